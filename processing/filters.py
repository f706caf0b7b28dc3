"""Zero-phase low-pass filters that say where their -3 dB point is.

A filter that is run forward and backward has twice the attenuation of one pass: the corner given to
the usual design functions is then a -6 dB point. Here the cut-off is always the -3 dB point of the
two passes together, at any sampling rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.gaps import bridge, near

_TIME_CONSTANTS = 4.0
"""Of the slowest pole, after which less than 1 % of a step is left, for half orders 1 to 8."""


@dataclass(frozen=True)
class LowPass:
    """A zero-phase Butterworth low-pass filter.

    One value of this type filters every channel that enters one regression. A linear filter
    commutes with ``F = m a`` only if it is the same on both sides; there is no way to give each
    side its own.

    Attributes
    ----------
    cutoff_hz : float
        -3 dB point of the two passes together.
    half_order : int
        Order of one pass; the net order is twice that.

    Raises
    ------
    ValueError
        If the cut-off is not positive and finite, or the order is not a positive whole number.
    """

    cutoff_hz: float
    half_order: int = 4

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cutoff_hz) and self.cutoff_hz > 0):
            raise ValueError(f"cutoff_hz must be positive, not {self.cutoff_hz}")
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

    @property
    def reach_s(self) -> float:
        """How far a single sample spreads to either side, seconds: 1.5 periods of the cut-off at the usual order.

        Four time constants ``1 / (2 pi fd sin(pi / 2n))`` of the slowest pole. Beyond it, less than
        1 % is left of a disturbance that lasts.
        """
        return _TIME_CONSTANTS / (2 * math.pi * self.design_hz * math.sin(math.pi / (2 * self.half_order)))

    def reach_samples(self, rate_hz: float) -> int:
        """How far a single sample spreads to either side at a sampling rate, samples.

        Four time constants of the slowest pole ``(1 + s) / (1 - s)`` of the sampled filter: `reach_s`
        far below the Nyquist frequency, more near it.
        """
        corner = self._stretch * math.tan(math.pi * self.cutoff_hz / rate_hz)
        angles = np.pi * (0.5 + (2 * np.arange(self.half_order) + 1) / (2 * self.half_order))
        poles = corner * np.exp(1j * angles)
        slowest = float(np.max(np.abs((1 + poles) / (1 - poles))))
        return math.ceil(_TIME_CONSTANTS / -math.log(slowest))

    def gain(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Amplitude of the two passes of the analogue prototype, any shape."""
        return np.asarray(1.0 / (1.0 + (frequency_hz / self.design_hz) ** (2 * self.half_order)))

    def apply(self, samples: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
        """Filter samples along their first axis.

        The bilinear transform maps a frequency f to ``tan(pi f / rate)``; the corner of one pass is
        chosen there, so that the -3 dB point stays at `cutoff_hz` however near Nyquist it is.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
            Without missing values; see `apply_with_gaps`.
        rate_hz : float
            Samples per second.

        Returns
        -------
        ndarray of float64, same shape
            A new array. The ends are continued by odd reflection over three periods of the cut-off,
            or over the whole record where that is shorter.

        Raises
        ------
        ValueError
            If the cut-off is not below the Nyquist frequency, or the samples are not finite.
        """
        from scipy.signal import butter, sosfiltfilt

        if not (math.isfinite(rate_hz) and rate_hz > 0):
            raise ValueError(f"rate_hz must be positive, not {rate_hz}")
        if not self.cutoff_hz < 0.5 * rate_hz:
            raise ValueError(
                f"a cut-off of {self.cutoff_hz:g} Hz needs more than {2 * self.cutoff_hz:g} samples/s, not {rate_hz:g}"
            )
        if not np.all(np.isfinite(samples)):
            raise ValueError("samples must be finite; use apply_with_gaps where some are missing (NaN)")
        if samples.size == 0:
            return np.array(samples, dtype=np.float64)
        corner_hz = rate_hz / math.pi * math.atan(self._stretch * math.tan(math.pi * self.cutoff_hz / rate_hz))
        sections = butter(int(self.half_order), corner_hz, fs=rate_hz, output="sos")
        padding = min(math.ceil(3 * rate_hz / self.cutoff_hz), samples.shape[0] - 1)
        return np.asarray(sosfiltfilt(sections, samples, axis=0, padtype="odd", padlen=padding), dtype=np.float64)

    def apply_with_gaps(
        self, samples: NDArray[np.float64], rate_hz: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Filter samples some of which are missing, and say which results depend on them.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,)
            Missing ones are NaN.
        rate_hz : float
            Samples per second.

        Returns
        -------
        filtered : ndarray of float64, shape (n_samples,)
        trusted : ndarray of bool, shape (n_samples,)
            False within the filter's reach of a missing sample. The bridge across a gap is there for
            the recursion only and is not data.

        Raises
        ------
        ValueError
            If samples are missing and fewer than two are there, if one is infinite, or as in `apply`.
        """
        missing = np.isnan(samples)
        if missing.any() and np.count_nonzero(~missing) < 2:
            raise ValueError(f"{np.count_nonzero(~missing)} of {samples.size} samples are there; two are needed")
        return self.apply(bridge(samples), rate_hz), ~near(missing, self.reach_samples(rate_hz))
