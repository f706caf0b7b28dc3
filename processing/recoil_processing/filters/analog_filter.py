"""An analogue low-pass in a sensor's chain: by how much it delays a slow signal, and what it lets through."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.arguments import require_positive

FilterType = Literal["bessel", "butterworth"]

MOST_ORDER = 25
"""Order beyond which the poles of a Bessel low-pass are no longer found to the digits that they need."""


@dataclass(frozen=True)
class AnalogLowPass:
    """An analogue low-pass, passed once.

    Attributes
    ----------
    cutoff_hz
        Frequency of the low-pass's -3 dB point.
    kind
        ``bessel`` or ``butterworth``.

    Raises
    ------
    ValueError
        If the cut-off is not positive, the order is not a whole number from 1 to 25, or the kind is unknown.
    """

    cutoff_hz: float
    kind: FilterType = "butterworth"
    order: int = 4

    def __post_init__(self) -> None:
        require_positive(cutoff_hz=self.cutoff_hz)
        if not (1 <= self.order <= MOST_ORDER and self.order == int(self.order)):
            raise ValueError(f"order must be a whole number from 1 to {MOST_ORDER}, not {self.order}")
        if self.kind not in ("bessel", "butterworth"):
            raise ValueError(f"kind must be bessel or butterworth, not {self.kind!r}")

    @cached_property
    def _poles(self) -> NDArray[np.complex128]:
        """Poles of the prototype that is 3 dB down at 1 rad/s."""
        from scipy.signal import bessel, butter

        if self.kind == "butterworth":
            _, poles, _ = butter(int(self.order), 1.0, analog=True, output="zpk")
        else:
            _, poles, _ = bessel(int(self.order), 1.0, analog=True, norm="mag", output="zpk")
        return np.asarray(poles, dtype=np.complex128)

    @property
    def delay_s(self) -> float:
        """Delay of a slow signal, seconds.

        The phase of ``H(s) = prod(-p) / prod(s - p)`` falls off at zero frequency by ``sum(Re(-1/p))``, which is the
        group delay there: ``1 / (2 pi fc sin(pi/2n))`` for a Butterworth low-pass of order n. That of a Bessel
        low-pass, which is as flat as can be, holds up to its corner (W. E. Thomson, Proc. IEE 96(3), 1949).
        """
        return float(np.sum((-1.0 / self._poles).real)) / (2 * math.pi * self.cutoff_hz)

    def gain(self, frequency_hz: Array) -> Array:
        """Amplitude, shape of `frequency_hz`."""
        s = 1j * frequency_hz / self.cutoff_hz
        response = np.ones(np.shape(s), dtype=np.complex128)
        for pole in self._poles:
            response *= -pole / (s - pole)
        return np.asarray(np.abs(response), dtype=np.float64)
