"""A low-pass of finite length: symmetric about each sample, so without phase and without memory beyond its ends.

The ideal low-pass is cut to length by a Kaiser window (J. F. Kaiser, "Nonrecursive digital filter design
using the I0-sinh window function", Proc. IEEE Symp. Circuits and Systems, 1974), whose shape sets how far
down the stop band is and whose length how quickly it gets there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.zero_phase_filter import (
    HALF_AMPLITUDE,
    HALF_POWER,
    FilterDescription,
    apply_bridged,
    check_cutoff,
    check_finite,
    check_rate,
    check_shape,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_ATTENUATION_DB = 40.0
"""Below it Kaiser's fit is off by more than a decibel or two."""
HIGH_RATE = 64.0
"""Samples per period of the cut-off at which the gain is that of the limit of high rates, to 0.1 %."""


@dataclass(frozen=True)
class KaiserLowPass:
    """A linear-phase finite low-pass, taken symmetrically about each sample.

    Attributes
    ----------
    cutoff_hz : float
        Its -3 dB point.
    transition : float
        Width of the transition from pass band to stop band over the cut-off, at most 1; half of it lies above
        the -6 dB point.
    attenuation_db : float
        Of the stop band, to 1.5 dB. The pass band, whose gain at 0 Hz is exactly 1, keeps within twice that: 60 dB
        are 0.2 %.

    Raises
    ------
    ValueError
        If the cut-off is not positive and finite, the transition is not above 0 and at most 1, or the attenuation
        is below 40 dB.
    """

    cutoff_hz: float
    transition: float = 0.5
    attenuation_db: float = 60.0

    def __post_init__(self) -> None:
        check_cutoff(self.cutoff_hz)
        if not (math.isfinite(self.transition) and 0 < self.transition <= 1):
            raise ValueError(f"transition must be above 0 and at most 1 times the cut-off, not {self.transition}")
        if not (math.isfinite(self.attenuation_db) and self.attenuation_db >= LEAST_ATTENUATION_DB):
            raise ValueError(f"attenuation_db must be at least {LEAST_ATTENUATION_DB:g}, not {self.attenuation_db}")

    def weights(self, rate_hz: float) -> Array:
        """Weights from the middle sample outward, shape (reach + 1,), at a sampling rate.

        Read-only; their sum over both sides is 1.

        Raises
        ------
        ValueError
            If the transition does not end below the Nyquist frequency.
        """
        return _weights(self, rate_hz)

    def reach_samples(self, rate_hz: float) -> int:
        """How far a single sample spreads to either side: no further at all.

        ``M/2`` of Kaiser's ``M = (A - 7.95) / (2.285 dw)``, with dw the transition in radians per sample.
        """
        check_rate(rate_hz)
        width = 2 * math.pi * self.transition * self.cutoff_hz / rate_hz
        return max(1, math.ceil((self.attenuation_db - 7.95) / (2 * 2.285 * width)))

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude, any shape, at a sampling rate or in the limit of high rates; small negative ones in the stop band.

        In the limit it is that of 64 samples per period of the cut-off up to half that rate, and 0 beyond.
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        used_hz = HIGH_RATE * self.cutoff_hz if rate_hz is None else rate_hz
        amplitude = _amplitude(self.weights(used_hz), frequency / used_hz)
        return amplitude if rate_hz is not None else np.where(np.abs(frequency) <= used_hz / 2, amplitude, 0.0)

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis, see `filters.zero_phase_filter.ZeroPhaseFilter.apply`.

        The ends are continued by odd reflection over the filter's reach, over and over where the record is
        shorter.

        Raises
        ------
        ValueError
            If the transition does not end below the Nyquist frequency, or the samples are not finite.
        """
        check_shape(samples)
        side = self.weights(rate_hz)
        check_finite(samples)
        if samples.size == 0:
            return np.array(samples, dtype=np.float64)
        from scipy.signal import oaconvolve

        whole = np.concatenate([side[:0:-1], side])
        reach = side.size - 1
        filtered = np.empty(samples.shape)
        columns, targets = (samples.T, filtered.T) if samples.ndim == 2 else ([samples], [filtered])
        for column, target in zip(columns, targets, strict=True):
            padded = np.pad(column.astype(np.float64), reach, mode="reflect", reflect_type="odd")
            target[...] = oaconvolve(padded, whole, mode="valid")
        return filtered

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter samples some of which are missing, see `recoil_processing.filters.zero_phase_filter.apply_bridged`."""
        return apply_bridged(self, samples, rate_hz)

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is, see `recoil_processing.filters.zero_phase_filter.FilterDescription`."""
        used_hz = HIGH_RATE * self.cutoff_hz if rate_hz is None else rate_hz
        reach = self.reach_samples(used_hz)
        edge_hz = _where(self.weights(used_hz), HALF_AMPLITUDE, self.cutoff_hz, self._top_hz, used_hz)
        parameters = {"attenuation_db": self.attenuation_db, "transition_hz": self.transition * self.cutoff_hz}
        if rate_hz is not None:
            parameters["taps"] = 2 * reach + 1
        return FilterDescription(
            "kaiser", None, 1, self.cutoff_hz, edge_hz, "odd", reach / used_hz, rate_hz, parameters
        )

    @property
    def _top_hz(self) -> float:
        return (1.0 + self.transition) * self.cutoff_hz

    def memory_samples(self, rate_hz: float, tolerance: float) -> int:
        """Return how far a sample has any influence, whatever the tolerance, see `filters.filter_blocks`."""
        del tolerance
        return self.reach_samples(rate_hz)


@lru_cache(maxsize=16)
def _weights(low_pass: KaiserLowPass, rate_hz: float) -> Array:
    from scipy.optimize import brentq
    from scipy.signal.windows import kaiser

    reach = low_pass.reach_samples(rate_hz)
    top_hz = (1.0 + low_pass.transition) * low_pass.cutoff_hz
    if not top_hz < 0.5 * rate_hz:
        raise ValueError(
            f"a cut-off of {low_pass.cutoff_hz:g} Hz with a transition up to {top_hz:g} Hz needs more than "
            f"{2 * top_hz:g} samples/s, not {rate_hz:g}"
        )
    window = kaiser(2 * reach + 1, _shape(low_pass.attenuation_db))[reach:]

    def cut(edge_hz: float) -> Array:
        edge = 2.0 * edge_hz / rate_hz
        side = np.asarray(edge * np.sinc(edge * np.arange(reach + 1)) * window, dtype=np.float64)
        return np.asarray(side / (side[0] + 2.0 * side[1:].sum()))

    def excess(edge_hz: float) -> float:
        return float(_amplitude(cut(edge_hz), np.asarray(low_pass.cutoff_hz / rate_hz))) - HALF_POWER

    # half the amplitude at the edge itself, nearly all of it half a transition below
    edge_hz = brentq(excess, low_pass.cutoff_hz * (1.0 - 0.1 * low_pass.transition), top_hz, xtol=1e-9 * top_hz)
    side = cut(float(edge_hz))
    side.flags.writeable = False
    return side


def _shape(attenuation_db: float) -> float:
    """Return the shape of Kaiser's window for an attenuation, by his fit from 21 dB on."""
    if attenuation_db > 50:
        return 0.1102 * (attenuation_db - 8.7)
    return 0.5842 * math.pow(attenuation_db - 21, 0.4) + 0.07886 * (attenuation_db - 21)


def _amplitude(side: Array, cycles: Array) -> Array:
    """Sum ``w0 + 2 sum wk cos(2 pi k c)``, a Chebyshev series in ``cos(2 pi c)``."""
    from numpy.polynomial.chebyshev import chebval

    return np.asarray(chebval(np.cos(2 * np.pi * cycles), np.concatenate([side[:1], 2.0 * side[1:]])), dtype=np.float64)


def _where(side: Array, amplitude: float, low_hz: float, high_hz: float, rate_hz: float) -> float:
    from scipy.optimize import brentq

    def excess(frequency_hz: float) -> float:
        return float(_amplitude(side, np.asarray(frequency_hz / rate_hz))) - amplitude

    found, _ = brentq(excess, low_hz, high_hz, full_output=True)
    return float(found)
