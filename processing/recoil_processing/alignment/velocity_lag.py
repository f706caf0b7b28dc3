"""The clock's offset by velocities alone: the plain estimate that the likelihood's is checked against.

Mean velocities over spans of frames, ``(z_j - z_i) / (t_j - t_i)``, are fitted by those of the
accelerometer's double integral, ``k (D(t_j + tau) - D(t_i + tau)) / (t_j - t_i) + a + b t``, all with the
same weight: the least-squares form of a velocity correlation with a maximum between samples. It is not the
best estimate, but it leans on other parts of the record than the likelihood does, and where the model
holds, the two agree within their uncertainties. Its uncertainty is not the residual's: the weights that the
fit gives to the marker's noise and to the accelerometer's are known, and so are the two noise levels.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_processing.alignment.motion_least_squares import LONGEST_STEP_S, MotionModel

Array = NDArray[np.float64]

SPAN_S = 4e-3
"""Over which velocities are taken: coarse, but free of the frame noise."""
MOST_STEPS = 10
NEGLIGIBLE_STEP_S = 1e-8


def span_frames(times_s: Array) -> int:
    """Return how many frames apart two positions are taken for a velocity."""
    return max(1, round(SPAN_S / float(np.median(np.diff(times_s)))))


def camera_velocity(times_s: Array, positions_m: Array) -> tuple[Array, Array]:
    """Velocities over spans of about `SPAN_S`, at their middles; shape (n_frames - span,) each."""
    span = span_frames(times_s)
    dt = times_s[span:] - times_s[:-span]
    velocity = (positions_m[span:] - positions_m[:-span]) / dt
    return 0.5 * (times_s[span:] + times_s[:-span]), velocity


def mean_accelerations(model: MotionModel, span_s: float) -> tuple[tuple[Array, Array], Array]:
    """Mean accelerations over a span: what a zero that shifts is small against, where a velocity is not.

    Returns
    -------
    (times_s, camera), reference : tuple of ndarray, ndarray
        By the camera at the middles of the spans, on its clock, shape (n_frames - span,) each; and by the
        accelerometer at its own samples, shape (n_samples,), those at its ends over shorter spans.
    """
    times, velocity = camera_velocity(model.times_s, model.positions_m)
    half = 0.5 * span_s
    inner = times[(times >= times[0] + half) & (times <= times[-1] - half)]
    camera = (np.interp(inner + half, times, velocity) - np.interp(inner - half, times, velocity)) / span_s
    integral = model.integral
    own = integral.start_s + integral.step_s * np.arange(integral.velocity.size)
    felt = (np.interp(own + half, own, integral.velocity) - np.interp(own - half, own, integral.velocity)) / span_s
    return (inner, camera), felt


def velocity_shift(
    model: MotionModel,
    shift_s: float,
    drift: float,
    *,
    marker_variance: float,
    density: float,
    u_drift: float,
    since_s: float,
) -> tuple[float, float]:
    """Estimate the shift by velocities, the drift held.

    Parameters
    ----------
    shift_s, drift
        To start from; the drift is held.
    marker_variance
        Of the camera's white noise, m^2.
    density
        Of the accelerometer's white noise, (m/s^2)^2/Hz, two-sided.
    u_drift
        Standard uncertainty of the drift.
    since_s
        Camera time from the model's origin at which the mapped time's uncertainty is asked for.

    Returns
    -------
    shift_s, u_s : float
        Shift and standard uncertainty of the mapped time there; NaN and infinity where it is not identifiable.
    """
    span = span_frames(model.times_s)
    inside = model.integral.covers(model.mapped_s(shift_s, drift))
    times, positions = model.times_s[inside], model.positions_m[inside]
    if times.size < span + 8:
        return math.nan, math.inf
    dt = times[span:] - times[:-span]
    seen = (positions[span:] - positions[:-span]) / dt
    since = 0.5 * (times[span:] + times[:-span]) - model.origin_s
    mapped = model.mapped_s(0.0, drift)[inside]
    for _ in range(MOST_STEPS):
        travel, velocity = model.integral.at(mapped + shift_s)
        felt, rise = (travel[span:] - travel[:-span]) / dt, (velocity[span:] - velocity[:-span]) / dt
        errors = [(error[span:] - error[:-span]) / dt for error in model.errors(mapped + shift_s)]
        columns = np.column_stack([felt, rise, np.ones_like(since), since, *errors])
        scale = np.sqrt((columns**2).sum(axis=0))
        if not np.all(scale > 0):
            return math.nan, math.inf
        weights = np.linalg.pinv(columns / scale) / scale[:, None]
        gain, step = float(weights[0] @ seen), float(weights[1] @ seen)
        if gain == 0.0:
            return math.nan, math.inf
        step = float(np.clip(step / gain, -LONGEST_STEP_S, LONGEST_STEP_S))
        shift_s += step
        if abs(step) < NEGLIGIBLE_STEP_S:
            break
    else:
        return math.nan, math.inf
    on_shift = weights[1] / gain
    on_frames = np.zeros_like(times)
    on_frames[span:] += on_shift / dt
    on_frames[:-span] -= on_shift / dt
    by_drift = float(on_shift @ (gain * rise * since)) - since_s
    variance = marker_variance * float(on_frames @ on_frames) + density * _walk_energy(times, on_frames)
    return shift_s, math.sqrt(variance + (by_drift * u_drift) ** 2)


def _walk_energy(times_s: Array, weights: Array) -> float:
    """Variance of a weighted sum of the double integral of white noise of density 1.

    The noise at s reaches it by the sum of ``w_i (t_i - s)`` over later instants, which is a straight line
    between instants; its square is integrated exactly.
    """
    steps = np.diff(times_s)
    later = np.append(np.cumsum(weights[::-1])[::-1], 0.0)[1:-1]
    reach = np.append(np.cumsum((later * steps)[::-1])[::-1], 0.0)
    return float(np.sum(steps * (reach[:-1] ** 2 + reach[:-1] * reach[1:] + reach[1:] ** 2)) / 3.0)
