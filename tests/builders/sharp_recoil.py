"""A recoil with a shot that is over in milliseconds, known in closed form, as camera and accelerometer record it.

Harder on derivatives than `tests.builders.motions`: the force sets in with a kink, and brake and recuperator take over
within milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ONSET_S = 0.1
PEAK_M_S2, PEAK_AFTER_S = 2430.0, 1.43e-3
"""Of the shot's ``A (u/T) exp(1 - u/T)``, u from the onset: it reaches 9.45 m/s."""
RAMPS = ((-73.0, 0.102, 0.008), (60.0, 0.228, 0.012), (13.0, 0.300, 0.300))
"""Height in m/s^2, begin and duration in s of accelerations that set in as ``sin^2`` and stay."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Travel as a camera saw it and acceleration as a sensor felt it, on one clock.

    Attributes
    ----------
    frame_times_s, displacement_m : ndarray, shape (n_frames,)
    step_s : float
        Of the accelerometer, which starts at 0.
    acceleration_m_s2 : ndarray, shape (n_samples,)
    """

    frame_times_s: Array
    displacement_m: Array
    step_s: float
    acceleration_m_s2: Array

    @property
    def times_s(self) -> Array:
        """Instants of the acceleration, shape (n_samples,)."""
        return np.asarray(self.step_s * np.arange(self.acceleration_m_s2.size))


def motion(times_s: Array) -> tuple[Array, Array, Array]:
    """Travel, velocity and acceleration, SI, shape of `times_s` each."""
    u, tau = np.maximum(times_s - ONSET_S, 0.0), PEAK_AFTER_S
    height, decay = PEAK_M_S2 * np.e, np.exp(-np.maximum(times_s - ONSET_S, 0.0) / PEAK_AFTER_S)
    x = height * tau * (u - 2 * tau + (u + 2 * tau) * decay)
    v = height * (tau - (u + tau) * decay)
    a = height * u / tau * decay
    for step, begin, duration in RAMPS:
        s = np.clip((times_s - begin) / duration, 0.0, 1.0)
        after = np.maximum(times_s - begin - duration, 0.0)
        a = a + step * np.sin(np.pi * s / 2) ** 2
        v = v + step * (duration * (s / 2 - np.sin(np.pi * s) / (2 * np.pi)) + after)
        x = x + step * (
            duration**2 * (s**2 / 4 + (np.cos(np.pi * s) - 1) / (2 * np.pi**2)) + after * duration / 2 + after**2 / 2
        )
    return x, v, a


def record_recoil(
    seed: int,
    *,
    frame_rate_hz: float = 2000.0,
    begin_s: float = 0.0,
    end_s: float = 0.6,
    marker_sigma_m: float = 5e-5,
    acceleration_sigma_m_s2: float = 5.0,
    rate_hz: float = 20000.0,
    gain: float = 1.01,
    bias_m_s2: float = 2.0,
) -> Recorded:
    """Record the recoil; the frames fall between the accelerometer's samples.

    Parameters
    ----------
    seed : int
    frame_rate_hz, begin_s, end_s : float
        Of the camera; the accelerometer records from 0 to 0.6 s.
    marker_sigma_m, acceleration_sigma_m_s2 : float
        White noises.
    rate_hz : float
        Of the accelerometer.
    gain : float
        Camera's scale, which is right, over the accelerometer's.
    bias_m_s2 : float
        Of the accelerometer.
    """
    rng = np.random.default_rng(seed)
    frames = begin_s + (np.arange(round((end_s - begin_s) * frame_rate_hz)) + rng.random()) / frame_rate_hz
    seen = motion(frames)[0] + marker_sigma_m * rng.standard_normal(frames.size)
    times = np.arange(round(0.6 * rate_hz) + 1) / rate_hz
    felt = motion(times)[2] / gain + bias_m_s2 + acceleration_sigma_m_s2 * rng.standard_normal(times.size)
    return Recorded(frames, seen, 1.0 / rate_hz, felt)
