"""The stream decoder: bytes are fed in pieces of any size, frames come out.

How the stream is cut into pieces changes nothing. After a bad checksum the search goes on one byte
further, not one frame further: the bytes that failed may hold the beginning of a good frame.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import Enum, auto
from typing import Final, Literal

from daq.frames.framing import Field, Framing


class _NeedData(Enum):
    NEED_DATA = auto()


NEED_DATA: Final = _NeedData.NEED_DATA
"""What `FrameDecoder.next_frame` returns when the bytes so far hold no further frame."""


@dataclass(frozen=True)
class Frame:
    """One frame of a stream.

    Attributes
    ----------
    start : int
        Byte of the stream at which it begins.
    end : int
        Byte of the stream behind it, its delimiter included.
    data : bytes
        The whole frame; of a line, the text between start and checksum or delimiter.
    """

    start: int
    end: int
    data: bytes


@dataclass
class Counters:
    """What a decoder met.

    Attributes
    ----------
    received : int
        Good frames.
    bad_checksum : int
        Places that looked like a frame and had a wrong checksum.
    bad_length : int
        Places with an impossible length, overlong lines, and lines without the declared numbers.
    skipped_bytes : int
        Bytes outside of good frames.
    unknown_types : int
        Good frames that no frame type fits.
    """

    received: int = 0
    bad_checksum: int = 0
    bad_length: int = 0
    skipped_bytes: int = 0
    unknown_types: int = 0

    def as_dict(self) -> dict[str, int]:
        """Return the counts by name."""
        return asdict(self)


class FrameDecoder:
    """Decoder of one stream.

    Parameters
    ----------
    framing : Framing

    Attributes
    ----------
    counters : Counters
    """

    def __init__(self, framing: Framing) -> None:
        self.counters = Counters()
        self._framing = framing
        self._buffer = bytearray()
        self._at = 0
        self._offset = 0
        self._closed = False
        self._overlong = False

    def feed(self, data: bytes) -> None:
        """Add bytes to the stream; ValueError after `close`."""
        if self._closed:
            raise ValueError("the decoder is closed")
        del self._buffer[: self._at]
        self._at = 0
        self._buffer += data

    def close(self) -> None:
        """End the stream: what waits for more bytes is searched once more, then counted as skipped."""
        self._closed = True

    def next_frame(self) -> Frame | Literal[_NeedData.NEED_DATA]:
        """Return the next good frame, or `NEED_DATA`."""
        frame = self._next_binary() if self._framing.kind == "sync" else self._next_line()
        if frame is not NEED_DATA:
            self.counters.received += 1
            self.counters.unknown_types += self._framing.type_of(frame.data) is None
        return frame

    def _skip_to(self, at: int) -> None:
        self.counters.skipped_bytes += at - self._at
        self._advance_to(at)

    def _advance_to(self, at: int) -> None:
        self._offset += at - self._at
        self._at = at

    def _next_binary(self) -> Frame | Literal[_NeedData.NEED_DATA]:
        framing, buffer = self._framing, self._buffer
        head = max(framing.length.head, len(framing.sync))
        smallest = max(head, framing.checksum.start + framing.checksum.size if framing.checksum else 1)
        while True:
            at = buffer.find(framing.sync, self._at)
            if at < 0:
                kept = 0 if self._closed else min(len(framing.sync) - 1, len(buffer) - self._at)
                self._skip_to(len(buffer) - kept)
                return NEED_DATA
            self._skip_to(at)
            if len(buffer) - at >= head:
                total = framing.length.of(buffer, at)
                if not smallest <= total <= framing.maximum:
                    self.counters.bad_length += 1
                    self._skip_to(at + 1)
                    continue
                if len(buffer) - at >= total:
                    data = bytes(buffer[at : at + total])
                    if framing.checksum is None or framing.checksum.holds(data):
                        start = self._offset
                        self._advance_to(at + total)
                        return Frame(start, self._offset, data)
                    self.counters.bad_checksum += 1
                    self._skip_to(at + 1)
                    continue
            if not self._closed:
                return NEED_DATA
            self._skip_to(at + 1)

    def _next_line(self) -> Frame | Literal[_NeedData.NEED_DATA]:
        framing, buffer = self._framing, self._buffer
        while True:
            end = buffer.find(framing.delimiter, self._at)
            if end < 0:
                return self._wait_for_delimiter()
            behind = end + len(framing.delimiter)
            line, overlong = bytes(buffer[self._at : end]), self._overlong
            self._overlong = False
            if overlong or len(line) > framing.maximum:
                self.counters.bad_length += 1
                self._skip_to(behind)
                continue
            begins = line.rfind(framing.start) if framing.start else 0
            body = line[max(begins, 0) :].strip(b"\r\n")
            if begins < 0 or not body.strip() or (framing.comment and body.startswith(framing.comment)):
                self._skip_to(behind)
                continue
            data = self._checked_line(body)
            if data is None:
                self._skip_to(behind)
                continue
            self._skip_to(self._at + begins)
            start = self._offset
            self._advance_to(behind)
            return Frame(start, self._offset, data)

    def _wait_for_delimiter(self) -> Literal[_NeedData.NEED_DATA]:
        """Keep what may be a line's beginning; give up a line that is too long."""
        waiting = len(self._buffer) - self._at
        if self._closed:
            self._skip_to(len(self._buffer))
        elif self._overlong or waiting > self._framing.maximum + len(self._framing.delimiter):
            self._overlong = True
            self._skip_to(len(self._buffer) - min(waiting, len(self._framing.delimiter) - 1))
        return NEED_DATA

    def _checked_line(self, body: bytes) -> bytes | None:
        """Return a line without its checksum if that is right and its numbers are there."""
        checksum = self._framing.checksum
        if checksum is not None:
            body, star, stated = body.rpartition(b"*")
            try:
                right = bool(star) and int(stated, 16) == checksum.algorithm.of(body[checksum.start :])
            except ValueError:
                right = False
            if not right:
                self.counters.bad_checksum += 1
                return None
        frame_type = self._framing.type_of(body)
        if frame_type is not None and not all(
            cell_value(body, field, self._framing.separator) is not None for field in frame_type.fields
        ):
            self.counters.bad_length += 1
            return None
        return body


def cell_value(line: bytes, field: Field, separator: str) -> float | None:
    """Return the finite number in a field's cell of a line, unscaled; None if there is none."""
    cells = line.split(separator.encode())
    try:
        value = float(cells[field.at])
    except (ValueError, IndexError):
        return None
    return value if math.isfinite(value) else None
