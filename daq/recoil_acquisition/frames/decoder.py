"""The stream decoder: bytes are fed in pieces of any size, frames come out.

How the stream is cut into pieces changes nothing. After a bad checksum the search goes on one byte
further, not one frame further: the bytes that failed may hold the beginning of a good frame. Where a
delimiter or a silence bounds a frame, the search goes on behind that.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from recoil_acquisition.frames.acceptance import Acceptance
from recoil_acquisition.frames.frame_set import Frame, FrameCollection, FrameCounters, FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.search import NEED_DATA, Found, Search, search_for


class FrameDecoder:
    """Decoder of one stream."""

    def __init__(self, framing: Framing) -> None:
        self.counters = FrameCounters()
        self._framing = framing
        self._acceptance = Acceptance(framing)
        self._search: Search = search_for(framing, self._acceptance, self.counters)
        self._buffer = self._search.buffer
        self._breaks: deque[tuple[int, bool]] = deque()
        self._skipped_before: int | None = None
        self._heard_s: float | None = None
        self._closed = False

    def feed(self, data: bytes, host_s: float | None = None) -> None:
        """Add the bytes of one read of the port.

        Parameters
        ----------
        data
            Bytes; none to let time pass.
        host_s
            Host time of the read, counted from any start. A silence longer than `Framing.silence_s` ends
            what came before it; the time that the bytes of this read took on the line, which the baud rate
            tells, is no silence.

        Raises
        ------
        ValueError
            After `close`; without host time if frames end by silence.
        """
        if self._closed:
            raise ValueError("the decoder is closed")
        search = self._search
        if host_s is None:
            if self._framing.kind == "idle":
                raise ValueError("frames that end by silence need the host time of each read")
        else:
            if self._heard_s is not None and self._framing.silence_s:
                silence_s = host_s - self._heard_s - len(data) * self._framing.byte_s
                if silence_s > self._framing.silence_s:
                    self.interrupt()
            if data or self._heard_s is None:
                self._heard_s = host_s
        search.drop_searched()
        self._buffer += data

    def interrupt(self, *, missing: bool = False) -> None:
        """Note that the stream was interrupted here: what waits for more bytes will not get them.

        Parameters
        ----------
        missing
            Whether bytes are missing here, so that what comes next may be the rest of a frame: where delimiters end
            frames, nothing else shows that it is none.
        """
        at = self._search.offset + len(self._buffer) - self._search.at
        if self._breaks and self._breaks[-1][0] == at:
            missing = self._breaks.pop()[1] or missing
        self._breaks.append((at, missing))

    def close(self) -> None:
        """End the stream: what waits for more bytes is searched once more, then counted as skipped."""
        self._closed = True

    def next_frame(self) -> Found:
        """Return the next good frame, or `NEED_DATA`."""
        while self._breaks:
            frame = self._next_before_break()
            if frame is not NEED_DATA:
                return self._received(frame)
        frame = self._search.next(len(self._buffer), ended=self._closed)
        return frame if frame is NEED_DATA else self._received(frame)

    def take(self) -> FrameSet:
        """Return all good frames that the bytes so far hold and that were not returned before."""
        frames = FrameCollection()
        self.take_into(frames)
        return frames.together(replace(self.counters))

    def take_into(self, frames: FrameCollection) -> None:
        """Add all good frames that the bytes so far hold and that were not returned before."""
        found = []
        while (frame := self.next_frame()) is not NEED_DATA:
            found.append(frame)
        frames.add(found)

    def _received(self, frame: Frame) -> Frame:
        self.counters.received += 1
        if self._acceptance.selective and self._framing.type_of(frame.data) is None:
            self.counters.unknown_types += 1
        return frame

    def _break(self) -> int:
        """Return the byte of the buffer before which the stream was interrupted first."""
        return self._breaks[0][0] - self._search.offset + self._search.at

    def _next_before_break(self) -> Found:
        """Search up to the first break as if more bytes could come, then as if none could."""
        search, end = self._search, self._break()
        if self._skipped_before is None:
            frame = search.next(end, ended=False)
            if frame is not NEED_DATA:
                return frame
            self._skipped_before = self.counters.skipped_bytes
        frame = search.next(end, ended=True)
        if frame is NEED_DATA:
            if self._framing.kind != "idle" and self.counters.skipped_bytes > self._skipped_before:
                self.counters.timed_out += 1
            self._skipped_before = None
            if self._breaks.popleft()[1]:
                search.begin_within()
        return frame
