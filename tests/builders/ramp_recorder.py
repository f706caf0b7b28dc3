"""A virtual recorder each of whose samples says which channel's it is, and of which tick."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recoil_rigs.twin.oxygen_packets import Raw, ValueForm, WireChannel, raw_of
from recoil_rigs.twin.oxygen_recorder import GOOD, Handling, OxygenRecorder, RecorderContent

PERIOD = 1 << 15
"""Ticks after which the numbers come again; 16 channels of it are whole numbers of 20 bits."""

UNIT = "m/s2"


def ramp(channel: int, channels: int, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return what a channel's samples are at some ticks, before they are scaled."""
    return ticks % PERIOD * channels + channel


def ramp_content(channels: int, rate_hz: float, form: ValueForm, packet_s: float) -> RecorderContent:
    """Return a recorder whose channels are ``AI 1`` and so on; one of whole numbers is scaled."""
    scaled = (1.0, 0.0) if form == "f32" else (0.25, 10.0)
    ticks = np.arange(PERIOD)
    raw = np.stack([raw_of(ramp(i, channels, ticks), form) for i in range(channels)])
    wire = tuple(WireChannel(f"AI {i + 1}", UNIT, *scaled) for i in range(channels))
    said = {"SampleRate": f'(SCALAR,{rate_hz!r},"Hz")', "Unit": f'(STRING,"{UNIT}")', "Used": '(STRING,"ON")'}
    return RecorderContent(wire, (said,) * channels, rate_hz, form, raw, packet_s)


@dataclass
class RampRecorder(OxygenRecorder):
    """Streams its ramps from the start of the stream on, as long as somebody takes them.

    Attributes
    ----------
    sent
        First tick, number of samples, and time of the host's monotonic clock behind its write, of each packet.
    cpu_s
        Processor time of the thread that sends.
    """

    sent: list[tuple[int, int, int]] = field(default_factory=list)
    cpu_s: float = 0.0

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
