"""What only the screen shows of a recorder is right although most of its stream is not looked at."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.devices.described import described_events
from recoil_acquisition.devices.device import STREAM, Block
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel
from recoil_acquisition.trigger import Edge, Trigger
from recoil_rigs.twin.oxygen_packets import WireChannel, channel_info, data_part, packet, raw_of, xml_part
from tests.builders.live_sources import port, serial_block, serial_frame

TRIGGER = Trigger((Edge("rate", 50.0, 20.0),), pre_s=0.2, post_s=0.3)
RATE_HZ = 1000.0
RECORDER = LiveSource(
    "daq", "dewetron", {"oxygen": "127.0.0.1"}, (LiveChannel("pressure", "p", 1.0, 0.0, "Pa"),)
)  # fmt: skip


def block(k: int, *parts: bytes, seed: int = 7) -> Block:
    return Block("daq", 10**10 + k * 10_000_000, packet(k, seed, parts), STREAM)


def test_a_new_factor_that_was_said_while_nobody_looked_holds_for_what_is_shown() -> None:
    engine = CaptureEngine([RECORDER, port()], TRIGGER)
    shown: list[float] = []
    for k in range(300):
        factor = 1.0 if k < 150 else 2.0
        wire = WireChannel("p", "Pa", factor, 1.0)
        at_ns = 10**10 + k * 10_000_000
        if k in (0, 150):  # between two looks
            engine.take(block(k, xml_part(channel_info([wire]))))
        elif k % 20 == 5:
            said = TickChannel("p", "Pa", Fraction(1000), 1, factor, 1.0)
            for event in described_events("daq", at_ns, StreamDescription((said,))):
                engine.take(event)
        engine.take(block(k, data_part(wire, raw_of(np.full(10, 100.0), "f32"), 10 * k, RATE_HZ, "f32")))
        engine.take(serial_block(at_ns / 1e9, serial_frame(k, 1.0)))
        if (level := engine.level("pressure", at_ns / 1e9)) is not None:
            shown.append(level.last)
    assert {*shown} == {101.0, 201.0}
    # at the latest with the next event, but for the first half second of a clock, in which nothing is shown anew
    assert shown.count(101.0) == pytest.approx(150 - 51 + 80, abs=30)
