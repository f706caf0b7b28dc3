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


def fastest_s(work: Callable[[], Any], rounds: int = 5) -> float:
    """Return the least processor time of some repetitions: the machine's other work only ever slows it down."""
    times_s = []
    for _ in range(rounds):
        begin_s = process_time()
        work()
        times_s.append(process_time() - begin_s)
    return min(times_s)
