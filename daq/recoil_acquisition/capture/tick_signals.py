"""Channels in SI of an instrument that counts its samples, as its stream passes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples
from recoil_acquisition.devices.described import DESCRIBED, DescribedEvents
from recoil_acquisition.devices.device import EVENT, Block, Counters, event_of, interrupts
from recoil_acquisition.devices.tick_clock import TickClock
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel, TickDecoder, TickSamples


class TickSignals:
    """Channels of a stream.

    Each channel has a clock of its own, because a gap, or another beat behind it, may be one channel's alone.

    Parameters
    ----------
    channels
        Channels that are wanted, by the names of the stream in their ``signal``.
    decoder
        Decoder of the stream.
    """

    def __init__(self, channels: Sequence[LiveChannel], decoder: TickDecoder) -> None:
        self._wanted: dict[str, list[LiveChannel]] = {}
        for channel in channels:
            self._wanted.setdefault(channel.signal, []).append(channel)
        self._decoder, self._events = decoder, DescribedEvents()
        self._description: StreamDescription | None = None
        self._clocks: dict[str, _Clock] = {}

    def feed(self, block: Block) -> Iterable[LiveSamples]:
        """Take the next block; return the samples that it completes, decoded as they are taken."""
        if block.kind == EVENT:
            self._heed(block)
        return self._decoded(block) if block.is_data else ()

    def skip(self) -> None:
        """Note that bytes are missing before the next block."""
        self._decoder.skip()

    def stamped_by(self, blocks: Sequence[Block]) -> str:
        """Return which clock dates the samples: that of the ``recorder``, which counts them."""
        del blocks
        return "recorder"

    def unheard(self, channel: LiveChannel, counters: Counters) -> str:
        """Say why nothing of a channel may have come, and what to do."""
        if self._description is None:
            return f"the recorder has not said what it sends, in {counters.received} bytes: check its stream"
        return f"no sample of {channel.signal} came: check that the recorder's acquisition runs, and its channel"

    def _heed(self, block: Block) -> None:
        if interrupts(block):
            self._decoder.skip()
            for clock in self._clocks.values():
                clock.interrupt()
            return
        event = event_of(block)
        if event.name == DESCRIBED and (said := self._events.take(event.detail)) is not None:
            self._decoder.describe(said)
            self._describe(said)

    def _describe(self, description: StreamDescription) -> None:
        if description != self._description:  # a new epoch: ticks may begin anew
            self._description = description
            for clock in self._clocks.values():
                clock.restart()

    def _decoded(self, block: Block) -> Iterator[LiveSamples]:
        for item in self._decoder.feed(block.payload):
            if isinstance(item, StreamDescription):
                self._describe(item)
            elif isinstance(item, TickSamples) and self._description is not None:
                yield from self._samples(item, self._description, block.host_ns)

    def _samples(self, item: TickSamples, description: StreamDescription, host_ns: int) -> Iterator[LiveSamples]:
        if item.channel >= len(description.channels) or not item.raw.size:
            return
        channel = description.channels[item.channel]
        wanted = self._wanted.get(channel.name)
        if not wanted or not channel.tick_rate:
            return
        if channel.name not in self._clocks:
            self._clocks[channel.name] = _Clock(channel)
        dated = self._clocks[channel.name].dated(channel, item, host_ns)
        if dated is None:
            return
        first, times_s = dated
        for one in wanted:
            values = _in_si(item.raw[first:], channel, one)
            found = np.isfinite(values)
            if found.all():
                yield LiveSamples(one.name, times_s, values)
            elif found.any():  # what is no number is no value
                yield LiveSamples(one.name, times_s[found], values[found])


class _Clock:
    """Clock of one channel, in samples."""

    def __init__(self, channel: TickChannel) -> None:
        self._rate = _sample_rate(channel)
        self._clock = TickClock(float(self._rate))
        self._next: int | None = None
        self._interrupted = False

    def restart(self) -> None:
        self._clock.restart()
        self._next = None

    def interrupt(self) -> None:
        """Note that the connection was lost: nothing is repeated behind it, ticks that go back are counted anew."""
        self._interrupted = True

    def dated(self, channel: TickChannel, item: TickSamples, host_ns: int) -> tuple[int, Array] | None:
        """Return from which sample on they are new, and their instants; None where there is no relation yet."""
        if _sample_rate(channel) != self._rate:
            self._rate = _sample_rate(channel)
            self._clock = TickClock(float(self._rate))
            self._next = None
        numbers = None if item.ticks is None else np.asarray(item.ticks, dtype=np.int64)
        first = item.first_tick // channel.step if numbers is None else int(numbers[0])
        count = item.raw.size if numbers is None else int(numbers[-1]) - first + 1
        again = 0 if self._next is None else self._next - first
        interrupted, self._interrupted = self._interrupted, False
        if again >= count or (interrupted and again > 0):
            if again - count < float(self._rate) and not interrupted:
                return None  # samples that came before: doubled, or late
            self.restart()
            again = 0
        again = max(again, 0)
        self._next = first + count
        times_s = self._clock.feed(first + again, count - again, host_ns)
        if times_s is None:
            return None
        if numbers is None:
            return again, times_s
        new = int(np.searchsorted(numbers, first + again))
        return new, times_s[numbers[new:] - first - again]


def _in_si(raw: NDArray[Any], channel: TickChannel, wanted: LiveChannel) -> Array:
    """Return numbers of a stream in the SI unit of a channel: both lines as one, in one pass."""
    with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is no number, and left out
        values: Array = np.multiply(raw, wanted.factor * channel.factor, dtype=np.float64)
        values += wanted.factor * channel.offset + wanted.offset
    return values


def _sample_rate(channel: TickChannel) -> Fraction:
    return channel.tick_rate / (channel.step or 1)
