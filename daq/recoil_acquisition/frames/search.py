"""Search for the next frame in a stream's bytes, for each kind of framing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum, auto
from typing import Final, Literal

from recoil_acquisition.frames.acceptance import Acceptance
from recoil_acquisition.frames.byte_stuffing import (
    COBS_DELIMITER,
    SLIP_DELIMITER,
    decode_cobs,
    decode_slip,
    longest_packet,
)
from recoil_acquisition.frames.frame_set import Frame, FrameCounters
from recoil_acquisition.frames.framing import Framing


class _NeedData(Enum):
    NEED_DATA = auto()


NEED_DATA: Final = _NeedData.NEED_DATA
"""Answer while the bytes so far hold no further frame."""

Found = Frame | Literal[_NeedData.NEED_DATA]


class Search(ABC):
    """The bytes of a stream that are not searched yet, and where in the stream they are.

    Parameters
    ----------
    counters
        Counters that what is met is added to.

    Attributes
    ----------
    at
        First byte of the buffer that is not searched.
    offset
        Number of the byte at `at` in the stream.
    """

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        self.buffer = bytearray()
        self.at = 0
        self.offset = 0
        self._framing = framing
        self._acceptance = acceptance
        self._counters = counters

    @abstractmethod
    def next(self, end: int, *, ended: bool) -> Found:
        """Return the next good frame before byte ``end`` of the buffer, behind which nothing comes if ``ended``."""

    def drop_searched(self) -> None:
        """Forget the bytes that are searched."""
        del self.buffer[: self.at]
        self.at = 0

    def advance_to(self, at: int) -> None:
        """Go on at a byte of the buffer."""
        self.offset += at - self.at
        self.at = at

    def frame_to(self, at: int, data: bytes) -> Frame:
        """Go on at a byte of the buffer, and return the frame that ends there."""
        start = self.offset
        self.advance_to(at)
        return Frame(start, self.offset, data)

    def begin_within(self) -> None:  # noqa: B027 - where a head or a silence marks a frame, nothing is to be done
        """Take what follows for the rest of a frame whose beginning is missing."""

    def skip_to(self, at: int) -> None:
        """Go on at a byte of the buffer, and count those before it as outside of frames."""
        self._counters.skipped_bytes += at - self.at
        self.advance_to(at)


class SyncSearch(Search):
    """Frames that begin with sync bytes, or anywhere, and whose length is known from their head.

    Attributes
    ----------
    smallest
        Least length that a frame can have.
    """

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self._head = max(framing.length.head, len(framing.sync))
        checksum = framing.checksum
        self.smallest = max(self._head, checksum.start + checksum.size if checksum else 1)

    def next(self, end: int, *, ended: bool) -> Found:
        """Return the next good frame."""
        framing, buffer, sync = self._framing, self.buffer, self._framing.sync
        while True:
            at = buffer.find(sync, self.at, end)
            if at < 0 or at == end:
                kept = 0 if ended else min(max(len(sync) - 1, 0), end - self.at)
                self.skip_to(end - kept)
                return NEED_DATA
            if at > self.at:
                self.skip_to(at)
            fault = None
            if end - at >= self._head:
                total = framing.length.of(buffer, at)
                if not self.smallest <= total <= framing.maximum:
                    fault = "bad_length"
                elif end - at >= total:
                    data = bytes(buffer[at : at + total])
                    fault = self._acceptance.fault_of(data)
                    if fault is None and framing.look_ahead:
                        following = bytes(buffer[at + total : min(at + total + len(sync), end)])
                        if not sync.startswith(following):
                            fault = "not_followed"
                        elif len(following) < len(sync) and not ended:
                            return NEED_DATA
                    if fault is None:
                        return self.frame_to(at + total, data)
            if fault is not None:
                self._counters.note(fault)
            elif not ended:
                return NEED_DATA
            self.skip_to(at + 1)


class _Delimited(Search):
    """Frames that end with a delimiter: everything before it that is too long is given up while it comes.

    Attributes
    ----------
    longest
        Most bytes before a delimiter.
    overlong
        Whether the beginning of what comes was given up.
    """

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self.delimiter = framing.delimiter
        self.longest = framing.maximum
        self.overlong = False

    def begin_within(self) -> None:
        """Give up what comes before the next delimiter."""
        self.overlong = True

    def _refuse(self, behind: int, fault: str | None) -> None:
        if fault is not None:
            self._counters.note(fault)
        self.skip_to(behind)

    def _piece(self, end: int, *, ended: bool) -> tuple[bytes, int] | None:
        """Return what stands before the next delimiter, and the byte behind that; None without delimiter."""
        while True:
            found = self.buffer.find(self.delimiter, self.at, end)
            if found < 0:
                self._wait_for_delimiter(end, ended=ended)
                return None
            behind = found + len(self.delimiter)
            piece, overlong = bytes(self.buffer[self.at : found]), self.overlong
            self.overlong = False
            if not overlong and len(piece) <= self.longest:
                return piece, behind
            self._refuse(behind, "bad_length")

    def _wait_for_delimiter(self, end: int, *, ended: bool) -> None:
        """Keep what may be the beginning of a line or packet; give up one that is too long."""
        waiting = end - self.at
        if ended:
            self.overlong = False
            self.skip_to(end)
        elif self.overlong or waiting > self.longest + len(self.delimiter):
            self.overlong = True
            self.skip_to(end - min(waiting, len(self.delimiter) - 1))


class LineSearch(_Delimited):
    """Lines of text."""

    def next(self, end: int, *, ended: bool) -> Found:
        """Return the next good line."""
        framing = self._framing
        while (piece := self._piece(end, ended=ended)) is not None:
            line, behind = piece
            begins = line.rfind(framing.start) if framing.start else 0
            body = line[max(begins, 0) :].strip(b"\r\n")
            if begins < 0 or not body.strip() or (framing.comment and body.startswith(framing.comment)):
                self.skip_to(behind)
                continue
            data, fault = self._acceptance.line(body)
            if fault is not None:
                self._refuse(behind, fault)
                continue
            self.skip_to(self.at + begins)
            return self.frame_to(behind, data)
        return NEED_DATA


class PacketSearch(_Delimited):
    """Packets stuffed by COBS or SLIP; one delimiter may also stand before them, as SLIP advises."""

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self._decode = decode_cobs if framing.kind == "cobs" else decode_slip
        self.delimiter = COBS_DELIMITER if framing.kind == "cobs" else SLIP_DELIMITER
        self.longest = longest_packet(framing.kind, framing.maximum)

    def next(self, end: int, *, ended: bool) -> Found:
        """Return the next good packet, decoded."""
        while True:
            begin = self.at
            if not self.overlong and self.buffer.startswith(self.delimiter, begin, end):
                begin += 1
            if begin > self.at and self.buffer.startswith(self.delimiter, begin, end):
                self.skip_to(begin)
                continue
            found = self.buffer.find(self.delimiter, begin, end)
            if found < 0:
                self._wait_for_delimiter(end, ended=ended)
                return NEED_DATA
            overlong, self.overlong = self.overlong or found - begin > self.longest, False
            data = None if overlong else self._decode(bytes(self.buffer[begin:found]))
            if data is None or len(data) > self._framing.maximum:
                self._refuse(found + 1, "bad_length")
            elif (fault := self._acceptance.fault_of(data)) is not None:
                self._refuse(found + 1, fault)
            else:
                return self.frame_to(found + 1, data)


class SilenceSearch(Search):
    """Frames between silences: what stands between two of them is one frame, or none."""

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self._overlong = False

    def next(self, end: int, *, ended: bool) -> Found:
        """Return the frame that a silence ended."""
        self._overlong = self._overlong or end - self.at > self._framing.maximum
        if not ended:
            if self._overlong:
                self.skip_to(end)
            return NEED_DATA
        data, overlong = bytes(self.buffer[self.at : end]), self._overlong
        self._overlong = False
        if not data and not overlong:
            return NEED_DATA
        fault = "bad_length" if overlong else self._acceptance.fault_of(data)
        if fault is not None:
            self._counters.note(fault)
            self.skip_to(end)
            return NEED_DATA
        return self.frame_to(end, data)


_KINDS: dict[str, Callable[[Framing, Acceptance, FrameCounters], Search]] = {
    "sync": SyncSearch,
    "fixed": SyncSearch,
    "delimiter": LineSearch,
    "cobs": PacketSearch,
    "slip": PacketSearch,
    "idle": SilenceSearch,
}


def search_for(framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> Search:
    """Return the search of a framing's kind."""
    return _KINDS[framing.kind](framing, acceptance, counters)
