"""Frames of a CAN bus, whatever file they came from, decoded by the bus's database.

Each message is a time base of its own: the stamps of its frames in the file's relative time. Whole arrays are
decoded at once.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError
from recoil_acquisition.readers.can.counters import count_messages, counts_as_json, declared_counters
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import EXTENDED, CanLog
from recoil_acquisition.readers.can.messages import CanDatabase, Messages, count_identifiers, load_database, messages_of
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.track import Track


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


class CanRecording:
    """One opened log.

    Parameters
    ----------
    path : Path
    reader : str
    log : CanLog
    database : CanDatabase
    declared : Declarations
        Its clock, and its counters: gaps and missing messages of each are counted (`MessageCount`).

    Raises
    ------
    CorruptFileError
        If the log has no data frames.
    ReadError
        If a counter that is declared is none of the database.
    """

    def __init__(self, path: Path, reader: str, log: CanLog, database: CanDatabase, declared: Declarations) -> None:
        self.path = path
        self.reader = reader
        self.absolute_start: AbsoluteStart | None = log.absolute_start
        self.incomplete = log.incomplete
        self._clock = declared.clock
        self._database = database
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
        self._signals: dict[str, tuple[Messages, SignalLayout, NDArray[np.bool_]]] = {}
        foreign = np.ones(log.frames.key.size, dtype=bool)
        foreign &= ~np.isin(log.frames.key, [one.key for one in database.faulty])
        absent: list[str] = []
        headers: list[SignalHeader] = []
        for message in database.messages:
            key = message.frame_id | (EXTENDED if message.is_extended_frame else 0)
            own = log.frames.key == key
            foreign &= ~own
            chosen = np.flatnonzero(own)
            if chosen.size:
                headers += self._add(messages_of(message, log.frames, chosen, notes), notes)
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
        self.signals = tuple(headers)
        self.notes = tuple(notes)
        self.metadata = {
            **log.metadata,
            "unknown_identifiers": unknown,
            "absent_messages": absent,
            **counts_as_json(counts),
        }

    def _add(self, messages: Messages, notes: list[str]) -> list[SignalHeader]:
        headers = []
        for layout in messages.layouts.values():
            name = f"{messages.name}.{layout.name}"
            held = present(layout, messages.layouts, messages.data, messages.length)
            short = int(np.count_nonzero(held & (messages.length < layout.bytes_needed)))
            if short:
                notes.append(f"{name}: {short} frames are too short to hold it: lost samples")
            self._signals[name] = messages, layout, held
            headers.append(SignalHeader(name, layout.unit, int(np.count_nonzero(held))))
        return headers

    def _find(self, name: str) -> tuple[Messages, SignalLayout, NDArray[np.bool_]]:
        try:
            return self._signals[name]
        except KeyError:
            self._database.refuse_faulty(name, self.path)
            raise MissingChannelError(name, tuple(self._signals), path=self.path) from None

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of ``Message.Signal`` in the database's unit, lost ones NaN, shape (stop - start,)."""
        messages, layout, held = self._find(name)
        chosen = slice(start, stop) if held.all() else np.flatnonzero(held)[start:stop]
        data = messages.data[chosen]
        long_enough = messages.length[chosen] >= layout.bytes_needed
        if long_enough.all():
            return layout.decode(data)
        values = np.full(len(data), np.nan)
        if long_enough.any():
            values[long_enough] = layout.decode(data[long_enough])
        return values

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        """Return the stored integers, unless the signal is a float or a frame was too short to hold it."""
        messages, layout, held = self._find(name)
        complete = bool((messages.length[held] >= layout.bytes_needed).all())
        if layout.kind == "float" or not complete or (layout.kind == "unsigned" and layout.length == 64):
            return None
        counts = layout.raw(messages.data[held][start:stop]).astype(np.int64)
        return RawCounts(counts, layout.scale, layout.offset, layout.unit)

    def time_base(self, name: str) -> TimeBase:
        """Return the stamps of the frames that hold the signal."""
        messages, _, held = self._find(name)
        return TimeBase.stamped(self._clock, messages.time_s[held], self.absolute_start)

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()
