"""Whether the accelerometer's zero shifted at the shot, decided together with the force.

A piezoelectric accelerometer that was overloaded or strained may come back to another zero, at once or
slowly. A high-pass would take the recoil with it; instead the shapes that a shift may have become columns of
the regression, each with a coefficient of its own: a step at the release, and one that decays. They
enter only where the shot demands them: where they lower what is minimised by more than chance does
(Bayesian information criterion, G. Schwarz, Ann. Statist. 6(2), 1978, with the number of rows that carry errors of
their own, and a margin for the shapes that were tried). To the force alone a brake gauge that is off looks like
a shift; the camera, which saw the same motion, tells the two apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.calibration import Calibration, CameraScale, calibrated_mass
from identification.mass import ScaleUncertainty
from identification.regression import Regression
from processing.filters import LowPass
from processing.scale_and_zero import FilmedMotion, ScaleAndZero

Array = NDArray[np.float64]

TIME_CONSTANTS_S = (0.01, 0.02, 0.05, 0.1)
"""Of decays that are tried: shorter ones are part of the pulse, longer ones are steps over one recoil."""
LEAST_NOISE = 2e-4
"""Of the rows, share of the acceleration's peak: a shift that is smaller does not matter to the mass."""
MARGIN = 10.0
"""By how much the criterion must fall: decisive in the words of Kass and Raftery (1995), J. Am. Stat. Assoc. 90."""


@dataclass(frozen=True)
class ZeroShift:
    """The shift of a zero at the shot.

    Attributes
    ----------
    step_m_s2, u_step_m_s2 : float
        What stays; 0 where there is no such part.
    decaying_m_s2, u_decaying_m_s2 : float
        What decays.
    time_constant_s : float
        Of the decay; infinite where there is none.
    criterion : float
        By how much the information criterion falls if the zero may shift; not demanded below `MARGIN`.
    confirmed : bool
        Whether a camera had its say: gauges that are off may look like a shift to the force alone.
    """

    step_m_s2: float = 0.0
    u_step_m_s2: float = 0.0
    decaying_m_s2: float = 0.0
    u_decaying_m_s2: float = 0.0
    time_constant_s: float = math.inf
    criterion: float = 0.0
    confirmed: bool = False

    @property
    def demanded(self) -> bool:
        """Whether the shot demands a shift."""
        return self.criterion > MARGIN

    def __str__(self) -> str:
        parts = []
        if self.u_step_m_s2:
            parts.append(f"by {self.step_m_s2:+.3g} m/s^2 (u {self.u_step_m_s2:.2g}) to stay")
        if self.u_decaying_m_s2:
            decay = f"by {self.decaying_m_s2:+.3g} m/s^2 (u {self.u_decaying_m_s2:.2g})"
            parts.append(f"{decay} that decay in {1e3 * self.time_constant_s:g} ms")
        return " and ".join(parts) or "not at all"


@dataclass(frozen=True)
class _Shape:
    """Columns of one way to shift: a step or not, a decay or not."""

    step: bool
    time_constant_s: float | None

    @property
    def size(self) -> int:
        return self.step + (self.time_constant_s is not None)

    def columns(self, regression: Regression) -> Array:
        """Return the columns before the filter, shape (n, size)."""
        since = regression.times_s - regression.times_s[int(np.argmax(regression.released > 0.5))]
        columns = [regression.released] if self.step else []
        if self.time_constant_s is not None:
            columns.append(regression.released * np.exp(-np.maximum(since, 0.0) / self.time_constant_s))
        return np.column_stack([np.zeros((regression.times_s.size, 0)), *columns])


NO_SHIFT = _Shape(step=False, time_constant_s=None)


@dataclass(frozen=True, eq=False)
class Filmed:
    """What a camera adds to the decision.

    Attributes
    ----------
    motion : FilmedMotion
        On the grid of the regression.
    densities : tuple of float
        Of the accelerometer's noise that are tried, (m/s^2)^2/Hz, two-sided.
    u_rel : float
        Relative standard uncertainty of the camera's own scale.
    """

    motion: FilmedMotion
    densities: tuple[float, ...]
    u_rel: float

    def scale(self, found: ScaleAndZero) -> CameraScale:
        """Return what a solution says of the accelerometer."""
        return CameraScale(found.gain, np.append(found.bias_m_s2, found.shifts_m_s2), found.covariance, self.u_rel)


def calibrated_with_zero_shift(
    recorded: Regression,
    low_pass: LowPass,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    camera: CameraScale | None,
    filmed: Filmed | None = None,
) -> tuple[Regression, Calibration, ZeroShift]:
    """Estimate the mass with the sensors' errors, a shift of the zero among them where the shot demands one.

    Parameters
    ----------
    recorded : Regression
    low_pass : LowPass
        Which both sides and the shapes of a shift pass.
    scales, u_bias_m_s2, camera
        As of `calibrated_mass`, for a zero that does not shift.
    filmed : Filmed, optional
        Without it a shift is not to be told from a gauge that is off: see `ZeroShift.confirmed`.

    Returns
    -------
    filtered : Regression
        With the columns of the shift, if there is one.
    calibration : Calibration
    shift : ZeroShift

    Raises
    ------
    IdentificationError
        As of `calibrated_mass`.
    """
    plain = recorded.filtered(low_pass)
    unshifted = calibrated_mass(plain, scales, u_bias_m_s2, camera)
    decays = [tau for tau in TIME_CONSTANTS_S if tau < recorded.times_s[-1] - recorded.interval_s[0]]
    if not (math.isfinite(u_bias_m_s2) and decays):
        # without a silence a zero that shifted is like one that was never known
        return plain, unshifted, ZeroShift()
    fullest = [_Shape(step=True, time_constant_s=tau) for tau in decays]
    shapes = [NO_SHIFT, _Shape(step=True, time_constant_s=None)]
    shapes += [_Shape(step=False, time_constant_s=tau) for tau in decays]
    regressions, films = {}, {}
    density = None
    for shape in [*fullest, *shapes]:
        columns = shape.columns(recorded)
        regressions[shape] = replace(plain, shifts=_filtered(columns, low_pass, recorded.rate_hz))
        if filmed is not None:
            if density is None and (best := filmed.motion.likeliest(columns, filmed.densities)) is not None:
                density = best.density
            film = None if density is None else filmed.motion.solve(columns, density)
            if film is None:
                return calibrated_with_zero_shift(recorded, low_pass, scales, u_bias_m_s2, camera)
            films[shape] = film
    # the noise is that of the fullest shape: what a shift leaves unexplained must not excuse it
    least = LEAST_NOISE * float(np.max(np.abs(plain.acceleration_m_s2[plain.used])))
    noise = max(
        min(_calibrated(regressions[s], scales, u_bias_m_s2, s, filmed, films).noise_m_s2 for s in fullest), least
    )
    criteria = {}
    for shape, regression in regressions.items():
        fit = _calibrated(regression, scales, u_bias_m_s2, shape, filmed, films, noise)
        frames = films[shape].misfit if shape in films else 0.0
        criteria[shape] = fit.misfit + frames + shape.size * math.log(max(fit.estimate.rows, 2))
    chosen = min(criteria, key=lambda shape: criteria[shape])
    fall = criteria[NO_SHIFT] - criteria[chosen]
    if fall <= MARGIN:
        return plain, unshifted, ZeroShift(criterion=max(fall, 0.0))
    calibration = _calibrated(regressions[chosen], scales, u_bias_m_s2, chosen, filmed, films)
    shift = _described(chosen, calibration.shifts_m_s2, calibration.u_shifts_m_s2, fall)
    return regressions[chosen], calibration, replace(shift, confirmed=filmed is not None)


def _filtered(columns: Array, low_pass: LowPass, rate_hz: float) -> Array:
    return np.column_stack([np.zeros((len(columns), 0)), *(low_pass.apply(c, rate_hz) for c in columns.T)])


def _calibrated(
    regression: Regression,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    shape: _Shape,
    filmed: Filmed | None,
    films: Mapping[_Shape, ScaleAndZero],
    noise_m_s2: float | None = None,
) -> Calibration:
    camera = None if filmed is None else filmed.scale(films[shape])
    return calibrated_mass(regression, scales, u_bias_m_s2, camera, noise_m_s2=noise_m_s2)


def _described(shape: _Shape, sizes: Sequence[float] | Array, u: Sequence[float] | Array, fall: float) -> ZeroShift:
    decays = shape.time_constant_s is not None
    return ZeroShift(
        step_m_s2=float(sizes[0]) if shape.step else 0.0,
        u_step_m_s2=float(u[0]) if shape.step else 0.0,
        decaying_m_s2=float(sizes[-1]) if decays else 0.0,
        u_decaying_m_s2=float(u[-1]) if decays else 0.0,
        time_constant_s=math.inf if shape.time_constant_s is None else shape.time_constant_s,
        criterion=fall,
    )
