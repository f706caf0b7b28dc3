"""Zero-phase low-pass filters that say where their -3 dB point is.

A filter that is run forward and backward has twice the attenuation of one pass: the corner given to
the usual design functions is then a -6 dB point. Here the cut-off is always the -3 dB point of the
two passes together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
    """

    cutoff_hz: float
    half_order: int = 4

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cutoff_hz) and self.cutoff_hz > 0):
            raise ValueError(f"cutoff_hz must be positive, not {self.cutoff_hz}")
        if self.half_order < 1:
            raise ValueError(f"half_order must be at least 1, not {self.half_order}")

    @property
    def design_hz(self) -> float:
        """Corner of one pass, so that both together are 3 dB down at `cutoff_hz`.

        One pass has ``|H|^2 = 1 / (1 + (f/fd)^(2n))``; two have that as amplitude, which is
        ``1/sqrt(2)`` where ``(f/fd)^(2n) = sqrt(2) - 1``.
        """
        return float(self.cutoff_hz / (math.sqrt(2.0) - 1.0) ** (1.0 / (2 * self.half_order)))

    @property
    def reach_s(self) -> float:
        """How far a single sample spreads to either side: three periods of the cut-off, halved."""
        return 1.5 / self.cutoff_hz

    def gain(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Amplitude of the two passes of the analogue prototype, any shape."""
        return np.asarray(1.0 / (1.0 + (frequency_hz / self.design_hz) ** (2 * self.half_order)))

    def apply(self, samples: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
        """Filter samples along their first axis.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
            Without missing values; see `apply_with_gaps`.
        rate_hz : float

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

        if not self.design_hz < 0.5 * rate_hz:
            raise ValueError(f"a cut-off of {self.cutoff_hz:g} Hz needs more than {2 * self.design_hz:.0f} samples/s")
        if not np.all(np.isfinite(samples)):
            raise ValueError("samples must be finite; use apply_with_gaps where some are missing")
        sections = butter(self.half_order, self.design_hz, fs=rate_hz, output="sos")
        padding = min(math.ceil(3 * rate_hz / self.cutoff_hz), samples.shape[0] - 1)
        return np.asarray(sosfiltfilt(sections, samples, axis=0, padtype="odd", padlen=padding))

    def apply_with_gaps(
        self, samples: NDArray[np.float64], rate_hz: float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Filter samples some of which are missing, and say which results depend on them.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,)
            Missing ones are NaN.
        rate_hz : float

        Returns
        -------
        filtered : ndarray of float64, shape (n_samples,)
        trusted : ndarray of bool, shape (n_samples,)
            False within the filter's reach of a missing sample. The bridge across a gap is there for
            the recursion only and is not data.

        Raises
        ------
        ValueError
            If fewer than two samples are there.
        """
        missing = np.isnan(samples)
        if not missing.any():
            return self.apply(samples, rate_hz), np.ones(samples.shape, dtype=bool)
        present = np.flatnonzero(~missing)
        if present.size < 2:
            raise ValueError("fewer than two samples are there")
        bridged = np.interp(np.arange(samples.size), present, samples[present])
        reach = math.ceil(self.reach_s * rate_hz)
        spread = np.convolve(missing, np.ones(2 * reach + 1), mode="same") if samples.size > 2 * reach else None
        trusted = np.zeros(samples.shape, dtype=bool) if spread is None else spread < 0.5
        return self.apply(bridged, rate_hz), trusted
