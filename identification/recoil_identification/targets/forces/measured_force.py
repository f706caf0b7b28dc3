"""The force on the recoiling part as its sensors show it, before any estimate: accelerometer, gauges and camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

U_FREE_CLOCK_S = 1e-4
"""Standard uncertainty of an offset between the clocks that the same motion told: it is told anew here, not twice."""


@dataclass(frozen=True, eq=False)
class TrackedTravel(ReadOnlyArrays):
    """A camera's travel, on the clock of the force.

    Attributes
    ----------
    times_s, positions_m : ndarray, shape (n_frames,)
        Strictly increasing, finite.
    sigma_m
        White noise.
    u_scale
        Relative standard uncertainty of its scale.
    u_clock_s
        Standard uncertainty of its clock's offset.
    """

    times_s: Array
    positions_m: Array
    sigma_m: float
    u_scale: float
    u_clock_s: float


@dataclass(frozen=True, eq=False)
class MeasuredForce(ReadOnlyArrays):
    """The force as accelerometer and gauges show it, at evenly spaced instants.

    Attributes
    ----------
    force_n : ndarray, shape (n,)
        ``m3 a_read + R_f``; lost samples NaN.
    resistance_n : ndarray, shape (n,)
        R_f by the gauges, lost samples bridged.
    acceleration_m_s2 : ndarray, shape (n,)
        a' about right, for the effect of the sensors' errors: smooth, lost samples bridged.
    carried_m_s2 : ndarray, shape (n,)
        c.
    noise_n
        Standard deviation of the force's white noise, per sample.
    u_gain
        Relative standard uncertainty of the accelerometer's sensitivity.
    u_zero_m_s2
        Standard uncertainty of the accelerometer's zero.
    """

    start_s: float
    step_s: float
    force_n: Array
    resistance_n: Array
    acceleration_m_s2: Array
    carried_m_s2: Array
    mass_kg: float
    noise_n: float
    u_gain: float
    u_zero_m_s2: float

    @property
    def times_s(self) -> Array:
        """The instants, shape (n,)."""
        return np.asarray(self.start_s + self.step_s * np.arange(self.force_n.size))

    def thinned(self, factor: int) -> MeasuredForce:
        """Return the means of blocks, each dated at its middle; what is left over at the end is dropped."""
        if factor < 1:
            raise ValueError(f"the factor must be at least 1, not {factor}")
        count = self.force_n.size // factor

        def means(samples: Array) -> Array:
            return np.asarray(samples[: count * factor].reshape(count, factor).mean(axis=1))

        blocks = self.force_n[: count * factor].reshape(count, factor)
        there = np.isfinite(blocks).all(axis=1)
        force = np.full(count, np.nan)
        force[there] = blocks[there].mean(axis=1)
        return MeasuredForce(
            self.start_s + 0.5 * (factor - 1) * self.step_s,
            factor * self.step_s,
            force,
            means(self.resistance_n),
            means(self.acceleration_m_s2),
            means(self.carried_m_s2),
            self.mass_kg,
            self.noise_n / math.sqrt(factor),
            self.u_gain,
            self.u_zero_m_s2,
        )
