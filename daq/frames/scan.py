"""Every frame of a whole capture at once.

Frames of fixed length are found and checked as arrays; all other framings go through the stream
decoder. Both give the same frames and the same counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.frames.decoder import NEED_DATA, Counters, FrameDecoder
from daq.frames.framing import Framing

_CHUNK = 1 << 16


@dataclass(frozen=True, eq=False)
class FrameSet:
    """The good frames of a capture.

    Attributes
    ----------
    buffer : bytes
        Where their bytes are.
    begins : ndarray of int64, shape (n_frames,)
        Each frame's first byte in the buffer.
    lengths : ndarray of int64, shape (n_frames,)
        Each frame's bytes in the buffer.
    ends : ndarray of int64, shape (n_frames,)
        Byte of the stream behind each frame.
    counters : Counters
    """

    buffer: bytes
    begins: NDArray[np.int64]
    lengths: NDArray[np.int64]
    ends: NDArray[np.int64]
    counters: Counters

    def frame(self, i: int) -> bytes:
        """Return one frame."""
        return self.buffer[self.begins[i] : self.begins[i] + self.lengths[i]]


def find_frames(framing: Framing, stream: bytes) -> FrameSet:
    """Find every frame of a capture.

    Parameters
    ----------
    framing : Framing
    stream : bytes

    Returns
    -------
    FrameSet
    """
    if framing.kind == "sync" and framing.length.fixed is not None:
        return find_fixed(framing, stream, framing.length.fixed)
    return find_by_decoder(framing, stream)


def find_by_decoder(framing: Framing, stream: bytes) -> FrameSet:
    """Find every frame with the stream decoder."""
    decoder = FrameDecoder(framing)
    frames = []
    for at in range(0, len(stream), _CHUNK):
        decoder.feed(stream[at : at + _CHUNK])
        if at + _CHUNK >= len(stream):
            decoder.close()
        while (frame := decoder.next_frame()) is not NEED_DATA:
            frames.append(frame)
    lengths = np.array([len(frame.data) for frame in frames], dtype=np.int64)
    begins = np.cumsum(lengths) - lengths
    ends = np.array([frame.end for frame in frames], dtype=np.int64)
    return FrameSet(b"".join(frame.data for frame in frames), begins, lengths, ends, decoder.counters)


def find_fixed(framing: Framing, stream: bytes, length: int) -> FrameSet:
    """Find every frame of one fixed length, as arrays."""
    data = np.frombuffer(stream, dtype=np.uint8)
    candidates = _occurrences(data, framing.sync)
    candidates = candidates[candidates + length <= data.size]
    good = _checked(framing, data, candidates, length)
    begins, bad, free = [], 0, 0
    for at, right in zip(candidates.tolist(), good.tolist(), strict=True):
        if at < free:
            continue
        if right:
            begins.append(at)
            free = at + length
        else:
            bad += 1
    starts = np.array(begins, dtype=np.int64)
    frames = FrameSet(stream, starts, np.full(starts.size, length, dtype=np.int64), starts + length, Counters())
    frames.counters.received = starts.size
    frames.counters.bad_checksum = bad
    frames.counters.skipped_bytes = data.size - starts.size * length
    if all(frame_type.when is not None for frame_type in framing.types):
        frames.counters.unknown_types = sum(framing.type_of(frames.frame(i)) is None for i in range(starts.size))
    return frames


def _occurrences(data: NDArray[np.uint8], pattern: bytes) -> NDArray[np.intp]:
    """Places of a pattern, overlapping ones as well."""
    last = data.size - len(pattern) + 1
    if last <= 0:
        return np.zeros(0, dtype=np.intp)
    places = np.flatnonzero(data[:last] == pattern[0])
    for i, byte in enumerate(pattern[1:], start=1):
        places = places[data[places + i] == byte]
    return places


def _checked(framing: Framing, data: NDArray[np.uint8], candidates: NDArray[np.intp], length: int) -> NDArray[np.bool_]:
    """Tell which candidates have the right checksum."""
    checksum = framing.checksum
    if checksum is None:
        return np.ones(candidates.size, dtype=bool)
    right = []
    for part in np.array_split(candidates, max(1, candidates.size * length >> 24)):
        rows = data[part[:, None] + np.arange(length)]
        tail = rows[:, -checksum.size :] if checksum.big_endian else rows[:, : -checksum.size - 1 : -1]
        stated = np.zeros(part.size, dtype=np.int64)
        for column in tail.T:
            stated = stated << 8 | column
        right.append(checksum.algorithm.of_rows(rows[:, checksum.start : -checksum.size]) == stated)
    return np.concatenate(right)
