"""Velocity and travel from an acceleration, at its samples and between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


def integrate(samples: Array, step_s: float) -> Array:
    """Integrate evenly spaced samples by the trapezoidal rule from zero; shape (n,) to (n,)."""
    total = np.zeros_like(samples)
    np.cumsum(0.5 * step_s * (samples[1:] + samples[:-1]), out=total[1:])
    return total


@dataclass(frozen=True, eq=False)
class DoubleIntegral(ReadOnlyArrays):
    """The exact integrals of straight lines through the samples of an acceleration, from rest at the first one.

    Attributes
    ----------
    start_s, step_s
        Time base.
    acceleration, velocity, travel : ndarray, shape (n,), n at least 2
        m/s^2, m/s and m.
    """

    start_s: float
    step_s: float
    acceleration: Array
    velocity: Array
    travel: Array

    @classmethod
    def of(cls, acceleration: Array, start_s: float, step_s: float) -> DoubleIntegral:
        """Integrate an acceleration, shape (n,), without missing samples."""
        velocity = integrate(acceleration, step_s)
        # the trapezoidal rule over a parabola errs by h^3/12 times its second derivative, here the acceleration's rise
        travel = integrate(velocity, step_s) - step_s**2 / 12 * (acceleration - acceleration[0])
        return cls(start_s, step_s, acceleration, velocity, travel)

    def covers(self, times_s: Array) -> NDArray[np.bool_]:
        """Return which instants lie within the record, shape of `times_s`."""
        end_s = self.start_s + self.step_s * (self.acceleration.size - 1)
        return np.asarray((times_s >= self.start_s) & (times_s <= end_s))

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """Travel and velocity at any instants, shape of `times_s`; beyond the ends the outermost lines go on."""
        position = (times_s - self.start_s) / self.step_s
        i = np.clip(np.floor(position).astype(np.int64), 0, self.acceleration.size - 2)
        s, h = position - i, self.step_s
        a, rise = self.acceleration[i], self.acceleration[i + 1] - self.acceleration[i]
        travel = self.travel[i] + h * s * (self.velocity[i] + h * s * (a / 2 + s * rise / 6))
        return travel, self.velocity[i] + h * s * (a + s * rise / 2)
