"""The camera's clock from the motion itself: camera displacement against accelerometer.

The camera saw ``z_i = x(t_i) + n_i`` at frame times on its own clock; the accelerometer felt
``x''(t)`` on the recorder's. With ``D`` the double integral of the accelerometer's signal,

    z_i = k D((1 + gamma) t_i + tau) + c0 + c1 t_i + c2 t_i^2 / 2 + w_i + n_i,

where k is the ratio of the camera's scale to the accelerometer's, c0 to c2 are the integration
constants and the accelerometer's bias, n is the marker's white noise and w the double integral of
the accelerometer's white noise: a random walk of the velocity. A Kalman filter of w turns every
column of this linear model into independent rows (it whitens them), so that tau is found by
weighted least squares and its uncertainty is the likelihood's own curvature. The filter does not
depend on tau.

The model is the multi-rate displacement-acceleration filter of Smyth and Wu (2007), Mech. Syst.
Signal Process. 21(2), with the clock's offset as a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.correlation import CoarseLag, coarse_lag
from processing.double_integral import DoubleIntegral, integrate
from processing.motion_fit import MotionFit
from processing.motion_least_squares import MotionModel, MotionSolution, gauss_newton_step, profile
from processing.noise import noise_sigma
from processing.outliers import isolated_outliers, stuck_repeats

__all__ = ["INFLATIONS", "MotionFit", "align_motion", "integrate"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

INFLATIONS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Candidate factors on the accelerometer's noise density: ringing and mounting add to its white noise."""
LIKELIER = 2.0
"""By how much a further inflation must raise the log-likelihood: Akaike's criterion for one more parameter, doubled."""
LEAST_NOISE_M = 1e-9
"""Of a marker; no camera is better."""
UNKNOWN_DRIFT = 0.1
"""Prior of a drift of which nothing is known; a wrong frame rate hides in it."""
SEARCH_STEP_S = 5e-4
"""Of the coarse search."""
LEAST_FRAMES = 50
"""Below this the seven unknowns and two noise levels are not to be told from so few frames."""
LEAST_TRAVEL_SIGMA = 20.0
"""How many times its noise a marker must move."""
MOST_STEPS = 20
"""Of Gauss-Newton at one noise level; two or three are usual."""


def align_motion(
    camera_times_s: Array,
    displacement_m: Array,
    start_s: float,
    step_s: float,
    acceleration_m_s2: Array,
    *,
    acceleration_sigma_m_s2: float,
    drift_allowance: float,
) -> MotionFit | str:
    """Find the offset and drift between a camera's clock and an accelerometer's.

    Parameters
    ----------
    camera_times_s : ndarray, shape (n_frames,)
        On the camera's clock, strictly increasing.
    displacement_m : ndarray, shape (n_frames,)
        Lost frames NaN; they are left out, not filled.
    start_s, step_s : float
        Time base of the acceleration on the reference clock.
    acceleration_m_s2 : ndarray, shape (n_samples,)
        Second derivative of the same motion, positive alike, bias taken off as far as known; without
        missing samples.
    acceleration_sigma_m_s2 : float
        Its white noise per sample.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before this record is seen.

    Returns
    -------
    MotionFit or str
        A sentence where there is no motion to align by.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, the acceleration is not finite, or its noise or step
        is not positive.
    """
    _check(camera_times_s, displacement_m, step_s, acceleration_m_s2, acceleration_sigma_m_s2)
    seen = np.isfinite(displacement_m)
    t, z = camera_times_s[seen], displacement_m[seen]
    if t.size < LEAST_FRAMES:
        return f"only {t.size} frames have a position"
    marker_sigma = _marker_sigma(displacement_m)
    if acceleration_m_s2.size < 2:
        return f"only {acceleration_m_s2.size} samples of the acceleration are there"
    if np.ptp(z) < LEAST_TRAVEL_SIGMA * marker_sigma:
        return f"the track does not move: it spans {1e3 * np.ptp(z):.3g} mm at {1e3 * marker_sigma:.2g} mm noise"
    model = MotionModel(t, z, 0.5 * float(t[0] + t[-1]), DoubleIntegral.of(acceleration_m_s2, start_s, step_s))
    lag = coarse_lag(*_camera_velocity(t, z), start_s, step_s, model.integral.velocity, step_of_search_s=SEARCH_STEP_S)
    if isinstance(lag, str):
        return lag
    densities = [inflation * acceleration_sigma_m_s2**2 * step_s for inflation in INFLATIONS]
    first = _converge(model, lag.offset_s, 0.0, marker_sigma**2, densities[0], drift_allowance)
    if isinstance(first, str):
        return first
    odd = _contradicting(model, first, marker_sigma)
    model = replace(model, times_s=t[~odd], positions_m=z[~odd])
    best = _likeliest(model, first, marker_sigma**2, densities, drift_allowance)
    if isinstance(best, str):
        return best
    free = _likeliest(model, best[0], marker_sigma**2, densities, UNKNOWN_DRIFT)
    if isinstance(free, str):
        return free
    return _report(model, *best, free[0], lag, marker_sigma, int(odd.sum()))


def _check(times_s: Array, positions: Array, step_s: float, acceleration: Array, sigma: float) -> None:
    if times_s.ndim != 1 or times_s.shape != positions.shape:
        raise ValueError(f"camera times and displacements must be equally many, not {times_s.shape}, {positions.shape}")
    if not np.all(np.diff(times_s) > 0):
        raise ValueError("camera_times_s must increase strictly")
    if not np.all(np.isfinite(acceleration)):
        raise ValueError("acceleration_m_s2 must be finite; bridge lost samples first")
    for name, value in (("step_s", step_s), ("acceleration_sigma_m_s2", sigma)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive, not {value}")


def _marker_sigma(displacement_m: Array) -> float:
    """Noise of a marker; positions that software held instead of measuring tell nothing of it."""
    held = np.zeros(displacement_m.shape, dtype=bool)
    held[1:-1] = (displacement_m[1:-1] == displacement_m[:-2]) & (displacement_m[1:-1] == displacement_m[2:])
    sigma = noise_sigma(np.where(held, np.nan, displacement_m))
    if not math.isfinite(sigma):
        # never four frames in a row: the differences then reach over the lost ones
        sigma = noise_sigma(displacement_m[np.isfinite(displacement_m)])
    return max(sigma, LEAST_NOISE_M)


def _converge(
    model: MotionModel, shift_s: float, drift: float, marker_variance: float, density: float, drift_allowance: float
) -> MotionSolution | str:
    """Gauss-Newton at one noise level of the accelerometer."""
    steps, last_s, previous = 0, 0.0, None
    while True:
        frames = np.count_nonzero(model.integral.covers(model.mapped_s(shift_s, drift)))
        if frames < LEAST_FRAMES:
            return f"only {frames} frames fall into the recorder's record"
        solution = gauss_newton_step(
            model,
            shift_s,
            drift,
            marker_variance=marker_variance,
            density=density,
            drift_allowance=drift_allowance,
            previous=previous,
        )
        if solution is None:
            return "the motion that both records show cannot be told from an error of zero or velocity"
        steps += 1
        if solution.converged or steps == MOST_STEPS:
            return solution
        step_s = solution.shift_s - shift_s
        # a step that takes back most of the one before has gone too far, as that one did
        share = 0.5 if step_s * last_s < 0 and abs(step_s) > 0.5 * abs(last_s) else 1.0
        shift_s, drift = shift_s + share * step_s, drift + share * (solution.drift - drift)
        last_s, previous = share * step_s, solution


def _contradicting(model: MotionModel, solution: MotionSolution, marker_sigma: float) -> Flags:
    """Find the frames that contradict their neighbours, given the accelerometer, shape (n_frames,)."""
    travel, _ = model.integral.at(model.mapped_s(solution.shift_s, solution.drift)[solution.inside])
    times, positions = model.times_s[solution.inside], model.positions_m[solution.inside]
    residual = positions - solution.gain * travel
    stuck = stuck_repeats(positions, residual, marker_sigma)
    spikes = isolated_outliers(times[~stuck], residual[~stuck], marker_sigma)
    odd = np.zeros(model.times_s.shape, dtype=bool)
    inside = np.flatnonzero(solution.inside)
    odd[inside[stuck]] = True
    odd[inside[~stuck][spikes]] = True
    return odd


def _likeliest(
    model: MotionModel,
    start: MotionSolution,
    marker_variance: float,
    densities: Sequence[float],
    drift_allowance: float,
) -> tuple[MotionSolution, float] | str:
    """Solve at rising noise densities of the accelerometer until the likelihood rises no more; with the density."""
    best: tuple[MotionSolution, float] | None = None
    shift, drift = start.shift_s, start.drift
    for density in densities:
        found = _converge(model, shift, drift, marker_variance, density, drift_allowance)
        if isinstance(found, str):
            return found
        if best is not None and found.log_likelihood <= best[0].log_likelihood + LIKELIER:
            break
        best = found, density
        shift, drift = found.shift_s, found.drift
    if best is None:
        raise ValueError("there must be a noise density to try")
    return best


def _report(
    model: MotionModel,
    solution: MotionSolution,
    density: float,
    free: MotionSolution,
    lag: CoarseLag,
    marker_sigma: float,
    frames_set_aside: int,
) -> MotionFit:
    """Give the fit on the clocks' own terms, with the likelihood around the offset."""
    _, velocity = model.integral.at(model.mapped_s(solution.shift_s, solution.drift)[solution.inside])
    since = model.times_s[solution.inside] - model.origin_s
    u_offset = solution.u_mapped_s(float(np.average(since, weights=velocity**2)))
    offset = solution.shift_s - solution.drift * model.origin_s
    around = np.linspace(-1.0, 1.0, 41) * max(8 * u_offset, 2e-4)
    curve = profile(model, solution, around)
    u_gain, u_bias = (math.sqrt(solution.covariance[i, i]) for i in (0, 5))
    return MotionFit(
        offset_s=offset,
        drift=solution.drift,
        u_offset_s=u_offset,
        u_drift=math.sqrt(solution.covariance[2, 2]),
        gain=solution.gain,
        u_gain=u_gain,
        u_bias_m_s2=u_bias,
        gain_bias_correlation=float(solution.covariance[0, 5] / (u_gain * u_bias)),
        integration_constants=solution.constants,
        origin_s=model.origin_s,
        marker_sigma_m=marker_sigma,
        acceleration_density=density,
        innovation_statistic=solution.innovation_statistic,
        coarse_offset_s=lag.offset_s,
        correlation=lag.correlation,
        second_peak=lag.second_peak,
        at_search_edge=lag.at_search_edge,
        candidates_s=offset + around,
        log_likelihood=curve - curve.max(),
        free_drift=free.drift,
        u_free_drift=math.sqrt(free.covariance[2, 2]),
        frames=int(np.count_nonzero(solution.inside)),
        frames_set_aside=frames_set_aside,
        converged=solution.converged,
    )


def _camera_velocity(times_s: Array, displacement_m: Array) -> tuple[Array, Array]:
    """Velocity over spans of about 4 ms, at their middles: coarse, but free of the frame noise."""
    span = max(1, round(4e-3 / float(np.median(np.diff(times_s)))))
    dt = times_s[span:] - times_s[:-span]
    velocity = (displacement_m[span:] - displacement_m[:-span]) / dt
    return 0.5 * (times_s[span:] + times_s[:-span]), velocity
