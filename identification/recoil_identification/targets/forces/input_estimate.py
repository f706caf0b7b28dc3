"""The propellant's force as the unknown input of the motion: Kalman input estimation with smoothing.

While the recoiling part is free, ``m3 a' = P - R_f``. With the resistance R_f by its gauges known, the
accelerometer shows the force itself with what rings and hisses on it, and the camera its double integral::

    f   = m3 a_read + R_f = P + da m3 a' + m3 b + stress waves + white noise
    x'' = (P - R_f) / m3 - c,     z = (1 + dc) x + tau x' + marker noise

with c what a' has besides x'' (gravity and the carriage's motion). The state holds x, x', P and P', whose
change is white noise (an integrated random walk), a constant for each of the sensors' errors da, b, dc and tau,
restricted by its standard uncertainty, and two for each mode of the stress waves: a damped oscillator driven by
white noise, of which the velocity is seen, because what rings about a motion adds no force in the end. How
rough the force is and how hard the structure is knocked, at every instant, is found by maximum likelihood
(`recoil_identification.targets.forces.input_smoother`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.forces.input_smoother import InputModel, Smoothed, follow_intensities
from recoil_identification.targets.forces.measured_force import MeasuredForce, TrackedTravel
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.stress_waves.ringing import Mode

SAMPLES_PER_PERIOD = 3.0
"""Samples on a period of the highest mode, at the thinned rate."""
LEAST_RATE_HZ = 10e3
"""Rate of the thinned record: twenty samples on a rise of 2 ms."""
BROADBAND_DAMPING = 0.5
"""Damping ratio of the oscillator that stands for what rings beside the modes that were found."""
_TRAVEL, _VELOCITY, _FORCE, _SLOPE, _GAIN, _ZERO, _SCALE, _CLOCK = range(8)
_ROUGHNESS, _RINGING = 0, 1
"""Drivers."""
_PLAIN = 8
"""States before those of the modes."""
GUESS_CUTOFF_HZ = 500.0
"""Cut-off of the low-pass that tells the smooth from the rest for a first guess."""
LOCAL_S = 1e-3
"""Over which the first guess of an intensity is taken."""
LEAST_SHARE = 1e-6
"""Share of the largest force, in a step: the first guess of an intensity is no smaller."""


@dataclass(frozen=True, eq=False)
class InputEstimate(ReadOnlyArrays):
    """The force that moved the part.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    force_n, u_force_n : ndarray, shape (n,)
        Force with the standard deviation of its posterior: noises, stress waves, and the errors of accelerometer,
        camera and clock. What the mass and the resistance lack is not in it.
    slope_n_s, u_slope_n_s : ndarray, shape (n,)
        Derivative of the force, and its standard deviation.
    travel_m, velocity_m_s : ndarray, shape (n,)
    impulse_n_s, u_impulse_n_s : ndarray, shape (n,)
        Integral of the force from the first instant, with its standard deviation: the momentum that was gained, and
        that went into the resistance.
    gain_error, u_gain_error
        da: by how much the accelerometer reads too high, relative.
    stress_waves_n : ndarray, shape (n,)
        Mass times what rings.
    noise_n
        White noise of the thinned record.
    innovation_statistic
        1 if noise levels and model fit.
    error_covariance_n2 : ndarray, shape (n, n)
        Covariance of noise and stress waves at the instants of the thinned record, as the likelihood has found them.
    factor
        Factor by which the record was thinned.
    """

    times_s: Array
    force_n: Array
    u_force_n: Array
    slope_n_s: Array
    u_slope_n_s: Array
    travel_m: Array
    velocity_m_s: Array
    impulse_n_s: Array
    u_impulse_n_s: Array
    gain_error: float
    u_gain_error: float
    stress_waves_n: Array
    noise_n: float
    innovation_statistic: float
    log_likelihood: float
    modes: tuple[Mode, ...]
    error_covariance_n2: Array
    factor: int


def thinning_factor(rate_hz: float, modes: Sequence[Mode]) -> int:
    """Return how many samples a block may have so that force and modes are still told."""
    highest = max((mode.frequency_hz for mode in modes), default=0.0)
    return max(1, int(rate_hz / max(LEAST_RATE_HZ, SAMPLES_PER_PERIOD * highest)))


def estimate_input(measured: MeasuredForce, tracked: TrackedTravel | None, modes: Sequence[Mode]) -> InputEstimate:
    """Estimate the force that moved the part.

    Parameters
    ----------
    measured
        Measured force from rest on.
    modes
        Modes of the stress waves; one more, broad, stands for the rest.

    Raises
    ------
    ValueError
        If the record is shorter than 20 samples of the thinned rate, or nothing of it is there.
    """
    factor = thinning_factor(1.0 / measured.step_s, modes)
    thin = measured.thinned(factor)
    if thin.force_n.size < 20 or np.isfinite(thin.force_n).sum() < 20:
        raise ValueError(f"at least 20 samples of the thinned record are needed, found {thin.force_n.size}")
    scale = float(np.nanmax(np.abs(thin.force_n)))
    model = _model(thin, tracked, modes, scale)
    found = follow_intensities(model, _first_guess(thin, scale))
    return _estimate(thin, model, found, tuple(modes), scale, factor)


def _model(thin: MeasuredForce, tracked: TrackedTravel | None, modes: Sequence[Mode], scale_n: float) -> InputModel:
    """Set the state up in units of a step, of the largest force, and of the length that they give with the mass."""
    from scipy.linalg import expm

    h, count = thin.step_s, thin.force_n.size
    length = scale_n / thin.mass_kg * h**2
    n = _PLAIN + 2 * (len(modes) + 1)
    motion = np.zeros((4, 4))
    motion[[0, 1, 2], [1, 2, 3]] = 1.0
    transition = np.eye(n)
    transition[:4, :4] = expm(motion)
    # an acceleration that does not change within the step
    inputs = np.zeros((count - 1, n))
    known = -(thin.resistance_n / thin.mass_kg + thin.carried_m_s2) * h**2 / length
    known = 0.5 * (known[1:] + known[:-1])
    inputs[:, _TRAVEL], inputs[:, _VELOCITY] = 0.5 * known, known
    growths = np.zeros((2, n, n))
    growths[_ROUGHNESS, :4, :4] = _growth(motion, np.array([0.0, 0.0, 0.0, 1.0]))
    amplitudes = np.array([mode.amplitude for mode in modes])
    shares = amplitudes**2 / float(np.sum(amplitudes**2)) if len(modes) else np.zeros(0)
    middle = math.exp(float(np.mean(np.log([m.frequency_hz for m in modes])))) if len(modes) else 0.2 / h
    oscillators = [(m.frequency_hz, m.damping_ratio, s) for m, s in zip(modes, shares, strict=True)]
    for i, (frequency_hz, damping, share) in enumerate([*oscillators, (middle, BROADBAND_DAMPING, 0.02)]):
        own = slice(_PLAIN + 2 * i, _PLAIN + 2 * i + 2)
        w = 2 * math.pi * frequency_hz * h
        decay = np.array([[0.0, w], [-w, -2 * damping * w]])
        transition[own, own] = expm(decay)
        # of unit variance when it has settled, times its share
        growths[_RINGING, own, own] = _growth(decay, np.array([0.0, math.sqrt(4 * damping * w * share)]))
    start, covariance = np.zeros(n), np.zeros((n, n))
    first = float(thin.force_n[np.isfinite(thin.force_n)][0]) / scale_n
    start[_FORCE] = first
    errors = {
        _VELOCITY: 1e-4 * h / length,
        _FORCE: 0.1,
        _SLOPE: 1e-4,
        _GAIN: thin.u_gain,
        _ZERO: thin.u_zero_m_s2 * thin.mass_kg / scale_n,
    }
    steps = np.flatnonzero(np.isfinite(thin.force_n))
    rows = np.zeros((steps.size, n))
    rows[:, _FORCE] = rows[:, _ZERO] = 1.0
    rows[:, _GAIN] = thin.acceleration_m_s2[steps] * thin.mass_kg / scale_n
    rows[:, _PLAIN + 1 :: 2] = 1.0
    values = thin.force_n[steps] / scale_n
    variances = np.full(steps.size, (thin.noise_n / scale_n) ** 2)
    if tracked is not None:
        errors |= {_TRAVEL: 1.0 / length, _SCALE: tracked.u_scale, _CLOCK: tracked.u_clock_s / h}
        at = (tracked.times_s - thin.start_s) / h
        inside = (at > -0.5) & (at < count - 0.5)
        at, seen = at[inside], tracked.positions_m[inside] / length
        nearest = np.clip(np.round(at).astype(np.int64), 0, count - 1)
        since = at - nearest
        acceleration = (thin.acceleration_m_s2 - thin.carried_m_s2)[nearest] * h**2 / length
        velocity = np.cumsum(thin.acceleration_m_s2 - thin.carried_m_s2)[nearest] * h**2 / length
        frames = np.zeros((at.size, n))
        frames[:, _TRAVEL], frames[:, _VELOCITY] = 1.0, since
        # for the small effects of scale and clock the travel as seen and the velocity as integrated will do
        frames[:, _SCALE], frames[:, _CLOCK] = seen - float(np.median(seen[:5])), velocity
        steps, rows = np.concatenate([steps, nearest]), np.vstack([rows, frames])
        values = np.concatenate([values, seen - 0.5 * since**2 * acceleration])
        variances = np.concatenate([variances, np.full(at.size, (tracked.sigma_m / length) ** 2)])
        start[_TRAVEL] = float(np.median(seen[:5])) if seen.size else 0.0
        order = np.argsort(steps, kind="stable")
        steps, rows, values, variances = steps[order], rows[order], values[order], variances[order]
    for i, u in errors.items():
        covariance[i, i] = u**2
    return InputModel(transition, inputs, growths, start, covariance, steps, rows, values, variances)


def _growth(drift: Array, push: Array) -> Array:
    """Covariance that white noise of unit intensity along ``push`` adds in a unit step (C. F. Van Loan, 1978)."""
    from scipy.linalg import expm

    n = push.size
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -drift, np.outer(push, push), drift.T
    both = expm(block)
    growth = both[n:, n:].T @ both[:n, n:]
    return np.asarray(0.5 * (growth + growth.T))


def _first_guess(thin: MeasuredForce, scale_n: float) -> Array:
    """Return ln q of force and stress waves by the energy of what is smooth and of what is not, (2, n - 1)."""
    force = bridge(thin.force_n) / scale_n
    smooth = LowPass(min(GUESS_CUTOFF_HZ, 0.1 / thin.step_s)).apply(force, 1.0 / thin.step_s)
    bend = np.diff(np.diff(smooth, prepend=smooth[0]), prepend=0.0)[1:]
    reach = max(3, round(LOCAL_S / thin.step_s))
    window = np.ones(reach) / reach

    def local(energy: Array) -> Array:
        return np.log(np.convolve(energy, window, mode="same") + LEAST_SHARE**2)

    return np.stack([local(bend**2), local((force - smooth)[1:] ** 2)])


def _error_covariance(model: InputModel, log_q: Array) -> Array:
    """Covariance of what rings between all instants, in the model's units, shape (n, n)."""
    n = model.count
    total = np.zeros((n, n))
    for at in range(_PLAIN, model.start.size, 2):
        own = slice(at, at + 2)
        step, growth = model.transition[own, own], model.growths[_RINGING][own, own]
        powers = np.zeros((n, 2))
        powers[0] = 0.0, 1.0
        for lag in range(1, n):
            powers[lag] = powers[lag - 1] @ step
        spread = np.zeros((2, 2))
        for i in range(n):
            # the velocity later on given the state now, times the state's covariance with the velocity now
            column = powers[: n - i] @ spread[:, 1]
            total[i:, i] += column
            total[i, i + 1 :] += column[1:]
            if i < n - 1:
                spread = step @ spread @ step.T + math.exp(log_q[i]) * growth
    return total


def _estimate(
    thin: MeasuredForce, model: InputModel, found: Smoothed, modes: tuple[Mode, ...], scale_n: float, factor: int
) -> InputEstimate:
    h = thin.step_s
    length = scale_n / thin.mass_kg * h**2
    x, variances = found.states, np.maximum(np.diagonal(found.covariances, axis1=1, axis2=2), 0.0)
    # momentum: what the part has gained, and what went into resistance and carried motion
    spent = thin.resistance_n + thin.mass_kg * thin.carried_m_s2
    spent = np.concatenate([[0.0], np.cumsum(0.5 * h * (spent[1:] + spent[:-1]))])
    velocity = x[:, _VELOCITY] * length / h
    return InputEstimate(
        times_s=thin.times_s,
        force_n=x[:, _FORCE] * scale_n,
        u_force_n=np.sqrt(variances[:, _FORCE]) * scale_n,
        slope_n_s=x[:, _SLOPE] * scale_n / h,
        u_slope_n_s=np.sqrt(variances[:, _SLOPE]) * scale_n / h,
        travel_m=(x[:, _TRAVEL] - x[0, _TRAVEL]) * length,
        velocity_m_s=velocity,
        impulse_n_s=thin.mass_kg * (velocity - velocity[0]) + spent,
        u_impulse_n_s=thin.mass_kg * np.sqrt(variances[:, _VELOCITY]) * length / h,
        gain_error=float(x[-1, _GAIN]),
        u_gain_error=math.sqrt(float(variances[-1, _GAIN])),
        stress_waves_n=np.asarray(x[:, _PLAIN + 1 :: 2].sum(axis=1)) * scale_n,
        noise_n=thin.noise_n,
        innovation_statistic=found.innovation_statistic,
        log_likelihood=found.log_likelihood,
        modes=modes,
        error_covariance_n2=scale_n**2 * _error_covariance(model, found.log_intensities[_RINGING])
        + thin.noise_n**2 * np.eye(x.shape[0]),
        factor=factor,
    )
