"""The same pulses on two clocks: which belong together, where some are missing on either side or do not belong.

One trigger edge, several, or the pulse of every frame of a camera: both clocks have instants, of which most are
common. Where they come at irregular intervals, the offset that brings most of them together is voted for by all
differences of instants.

Pulses at even intervals fit at every whole number of periods, and random gaps hardly distinguish these: at an offset
that lets one train stick out beyond the other's end, as many pulses have to be missing there as stick out, and that is
the least likely of all. So the offset is the one at which both trains together reach the least far; where one of the
trains is longer than the other, several offsets do, and only another source decides which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.lattice import LEAST_STAMPS, Lattice, find_lattice
from recoil_processing.arguments import require_increasing, require_positive

Indices = NDArray[np.intp]

MOST_RATE = 0.02
"""Relative difference up to which the two trains' periods are taken for the same."""
BINS_PER_TOLERANCE = 4
"""Bins of the voting within the tolerance."""
MOST_PLACES = 1 << 24
"""Places of offsets that are voted for."""
MOST_DIFFERENCES = 1 << 22
"""Number of differences that are formed at a time."""
MOST_VOTED = 4
"""Offsets that are compared after the voting."""
MOST_LAGS = 1000
"""Whole numbers of periods that are compared."""


@dataclass(frozen=True, eq=False)
class Pairing(ReadOnlyArrays):
    """Pairs of instants of two clocks that are the same events.

    Attributes
    ----------
    source, reference : ndarray of int, shape (n_pairs,)
        Indices of the pairs, increasing.
    rivals
        Number of other offsets that fit as well.
    rate
        Period of the reference's train over that of the source's; 1 where they have none.
    """

    source: Indices
    reference: Indices
    rivals: int
    rate: float


def pair_pulses(
    source_s: Array,
    reference_s: Array,
    *,
    tolerance_s: float,
    near_s: tuple[float, float] | None = None,
) -> Pairing | str:
    """Find which instants of two clocks are the same events.

    Parameters
    ----------
    source_s, reference_s : ndarray, shape (n_source,), (n_reference,)
        Each on its own clock, strictly increasing.
    tolerance_s
        Time by which a pair may lie off; it is kept below a quarter of the shortest interval, or of the period.
    near_s
        An offset that is known from elsewhere (reference less source, in the middle of the source's instants),
        and by how much it may be off: no other offset is a candidate then.

    Returns
    -------
    Pairing or str
        A sentence where no two instants belong together.

    Raises
    ------
    ValueError
        If instants do not increase, the tolerance is not positive, or the records are too long for it.
    """
    require_increasing(source_s=source_s, reference_s=reference_s)
    require_positive(tolerance_s=tolerance_s)
    if min(source_s.size, reference_s.size) == 0:
        return "there are no pulses to pair"
    # counted from the middles of the records, an error of the rate does the least harm
    middles = [0.5 * float(instants[0] + instants[-1]) for instants in (source_s, reference_s)]
    own, other = source_s - middles[0], reference_s - middles[1]
    window = None
    if near_s is not None:
        at = near_s[0] + middles[0] - middles[1]
        window = (at - near_s[1], at + near_s[1])
    beats = _common_beat(own, other)
    if beats is None:
        intervals = [float(np.median(np.diff(edges))) for edges in (own, other) if edges.size > 1]
        return _voted(own, other, min(tolerance_s, 0.25 * min(intervals, default=math.inf)), window)
    return _in_step(own, other, *beats, tolerance_s, window)


def _common_beat(own: Array, other: Array) -> tuple[Lattice, Lattice] | None:
    """Return the lattices of two trains of one period, None where they have none in common."""
    if min(own.size, other.size) < LEAST_STAMPS:
        return None
    one, two = find_lattice(own), find_lattice(other)
    if one is None or two is None or abs(one.frequency_hz / two.frequency_hz - 1.0) > MOST_RATE:
        return None
    return one, two


def _in_step(
    own: Array, other: Array, one: Lattice, two: Lattice, tolerance_s: float, window: tuple[float, float] | None
) -> Pairing | str:
    """Pair two trains of one period, at the whole number of periods at which both reach the least far."""
    period_s, rate = 1.0 / two.frequency_hz, one.frequency_hz / two.frequency_hz
    tolerance = min(tolerance_s, 0.25 * period_s) / period_s
    (a, at_a), (b, at_b) = _places(own, one, tolerance), _places(other, two, tolerance)
    if min(a.size, b.size) == 0:
        return "the pulses keep no even beat"
    if window is None:
        ends = int(b[0] - a[0]), int(b[-1] - a[-1])
        lags = np.arange(min(ends), max(ends) + 1)
    else:
        # the offset at a lag of no places, in the middle of the source's record
        zero_s = float(other[0]) + period_s * (two.phase - one.phase - one.frequency_hz * float(own[0]))
        first, last = ((bound - zero_s) / period_s for bound in window)
        lags = np.arange(math.ceil(first), math.floor(last) + 1)
        if lags.size == 0:
            return "no two pulses lie where the offset that is known puts them"
        reach = np.maximum(a[-1] + lags, b[-1]) - np.minimum(a[0] + lags, b[0])
        lags = lags[reach == reach.min()]
    tried = lags[np.unique(np.linspace(0, lags.size - 1, min(lags.size, MOST_LAGS)).astype(np.int64))]
    common = [np.intersect1d(a + lag, b, assume_unique=True).size for lag in tried]
    lag = tried[int(np.argmax(common))]
    _, in_a, in_b = np.intersect1d(a + lag, b, assume_unique=True, return_indices=True)
    if in_a.size == 0:
        return "no two pulses lie where the offset that is known puts them"
    return Pairing(at_a[in_a], at_b[in_b], int(lags.size) - 1, rate)


def _places(times_s: Array, lattice: Lattice, tolerance: float) -> tuple[NDArray[np.int64], Indices]:
    """Places on a lattice of the instants that lie on it, each once and increasing, and which instants these are."""
    beats = lattice.frequency_hz * (times_s - times_s[0]) - lattice.phase
    off = np.abs(beats - np.round(beats))
    near = np.flatnonzero(off <= tolerance)
    near = near[np.argsort(off[near], kind="stable")]
    places, first = np.unique(np.round(beats[near]).astype(np.int64), return_index=True)
    return places, near[first].astype(np.intp)


def _voted(own: Array, other: Array, tolerance_s: float, window: tuple[float, float] | None) -> Pairing | str:
    """Pair instants at irregular intervals by the offset that most differences vote for."""
    votes = _votes(own, other, tolerance_s, window)
    if votes is None:
        return "no two pulses lie where the offset that is known puts them"
    pairs = [_nearest(own + shift, other, tolerance_s) for shift in votes]
    sizes = [found[0].size for found in pairs]
    best = int(np.argmax(sizes))
    return Pairing(*pairs[best], sizes.count(sizes[best]) - 1, 1.0)


def _votes(own: Array, other: Array, tolerance_s: float, window: tuple[float, float] | None) -> list[float] | None:
    """Return the shifts that bring most instants together: the best, and the next ones away from it."""
    low, high = window if window is not None else (float(other[0] - own[-1]), float(other[-1] - own[0]))
    bin_s = tolerance_s / BINS_PER_TOLERANCE
    if math.isinf(bin_s):
        bin_s = max(high - low, 1.0)
    places = int((high - low) / bin_s) + 2
    if places > MOST_PLACES:
        raise ValueError(f"offsets over {high - low:.4g} s cannot be voted for in steps of {bin_s:g} s")
    counts = np.zeros(places)
    sums = np.zeros(places)
    at_once = max(MOST_DIFFERENCES // other.size, 1)
    for start in range(0, own.size, at_once):
        differences = (other[None, :] - own[start : start + at_once, None]).ravel()
        differences = differences[(differences >= low) & (differences <= high)]
        at = ((differences - low) / bin_s).astype(np.int64)
        counts += np.bincount(at, minlength=places)
        sums += np.bincount(at, weights=differences, minlength=places)
    if not counts.any():
        return None
    kernel = np.ones(BINS_PER_TOLERANCE + 1)
    total, moments = np.convolve(counts, kernel, "same"), np.convolve(sums, kernel, "same")
    shifts = []
    for _ in range(MOST_VOTED):
        best = int(np.argmax(total))
        if total[best] <= 0:
            break
        shifts.append(float(moments[best] / total[best]))
        total[max(best - 2 * BINS_PER_TOLERANCE, 0) : best + 2 * BINS_PER_TOLERANCE + 1] = 0.0
    return shifts


def _nearest(moved: Array, other: Array, tolerance_s: float) -> tuple[Indices, Indices]:
    """Pair each instant with the nearest of the other side, where each is the other's nearest, within a tolerance."""
    after = np.clip(np.searchsorted(other, moved), 1, max(other.size - 1, 1))
    if other.size == 1:
        nearest = np.zeros(moved.size, dtype=np.intp)
    else:
        nearest = np.where(moved - other[after - 1] <= other[after] - moved, after - 1, after)
    distance = np.abs(moved - other[nearest])
    order = np.lexsort((distance, nearest))
    first = np.ones(order.size, dtype=bool)
    first[1:] = nearest[order][1:] != nearest[order][:-1]
    kept = np.sort(order[first])
    kept = kept[distance[kept] <= tolerance_s]
    return kept.astype(np.intp), nearest[kept].astype(np.intp)
