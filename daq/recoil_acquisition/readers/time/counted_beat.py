"""The even beat of frames that are counted by their sender, where the host stamps them late.

A host stamps what its adapter held back packet by packet, and now and then it stands still and stamps all that came
meanwhile at once. The sender's count says when such a frame was sent, if the sender is even. Whether it is, the stamps
say themselves: none is early, and of any frames behind one another some are stamped at once, so that the lower edge of
what the stamps are late by lies flat along the whole record. A sender that paused, restarted or sends upon events
leaves its beat and does not come back to it; its count dates nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.count_cycle import CountCycle
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA
from recoil_acquisition.readers.time.bursts import Bursts

_LEAST_FRAMES = 32
_LATE = 0.5
"""Share of a step from which on a stamp is late, and not just jittered by the bus."""
_FLAT = 0.25
"""Share of a step within which the lower edge lies flat, where stamps come one by one."""
_FLAT_STEPS, _FLAT_PACKET = 2.0, 0.25
"""Steps, or share of a packet, within which the lower edge lies flat, where they come in packets; a step at least."""
_LEAST_RUN, _RUNS = 32, 96
"""Frames, at least, and number of the runs of which each gives a point of the lower edge."""
_SCATTERS = 4.0
"""Scatters of these points by which a stamp may be early."""
_WAITS = 6.0
"""Median waits that one at an end of the record may last, where it is not seen that it ends."""
_LONGEST_END = 64
"""Number of frames that may wait there."""
_AT_ONCE = 0.25
"""Share of the time in which frames were sent within which a host that held them back stamps them."""


@dataclass(frozen=True, eq=False)
class CountedBeat:
    """Instants of frames on the even beat of their sender.

    Attributes
    ----------
    times_s : ndarray of float64, shape (n_frames,)
        Instants, increasing, s.
    latest_s
        Longest time by which a stamp is later than its instant, s.
    late
        Number of stamps that are later by more than half a step.
    """

    times_s: NDArray[np.float64]
    latest_s: float
    late: int


def frame_numbers(
    counts: NDArray[np.int64], held: NDArray[np.bool_], cycle: CountCycle | None
) -> NDArray[np.int64] | None:
    """Return the numbers of frames by their counter, see `CountCycle.numbers`.

    Parameters
    ----------
    counts : ndarray of int64, shape (n_frames,)
        Counts as stored.
    held : ndarray of bool, shape (n_frames,)
        Whether a frame holds the counter.
    cycle
        Cycle of the counter; None where it is not known.

    Returns
    -------
    ndarray of int64, shape (n_frames,), or None
        None where a frame has no number, or they do not increase from frame to frame.
    """
    if cycle is None:
        return None
    numbers, known = cycle.numbers(counts, held)
    return numbers if bool(known.all() and (np.diff(numbers) > 0).all()) else None


def counted_beat(numbers: NDArray[np.int64], times_s: NDArray[np.float64], bursts: Bursts | None) -> CountedBeat | None:
    """Return when counted frames were sent: at even intervals, on the line along the lower edge of their stamps.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n_frames,)
        The sender's count of its frames, unwrapped, increasing.
    times_s : ndarray of float64, shape (n_frames,)
        Stamps of the host, none below the one before it, s.
    bursts
        Bursts in which the stamps come; None where they come one by one.

    Returns
    -------
    CountedBeat or None
        None where the numbers do not count frames that are sent evenly.
    """
    if numbers.size < _LEAST_FRAMES:
        return None
    # of frames half a record apart most were stamped as late as each other, whatever stalls there were
    half = numbers.size // 2
    period_s = float(np.median((times_s[half:] - times_s[:-half]) / (numbers[half:] - numbers[:-half])))
    since_s = period_s * (numbers - numbers[0])
    slope, level_s = _lower_edge(since_s, times_s - since_s)
    found_s = level_s + (1.0 + slope) * since_s
    step_s = period_s * float(np.median(np.diff(numbers)))
    if not step_s > 0 or not (np.diff(found_s) > 0).all():
        return None
    if not is_one_beat(times_s, found_s, step_s, bursts):
        return None
    late_s = times_s - found_s
    return CountedBeat(found_s, float(late_s.max()), int(np.count_nonzero(late_s > _LATE * step_s)))


def is_one_beat(
    times_s: NDArray[np.float64],
    found_s: NDArray[np.float64],
    step_s: float,
    bursts: Bursts | None,
    *,
    scattered: bool = False,
) -> bool:
    """Return whether stamps are those of frames on one beat, along the whole record.

    None is early, and behind every delay they come back to the beat. A line that
    most frames lie on is no proof: of a sender that paused, and did not count meanwhile, a quarter may lie off it.

    Parameters
    ----------
    times_s, found_s : ndarray of float64, shape (n_frames,)
        Stamps, and instants of the frames on the beat in question, s.
    step_s
        Time from frame to frame, s.
    bursts
        Bursts in which the stamps come; None where they come one by one.
    scattered
        Whether their lower edge may scatter as most of it does, where it is known already that it does not wander.
    """
    late_s = times_s - found_s
    lowest_s = np.array([late_s[run].min() for run in _runs(late_s.size)])
    level_s = float(np.median(lowest_s))
    late_s, found_s = late_s - level_s, found_s + level_s
    flat_s = _FLAT * step_s
    if bursts is not None:
        flat_s = max(step_s, min(_FLAT_STEPS * step_s, _FLAT_PACKET * (bursts.within_s + bursts.pause_s)))
    if scattered:
        flat_s += _SCATTERS * MAD_TO_SIGMA * float(np.median(np.abs(lowest_s - level_s)))
    ends_s = flat_s + _WAITS * max(float(np.median(late_s)), 0.0)
    longest = _LONGEST_END if bursts is None else max(_LONGEST_END, 2 * bursts.stamps)
    return bool(
        late_s.min() >= -flat_s
        and _comes_back(late_s, times_s, found_s, flat_s, ends_s, longest)
        and _comes_back(late_s[::-1], -times_s[::-1], -found_s[::-1], flat_s, ends_s, longest)
    )


def _runs(count: int) -> list[NDArray[np.intp]]:
    """Return the frames in runs, of each of which the lowest stamp is a point of the lower edge."""
    return np.array_split(np.arange(count), np.clip(count // _LEAST_RUN, 2, _RUNS))


def _lower_edge(since_s: NDArray[np.float64], beyond_s: NDArray[np.float64]) -> tuple[float, float]:
    """Return slope and level of the line along the lower edge of stamps less their beat (Theil and Sen)."""
    runs = _runs(since_s.size)
    slope = 0.0
    # which stamp of a run is the lowest is known once the slope is
    for _ in range(3):
        flat_s = beyond_s - slope * since_s
        lowest = np.array([run[np.argmin(flat_s[run])] for run in runs])
        x, y = since_s[lowest], beyond_s[lowest]
        one, other = np.triu_indices(lowest.size, k=1)
        slope = float(np.median((y[other] - y[one]) / (x[other] - x[one])))
    return slope, float(np.median(y - slope * x))


def _comes_back(
    late_s: NDArray[np.float64],
    times_s: NDArray[np.float64],
    found_s: NDArray[np.float64],
    flat_s: float,
    ends_s: float,
    longest: int,
) -> bool:
    """Return whether stamps come back to the beat behind every delay, as those of a sender that paused do not.

    At the end of a record they may not have come back yet: those that came at once, for a log may end within what was
    held back, and a few that waited no longer than others.
    """
    least_s = np.minimum.accumulate(late_s[::-1])[::-1]
    first = int(np.searchsorted(least_s, flat_s, side="right"))
    count = late_s.size - first
    if not count:
        return True
    at_once = count > 1 and times_s[-1] - times_s[first] <= _AT_ONCE * (found_s[-1] - found_s[first])
    return bool(at_once or (count <= longest and late_s[-1] <= ends_s))
