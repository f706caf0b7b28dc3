"""Where two records of one motion fit each other, roughly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MINIMUM_OVERLAP = 0.25
"""Least share of the shorter record's energy that must overlap for a lag to be a candidate."""


@dataclass(frozen=True)
class CoarseLag:
    """The best lag of a normalised cross-correlation.

    Attributes
    ----------
    offset_s : float
        To be added to the source's times to get the reference's.
    correlation : float
        Normalised correlation there, at most 1.
    second_peak : float
        Highest correlation at least `exclusion_s` away.
    at_search_edge : bool
        Whether the best lag is the first or last one possible.
    """

    offset_s: float
    correlation: float
    second_peak: float
    at_search_edge: bool


def coarse_lag(
    source_times_s: Array,
    source: Array,
    start_s: float,
    step_s: float,
    reference: Array,
    *,
    step_of_search_s: float,
    exclusion_s: float = 0.02,
) -> CoarseLag | str:
    """Find the lag at which a source's signal fits a reference's best.

    Both are put on a grid of `step_of_search_s`; at each lag the correlation is normalised by the
    energies inside the overlap, so that a long overlap with silence does not win.

    Parameters
    ----------
    source_times_s, source : ndarray, shape (n_source,)
        On the source's clock, increasing; NaN are left out.
    start_s, step_s : float
        Time base of the reference.
    reference : ndarray, shape (n_reference,)
    step_of_search_s : float
    exclusion_s : float
        Half width around the best lag in which no second peak is looked for.

    Returns
    -------
    CoarseLag or str
        A sentence where one of the two does not move.
    """
    present = np.isfinite(source)
    t, y = source_times_s[present], source[present]
    if t.size < 8:
        return f"only {t.size} samples are there to align by"
    grid = np.arange(t[0], t[-1], step_of_search_s)
    y = np.interp(grid, t, y)
    reference_times = start_s + step_s * np.arange(reference.size)
    x = np.interp(np.arange(start_s, reference_times[-1], step_of_search_s), reference_times, reference)
    if not (np.ptp(y) > 0 and np.ptp(x) > 0):
        return "a constant signal cannot be aligned"
    y, x = y - np.median(y), x - np.median(x)
    # zero padding to the full length keeps the circular correlation from wrapping
    size = 1 << (x.size + y.size - 1).bit_length()

    def correlate(a: Array, b: Array) -> Array:
        product = np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size))
        full = np.fft.irfft(product, size)
        return np.concatenate([full[-(y.size - 1) :], full[: x.size]])

    products = correlate(x, y)
    energy_x = correlate(x**2, np.ones_like(y))
    energy_y = correlate(np.ones_like(x), y**2)
    enough = (energy_x > MINIMUM_OVERLAP * (x**2).sum()) & (energy_y > MINIMUM_OVERLAP * (y**2).sum())
    if not enough.any():
        return "the two records have no motion in common"
    correlation = np.full(products.shape, -np.inf)
    np.divide(products, np.sqrt(np.abs(energy_x * energy_y)), out=correlation, where=enough)
    best = int(np.argmax(correlation))
    lags = np.arange(-(y.size - 1), x.size)
    offset = start_s + lags[best] * step_of_search_s - grid[0]
    away = np.abs(lags - lags[best]) * step_of_search_s > exclusion_s
    others = correlation[away & np.isfinite(correlation)]
    candidates = np.flatnonzero(np.isfinite(correlation))
    return CoarseLag(
        offset_s=float(offset),
        correlation=float(correlation[best]),
        second_peak=float(others.max()) if others.size else 0.0,
        at_search_edge=best in (candidates[0], candidates[-1]),
    )
