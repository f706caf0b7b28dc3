"""How long two programs take over the same work, in processor time."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any, NamedTuple


class Beside(NamedTuple):
    """Seconds that ours and a peer took, each the least of its repetitions."""

    ours_s: float
    theirs_s: float

    @property
    def times(self) -> float:
        """How many times as fast ours is."""
        return self.theirs_s / self.ours_s


def in_turns(ours: Callable[[], Any], theirs: Callable[[], Any], rounds: int = 5) -> Beside:
    """Time both in turns, so that what else the machine does meets both."""
    turns = [(fastest_s(ours, 1), fastest_s(theirs, 1)) for _ in range(rounds)]
    return Beside(min(one for one, _ in turns), min(one for _, one in turns))


def fastest_s(work: Callable[[], Any], rounds: int = 5) -> float:
    """Return the least processor time of some repetitions: the machine's other work only ever slows it down."""
    times_s = []
    for _ in range(rounds):
        begin_s = process_time()
        work()
        times_s.append(process_time() - begin_s)
    return min(times_s)
