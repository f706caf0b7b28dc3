"""All that a serial port delivered, with the host's time of each read, and every frame in it.

Host time counts from 1970-01-01 UTC where the host's wall clock is known, else from any start; what lies before 2001 is
taken for the latter. Nothing is interpreted, so that a wrong framing can be corrected later.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import FrameCollection, FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class PortStream(ReadOnlyArrays):
    """Bytes that a port delivered.

    Attributes
    ----------
    stream
        Bytes of the port, all of them.
    host_ns : ndarray of int64, shape (n_reads,)
        Host time of each read; empty for a plain file of bytes.
    ends : ndarray of int64, shape (n_reads,)
        Byte of the stream behind each read.
    breaks
        Bytes of the stream before which it was interrupted, ascending.
    incomplete
        Sentence on how the stream shows that something is missing; empty if nothing shows that.
    """

    stream: bytes
    host_ns: NDArray[np.int64]
    ends: NDArray[np.int64]
    incomplete: str = ""
    breaks: tuple[int, ...] = ()

    @classmethod
    def plain(cls, stream: bytes) -> PortStream:
        """Return a stream without host times."""
        none = np.zeros(0, dtype=np.int64)
        return cls(stream, none, none)

    @classmethod
    def of_reads(cls, reads: Iterable[tuple[int, bytes | None]], *, incomplete: str = "") -> PortStream:
        """Return the stream that some reads of a port gave, each with its host time; None where it was interrupted."""
        pieces, times, ends, breaks, total = [], [], [], [], 0
        for host_ns, piece in reads:
            if piece is None:
                breaks.append(total)
                continue
            pieces.append(piece)
            total += len(piece)
            times.append(host_ns)
            ends.append(total)
        host, behind = np.array(times, dtype=np.int64), np.array(ends, dtype=np.int64)
        return cls(b"".join(pieces), host, behind, incomplete, tuple(breaks))


_CHUNK = 1 << 20


def find_frames(framing: Framing, stream: bytes) -> FrameSet:
    """Find every frame of a stream without host times, in which no silence ends anything.

    Raises
    ------
    ValueError
        If frames end by silence.
    """
    decoder = FrameDecoder(framing)
    frames = FrameCollection()
    for at in range(0, len(stream), _CHUNK):
        decoder.feed(stream[at : at + _CHUNK])
        decoder.take_into(frames)
    return _ended(decoder, frames)


def find_frames_of_port(framing: Framing, port: PortStream) -> FrameSet:
    """Find every frame of a port, whose host times show the silences where the framing asks for them.

    Nothing is joined over a place where the device was lost.

    Raises
    ------
    ValueError
        If frames end by silence and the stream has no host times.
    """
    if not port.host_ns.size or not (framing.silence_s or port.breaks):
        return find_frames(framing, port.stream)
    decoder = FrameDecoder(framing)
    frames, waiting, begin = FrameCollection(), 0, 0
    host_s = ((port.host_ns - port.host_ns[:1]) / 1e9).tolist()
    breaks = deque(port.breaks)
    for end, instant_s in zip(port.ends.tolist(), host_s, strict=True):
        while breaks and breaks[0] <= begin:
            breaks.popleft()
            decoder.interrupt(missing=True)
        decoder.feed(port.stream[begin:end], instant_s)
        waiting += end - begin
        begin = end
        if waiting >= _CHUNK:
            decoder.take_into(frames)
            waiting = 0
    # bytes whose own read is not known came with the next read, whose time is lost
    decoder.feed(port.stream[begin:], host_s[-1])
    return _ended(decoder, frames)


def _ended(decoder: FrameDecoder, frames: FrameCollection) -> FrameSet:
    decoder.close()
    decoder.take_into(frames)
    return frames.together(decoder.counters)
