"""Channels of a bus in SI as its frames pass, and by how much they were held back.

A shot is cut out of every source around the instant of its trigger. An interface, its driver or the machine may
deliver a frame late without anyone's having been late to read it: dated by its arrival, it would move the window of all
other sources. The interface's stamps go on evenly meanwhile, so that the difference of both clocks shows by how much.
An interface's clock that is set back runs backwards, which shows it; set back by less than a pause of the bus, it looks
like a delay until the usual difference is the new one, at most 2.5 s.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples, LiveSource
from recoil_acquisition.devices.can_device import KERNEL_STAMPED
from recoil_acquisition.devices.device import CAN, Block, Counters
from recoil_acquisition.errors import MissingChannelError, ReadError
from recoil_acquisition.frames import can_rows
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.readers.can.buses import bus_number
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import keys_of_rows
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.can.parameter_groups import Sender

Instants = NDArray[np.int64]

LONGEST_DELAY_S = 1.0
"""Delay from which on frames are not held back: the interface's clock was set anew."""
_BUCKET_NS = 250_000_000
_BUCKETS = 20
"""Number of quarters of a second of each of which the least difference is kept; their median is that of no wrong stamp
and of no delay that lasts less than half of them."""
_FEWEST_BUCKETS = 4
"""Number of buckets below which nothing is known."""


class HeldBack:
    """Follows by how much the frames of one bus are late."""

    def __init__(self) -> None:
        self._least_ns: deque[tuple[int, int]] = deque(maxlen=_BUCKETS)
        self._stamp_ns = 0

    def late_s(self, host_ns: Instants, device_ns: Instants) -> Array:
        """Return by how much frames were held back, at most `LONGEST_DELAY_S`; 0 where it is not known.

        Parameters
        ----------
        host_ns : ndarray of int64, shape (n_frames,), n_frames at least 1
            Host times at which the frames were received, not running backwards.
        device_ns : ndarray of int64, shape (n_frames,)
            The stamps of the interface's own clock.

        Returns
        -------
        ndarray of float64, shape (n_frames,)
        """
        difference = host_ns - device_ns
        if np.any(np.diff(device_ns, prepend=self._stamp_ns) < 0):
            self._least_ns.clear()  # its clock was set back
        self._stamp_ns = int(device_ns[-1])
        late_ns = np.zeros(host_ns.size)
        if len(self._least_ns) >= _FEWEST_BUCKETS:
            usual_ns = sorted(least for _, least in self._least_ns)[(len(self._least_ns) - 1) // 2]
            late_ns = np.maximum(difference - usual_ns, 0.0)
            late_ns[late_ns > LONGEST_DELAY_S * 1e9] = 0.0
        bucket, least = int(host_ns[-1]) // _BUCKET_NS, int(difference.min())
        if self._least_ns and self._least_ns[-1][0] == bucket:
            least = min(least, self._least_ns.pop()[1])
        self._least_ns.append((bucket, least))
        return late_ns / 1e9


class CanSignals:
    """Channels of a bus.

    Parameters
    ----------
    source
        Source with its database.
    """

    def __init__(self, source: LiveSource, channels: Sequence[LiveChannel]) -> None:
        database = load_database(source.database or "", source.path)
        self._wanted: dict[int, list[tuple[LiveChannel, SignalLayout, dict[str, SignalLayout]]]] = {}
        self._senders: dict[int, Sender] = {}
        self._interface = source.device.get("interface")
        self._bus = None if source.bus is None else bus_number(source.bus)
        for channel in channels:
            decoded = [one for one in database.named(channel.signal) if one.layout is not None]
            if not decoded:
                database.refuse_faulty(channel.signal, source.path)
                raise MissingChannelError(channel.signal, tuple(database.signals), path=source.path)
            if len(decoded) > 1:
                raise ReadError(
                    f"{channel.signal!r} is of several messages of the CAN database",
                    path=source.path,
                    found=", ".join(repr(one.name) for one in decoded),
                    remedy="write one of these as `signal` in the rig file",
                )
            one = decoded[0]
            if one.layout is not None:
                self._wanted.setdefault(one.key, []).append((channel, one.layout, one.layouts))
            self._senders[one.key] = database.sender_of(one)
        self._held_back = HeldBack()
        self._clock: int | None = None
        self._latest_s = -np.inf

    def feed(self, block: Block) -> list[LiveSamples]:
        """Take the next block; return the samples that it completes."""
        if block.kind != CAN:
            return []
        records = can_rows.parse_rows(block.payload)
        if not records.size:
            return []
        # within one source time goes forward; a frame is never dated before the one in front of it
        times_s = np.maximum.accumulate(records["host_ns"] / 1e9 - self._late_s(records))
        times_s = np.maximum(times_s, self._latest_s)
        self._latest_s = float(times_s[-1])
        plain = records["flags"] & (can_rows.ERROR | can_rows.REMOTE) == 0
        if self._bus is not None:
            plain &= records["channel"] == self._bus
        keys = keys_of_rows(records)
        samples = []
        for key, rows in self._wanted.items():
            wanted = plain & self._senders[key].sent(keys)
            chosen = records[wanted]
            if not chosen.size:
                continue
            data, length = chosen["data"], chosen["length"].astype(np.int64)
            for channel, layout, layouts in rows:
                held = present(layout, layouts, data, length) & (length >= layout.bytes_needed)
                values = layout.decode(data[held]) * channel.factor + channel.offset
                there = np.isfinite(values)  # a code is no value
                if there.any():
                    samples.append(LiveSamples(channel.name, times_s[wanted][held][there], values[there]))
        return samples

    def _late_s(self, records: NDArray[np.void]) -> Array:
        """Return by how much frames were held back before they came, where one clock of the interface stamps them."""
        clock = can_rows.clock_of(records["flags"])
        if clock is None:
            return np.zeros(records.size)
        if clock != self._clock:  # what is known is of the other one
            self._clock, self._held_back = clock, HeldBack()
        return self._held_back.late_s(np.maximum.accumulate(records["host_ns"]), records["device_ns"])

    def skip(self) -> None:
        """Do nothing: a block holds whole frames."""

    def stamped_by(self, blocks: Sequence[Block]) -> str:
        """Return which clock stamped the frames: the ``hardware``, the ``adapter``, the ``kernel`` or the ``host``."""
        rows = [can_rows.parse_rows(block.payload)["flags"] for block in blocks if block.kind == CAN]
        clock = can_rows.clock_of(np.concatenate(rows)) if rows else None
        if clock is None:
            return "host"
        if clock & can_rows.HARDWARE_TIME:
            return "hardware"
        return "kernel" if self._interface in KERNEL_STAMPED else "adapter"

    def unheard(self, channel: LiveChannel, counters: Counters) -> str:
        """Say why nothing of a channel may have come, and what to do."""
        del counters
        return f"no message holds {channel.signal}: check the database and that its node is on"
