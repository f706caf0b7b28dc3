"""Every frame of all that a port delivered."""

from __future__ import annotations

from collections import deque

from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import FrameCollection, FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.port_stream import PortStream

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
