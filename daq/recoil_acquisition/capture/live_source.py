"""A source that is read live, and its channels in SI as they pass."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import Block, Counters, Device
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.live_kind import LiveKind, live_kind_of
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.quantity import Unit
from recoil_acquisition.readers.can.buses import BusName


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

    def shown(self, value: float, *, rate: bool = False, span: bool = False, digits: int = 4) -> str:
        """Write a value in SI in the unit in which people read the channel.

        Parameters
        ----------
        rate, span
            Whether it is a rate of change, by the second, or a difference of two values.
        """
        unit, spelling = self.shown_unit or Unit(frozenset(), 1.0), self.shown_in or self.unit
        number = value / unit.factor if rate or span else unit.from_si(value)
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

    @property
    def live_kind(self) -> LiveKind:
        """The kind of its device; ValueError if it has none that can be read live."""
        kind = live_kind_of(self.kind, self.device)
        if kind is None:
            raise ValueError(f"source '{self.name}' of kind {self.kind!r} has no live signals")
        return kind


def open_source(source: LiveSource, heard: Callable[[str, str, bytes], None] | None = None) -> Device:
    """Open the device of a source, whose talk may be heard; DeviceError, in one line, if that cannot be done."""
    signals = tuple(dict.fromkeys(channel.signal for channel in source.channels))
    declared = DeviceDeclarations(source.framing, source.database, source.counters, source.bus, signals, heard)
    return open_device(source.name, source.kind, source.device, declared)


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


class LiveSignals(Protocol):
    """Channels of one live source, decoded block by block."""

    def feed(self, block: Block) -> Iterable[LiveSamples]:
        """Take the next block; return the samples that it completes, all of which are taken before the block behind it.

        They may be decoded as they are taken: of many fast channels no more than one is held at a time then.
        """

    def skip(self) -> None:
        """Note that data is missing before the next block."""

    def stamped_by(self, blocks: Sequence[Block]) -> str:
        """Return which clock stamped the samples of some blocks: that of the ``host`` when it read them, or another."""

    def unheard(self, channel: LiveChannel, counters: Counters) -> str:
        """Say why nothing of a channel may have come, and what to do."""


def signals_of(source: LiveSource, channels: Sequence[LiveChannel]) -> LiveSignals:
    """Return what decodes some channels of a source.

    Raises
    ------
    MissingChannelError
        If the source has no such signal, with the nearest names.
    ReadError
        If its database is at fault.
    ValueError
        If it is of no kind that is read live, or lacks what decodes it.
    """
    signals: LiveSignals = source.live_kind.load("signals")(source, channels)
    return signals
