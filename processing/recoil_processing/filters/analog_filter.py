"""An analogue low-pass in a sensor's chain: by how much it delays a slow signal, and what it lets through."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FilterType = Literal["bessel", "butterworth"]

MOST_ORDER = 25
"""Beyond it the poles of the Bessel low-pass by which ours is checked lose their digits."""


@dataclass(frozen=True)
class AnalogLowPass:
    """An analogue low-pass, passed once.

    Attributes
    ----------
    cutoff_hz
        Its -3 dB point.
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
        if not (math.isfinite(self.cutoff_hz) and self.cutoff_hz > 0):
            raise ValueError(f"cutoff_hz must be positive, not {self.cutoff_hz}")
        if not (1 <= self.order <= MOST_ORDER and self.order == int(self.order)):
            raise ValueError(f"order must be a whole number from 1 to {MOST_ORDER}, not {self.order}")
        if self.kind not in ("bessel", "butterworth"):
            raise ValueError(f"kind must be bessel or butterworth, not {self.kind!r}")

    @cached_property
    def _bessel(self) -> tuple[Array, float]:
        """Coefficients of ``1 / gain^2`` in falling powers of ``(f/fc)^2`` of a Bessel low-pass, and ``2 pi fc delay``.

        ``H(s) = B(0) / B(s)`` with the reverse Bessel polynomial B delays a slow signal by 1 s (W. E. Thomson,
        Proc. IEE 96(3), 1949); it is taken at the frequency where it is 3 dB down. The coefficients of ``|B(jw)|^2``
        are whole positive numbers: nothing cancels.
        """
        n, factorial = int(self.order), math.factorial
        b = [factorial(2 * n - k) // (2 ** (n - k) * factorial(k) * factorial(n - k)) for k in range(n + 1)]
        power = [
            sum((-1) ** (i - m) * b[i] * b[2 * m - i] for i in range(max(2 * m - n, 0), min(2 * m, n) + 1))
            for m in range(n, -1, -1)
        ]
        shares = np.array([one / power[-1] for one in power])
        # Newton's steps go straight to the corner once they are above it: the polynomial and its slope only rise
        corner = (2 * n - 1) * math.log(2.0)
        for _ in range(20):
            corner -= float((np.polyval(shares, corner) - 2.0) / np.polyval(np.polyder(shares), corner))
        return shares * corner ** np.arange(n, -1, -1), math.sqrt(corner)

    @property
    def delay_s(self) -> float:
        """Delay of a slow signal, seconds.

        That of a Butterworth low-pass of order n is ``1 / (2 pi fc sin(pi/2n))``, the sum of ``Re(-1/p)`` over its
        poles. That of a Bessel low-pass, which is as flat as can be, holds up to its corner.
        """
        slow = self._bessel[1] if self.kind == "bessel" else 1.0 / math.sin(math.pi / (2 * self.order))
        return slow / (2 * math.pi * self.cutoff_hz)

    def gain(self, frequency_hz: Array) -> Array:
        """Amplitude, shape of `frequency_hz`."""
        # scipy.signal has the poles of both, but takes a third of a second to import
        square = (frequency_hz / self.cutoff_hz) ** 2
        with np.errstate(over="ignore"):  # so far up nothing is left
            power = np.polyval(self._bessel[0], square) if self.kind == "bessel" else 1.0 + square ** int(self.order)
            return np.asarray(1.0 / np.sqrt(power), dtype=np.float64)
