"""The period of instants that lie on an even lattice, with jitter, gaps and strangers, and their places on it.

An even lattice shows in the Rayleigh statistic ``R(f) = |mean(exp(2 pi i f t))|``: it is 1 for stamps without jitter
and ``exp(-2 (pi s f)^2)`` for normal jitter s; for stamps without any lattice ``n R^2`` is exponential (Lord
Rayleigh, Phil. Mag. 10, 1880; N. I. Fisher, Statistical Analysis of Circular Data, 1993, section 4.3). Gaps do not
touch it.

Places are then counted along the stamps: the lattice's places less the stamps' numbers only ever rise, by the
samples that were lost. The likeliest such staircase is found exactly (dynamic programming, R. Bellman, 1957), with
Laplace's distribution of the jitter, which a late stamp does not impress.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array

Places = NDArray[np.int64]

BY_THE_STEP = 0.25
"""Share of a step that neighbours may be off whole steps, so that steps are counted one by one."""
LEAST_STAMPS = 12
"""Number of stamps below which no lattice is distinguished from chance."""
MOST_STAMPS = 1 << 15
"""Number of stamps by which the period is searched; all of them refine it."""
FASTEST, SLOWEST = 2.0, 0.7
"""Lattice's frequency over the stamps' own mean rate: half of them lost, or three in ten strangers."""
BINS_PER_STEP = 16
PADDING = 4
"""Resolution of the search: bins per mean step, and frequencies per reciprocal of the record."""
AS_COHERENT = 0.8
"""Share of the best coherence from which on a slower lattice is the lattice."""
LEAST_COHERENCE = 0.3
"""Coherence below which places are no longer counted rightly: at normal jitter of a quarter of a step, a mean wait of a
half."""
LEAST_NEIGHBOURS = 0.25
"""Share of the stamps that follow the one before them by a step and not by more, of a lattice that lost half of its
stamps at random 0.5. Where a beat shifts within the record, twice its frequency may be the most coherent one, and on
that lattice hardly a stamp has a neighbour."""
TOGETHER = 0.1
"""Steps within which stamps were read at once."""
CHANCE = 1e-3
"""Probability that stamps without a lattice are taken for one."""
LOSS_NATS = 6.0
"""Cost of a gap in the staircase: one sample in some hundreds is lost."""
MOST_CELLS = 50_000_000
"""Cells of the staircase's table."""


@dataclass(frozen=True)
class Lattice:
    """Instants ``(place + phase) / frequency_hz`` that stamps lie near.

    Attributes
    ----------
    phase
        Phase of the mean stamp counted from the first one, in steps.
    coherence
        Rayleigh's R.
    """

    frequency_hz: float
    phase: float
    coherence: float


def find_lattice(times_s: Array) -> Lattice | None:
    """Find the even lattice that stamps lie near.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times, increasing.

    Returns
    -------
    Lattice or None
        Lattice of the stamps; None where none is seen well enough, see `LEAST_COHERENCE`, or every other place of it is
        empty.
    """
    if times_s.size < LEAST_STAMPS or not times_s[-1] > times_s[0]:
        return None
    since = times_s - times_s[0]
    some = since[:MOST_STAMPS]
    mean_rate = (some.size - 1) / float(some[-1])
    tick = 1.0 / (BINS_PER_STEP * mean_rate)
    counts = np.bincount(np.minimum((some / tick).astype(np.int64), BINS_PER_STEP * some.size))
    size = 1 << math.ceil(math.log2(PADDING * counts.size))
    spectrum = np.abs(np.fft.rfft(counts, size)) / some.size
    frequency = np.arange(spectrum.size) / (size * tick)
    low, high = np.searchsorted(frequency, [SLOWEST * mean_rate, FASTEST * mean_rate])
    at = low + int(np.argmax(spectrum[low:high]))
    # a lattice without jitter is as coherent at twice its frequency
    for share in (3, 2):
        slower = at // share
        if slower - 2 > low and spectrum[slower - 2 : slower + 3].max() > AS_COHERENT * spectrum[at]:
            at = slower - 2 + int(np.argmax(spectrum[slower - 2 : slower + 3]))
            break
    best = float(frequency[at])
    best = _refined(some, best, 1.0 / (PADDING * float(some[-1])))
    if some.size < since.size:
        best = _refined(since, best, 1.0 / (PADDING * float(since[-1])))
    if np.count_nonzero(np.diff(since) < 1.5 / best) < LEAST_NEIGHBOURS * since.size:
        return None
    vector = complex(np.exp(2j * np.pi * best * since).mean())
    independent = _independent(since, TOGETHER / best)
    if abs(vector) < max(LEAST_COHERENCE, math.sqrt(math.log(FASTEST * since.size / CHANCE) / independent)):
        return None
    return Lattice(best, float(np.angle(vector)) / (2 * math.pi), abs(vector))


def _independent(since_s: Array, together_s: float) -> float:
    """Return how many independent stamps hold as much: those that a late host read at once are one."""
    batch = np.concatenate([[0], np.cumsum(np.diff(since_s) > together_s)])
    return float(since_s.size**2 / (np.bincount(batch).astype(np.float64) ** 2).sum())


def _refined(since_s: Array, frequency_hz: float, width_hz: float) -> float:
    """Return the frequency of the highest coherence within a width to either side."""
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda f: -abs(complex(np.exp(2j * np.pi * f * since_s).mean())),
        bounds=(frequency_hz - width_hz, frequency_hz + width_hz),
        method="bounded",
        options={"xatol": 1e-4 * width_hz},
    )
    return float(found.x)


def count_steps(times_s: Array) -> Places | None:
    """Count along stamps of a source that samples evenly and loses samples.

    Parameters
    ----------
    times_s : ndarray, shape (n,), n at least 2
        Times, increasing.

    Returns
    -------
    ndarray of int64, shape (n,), or None
        Places on the lattice, from 0, strictly increasing; a stamp beside a gap may be one off where jitter is
        above a sixth of a step. None where no lattice is seen.
    """
    by_step = _step_by_step(times_s)
    if by_step is not None:
        return by_step
    lattice = find_lattice(times_s)
    if lattice is None:
        return None
    numbers = np.arange(times_s.size, dtype=np.int64)
    beyond = lattice.frequency_hz * (times_s - times_s[0]) - lattice.phase - numbers
    scale = math.sqrt(-2.0 * math.log(lattice.coherence)) / (2 * math.pi)
    lost = np.zeros_like(numbers)
    for _ in range(3):
        staircase = _staircase(beyond, LOSS_NATS * scale)
        if staircase is None:
            return None
        lost = staircase
        level = float(np.median(beyond - lost))
        beyond, scale = beyond - level, max(float(np.mean(np.abs(beyond - lost - level))), 1e-3)
    return np.asarray(numbers + lost - lost[0], dtype=np.int64)


def _step_by_step(times_s: Array) -> Places | None:
    """Count neighbours' steps one by one; None where one of them is not near a whole number of steps."""
    steps = np.diff(times_s)
    step_s = float(np.median(steps))
    before: Array | None = None
    for _ in range(4):
        if not step_s > 0:
            return None
        whole = np.round(steps / step_s)
        if whole.min() < 1 or np.abs(steps / step_s - whole).max() > BY_THE_STEP:
            return None
        if before is not None and np.array_equal(before, whole):
            return np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)
        # a long gap is counted by the period of all, not by the median step
        step_s, before = float((times_s[-1] - times_s[0]) / whole.sum()), whole
    return None


def _staircase(beyond: Array, loss_cost: float) -> Places | None:
    """Return the rising staircase of whole numbers that lies best among values, by their absolute differences."""
    low = math.floor(float(np.min(beyond)))
    levels = low + np.arange(math.ceil(float(np.max(beyond))) - low + 1)
    if levels.size * beyond.size > MOST_CELLS:
        return None
    count = beyond.size
    begun, below = np.empty((levels.size, count), dtype=np.int32), np.empty((levels.size, count), dtype=np.int32)
    lowest, best, ends = np.full(count, math.inf), np.zeros(count, dtype=np.int32), np.empty(levels.size)
    for k, level in enumerate(levels.tolist()):
        # a path that is on this level has begun it at some stamp, coming from the best one below, or from none
        own = np.cumsum(np.abs(beyond - level))
        before = np.empty(count)
        before[0], before[1:] = 0.0, lowest[:-1] + loss_cost - own[:-1]
        least = np.minimum.accumulate(before)
        # where both cost the same, none was lost
        newer = np.concatenate([[True], before[1:] < least[:-1]])
        begun[k] = np.maximum.accumulate(np.where(newer, np.arange(count), 0))
        below[k] = best
        cost = own + least
        best = np.where(cost <= lowest, k, best)
        lowest = np.minimum(lowest, cost)
        ends[k] = cost[-1]
    path = np.empty(count, dtype=np.int64)
    at, stop = int(np.argmin(ends)), count
    while stop:
        start = int(begun[at, stop - 1])
        path[start:stop] = at
        at, stop = int(below[at, start - 1]), start
    return np.asarray(levels[path], dtype=np.int64)
