"""Readings of a virtual rig's sensors: what they make of what they feel, and what the motion adds to their noise.

Plain arrays in SI on the uniform grid of the motion, see `recoil_rigs.twin.readings` for the equations.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.line_motion import LineMotion
from recoil_rigs.twin.motion import Motion
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.unread_forces import Projectile, UnreadForces

_GATEWAY_SHAPE = 2.0
_KNOCK_S, _KNOCK_FREEDOM = 1e-3, 2.0


def low_pass(signal: Array, step_s: float, frequency_hz: float, damping: float) -> Array:
    """Return ``LP2`` of a signal on a uniform grid, settled at its start, shape (n,)."""
    from scipy.signal import lfilter

    first, numerator, denominator = signal[0], *_resonance(step_s, frequency_hz, damping)
    w2 = (2 * math.pi * frequency_hz) ** 2
    return np.asarray(first + lfilter(w2 * numerator, denominator, signal - first), dtype=np.float64)


def ringing(signal: Array, step_s: float, frequency_hz: float, damping: float) -> Array:
    """Return ``s^2 / (s^2 + 2 z w s + w^2)`` of a signal on a uniform grid, settled at its start, shape (n,)."""
    from scipy.signal import lfilter

    _, denominator = _resonance(step_s, frequency_hz, damping)
    K2 = _warped(step_s, frequency_hz) ** 2
    return np.asarray(lfilter(K2 * np.array([1.0, -2.0, 1.0]), denominator, signal - signal[0]), dtype=np.float64)


def _warped(step_s: float, frequency_hz: float) -> float:
    """Return K of the bilinear transform ``s = K (z - 1) / (z + 1)`` that keeps a frequency."""
    w = 2 * math.pi * frequency_hz
    return float(w / math.tan(0.5 * w * step_s))


def _resonance(step_s: float, frequency_hz: float, damping: float) -> tuple[Array, Array]:
    """Return the bilinear transform of ``1 / (s^2 + 2 z w s + w^2)``, its numerator and denominator."""
    w, K = 2 * math.pi * frequency_hz, _warped(step_s, frequency_hz)
    denominator = np.array([K**2 + 2 * damping * w * K + w**2, 2 * (w**2 - K**2), K**2 - 2 * damping * w * K + w**2])
    return np.array([1.0, 2.0, 1.0]), denominator


def lagged(signal: Array, step_s: float, time_constant_s: float) -> Array:
    """Return a signal behind ``1 / (s tau + 1)``, settled at its start, shape (n,)."""
    from scipy.signal import lfilter

    K = 2.0 * time_constant_s / step_s
    first = signal[0]
    return np.asarray(first + lfilter([1.0, 1.0], [K + 1.0, 1.0 - K], signal - first), dtype=np.float64)


def breech_reading(true_pa: Array, motion: Motion, r: Readings, m: Mechanism, u: UnreadForces, full_pa: float) -> Array:
    """Return what the breech gauge reads of the pressure at the breech, shape (n,)."""
    read = true_pa
    if r.gauge_ahead:
        shot = Projectile.driven(motion.times_s, m.force_areas[0] * true_pa, u.projectile_mass_kg, u.bore_length_m)
        read = read * (1.0 - r.gauge_ahead * (r.chamber_length_m / (r.chamber_length_m + shot.travel_m)) ** 2)
    z, peak = read / full_pa, int(np.argmax(read))
    if r.breech_linearity:
        read = read + r.breech_linearity * full_pa * 2.0 * z * (1.0 - z)
    if r.breech_hysteresis:
        y = true_pa / true_pa[peak]
        behind = np.arange(read.size) > peak
        read = read + behind * r.breech_hysteresis * full_pa * y * (1.0 - y)
    if r.breech_amplifier_s:
        read = read - lagged(read, float(motion.times_s[1]), r.breech_amplifier_s)
    return read


def acceleration_reading(felt: Array, step_s: float, r: Readings) -> Array:
    """Return what the recoil accelerometer reads of what it feels, shape (n,)."""
    read = felt
    if r.tube_axial_hz:
        read = read + ringing(2.0 * felt, step_s, r.tube_axial_hz, r.tube_axial_damping)
    if r.accelerometer_bracket_hz:
        read = low_pass(read, step_s, r.accelerometer_bracket_hz, r.accelerometer_bracket_damping)
    if r.accelerometer_amplifier_s:
        read = read - lagged(read, step_s, r.accelerometer_amplifier_s)
    return read


def travel_reading(
    travel_m: Array,
    felt: Array,
    motion: Motion | LineMotion,
    r: Readings,
    m: Mechanism,
    ground: tuple[float, float] | None,
) -> Array:
    """Return what a marker shows of the travel on the motion's grid, shape (n,).

    Parameters
    ----------
    felt : ndarray, shape (n,)
        Specific acceleration along the bore.
    ground
        Place of the mark from the centre of mass in the part's axes, m, for a camera on the ground; None for one that
        sees the travel along the bore.
    """
    step = float(motion.times_s[1])
    seen = on_the_ground(motion, m, *ground) if ground is not None and isinstance(motion, Motion) else travel_m
    if r.tube_axial_hz:
        bent = low_pass(2.0 * (felt - felt[0]), step, r.tube_axial_hz, r.tube_axial_damping)
        seen = seen + bent / (2 * math.pi * r.tube_axial_hz) ** 2
    if r.marker_bracket_hz:
        seen = low_pass(seen, step, r.marker_bracket_hz, r.marker_bracket_damping)
    if r.lens_m:
        share = travel_m / max(float(np.max(travel_m)), 1e-9)
        seen = seen + 4.0 * r.lens_m * share * (1.0 - share)
    return seen


def on_the_ground(motion: Motion, m: Mechanism, p_5: float = 0.0, p_6: float = 0.0) -> Array:
    """Return how far a mark of the recoiling part has come, along the bore at rest, rearward, shape (n,).

    Parameters
    ----------
    p_5, p_6
        Place of the mark from the centre of mass, along the bore and across it, m.
    """
    xi, eta, alpha, beta, x = motion.q.T
    phi1, phi2, lever, over = m.phi10 + alpha, m.phi20 + alpha + beta, m.b + p_5 - x, m.d + p_6
    forward = xi + m.XA * np.cos(phi1) - m.YA * np.sin(phi1) + lever * np.cos(phi2) - over * np.sin(phi2)
    up = eta + m.XA * np.sin(phi1) + m.YA * np.cos(phi1) + lever * np.sin(phi2) + over * np.cos(phi2)
    along = (forward - forward[0]) * math.cos(m.phi20) + (up - up[0]) * math.sin(m.phi20)
    return np.asarray(-along, dtype=np.float64)


def handed_on(
    signal: Array, times_s: Array, at_s: Array, latency_s: float, rate_hz: float, rng: np.random.Generator
) -> Array:
    """Return what a recorder has at instants of a signal that a gateway hands on, held and late, shape (n,)."""
    taken_s = np.arange(times_s[0] - rng.uniform() / rate_hz, times_s[-1], 1.0 / rate_hz)
    late_s = rng.gamma(_GATEWAY_SHAPE, latency_s / _GATEWAY_SHAPE, taken_s.size)
    # one that overtakes another takes its place
    arrive_s = np.maximum.accumulate(taken_s + late_s)
    values = np.interp(taken_s, times_s, signal)
    return np.asarray(values[np.maximum(np.searchsorted(arrive_s, at_s, side="right") - 1, 0)], dtype=np.float64)


def acceleration_noise(
    motion: Motion | LineMotion, felt: Array, at_s: Array, r: Readings, rng: np.random.Generator
) -> Array:
    """Return what the motion adds to the recoil accelerometer's noise at instants, m/s^2, shape (n,)."""
    moves = motion.moves(at_s)
    size = np.abs(np.interp(at_s, motion.times_s, felt))
    speed = np.abs(np.interp(at_s, motion.times_s, motion.speed_m_s))
    spread = np.sqrt(
        (r.noise_of_acceleration * size) ** 2 + (r.noise_of_speed_per_s * speed) ** 2 + r.structure_borne_m_s2**2
    )
    added = spread * moves * rng.normal(0.0, 1.0, at_s.shape)
    for at, times in zip(
        rng.uniform(motion.t_fire_s, motion.t_end_s, r.knocks), rng.standard_t(_KNOCK_FREEDOM, r.knocks), strict=True
    ):
        phase = (at_s - at) / _KNOCK_S
        pulse = np.where((phase > 0) & (phase < 1), np.sin(math.pi * np.clip(phase, 0.0, 1.0)), 0.0)
        added = added + r.knock_m_s2 * times * pulse
    return np.asarray(added, dtype=np.float64)


def gauge_noise(
    motion: Motion | LineMotion, reading: Array, full_scale: float, at_s: Array, r: Readings, rng: np.random.Generator
) -> Array:
    """Return what the motion adds to the noise of what reads a force at instants, in its SI unit, shape (n,).

    Parameters
    ----------
    reading : ndarray, shape (n,)
        Readings at the instants.
    full_scale
        Largest reading that the sensor has.
    """
    speed = np.abs(np.interp(at_s, motion.times_s, motion.speed_m_s))
    spread = np.hypot(r.noise_of_reading * reading, r.gauge_noise_of_speed_s_m * full_scale * speed)
    return np.asarray(spread * motion.moves(at_s) * rng.normal(0.0, 1.0, at_s.shape), dtype=np.float64)
