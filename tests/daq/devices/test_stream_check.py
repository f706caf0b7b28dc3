"""Counts of damage and gaps while a stream passes."""

from __future__ import annotations

import struct
import threading
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.devices import stream_check
from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import CAN, SERIAL, Block
from recoil_acquisition.devices.opening import make_device
from recoil_acquisition.devices.stream_check import FramingCheck, can_counter_check
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.frames import can_rows as capture
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.decoder import FrameDecoder
from tests.builders import vendor_files as build
from tests.builders.can_rows import pack_row

FRAMING = framing_from_table(build.FRAMING)
DBC = build.DBC + '\nBO_ 512 NODE: 8 RIG\n SG_ n : 4|10@1+ (1,0) [0|0] "" RIG\n SG_ f : 32|32@1- (1,0) [0|0] "" RIG\n'


def blocks_of(stream: bytes, cuts: list[int]) -> list[Block]:
    places = sorted({0, len(stream), *(cut % (len(stream) + 1) for cut in cuts)})
    return [Block("imu", 10**9 + a, stream[a:b], SERIAL) for a, b in pairwise(places)]


@settings(max_examples=40, deadline=None)
@given(
    cuts=st.lists(st.integers(0, 10**6), max_size=30),
    lost=st.sets(st.integers(1, 58), max_size=6),
    spoilt=st.sets(st.integers(1, 58), max_size=4),
)
def test_frames_damage_and_gaps_are_counted_exactly(cuts: list[int], lost: set[int], spoilt: set[int]) -> None:
    frames = build.serial_frames(60)
    gone = sorted(lost | spoilt)
    stream = b"".join(
        frame[:5] + bytes([frame[5] ^ 1]) + frame[6:] if i in spoilt - lost else frame
        for i, frame in enumerate(frames)
        if i not in lost
    )
    check = FramingCheck(FRAMING)
    for block in blocks_of(stream, cuts):
        check.feed(block)
    assert check.bad == len(spoilt - lost)
    assert check.skipped_bytes == 16 * len(spoilt - lost)
    assert check.counter_gaps == sum(b - a > 1 for a, b in pairwise([i for i in range(60) if i not in gone]))


def test_a_framing_without_counter_counts_no_gaps() -> None:
    table = {key: value for key, value in build.FRAMING.items() if key != "counter"}
    check = FramingCheck(framing_from_table(table))
    for block in blocks_of(b"".join(build.serial_frames(9)) + b"x", []):
        check.feed(block)
    assert check.counter_gaps is None
    assert (check.bad, check.skipped_bytes) == (0, 0)


def test_the_thread_that_reads_does_not_wait_for_a_count_that_takes_long(monkeypatch) -> None:
    monkeypatch.setattr(stream_check, "_BATCH_BYTES", 1)
    decoding, go_on = threading.Event(), threading.Event()

    class Slow(FrameDecoder):
        def feed(self, data, now_s=None):
            decoding.set()
            assert go_on.wait(30)
            super().feed(data, now_s)

    monkeypatch.setattr(stream_check, "FrameDecoder", Slow)
    check = FramingCheck(FRAMING)
    frames = build.serial_frames(20)
    first = threading.Thread(target=check.feed, args=(Block("imu", 1, frames[0], SERIAL),))
    first.start()
    assert decoding.wait(30)
    for frame in frames[1:]:
        check.feed(Block("imu", 1, frame, SERIAL))
    go_on.set()
    first.join()
    assert (check.bad, check.skipped_bytes, check.counter_gaps) == (0, 0, 0)


@pytest.mark.real_time
@settings(max_examples=40, deadline=None)
@given(lost=st.sets(st.integers(1, 2998), max_size=20), size=st.integers(1, 700))
def test_gaps_of_a_message_counter_are_counted_over_its_wrap(lost: set[int], size: int) -> None:
    kept = [n for n in range(3000) if n not in lost]
    records = [
        pack_row(
            device_ns=0, host_ns=n, identifier=0x200, flags=0, data=struct.pack("<Q", (n % 1024) << 4 | 0xF << 14 | 3)
        )
        for n in kept
    ]
    foreign = pack_row(device_ns=0, host_ns=0, identifier=0x200, flags=capture.EXTENDED, data=bytes(8))
    check = can_counter_check("bus", ["NODE.n"], DBC, Path("rig.toml"))
    for at in range(0, len(records), size):
        check.feed(Block("bus", 0, foreign + b"".join(records[at : at + size]), CAN))
    assert check.counter_gaps == int((np.diff(kept) != 1).sum())
    assert check.skipped_bytes is None
    assert check.bad == 0


def test_a_counter_that_is_not_in_the_database_is_refused() -> None:
    table = {"interface": "virtual", "channel": "x"}
    with pytest.raises(DeviceError, match=r"no signal 'NODE.m'; found NODE.n"):
        make_device("bus", "can", table, DeviceDeclarations(database=DBC, counters=("NODE.m",)))
    device = make_device("bus", "can", table, DeviceDeclarations(database=DBC, counters=("NODE.n",)))
    assert device.counters.counter_gaps == 0
    without = make_device("bus", "can", table)
    assert without.counters.counter_gaps is None


def test_a_counter_that_is_a_float_is_refused() -> None:
    text = DBC + "\nSIG_VALTYPE_ 512 f : 1;\n"
    with pytest.raises(DeviceError, match="no whole number"):
        can_counter_check("bus", ["NODE.f"], text, Path("rig.toml"))
