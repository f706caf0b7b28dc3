"""The rest between two shots: whether a channel stands where it stood before the last one, as quietly as then."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.capture.status import ChannelStatus
from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_daq.terminal.engineering import engineering, spelled

AFTER_S = 5.0
"""Time after a crossing, s, for which the mechanism is not expected to rest again."""
MOVED, NOISIER = 0.01, 3.0
"""Share of its range by which a zero has moved, and factor by which noise has grown, from which on it is said."""
_LEAST_NOISE = 1e-3
"""Share of its range below which noise is nobody's concern."""
_KEPT_S = 10.0


class RestWatch:
    """Compares where channels are at rest with where they were before the last shot.

    Parameters
    ----------
    units
        Units in which people read them.
    """

    def __init__(self, units: UnitChoice = SI) -> None:
        self._units = units
        self._seen: deque[tuple[float, dict[str, Level]]] = deque()
        self._before: dict[str, Level] = {}
        self._shot = ""
        self._moved_s = -np.inf

    def moved(self, time_s: float) -> None:
        """Note that something crossed a level of the trigger: for a while nothing rests."""
        self._moved_s = max(self._moved_s, time_s)

    def look(self, channels: Sequence[ChannelStatus]) -> tuple[str, ...]:
        """Take the levels of the last second; return a sentence for each channel that rests otherwise than before."""
        now_s = time.monotonic()
        levels = {one.name: one.level for one in channels if one.level is not None}
        self._seen.append((now_s, levels))
        while self._seen[0][0] < now_s - _KEPT_S:
            self._seen.popleft()
        return tuple(self._changes(channels)) if now_s - self._moved_s > AFTER_S else ()

    def fired(self, shot: str, trigger_s: float) -> None:
        """Keep the rest before a shot: the last levels that were taken before its trigger."""
        before = [levels for at_s, levels in self._seen if at_s <= trigger_s]
        self.moved(trigger_s)
        if before:
            self._before, self._shot = before[-1], shot

    def _changes(self, channels: Sequence[ChannelStatus]) -> Iterator[str]:
        for channel in channels:
            before, now = self._before.get(channel.name), channel.level
            if before is None or now is None or channel.range is None:
                continue
            span = channel.range[1] - channel.range[0]
            noise, noise_before = now.high - now.low, before.high - before.low
            moved = (now.high + now.low - before.high - before.low) / 2.0
            if abs(moved) > max(MOVED * span, noise, noise_before):
                sign = "+" if moved > 0 else ""
                factor, unit = self._units.factor(channel.unit)
                text = f"{sign}{engineering(factor * moved, spelled(unit), digits=2)}"
                yield f"zero of {channel.name} {text} since before {self._shot}"
            elif noise > NOISIER * max(noise_before, _LEAST_NOISE * span):
                factor = noise / max(noise_before, 1e-300)
                times = f"{factor:.1f} times" if factor < 1000 else "far above"
                yield f"noise of {channel.name} {times} that before {self._shot}"
