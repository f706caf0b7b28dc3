"""The recoil on which estimators of the mass are compared: known forces, a noisy accelerometer that rings, a camera.

782 kg, a breech force of 2 MN over about 10 ms, a brake of 0.3 MN: 2528 m/s^2, 23.3 m/s, 0.88 m in 74 ms. The
accelerometer's white noise is 5 % of its peak; two stress waves ring from the ignition on and again when the breech
force ends, with random phases and amplitudes. Forces have white noise of 1 % of their full scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

MASS_KG = 782.0
RATE_HZ = 20_000.0
FRAME_RATE_HZ = 5_000.0
PRE_TRIGGER_S = 0.2
BREECH_N, BRAKE_N = 2.0e6, 0.3e6
RISE_S, FALL_FROM_S, FALL_S, BRAKE_RISE_S = 3.2e-3, 8.6e-3, 5.6e-3, 18e-3
ACCELERATION_NOISE = 0.05
FORCE_NOISE = 0.01
MARKER_SIGMA_M = 3e-4
SECOND_RING_S = 9.5e-3
MODES = ((1200.0, 0.30, 8e-3), (3000.0, 0.20, 4e-3))
"""Frequency in Hz, amplitude over the peak of the acceleration, time constant in s."""
SECOND_RING = 0.5
"""Amplitude of the second burst over the first one's."""
AMPLITUDE_SPREAD = 0.3
FINE = 20
"""Steps of integration per sample."""


def _rise(since_s: np.ndarray, duration_s: float) -> np.ndarray:
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(since_s / duration_s, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class TrueRecoil:
    """The motion at the samples, shape (n,), and at the frames; zero is the onset of force.

    ``moving`` are the samples from the onset to the end of travel.
    """

    times_s: np.ndarray
    forces_n: np.ndarray
    acceleration_m_s2: np.ndarray
    moving: slice
    end_s: float
    frame_times_s: np.ndarray
    displacement_m: np.ndarray
    velocity_at_frames_m_s: np.ndarray
    peak_m_s2: float
    rms_m_s2: float


def _forces(t: np.ndarray) -> np.ndarray:
    """Breech and brake force, the latter as if the part moved for ever, shape (n, 2)."""
    breech = BREECH_N * _rise(t, RISE_S) * (1.0 - _rise(t - FALL_FROM_S, FALL_S))
    brake = -BRAKE_N * _rise(t, BRAKE_RISE_S)
    return np.column_stack([breech, brake])


@cache
def true_recoil() -> TrueRecoil:
    step = 1.0 / (FINE * RATE_HZ)
    fine = step * np.arange(round(0.1 / step))
    acceleration = _forces(fine).sum(axis=1) / MASS_KG
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * step * (acceleration[1:] + acceleration[:-1]))])
    travel = np.concatenate([[0.0], np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]))])
    end_s = float(fine[int(np.argmax(velocity)) + int(np.argmax(velocity[int(np.argmax(velocity)) :] <= 0))])
    first = round(PRE_TRIGGER_S * RATE_HZ)
    times = (np.arange(first + int(end_s * RATE_HZ) + 1) - first) / RATE_HZ
    forces = np.where((times >= 0)[:, None], _forces(times), 0.0)
    a = forces.sum(axis=1) / MASS_KG
    frames = (np.arange(round((PRE_TRIGGER_S + end_s) * FRAME_RATE_HZ)) - PRE_TRIGGER_S * FRAME_RATE_HZ) / FRAME_RATE_HZ
    moving = slice(first, times.size)
    return TrueRecoil(
        times,
        forces,
        a,
        moving,
        end_s,
        frames,
        np.interp(frames, fine, travel, left=0.0),
        np.interp(frames, fine, velocity, left=0.0),
        float(a.max()),
        math.sqrt(float(np.mean(a[moving] ** 2))),
    )


def ringing_shapes(times_s: np.ndarray) -> np.ndarray:
    """Cosine and sine of every burst of amplitude 1 of its mode's, shape (n, 8), m/s^2."""
    peak = true_recoil().peak_m_s2
    columns = []
    for start_s, burst in ((0.0, 1.0), (SECOND_RING_S, SECOND_RING)):
        since = np.maximum(times_s - start_s, 0.0)
        for hz, share, tau in MODES:
            envelope = np.where(times_s >= start_s, burst * share * peak * np.exp(-since / tau), 0.0)
            columns += [envelope * np.cos(2 * np.pi * hz * since), envelope * np.sin(2 * np.pi * hz * since)]
    return np.column_stack(columns)


@dataclass(frozen=True, eq=False)
class RecordedRecoil:
    """One shot as recorded, on the samples and frames of `true_recoil`."""

    acceleration_m_s2: np.ndarray
    forces_n: np.ndarray
    displacement_m: np.ndarray

    @property
    def force_n(self) -> np.ndarray:
        return np.asarray(self.forces_n.sum(axis=1))


def record_recoil(
    seed: int,
    *,
    ringing: float = 1.0,
    zero_shift: float = 0.0,
    force_late_samples: int = 0,
    breech_gain: float = 1.0,
    brake_gain: float = 1.0,
    acceleration_gain: float = 1.0,
    camera_scale: float = 1.0,
) -> RecordedRecoil:
    """Record the recoil with the noise of one seed, and with errors of the sensors.

    ``zero_shift`` is a step of the accelerometer's zero at the onset, as a share of its peak.
    """
    true, rng = true_recoil(), np.random.default_rng(seed)
    t = true.times_s
    weights = []
    for _ in range(2 * len(MODES)):
        amplitude = 1.0 + AMPLITUDE_SPREAD * rng.uniform(-1.0, 1.0)
        phase = rng.uniform(0.0, 2 * np.pi)
        weights += [amplitude * math.cos(phase), amplitude * math.sin(phase)]
    a = acceleration_gain * (true.acceleration_m_s2 + ringing * ringing_shapes(t) @ np.array(weights))
    a = a + ACCELERATION_NOISE * true.peak_m_s2 * rng.standard_normal(t.size)
    a = a + zero_shift * true.peak_m_s2 * (t >= 0)
    forces = np.roll(true.forces_n, force_late_samples, axis=0) * [breech_gain, brake_gain]
    forces[:force_late_samples] = 0.0
    forces = forces + FORCE_NOISE * np.array([BREECH_N, BRAKE_N]) * rng.standard_normal((t.size, 2))
    x = camera_scale * true.displacement_m + MARKER_SIGMA_M * rng.standard_normal(true.displacement_m.size)
    return RecordedRecoil(a, forces, x)
