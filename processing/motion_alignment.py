"""The camera's clock from the motion itself: camera displacement against accelerometer.

The camera saw ``z_i = x(t_i) + n_i`` at frame times on its own clock; the accelerometer felt
``x''(t)`` on the recorder's. With ``D`` the double integral of the accelerometer's signal,

    z_i = k D((1 + gamma) t_i + tau) + c0 + c1 t_i + c2 t_i^2 / 2 + w_i + n_i,

where k is the ratio of the camera's scale to the accelerometer's, c0 to c2 are the integration
constants and the accelerometer's bias, n is the marker's white noise and w the double integral of
the accelerometer's white noise: a random walk of the velocity. A Kalman filter of w turns every
column of this linear model into independent rows (it whitens them), so that tau is found by
weighted least squares and its uncertainty is the likelihood's own curvature. The filter does not
depend on tau: one pass serves all candidates.

The model is the multi-rate displacement-acceleration filter of Smyth and Wu (2007), Mech. Syst.
Signal Process. 21(2), with the clock's offset as a parameter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.correlation import coarse_lag
from processing.noise import noise_sigma

Array = NDArray[np.float64]

INFLATIONS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Candidate factors on the accelerometer's noise density: ringing and mounting add to its white noise."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """The outcome of aligning a displacement with an acceleration.

    Attributes
    ----------
    offset_s, drift : float
        ``t_ref = (1 + drift) t_cam + offset_s``.
    u_offset_s : float
        Standard uncertainty of the mapped time in the middle of the motion.
    u_drift : float
    gain, u_gain : float
        Camera scale over accelerometer scale, and its standard uncertainty.
    u_bias_m_s2 : float
        Standard uncertainty of c2.
    gain_bias_correlation : float
        Correlation of the estimates of gain and c2.
    integration_constants : tuple of float
        c0 in m, c1 in m/s, c2 in m/s^2, on the *camera's* time counted from `origin_s`.
    origin_s : float
        Camera time that c0 to c2 count from.
    marker_sigma_m : float
        Noise of the marker, from its third differences.
    acceleration_density : float
        Noise density of the accelerometer that explains the record, (m/s^2)^2/Hz, two-sided.
    innovation_statistic : float
        Mean squared normalised residual; 1 if model and noise levels fit.
    coarse_offset_s : float
        What the velocity correlation said.
    correlation : float
        Its peak, 1 at the most.
    second_peak : float
        Highest correlation away from that peak.
    candidates_s, log_likelihood : ndarray, shape (n_candidates,)
        The likelihood around the offset, its maximum at 0.
    """

    offset_s: float
    drift: float
    u_offset_s: float
    u_drift: float
    gain: float
    u_gain: float
    u_bias_m_s2: float
    gain_bias_correlation: float
    integration_constants: tuple[float, float, float]
    origin_s: float
    marker_sigma_m: float
    acceleration_density: float
    innovation_statistic: float
    coarse_offset_s: float
    correlation: float
    second_peak: float
    at_search_edge: bool
    candidates_s: Array
    log_likelihood: Array


def integrate(samples: Array, step_s: float) -> Array:
    """Integrate evenly spaced samples by the trapezoidal rule from zero; shape (n,) to (n,)."""
    total = np.empty_like(samples)
    total[0] = 0.0
    np.cumsum(0.5 * step_s * (samples[1:] + samples[:-1]), out=total[1:])
    return total


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
        On the camera's clock, increasing.
    displacement_m : ndarray, shape (n_frames,)
        Lost frames NaN; they are left out, not filled.
    start_s, step_s : float
        Time base of the acceleration on the reference clock.
    acceleration_m_s2 : ndarray, shape (n_samples,)
        Second derivative of the same motion, positive alike, bias taken off as far as known.
    acceleration_sigma_m_s2 : float
        Its white noise per sample.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before this record is seen.

    Returns
    -------
    MotionFit or str
        A sentence where there is no motion to align by.
    """
    seen = np.isfinite(displacement_m)
    t, z = camera_times_s[seen], displacement_m[seen]
    if t.size < 50:
        return f"only {t.size} frames have a position"
    marker_sigma = max(noise_sigma(displacement_m), 1e-9)
    if np.ptp(z) < 20 * marker_sigma:
        return f"the track does not move: it spans {1e3 * np.ptp(z):.3g} mm at {1e3 * marker_sigma:.2g} mm noise"
    velocity = integrate(acceleration_m_s2, step_s)
    position = integrate(velocity, step_s)
    ends = start_s, start_s + step_s * (acceleration_m_s2.size - 1)
    lag = coarse_lag(*_camera_velocity(t, z), start_s, step_s, velocity, step_of_search_s=5e-4)
    if isinstance(lag, str):
        return lag

    origin = 0.5 * (t[0] + t[-1])
    density = acceleration_sigma_m_s2**2 * step_s

    def columns(offset_s: float, drift: float) -> tuple[Array, NDArray[np.bool_]]:
        mapped = (1.0 + drift) * t + offset_s
        inside = (mapped >= ends[0]) & (mapped <= ends[1])
        grid = (mapped - start_s) / step_s
        shape = _at(position, grid), _at(velocity, grid)
        since = t - origin
        return np.column_stack([z, shape[0], shape[1], shape[1] * t, np.ones_like(t), since, 0.5 * since**2]), inside

    best: tuple[float, float, _Solution] | None = None
    for inflation in INFLATIONS:
        offset, drift = (best[0], best[1]) if best else (lag.offset_s, 0.0)
        solution = None
        for _ in range(12):
            table, inside = columns(offset, drift)
            if np.count_nonzero(inside) < 50:
                return "fewer than 50 frames fall into the recorder's record"
            rows, log_det = whiten(t[inside], table[inside], marker_sigma**2, inflation * density)
            solution = _solve(rows, log_det, drift, drift_allowance)
            step = solution.offset_step_s
            offset, drift = offset + float(np.clip(step, -2e-3, 2e-3)), drift + solution.drift_step
            if abs(step) < 1e-9:
                break
        if solution is None:
            continue
        if best is None or solution.log_likelihood > best[2].log_likelihood + 2.0:
            best = (offset, drift, solution)
            chosen = inflation
        else:
            break
    if best is None:
        return "no offset fits"
    offset, drift, solution = best

    table, inside = columns(offset, drift)
    middle = float(np.average(t[inside], weights=table[inside, 2] ** 2))
    u_mapped = math.sqrt(max(solution.variance_of_mapped_time(middle), 0.0))
    width = max(8 * u_mapped, 2e-4)
    candidates = offset + np.linspace(-width, width, 41)
    shapes = [columns(candidate, drift)[0][inside, 1] for candidate in candidates]
    together = np.column_stack([table[inside][:, [0, 4, 5, 6]], *shapes])
    curve = _profile(whiten(t[inside], together, marker_sigma**2, chosen * density)[0])
    u_gain, u_bias = (math.sqrt(solution.covariance[i, i]) for i in (0, 5))
    k, c0, c1, c2 = (float(c) for c in solution.coefficients)
    return MotionFit(
        offset_s=offset,
        drift=drift,
        u_offset_s=u_mapped,
        u_drift=math.sqrt(solution.covariance[2, 2]),
        gain=k,
        u_gain=u_gain,
        u_bias_m_s2=u_bias,
        gain_bias_correlation=float(solution.covariance[0, 5] / (u_gain * u_bias)),
        integration_constants=(c0, c1, c2),
        origin_s=origin,
        marker_sigma_m=marker_sigma,
        acceleration_density=chosen * density,
        innovation_statistic=solution.innovation_statistic,
        coarse_offset_s=lag.offset_s,
        correlation=lag.correlation,
        second_peak=lag.second_peak,
        at_search_edge=lag.at_search_edge,
        candidates_s=candidates,
        log_likelihood=curve - curve.max(),
    )


def whiten(times_s: Array, columns: Array, marker_variance: float, density: float) -> tuple[Array, float]:
    """Turn columns whose errors are marker noise plus a random walk of the velocity into independent rows.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
    columns : ndarray, shape (n, n_columns)
    marker_variance : float
        Of the white noise, m^2.
    density : float
        Of the acceleration that drives the walk, (m/s^2)^2/Hz, two-sided.

    Returns
    -------
    rows : ndarray, shape (n, n_columns)
        Normalised innovations of every column.
    log_determinant : float
        Sum of the logarithms of the innovations' variances.

    Notes
    -----
    State [w, w'] from zero; over a step h the process noise is
    ``density * [[h^3/3, h^2/2], [h^2/2, h]]``. All columns share the gains.
    """
    n = times_s.size
    steps = np.diff(times_s, prepend=times_s[0])
    gains = np.empty((n, 2))
    scales = np.empty(n)
    p00 = p01 = p11 = 0.0
    for i, h in enumerate(steps.tolist()):
        p00 += h * (2 * p01 + h * p11) + density * h**3 / 3
        p01 += h * p11 + density * h**2 / 2
        p11 += density * h
        s = p00 + marker_variance
        g0, g1 = p00 / s, p01 / s
        gains[i] = g0, g1
        scales[i] = s
        p11 -= g1 * p01
        p00, p01 = (1 - g0) * p00, (1 - g0) * p01
    rows = np.empty_like(columns)
    w = np.zeros(columns.shape[1])
    rate = np.zeros(columns.shape[1])
    for i in range(n):
        w = w + steps[i] * rate
        innovation = columns[i] - w
        rows[i] = innovation
        w = w + gains[i, 0] * innovation
        rate = rate + gains[i, 1] * innovation
    return rows / np.sqrt(scales)[:, None], float(np.log(scales).sum())


@dataclass(frozen=True, eq=False)
class _Solution:
    coefficients: Array
    offset_step_s: float
    drift_step: float
    covariance: Array
    log_likelihood: float
    innovation_statistic: float

    def variance_of_mapped_time(self, camera_time_s: float) -> float:
        pick = np.zeros(self.covariance.shape[0])
        pick[1], pick[2] = 1.0, camera_time_s
        return float(pick @ self.covariance @ pick)


def _solve(rows: Array, log_determinant: float, drift: float, drift_allowance: float) -> _Solution:
    """One Gauss-Newton step: columns z | D, V, V t, 1, t, t^2/2, with the drift's prior as a row."""
    z, design = rows[:, 0], rows[:, 1:].copy()
    gain = float(np.linalg.lstsq(design[:, [0, 3, 4, 5]], z, rcond=None)[0][0])
    design[:, 1:3] *= gain
    prior = np.zeros((1, design.shape[1]))
    prior[0, 2] = 1.0 / max(drift_allowance, 1e-12)
    design = np.vstack([design, prior])
    target = np.append(z, -drift / max(drift_allowance, 1e-12))
    scale = np.sqrt((design**2).sum(axis=0))
    scale[scale == 0] = 1.0
    q, r = np.linalg.qr(design / scale)
    inverse = np.linalg.inv(r)
    solution = inverse @ (q.T @ target) / scale
    residual = target - design @ solution
    n = rows.shape[0]
    chi2 = float(residual @ residual)
    covariance = inverse @ inverse.T / np.outer(scale, scale)
    return _Solution(
        coefficients=solution[[0, 3, 4, 5]],
        offset_step_s=float(solution[1]),
        drift_step=float(solution[2]),
        covariance=covariance * max(1.0, chi2 / n),
        log_likelihood=-0.5 * (chi2 + log_determinant),
        innovation_statistic=chi2 / n,
    )


def _profile(rows: Array) -> Array:
    """Log-likelihood of each candidate shape (columns 4 on), the other parameters at their best."""
    target, nuisance, shapes = rows[:, 0], rows[:, 1:4], rows[:, 4:]
    q, _ = np.linalg.qr(nuisance)
    target = target - q @ (q.T @ target)
    shapes = shapes - q @ (q.T @ shapes)
    explained = (shapes.T @ target) ** 2 / np.einsum("ij,ij->j", shapes, shapes)
    return np.asarray(-0.5 * (target @ target - explained))


def _at(samples: Array, position: Array) -> Array:
    """Evaluate at fractional sample positions; beyond the ends the end values stand in."""
    return np.interp(position, np.arange(samples.size), samples)


def _camera_velocity(times_s: Array, displacement_m: Array) -> tuple[Array, Array]:
    """Velocity over spans of about 4 ms, at their middles: coarse, but free of the frame noise."""
    span = max(1, round(4e-3 / float(np.median(np.diff(times_s)))))
    dt = times_s[span:] - times_s[:-span]
    velocity = (displacement_m[span:] - displacement_m[:-span]) / dt
    return 0.5 * (times_s[span:] + times_s[:-span]), velocity
