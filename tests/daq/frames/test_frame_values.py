from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.frame_set import FrameSet
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import decode_fields, gaps, unwrap
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import FRAMING, serial_frames

RANGES = {"u8": (0, 2**8 - 1), "i8": (-(2**7), 2**7 - 1), "u16": (0, 2**16 - 1), "i16": (-(2**15), 2**15 - 1)}
RANGES |= {"u24": (0, 2**24 - 1), "i24": (-(2**23), 2**23 - 1), "u32": (0, 2**32 - 1), "i32": (-(2**31), 2**31 - 1)}


@pytest.mark.exhaustive
@settings(max_examples=120, deadline=None)
@given(kind=st.sampled_from(list(RANGES)), endian=st.sampled_from(["little", "big"]), data=st.data())
def test_whole_numbers_of_every_type_are_read(kind: str, endian: str, data: st.DataObject) -> None:
    numbers = data.draw(st.lists(st.integers(*RANGES[kind]), min_size=1, max_size=5))
    size = int(kind[1:]) // 8
    table = {"kind": "sync", "sync": "AA", "length": {"fixed": 2 + size}, "endian": endian}
    framing = framing_from_table(
        {**table, "fields": [{"name": "a", "at": 2, "type": kind, "scale": 0.5, "offset": 3.0}]}
    )
    stream = b"".join(b"\xaa\0" + n.to_bytes(size, endian, signed=kind[0] == "i") for n in numbers)  # type: ignore[arg-type]  # a literal
    series = decode_fields(framing, find_frames(framing, stream))["a"]
    assert series.raw.tolist() == numbers
    np.testing.assert_array_equal(series.values, 0.5 * np.array(numbers) + 3.0)


@pytest.mark.parametrize(("kind", "code"), [("f32", "f"), ("f64", "d")])
@pytest.mark.parametrize(("endian", "mark"), [("little", "<"), ("big", ">")])
def test_floats_are_read(kind: str, code: str, endian: str, mark: str) -> None:
    size = struct.calcsize(code)
    fields = [{"name": "a", "at": 1, "type": kind, "endian": endian}]
    framing = framing_from_table({"kind": "sync", "sync": "AA", "length": {"fixed": 1 + size}, "fields": fields})
    stream = b"".join(b"\xaa" + struct.pack(mark + code, v) for v in (1.5, -2621440.0))
    assert decode_fields(framing, find_frames(framing, stream))["a"].raw.tolist() == [1.5, -2621440.0]


MIP: dict[str, Any] = {
    "kind": "sync",
    "sync": "75 65",
    "length": {"at": 3, "type": "u8", "add": 6},
    "max": 261,
    "endian": "big",
    "checksum": {"algo": "fletcher16", "from": 0, "order": "big"},
    "frames": [
        {
            "when": {"at": 2, "equals": 0x80},
            "tlv": {"from": 4, "len": "u8", "len_includes": 2, "id": "u8"},
            "fields": [
                {"name": "ax", "id": 4, "type": "f32", "scale": 9.80665, "unit": "m/s2"},
                {"name": "gz", "id": 5, "at": 8, "type": "f32", "unit": "rad/s"},
            ],
        }
    ],
}
XBUS: dict[str, Any] = {
    "kind": "sync",
    "sync": "FA FF 36",
    "length": {"at": 3, "type": "u8", "add": 5},
    "max": 260,
    "endian": "big",
    "checksum": {"algo": "neg-sum8", "from": 1},
    "tlv": {"from": 4, "id": "u16", "len": "u8", "id_first": True},
    "fields": [
        {"name": "packet_counter", "id": 0x1020, "type": "u16"},
        {"name": "sample_time", "id": 0x1060, "type": "u32"},
    ],
}


def mip(elements: bytes, kind: int = 0x80) -> bytes:
    framing = framing_from_table(MIP)
    assert framing.checksum is not None
    body = bytes([0x75, 0x65, kind, len(elements)]) + elements
    return body + framing.checksum.algorithm.of(body).to_bytes(2, "big")


def test_elements_are_found_by_identifier_wherever_they_stand() -> None:
    accel = bytes([14, 4]) + struct.pack(">3f", 1.0, 2.0, 3.0)
    gyro = bytes([14, 5]) + struct.pack(">3f", 4.0, 5.0, 6.0)
    short, broken = bytes([6, 5]) + bytes(4), bytes([200, 4]) + bytes(4)
    stream = (
        mip(accel + gyro) + mip(gyro) + mip(gyro + accel) + mip(short + accel) + mip(broken) + mip(accel, kind=0x81)
    )
    framing = framing_from_table(MIP)
    frames = find_frames(framing, stream)
    series = decode_fields(framing, frames)
    assert series["ax"].frames.tolist() == [0, 2, 3]
    np.testing.assert_allclose(series["ax"].values, 9.80665)
    assert series["gz"].frames.tolist() == [0, 1, 2]
    assert series["gz"].values.tolist() == [6.0, 6.0, 6.0]
    assert frames.counters.unknown_types == 1


def test_frames_are_told_apart_by_their_selector() -> None:
    framing = framing_from_table(
        {
            "kind": "sync",
            "sync": "55",
            "length": {"fixed": 4},
            "frames": [
                {"when": {"at": 1, "equals": "51"}, "fields": [{"name": "a", "at": 2, "type": "u8"}]},
                {"when": {"at": 1, "equals": 0x52}, "fields": [{"name": "b", "at": 3, "type": "u8"}]},
            ],
        }
    )
    series = decode_fields(
        framing, find_frames(framing, bytes([0x55, 0x51, 7, 8, 0x55, 0x52, 9, 10, 0x55, 0x53, 1, 2]))
    )
    assert (series["a"].frames.tolist(), series["a"].raw.tolist()) == ([0], [7])
    assert (series["b"].frames.tolist(), series["b"].raw.tolist()) == ([1], [10])


def test_lines_of_several_kinds_are_told_apart() -> None:
    framing = framing_from_table(
        {
            "kind": "delimiter",
            "frames": [
                {"when": {"at": 0, "equals": "A"}, "fields": [{"name": "a", "at": 1}]},
                {"when": {"at": 0, "equals": "B"}, "fields": [{"name": "b", "at": 2, "scale": 2.0}]},
            ],
        }
    )
    series = decode_fields(framing, find_frames(framing, b"A,1\nB,x,2\nC\nA,3\n"))
    assert series["a"].raw.tolist() == [1.0, 3.0]
    assert series["b"].values.tolist() == [4.0]


def test_a_field_beyond_a_frame_of_variable_length_is_not_held() -> None:
    framing = framing_from_table(
        {
            "kind": "sync",
            "sync": "AA",
            "length": {"at": 1, "type": "u8"},
            "fields": [{"name": "a", "at": 3, "type": "u16"}],
        }
    )
    frames = FrameSet(
        bytes([0xAA, 4, 0, 1, 0xAA, 5, 0, 1, 2]),
        np.array([0, 4]),
        np.array([4, 5]),
        np.array([4, 9]),
        find_frames(framing, b"").counters,
    )
    series = decode_fields(framing, frames)["a"]
    assert (series.frames.tolist(), series.raw.tolist()) == ([1], [0x0201])


@settings(max_examples=80, deadline=None)
@given(steps=st.lists(st.integers(-20, 40), max_size=60), first=st.integers(0, 255))
def test_unwrapping_gives_the_steps_back(steps: list[int], first: int) -> None:
    counts = first + np.r_[0, np.cumsum(steps)].astype(np.int64)
    np.testing.assert_array_equal(unwrap(counts % 256, 256), counts - first)
    np.testing.assert_array_equal(unwrap(counts, 0), counts - first)


def test_gaps_and_missing_frames_are_counted_over_the_wrap() -> None:
    assert gaps(np.array([254, 255, 0, 1, 5, 6, 6, 7]), 256) == (2, 3)
    assert gaps(np.zeros(0, dtype=np.int64), 256) == (0, 0)


def test_the_bundled_framing_is_decoded() -> None:
    framing = framing_from_table(FRAMING)
    series = decode_fields(framing, find_frames(framing, b"".join(serial_frames(40))))
    np.testing.assert_allclose(series["gyro"].values, 0.01 * np.arange(40), rtol=1e-6)
    np.testing.assert_allclose(series["temperature"].values, 21.5)


def test_a_real_mip_stream_is_framed_completely() -> None:
    framing = framing_from_table(MIP)
    frames = find_frames(framing, shared_file("serial/mip_data.bin").read_bytes())
    assert frames.counters.received == 8384
    assert (frames.counters.bad_checksum, frames.counters.skipped_bytes) == (0, 0)
    assert np.median(np.abs(decode_fields(framing, frames)["ax"].values)) < 20.0


@pytest.mark.parametrize("number", [1, 2, 3])
def test_real_xbus_messages_are_framed_completely_though_their_clock_steps(number: int) -> None:
    framing = framing_from_table(XBUS)
    frames = find_frames(framing, shared_file(f"serial/output{number}.bin").read_bytes())
    series = decode_fields(framing, frames)
    assert (frames.counters.received, frames.counters.skipped_bytes) == (100, 0)
    assert gaps(series["packet_counter"].raw, 65536) == (0, 0)
    assert np.diff(unwrap(series["sample_time"].raw, 2**32)).min() < 0


def test_a_real_card_log_with_foreign_text_is_framed() -> None:
    fields = [{"name": "t", "at": 6, "type": "u32"}]
    table = {"kind": "sync", "sync": "FA 14 3E 00 3A 00", "length": {"fixed": 124}, "fields": fields}
    framing = framing_from_table({**table, "checksum": {"algo": "crc16-xmodem", "from": 1, "order": "big"}})
    frames = find_frames(framing, shared_file("serial/vn100_F00379.bin").read_bytes())
    assert (frames.counters.received, frames.counters.bad_checksum) == (8895, 2)


def test_the_generated_streams_agree_with_their_truth() -> None:
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    lines = framing_from_table(
        {
            "kind": "delimiter",
            "start": "$",
            "checksum": {"algo": "xor8", "from": 1},
            "fields": [{"name": "ax", "at": 4, "unit": "m/s2"}],
        }
    )
    frames = find_frames(lines, shared_file("serial/generated/vn100_ascii_VNIMU.txt").read_bytes())
    assert (frames.counters.received, frames.counters.bad_checksum) == (298, 2)
    framing = framing_from_table(MIP)
    frames = find_frames(framing, shared_file("serial/generated/mip_0x80_04_05.bin").read_bytes())
    np.testing.assert_allclose(decode_fields(framing, frames)["ax"].values, truth["ax"], atol=2e-5)
    csv = framing_from_table({"kind": "delimiter", "comment": "#", "fields": [{"name": "p", "at": 4}]})
    frames = find_frames(csv, shared_file("serial/generated/csv_lines.txt").read_bytes())
    np.testing.assert_allclose(decode_fields(csv, frames)["p"].values, truth["p"][::2][: frames.ends.size], atol=0.006)
