"""What force gauges, accelerometer and camera recorded of one recoil, and what is known of them beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_processing.shot.clocks.autoregressive_noise import AutoregressiveNoise

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Recoil:
    """What force gauges, accelerometer and camera recorded of one recoil, on one clock.

    Attributes
    ----------
    start_s, step_s
        Time base of force and acceleration.
    force_n : ndarray, shape (n,)
        Finite, zero before the release.
    acceleration_m_s2 : ndarray, shape (n,)
        a' of the model; zero before the release but for noise.
    other_m_s2 : ndarray, shape (n,)
        The travel's acceleration that is not a', zero before the release.
    used : ndarray of bool, shape (n,)
        Samples of the acceleration that are compared with the force; the others are bridges.
    frame_times_s, displacement_m : ndarray, shape (n_frames,)
    """

    start_s: float
    step_s: float
    force_n: Array
    acceleration_m_s2: Array
    other_m_s2: Array
    used: Flags
    frame_times_s: Array
    displacement_m: Array
    release_s: float
    end_s: float

    def __post_init__(self) -> None:
        series = (self.force_n, self.acceleration_m_s2, self.other_m_s2)
        if self.force_n.ndim != 1 or any(one.shape != self.force_n.shape for one in (*series, self.used)):
            raise ValueError("force, acceleration, the other acceleration and flags must be equally long")
        if not all(np.all(np.isfinite(one)) for one in series):
            raise ValueError("force and accelerations must be finite; bridge lost samples first")
        if not (self.step_s > 0 and self.release_s < self.end_s):
            raise ValueError("the step must be positive and the release before the end")

    @property
    def times_s(self) -> Array:
        """Instants of force and acceleration, shape (n,)."""
        return np.asarray(self.start_s + self.step_s * np.arange(self.force_n.size))


@dataclass(frozen=True)
class Knowledge:
    """What is known beforehand.

    Attributes
    ----------
    force_sigma_n, quiet_sigma_m_s2
        White noise of force and acceleration per sample in the pre-trigger baseline.
    u_zero_m_s2, u_skew_s, u_shift_s, u_gain, u_scale
        Standard uncertainties of b, s, the camera's offset, g and c, which are zero to this; 0 to hold one, infinite
        to free it.
    """

    force_sigma_n: float
    quiet_sigma_m_s2: float
    u_zero_m_s2: float = math.inf
    u_skew_s: float = math.inf
    u_shift_s: float = 0.0
    u_gain: float = 0.0
    u_scale: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must be zero or positive, not {getattr(self, name)}")


@dataclass(frozen=True)
class NoiseLevels:
    """Of both kinds of rows.

    Attributes
    ----------
    density
        Of the walk, (m/s^2)^2/Hz, two-sided.
    """

    acceleration: AutoregressiveNoise
    marker_sigma_m: float
    density: float
