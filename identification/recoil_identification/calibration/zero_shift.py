"""Shift of the accelerometer's zero at the shot, decided together with the force.

A piezoelectric accelerometer that was overloaded or strained may come back to another zero, at once or
slowly. A high-pass would take the recoil with it; instead the shapes that a shift may have become columns of
the regression, each with a coefficient of its own: a step at the onset of force, a kick there, which is what a step
leaves that came a little earlier or later, and a step that decays. They
enter only where the shot demands them: where they would lower what is minimised by more than chance does
(Bayesian information criterion, G. Schwarz, Ann. Statist. 6(2), 1978, with the number of rows that carry errors of
their own, and a margin for the shapes that were tried), and by more than any other sensor that is off. By how much is
told by what is left without them. To the force alone a brake gauge that is off looks like a shift; the camera, which
saw the same motion, tells the two apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.measured import Worded, joined, measured, worded
from recoil_acquisition.numerics.arrays import Array
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.solution import with_shifts
from recoil_identification.estimate.mass import ACCELERATION
from recoil_identification.inference.score import Scores
from recoil_identification.rows.camera_rows import OTHER_ZERO, CameraRows
from recoil_identification.rows.equation_of_motion import shift
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE, ZERO
from recoil_processing.shot.regression import Regression

TIME_CONSTANTS_S = (0.01, 0.02, 0.05, 0.1)
"""Time constants of decays that are tried: shorter ones are part of the pulse, longer ones are steps over one
recoil."""
LEAST_STEP_SIGMA = 4.0
"""Standard uncertainties that a step must have for a kick to be its own."""
ALIKE = 0.95
"""Share of the largest normalised residual of another sensor above which a shift explains the shot as well."""
MARGIN = 10.0
"""Amount by which the criterion must fall: decisive in the words of Kass and Raftery (1995), J. Am. Stat. Assoc. 90."""
_STEP, _KICK, _DECAYS = 0, 1, 2
"""Columns of step and kick, and the first of the decays, in the order of `TIME_CONSTANTS_S`."""
Shape = tuple[int, ...]
"""Columns in which the zero shifts: none, the step with or without a kick, a decay, or step and decay."""


@dataclass(frozen=True)
class ZeroShift:
    """The shift of a zero at the shot.

    Attributes
    ----------
    step_m_s2, u_step_m_s2
        Part of the shift that stays, and its standard uncertainty; 0 where there is no such part.
    decaying_m_s2, u_decaying_m_s2
        Part of the shift that decays, and its standard uncertainty.
    time_constant_s
        Time constant of the decay; infinite where there is none.
    kick_m_s, u_kick_m_s
        Velocity that the sensor gained falsely at the onset: the step's times its lateness, negative, or of an
        overload.
    criterion
        Fall of the information criterion if the zero may shift; not demanded below `MARGIN`.
    confirmed
        Whether a camera had its say: gauges that are off may look like a shift to the force alone.
    """

    step_m_s2: float = 0.0
    u_step_m_s2: float = 0.0
    decaying_m_s2: float = 0.0
    u_decaying_m_s2: float = 0.0
    time_constant_s: float = math.inf
    kick_m_s: float = 0.0
    u_kick_m_s: float = 0.0
    criterion: float = 0.0
    confirmed: bool = False

    @property
    def demanded(self) -> bool:
        """True if the shot demands a shift."""
        return self.criterion > MARGIN

    def as_found(self, shape: Shape, calibration: Calibration) -> ZeroShift:
        """Take over the parts that a calibration found of a shape."""
        sizes, u = calibration.shifts_m_s2.tolist(), calibration.u_shifts_m_s2.tolist()
        stays, kicks = _STEP in shape, _KICK in shape
        tau = next((TIME_CONSTANTS_S[j - _DECAYS] for j in shape if j >= _DECAYS), None)
        return replace(
            self,
            step_m_s2=sizes[0] if stays else 0.0,
            u_step_m_s2=u[0] if stays else 0.0,
            decaying_m_s2=0.0 if tau is None else sizes[-1],
            u_decaying_m_s2=0.0 if tau is None else u[-1],
            time_constant_s=math.inf if tau is None else tau,
            kick_m_s=sizes[-1] if kicks else 0.0,
            u_kick_m_s=u[-1] if kicks else 0.0,
        )

    @property
    def told(self) -> Worded:
        """By how much it shifted, in words."""
        parts = list[str]()
        for opened, size, u, unit, forms, closed in (
            ("by ", self.step_m_s2, self.u_step_m_s2, "m/s^2", ("+.3g", ".2g"), ") to stay"),
            ("by ", self.decaying_m_s2, self.u_decaying_m_s2, "m/s^2", ("+.3g", ".2g"),
             f") that decay in {1e3 * self.time_constant_s:g} ms"),
            ("with a kick of ", self.kick_m_s, self.u_kick_m_s, "m/s", ("+.2g", ".1g"), ")"),
        ):  # fmt: skip
            if u:
                parts.append(
                    worded(opened, measured(size, unit, forms[0]), " (u ", measured(u, unit, forms[1]), closed)
                )
        return joined(" and ", parts or ["not at all"])

    def __str__(self) -> str:
        return str(self.told)


def shift_columns(regression: Regression) -> Array:
    """Return step and kick at the onset and the decays from it, before any filter, shape (n, 6)."""
    since = regression.times_s - regression.interval_s[0]
    step = (since >= 0.0).astype(np.float64)
    decays = [step * np.exp(-np.maximum(since, 0.0) / tau) for tau in TIME_CONSTANTS_S]
    kick = np.zeros_like(step)
    kick[int(np.argmax(step > 0.0))] = 1.0 / regression.step_s
    return np.column_stack([step, kick, *decays])


def with_zero_shift(
    calibration: Calibration, full: Regression, camera: CameraRows | None
) -> tuple[Shape, Calibration, ZeroShift]:
    """Let the accelerometer's zero shift where the shot demands it, and estimate the mass anew.

    Parameters
    ----------
    calibration
        Calibration by rows and frames without a shift. A zero that was not known before the shot is not judged.
    full
        The same rows' regression, with every shape of `shift_columns` behind its filter.
    camera
        Rows of its frames, with all shapes as well. Without them a shift is not to be told from a gauge that is off:
        see `ZeroShift.confirmed`.

    Returns
    -------
    shape : tuple of int
        Columns of `shift_columns` in which it shifts; empty for none.
    calibration : Calibration
    shift : ZeroShift
    """
    known = any(ZERO in prior.sources for prior in calibration.own)
    decays = _decays(full)
    if full.shifts is None or not (known and decays):
        return (), calibration, ZeroShift()
    singles: list[Shape] = [(_STEP,), *((j,) for j in decays)]
    shapes = [*singles, (_STEP, _KICK), *((_STEP, j) for j in decays)]
    per_shape = math.log(max(calibration.estimate.rows, 2))
    scores = _scores(calibration, full, camera)
    at_best = max(scores.fall(shape) - len(shape) * per_shape for shape in shapes)
    if at_best <= MARGIN or math.sqrt(at_best) < ALIKE * _largest_of_others(calibration):
        return (), calibration, ZeroShift(criterion=min(max(at_best, 0.0), MARGIN))
    # far from where nothing shifts the scores are no more than a hint
    criteria: dict[Shape, tuple[float, Calibration]] = {}
    for shape in shapes:
        found = with_shifts(calibration, full.shifts[:, shape], None if camera is None else camera.with_shifts(shape))
        if _KICK in shape and abs(found.shifts_m_s2[0]) < LEAST_STEP_SIGMA * found.u_shifts_m_s2[0]:
            # a kick without a step is the release, modelled as an instant, and no zero that shifted
            continue
        criteria[shape] = found.inferred.misfit + len(shape) * per_shape, found
    chosen = min(criteria, key=lambda shape: criteria[shape][0])
    fall, found = calibration.inferred.misfit - criteria[chosen][0], criteria[chosen][1]
    if fall <= MARGIN:
        return (), calibration, ZeroShift(criterion=max(fall, 0.0))
    return chosen, found, ZeroShift(criterion=fall, confirmed=camera is not None).as_found(chosen, found)


def can_be_told(regression: Regression, u_zero_m_s2: float) -> bool:
    """Return whether a shift can be told: without a baseline it is like a zero that was never known."""
    return math.isfinite(u_zero_m_s2) and bool(_decays(regression))


def _decays(regression: Regression) -> list[int]:
    """Return the columns of the decays that are shorter than what is left of the record."""
    left_s = regression.times_s[-1] - regression.interval_s[0]
    return [_DECAYS + i for i, tau in enumerate(TIME_CONSTANTS_S) if tau < left_s]


def _scores(calibration: Calibration, full: Regression, camera: CameraRows | None) -> Scores:
    """Score every shape of a shift by what a zero that does not shift leaves of rows and frames."""
    block = replace(calibration.block, regression=full)
    parts = (block,) if camera is None else (block, camera)
    sizes = [shift(i).name for i in range(_DECAYS + len(TIME_CONSTANTS_S))]
    joint = replace(calibration.rows, parts=parts)
    _, derivatives = joint.linearised(calibration.values | dict.fromkeys(sizes, 0.0))
    return calibration.scores(derivatives[:, [joint.unknowns.index(name) for name in sizes]])


def _largest_of_others(calibration: Calibration) -> float:
    """Return the largest normalised residual that has another name: a gauge that is off looks like a decaying zero."""
    own = (ZERO, ACCELERATION, CAMERA_SCALE, RELEASE, OTHER_ZERO.name)
    return max((abs(w) for source, w in calibration.normalised_residuals.items() if source not in own), default=0.0)
