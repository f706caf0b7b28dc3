"""Camera's clock from the motion itself: camera displacement against accelerometer.

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

The offset is checked against a plain estimate by velocities alone. Mean velocities over spans of frames,
``(z_j - z_i) / (t_j - t_i)``, are fitted by those of the accelerometer's double integral,
``k (D(t_j + tau) - D(t_i + tau)) / (t_j - t_i) + a + b t``, all with the same weight: the least-squares form of a
velocity correlation with a maximum between samples. It is not the best estimate, but it leans on other parts of the
record than the likelihood does, and where the model holds, the two agree within their uncertainties. Its uncertainty
is not the residual's: the weights that the fit gives to the marker's noise and to the accelerometer's are known, and so
are the two noise levels.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from recoil_acquisition.clocks.timebase import usual_step_s
from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.alignment.correlation import CoarseLag, coarse_lag
from recoil_processing.alignment.dropped_frames import find_frame_faults
from recoil_processing.alignment.frame_fault import FrameFault, correct_times
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.alignment.motion_least_squares import LONGEST_STEP_S, MotionModel, MotionSolution, profile
from recoil_processing.alignment.motion_solver import LEAST_FRAMES, MotionSolver
from recoil_processing.arguments import require_alike, require_finite, require_increasing, require_positive
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.noise import noise_sigma
from recoil_processing.outliers import contradicting

INFLATIONS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Candidate factors on the accelerometer's noise density: ringing and mounting add to its white noise."""
LEAST_NOISE_M = 1e-9
"""Noise of a marker; no camera is better."""
UNKNOWN_DRIFT = 0.1
"""Prior of a drift of which nothing is known; a wrong frame rate hides in it."""
SEARCH_STEP_S = 5e-4
"""Step of the coarse search."""
SHIFT_SPAN_S = 0.03
"""Span over which accelerations are compared where the zero shifted: a pulse is shorter, and what a zero adds small."""
LEAST_SHIFT_GAIN = 12.0
"""Least rise of the log-likelihood for which a shift of the accelerometer's zero is taken: nearly five standard
deviations."""
DOUBTED_STATISTIC = 1.6
"""Mean squared normalised residual from which on a fit is doubted, see `recoil_processing.alignment.align`."""
PROBE_S = 1e-5
"""Span over which a travel is differentiated."""
KICK_FRAMES = 10
"""Frames that there must be on either side of an instant at which the velocity may be wrong."""
LEAST_TRAVEL_SIGMA = 20.0
"""Multiple of its noise by which a marker must move."""
SPAN_S = 4e-3
"""Span over which velocities are taken: coarse, but free of the frame noise."""
MOST_GAIN = 2.0
"""Ratio of two travels, either way, from which on they are of two motions: no frame that is missing, and no jump that a
track can be told by, makes one of the other."""
MOST_STEPS = 10
NEGLIGIBLE_STEP_S = 1e-8


def align_motion(
    camera_times_s: Array,
    displacement_m: Array,
    start_s: float,
    step_s: float,
    acceleration_m_s2: Array,
    *,
    acceleration_sigma_m_s2: float,
    drift_allowance: float,
    onset_s: float | None = None,
    kicks_s: tuple[float, ...] = (),
    u_bend_m: float = 0.0,
) -> MotionFit | str:
    """Find the offset and drift between a camera's clock and an accelerometer's.

    Parameters
    ----------
    camera_times_s : ndarray, shape (n_frames,)
        Times on the camera's clock, strictly increasing.
    displacement_m : ndarray, shape (n_frames,)
        Displacement; lost frames are NaN: they are left out, not filled.
    start_s, step_s
        Time base of the acceleration on the reference clock.
    acceleration_m_s2 : ndarray, shape (n_samples,)
        Second derivative of the same motion, positive alike, bias taken off as far as known; without
        missing samples.
    acceleration_sigma_m_s2
        Standard deviation of the accelerometer's white noise per sample.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before this record is seen.
    onset_s
        First instant of force on the reference clock, at which the accelerometer's zero may shift. That it did is
        taken only where the record cannot be explained without it, and is far likelier with it.
    kicks_s
        Instants on the reference clock where samples of the acceleration were lost and bridged: from each on its
        integral may be wrong by a velocity, which is one more unknown.
    u_bend_m
        Standard uncertainty of what the camera's optics bend the travel by in its middle; 0 if they bend nothing.

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
    require_alike(camera_times_s=camera_times_s, displacement_m=displacement_m)
    require_increasing(camera_times_s=camera_times_s)
    require_finite(acceleration_m_s2=acceleration_m_s2)
    require_positive(step_s=step_s, acceleration_sigma_m_s2=acceleration_sigma_m_s2)
    if acceleration_m_s2.size < 2:
        return f"only {acceleration_m_s2.size} samples of the acceleration are there"
    integral = DoubleIntegral.of(acceleration_m_s2, start_s, step_s)
    density = acceleration_sigma_m_s2**2 * step_s
    optional = kicks_s, u_bend_m
    fit, faults = _fit(camera_times_s, displacement_m, integral, density, drift_allowance, None, *optional)
    shifted_from_s = None
    if onset_s is not None and _doubted(fit, density):
        shifted, others = _fit(camera_times_s, displacement_m, integral, density, drift_allowance, onset_s, *optional)
        if not isinstance(shifted, str) and (
            isinstance(fit, str) or shifted.best_log_likelihood > fit.best_log_likelihood + LEAST_SHIFT_GAIN
        ):
            fit, faults, shifted_from_s = shifted, others, onset_s
    if isinstance(fit, str) or not faults:
        return fit
    times, real = correct_times(camera_times_s, faults)
    positions = np.where(real, displacement_m, np.nan)
    for fault in faults:
        positions[fault.index :] -= fault.jump_m
    corrected, _ = _fit(times, positions, integral, density, drift_allowance, shifted_from_s, *optional)
    return replace(fit, frame_faults=faults, corrected=None if isinstance(corrected, str) else corrected)


def _doubted(fit: MotionFit | str, density: float) -> bool:
    """Whether a fit without a shift of the zero leaves something to be explained."""
    return isinstance(fit, str) or fit.acceleration_density > density or fit.innovation_statistic > DOUBTED_STATISTIC


def _fit(
    times_s: Array,
    displacement_m: Array,
    integral: DoubleIntegral,
    density: float,
    drift_allowance: float,
    shifted_from_s: float | None,
    kicks_s: tuple[float, ...],
    u_bend_m: float,
) -> tuple[MotionFit | str, tuple[FrameFault, ...]]:
    """Fit a record with the times given, and say where those are wrong by a frame."""
    seen = np.isfinite(displacement_m)
    t, z = times_s[seen], displacement_m[seen]
    if t.size < LEAST_FRAMES:
        return f"only {t.size} frames have a position", ()
    marker_sigma = _marker_sigma(displacement_m)
    if not shows_motion(displacement_m):
        span, noise = measured(1e3 * float(np.ptp(z)), "mm", ".3g"), measured(1e3 * marker_sigma, "mm", ".2g")
        return worded("the track does not move: it spans ", span, " at ", noise, " noise"), ()
    model = MotionModel(t, z, 0.5 * float(t[0] + t[-1]), integral, shifted_from_s, kicks_s, u_bend_m)
    if shifted_from_s is None:
        by_camera, felt = camera_velocity(t, z), integral.velocity
    else:
        by_camera, felt = mean_accelerations(model, SHIFT_SPAN_S)
    lag = coarse_lag(*by_camera, integral.start_s, integral.step_s, felt, step_of_search_s=SEARCH_STEP_S)
    if isinstance(lag, str):
        return lag, ()
    model = replace(model, kicks_s=_seen_kicks(model, lag.offset_s))
    solver = MotionSolver(marker_sigma**2, [inflation * density for inflation in INFLATIONS])
    first = solver.converge(model, lag.offset_s, 0.0, density, drift_allowance)
    if isinstance(first, str):
        return first, ()
    odd = _contradicting(model, first, marker_sigma)
    model = replace(model, times_s=t[~odd], positions_m=z[~odd])
    best = solver.likeliest(model, first.shift_s, first.drift, drift_allowance)
    if isinstance(best, str):
        return best, ()
    free = solver.likeliest(model, best[0].shift_s, best[0].drift, UNKNOWN_DRIFT)
    if isinstance(free, str):
        return free, ()
    fit = _report(model, *best, free[0], lag, marker_sigma, int(odd.sum()), drift_allowance)
    if not 1.0 / MOST_GAIN < fit.gain < MOST_GAIN:
        return fit, ()
    faults = find_frame_faults(
        model,
        best[0],
        solver,
        rows=np.flatnonzero(seen)[~odd],
        repeated=np.append(False, np.diff(displacement_m) == 0),
        period_s=usual_step_s(times_s),
        drift_allowance=drift_allowance,
    )
    return fit, faults


def _seen_kicks(model: MotionModel, shift_s: float) -> tuple[float, ...]:
    """Kicks with frames before and behind them; one at an end of its track is a part of its constant velocity."""
    mapped = model.mapped_s(shift_s, 0.0)
    mapped = mapped[model.integral.covers(mapped)]
    if mapped.size <= 2 * KICK_FRAMES:
        return ()
    return tuple(k for k in model.kicks_s if mapped[KICK_FRAMES] < k < mapped[-1 - KICK_FRAMES])


def shows_motion(displacement_m: Array) -> bool:
    """Return whether a track moves by more than its noise; frames that were lost are NaN."""
    seen = displacement_m[np.isfinite(displacement_m)]
    return bool(np.ptp(seen) >= LEAST_TRAVEL_SIGMA * _marker_sigma(displacement_m)) if seen.size else False


def _marker_sigma(displacement_m: Array) -> float:
    """Noise of a marker; positions that software held instead of measuring contain none of it."""
    held = np.zeros(displacement_m.shape, dtype=bool)
    held[1:-1] = (displacement_m[1:-1] == displacement_m[:-2]) & (displacement_m[1:-1] == displacement_m[2:])
    sigma = noise_sigma(np.where(held, np.nan, displacement_m))
    if not math.isfinite(sigma):
        # never four frames in a row: the differences then reach over the lost ones
        sigma = noise_sigma(displacement_m[np.isfinite(displacement_m)])
    return max(sigma, LEAST_NOISE_M)


def _contradicting(model: MotionModel, solution: MotionSolution, marker_sigma: float) -> Flags:
    """Find the frames that contradict their neighbours, given the accelerometer, shape (n_frames,)."""
    travel, _ = model.integral.at(model.mapped_s(solution.shift_s, solution.drift)[solution.inside])
    times, positions = model.times_s[solution.inside], model.positions_m[solution.inside]
    odd = np.zeros(model.times_s.shape, dtype=bool)
    odd[solution.inside] = contradicting(times, positions, positions - solution.gain * travel, marker_sigma)
    return odd


def _report(
    model: MotionModel,
    solution: MotionSolution,
    density: float,
    free: MotionSolution,
    lag: CoarseLag,
    marker_sigma: float,
    frames_set_aside: int,
    drift_allowance: float,
) -> MotionFit:
    """Give the fit on the clocks' own terms, with the likelihood around the offset."""
    mapped = model.mapped_s(solution.shift_s, solution.drift)[solution.inside]
    _, velocity = model.integral.at(mapped)
    since = model.times_s[solution.inside] - model.origin_s
    # what the accelerometer's bias adds is no motion
    _, rate, curvature = solution.constants
    moves = solution.gain * velocity + rate + curvature * since
    # the velocity that an error makes of nothing is its travel's derivative
    later, earlier = model.errors(mapped + PROBE_S), model.errors(mapped - PROBE_S)
    for size, after, before in zip(solution.errors, later, earlier, strict=True):
        moves += size * (after - before) / (2 * PROBE_S)
    middle = float(np.average(since, weights=moves**2))
    u_offset = solution.u_mapped_s(middle)
    by_velocity, u_by_velocity = velocity_shift(
        model,
        solution.shift_s,
        solution.drift,
        marker_variance=marker_sigma**2,
        density=density,
        u_drift=math.sqrt(solution.covariance[2, 2]),
        since_s=middle,
    )
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
        drift_allowance=drift_allowance,
        velocity_offset_s=by_velocity - solution.drift * model.origin_s,
        u_velocity_offset_s=u_by_velocity,
        best_log_likelihood=solution.log_likelihood,
        shifted_zero_m_s2=None if model.shifted_from_s is None else -float(solution.errors[0]) / solution.gain,
    )


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
        Shift and drift to start from; the drift is held.
    marker_variance
        Variance of the camera's white noise, m^2.
    density
        Density of the accelerometer's white noise, (m/s^2)^2/Hz, two-sided.
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
    bends, u_bends_m = model.bends(inside)
    variance = marker_variance * float(on_frames @ on_frames) + density * _walk_energy(times, on_frames)
    variance += float(np.sum((on_frames @ bends * u_bends_m) ** 2))
    return shift_s, math.sqrt(variance + (by_drift * u_drift) ** 2)


def camera_velocity(times_s: Array, positions_m: Array) -> tuple[Array, Array]:
    """Velocities over spans of about `SPAN_S`, at their middles; shape (n_frames - span,) each."""
    span = span_frames(times_s)
    dt = times_s[span:] - times_s[:-span]
    velocity = (positions_m[span:] - positions_m[:-span]) / dt
    return 0.5 * (times_s[span:] + times_s[:-span]), velocity


def span_frames(times_s: Array) -> int:
    """Return how many frames apart two positions are taken for a velocity."""
    return max(1, round(SPAN_S / float(np.median(np.diff(times_s)))))


def mean_accelerations(model: MotionModel, span_s: float) -> tuple[tuple[Array, Array], Array]:
    """Mean accelerations over a span: what a zero that shifts is small against, where a velocity is not.

    Returns
    -------
    (times_s, camera), reference : tuple of ndarray, ndarray
        Velocities by the camera at the middles of the spans, on its clock, shape (n_frames - span,) each; and by the
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


def _walk_energy(times_s: Array, weights: Array) -> float:
    """Variance of a weighted sum of the double integral of white noise of density 1.

    The noise at s reaches it by the sum of ``w_i (t_i - s)`` over later instants, which is a straight line
    between instants; its square is integrated exactly.
    """
    steps = np.diff(times_s)
    later = np.append(np.cumsum(weights[::-1])[::-1], 0.0)[1:-1]
    reach = np.append(np.cumsum((later * steps)[::-1])[::-1], 0.0)
    return float(np.sum(steps * (reach[:-1] ** 2 + reach[:-1] * reach[1:] + reach[1:] ** 2)) / 3.0)
