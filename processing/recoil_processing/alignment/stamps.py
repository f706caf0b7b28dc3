"""Stamps of sources that sample evenly and are stamped late, by a varying wait.

A sample is taken on the even beat of its source's crystal; its stamp comes later, by the shortest way and by a wait:
for the bus, in the adapter, until the host was scheduled. A wait is one-sided, so that the line along the lower
edge of the stamps is nearest to the beat: it is late by the shortest way alone, the mean by the mean wait as
well. Where jitter is two-sided, as of rounded stamps, the mean is better known than an edge. Which of the two
lies straighter along the record is seen from the record, and that one is taken.

A recorder's stamps jitter for one of two reasons: its converter is clocked, and software or rounding dates the samples;
or software starts each conversion, and the stamps are right. The record tells which where its signals are steep:
samples that were taken at jittering instants lie off the curve through their neighbours on the even beat by slope
times jitter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA, MEDIAN_LOSS
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.readers.time.bursts import find_bursts
from recoil_acquisition.readers.time.counted_beat import is_one_beat
from recoil_processing.alignment.lattice import count_steps
from recoil_processing.arguments import require_alike

Counts = NDArray[np.int64]
Line = Literal["lower edge", "mean", "none"]

RUNS = (96, 48, 24, 12)
"""Numbers of runs into which the stamps may be cut, each giving a point of the line: a longer one reaches the edge
surer."""
LEAST_RUN = 8
"""Stamps of a run."""
LEAST_COUNTED = 32
"""Counted stamps below which it is not seen whether all of them are on one line."""
MOST_WANDER = 0.6
"""Scatter of the runs' points over that of the stamps within a run: of white jitter 0.35, of a walk mostly over 1."""
FINE_WANDER = 1e-2
"""Share of a step within which stamps may wander: rounded ones do, at the beat of step and rounding."""

OUTLYING = 5.0
"""Standard deviations beyond which a sample is no cubic's, whatever dated it."""


@dataclass(frozen=True, eq=False)
class EvenStamps(ReadOnlyArrays):
    """Instants at which a source that samples evenly took its samples.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Times on the line; the stamps as given where the source does not sample evenly.
    line
        Kind of line that was taken; ``none`` where the source does not sample evenly.
    step_s
        Period of the source; NaN where it has none.
    scatter_s
        Standard deviation of the stamps about the line, 0 without one.
    wait_s
        Mean time by which the stamps are later than the line, 0 without one.
    u_line_s
        Standard uncertainty of the line against the beat and its shortest way, 0 without one.
    """

    times_s: Array
    line: Line
    step_s: float = math.nan
    scatter_s: float = 0.0
    wait_s: float = 0.0
    u_line_s: float = 0.0

    @property
    def even(self) -> bool:
        """Whether the source samples evenly."""
        return self.line != "none"


def even_stamps(times_s: Array, counts: Counts | None = None) -> EvenStamps:
    """Lay a line through stamps of a source that samples evenly and is stamped with jitter.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times, increasing; some steps may be multiples of the others where samples were lost.
    counts : ndarray of int64, shape (n,), optional
        The source's own count of its samples, unwrapped. It says what was lost however large the jitter is; without it
        jitter may be a quarter of a step, or the mean wait half of one.

    Returns
    -------
    EvenStamps
        Stamps on their line; as given where the source does not sample evenly, the jitter hides it, or the count
        contradicts itself or the stamps, as where the source paused or its clock was set.

    Raises
    ------
    ValueError
        If there is not one count for each stamp.
    """
    if counts is not None:
        require_alike(stamps=times_s, counts=counts)
    as_given = EvenStamps(times_s, "none")
    if times_s.size < 2 or not times_s[-1] > times_s[0]:
        return as_given
    places = count_steps(times_s) if counts is None else counts - counts[0]
    if places is None or not np.all(np.diff(places) > 0):
        return as_given
    found = _line_through(times_s, places.astype(np.float64))
    if found is None:
        return as_given
    # of a source that paused and did not count meanwhile most stamps lie on one line, and some far off
    if counts is not None and times_s.size >= LEAST_COUNTED:
        own_step_s = found.step_s * float(np.median(np.diff(places)))
        if not is_one_beat(times_s, found.times_s, own_step_s, find_bursts(times_s), scattered=True):
            return as_given
    return found


def _line_through(times_s: Array, places: Array) -> EvenStamps | None:
    """Lay the line; None where the stamps wander about it."""
    first, rough_s = float(times_s[0]), float((times_s[-1] - times_s[0]) / places[-1])
    beyond = (times_s - first) - rough_s * places
    runs = [count for count in RUNS if count * LEAST_RUN <= times_s.size]
    if runs:
        candidates = [_through_means(places, beyond, runs[0]), *(_through_lowest(places, beyond, r) for r in runs)]
        best = min(candidates, key=lambda candidate: candidate.u_s)
    else:
        best = _through_all(places, beyond)
    step_s = rough_s + best.slope
    u_line = best.u_s
    if best.wander_s > MOST_WANDER * best.within_s:
        if best.wander_s > FINE_WANDER * step_s:
            return None
        u_line = best.wander_s
    left = beyond - best.level_s - best.slope * places
    return EvenStamps(
        times_s=first + best.level_s + step_s * places,
        line=best.line,
        step_s=step_s,
        scatter_s=float(np.std(left)),
        wait_s=float(np.mean(left)),
        u_line_s=u_line,
    )


@dataclass(frozen=True)
class _Candidate:
    """A line, its uncertainty, and how its points scatter about it against the stamps within a run."""

    line: Line
    slope: float
    level_s: float
    u_s: float
    wander_s: float = 0.0
    within_s: float = 0.0


def _through_all(places: Array, beyond: Array) -> _Candidate:
    since = places - places.mean()
    slope = float(since @ beyond / (since @ since))
    level = float(beyond.mean()) - slope * float(places.mean())
    scatter = float(np.std(beyond - level - slope * places))
    return _Candidate("mean", slope, level, scatter / math.sqrt(places.size))


def _through_means(places: Array, beyond: Array, count: int) -> _Candidate:
    runs = np.array_split(np.arange(places.size), count)
    x, y = (np.array([values[run].mean() for run in runs]) for values in (places, beyond))
    slope, level = _robust_line(x, y)
    return _candidate("mean", x, y, slope, level, runs, beyond - slope * places)


def _through_lowest(places: Array, beyond: Array, count: int) -> _Candidate:
    runs = np.array_split(np.arange(places.size), count)
    slope = 0.0
    # which stamp of a run is the lowest is known once the slope is
    for _ in range(3):
        lowest = np.array([run[np.argmin((beyond - slope * places)[run])] for run in runs])
        slope, level = _robust_line(places[lowest], beyond[lowest])
    return _candidate("lower edge", places[lowest], beyond[lowest], slope, level, runs, beyond - slope * places)


def _candidate(
    line: Line, x: Array, y: Array, slope: float, level: float, runs: list[NDArray[np.intp]], flat: Array
) -> _Candidate:
    spread = MAD_TO_SIGMA * float(np.median(np.abs(y - level - slope * x)))
    within = float(np.median([np.std(flat[run]) for run in runs]))
    # rounding of the sums of seconds is no wander
    within = max(within, 4e-15 * float(np.abs(flat).max()), 1e-12)
    return _Candidate(line, slope, level, MEDIAN_LOSS * spread / math.sqrt(len(runs)), spread, within)


def _robust_line(x: Array, y: Array) -> tuple[float, float]:
    """Return slope and level of the line through the medians of slopes and of what is left (Theil and Sen)."""
    one, other = np.triu_indices(x.size, k=1)
    slope = float(np.median((y[other] - y[one]) / (x[other] - x[one])))
    return slope, float(np.median(y - slope * x))


def share_at_stamps(series: Sequence[Array], late_s: Array, places: Counts, step_s: float) -> tuple[float, float]:
    """Return which share of their jitter the samples were taken off the even beat by: 1 at the stamps, 0 on the beat.

    What a sample lies off the cubic through two neighbours on either side is regressed on what its own lateness and
    theirs, times the slope, would make of it.

    Parameters
    ----------
    series : sequence of ndarray, shape (n,)
        Signals that share the stamps; lost samples NaN.
    late_s : ndarray, shape (n,)
        Stamps less the even beat.
    places : ndarray of int64, shape (n,)
        Places of the stamps on the beat; across a gap nothing is compared.
    step_s
        Beat of the source.

    Returns
    -------
    share, u : float
        Share and its standard uncertainty, by the scatter of what was regressed; infinite where nothing is steep.
    """
    if late_s.size < LEAST_RUN:
        return 0.0, math.inf
    whole = places[4:] - places[:-4] == 4
    products, squares, scatter = 0.0, 0.0, 0.0
    for samples in series:
        slope = np.zeros(samples.size)
        slope[1:-1] = (samples[2:] - samples[:-2]) / (2.0 * step_s)
        off, by_jitter = _off_the_cubic(samples), _off_the_cubic(slope * late_s)
        used = whole & np.isfinite(off) & np.isfinite(by_jitter)
        off, by_jitter = off[used], by_jitter[used]
        noise = MAD_TO_SIGMA * float(np.median(np.abs(off))) if off.size else 0.0
        if not noise > 0:
            continue
        # a steep front that is no cubic must not decide alone
        kept = np.abs(off) < OUTLYING * noise + OUTLYING * np.abs(by_jitter)
        off, by_jitter = off[kept] / noise, by_jitter[kept] / noise
        products, squares = products + float(off @ by_jitter), squares + float(by_jitter @ by_jitter)
        scatter += float((off**2) @ (by_jitter**2))
    return (products / squares, math.sqrt(scatter) / squares) if squares > 0 else (0.0, math.inf)


def _off_the_cubic(samples: Array) -> Array:
    """Return how far samples lie off the cubic through two neighbours on either side, shape (n - 4,)."""
    near, far = samples[1:-3] + samples[3:-1], samples[:-4] + samples[4:]
    return np.asarray(samples[2:-2] - (4.0 * near - far) / 6.0)
