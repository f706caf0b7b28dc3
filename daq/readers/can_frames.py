"""Frames of a CAN log as arrays, whatever format the log has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.timebase import AbsoluteStart

ID_MASK = 0x1FFFFFFF
EXTENDED = 0x80000000
"""Flag of a 29-bit identifier, as in ``linux/can.h`` and in Vector's formats."""

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Data length by data length code, ISO 11898-1."""


@dataclass(frozen=True, eq=False)
class CanFrames:
    """Data frames of one log, in its order.

    Attributes
    ----------
    time_s : ndarray of float64, shape (n_frames,)
        The log's own relative time.
    key : ndarray of uint32, shape (n_frames,)
        Identifier, with `EXTENDED` set for a 29-bit one.
    channel : ndarray of int64, shape (n_frames,)
        As the log numbers channels.
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


@dataclass(frozen=True, eq=False)
class CanLog:
    """What one log holds.

    Attributes
    ----------
    frames : CanFrames
    absolute_start : AbsoluteStart or None
    notes : tuple of str
        Damage and repairs.
    incomplete : str
        How it shows that the log was cut off; empty if nothing shows that.
    metadata : mapping
        Counts of what is no data frame, and what the header says.
    """

    frames: CanFrames
    absolute_start: AbsoluteStart | None
    notes: tuple[str, ...] = ()
    incomplete: str = ""
    metadata: Mapping[str, Any] = field(default_factory=dict)


class FrameList:
    """Frames gathered one by one while a log is read.

    Attributes
    ----------
    error_frames, remote_frames, other_events, damaged : int
        Entries that are no data frames; they are counted and left out.
    """

    def __init__(self) -> None:
        self._times: list[int] = []
        self._keys: list[int] = []
        self._channels: list[int] = []
        self._data: list[bytes] = []
        self.error_frames = 0
        self.remote_frames = 0
        self.other_events = 0
        self.damaged = 0

    def add(self, time_ns: int, key: int, channel: int, data: bytes) -> None:
        """Add a data frame."""
        self._times.append(time_ns)
        self._keys.append(key)
        self._channels.append(channel)
        self._data.append(data)

    def first_time_ns(self) -> int:
        """Return the first frame's time; 0 if there is none."""
        return self._times[0] if self._times else 0

    def frames(self, zero_ns: int = 0) -> CanFrames:
        """Return the frames, their time relative to ``zero_ns``."""
        length = np.fromiter(map(len, self._data), dtype=np.int64, count=len(self._data))
        width = int(length.max(initial=8))
        padded = b"".join(data.ljust(width, b"\0") for data in self._data)
        relative = np.fromiter((t - zero_ns for t in self._times), dtype=np.float64, count=len(self._times))
        return CanFrames(
            time_s=relative / 1e9,
            key=np.array(self._keys, dtype=np.uint32),
            channel=np.array(self._channels, dtype=np.int64),
            length=length,
            data=np.frombuffer(padded, dtype=np.uint8).reshape(-1, width),
        )

    def counts(self) -> dict[str, int]:
        """Return how many entries of each kind the log holds."""
        return {
            "data_frames": len(self._times),
            "error_frames": self.error_frames,
            "remote_frames": self.remote_frames,
            "other_events": self.other_events,
            "damaged_entries": self.damaged,
        }

    def notes(self) -> list[str]:
        """Say what was left out and matters."""
        notes = []
        if self.error_frames:
            notes.append(f"{self.error_frames} error frames: frames may be missing around them")
        if self.damaged:
            notes.append(f"{self.damaged} entries are damaged and were left out")
        return notes
