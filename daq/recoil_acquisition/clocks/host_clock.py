"""The two clocks of the host: the wall clock that people set, and the monotonic one that stamps what is received."""

from __future__ import annotations

import time
from dataclasses import dataclass

from recoil_acquisition.quantities.declaration import STRICT

_ANCHOR_TRIES = 9


@dataclass(frozen=True)
class Anchor:
    """One instant on the host's two clocks.

    Attributes
    ----------
    wall_ns
        Time by the host's wall clock, nanoseconds since 1970-01-01 UTC.
    monotonic_ns
        The host's monotonic clock.
    within_ns
        Time by which the pair may be off: half of that between the two readings that enclose the wall clock's.
    """

    __pydantic_config__ = STRICT

    wall_ns: int
    monotonic_ns: int
    within_ns: int

    def wall_of(self, monotonic_ns: int) -> int:
        """Return the wall-clock time of an instant of the monotonic clock, if neither was set since."""
        return self.wall_ns + monotonic_ns - self.monotonic_ns


def anchor() -> Anchor:
    """Read both clocks of the host, as closely together as a few tries give."""
    tries = []
    for _ in range(_ANCHOR_TRIES):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        tries.append(Anchor(wall, (before + after) // 2, (after - before + 1) // 2))
    return min(tries, key=lambda one: one.within_ns)
