"""Whether the accelerometer's zero shifted at the shot, decided together with the force.

A piezoelectric accelerometer that was overloaded or strained may come back to another zero, at once or
slowly. A high-pass would take the recoil with it; instead the shapes that a shift may have become columns of
the regression, each with a coefficient of its own: a step at the onset of force, a kick there, which is what a step
leaves that came a little earlier or later, and a step that decays. They
enter only where the shot demands them: where they lower what is minimised by more than chance does
(Bayesian information criterion, G. Schwarz, Ann. Statist. 6(2), 1978, with the number of rows that carry errors of
their own, and a margin for the shapes that were tried). To the force alone a brake gauge that is off looks like
a shift; the camera, which saw the same motion, tells the two apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_identification.calibration import CRITICAL_VALUE, Calibration, calibrated_mass
from recoil_identification.mass import reverse_mass
from recoil_identification.row_noise import row_noise
from recoil_identification.sensor_priors import CAMERA_GAIN, CAMERA_SCALE, CAMERA_SHIFT, CameraScale
from recoil_processing.filters import LowPass
from recoil_processing.motion.scale_and_zero import ScaleAndZero, WhitenedTrack
from recoil_processing.shot.camera_motion import RecordedMotion
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty

Array = NDArray[np.float64]

TIME_CONSTANTS_S = (0.01, 0.02, 0.05, 0.1)
"""Of decays that are tried: shorter ones are part of the pulse, longer ones are steps over one recoil."""
LEAST_STEP_SIGMA = 4.0
"""Standard uncertainties that a step must have for a kick to be its own."""
BENT_M = 1e-4
"""By which the travel is bent to see what that does: it is linear."""
MARGIN = 10.0
"""By how much the criterion must fall: decisive in the words of Kass and Raftery (1995), J. Am. Stat. Assoc. 90."""


@dataclass(frozen=True)
class ZeroShift:
    """The shift of a zero at the shot.

    Attributes
    ----------
    step_m_s2, u_step_m_s2
        What stays; 0 where there is no such part.
    decaying_m_s2, u_decaying_m_s2
        What decays.
    time_constant_s
        Of the decay; infinite where there is none.
    kick_m_s, u_kick_m_s
        Velocity that the sensor gained falsely at the onset: the step's times its lateness, negative, or of an
        overload.
    criterion
        By how much the information criterion falls if the zero may shift; not demanded below `MARGIN`.
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
        """Whether the shot demands a shift."""
        return self.criterion > MARGIN

    def __str__(self) -> str:
        parts = []
        if self.u_step_m_s2:
            parts.append(f"by {self.step_m_s2:+.3g} m/s^2 (u {self.u_step_m_s2:.2g}) to stay")
        if self.u_decaying_m_s2:
            decay = f"by {self.decaying_m_s2:+.3g} m/s^2 (u {self.u_decaying_m_s2:.2g})"
            parts.append(f"{decay} that decay in {1e3 * self.time_constant_s:g} ms")
        if self.u_kick_m_s:
            parts.append(f"with a kick of {self.kick_m_s:+.2g} m/s (u {self.u_kick_m_s:.1g})")
        return " and ".join(parts) or "not at all"


_STEP, _KICK, _DECAYS = 0, 1, 2
"""Columns of step and kick, and the first of the decays, in the order of `TIME_CONSTANTS_S`."""
Shape = tuple[int, ...]
"""Columns in which the zero shifts: none, the step with or without a kick, a decay, or step and decay."""


def shift_columns(regression: Regression) -> Array:
    """Return step and kick at the onset and the decays from it, before any filter, shape (n, 6)."""
    since = regression.times_s - regression.interval_s[0]
    step = (since >= 0.0).astype(np.float64)
    decays = [step * np.exp(-np.maximum(since, 0.0) / tau) for tau in TIME_CONSTANTS_S]
    kick = np.zeros_like(step)
    kick[int(np.argmax(step > 0.0))] = 1.0 / regression.step_s
    return np.column_stack([step, kick, *decays])


def _scale(
    camera: RecordedMotion,
    found: ScaleAndZero,
    bent: Sequence[WhitenedTrack | None],
    shape: Shape,
    u_distortion_m: float,
) -> CameraScale:
    """Return what a solution for a shape says of the accelerometer, and what distortions of the picture add to it."""
    kick = shape.index(_KICK) if _KICK in shape else None
    zeros, by_distortion = np.append(found.bias_m_s2, found.shifts_m_s2), []
    for track in bent:
        other = None if track is None else track.solve(shape)
        if other is not None:
            moved = np.append(other.bias_m_s2, other.shifts_m_s2) - zeros
            by_distortion.append(np.append(other.gain - found.gain, moved) / BENT_M)
    columns = np.column_stack(by_distortion) if by_distortion else np.zeros((0, 0))
    return CameraScale(found.gain, zeros, found.covariance, camera.u_rel, kick, columns, u_distortion_m)


def calibrated_with_zero_shift(
    recorded: Regression,
    low_pass: LowPass,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    camera: CameraScale | None,
    filmed: RecordedMotion | None = None,
    quiet: BaselineNoise | None = None,
    u_distortion_m: float = 0.0,
) -> tuple[Regression, Regression, Calibration, ZeroShift]:
    """Estimate the mass with the sensors' errors, a shift of the zero among them where the shot demands one.

    Parameters
    ----------
    low_pass
        Which both sides and the shapes of a shift pass.
    scales, u_bias_m_s2, camera
        As of `calibrated_mass`, for a zero that does not shift.
    filmed
        Without it a shift is not to be told from a gauge that is off: see `ZeroShift.confirmed`.
    quiet
        Noise of the pre-trigger baseline; that of the rows themselves counts without it.
    u_distortion_m
        Standard uncertainty of what the camera's optics bend the travel by.

    Returns
    -------
    recorded : Regression
        With the columns of the shift, if there is one.
    filtered : Regression
        The same behind the low-pass.
    calibration : Calibration
    shift : ZeroShift

    Raises
    ------
    IdentificationError
        As of `calibrated_mass`.
    """
    plain = recorded.filtered(low_pass)
    first_kg = reverse_mass(plain, scales).mass_kg
    left_s = recorded.times_s[-1] - recorded.interval_s[0]
    decays = [_DECAYS + i for i, tau in enumerate(TIME_CONSTANTS_S) if tau < left_s]
    if not (math.isfinite(u_bias_m_s2) and decays):
        # without a baseline a zero that shifted is like one that was never known
        noise = row_noise(plain, first_kg, quiet)
        return recorded, plain, calibrated_mass(plain, scales, u_bias_m_s2, camera, noise=noise), ZeroShift()
    columns = shift_columns(recorded)
    film, bent = None, []
    if filmed is not None:
        film = filmed.motion.likeliest(columns, (_STEP, _KICK), filmed.densities)
    if filmed is not None and film is not None and u_distortion_m > 0:
        bent = [filmed.motion.bent(number, BENT_M).whitened(columns, film.density) for number in range(2)]
    full = plain.with_shifts(columns)
    filtered = np.zeros(columns.shape) if full.shifts is None else full.shifts
    # with every shape released: what a shift leaves unexplained must not excuse it
    noise = row_noise(full, first_kg, quiet)
    seen: dict[Shape, ScaleAndZero] = {}
    shapes: list[Shape] = [(), (_STEP,), *((j,) for j in decays), (_STEP, _KICK), *((_STEP, j) for j in decays)]
    if film is not None:
        seen = {shape: found for shape in shapes if (found := film.solve(shape)) is not None}
        if len(seen) < len(shapes):
            seen = {}

    def fitted(shape: Shape) -> Calibration:
        scale = _scale(filmed, seen[shape], bent, shape, u_distortion_m) if filmed is not None and seen else None
        regression = replace(plain, shifts=filtered[:, shape])
        return calibrated_mass(regression, scales, u_bias_m_s2, scale, noise=noise)

    unshifted = fitted(()) if seen else calibrated_mass(plain, scales, u_bias_m_s2, camera, noise=noise)
    criteria = {}
    for shape in shapes:
        fit = fitted(shape)
        if shape and any(
            abs(fit.normalised_residuals[s]) > CRITICAL_VALUE for s in fit.normalised_residuals if _by_camera(s)
        ):
            # a gauge that is a little off looks like a zero that decays with the pulse; the camera saw none
            continue
        if _KICK in shape and abs(fit.shifts_m_s2[0]) < LEAST_STEP_SIGMA * fit.u_shifts_m_s2[0]:
            # a kick without a step is the release, modelled as an instant, and no zero that shifted
            continue
        frames = seen[shape].misfit if seen else 0.0
        criteria[shape] = fit.inferred.misfit + frames + len(shape) * math.log(max(fit.estimate.rows, 2))
    chosen = min(criteria, key=lambda shape: criteria[shape])
    fall = criteria[()] - criteria[chosen]
    if fall <= MARGIN:
        return recorded, plain, unshifted, ZeroShift(criterion=max(fall, 0.0))
    calibration = fitted(chosen)
    shift = _described(chosen, calibration.shifts_m_s2, calibration.u_shifts_m_s2, fall)
    shifted = replace(recorded, shifts=columns[:, chosen])
    return shifted, replace(plain, shifts=filtered[:, chosen]), calibration, replace(shift, confirmed=bool(seen))


def _by_camera(source: str) -> bool:
    return source in (CAMERA_SCALE, CAMERA_GAIN) or source.startswith(CAMERA_SHIFT)


def _described(shape: Shape, sizes: Array, u: Array, fall: float) -> ZeroShift:
    stays, kicks = _STEP in shape, _KICK in shape
    tau = next((TIME_CONSTANTS_S[j - _DECAYS] for j in shape if j >= _DECAYS), None)
    return ZeroShift(
        step_m_s2=float(sizes[0]) if stays else 0.0,
        u_step_m_s2=float(u[0]) if stays else 0.0,
        decaying_m_s2=0.0 if tau is None else float(sizes[-1]),
        u_decaying_m_s2=0.0 if tau is None else float(u[-1]),
        time_constant_s=math.inf if tau is None else tau,
        kick_m_s=float(sizes[-1]) if kicks else 0.0,
        u_kick_m_s=float(u[-1]) if kicks else 0.0,
        criterion=fall,
    )
