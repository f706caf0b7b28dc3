"""A virtual recorder each of whose samples says which channel's it is, and of which tick."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recoil_rigs.twin.oxygen_packets import Raw, ValueForm, WireChannel, data_part, packet, raw_of
from recoil_rigs.twin.oxygen_recorder import GOOD, Handling, OxygenRecorder, RecorderContent
from tests.builders.oxygen_client import Packet

PERIOD = 1 << 15
"""Ticks after which the numbers come again; 16 channels of it are whole numbers of 20 bits."""

FACTOR, OFFSET = 0.25, 10.0
"""Scale of whole numbers."""


def ramp(channel: int, channels: int, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return what a channel's samples are at some ticks, before they are scaled."""
    return ticks % PERIOD * channels + channel


def ramp_content(units: Mapping[str, str], rate_hz: float, form: ValueForm, packet_s: float) -> RecorderContent:
    """Return a recorder of channels by name, each with its unit; whole numbers are scaled."""
    scaled, count = (1.0, 0.0) if form == "f32" else (FACTOR, OFFSET), len(units)
    ticks = np.arange(PERIOD)
    raw = np.stack([raw_of(ramp(i, count, ticks), form) for i in range(count)])
    wire = tuple(WireChannel(name, unit, *scaled) for name, unit in units.items())
    said = tuple(
        {"SampleRate": f'(SCALAR,{rate_hz!r},"Hz")', "Unit": f'(STRING,"{unit}")', "Used": '(STRING,"ON")'}
        for unit in units.values()
    )
    return RecorderContent(wire, said, rate_hz, form, raw, packet_s)


@dataclass
class Ramps:
    """Checks a recorder's ramps, packet by packet, and joins the ticks that follow each other.

    Attributes
    ----------
    stretches
        First tick and the one behind the last, of ticks that follow each other in all channels, within one seed.
    wrong
        Number of samples that are not what their tick says.
    """

    channels: int
    stretches: list[tuple[int, int]] = field(default_factory=list)
    seeds: list[int] = field(default_factory=list)
    wrong: int = 0

    def take(self, one: Packet) -> None:
        """Check one packet."""
        if not one.data:
            return
        assert len(one.data) == self.channels
        for channel, (ticks, _, code, data) in enumerate(one.data):
            expected = raw_of(ramp(channel, self.channels, ticks.astype(np.int64)), "f32" if code == 10 else "i24")
            self.wrong += int((np.frombuffer(data, np.uint8) != expected.ravel()).any()) * ticks.size
        first, behind = int(one.data[0][0][0]), int(one.data[0][0][-1]) + 1
        new = not self.seeds or self.seeds[-1] != one.seed
        if new:
            self.seeds.append(one.seed)
        if not new and self.stretches and self.stretches[-1][1] == first:
            self.stretches[-1] = (self.stretches[-1][0], behind)
        else:
            self.stretches.append((first, behind))


class RampRecorder(OxygenRecorder):
    """Streams its ramps from the start of the stream on, as long as somebody takes them.

    Attributes
    ----------
    sent
        First tick, number of samples, and time of the host's monotonic clock behind its write, of each packet.
    cpu_s
        Processor time of the thread that sends.
    """

    def __init__(self, name: str, content: RecorderContent) -> None:
        super().__init__(name, content)
        self.sent: list[tuple[int, int, int]] = []
        self.cpu_s = 0.0

    def at_rest(self, first: int, count: int) -> Raw:
        """Return the ramps from a tick on."""
        rest, start = self.content.rest, first % PERIOD
        if start + count <= PERIOD:
            return rest[:, start : start + count]
        return rest[:, (start + np.arange(count)) % PERIOD]

    def send(self, first: int, raw: Raw, handling: Handling = GOOD) -> bool:
        """Send samples, and note that they are sent."""
        done = super().send(first, raw, handling)
        if done:
            self.sent.append((first, raw.shape[1], time.monotonic_ns()))
        self.cpu_s = time.thread_time()
        return done

    def break_off(self) -> None:
        """Be gone in the middle of a packet, as a recorder whose program is killed."""
        with self._lock:
            streaming = self._streaming
            if streaming is not None:
                raw = self.at_rest(self._rested, self.content.packet_ticks)
                rate_hz, form = self.content.rate_hz, self.content.form
                parts = [data_part(one, raw[i], self._rested, rate_hz, form) for i, one in streaming.channels.items()]
                data = packet(streaming.sequence, streaming.seed, parts)
                self._write(data[: len(data) // 2], ())
                streaming.sequence += 1
        self.unplug()
