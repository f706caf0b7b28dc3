"""A source that is read live, its channels in SI as they pass, and by how much its frames were held back.

A shot is cut out of every source around the instant of its trigger. An interface, its driver or the machine may
deliver a frame late without anyone's having been late to read it: dated by its arrival, it would move the window of all
other sources. The interface's stamps go on evenly meanwhile, so that the difference of both clocks shows by how much.
An interface's clock that is set back runs backwards, which shows it; set back by less than a pause of the bus, it looks
like a delay until the usual difference is the new one, at most 2.5 s.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.devices.device import CAN, SERIAL, Block, Device, interrupts
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.errors import MissingChannelError, ReadError
from recoil_acquisition.frames import can_rows
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.values import decode_fields
from recoil_acquisition.quantity import Unit
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_acquisition.readers.can.buses import BusName, bus_number
from recoil_acquisition.readers.can.decoding import SignalLayout, present
from recoil_acquisition.readers.can.frames import keys_of_rows
from recoil_acquisition.readers.can.messages import load_database

Instants = NDArray[np.int64]
Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class LiveChannel:
    """One channel of a live source: ``value = factor * signal + offset``.

    Attributes
    ----------
    name
        Name of the channel in the rig file.
    signal
        Name of the signal: ``Message.Signal`` of a bus, the field of a framing.
    factor, offset
        Line from the signal's unit to SI, polarity and sensitivity included.
    unit
        SI unit of the samples.
    range
        Range of the channel's sensor, SI.
    shown_in, shown_unit
        Unit in which people read it, and its spelling; None for SI.
    """

    name: str
    signal: str
    factor: float
    offset: float
    unit: str
    range: tuple[float, float] | None = None
    shown_in: str = ""
    shown_unit: Unit | None = None

    def shown(self, value: float, *, rate: bool = False, digits: int = 4) -> str:
        """Write a value in SI in the unit in which people read the channel; a rate of change is by the second."""
        unit, spelling = self.shown_unit or Unit(frozenset(), 1.0), self.shown_in or self.unit
        number = value / unit.factor if rate else unit.from_si(value)
        return f"{number:.{digits}g} {spelling}{'/s' if rate else ''}".strip()


@dataclass(frozen=True)
class LiveSource:
    """Declaration of one live source.

    Attributes
    ----------
    device
        Table ``device`` of the source.
    framing
        Framing of a serial source; None of any other.
    database
        Text of a bus's database.
    counters
        Signals of a bus that count messages.
    bus
        Bus of the source, where its device delivers several.
    path
        The rig file, for messages.
    """

    name: str
    kind: str
    device: Mapping[str, Any]
    channels: tuple[LiveChannel, ...]
    framing: Framing | None = None
    database: str | None = None
    counters: tuple[str, ...] = ()
    bus: BusName | None = None
    path: Path = Path("rig.toml")


def open_source(source: LiveSource) -> Device:
    """Open the device of a source; DeviceError, in one line, if that cannot be done."""
    return open_device(
        source.name, source.kind, source.device,
        framing=source.framing, database=source.database, counters=source.counters, bus=source.bus,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class LiveSamples(ReadOnlyArrays):
    """Samples of one channel as they came.

    Attributes
    ----------
    times_s : ndarray of float64, shape (n_samples,)
        Instants on the host's monotonic clock, never running backwards.
    values : ndarray of float64, shape (n_samples,)
        Samples, SI.
    """

    channel: str
    times_s: Array
    values: Array


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
        self._bus = None if source.bus is None else bus_number(source.bus)
        for channel in channels:
            decoded = [one for one in database.signals.get(channel.signal, ()) if one.layout is not None]
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
        self._held_back = HeldBack()
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
            wanted = plain & (keys == key)
            chosen = records[wanted]
            if not chosen.size:
                continue
            data, length = chosen["data"], chosen["length"].astype(np.int64)
            for channel, layout, layouts in rows:
                held = present(layout, layouts, data, length) & (length >= layout.bytes_needed)
                if held.any():
                    values = layout.decode(data[held]) * channel.factor + channel.offset
                    samples.append(LiveSamples(channel.name, times_s[wanted][held], values))
        return samples

    def _late_s(self, records: NDArray[np.void]) -> Array:
        """Return by how much frames were held back before they came, where the interface stamps them."""
        if not (records["flags"] & can_rows.DEVICE_TIME != 0).all():
            return np.zeros(records.size)
        return self._held_back.late_s(np.maximum.accumulate(records["host_ns"]), records["device_ns"])

    def skip(self) -> None:
        """Do nothing: a block holds whole frames."""


class SerialSignals:
    """Channels of a port.

    Parameters
    ----------
    path
        The rig file, for messages.
    """

    def __init__(self, framing: Framing, channels: Sequence[LiveChannel], path: Path) -> None:
        known = {field.name for frame_type in framing.types for field in frame_type.fields}
        for channel in channels:
            if channel.signal not in known:
                raise MissingChannelError(channel.signal, tuple(sorted(known)), path=path)
        self._framing = framing
        self._channels = tuple(channels)
        self._fields = frozenset(channel.signal for channel in channels)
        self._decoder = FrameDecoder(framing)
        self._fed = 0
        self._latest_s = -np.inf

    def feed(self, block: Block) -> list[LiveSamples]:
        """Take the next block; return the samples that it completes."""
        if not block.is_data:
            if interrupts(block):
                self._decoder.interrupt(missing=True)
            return []
        host_s = block.host_ns / 1e9
        self._decoder.feed(block.payload, host_s)
        self._fed += len(block.payload)
        frames = self._decoder.take()
        if not frames.begins.size:
            return []
        series = decode_fields(self._framing, frames, self._fields)
        # a frame ended on the line before the bytes that came behind it in the same read
        times_s = host_s - (self._fed - frames.ends).astype(np.float64) * self._framing.byte_s
        times_s = np.clip(np.maximum.accumulate(times_s), self._latest_s, host_s)
        self._latest_s = float(times_s[-1])
        samples = []
        for channel in self._channels:
            found = series[channel.signal]
            if found.frames.size:
                values = found.values * channel.factor + channel.offset
                samples.append(LiveSamples(channel.name, times_s[found.frames], values))
        return samples

    def skip(self) -> None:
        """Note that bytes are missing: a half frame will not be completed."""
        self._decoder.interrupt(missing=True)


LiveSignals = CanSignals | SerialSignals
"""The channels of one live source, decoded block by block."""


def signals_of(source: LiveSource, channels: Sequence[LiveChannel]) -> LiveSignals:
    """Return what decodes some channels of a source.

    Raises
    ------
    MissingChannelError
        If the source has no such signal, with the nearest names.
    ReadError
        If its database is at fault.
    """
    if source.kind == CAN:
        return CanSignals(source, channels)
    if source.kind == SERIAL and source.framing is not None:
        return SerialSignals(source.framing, channels, source.path)
    raise ValueError(f"source '{source.name}' of kind {source.kind!r} has no live signals")
