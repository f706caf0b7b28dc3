"""The sensors of the virtual rig: what they feel, what rings in them, and what their chains make of it.

Plain arrays in SI. Each channel draws from a generator of its own, seeded by the shot's seed and the
channel's name, so that one more channel changes no other.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.model import Mechanism, carriage_specific_force, specific_acceleration
from recoil_rigs.rig import Sensor
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS
from recoil_rigs.twin.line_motion import LineMotion
from recoil_rigs.twin.motion import Motion
from recoil_rigs.twin.recorder_settings import RecorderSettings

_BESSEL_ORDER = 4
_BESSEL_DELAY = 2.113917674904216
"""Delay of the fourth-order Bessel low-pass at low frequency times its angular -3 dB frequency."""

_MODES_HZ = (980.0, 1450.0, 2100.0, 2900.0, 3700.0)
_KNOCKS = ((0.0, 1.0), (0.0063, 0.5), (0.015, 0.35), (0.086, 0.15))
"""Delay from the shot, s, and relative size of the knocks; the last one comes at the end of recoil."""
_LAST_KNOCK = 0.08
_WANDER_S = 2e-3
"""Time after which a gauge's gain has wandered to another value."""


def generator(seed: int, *names: str) -> np.random.Generator:
    """Return the random generator of one part of one shot, the same for the same seed and names."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=[zlib.crc32(n.encode()) for n in names]))


def truth(role: str, mechanism: Mechanism, motion: Motion, position: tuple[float, float]) -> Array:
    """Return what a sensor of a role feels, without any error, SI, shape (n,).

    Parameters
    ----------
    role
        A key of `recoil_rigs.rig.ROLES`.
    position
        Place of an accelerometer, from its body's reference point in the body's axes, m.
    """
    w1, dw1 = motion.qd[:, 2], motion.qdd[:, 2]
    w2, dw2 = w1 + motion.qd[:, 3], dw1 + motion.qdd[:, 3]
    if role == "recoil_acceleration":
        at_centre = specific_acceleration(mechanism, motion.q, motion.qd, motion.qdd)
        return at_centre + position[0] * w2**2 + position[1] * dw2
    if role in CARRIAGE_ACCELERATIONS:
        forces = carriage_specific_force(mechanism, motion.q, motion.qd, motion.qdd, *position)
        return forces[CARRIAGE_ACCELERATIONS.index(role)]
    if role == "trigger":
        return _trigger(motion.times_s, motion.t_fire_s)
    plain = {
        "carriage_rate": w1,
        "tipping_rate": w2,
        "carriage_angular_acceleration": dw1,
        "tipping_angular_acceleration": dw2,
        "breech_pressure": motion.breech_pressure_pa,
        "brake_pressure": motion.brake_pressure_pa,
        "recuperator_pressure": motion.recuperator_pressure_pa,
        "recoil_displacement": motion.q[:, 4],
        # the loads have the paper's signs, in which what presses on the ground is negative
        "ground_force_x": -motion.ground_x_n,
        "ground_force_y": -motion.ground_y_n,
        "ground_force_d": -motion.ground_d_n,
        "ground_friction_d": -motion.ground_friction_n,
        "elevating_moment": -motion.elevating_moment_n_m,
    }
    return plain[role]


def line_truth(role: str, mechanism: Mechanism, motion: LineMotion, share: float) -> Array:
    """Return what a sensor of a role feels on a line, without any error, SI, shape (n,).

    Parameters
    ----------
    role
        A key of `recoil_rigs.rig.ROLES` that a line has.
    share
        Share of the whole driving or resisting force that passes the sensor.
    """
    if role == "trigger":
        return _trigger(motion.times_s, motion.t_fire_s)
    if role in ("recoil_acceleration", "recoil_velocity", "recoil_displacement"):
        felt = {"acceleration": motion.specific_m_s2, "velocity": motion.speed_m_s, "displacement": motion.travel_m}
        return felt[role.removeprefix("recoil_")]
    bore_m2, _, _ = mechanism.force_areas
    per_force = {
        "breech_pressure": 1.0 / bore_m2,
        "brake_pressure": 1.0 / mechanism.brake_area,
        "recuperator_pressure": 1.0 / mechanism.recuperator_area,
    }
    whole = motion.driving_n if role in ("driving_force", "breech_pressure") else motion.resisting_n
    return np.asarray(share * per_force.get(role, 1.0) * whole, dtype=np.float64)


def _trigger(times_s: Array, t_fire_s: float) -> Array:
    since = times_s - t_fire_s
    return np.where((since >= 0.0) & (since < 0.01), 5.0, 0.0)


def stress_waves(times_s: Array, t_fire_s: float, t_end_s: float, rng: np.random.Generator) -> Array:
    """Return the modal accelerations that the knocks of a shot excite, shape (n_modes, n).

    Each mode is ``s^2 / (s^2 + 2 zeta w s + w^2)`` on short half-sine force pulses. The double zero at
    zero frequency is what a structure that rings about its own motion has: the ringing adds neither
    velocity nor displacement in the end. Modes lie between 0.9 and 4 kHz with damping ratios of 0.6 to 3 %.
    The largest value of each mode is 1.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times on a uniform grid.
    rng
        Draws the modes and the pulses.
    """
    from scipy.signal import lfilter

    step = times_s[1] - times_s[0]
    knocks = [(t_fire_s + 0.0005 + delay, size) for delay, size in _KNOCKS] + [(t_end_s, _LAST_KNOCK)]
    push = np.zeros_like(times_s)
    for start, size in knocks:
        width = rng.uniform(0.8e-4, 3.5e-4)
        phase = (times_s - start) / width
        push += size * np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0.0, 1.0)), 0.0)
    modes = []
    for frequency in _MODES_HZ:
        w = 2 * np.pi * frequency * rng.uniform(0.93, 1.07)
        zeta = rng.uniform(0.006, 0.03)
        # bilinear transform, warped so that the mode keeps its frequency
        K = w / np.tan(0.5 * w * step)
        denominator = [K**2 + 2 * zeta * w * K + w**2, 2 * (w**2 - K**2), K**2 - 2 * zeta * w * K + w**2]
        rings = lfilter([K**2, -2 * K**2, K**2], denominator, push)
        modes.append(rings / np.abs(rings).max())
    return np.array(modes)


def mix(modes: Array, peak: float, rng: np.random.Generator) -> Array:
    """Return how the modes arrive at one sensor: mixed at random, with a given peak, shape (n,)."""
    weights = rng.normal(0.0, 1.0, len(modes)) * np.linspace(1.0, 0.6, len(modes))
    arrives = weights @ modes
    return np.asarray(peak / np.abs(arrives).max() * arrives, dtype=np.float64)


def wandering(at_s: Array, rng: np.random.Generator) -> Array:
    """Return what wanders within a shot: a smooth curve through draws of standard deviation 1, shape (n,).

    Parameters
    ----------
    at_s : ndarray, shape (n,)
        Instants, rising.
    """
    from scipy.interpolate import CubicSpline

    nodes_s = np.arange(at_s[0], at_s[-1] + 2 * _WANDER_S, _WANDER_S)
    return np.asarray(CubicSpline(nodes_s, rng.normal(0.0, 1.0, nodes_s.size))(at_s), dtype=np.float64)


def _within_grid(filter_hz: float, step_s: float) -> bool:
    """Return whether a low-pass takes anything away from what a grid can hold."""
    return filter_hz < 0.45 / step_s


def chain(signal: Array, step_s: float, sensor: Sensor) -> Array:
    """Return a signal behind its piezoelectric coupling and its anti-alias filter, settled at the start.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Samples on a uniform grid.
    sensor
        ``time_constant_s``: a first-order high-pass; ``filter_hz``: a Bessel low-pass of fourth order,
        -3 dB there.
    """
    from scipy.signal import bessel, lfilter, sosfilt, sosfilt_zi

    if sensor.time_constant_s is not None:
        keep = np.exp(-step_s / sensor.time_constant_s)
        slow, _ = lfilter([1 - keep], [1, -keep], signal, zi=[keep * signal[0]])
        signal = signal - slow
    if sensor.filter_hz is not None and _within_grid(sensor.filter_hz, step_s):
        sos = bessel(_BESSEL_ORDER, sensor.filter_hz, fs=1.0 / step_s, norm="mag", output="sos")
        signal, _ = sosfilt(sos, signal, zi=signal[0] * sosfilt_zi(sos))
    return signal


def sample(signal: Array, times_s: Array, at_s: Array, sensor: Sensor | None = None) -> Array:
    """Take samples of a signal on a uniform grid that starts at 0, by cubic splines; rest before.

    The samples of a chain are late by exactly the ``delay_s`` that the sensor declares: the anti-alias
    filter's own delay counts towards it, and is the whole where none is declared.
    """
    from scipy.interpolate import CubicSpline

    delay = 0.0
    if sensor is not None:
        of_filter = 0.0 if sensor.filter_hz is None else _BESSEL_DELAY / (2 * np.pi * sensor.filter_hz)
        delay = sensor.delay_s if "delay_s" in sensor.model_fields_set else of_filter
        if sensor.filter_hz is not None and _within_grid(sensor.filter_hz, float(times_s[1])):
            delay -= of_filter
    where = np.clip(at_s - delay, 0.0, times_s[-1])
    return np.asarray(CubicSpline(times_s, signal)(where), dtype=np.float64)


@dataclass(frozen=True)
class Errors:
    """Errors of one sensor on the physical value, in the unit of its record.

    Attributes
    ----------
    gain
        Factor on the true value.
    offset
        Added to it.
    """

    gain: float
    offset: float


def digitise(
    values: Array,
    full_range: tuple[float, float] | None,
    u_rel: float,
    settings: RecorderSettings,
    rng: np.random.Generator,
    zero_shift: Array,
    scale_error: float | None = None,
    gain_factor: float = 1.0,
    noise_factor: Array | float = 1.0,
    added: Array | float = 0.0,
) -> tuple[Array, Errors]:
    """Return what the recorder stores of true values: gain error, offset, zero shift, noise, clipping, steps.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Values in the unit of the file.
    full_range
        Range of the sensor, in the same unit; without one nothing is clipped or stepped.
    u_rel
        Relative standard uncertainty of the sensor's scale.
    rng
        Random generator of this channel.
    zero_shift : ndarray, shape (n,)
        Shift of the zero, share of full scale.
    scale_error
        Error of the sensor's scale in standard uncertainties; drawn if left out.
    gain_factor
        Factor on the gain, beside what the scale is off.
    noise_factor : float or ndarray, shape (n,)
        Factor on the white noise.
    added : float or ndarray, shape (n,)
        Further noise, in the unit of the file.
    """
    low, high = full_range if full_range is not None else (-np.inf, np.inf)
    full_scale = max(abs(low), abs(high)) if full_range is not None else float(np.abs(values).max())
    drawn, bias = rng.normal(0.0, 1.0, 2)
    scale, offset = u_rel * (drawn if scale_error is None else scale_error), settings.bias * full_scale * bias
    gain = 1.0 + float(scale) if settings.gain_errors else 1.0
    errors = Errors(gain * gain_factor, float(offset))
    noise = settings.noise * full_scale * rng.normal(0.0, 1.0, values.shape) * noise_factor + added
    stored = errors.gain * values + errors.offset + full_scale * zero_shift + noise
    stored = np.clip(stored, low, high)
    if settings.bits and full_range is not None:
        count = (high - low) / 2**settings.bits
        stored = np.clip(low + count * np.round((stored - low) / count), low, high - count)
    return stored, errors
