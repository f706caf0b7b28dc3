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
from recoil_acquisition.frames.count_cycle import CountCycle, find_cycle
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import CanFrames
from recoil_acquisition.readers.can.messages import CanDatabase, Messages
from recoil_acquisition.readers.counter_gaps import CounterGaps, find_gaps, gaps_as_json
from recoil_acquisition.readers.time.bursts import Bursts
from recoil_acquisition.readers.time.counted_beat import CountedBeat, counted_beat, frame_numbers
from recoil_acquisition.remark import Note, NoteCode, Remark

_NEVER_WRAPS_BITS = 63
"""Bits of a counter that does not wrap while anything is recorded, and whose modulo is no int64."""


_LEAST_EVEN, _EVEN, _MOSTLY = 16, 0.25, 0.9
"""Messages of which it is said whether they are even; difference of a step from the usual one; share of those."""
_JUMP = 8.0
"""Usual steps from which on one is a jump."""


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

    @property
    def width(self) -> int:
        """Number of values that it can hold; 0 where it does not wrap while anything is recorded."""
        return 0 if self.layout.length >= _NEVER_WRAPS_BITS else 1 << self.layout.length


@dataclass(frozen=True)
class MessageCount:
    """Losses of a log by a counter.

    Attributes
    ----------
    name
        Name of the counter, ``Message.Signal``.
    channels
        Gaps on each channel of the log that has such messages.
    cycle
        Cycle of the counter, as its counts show it.
    marks
        Number of messages whose count is none of the cycle, such as the mark of a fault.
    """

    name: str
    channels: tuple[CounterGaps, ...]
    cycle: CountCycle
    marks: int

    def notes(self) -> list[Remark]:
        """Say how many messages are missing, and how the counter counts where that is not through all of its field."""
        notes: list[Remark] = []
        places = sum(c.places for c in self.channels)
        if places:
            text = f"{self.name}: {places} gaps, {sum(c.missing for c in self.channels)} messages are missing"
            notes.append(Note(NoteCode.LOST, self.name, text))
        first, step = self.cycle.first, self.cycle.step
        ways = [] if first is None else [f"from {first} to {first + self.cycle.modulo - step} and begins anew"]
        ways += [f"by {step}"] if step != 1 else []
        if ways:
            marks = f"; {self.marks} messages have another number there, which is no count" if self.marks else ""
            text = f"{self.name} counts {' '.join(ways)}, as its numbers show, and gaps are counted so{marks}"
            notes.append(Note(NoteCode.UNSEEN, self.name, text))
        return notes


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
    times_s, counts = frames.time_s[chosen], np.zeros(held.size, dtype=np.int64)
    counts[held] = counter.layout.raw(data[held]).astype(np.int64)
    channels = np.unique(channel[held])
    cycle = _common_cycle([counts[held & (channel == one)] for one in channels], counter.width)
    found, marks = [], int(np.count_nonzero(held)) - int(np.count_nonzero(cycle.holds(counts[held])))
    for one in channels:
        own = held & (channel == one)
        numbers, known = cycle.numbers(counts[own], np.ones(np.count_nonzero(own), dtype=bool))
        found.append(find_gaps(numbers[known], times_s[own][known], 0, cycle.step))
    return MessageCount(counter.name, tuple(found), cycle, marks)


def _common_cycle(counts: Sequence[NDArray[np.int64]], width: int) -> CountCycle:
    """Return the cycle in which a counter counts on each bus; that of its whole field where they differ."""
    found = {find_cycle(one, width) for one in counts}
    cycle = found.pop() if len(found) == 1 else None
    return cycle or CountCycle(width)


def _numbers(counter: MessageCounter, messages: Messages) -> NDArray[np.int64] | None:
    layout = counter.layout
    held = present(layout, counter.layouts, messages.data, messages.length) & (messages.length >= layout.bytes_needed)
    counts = layout.raw(messages.data).astype(np.int64)
    return frame_numbers(counts, held, find_cycle(counts[held], counter.width))


def notes_of_jumps_by_counter(counter: MessageCounter, messages: Messages) -> list[Remark]:
    """Say where the stamps of an even message jump ahead and its counter goes on as if nothing had been."""
    numbers = _numbers(counter, messages)
    if numbers is None or numbers.size < _LEAST_EVEN:
        return []
    steps_s = np.diff(messages.time_s) / np.diff(numbers)
    usual_s = float(np.median(steps_s))
    if np.mean(np.abs(steps_s - usual_s) <= _EVEN * usual_s) < _MOSTLY:
        return []
    jumps = np.flatnonzero(steps_s > _JUMP * usual_s)
    if not jumps.size:
        return []
    first = int(jumps[np.argmax(steps_s[jumps])])
    places = "one place" if jumps.size == 1 else f"{jumps.size} places"
    text = (
        f"{messages.name}: stamps jump ahead at {places}, most by {steps_s[first]:.6g} s"
        f" at {messages.time_s[first]:.6g} s, and {counter.name} goes on: the sender paused, or a clock was set"
    )
    return [Note(NoteCode.TIME, messages.name, text)]


def instants_by_counter(counter: MessageCounter, messages: Messages, bursts: Bursts | None) -> CountedBeat | None:
    """Return when the frames of a message were sent, by its counter: on the line along the lower edge of their stamps.

    Parameters
    ----------
    bursts
        Bursts in which the stamps come; None where they come one by one.

    Returns
    -------
    CountedBeat or None
        None where the counter does not count frames that are sent evenly.
    """
    numbers = _numbers(counter, messages)
    return None if numbers is None else counted_beat(numbers, messages.time_s, bursts)


def counts_as_json(counts: Sequence[MessageCount]) -> dict[str, Any]:
    """Return each counter's count in JSON types, and over all of them sums and maxima; nothing without counters."""
    if not counts:
        return {}
    every = [one for count in counts for one in count.channels]
    return {"counters": {count.name: gaps_as_json(count.channels) for count in counts}, **gaps_as_json(every)}
