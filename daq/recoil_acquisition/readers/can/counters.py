"""Signals that count the messages they are in, and the messages that are missing by them.

What a counter of n bits shows: up to ``2**(n - 1) - 1`` messages lost in a row are counted exactly; more, up to
``2**n - 1``, are seen as a gap whose size is not known, because the counter may as well have gone back;
``2**n`` in a row, 256 of a counter of 8 bits, cannot be seen at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError, nearest_first
from recoil_acquisition.frames.values import unwrap
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import CanFrames
from recoil_acquisition.readers.can.messages import CanDatabase, Messages
from recoil_acquisition.readers.counter_gaps import CounterGaps, find_gaps, gaps_as_json
from recoil_acquisition.readers.time.bursts import Bursts
from recoil_acquisition.readers.time.counted_beat import counted_beat
from recoil_acquisition.remark import Note, NoteCode, Remark

_NEVER_WRAPS_BITS = 63
"""Bits of a counter that does not wrap while anything is recorded, and whose modulo is no int64."""


@dataclass(frozen=True, eq=False)
class MessageCounter:
    """A signal that counts the messages it is in.

    Attributes
    ----------
    name
        Name of the signal, ``Message.Signal``.
    key
        Identifier of the message, with bit 31 for 29 bits.
    layouts
        Layouts of all signals of the message.
    """

    name: str
    key: int
    layout: SignalLayout
    layouts: dict[str, SignalLayout]


@dataclass(frozen=True)
class MessageCount:
    """Losses of a log by a counter.

    Attributes
    ----------
    name
        Name of the counter, ``Message.Signal``.
    channels
        Gaps on each channel of the log that has such messages.
    """

    name: str
    channels: tuple[CounterGaps, ...]

    def notes(self) -> list[Remark]:
        """Say how many messages are missing."""
        places = sum(c.places for c in self.channels)
        if not places:
            return []
        text = f"{self.name}: {places} gaps, {sum(c.missing for c in self.channels)} messages are missing"
        return [Note(NoteCode.LOST, self.name, text)]


def declared_counters(names: Sequence[str], database: CanDatabase, path: Path) -> list[MessageCounter]:
    """Find the counters that a rig declares in its database.

    Parameters
    ----------
    names
        Names of the counters, such as ``Message.Signal``.
    path
        Log, for messages.

    Returns
    -------
    list of MessageCounter

    Raises
    ------
    ReadError
        If the database has no such signal, with the nearest names, or it is not an integer.
    """
    if not names:
        return []
    known = {
        name: [MessageCounter(one.name, one.key, one.layout, one.layouts) for one in those if one.layout is not None]
        for name, those in database.signals.items()
    }
    integers = [name for name, those in known.items() if those and all(one.layout.kind != "float" for one in those)]
    for name in names:
        if name in integers:
            continue
        database.refuse_faulty(name, path)
        nearest = nearest_first(name, integers)
        raise ReadError(
            f"the counter {name!r} is a float in the CAN database"
            if name in known
            else f"the CAN database has no signal {name!r} that could count messages",
            path=path,
            expected="an integer signal",
            found=", ".join(map(repr, nearest[:8])) + (f" and {len(nearest) - 8} more" if len(nearest) > 8 else "")
            if nearest
            else "no integer signals at all",
            remedy="correct `counters` of this source in the rig file, nearest names first",
        )
    return list({one.name: one for name in names for one in known[name]}.values())


def count_messages(counter: MessageCounter, frames: CanFrames) -> MessageCount:
    """Count the gaps of a counter, over all frames that hold it, in the order in which the log has them.

    Parameters
    ----------
    frames
        Frames of the log; the messages of each of its channels are counted for themselves.
    """
    chosen = frames.key == counter.key
    data, length, channel = frames.data[chosen], frames.length[chosen], frames.channel[chosen]
    needed = max(layout.bytes_needed for layout in counter.layouts.values())
    if data.shape[1] < needed:
        data = np.pad(data, ((0, 0), (0, needed - data.shape[1])))
    held = present(counter.layout, counter.layouts, data, length) & (length >= counter.layout.bytes_needed)
    modulo = 0 if counter.layout.length >= _NEVER_WRAPS_BITS else 2**counter.layout.length
    times_s = frames.time_s[chosen]
    found = []
    for one in np.unique(channel[held]):
        own = held & (channel == one)
        found.append(find_gaps(counter.layout.raw(data[own]).astype(np.int64), times_s[own], modulo))
    return MessageCount(counter.name, tuple(found))


def instants_by_counter(counter: MessageCounter, messages: Messages, bursts: Bursts) -> NDArray[np.float64] | None:
    """Return when the frames of a message were sent, by its counter: on the line along the lower edge of their stamps.

    Parameters
    ----------
    bursts
        Bursts in which the stamps come.

    Returns
    -------
    ndarray of float64, shape (n_frames,), or None
        Instants of the frames, s; None where a frame does not hold the counter, or it does not count them.
    """
    layout = counter.layout
    held = present(layout, counter.layouts, messages.data, messages.length) & (messages.length >= layout.bytes_needed)
    if not held.all():
        return None
    modulo = 0 if layout.length >= _NEVER_WRAPS_BITS else 2**layout.length
    numbers = unwrap(layout.raw(messages.data).astype(np.int64), modulo)
    return counted_beat(numbers, messages.time_s, bursts)


def counts_as_json(counts: Sequence[MessageCount]) -> dict[str, Any]:
    """Return each counter's count in JSON types, and over all of them sums and maxima; nothing without counters."""
    if not counts:
        return {}
    every = [one for count in counts for one in count.channels]
    return {"counters": {count.name: gaps_as_json(count.channels) for count in counts}, **gaps_as_json(every)}
