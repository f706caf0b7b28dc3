"""Frames of a CAN bus, whatever file they came from, decoded by the bus's database.

Each message is a time base of its own: the stamps of its frames in the file's relative time. Whole arrays are
decoded at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.can.counters import count_messages, counts_as_json, declared_counters
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import CanLog, key_of
from recoil_acquisition.readers.can.messages import CanDatabase, Messages, count_identifiers, load_database, messages_of
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.timebase import AbsoluteStart, TimeBase


def declared_database(declared: Declarations, path: Path) -> CanDatabase:
    """Return the database that a rig declares for a file of a CAN bus.

    Raises
    ------
    ReadError
        If none is declared, or it is wrong.
    """
    if declared.database is None:
        raise ReadError(
            "a CAN log holds no signals without its database",
            path=path,
            remedy='declare `database = "<file>.dbc"` (or .kcd, .sym, .arxml) of this source',
        )
    return load_database(declared.database, path)


class CanRecording(Recording):
    """One opened log.

    Parameters
    ----------
    declared
        Its clock, and its counters: gaps and missing messages of each are counted (`MessageCount`).

    Raises
    ------
    CorruptFileError
        If the log has no data frames.
    ReadError
        If a counter that is declared is none of the database.
    """

    def __init__(self, path: Path, reader: str, log: CanLog, database: CanDatabase, declared: Declarations) -> None:
        notes = [*log.notes, *database.notes()]
        counters = declared_counters(declared.counters, database, path)
        if not log.frames.key.size:
            kinds = ("error_frames", "remote_frames", "other_events", "damaged_entries")
            counted = [f"{n} {kind.replace('_', ' ')}" for kind in kinds if (n := log.metadata.get(kind))]
            raise CorruptFileError(
                "the log has no data frames",
                path=path,
                found=", ".join(counted) or "no entries at all",
                remedy="check the recorder's channel and filters",
            )
        foreign = np.ones(log.frames.key.size, dtype=bool)
        foreign &= ~np.isin(log.frames.key, [one.key for one in database.faulty])
        absent: list[str] = []
        signals: list[_Signal] = []
        for message in database.messages:
            own = log.frames.key == key_of(message)
            foreign &= ~own
            chosen = np.flatnonzero(own)
            if chosen.size:
                signals += _signals(messages_of(message, log.frames, chosen, notes), notes)
            else:
                absent.append(message.name)
        counts = [count_messages(counter, log.frames) for counter in counters]
        notes += [note for count in counts for note in count.notes()]
        unknown = count_identifiers(log.frames.key[foreign])
        if unknown:
            shown = ", ".join(f"{n} x{count}" for n, count in list(unknown.items())[:8])
            more = " ..." if len(unknown) > 8 else ""
            notes.append(f"frames with identifiers unknown to the database: {sum(unknown.values())} ({shown}{more})")
        if absent:
            shown = ", ".join(absent[:8]) + (" ..." if len(absent) > 8 else "")
            notes.append(f"messages of the database that the log does not hold: {shown}")
        metadata = {
            **log.metadata,
            "unknown_identifiers": unknown,
            "absent_messages": absent,
            **counts_as_json(counts),
        }
        channels = []
        for one in signals:
            name, count = f"{one.messages.name}.{one.layout.name}", int(np.count_nonzero(one.held))
            instants = partial(one.instants, declared.clock, log.absolute_start)
            channels.append(StoredChannel(SignalHeader(name, one.layout.unit, count), instants, one.samples, one.raw))
        super().__init__(
            path, reader, channels, metadata=metadata, notes=notes, incomplete=log.incomplete,
            absolute_start=log.absolute_start, check_name=partial(database.refuse_faulty, path=path),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Signal:
    """A signal of the frames of one message, and which of them hold it."""

    messages: Messages
    layout: SignalLayout
    held: NDArray[np.bool_]

    def instants(self, clock: str, start: AbsoluteStart | None) -> TimeBase:
        return TimeBase.stamped(clock, self.messages.time_s[self.held], start)

    def samples(self, start: int, stop: int) -> NDArray[np.float64]:
        chosen = slice(start, stop) if self.held.all() else np.flatnonzero(self.held)[start:stop]
        data = self.messages.data[chosen]
        long_enough = self.messages.length[chosen] >= self.layout.bytes_needed
        if long_enough.all():
            return self.layout.decode(data)
        values = np.full(len(data), np.nan)
        if long_enough.any():
            values[long_enough] = self.layout.decode(data[long_enough])
        return values

    def raw(self, start: int, stop: int) -> RawCounts | None:
        """Return the stored integers, unless the signal is a float or a frame was too short to hold it."""
        layout = self.layout
        complete = bool((self.messages.length[self.held] >= layout.bytes_needed).all())
        if layout.kind == "float" or not complete or (layout.kind == "unsigned" and layout.length == 64):
            return None
        counts = layout.raw(self.messages.data[self.held][start:stop]).astype(np.int64)
        return RawCounts(counts, layout.scale, layout.offset, layout.unit)


def _signals(messages: Messages, notes: list[str]) -> list[_Signal]:
    signals = []
    for layout in messages.layouts.values():
        held = present(layout, messages.layouts, messages.data, messages.length)
        short = int(np.count_nonzero(held & (messages.length < layout.bytes_needed)))
        if short:
            notes.append(f"{messages.name}.{layout.name}: {short} frames are too short to hold it: lost samples")
        signals.append(_Signal(messages, layout, held))
    return signals
