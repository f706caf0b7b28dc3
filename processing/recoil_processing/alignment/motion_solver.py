"""From a rough offset to the likeliest one: Gauss-Newton at rising noise levels of the accelerometer.

The model stands in `recoil_processing.alignment.motion_alignment`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.alignment.motion_least_squares import MotionModel, MotionSolution, gauss_newton_step

LIKELIER = 2.0
"""Log-likelihood that a further density must gain: Akaike's criterion for one more parameter, doubled."""
LEAST_FRAMES = 50
"""Number of frames below which the seven unknowns and two noise levels are not identifiable."""
MOST_STEPS = 20
"""Steps of Gauss-Newton at one noise level; two or three are usual."""


@dataclass(frozen=True, eq=False)
class MotionSolver:
    """Terms that are known before the offset is looked for.

    Attributes
    ----------
    marker_variance
        Variance of the camera's white noise, m^2.
    densities
        Candidates, rising, for the noise density of the accelerometer, (m/s^2)^2/Hz, two-sided; at least one.
    """

    marker_variance: float
    densities: Sequence[float]
    _filtered: dict[float, tuple[Array, MotionSolution]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.densities:
            raise ValueError("there must be a noise density to try")

    def step(
        self, model: MotionModel, shift_s: float, drift: float, density: float, drift_allowance: float
    ) -> MotionSolution | None:
        """Improve a shift and a drift once; None where the columns are not independent."""
        # a filter depends on the instants and the density alone, and takes most of the time
        times, previous = self._filtered.get(density, (None, None))
        solution = gauss_newton_step(
            model,
            shift_s,
            drift,
            marker_variance=self.marker_variance,
            density=density,
            drift_allowance=drift_allowance,
            previous=previous if times is model.times_s else None,
        )
        if solution is not None:
            self._filtered[density] = model.times_s, solution
        return solution

    def converge(
        self, model: MotionModel, shift_s: float, drift: float, density: float, drift_allowance: float
    ) -> MotionSolution | str:
        """Repeat steps at one density until they are negligible; a sentence where there is nothing to go by."""
        steps, last_s = 0, 0.0
        while True:
            frames = np.count_nonzero(model.integral.covers(model.mapped_s(shift_s, drift)))
            if frames < LEAST_FRAMES:
                return f"only {frames} frames fall into the recorder's record"
            solution = self.step(model, shift_s, drift, density, drift_allowance)
            if solution is None:
                return "the motion that both records show cannot be distinguished from an error of zero or velocity"
            steps += 1
            if solution.converged or steps == MOST_STEPS:
                return solution
            step_s = solution.shift_s - shift_s
            # a step that takes back most of the one before has gone too far, as that one did
            share = 0.5 if step_s * last_s < 0 and abs(step_s) > 0.5 * abs(last_s) else 1.0
            shift_s, drift = shift_s + share * step_s, drift + share * (solution.drift - drift)
            last_s = share * step_s

    def likeliest(
        self, model: MotionModel, shift_s: float, drift: float, drift_allowance: float
    ) -> tuple[MotionSolution, float] | str:
        """Converge at rising densities until the likelihood rises no more; with the density, or a sentence."""
        best: tuple[MotionSolution, float] | None = None
        for density in self.densities:
            found = self.converge(model, shift_s, drift, density, drift_allowance)
            if isinstance(found, str):
                return found
            if best is not None and found.log_likelihood <= best[0].log_likelihood + LIKELIER:
                break
            best = found, density
            shift_s, drift = found.shift_s, found.drift
        if best is None:
            raise ValueError("there must be a noise density to try")
        return best
