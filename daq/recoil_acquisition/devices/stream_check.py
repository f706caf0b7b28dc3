"""Looks at what passes and counts damage and gaps while it is recorded; it changes nothing and keeps nothing.

A serial stream is decoded a second time, and apart from this, for the trigger and the screen. Neither can take the
other's place: that one must give every sample at once, leaves blocks out when it falls behind, and looks only now and
then at a source that no trigger needs; counts must miss nothing and may come late. Because they may, many blocks are
decoded together: with frames of 16 bytes at 3 Mbaud, asked for every 50 ms, this takes 0.3 % of one core of a common
computer, and a batch that nobody asked for holds the thread that reads for 7 ms every 3.5 s. The trigger's decoding
takes 1.2 % there.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from recoil_acquisition.devices.device import Block
from recoil_acquisition.errors import DeviceError, nearest_first
from recoil_acquisition.frames import can_rows
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.values import decode_fields, gaps
from recoil_acquisition.readers.can.buses import BusName, bus_number
from recoil_acquisition.readers.can.decoding import SignalLayout, gather
from recoil_acquisition.readers.can.frames import keys_of_rows
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.can.parameter_groups import Sender

_BATCH_BYTES = 1 << 20


class FramingCheck:
    """Counts the frames of a serial stream by the framing that the rig declares.

    Blocks are gathered and decoded together when a count is asked for, by the thread that asks. Only where nobody does
    the thread that feeds decodes them, lest they fill the memory; it never waits for a decoding that goes on.
    """

    def __init__(self, framing: Framing) -> None:
        # only the counter is needed of the frames
        self._framing = framing
        self._decoder = FrameDecoder(framing)
        self._decoding = threading.Lock()
        self._waiting: deque[Block] = deque()
        self._waiting_bytes = 0
        self._last: int | None = None
        self._gaps = 0

    @property
    def bad(self) -> int:
        """Places that looked like a frame and were damaged, so far."""
        self._look()
        counters = self._decoder.counters
        return counters.bad_checksum + counters.bad_length + counters.implausible + counters.not_followed

    @property
    def skipped_bytes(self) -> int:
        """Bytes outside of good frames so far."""
        self._look()
        return self._decoder.counters.skipped_bytes

    @property
    def counter_gaps(self) -> int | None:
        """Gaps of the packet counter so far; None if the framing declares none."""
        self._look()
        return None if self._framing.counter is None else self._gaps

    def feed(self, block: Block) -> None:
        """Take the next block."""
        self._waiting.append(block)
        self._waiting_bytes += len(block.payload)
        if self._waiting_bytes >= _BATCH_BYTES:
            self._waiting_bytes = 0
            self._look(wait=False)

    def _look(self, *, wait: bool = True) -> None:
        if not self._decoding.acquire(blocking=wait):
            return
        try:
            if not self._waiting:
                return
            while self._waiting:
                block = self._waiting.popleft()
                self._decoder.feed(block.payload, block.host_ns / 1e9)
            frames = self._decoder.take()
            counter = self._framing.counter
            if counter is None or not frames.begins.size:
                return
            counts = decode_fields(self._framing, frames, (counter.field,))[counter.field].raw.astype(np.int64)
            if not counts.size:
                return
            followed = counts if self._last is None else np.append(self._last, counts)
            self._gaps += gaps(followed, counter.modulo, counter.step)[0]
            self._last = int(counts[-1])
        finally:
            self._decoding.release()


class CanCounterCheck:
    """Counts the gaps of message counters on a bus.

    Parameters
    ----------
    counters
        Layouts of the counters, by identifier and whether it has 29 bits.
    bus
        Number of the one bus whose messages are counted, where several are delivered; None for all.
    senders
        Senders of those messages that others than their identifier's may send.
    """

    skipped_bytes = None
    bad = 0

    def __init__(
        self,
        counters: Mapping[int, SignalLayout],
        bus: int | None = None,
        senders: Mapping[int, Sender] = MappingProxyType({}),
    ) -> None:
        self._counters, self._bus = dict(counters), bus
        self._senders = {key: Sender(key) for key in counters} | dict(senders)
        self._last: dict[int, int] = {}
        self.counter_gaps: int | None = 0

    def feed(self, block: Block) -> None:
        """Take the next block."""
        records = can_rows.parse_rows(block.payload)
        plain = records["flags"] & (can_rows.ERROR | can_rows.REMOTE) == 0
        if self._bus is not None:
            plain &= records["channel"] == self._bus
        keys = keys_of_rows(records)
        for key, layout in self._counters.items():
            long_enough = records["length"] >= layout.bytes_needed
            chosen = records[plain & long_enough & self._senders[key].sent(keys)]
            if not chosen.size:
                continue
            counts = gather(chosen["data"], layout.pieces)
            if key in self._last:
                counts = np.append(np.uint64(self._last[key]), counts)
            # a counter wraps at a power of two, and so do differences of uint64
            steps = np.diff(counts) & np.uint64(2**layout.length - 1)
            self.counter_gaps = (self.counter_gaps or 0) + int((steps != 1).sum())
            self._last[key] = int(counts[-1])


StreamCheck = FramingCheck | CanCounterCheck
"""A look at the blocks of data as they pass, for the counters only."""


def can_counter_check(
    source: str, names: Sequence[str], database: str, path: Path, bus: BusName | None = None
) -> CanCounterCheck:
    """Find the counters that a rig names, such as ``Message.Signal``, in a bus's database.

    Parameters
    ----------
    database
        Text of the DBC file.
    path
        The rig file, for messages.

    Raises
    ------
    DeviceError
        If there is no such signal, with the nearest names, or it is no whole number.
    ReadError
        If the database is at fault.
    """
    counters: dict[int, SignalLayout] = {}
    senders: dict[int, Sender] = {}
    parsed = load_database(database, path)
    known = parsed.signals
    for name in names:
        if not (named := parsed.named(name)):
            parsed.refuse_faulty(name, path)
            raise DeviceError(
                f"source '{source}': the database has no signal {name!r}",
                found=", ".join(nearest_first(name, tuple(known))[:5]),
                remedy="correct `counters` of the source in the rig file, nearest names first",
            )
        for one in named:
            if one.layout is None or one.layout.kind == "float":
                raise DeviceError(
                    f"source '{source}': {name} is no whole number", remedy="correct `counters` of the source"
                )
            counters[one.key], senders[one.key] = one.layout, parsed.sender_of(one)
    return CanCounterCheck(counters, None if bus is None else bus_number(bus), senders)
