"""Descriptions of a stream as events among its blocks, so that any part of what is recorded says what it holds.

A description stands in the detail of events named `DESCRIBED`, packed, in as many parts as it takes. A device says it
at each connection and change, and again every `REPEATED_S`, because a capture may begin anywhere.
"""

from __future__ import annotations

import base64

from recoil_acquisition.devices.device import LONGEST_DETAIL, Block, event_block
from recoil_acquisition.streams.packed_description import description_of, packed_description
from recoil_acquisition.streams.tick_stream import StreamDescription

DESCRIBED = "described"
"""Name of the event."""
REPEATED_S = 0.2
"""Longest time between two of them while samples come, s: less than what is cut behind a shot."""
_PART = LONGEST_DETAIL - 64
_MOST_PARTS = 256


def described_events(source: str, host_ns: int, description: StreamDescription) -> tuple[Block, ...]:
    """Return the events that say a description."""
    packed = base64.b85encode(packed_description(description)).decode()
    parts = [packed[at : at + _PART] for at in range(0, len(packed), _PART)]
    return tuple(
        event_block(source, host_ns, DESCRIBED, f"{number}/{len(parts)} {part}")
        for number, part in enumerate(parts, start=1)
    )


class DescribedEvents:
    """Puts the parts of descriptions together again."""

    def __init__(self) -> None:
        self._parts: list[str] = []

    def take(self, detail: str) -> StreamDescription | None:
        """Take the detail of the next event; return the description that it completes, None of any other."""
        head, _, part = detail.partition(" ")
        number, _, of = head.partition("/")
        if number == "1":
            self._parts = []
        if number != str(len(self._parts) + 1) or len(self._parts) >= _MOST_PARTS:
            self._parts = []  # its beginning is not there
            return None
        self._parts.append(part)
        if of != number:
            return None
        packed, self._parts = "".join(self._parts), []
        try:
            return description_of(base64.b85decode(packed))
        except ValueError:
            return None


def changes(before: StreamDescription, now: StreamDescription) -> str:
    """Say how a stream's channels are described otherwise than before; empty where they are not."""
    old, new = ({one.name: one for one in each.channels} for each in (before, now))
    found = [f"{name} is gone" for name in old if name not in new]
    found += [f"{name} is new" for name in new if name not in old]
    for name in (one for one in old if one in new):
        for what in ("unit", "factor", "offset", "tick_rate", "step"):
            was, is_now = getattr(old[name], what), getattr(new[name], what)
            if was != is_now:
                shown = what.replace("tick_rate", "rate")
                found.append(f"{shown} of {name} is {is_now or 'none'}, was {was or 'none'}")
    return "; ".join(found[:8]) or ("" if [*old] == [*new] else "the order of its channels")
