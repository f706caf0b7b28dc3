"""A recording of the channels of a container format, which must hold at least one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import FileEnd, NoSignalError, ReadError
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.readers.row_counter import first_counter, over_gaps
from recoil_acquisition.remark import Note, NoteCode, Remark


class Damaged(str):
    """A reason why a signal is left out: something of it is not where the file says, and may be on its way."""

    __slots__ = ()


def container_recording(
    path: Path,
    reader: str,
    channels: Sequence[StoredChannel],
    metadata: Mapping[str, Any],
    notes: Sequence[Remark],
    incomplete: str = "",
    absolute_start: AbsoluteStart | None = None,
    left_out: Mapping[str, str] | None = None,
    remedy: str | None = None,
    rows: Mapping[str, str] = MappingProxyType({}),
) -> Recording:
    """Return the recording of a container's channels; the first seven parameters are those of `Recording`.

    Parameters
    ----------
    left_out
        Reasons why signals are not read, by their names; whoever asks for one is given its reason.
    remedy
        Advice to the user where there is no channel.
    rows
        Group of each channel that a rate dates, by the channel's name: a counter among them tells which are missing.

    Raises
    ------
    NoSignalError
        If there is no channel: nothing in the file can be used, and `notes` say why.
    """
    if not channels:
        raise no_signal("no time history in this file", path, left_out or {}, notes, incomplete, remedy)
    dated, of_groups = _over_gaps(path, channels, rows)
    return Recording(
        path, reader, dated, metadata=metadata, notes=lambda: (*notes, *_said(of_groups)), incomplete=incomplete,
        absolute_start=absolute_start, check_name=partial(_refuse_left_out, left_out or {}, path),
    )  # fmt: skip


class _Rows:
    """Rows of a group that one rate dates.

    Parameters
    ----------
    channels
        All that it has.
    uniform
        Their instants by the rate alone.
    """

    def __init__(self, path: Path, channels: Sequence[StoredChannel], uniform: TimeBase) -> None:
        self._path, self._uniform = path, uniform
        self._columns = {one.header.name: one.samples for one in channels if not one.header.unit}

    @cached_property
    def found(self) -> tuple[TimeBase, Note | None]:
        """Instants with the gaps that a counter shows, and what is to say about them."""
        base = self._uniform
        counted = first_counter(self._columns, base.count)
        if counted is None or base.step_s is None:
            return base, None
        uniform = partial(_extended, base)
        return over_gaps(*counted, uniform, self._path, lambda row: f"sample {row + 1}")

    def instants(self) -> TimeBase:
        return self.found[0]


def _extended(base: TimeBase, count: int) -> TimeBase:
    return TimeBase.uniform(base.clock, base.start_s, base.step_s or 1.0, count, base.absolute_start)


def _over_gaps(
    path: Path, channels: Sequence[StoredChannel], rows: Mapping[str, str]
) -> tuple[Sequence[StoredChannel], list[_Rows]]:
    """Let a counter date the channels of its group, once somebody asks for instants or notes."""
    groups: dict[tuple[Any, ...], list[StoredChannel]] = {}
    for one in channels:
        base = one.time_base
        if one.header.name in rows and isinstance(base, TimeBase) and base.step_s is not None:
            groups.setdefault((rows[one.header.name], base.count, base.start_s, base.step_s), []).append(one)
    several = [own for own in groups.values() if len(own) > 1 and any(not one.header.unit for one in own)]
    found: list[_Rows] = []
    dated: dict[str, StoredChannel] = {}
    for own in several:
        base = own[0].time_base
        if isinstance(base, TimeBase):
            found.append(_Rows(path, own, base))
            dated |= {one.header.name: replace(one, time_base=found[-1].instants) for one in own}
    return [dated.get(one.header.name, one) for one in channels], found


def _said(groups: Sequence[_Rows]) -> list[Note]:
    return [note for one in groups if (note := one.found[1]) is not None]


def no_signal(
    problem: str,
    path: Path,
    left_out: Mapping[str, str],
    notes: Sequence[Remark],
    incomplete: str = "",
    remedy: str | None = None,
) -> NoSignalError:
    """Return the error of a container without a channel; the parameters are those of `container_recording`."""
    said = set(left_out_notes(left_out))
    return NoSignalError(
        problem, left_out, [str(note) for note in notes if note not in said], incomplete, path=path,
        found="; ".join(list(notes)[:6]) or "nothing", remedy=remedy,
        file_end=FileEnd.MISSING if incomplete else FileEnd.UNCLEAR,
    )  # fmt: skip


def left_out_notes(left_out: Mapping[str, str]) -> list[Remark]:
    """Return a note on each signal that is not read."""
    return [Note(NoteCode.LEFT_OUT, name, f"{name}: {reason}: left out") for name, reason in left_out.items()]


def unused_time_note(name: str) -> Note:
    """Return the note on a time that no channel has."""
    return Note(NoteCode.LEFT_OUT, name, f"{name}: a time that no channel was given: left out")


def note_on_starts() -> Note:
    """Return the note on channels whose absolute starts differ."""
    text = "channels start at different absolute times: their differences are in their time"
    return Note(NoteCode.TIME, None, text)


def _refuse_left_out(reasons: Mapping[str, str], path: Path, name: str) -> None:
    if name in reasons:
        end = FileEnd.UNCLEAR if isinstance(reasons[name], Damaged) else FileEnd.THERE
        raise ReadError(f"signal {name!r} cannot be read", path=path, found=str(reasons[name]), file_end=end)
