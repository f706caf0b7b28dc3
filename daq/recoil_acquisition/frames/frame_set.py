"""Frames that were found: one, many, and what was met on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.read_only import ReadOnlyArrays


class Frame(NamedTuple):
    """One frame of a stream.

    Attributes
    ----------
    start
        Byte of the stream at which it begins.
    end
        Byte of the stream behind it, its delimiter included.
    data
        The whole frame, decoded if it was stuffed, its checksum included; of a line, the text between start
        and checksum or delimiter.
    """

    start: int
    end: int
    data: bytes


@dataclass
class FrameCounters:
    """Counts of what a decoder met.

    Attributes
    ----------
    received
        Number of good frames.
    bad_checksum
        Places that looked like a frame and had a wrong checksum.
    bad_length
        Places with an impossible length or coding, overlong lines, and lines without the declared numbers.
    skipped_bytes
        Bytes outside of good frames.
    unknown_types
        Frames with a right checksum that no frame type fits: good ones, or refused ones where only known
        types are accepted.
    implausible
        Places with a right checksum and a value beyond what is declared plausible.
    not_followed
        Places with a right checksum that no sync bytes follow, where look-ahead is declared.
    timed_out
        Silences that ended a half frame.
    """

    received: int = 0
    bad_checksum: int = 0
    bad_length: int = 0
    skipped_bytes: int = 0
    unknown_types: int = 0
    implausible: int = 0
    not_followed: int = 0
    timed_out: int = 0

    def note(self, fault: str) -> None:
        """Count a fault by its name."""
        setattr(self, fault, getattr(self, fault) + 1)


@dataclass(frozen=True, eq=False)
class FrameSet(ReadOnlyArrays):
    """Good frames of a stream.

    Attributes
    ----------
    buffer
        Buffer that the frames' bytes are in.
    begins : ndarray of int64, shape (n_frames,)
        Place of each frame's first byte in the buffer.
    lengths : ndarray of int64, shape (n_frames,)
        Number of each frame's bytes in the buffer.
    ends : ndarray of int64, shape (n_frames,)
        Byte of the stream behind each frame.
    counters
        Counters of the stream so far.
    """

    buffer: bytes
    begins: NDArray[np.int64]
    lengths: NDArray[np.int64]
    ends: NDArray[np.int64]
    counters: FrameCounters

    def frame(self, i: int) -> bytes:
        """Return one frame."""
        return self.buffer[self.begins[i] : self.begins[i] + self.lengths[i]]


class FrameCollection:
    """Good frames in the order of the stream, until they are put together."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._lengths: list[NDArray[np.int64]] = []
        self._ends: list[NDArray[np.int64]] = []

    def add(self, frames: list[Frame]) -> None:
        """Add frames, in less room than each one takes alone."""
        self._pieces.append(b"".join(frame.data for frame in frames))
        self._lengths.append(np.array([len(frame.data) for frame in frames], dtype=np.int64))
        self._ends.append(np.array([frame.end for frame in frames], dtype=np.int64))

    def together(self, counters: FrameCounters) -> FrameSet:
        """Return the frames as one set."""
        none = np.zeros(0, dtype=np.int64)
        lengths, ends = np.concatenate([none, *self._lengths]), np.concatenate([none, *self._ends])
        return FrameSet(b"".join(self._pieces), np.cumsum(lengths) - lengths, lengths, ends, counters)
