"""Serial streams of every kind of framing, built from bytes."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import Frame, FrameCounters
from recoil_acquisition.frames.scan import PortStream
from recoil_acquisition.frames.search import NEED_DATA
from tests.builders import rdlog_bytes


def cobs(data: bytes) -> bytes:
    """Stuff a packet, one byte at a time as the paper tells it, and end it."""
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte:
            block.append(byte)
            if len(block) == 254:
                out += b"\xff" + block
                block.clear()
        else:
            out += bytes([len(block) + 1]) + block
            block.clear()
    return bytes(out) + bytes([len(block) + 1]) + bytes(block) + b"\0"


def slip(data: bytes, *, both_ends: bool = False) -> bytes:
    stuffed = data.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
    return (b"\xc0" if both_ends else b"") + stuffed + b"\xc0"


def summed(body: bytes, algorithm: str = "sum8", order: Any = "little") -> bytes:
    checksum = CHECKSUMS[algorithm]
    return body + checksum.of(body).to_bytes(checksum.size, order)


def witmotion_frame(kind: int, *numbers: int) -> bytes:
    return summed(struct.pack("<BB4h", 0x55, kind, *numbers))


def stamped_capture(reads: Sequence[tuple[float, bytes]]) -> bytes:
    """Keep reads with their host time in seconds."""
    session = {"sources": [{"name": "port", "kind": "serial"}]}
    return rdlog_bytes.rdlog(session, [(0, rdlog_bytes.SERIAL, round(t * 1e9), data) for t, data in reads])


def stamped_port(reads: Sequence[tuple[float, bytes]]) -> PortStream:
    """Return reads as the stream of a port, with their host time in seconds."""
    return PortStream.of_reads((round(t * 1e9), data) for t, data in reads)


def decoded(framing: Any, reads: Sequence[tuple[float | None, bytes]]) -> tuple[list[Frame], FrameCounters]:
    """Go from frame to frame after each read."""
    decoder = FrameDecoder(framing)
    frames = []
    for host_s, data in reads:
        decoder.feed(data, host_s)
        while (frame := decoder.next_frame()) is not NEED_DATA:
            frames.append(frame)
    decoder.close()
    while (frame := decoder.next_frame()) is not NEED_DATA:
        frames.append(frame)
    return frames, decoder.counters


def taken(framing: Any, reads: Sequence[tuple[float | None, bytes]]) -> tuple[list[tuple[int, bytes]], FrameCounters]:
    """Take the frames after each read, as their ends and bytes."""
    decoder = FrameDecoder(framing)
    sets = []
    for host_s, data in reads:
        decoder.feed(data, host_s)
        sets.append(decoder.take())
    decoder.close()
    sets.append(decoder.take())
    return [(int(s.ends[i]), s.frame(i)) for s in sets for i in range(s.ends.size)], decoder.counters
