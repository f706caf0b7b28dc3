"""Lost samples: bridges across them, and what lies near them.

A bridge is there for recursions and integrals that cannot leave a sample out. It is never data: what
depends on it must be marked, left out, or be a small term.
"""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags

LONGEST_STEP = 2.5
"""Steps between neighbours beyond which nothing is interpolated: one lost sample is, two are not."""


def bridge(samples: Array, *, otherwise: float | None = None) -> Array:
    """Bridge lost samples by straight lines; before the first and after the last one there, its value stands.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples, evenly spaced; lost ones are NaN.
    otherwise
        Value everywhere if no sample is there at all.

    Returns
    -------
    ndarray of float64, shape (n,)
        A new array.

    Raises
    ------
    ValueError
        If no sample is there at all and `otherwise` is not given, or the samples are not one series.
    """
    values = np.array(samples, dtype=np.float64)
    if values.ndim != 1:
        raise ValueError(f"samples must be one series of shape (n,), not {values.shape}")
    lost = np.isnan(values)
    if not lost.any():
        return values
    present = np.flatnonzero(~lost)
    if present.size == 0:
        if otherwise is None:
            raise ValueError(f"none of the {values.size} samples is there: nothing to bridge from")
        return np.full_like(values, otherwise)
    values[lost] = np.interp(np.flatnonzero(lost), present, values[present])
    return values


def bridged_smoothly(samples: Array, most: int) -> Array:
    """Bridge short gaps of a smooth motion by a cubic through all that is there, shape (n,); longer ones stay.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples, evenly spaced; lost ones are NaN.
    most
        Samples of the longest gap that is bridged.
    """
    lost, present = np.isnan(samples), np.flatnonzero(np.isfinite(samples))
    if not lost.any() or present.size < 4:
        return samples
    from scipy.interpolate import CubicSpline

    whole, curve = np.array(samples, dtype=np.float64), CubicSpline(present, samples[present])
    for first, stop in runs_of(lost):
        if stop - first <= most and first > 0 and stop < samples.size:
            whole[first:stop] = curve(np.arange(first, stop))
    return whole


def near(flags: Flags, reach: int) -> Flags:
    """Spread flags by a number of samples to either side.

    Parameters
    ----------
    flags : ndarray of bool, shape (n,)
    reach
        Samples; 0 gives the flags themselves.

    Returns
    -------
    ndarray of bool, shape (n,)
        Flags, true where a flag is set at most `reach` samples away.

    Raises
    ------
    ValueError
        If the reach is negative.
    """
    if reach < 0:
        raise ValueError(f"reach must not be negative, not {reach}")
    if reach == 0 or not flags.any():
        return flags.copy()
    count = np.concatenate([[0], np.cumsum(flags, dtype=np.int64)])
    index = np.arange(flags.size)
    spread: Flags = count[np.minimum(index + reach + 1, flags.size)] > count[np.maximum(index - reach, 0)]
    return spread


def runs_of(flags: Flags) -> list[tuple[int, int]]:
    """List the runs of set flags, shape (n,), as (first, one beyond the last), in order."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def first_of_run(flags: Flags, length: int) -> int | None:
    """Return the first of so many set flags in a row, shape (n,): a single noisy sample is none; None without any."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    begins = edges[::2][edges[1::2] - edges[::2] >= length]
    return int(begins[0]) if begins.size else None


def longest_run(flags: Flags) -> tuple[int, int]:
    """Return the first of the longest runs of set flags, shape (n,), as `runs_of` does; (0, 0) if none is set."""
    return max(runs_of(flags), key=lambda run: run[1] - run[0], default=(0, 0))
