"""A recording of the channels of a container format, which must hold at least one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import FileEnd, NoSignalError, ReadError
from recoil_acquisition.readers.recording import Recording, StoredChannel
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
) -> Recording:
    """Return the recording of a container's channels; the first seven parameters are those of `Recording`.

    Parameters
    ----------
    left_out
        Reasons why signals are not read, by their names; whoever asks for one is given its reason.
    remedy
        Advice to the user where there is no channel.

    Raises
    ------
    NoSignalError
        If there is no channel: nothing in the file can be used, and `notes` say why.
    """
    if not channels:
        raise no_signal("no time history in this file", path, left_out or {}, notes, incomplete, remedy)
    return Recording(
        path, reader, channels, metadata=metadata, notes=notes, incomplete=incomplete, absolute_start=absolute_start,
        check_name=partial(_refuse_left_out, left_out or {}, path),
    )  # fmt: skip


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
