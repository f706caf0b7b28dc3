"""Frames of a CAN bus, whatever file they came from, decoded by the bus's database.

Each message is a time base of its own: the stamps of its frames in the file's relative time. Whole arrays are
decoded at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, NoSignalError, ReadError
from recoil_acquisition.readers.can.buses import AT, bus_counts, by_bus, frames_of_bus
from recoil_acquisition.readers.can.counters import (
    MessageCounter,
    count_messages,
    counts_as_json,
    declared_counters,
    instants_by_counter,
    notes_of_jumps_by_counter,
)
from recoil_acquisition.readers.can.decoding import SignalLayout, present, told_apart
from recoil_acquisition.readers.can.frames import CanLog, key_of
from recoil_acquisition.readers.can.messages import CanDatabase, Messages, count_identifiers, load_database, messages_of
from recoil_acquisition.readers.can.parameter_groups import name_in_group
from recoil_acquisition.readers.can.second_recording import refuse_set_back
from recoil_acquisition.readers.can.senders import by_sender
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements, about_codes
from recoil_acquisition.readers.text.cells import whole_number
from recoil_acquisition.readers.time.bursts import find_bursts
from recoil_acquisition.readers.time.stalls import late_stamps
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark


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
        Declarations of the source: its clock, and its counters, of each of which gaps and missing messages are counted
        (`recoil_acquisition.readers.can.counters.MessageCount`).

    Raises
    ------
    NoSignalError
        If the log has no data frames, but others.
    CorruptFileError
        If it has no entries at all, or damaged ones alone; if stamps of a message go back and go on from there.
    ReadError
        If a counter that is declared is none of the database.
    """

    def __init__(self, path: Path, reader: str, log: CanLog, database: CanDatabase, declared: Declarations) -> None:
        database, log = by_sender(database, log)
        counters = declared_counters(declared.counters, database, path)
        if not log.frames.key.size:
            raise _no_data_frames(path, log)
        buses = bus_counts(log)
        log = log if declared.bus is None else frames_of_bus(log, declared.bus, path)
        notes = [*log.notes, *database.notes()]
        foreign = np.ones(log.frames.key.size, dtype=bool)
        foreign &= ~np.isin(log.frames.key, [one.key for one in database.faulty])
        absent: list[str] = []
        found: list[_Received] = []
        for message, own_name in zip(database.messages, database.own_names, strict=True):
            own = log.frames.key == key_of(message)
            foreign &= ~own
            chosen = np.flatnonzero(own)
            if chosen.size:
                found.append(_Received(message, own_name, by_bus(log, chosen)))
            else:
                absent.append(own_name)
        names = _Names(path)
        signals: list[_Signal] = []
        several = Counter(one.message.name for one in found)
        for one in found:
            name = one.own_name if several[one.message.name] > 1 else one.message.name
            apart = len(one.by_bus) > 1
            if apart:
                notes.append(_told_apart(name, one.by_bus))
            for bus, chosen in one.by_bus.items():
                called = f"{name}{AT}{bus}" if apart else name
                refuse_set_back(log, chosen, called, path)
                messages = messages_of(one.message, log.frames, chosen, notes, called)
                own_counters = [c for c in counters if c.key == key_of(one.message)]
                of_bus = _signals(_dated(messages, own_counters, notes), notes)
                for signal in of_bus:
                    own = (one.message.name, one.own_name, name_in_group(one.message))
                    names.add(name, own, signal.layout.name, bus if log.stores_buses else "", apart=apart)
                signals += of_bus
        counts = [count_messages(counter, log.frames) for counter in counters]
        notes += [note for count in counts for note in count.notes()]
        unknown = count_identifiers(log.frames.key[foreign])
        if unknown:
            shown = ", ".join(f"{n} x{count}" for n, count in list(unknown.items())[:8])
            more = " ..." if len(unknown) > 8 else ""
            text = f"frames with identifiers unknown to the database: {sum(unknown.values())} ({shown}{more})"
            notes.append(Note(NoteCode.UNMATCHED, None, text))
        if absent:
            shown = ", ".join(absent[:8]) + (" ..." if len(absent) > 8 else "")
            text = f"messages of the database that the log does not hold: {shown}"
            notes.append(Note(NoteCode.UNMATCHED, None, text))
        metadata = {
            **log.metadata,
            **({"buses": buses} if buses else {}),
            "unknown_identifiers": unknown,
            "absent_messages": absent,
            **counts_as_json(counts),
        }
        channels = []
        for name, signal in zip(names.chosen, signals, strict=True):
            count = int(np.count_nonzero(signal.held))
            instants = partial(signal.instants, declared.clock, log.absolute_start)
            header = SignalHeader(name, signal.layout.unit, count)
            said = {"comment": signal.layout.comment}
            # a factor of 0 makes nothing of any number
            beside = Statements(said if signal.layout.scale else {**said, "factor": 0.0}, (), not signal.layout.scale)
            channels.append(StoredChannel(header, instants, signal.samples, signal.raw, beside=beside))
        super().__init__(
            path, reader, channels, metadata=metadata, notes=notes, incomplete=log.incomplete,
            absolute_start=log.absolute_start, check_name=partial(_refuse, names, database, unknown),
            aliases=names.aliases(),
        )  # fmt: skip


_NO_DATA = {
    "error_frames": "reports of faults of the bus, without data",
    "remote_frames": "requests for data, without any",
    "other_events": "entries that are no frames",
    "damaged_entries": "entries that contradict themselves",
}
"""Entries of a log that are no data frames, by their counts in its metadata."""


def _no_data_frames(path: Path, log: CanLog) -> ReadError:
    """Return the error of a log that has no data frames: what it has instead."""
    if log.not_known:
        return ReadError(log.not_known, path=path, remedy="let the program that wrote it save an older version, or ASC")
    counts = {kind: int(count) for kind in _NO_DATA if (count := log.metadata.get(kind))}
    kinds = log.metadata.get("other_kinds", {})
    shown = ", ".join(f"{kind} x{count}" for kind, count in list(kinds.items())[:8])
    named = {f"{count} {kind.replace('_', ' ')}": _NO_DATA[kind] for kind, count in counts.items()}
    of_kinds = f" (other events by kind: {shown})" if shown else ""
    problem, found = "the log has no data frames", (", ".join(named) or "no entries at all") + of_kinds
    remedy = "check the recorder's channel and filters"
    if not counts.keys() - {"damaged_entries"}:
        return CorruptFileError(problem, path=path, found=found, remedy=remedy)
    if shown:
        named |= {name: f"{what}, by kind: {shown}" for name, what in named.items() if what == _NO_DATA["other_events"]}
    return NoSignalError(problem, named, log.notes, log.incomplete, path=path, found=found, remedy=remedy)


@dataclass(frozen=True, eq=False)
class _Received:
    """A message that a log has, and where its frames stand, by bus."""

    message: Any
    own_name: str
    by_bus: dict[str, NDArray[np.intp]]


class _Names:
    """Names of a log's signals: the shortest that no other one has, and longer ones under which each is found too.

    The longest is ``Message#identifier.Signal@bus``. What a shorter one of several signals stands for is a question.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.chosen: list[str] = []
        self._others: dict[str, dict[str, None]] = {}

    def add(self, message: str, own: tuple[str, ...], signal: str, bus: str, *, apart: bool) -> None:
        """Take the next signal.

        Parameters
        ----------
        message
            Shortest name of its message.
        own
            All names of its message.
        bus
            Bus that the message came on; empty where the log does not say it.
        apart
            Whether its message came on several buses.
        """
        at_bus = f"{AT}{bus}" if bus else ""
        name = told_apart([*self.chosen, f"{message}.{signal}" + at_bus * apart])[-1]
        self.chosen.append(name)
        for one in own:
            for other in dict.fromkeys((f"{one}.{signal}", f"{one}.{signal}{at_bus}")):
                self._others.setdefault(other, {})[name] = None

    def several(self, name: str) -> list[str]:
        """Return the signals for which a name may stand that none of them bears."""
        return list(self._others.get(name, ()))

    def aliases(self) -> dict[str, str]:
        """Return the other names that stand for one signal alone."""
        return {
            other: next(iter(those))
            for other, those in self._others.items()
            if len(those) == 1 and other not in self.chosen
        }


def _told_apart(name: str, by_bus: Mapping[str, NDArray[np.intp]]) -> Note:
    counted = ", ".join(f"{bus} ({places.size} frames)" for bus, places in by_bus.items())
    text = f"{name}: came on several buses, whose signals are told apart as {AT}BUS: {counted}"
    return Note(NoteCode.NAMES, name, text)


def _refuse(names: _Names, database: CanDatabase, unknown: Mapping[str, int], name: str) -> None:
    """Say why a name is that of no signal: a faulty message, a database of another bus, several that may be meant."""
    database.refuse_faulty(name, names.path)
    if not names.chosen and unknown:
        shown = ", ".join(list(unknown)[:8]) + (" ..." if len(unknown) > 8 else "")
        raise ReadError(
            f"the database knows no frame of this log, so {name!r} is not in it",
            path=names.path,
            found=f"identifiers {shown}",
            remedy="name the database of this bus in the rig file, or give the log of that one",
        )
    several = names.several(name)
    if not several:
        return
    shown = ", ".join(map(repr, several[:8])) + (" ..." if len(several) > 8 else "")
    buses = list(dict.fromkeys(one.rpartition(AT)[2] for one in several if AT in one))
    remedy = f"write {several[0]!r} or the like as `signal` in the rig file"
    if len(buses) > 1:
        bus = buses[0] if whole_number(buses[0]) is not None else f'"{buses[0]}"'
        remedy = f"set `bus = {bus}` or the like of this source in the rig file, or {remedy}"
    raise ReadError(
        f"{name!r} came on the buses {', '.join(buses)}" if len(buses) > 1 else f"{name!r} is of several messages",
        path=names.path, found=shown, remedy=remedy,
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
        complete = complete and not (layout.codes and layout.remarkable(self.messages.data[self.held])[0])
        if layout.kind == "float" or not complete or (layout.kind == "unsigned" and layout.length == 64):
            return None
        counts = layout.raw(self.messages.data[self.held][start:stop]).astype(np.int64)
        return RawCounts(counts, layout.scale, layout.offset, layout.unit)


def _dated(messages: Messages, counters: Sequence[MessageCounter], notes: list[Remark]) -> Messages:
    """Date frames by their counter where the host stamped them late, and say so; else by their stamps.

    Frames that were stamped at one instant are told apart by the counter alone.
    """
    stamped = messages.each_later()
    for counter in counters:
        for some in (messages, stamped) if stamped is not messages else (messages,):
            beat = instants_by_counter(counter, some, find_bursts(some.time_s))
            if beat is not None and beat.late:
                _note_left_out(some, messages, notes)
                why = find_bursts(some.time_s) or f"stamps are late by up to {1e3 * beat.latest_s:.3g} ms"
                text = f"{messages.name}: {why}: samples are dated by {counter.name} instead"
                notes.append(Note(NoteCode.TIME, messages.name, text))
                return replace(some, time_s=beat.times_s)
    _note_left_out(stamped, messages, notes)
    notes += [note for counter in counters for note in notes_of_jumps_by_counter(counter, stamped)]
    late = late_stamps(stamped.time_s)
    if late is not None:
        names = " and ".join(counter.name for counter in counters)
        why = (
            f"{names} does not count frames of an even beat"
            if names
            else "declare a signal that counts them in `counters`"
        )
        text = f"{messages.name}: {late.text}: samples are dated late by up to {1e3 * late.most_s:.3g} ms; {why}"
        notes.append(Caution(CautionCode.LATE_STAMPS, messages.name, text))
    return stamped


def _note_left_out(kept: Messages, messages: Messages, notes: list[Remark]) -> None:
    """Say how many frames of a message are left out because their stamps do not increase."""
    left_out = messages.backward + messages.time_s.size - kept.time_s.size
    if left_out:
        count = messages.backward + messages.time_s.size
        text = f"{messages.name}: {left_out} of {count} frames do not increase in time and were left out"
        notes.append(Caution(CautionCode.NOT_INCREASING, messages.name, text))


def _signals(messages: Messages, notes: list[Remark]) -> list[_Signal]:
    signals = []
    for layout in messages.layouts.values():
        held = present(layout, messages.layouts, messages.data, messages.length)
        short = int(np.count_nonzero(held & (messages.length < layout.bytes_needed)))
        if short:
            name = f"{messages.name}.{layout.name}"
            text = f"{name}: {short} frames are too short to hold it: lost samples"
            notes.append(Note(NoteCode.LOST, name, text))
        chosen = held & (messages.length >= layout.bytes_needed)
        notes += _remarkable(f"{messages.name}.{layout.name}", layout, messages.data[chosen])
        signals.append(_Signal(messages, layout, held))
    return signals


def _remarkable(name: str, layout: SignalLayout, data: NDArray[np.uint8]) -> Iterator[Remark]:
    """Say which samples are codes, and which are beyond what the database says."""
    codes, outside = layout.remarkable(data)
    if codes:
        yield about_codes(name, codes, len(data), "frames")
    if outside and layout.raw_limits is not None:
        low, high = (layout.scale * raw + layout.offset for raw in layout.raw_limits)
        text = (
            f"{name}: {outside} of {len(data)} frames hold a value outside of the database's range, "
            f"{min(low, high):.6g} to {max(low, high):.6g} {layout.unit}".rstrip()
            + ": they are taken as they are"
        )
        yield Note(NoteCode.CONTRADICTION, name, text)
