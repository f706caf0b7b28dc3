"""Interface of every linear zero-phase filter, and its description of itself.

A filter without phase delays nothing, so that channels stay aligned. A linear one commutes with
``F = m a``, so that whatever it does to the motion it does to the force too, provided that it is the same
for both: see `recoil_processing.filters.filtered`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Protocol, Self, runtime_checkable

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.arguments import require_positive
from recoil_processing.gaps import bridge, near

LEAST_SAMPLES = 2
"""Samples of a channel below which there is nothing to filter."""


@dataclass(frozen=True)
class FilterDescription:
    """Description of a filter for a report, so that another program can repeat it.

    Attributes
    ----------
    kind
        ``butterworth`` or ``channel frequency class``.
    order
        Order of one pass.
    passes
        Number of times that a sample passes the filter: 2, forward and backward.
    minus_3_db_hz, minus_6_db_hz
        Frequencies at which the amplitude of all passes together is ``1/sqrt(2)`` and ``1/2``.
    padding
        Kind of the record's continuation at its ends: ``odd`` is by reflection about the end point.
    padding_s
        Time by which the record is continued.
    rate_hz
        Sampling rate for which this holds; None is for the limit of high rates.
    parameters
        Further parameters that define the filter.
    """

    kind: str
    order: int | None
    passes: int
    minus_3_db_hz: float | None
    minus_6_db_hz: float | None
    padding: str
    padding_s: float
    rate_hz: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, object]:
        """Return the description in JSON types, parameters under a key of their own."""
        return asdict(self)


class ZeroPhaseFilter(Protocol):
    """A linear filter without phase."""

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
            Samples without missing values.
        rate_hz
            Samples per second.

        Returns
        -------
        ndarray of float64, same shape
            A new array.

        Raises
        ------
        ValueError
            If the rate is too low for the filter, or the samples are not finite.
        """
        ...

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter one channel with missing samples (NaN), and say which results depend on them.

        Parameters
        ----------
        samples : ndarray of float64, shape (n_samples,)

        Returns
        -------
        filtered : ndarray of float64, shape (n_samples,)
            Filtered samples; NaN throughout where fewer than `LEAST_SAMPLES` are there.
        trusted : ndarray of bool, shape (n_samples,)
            Flags, false within the filter's reach of a missing sample.

        Raises
        ------
        ValueError
            If a sample is infinite, or as in `apply`.
        """
        ...

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude of all passes together, any shape; at a sampling rate, or in the limit of high rates."""
        ...

    def reach_samples(self, rate_hz: float) -> int:
        """Return the number of samples over which one spreads to either side.

        Beyond, under 1 % is left of a disturbance that lasts.
        """
        ...

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is, at a sampling rate or in the limit of high rates."""
        ...


@runtime_checkable
class LowPassFilter(ZeroPhaseFilter, Protocol):
    """A linear low-pass without phase that an identification can be given, whose cut-off it chooses from the data.

    It is a value: two of one kind and cut-off are equal and hash alike, as frozen data classes do.
    """

    @property
    def cutoff_hz(self) -> float:
        """Frequency at which its amplitude is ``1/sqrt(2)``."""
        ...

    @property
    def reach_s(self) -> float:
        """Time over which a sample spreads to either side, s, in the limit of high rates: see `reach_samples`."""
        ...

    def at(self, cutoff_hz: float) -> Self:
        """Return a filter of the same kind with another cut-off.

        Raises
        ------
        ValueError
            If the cut-off is not positive and finite.
        """
        ...

    def __hash__(self) -> int:
        """Hash of kind and cut-off: what is made of a filter is kept for the next shot."""
        ...


def check_below_nyquist(cutoff_hz: float, rate_hz: float) -> None:
    """Refuse a sampling rate that is too low for a cut-off.

    Raises
    ------
    ValueError
        If the cut-off is not below half the rate, or the rate is none.
    """
    require_positive(rate_hz=rate_hz)
    if not cutoff_hz < 0.5 * rate_hz:
        raise ValueError(f"a cut-off of {cutoff_hz:g} Hz needs more than {2 * cutoff_hz:g} samples/s, not {rate_hz:g}")


def check_shape(samples: Array) -> None:
    """Refuse samples that are neither one channel nor a table of channels.

    Raises
    ------
    ValueError
        If their shape is neither (n,) nor (n, n_channels).
    """
    if samples.ndim not in (1, 2):
        raise ValueError(f"samples must have shape (n_samples,) or (n_samples, n_channels), not {samples.shape}")


def check_finite(samples: Array) -> None:
    """Refuse samples that are missing or infinite.

    Raises
    ------
    ValueError
        If one is.
    """
    if not np.all(np.isfinite(samples)):
        raise ValueError("samples must be finite; use apply_with_gaps where some are missing (NaN)")


def apply_bridged(zero_phase: ZeroPhaseFilter, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
    """Filter a channel with its gaps bridged by straight lines: `ZeroPhaseFilter.apply_with_gaps` of most filters.

    The bridge is there for the filter only and is not data.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_samples,)
        Samples; missing ones are NaN.

    Returns
    -------
    filtered : ndarray of float64, shape (n_samples,)
        NaN throughout where fewer than `LEAST_SAMPLES` are there: that is no signal, and nothing of it is trusted.
    trusted : ndarray of bool, shape (n_samples,)

    Raises
    ------
    ValueError
        If a sample is infinite, or as in the filter's `apply`.
    """
    missing = np.isnan(samples)
    if np.count_nonzero(~missing) < LEAST_SAMPLES:
        return np.full(samples.shape, np.nan), np.zeros(samples.shape, dtype=np.bool_)
    return zero_phase.apply(bridge(samples), rate_hz), ~near(missing, zero_phase.reach_samples(rate_hz))
