"""Content of a stream whose instrument counts its samples: its channels as it describes them, and samples by tick.

A tick is a whole number that the instrument counts; a sample belongs to one exactly. Nothing here is a time: that comes
from a `recoil_acquisition.devices.tick_clock.TickClock` live, and from the instrument's own start where it says one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

from recoil_acquisition.numerics.read_only import ReadOnlyArrays


@dataclass(frozen=True)
class TickChannel:
    """One channel as its instrument describes it: ``value = factor * raw + offset`` in its unit.

    Attributes
    ----------
    unit
        Unit as the instrument spells it; empty where it says none.
    tick_rate
        Ticks per second; zero where the instrument has not said it yet.
    step
        Ticks from one sample to the next; 0 where each sample has a tick of its own.
    said
        Further words that the instrument says of it, such as its range or its filter, in its own words. Two channels
        of which different ones are known are the same.
    """

    name: str
    unit: str
    tick_rate: Fraction
    step: int = 1
    factor: float = 1.0
    offset: float = 0.0
    said: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class StreamDescription:
    """Description of a stream, from here to the next one: with each a new epoch begins, over which nothing goes on.

    Attributes
    ----------
    channels
        Channels in the order in which the stream names them.
    start_utc_ns
        Instant of tick 0, ns since 1970-01-01 UTC; None where the instrument says none.
    time_by
        Source of its absolute time in the instrument's words, such as ``PTP``; empty where it says none.
    """

    channels: tuple[TickChannel, ...]
    start_utc_ns: int | None = None
    time_by: str = field(default="", compare=False)


@dataclass(frozen=True, eq=False)
class TickSamples(ReadOnlyArrays):
    """Samples of one channel that follow each other without a gap.

    Attributes
    ----------
    channel
        Place of the channel in the description, from 0.
    first_tick
        Tick of the first sample; each later one is ``step`` of its channel behind.
    raw : ndarray, shape (n_samples,)
        Numbers as they were sent, in the type in which they were sent.
    ticks : ndarray of int64, shape (n_samples,), or None
        Tick of each sample of a channel whose samples have ticks of their own.
    """

    channel: int
    first_tick: int
    raw: Any
    ticks: Any = None


@dataclass(frozen=True)
class StreamFault:
    """Part of a stream that cannot be read, or that says of itself that it is wrong; in one line.

    Attributes
    ----------
    is_out_of_step
        Whether it is not known where the next part begins: a new connection begins at one.
    """

    problem: str
    is_out_of_step: bool = False


TickItem = StreamDescription | TickSamples | StreamFault
"""What a decoder makes of the bytes of a stream."""


class TickDecoder(Protocol):
    """Decoder of the bytes of one stream, which may be cut anywhere."""

    def feed(self, data: bytes) -> list[TickItem]:
        """Return what the next bytes complete, in their order; nothing that they hold raises."""

    def skip(self) -> None:
        """Note that bytes are missing before the next: what is half there will not be completed."""

    def describe(self, description: StreamDescription) -> None:
        """Take what a device said of the stream, for bytes that begin behind the stream's own description."""
