"""Synthetic recoil motions, known in closed form, as a camera and an accelerometer record them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ONSET_S = 0.1
"""Begin of the motion on the reference clock."""
PULSES = (
    (2400.0, ONSET_S, 0.008),  # the shot: to 9.6 m/s
    (-160.0, ONSET_S + 0.004, 0.120),  # the brake: to rest after 0.6 m
    (-20.0, ONSET_S + 0.150, 0.200),  # the recuperator: to -2 m/s
    (20.0, ONSET_S + 0.430, 0.200),  # the buffer: to rest near battery
)
"""Amplitude in m/s^2, begin and duration in s of every ``sin^2`` pulse of acceleration."""


def travel(times_s: Array, pulses: tuple[tuple[float, float, float], ...] = PULSES) -> Array:
    """Travel in m at instants of the reference clock."""
    total = np.zeros_like(times_s)
    for amplitude, begin, duration in pulses:
        u = np.clip(times_s - begin, 0.0, duration)
        total += amplitude * (u**2 / 4 + duration**2 / (8 * np.pi**2) * (np.cos(2 * np.pi * u / duration) - 1))
        total += amplitude * duration / 2 * np.maximum(times_s - begin - duration, 0.0)
    return total


def velocity(times_s: Array, pulses: tuple[tuple[float, float, float], ...] = PULSES) -> Array:
    """Velocity in m/s at instants of the reference clock."""
    total = np.zeros_like(times_s)
    for amplitude, begin, duration in pulses:
        u = np.clip(times_s - begin, 0.0, duration)
        total += amplitude * (u / 2 - duration / (4 * np.pi) * np.sin(2 * np.pi * u / duration))
    return total


def acceleration(times_s: Array, pulses: tuple[tuple[float, float, float], ...] = PULSES) -> Array:
    """Acceleration in m/s^2 at instants of the reference clock."""
    total = np.zeros_like(times_s)
    for amplitude, begin, duration in pulses:
        u = np.clip(times_s - begin, 0.0, duration)
        total += amplitude * np.sin(np.pi * u / duration) ** 2
    return total


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """One motion on two clocks, ``t_ref = (1 + drift) t_camera + offset_s``.

    Attributes
    ----------
    camera_times_s, displacement_m : ndarray, shape (n_frames,)
    start_s, step_s : float
        Time base of the accelerometer, which is the reference clock.
    acceleration_m_s2 : ndarray, shape (n_samples,)
    marker_sigma_m, acceleration_sigma_m_s2 : float
        White noise of the two.
    offset_s, drift : float
        How the clocks map.
    gain : float
        Camera scale over accelerometer scale.
    """

    camera_times_s: Array
    displacement_m: Array
    start_s: float
    step_s: float
    acceleration_m_s2: Array
    marker_sigma_m: float
    acceleration_sigma_m_s2: float
    offset_s: float
    drift: float
    gain: float

    @property
    def reference_times_s(self) -> Array:
        """Instants of the acceleration, shape (n_samples,)."""
        return np.asarray(self.start_s + self.step_s * np.arange(self.acceleration_m_s2.size))


def record_motion(
    seed: int,
    *,
    offset_s: float = 0.0531372,
    drift: float = 0.0,
    gain: float = 1.01,
    bias_m_s2: float = 2.0,
    marker_sigma_m: float = 5e-5,
    acceleration_sigma_m_s2: float = 5.0,
    frame_rate_hz: float = 2000.0,
    first_frame_s: float = 0.0,
    frames: int = 1500,
    rate_hz: float = 20000.0,
    start_s: float = 0.0,
    duration_s: float = 0.9,
    lost_share: float = 0.0,
    pulses: tuple[tuple[float, float, float], ...] = PULSES,
) -> RecordedMotion:
    """Record a motion by a camera and an accelerometer.

    Parameters
    ----------
    seed : int
        Of all noise.
    offset_s, drift : float
        How the camera's clock maps to the accelerometer's.
    gain : float
        Camera scale over accelerometer scale; the camera's is right.
    bias_m_s2 : float
        Of the accelerometer.
    marker_sigma_m, acceleration_sigma_m_s2 : float
    frame_rate_hz, first_frame_s, frames
        The camera's frames on its own clock.
    rate_hz, start_s, duration_s : float
        The accelerometer's record.
    lost_share : float
        Of the frames, at random, NaN.
    pulses
        The motion.
    """
    rng = np.random.default_rng(seed)
    camera_times = first_frame_s + np.arange(frames) / frame_rate_hz
    displacement = travel((1.0 + drift) * camera_times + offset_s, pulses)
    displacement = displacement + marker_sigma_m * rng.standard_normal(frames)
    times = start_s + np.arange(round(duration_s * rate_hz)) / rate_hz
    felt = acceleration(times, pulses) / gain + bias_m_s2
    felt = felt + acceleration_sigma_m_s2 * rng.standard_normal(times.size)
    displacement[rng.random(frames) < lost_share] = np.nan
    return RecordedMotion(
        camera_times_s=camera_times,
        displacement_m=displacement,
        start_s=start_s,
        step_s=1.0 / rate_hz,
        acceleration_m_s2=felt,
        marker_sigma_m=marker_sigma_m,
        acceleration_sigma_m_s2=acceleration_sigma_m_s2,
        offset_s=offset_s,
        drift=drift,
        gain=gain,
    )
