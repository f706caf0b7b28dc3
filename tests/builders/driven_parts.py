"""A part that a force drives to the rear while sensors watch: plain arrays, no mechanism and no files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_identification.targets.forces.measured_force import MeasuredForce, TrackedTravel
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.stress_waves.ringing import Mode

MASS_KG = 800.0
ONSET_S = 0.004
HELD_N = 12e3
RATE_HZ = 50e3
GAIN_ERROR = 0.004


@dataclass(frozen=True, eq=False)
class DrivenPart:
    """What is true, and what the sensors say."""

    force_n: np.ndarray
    measured: MeasuredForce
    tracked: TrackedTravel
    modes: tuple[Mode, ...]


def driven_part(seed: int = 1, *, ringing_n: float = 150e3, gain_error: float = GAIN_ERROR) -> DrivenPart:
    """Drive the part by a pulse of 1.1 MN; the accelerometer rings at one mode and reads high."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(0.05 * RATE_HZ)) / RATE_HZ
    since = np.maximum(times - ONSET_S, 0.0)
    force = HELD_N + 1.8e6 * -np.expm1(-((since / 1.5e-3) ** 3)) * np.exp(-since / 5e-3)
    resistance = HELD_N + 20e3 * (1 - np.exp(-since / 5e-3))
    acceleration = (force - resistance) / MASS_KG
    mode = Mode(1500.0, 0.02, 0.1, ringing_n / MASS_KG)
    w = 2 * np.pi * mode.frequency_hz
    knock = np.maximum(since - 3e-4, 0.0)
    rings = ringing_n * np.where(knock > 0, np.exp(-0.02 * w * knock) * np.sin(w * knock), 0.0)
    noise = MASS_KG * 5.0
    read = (1 + gain_error) * acceleration * MASS_KG + rings + resistance + noise * rng.normal(size=times.size)
    frames = np.arange(0.0, 0.0499, 1 / 6000)
    travel = DoubleIntegral.of(acceleration, 0.0, 1 / RATE_HZ).at(frames)[0]
    measured = MeasuredForce(
        0.0, 1 / RATE_HZ, read, resistance, acceleration, np.zeros_like(times), MASS_KG, noise, 0.005, 0.3
    )
    tracked = TrackedTravel(frames, 0.02 + travel + 5e-5 * rng.normal(size=frames.size), 5e-5, 0.001, 1e-5)
    return DrivenPart(force, measured, tracked, (mode,))
