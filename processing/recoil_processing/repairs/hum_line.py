"""One line of the mains' hum: what is known of it, and how much of it may be taken off how far away."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array

LEAST_GAIN = 0.01
"""Share of a line below which nothing more is taken off."""


@dataclass(frozen=True)
class HumLine:
    """One line of the hum: ``amplitude cos(2 pi frequency (t - t0) + phase)``.

    Attributes
    ----------
    harmonic
        Multiple of the mains' frequency at which the line lies.
    amplitude, u_amplitude
        Amplitude and its standard uncertainty, in the unit of the samples.
    phase_rad, u_phase_rad
        Phase and its standard uncertainty at t0, the middle of the pre-trigger baseline, where it is known best.
    excess_db
        Level of the line over its neighbours.
    """

    harmonic: int
    frequency_hz: float
    u_frequency_hz: float
    amplitude: float
    u_amplitude: float
    phase_rad: float
    u_phase_rad: float
    excess_db: float

    def u_phase_at(self, since_s: Array) -> Array:
        """Return the standard uncertainty of the phase at instants after t0, rad, shape of `since_s`."""
        return np.hypot(self.u_phase_rad, 2 * np.pi * self.u_frequency_hz * since_s)

    def gain_at(self, since_s: Array) -> Array:
        """Return the share of the line that is taken off, shape of `since_s`.

        The amplitude's own uncertainty counts like a phase's; below `LEAST_GAIN` it is nothing.
        """
        u = np.hypot(self.u_phase_at(since_s), self.u_amplitude / self.amplitude)
        gain = np.exp(-0.5 * u**2)
        return np.asarray(np.where(gain >= LEAST_GAIN, gain, 0.0))

    def taken_at(self, since_s: Array) -> Array:
        """Return what is taken off, shape of `since_s`."""
        angle = 2 * np.pi * self.frequency_hz * since_s + self.phase_rad
        return np.asarray(self.gain_at(since_s) * self.amplitude * np.cos(angle))

    def quadrature_at(self, since_s: Array) -> Array:
        """Return what a phase that is off by its standard uncertainty leaves, shape of `since_s`."""
        angle = 2 * np.pi * self.frequency_hz * since_s + self.phase_rad
        return np.asarray(-math.sqrt(2.0) * self.u_left_at(since_s) * np.sin(angle))

    def u_left_at(self, since_s: Array) -> Array:
        """Return the root mean square of what is left of the line, shape of `since_s`: ``A sqrt((1 - g^2) / 2)``."""
        return np.asarray(self.amplitude * np.sqrt(0.5 * (1.0 - self.gain_at(since_s) ** 2)))
