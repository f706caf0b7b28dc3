"""Frames of a CAN log as arrays, whatever format the log has, and when their time zero was."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import WALL_CLOCK_NS, AbsoluteStart
from recoil_acquisition.frames import can_rows
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark

T = TypeVar("T", bound=np.integer[Any])

ID_MASK, BASE_ID_MASK = 0x1FFFFFFF, 0x7FF
"""Identifiers of 29 and of 11 bits."""
EXTENDED = 0x80000000
"""Flag of a 29-bit identifier, as in ``linux/can.h`` and in Vector's formats."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Data length by data length code, ISO 11898-1."""

LATEST_NS = 2**62
"""Stamps beyond 146 years are damage, and differences of those within them fit 64 bits."""
LARGEST_CHANNEL = 2**31 - 1
DATE_FAULT = "date_not_understood"
"""Key of the metadata of a log that says when it began in words or numbers that are not understood."""
MOST_KINDS = 64
"""Kinds of other events that are counted each for itself."""
NO_BUSES = "the format does not store on which bus a frame came: those of several buses cannot be told apart"


def is_length_of(length: int, code: int) -> bool:
    """Return whether data may be so long by a data length code: codes from 9 on are 8 bytes of a classic frame."""
    return 0 <= code < len(FD_LENGTHS) and length in (min(code, 8), FD_LENGTHS[code])


@dataclass(frozen=True, eq=False)
class CanFrames(ReadOnlyArrays):
    """Data frames of one log, in its order.

    Attributes
    ----------
    time_s : ndarray of float64, shape (n_frames,)
        Stamps in the log's own relative time, s.
    key : ndarray of uint32, shape (n_frames,)
        Identifier, with `EXTENDED` set for a 29-bit one.
    channel : ndarray of int64, shape (n_frames,)
        Number of the channel in the log.
    length : ndarray of int64, shape (n_frames,)
        Bytes of data.
    data : ndarray of uint8, shape (n_frames, width)
        Data, zero behind its length.
    """

    time_s: NDArray[np.float64]
    key: NDArray[np.uint32]
    channel: NDArray[np.int64]
    length: NDArray[np.int64]
    data: NDArray[np.uint8]

    def chosen(self, chosen: NDArray[np.bool_]) -> CanFrames:
        """Return some of the frames, in their order."""
        return CanFrames(
            self.time_s[chosen], self.key[chosen], self.channel[chosen], self.length[chosen], self.data[chosen]
        )


@dataclass(frozen=True, eq=False)
class CanLog:
    """Contents of one log.

    Attributes
    ----------
    notes
        Notes on damage and repairs.
    incomplete
        Sign by which it shows that the log was cut off; empty if nothing shows that.
    metadata
        Counts of what is no data frame, and the statements of the header.
    bus_names
        Names of the buses by channel, where the log has them; elsewhere a bus is called by its number.
    stores_buses
        Whether the format says on which bus a frame came.
    not_known
        Entries that were not read because they are written in a way that is not known here, in words; empty if there
        are none.
    """

    frames: CanFrames
    absolute_start: AbsoluteStart | None
    notes: tuple[Remark, ...] = ()
    incomplete: str = ""
    metadata: Mapping[str, Any] = field(default_factory=dict)
    bus_names: Mapping[int, str] = field(default_factory=dict)
    stores_buses: bool = True
    not_known: str = ""

    def without_buses(self) -> CanLog:
        """Return it as of a format that does not store them, and say so."""
        return replace(self, notes=(Note(NoteCode.UNSEEN, None, NO_BUSES), *self.notes), stores_buses=False)


@dataclass(frozen=True, eq=False)
class FrameBlock:
    """Frames that were read together.

    Attributes
    ----------
    place : ndarray of int64, shape (n_frames,)
        Place of each frame in the log: the frames of a log are in the order of their places.
    time_ns : ndarray of int64, shape (n_frames,)
        Stamps, ns.
    key, channel, length : ndarray, shape (n_frames,)
        Columns of `CanFrames`, in whatever integers hold them: there may be millions.
    data : ndarray of uint8, shape (n_frames, width)
        Data, zero behind its length.
    """

    place: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    key: NDArray[np.uint32]
    channel: NDArray[np.integer[Any]]
    length: NDArray[np.integer[Any]]
    data: NDArray[np.uint8]


def key_of(message: Any) -> int:
    """Return the key that the frames of a database's message have."""
    return int(message.frame_id) | (EXTENDED if message.is_extended_frame else 0)


def keys_of_rows(rows: NDArray[np.void]) -> NDArray[np.uint32]:
    """Return the keys of the rows of a capture, shape (n_rows,)."""
    extended = np.where(rows["flags"] & can_rows.EXTENDED, EXTENDED, 0)
    return (rows["id"] & np.uint32(ID_MASK) | extended).astype(np.uint32)


def _joined(blocks: Sequence[FrameBlock], field: str, dtype: type[T]) -> NDArray[T]:
    return np.concatenate([getattr(block, field) for block in blocks], dtype=dtype)


class FrameList:
    """Frames gathered while a log is read, one by one or in blocks.

    Attributes
    ----------
    place
        Place in the log of the frame that is added next; it counts on by itself.
    error_frames, remote_frames, other_events, damaged
        Entries that are no data frames; they are counted and left out.
    other_kinds
        Counts of the other events that name a kind which is none of frames, by that kind.
    """

    def __init__(self) -> None:
        self._blocks: list[FrameBlock] = []
        # Objects would take ten times the bytes of a frame
        self._places = array("q")
        self._times = array("q")
        self._keys = array("I")
        self._channels = array("q")
        self._lengths = array("q")
        self._data = bytearray()
        self.place = 0
        self.error_frames = 0
        self.remote_frames = 0
        self.other_events = 0
        self.damaged = 0
        self.other_kinds: Counter[str] = Counter()

    def add(self, time_ns: int, key: int, channel: int, data: bytes) -> None:
        """Add a data frame; one whose time is no time counts as damaged."""
        if not -LATEST_NS < time_ns < LATEST_NS or not 0 <= channel <= LARGEST_CHANNEL:
            self.damaged += 1
            return
        self._places.append(self.place)
        self.place += 1
        self._times.append(time_ns)
        self._keys.append(key)
        self._channels.append(channel)
        self._lengths.append(len(data))
        self._data += data

    def add_identified(self, time_ns: int, number: int, channel: int, data: bytes, *, extended: bool) -> None:
        """Add a data frame as `add` does; one whose identifier has too many bits counts as damaged."""
        if 0 <= number <= (ID_MASK if extended else BASE_ID_MASK):
            self.add(time_ns, number | (EXTENDED if extended else 0), channel, data)
        else:
            self.damaged += 1

    def add_other(self, kind: str) -> None:
        """Count an event that is no data frame, and of what kind it says that it is."""
        self.other_events += 1
        if kind in self.other_kinds or len(self.other_kinds) < MOST_KINDS:
            self.other_kinds[kind] += 1

    def add_block(self, block: FrameBlock) -> None:
        """Add data frames whose times and channels have been checked."""
        if block.key.size:
            self._blocks.append(block)

    def take(self, other: FrameList, place: int, later_ns: int) -> None:
        """Take all that another list holds, from a place in the log on, and so much later; it fits in 146 years."""
        for block in (*other._blocks, other._block()):
            self.add_block(replace(block, place=block.place + place, time_ns=block.time_ns + later_ns))
        self.error_frames += other.error_frames
        self.remote_frames += other.remote_frames
        self.other_events += other.other_events
        self.damaged += other.damaged
        self.other_kinds.update(other.other_kinds)

    def frames(self, *, from_first: bool = False) -> tuple[CanFrames, int]:
        """Return the frames in the log's order, and the time in ns that their time counts from.

        Parameters
        ----------
        from_first
            Whether time counts from the first frame.
        """
        blocks = [*self._blocks, self._block()]
        time_ns, channel, length = (_joined(blocks, field, np.int64) for field in ("time_ns", "channel", "length"))
        key = _joined(blocks, "key", np.uint32)
        data = np.zeros((key.size, max(block.data.shape[1] for block in blocks)), dtype=np.uint8)
        at = 0
        for block in blocks:
            data[at : at + block.key.size, : block.data.shape[1]] = block.data
            at += block.key.size
        place = _joined(blocks, "place", np.int64)
        if (place[1:] < place[:-1]).any():
            order = np.argsort(place, kind="stable")
            time_ns, channel, length = (numbers[order] for numbers in (time_ns, channel, length))
            key, data = key[order], data[order]
        del place, blocks
        zero_ns = int(time_ns[0]) if from_first and time_ns.size else 0
        time_ns -= zero_ns
        return CanFrames(time_ns / 1e9, key, channel, length, data), zero_ns

    def _block(self) -> FrameBlock:
        """Return the frames that were added one by one."""
        length = np.array(self._lengths, dtype=np.int64)
        width = int(length.max(initial=8))
        padded = np.zeros((length.size, width), dtype=np.uint8)
        padded[np.arange(width) < length[:, None]] = np.frombuffer(self._data, dtype=np.uint8)
        return FrameBlock(
            place=np.array(self._places, dtype=np.int64),
            time_ns=np.array(self._times, dtype=np.int64),
            key=np.array(self._keys, dtype=np.uint32),
            channel=np.array(self._channels, dtype=np.int64),
            length=length,
            data=padded,
        )

    def log(
        self, frames: CanFrames, start: AbsoluteStart | None, incomplete: str, notes: Sequence[Remark] = (), **said: Any
    ) -> CanLog:
        """Return the log of these frames: what was left out is noted and counted beside what it says."""
        cut = [Note(NoteCode.CUT, None, incomplete)] if incomplete else []
        own = (*self.notes(), *cut, *notes)
        kinds = {"other_kinds": dict(self.other_kinds)} if self.other_kinds else {}
        return CanLog(frames, start, own, incomplete, {**self.counts(), **kinds, **said})

    def counts(self) -> dict[str, int]:
        """Return how many entries of each kind the log holds."""
        return {
            "data_frames": len(self._times) + sum(block.key.size for block in self._blocks),
            "error_frames": self.error_frames,
            "remote_frames": self.remote_frames,
            "other_events": self.other_events,
            "damaged_entries": self.damaged,
        }

    def notes(self) -> list[Remark]:
        """Say what was left out and matters."""
        return notes_on_entries(self.error_frames, self.damaged)


def notes_on_entries(error_frames: int, damaged: int) -> list[Remark]:
    """Return notes on the entries of a log that are error frames, and on those that are damaged."""
    notes: list[Remark] = []
    if error_frames:
        notes.append(
            Note(
                NoteCode.LOST,
                None,
                f"{error_frames} error frames: frames may be missing around them",
            )
        )
    if damaged:
        text = f"{damaged} entries are damaged and were left out"
        notes.append(Caution(CautionCode.DAMAGED_ENTRIES, None, text))
    return notes


def start_of_stamps(found: FrameList) -> tuple[CanFrames, AbsoluteStart | None]:
    """Return a log's frames, and when their time zero was.

    Returns
    -------
    frames : CanFrames
        Frames whose time counts from the first one if its stamp is that of a clock, else as it is stored.
    start : AbsoluteStart or None
        Stamp of the first frame if it is that of a clock.
    """
    frames, zero_ns = found.frames(from_first=True)
    if zero_ns < WALL_CLOCK_NS:
        return found.frames()[0], None
    return frames, AbsoluteStart.since_1970(zero_ns, "UTC", "stamp of the first frame, taken as seconds since 1970")
