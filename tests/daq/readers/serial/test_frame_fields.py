"""Numbers that are found in frames of an unknown layout: where they stand, of what type, and nothing where none are."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import decode_fields
from recoil_acquisition.readers.serial.frame_fields import find_fields
from recoil_acquisition.readers.serial.raw_bytes import look_into

RNG = np.random.default_rng(4)
COUNT = 400
VALUES = np.cumsum(RNG.standard_normal((COUNT, 2)), axis=0).astype(np.float32)


def stream(order: str, *, counter: str = "H", first: int = 65500, lost: tuple[int, ...] = ()) -> bytes:
    """Write frames: mark, counter, clock in microseconds, two values, two bytes of nothing, CRC."""
    sign = {"little": "<", "big": ">"}[order]
    frames = []
    for k in range(COUNT):
        number = (first + k) % (1 << (8 * struct.calcsize(counter)))
        body = struct.pack(f"{sign}{counter}Iff", number, 4_294_900_000 + 1000 * k & 0xFFFFFFFF, *VALUES[k]) + b"\0\0"
        whole = b"\xaa\x55" + body
        frames.append(whole + CHECKSUMS["crc16-ccitt-false"].of(body).to_bytes(2, order))
    return b"".join(one for k, one in enumerate(frames) if k not in lost)


@pytest.mark.parametrize(
    ("order", "counter", "size"),
    # the zeros with which a long counter begins in the other order are bytes of the mark
    [("little", "H", 2), ("big", "H", 2), ("little", "B", 1), ("big", "B", 1), ("little", "I", 4)],
)
def test_counter_clock_and_values_are_found(order: str, counter: str, size: int) -> None:
    content = stream(order, counter=counter, lost=(50, 200))
    raw = look_into(content).framings[0]
    found = find_fields(raw.table, content, duration_s=0.401)
    assert found is not None
    assert (found.counter, found.clock, found.tick_s) == ("counter", "device_time", 1e-6)
    at = 2 + size
    assert found.values == (f"f32_at_{at + 4}", f"f32_at_{at + 8}")
    framing = framing_from_table(found.framing)
    series = {one.field.name: one for one in decode_fields(framing, find_frames(framing, content)).values()}
    kept = np.delete(VALUES, (50, 200), axis=0)
    assert np.array_equal(series[found.values[1]].values, kept[:, 1].astype(np.float64))


def whole_numbers(order: str) -> tuple[bytes, np.ndarray]:
    """Write frames: mark, length, counter, a zero, clock, a state, three whole numbers, one that stays zero, CRC."""
    sign = {"little": "<", "big": ">"}[order]
    numbers = np.cumsum(RNG.integers(-400, 401, (COUNT, 3)), axis=0) + 200
    frames = [
        struct.pack(f"{sign}BBBIB4h", 20, k % 256, 0, 5_000_000 + 1000 * k, 7, *numbers[k].tolist(), 0)
        for k in range(COUNT)
    ]
    whole = (b"\xa5\x5a" + one + CHECKSUMS["crc16-ccitt-false"].of(one).to_bytes(2, order) for one in frames)
    return b"".join(whole), numbers


@pytest.mark.parametrize("order", ["little", "big"])
def test_whole_numbers_of_two_bytes_are_found_with_their_byte_order(order: str) -> None:
    content, numbers = whole_numbers(order)
    found = find_fields(look_into(content).framings[0].table, content)
    assert found is not None
    assert (found.framing["endian"], found.values) == (order, ())
    assert found.counts == ("i16_at_10", "i16_at_12", "i16_at_14")
    # the zero beside it is no part of the counter, nor the state of the first number
    assert found.framing["counter"] == {"field": "counter", "modulo": 256}
    assert found.found == f"3 whole numbers of 16 bits, {order} endian, in each frame, a counter, the device's clock"
    framing = framing_from_table(found.framing)
    series = {one.field.name: one for one in decode_fields(framing, find_frames(framing, content)).values()}
    assert np.array_equal(series["i16_at_12"].values, numbers[:, 1])
    assert np.array_equal(np.diff(series["device_time"].values), np.full(COUNT - 1, 1000.0))


@pytest.mark.parametrize("order", ["little", "big"])
def test_whole_numbers_of_three_and_four_bytes_are_found(order: str) -> None:
    numbers = np.cumsum(RNG.integers(-9000, 9001, (COUNT, 2)), axis=0) + np.array([150_000, -90_000])
    frames = [
        bytes([20, k % 256]) + int(a).to_bytes(4, order, signed=True) + b"\x07" + int(b).to_bytes(3, order, signed=True)
        for k, (a, b) in enumerate(numbers.tolist())
    ]
    content = b"".join(b"\xa5\x5a" + one + CHECKSUMS["crc16-ccitt-false"].of(one).to_bytes(2, order) for one in frames)
    found = find_fields(look_into(content).framings[0].table, content)
    assert found is not None
    assert (found.framing["endian"], found.counts) == (order, ("i32_at_4", "i24_at_9"))
    assert f"1 whole numbers of 24 bits, {order} endian, and 1 whole numbers of 32 bits" in found.found
    framing = framing_from_table(found.framing)
    series = {one.field.name: one for one in decode_fields(framing, find_frames(framing, content)).values()}
    assert np.array_equal(series["i32_at_4"].values, numbers[:, 0])
    assert np.array_equal(series["i24_at_9"].values, numbers[:, 1])


def test_a_counter_and_a_clock_that_are_not_there_are_said() -> None:
    values = np.cumsum(RNG.standard_normal((COUNT, 2)), axis=0).astype(np.float32)
    bodies = [one.tobytes() for one in values]
    content = b"".join(b"\xaa\x55" + one + CHECKSUMS["crc16-xmodem"].of(one).to_bytes(2, "big") for one in bodies)
    found = find_fields(look_into(content).framings[0].table, content)
    assert found is not None
    assert found.found == "2 floating-point values in each frame, no counter, no clock of the device"


def test_without_the_hosts_times_the_tick_is_not_known() -> None:
    content = stream("little")
    found = find_fields(look_into(content).framings[0].table, content)
    assert found is not None
    assert (found.clock, found.tick_s) == ("device_time", None)
    assert "device_time" not in found.framing


def test_bytes_that_are_no_numbers_make_no_fields() -> None:
    frames = []
    for _ in range(COUNT):
        body = RNG.integers(0, 256, 16, dtype=np.uint8).tobytes()
        frames.append(b"\xaa\x55" + body + CHECKSUMS["crc16-xmodem"].of(body).to_bytes(2, "little"))
    content = b"".join(frames)
    assert find_fields(look_into(content).framings[0].table, content) is None


def test_a_handful_of_frames_is_not_enough() -> None:
    content = stream("little")
    table = look_into(content).framings[0].table
    assert find_fields(table, content[: 20 * 10]) is None
