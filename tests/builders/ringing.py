"""Synthetic recoil records with stress waves: the rigid-body truth, the ringing of five modes, white noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE_HZ = 50_000.0
DURATION_S = 0.30
PRE_TRIGGER_S = 0.040
PULSE_M_S2 = 2.0e6 / 782.0
"""2 MN on 782 kg."""
MASS_KG = 782.0
RISE_S, FALL_S = 2e-3, 10e-3
BRAKE_M_S2 = 300.0
BRAKE_S, BRAKE_RAMP_S, BRAKE_FROM_S = 80e-3, 3e-3, 2.5e-3
BURSTS_S = (0.0, 6.3e-3, 15e-3, 86e-3)
"""Shot, breech, brake valve, end of the stroke."""
_OVERSAMPLING = 4


@dataclass(frozen=True, eq=False)
class RingingRecord:
    """One accelerometer's record and what it hides.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        0 is the shot.
    truth_m_s2, ringing_m_s2, recorded_m_s2 : ndarray, shape (n,)
        The last is the sum of the first two and white noise.
    force_n : ndarray, shape (n,)
        Mass times truth, with 0.5 % white noise.
    frequencies_hz, damping_ratios : ndarray, shape (5,)
    """

    times_s: Array
    truth_m_s2: Array
    ringing_m_s2: Array
    recorded_m_s2: Array
    force_n: Array
    frequencies_hz: Array
    damping_ratios: Array

    @property
    def onset_index(self) -> int:
        """First sample of the shot."""
        return int(np.searchsorted(self.times_s, -0.5 / RATE_HZ))

    def error(self, estimate: Array) -> float:
        """Norm of the error over that of the truth, from 5 ms before to 120 ms after the shot."""
        inside = (self.times_s >= -5e-3) & (self.times_s <= 0.12)
        return float(np.linalg.norm((estimate - self.truth_m_s2)[inside]) / np.linalg.norm(self.truth_m_s2[inside]))


def rigid_body(times_s: Array, *, smooth: bool = False) -> Array:
    """Acceleration of the recoiling mass: the shot, then the brake with a ripple of 10 %."""
    rising = np.clip(times_s / RISE_S, 0.0, 1.0)
    falling = np.clip((times_s - RISE_S) / FALL_S, 0.0, 1.0)
    power = 2 if smooth else 1
    pulse = np.sin(0.5 * np.pi * rising) ** power * np.cos(0.5 * np.pi * falling) ** power
    since = times_s - BRAKE_FROM_S
    ramps = np.clip(since / BRAKE_RAMP_S, 0.0, 1.0) * np.clip((BRAKE_S + BRAKE_RAMP_S - since) / BRAKE_RAMP_S, 0.0, 1.0)
    return np.asarray(PULSE_M_S2 * pulse - BRAKE_M_S2 * ramps * (1.0 + 0.1 * np.sin(2 * np.pi * 40.0 * since)))


def modal_acceleration(
    times_s: Array, frequencies_hz: Array, damping_ratios: Array, gains: Array, knocks: Array
) -> Array:
    """Acceleration of modes that short forces excite: ``s^2 / (s^2 + 2 zeta w s + w^2)`` of each force.

    Its double zero at frequency zero is what a structure has that rings about its own motion: no net
    velocity stays.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
    frequencies_hz, damping_ratios, gains : ndarray, shape (n_modes,)
    knocks : ndarray, shape (n_knocks, 3)
        Instant in s, length in s of the half-sine of force, strength.
    """
    step = float(times_s[1] - times_s[0]) / _OVERSAMPLING
    # twice the record: what is left of the last knock must not come round to the beginning
    count = 2 * _OVERSAMPLING * times_s.size
    fine = times_s[0] + step * np.arange(count)
    force = np.zeros(count)
    for instant, length, strength in knocks:
        phase = (fine - instant) / length
        force += strength * np.where((phase > 0) & (phase < 1), np.sin(np.pi * phase), 0.0)
    s = 2j * np.pi * np.fft.rfftfreq(count, step)
    response = np.zeros(s.size, dtype=np.complex128)
    for f, zeta, gain in zip(frequencies_hz, damping_ratios, gains, strict=True):
        w = 2 * np.pi * f
        response += gain * s**2 / (s**2 + 2 * zeta * w * s + w**2)
    ringing = np.fft.irfft(np.fft.rfft(force) * response, count)
    return np.asarray(ringing[: _OVERSAMPLING * times_s.size : _OVERSAMPLING])


def ringing_record(
    seed: int,
    *,
    ringing: float = 2.0,
    smooth: bool = False,
    lowest_hz: float = 900.0,
    noise_share: float = 0.01,
    rate_hz: float = RATE_HZ,
) -> RingingRecord:
    """Record a shot with stress waves.

    Parameters
    ----------
    seed : int
        Of the modes, the knocks and the noise.
    ringing : float
        Peak of the ringing over that of the pulse.
    smooth : bool
        Whether the pulse begins and ends without a break of slope.
    lowest_hz : float
        Lower edge of the modes, up to 4 kHz; one always lies within 15 % of it.
    noise_share : float
        Standard deviation of the white noise over the pulse's peak.
    rate_hz : float
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(DURATION_S * rate_hz)) / rate_hz - PRE_TRIGGER_S
    truth = rigid_body(times, smooth=smooth)
    frequencies = np.sort(np.append(rng.uniform(lowest_hz, 4000.0, 4), lowest_hz * rng.uniform(1.0, 1.15)))
    damping = rng.uniform(0.006, 0.03, 5)
    gains = rng.uniform(0.4, 1.0, 5) * rng.choice([-1.0, 1.0], 5)
    instants = np.array(BURSTS_S) + np.array([0.0, 0.3e-3, 0.5e-3, 1e-3]) * rng.uniform(-1.0, 1.0, 4)
    strengths = np.array([1.0, 0.7, 0.5, 0.6]) * rng.uniform(0.7, 1.3, 4)
    knocks = np.column_stack([instants, rng.uniform(0.08e-3, 0.35e-3, 4), strengths])
    waves = modal_acceleration(times, frequencies, damping, gains, knocks)
    waves *= ringing * PULSE_M_S2 / np.abs(waves).max()
    recorded = truth + waves + noise_share * PULSE_M_S2 * rng.standard_normal(times.size)
    force = MASS_KG * (truth + 0.005 * PULSE_M_S2 * rng.standard_normal(times.size))
    return RingingRecord(times, truth, waves, recorded, force, frequencies, damping)
