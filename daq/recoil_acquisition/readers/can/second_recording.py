"""Where a second recording begins in a log: logs that were put together, or stopped and begun again.

What the second one says of its own beginning decides at which instants its frames came. Where it says nothing, or
something that cannot be, the log is refused: its stamps count from an instant that nobody knows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, FileEnd
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.time.increasing_stamps import single_ahead
from recoil_acquisition.remark import Note, NoteCode

BACK_NS = 100_000_000
"""Frames of one bus that were held back in a queue are logged later by less than this."""

_REMEDY = "take the recordings apart there, and give the one that is meant"


class SecondRecordingError(ValueError):
    """A second recording whose beginning is not known.

    Parameters
    ----------
    why
        Clause on its begin, behind "a second recording begins in this log".
    place
        Place in the log at which it begins.
    """

    def __init__(self, why: str, place: str) -> None:
        self.why, self.place = why, place
        super().__init__(f"{place}: {why}")

    def of(self, path: Path) -> CorruptFileError:
        """Return the error of its file."""
        return CorruptFileError(
            f"a second recording begins in this log, {self.why}",
            path=path,
            place=self.place,
            remedy=_REMEDY,
            file_end=FileEnd.THERE,
        )


def note_on_second(line: int, later_ns: int) -> Note:
    """Return the note on a second recording that begins in a line, and so much later than the first."""
    text = f"a second recording begins in line {line}, {later_ns / 1e9:.6g} s after the first"
    return Note(NoteCode.SECOND_RECORDING, None, text)


def second_begins(time_ns: NDArray[np.integer[Any]], channel: NDArray[np.integer[Any]]) -> int | None:
    """Return which frame is the first of a second recording by the stamps: they go back and stay back.

    A single stamp that is off is none, and neither is a frame that waited in a queue.

    Parameters
    ----------
    time_ns : ndarray of int, shape (n_frames,)
        Stamps in the log's order, ns; those of each bus are looked at for themselves.
    channel : ndarray of int, shape (n_frames,)
    """
    places = []
    for one in np.unique(channel):
        own = np.flatnonzero(channel == one)
        times = time_ns[own]
        if own.size < 4:
            continue
        before = np.minimum(times[1:-2], times[:-3])
        back = (times[2:-1] < before - BACK_NS) & (times[3:] < before - BACK_NS)
        if back.any():
            places.append(int(own[2 + int(np.argmax(back))]))
    return min(places, default=None)


def refuse_second_recording(log: CanLog, path: Path) -> None:
    """Raise `CorruptFileError` if the stamps of a log begin anew within it."""
    time_ns = np.round(log.frames.time_s * 1e9).astype(np.int64)
    at = second_begins(time_ns, log.frames.channel)
    if at is not None:
        own = np.flatnonzero(log.frames.channel[:at] == log.frames.channel[at])
        back_s = log.frames.time_s[own[-1]] - log.frames.time_s[at]
        raise SecondRecordingError(
            f"or a clock was set back: stamps go back by {back_s:.6g} s", f"frame {at + 1} of the log"
        ).of(path)


def refuse_set_back(log: CanLog, chosen: NDArray[np.intp], name: str, path: Path) -> None:
    """Raise `CorruptFileError` if the stamps of one message go back and go on from there, by however little.

    Frames of one identifier pass each other on no bus and in no queue, so that several in a row below the one before
    them are those of a clock that was set back: all that follows is dated early.

    Parameters
    ----------
    chosen : ndarray of int, shape (n_frames,)
        Places of the frames of the message, all of one bus.
    name
        Name of the message.
    """
    time_s = log.frames.time_s[chosen]
    if (np.diff(time_s) >= 0).all():
        return
    single = single_ahead(time_s)
    largest = np.maximum.accumulate(np.where(single, -np.inf, time_s))
    below = ~single & (time_s < largest)
    goes_on = np.r_[False, np.diff(time_s) > 0] & below & np.r_[False, below[:-1]]
    in_a_row = goes_on[2:] & goes_on[1:-1]
    if not in_a_row.any():
        return
    at = int(np.argmax(in_a_row))
    back_s = float(largest[at] - time_s[at])
    raise SecondRecordingError(
        f"or a clock was set back: stamps of {name} go back by {back_s:.6g} s",
        f"frame {int(chosen[at]) + 1} of the log",
    ).of(path)
