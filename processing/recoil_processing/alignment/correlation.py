"""Rough offset at which two records of one motion fit each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.arguments import require_finite, require_increasing

MINIMUM_OVERLAP = 0.25
"""Least share of each record's energy that must overlap for a lag to be a candidate."""
ROUNDING = 1e-12
"""Share of its largest value by which a signal that does not move may seem to."""
LEAST_SAMPLES = 8
"""Number of samples below which, on either side, there is no shape to compare."""
LEAST_VARIANCE = 0.01
"""Least share of each record's energy that its variance inside the overlap must be: a plateau has no shape."""
MOST_SAMPLES = 1 << 24
"""Samples of both records together on the search grid: some gigabytes of work space."""


@dataclass(frozen=True)
class CoarseLag:
    """The best lag of a normalised cross-correlation.

    Attributes
    ----------
    offset_s
        Offset to add to the source's times to get the reference's.
    correlation
        Normalised correlation there, at most 1.
    second_peak
        Highest correlation outside the best lag's own lobe; 0 if there is nothing outside.
    at_search_edge
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

    Both are put on a grid of `step_of_search_s`. At each lag the correlation is that of the overlap alone,
    its own means taken off: a long overlap with silence does not win, and a record that begins or ends in
    the motion does not lose.

    Parameters
    ----------
    source_times_s, source : ndarray, shape (n_source,)
        Times on the source's clock, strictly increasing, and samples; NaN are left out.
    start_s, step_s
        Time base of the reference.
    reference : ndarray, shape (n_reference,)
        Samples of the reference channel, none missing.
    exclusion_s
        Half width around the best lag in which no second peak is looked for. Beyond it the lobe goes
        on as long as the correlation falls: the flank of a slow motion is not a second peak.

    Returns
    -------
    CoarseLag or str
        A sentence where one of the two does not move, or they share nothing.

    Raises
    ------
    ValueError
        If the reference is not finite, the times do not increase, or the records are too long for the
        search grid.
    """
    require_finite(reference=reference)
    present = np.isfinite(source)
    t, y = source_times_s[present], source[present]
    if t.size < LEAST_SAMPLES:
        return f"only {t.size} samples are there to align by"
    if reference.size < LEAST_SAMPLES:
        return f"the reference has only {reference.size} samples to align by"
    require_increasing(source_times_s=t)
    end_s = start_s + step_s * (reference.size - 1)
    if (t[-1] - t[0]) + (end_s - start_s) > MOST_SAMPLES * step_of_search_s:
        raise ValueError(
            f"records of {t[-1] - t[0]:.4g} s and {end_s - start_s:.4g} s are too long to be searched "
            f"in steps of {step_of_search_s:g} s"
        )
    grid, reference_grid = np.arange(t[0], t[-1], step_of_search_s), np.arange(start_s, end_s, step_of_search_s)
    shorter_s = min(t[-1] - t[0], end_s - start_s)
    if min(grid.size, reference_grid.size) < LEAST_SAMPLES:
        return (
            f"a record of {1e3 * shorter_s:.3g} ms is too short to be aligned in steps of {1e3 * step_of_search_s:g} ms"
        )
    y = np.interp(grid, t, y)
    x = np.interp(reference_grid, start_s + step_s * np.arange(reference.size), reference)
    # a constant behind a filter differs from sample to sample by rounding
    if not all(np.ptp(values) > ROUNDING * np.abs(values).max() for values in (y, x)):
        return "a constant signal cannot be aligned"
    y, x = y - np.median(y), x - np.median(x)
    # scaled to 1, energies stay in float64 whatever the unit
    y, x = y / np.abs(y).max(), x / np.abs(x).max()
    correlation = _normalised(x, y)
    candidates = np.flatnonzero(np.isfinite(correlation))
    if candidates.size == 0:
        return "the two records have no motion in common"
    best = int(np.argmax(correlation))
    others = _outside_lobe(correlation, best, round(exclusion_s / step_of_search_s))
    return CoarseLag(
        offset_s=float(start_s + (best - (y.size - 1)) * step_of_search_s - grid[0]),
        correlation=float(correlation[best]),
        second_peak=float(others.max()) if others.size else 0.0,
        at_search_edge=best in (candidates[0], candidates[-1]),
    )


def _normalised(x: Array, y: Array) -> Array:
    """Correlation at lags ``1 - y.size`` to ``x.size - 1``; minus infinity where too little overlaps."""
    # zero padding to the full length keeps the circular correlation from wrapping
    size = 1 << (x.size + y.size - 1).bit_length()

    def sums(a: Array, b: Array) -> Array:
        full = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
        return np.concatenate([full[-(y.size - 1) :], full[: x.size]])

    ones_x, ones_y = np.ones_like(x), np.ones_like(y)
    count = np.maximum(np.round(sums(ones_x, ones_y)), 1.0)
    sum_x, sum_y = sums(x, ones_y), sums(ones_x, y)
    energy_x, energy_y = sums(x**2, ones_y), sums(ones_x, y**2)
    variance_x, variance_y = energy_x - sum_x**2 / count, energy_y - sum_y**2 / count
    enough = np.ones(count.shape, dtype=bool)
    for energy, variance, total in ((energy_x, variance_x, (x**2).sum()), (energy_y, variance_y, (y**2).sum())):
        enough &= (energy > MINIMUM_OVERLAP * total) & (variance > LEAST_VARIANCE * total)
    correlation = np.full(count.shape, -np.inf)
    products = sums(x, y) - sum_x * sum_y / count
    np.divide(products, np.sqrt(np.abs(variance_x * variance_y)), out=correlation, where=enough)
    return correlation


def _outside_lobe(correlation: Array, best: int, exclusion: int) -> Array:
    """Finite correlations beyond the lobe around the best one."""
    left, right = max(best - exclusion, 0), min(best + exclusion, correlation.size - 1)
    turns = np.flatnonzero(correlation[:left] >= correlation[1 : left + 1])
    left = int(turns[-1]) + 1 if turns.size else 0
    turns = np.flatnonzero(correlation[right + 1 :] >= correlation[right:-1])
    right = right + int(turns[0]) if turns.size else correlation.size - 1
    others = np.concatenate([correlation[:left], correlation[right + 1 :]])
    return np.asarray(others[np.isfinite(others)])
