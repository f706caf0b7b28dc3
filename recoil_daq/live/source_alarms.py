"""Alarms of live sources: which gives nothing, or nothing that is good, while a channel of the estimate hangs on it."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from recoil_daq.live.range_state import RangeSource, SourceState

SILENT_S = 1.2
"""Silence of a source, s, from which on it is an alarm."""
SPOILT = 0.1
"""Share of what came within `LOOKED_BACK_S` that belongs to no good frame, from which on it is an alarm."""
LOOKED_BACK_S = 1.5
_LEAST = {"bytes": 200, "frames": 10}
"""What must have come in that time before a share of it is believed."""
_ALARMS: Mapping[SourceState, str] = {
    "not understood": "{name} NOT UNDERSTOOD: {counted} come, none of them good: {remedy}",
}
"""State of a source that is read and gives nothing good -> what is said of it."""
_REMEDIES = {"bytes": "check baud rate, framing and cable", "frames": "check bit rate, termination and database"}


@dataclass(frozen=True)
class _Counted:
    """Count of what a source had received, and of what of it was spoilt, at an instant."""

    at_s: float
    received: int
    spoilt: int


class SourceAlarms:
    """Says what is wrong with the sources that matter, a sentence each.

    Parameters
    ----------
    triggering
        Sources that the trigger looks at.
    needed
        Other sources with a channel that has a role.
    """

    def __init__(self, triggering: Collection[str], needed: Collection[str]) -> None:
        self._triggering, self._needed = frozenset(triggering), frozenset(needed)
        self._counted: dict[str, deque[_Counted]] = {}

    def look(self, sources: Sequence[RangeSource], now_s: float) -> tuple[str, ...]:
        """Look at the sources as they are at an instant of the host's clock."""
        return tuple(text for one in sources for text in self._of(one, now_s))

    def _of(self, source: RangeSource, now_s: float) -> Iterator[str]:
        live, name = source.live, source.name
        if live is None:
            return
        spoilt = self._spoilt(source, now_s)
        if source.state == "lost":
            yield f"{name} LOST: it is opened as soon as it is back"
        if name not in self._triggering | self._needed:
            return
        remedy = _REMEDIES.get(live.counted, "check its settings and its cable")
        if source.state == "silent" and (live.age_s is None or live.age_s > SILENT_S):
            hangs = "the trigger looks at it" if name in self._triggering else "check its supply and its cable"
            yield f"{name} SILENT: {hangs}"
        elif (text := _ALARMS.get(source.state)) is not None:
            yield text.format(name=name, counted=live.counted, remedy=remedy)
        elif source.state == "live" and spoilt > SPOILT:
            yield f"{name} SPOILT: {100 * spoilt:.0f} % of its {live.counted} belong to no good frame: {remedy}"

    def _spoilt(self, source: RangeSource, now_s: float) -> float:
        """Return which share of what came lately belongs to no good frame."""
        live = source.live
        if live is None:
            return 0.0
        counters = live.counters
        # bytes of no frame are among those that were received, frames that are none are not
        of_bus = live.counted == "frames"
        bad = counters.bad + counters.error_frames if of_bus else counters.skipped_bytes or 0
        counted = self._counted.setdefault(source.name, deque())
        counted.append(_Counted(now_s, counters.received + bad * of_bus, bad))
        while counted[0].at_s < now_s - LOOKED_BACK_S:
            counted.popleft()
        received = counted[-1].received - counted[0].received
        whole = counted[-1].at_s - counted[0].at_s > LOOKED_BACK_S / 2
        if not whole or received < _LEAST.get(live.counted, 1):
            return 0.0
        return (counted[-1].spoilt - counted[0].spoilt) / received
