"""A zero-phase Butterworth low-pass filter that says where its -3 dB point is.

A filter that is run forward and backward has twice the attenuation of one pass: the corner given to
the usual design functions is then a -6 dB point. Here the cut-off is always the -3 dB point of the
two passes together, at any sampling rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.arguments import require_positive
from recoil_processing.filters.two_pass import TwoPass
from recoil_processing.filters.zero_phase_filter import (
    FilterDescription,
    apply_bridged,
    check_below_nyquist,
    check_shape,
)

ROWS_PER_CUTOFF = 2.5
"""Rows per period of the cut-off to which a filtered record is thinned: white noise is uncorrelated at about two."""
_TIME_CONSTANTS = 4.0
"""Time constants of the slowest pole after which less than 1 % of a step is left, for half orders 1 to 8."""


@dataclass(frozen=True)
class LowPass:
    """A zero-phase Butterworth low-pass filter.

    One value of this type filters every channel that enters one regression. A linear filter
    commutes with ``F = m a`` only if it is the same on both sides; `recoil_processing.filters.filtered.filter_alike`
    leaves no way to give each side its own.

    Attributes
    ----------
    cutoff_hz
        -3 dB point of the two passes together.
    half_order
        Order of one pass; the net order is twice that.
    padding_periods
        Periods of the cut-off by which a record is continued, ``padding_periods * rate_hz / cutoff_hz`` samples,
        rounded up; by all of the record where that is shorter.

    Raises
    ------
    ValueError
        If the cut-off is not positive and finite, or the order is not a positive whole number.
    """

    cutoff_hz: float
    half_order: int = 4

    padding_periods: ClassVar[float] = 3.0

    def __post_init__(self) -> None:
        require_positive(cutoff_hz=self.cutoff_hz)
        if self.half_order < 1 or self.half_order != int(self.half_order):
            raise ValueError(f"half_order must be a whole number of at least 1, not {self.half_order}")

    @property
    def _stretch(self) -> float:
        """Corner of one pass over the -3 dB point of both, of the analogue prototype.

        One pass has ``|H|^2 = 1 / (1 + (f/fd)^(2n))``; two have that as amplitude, which is
        ``1/sqrt(2)`` where ``(f/fd)^(2n) = sqrt(2) - 1``.
        """
        return float((math.sqrt(2.0) - 1.0) ** (-1.0 / (2 * self.half_order)))

    @property
    def design_hz(self) -> float:
        """Corner of one pass of the analogue prototype, so that both together are 3 dB down at `cutoff_hz`."""
        return self.cutoff_hz * self._stretch

    def corner_hz(self, rate_hz: float) -> float:
        """Corner of one pass of the sampled filter, which is the -6 dB point of both.

        The bilinear transform maps a frequency f to ``tan(pi f / rate)``; the corner is chosen there, so
        that the -3 dB point stays at `cutoff_hz` however near Nyquist it is.

        Raises
        ------
        ValueError
            If the cut-off is not below the Nyquist frequency.
        """
        check_below_nyquist(self.cutoff_hz, rate_hz)
        return rate_hz / math.pi * math.atan(self._stretch * math.tan(math.pi * self.cutoff_hz / rate_hz))

    @property
    def reach_s(self) -> float:
        """The time over which a sample spreads to either side, seconds: 1.5 periods of the cut-off at the usual order.

        Four time constants ``1 / (2 pi fd sin(pi / 2n))`` of the slowest pole. Beyond it, less than
        1 % is left of a disturbance that lasts.
        """
        return _TIME_CONSTANTS / (2 * math.pi * self.design_hz * math.sin(math.pi / (2 * self.half_order)))

    def at(self, cutoff_hz: float) -> LowPass:
        """Return a filter of the same order with another cut-off; errors as of the class."""
        return replace(self, cutoff_hz=cutoff_hz)

    def reach_samples(self, rate_hz: float) -> int:
        """Return the number of samples over which a single one spreads to either side at a sampling rate.

        Four time constants of the slowest pole ``(1 + s) / (1 - s)`` of the sampled filter: `reach_s`
        far below the Nyquist frequency, more near it.
        """
        corner = self._stretch * math.tan(math.pi * self.cutoff_hz / rate_hz)
        angles = np.pi * (0.5 + (2 * np.arange(self.half_order) + 1) / (2 * self.half_order))
        poles = corner * np.exp(1j * angles)
        slowest = float(np.max(np.abs((1 + poles) / (1 - poles))))
        return math.ceil(_TIME_CONSTANTS / -math.log(slowest))

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude of the two passes, any shape: of the analogue prototype, or of the filter sampled at a rate."""
        if rate_hz is None:
            ratio = frequency_hz / self.design_hz
        else:
            check_below_nyquist(self.cutoff_hz, rate_hz)
            corner = self._stretch * math.tan(math.pi * self.cutoff_hz / rate_hz)
            ratio = np.abs(np.tan(np.pi * frequency_hz / rate_hz)) / corner
        return np.asarray(1.0 / (1.0 + ratio ** (2 * self.half_order)))

    def two_pass(self, rate_hz: float) -> TwoPass:
        """Design the recursion for a sampling rate, see `recoil_processing.filters.two_pass.TwoPass`."""
        length = math.ceil(self.padding_periods * rate_hz / self.cutoff_hz)
        return _designed(int(self.half_order), self.corner_hz(rate_hz), rate_hz, length)

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
            Samples without missing values; see `apply_with_gaps`.
        rate_hz
            Samples per second.

        Returns
        -------
        ndarray of float64, same shape
            A new array.

        Raises
        ------
        ValueError
            If the cut-off is not below the Nyquist frequency, or the samples are not finite.
        """
        require_positive(rate_hz=rate_hz)
        check_shape(samples)
        return self.two_pass(rate_hz).run(samples)

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter samples some of which are missing, and say which results depend on them.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,)
            Samples; missing ones are NaN.
        rate_hz
            Samples per second.

        Returns
        -------
        filtered : ndarray of float64, shape (n_samples,)
        trusted : ndarray of bool, shape (n_samples,)
            Flags, false within the filter's reach of a missing sample. The bridge across a gap is there for the
            recursion only and is not data.

        Raises
        ------
        ValueError
            If samples are missing and fewer than two are there, if one is infinite, or as in `apply`.
        """
        return apply_bridged(self, samples, rate_hz)

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is, see `recoil_processing.filters.zero_phase_filter.FilterDescription`."""
        return FilterDescription(
            "butterworth",
            int(self.half_order),
            2,
            self.cutoff_hz,
            self.design_hz if rate_hz is None else self.corner_hz(rate_hz),
            "odd",
            self.padding_periods / self.cutoff_hz,
            rate_hz,
        )


@lru_cache(maxsize=64)
def _designed(half_order: int, corner_hz: float, rate_hz: float, padding_samples: int) -> TwoPass:
    """Design two passes, each with its -3 dB point at `corner_hz`; an estimate asks for the same ones many times."""
    from scipy.signal import butter  # only here: it takes a second to import

    return TwoPass(butter(half_order, corner_hz, fs=rate_hz, output="sos"), padding_samples)
