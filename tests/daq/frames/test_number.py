from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.field import TYPE_SIZES, Field
from recoil_acquisition.frames.number import number_at, numbers_at
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import decode_fields
from tests.builders.serial_packets import cobs

WHOLE = [type_ for type_ in TYPE_SIZES if type_[0] in "ui"]


@pytest.mark.exhaustive
@settings(max_examples=300, deadline=None)
@given(type_=st.sampled_from(list(TYPE_SIZES)), big_endian=st.booleans(), data=st.data())
def test_one_number_and_many_are_read_alike(type_: str, *, big_endian: bool, data: st.DataObject) -> None:
    size = TYPE_SIZES[type_]
    bits = None
    if type_ in WHOLE and data.draw(st.booleans()):
        lowest = data.draw(st.integers(0, 8 * size - 1))
        bits = lowest, data.draw(st.integers(1, min(63, 8 * size - lowest)))
    field = Field("a", 0, type_, big_endian, bits=bits)
    buffer = data.draw(st.binary(min_size=3 * size, max_size=3 * size))
    for at, many in zip((0, size, 2 * size), numbers_at(buffer, np.arange(3) * size, field), strict=True):
        one = number_at(buffer, at, field)
        if type_ == "u64" and bits is None and one >= 2**63:
            assert many < 0
        else:
            assert many == one or (math.isnan(one) and math.isnan(many))


@pytest.mark.exhaustive
@settings(max_examples=200, deadline=None)
@given(type_=st.sampled_from(WHOLE), data=st.data())
def test_a_slice_of_bits_is_the_shifted_number(type_: str, data: st.DataObject) -> None:
    size = TYPE_SIZES[type_]
    lowest = data.draw(st.integers(0, 8 * size - 1))
    count = data.draw(st.integers(1, min(63, 8 * size - lowest)))
    low, high = (-(2 ** (count - 1)), 2 ** (count - 1) - 1) if type_[0] == "i" else (0, 2**count - 1)
    value = data.draw(st.integers(low, high))
    others = data.draw(st.integers(0, 2 ** (8 * size) - 1)) & ~(((1 << count) - 1) << lowest)
    stored = (others | (value & ((1 << count) - 1)) << lowest).to_bytes(size, "little")
    assert number_at(stored, 0, Field("a", 0, type_, bits=(lowest, count))) == value


def test_the_fixed_point_number_of_48_bits_has_its_fraction_first() -> None:
    stored = struct.pack(">Ih", 0x80000000, -3) + struct.pack(">Ih", 1, 9)
    field = Field("a", 0, "fp1632", big_endian=True)
    assert numbers_at(stored, np.array([0, 6]), field).tolist() == [-2.5, 9 + 2.0**-32]


def test_arrays_follow_each_other_under_their_names() -> None:
    table = {"kind": "fixed", "length": {"fixed": 10}}
    fields = [
        {"name": ["x", "y", "z"], "at": 0, "type": "i16", "scale": 0.5, "unit": "m"},
        {"name": "d", "at": 6, "type": "u16", "count": 2},
    ]
    framing = framing_from_table({**table, "fields": fields})
    series = decode_fields(framing, find_frames(framing, struct.pack("<3h2H", 1, -2, 3, 4, 5)))
    assert {name: s.values.tolist() for name, s in series.items()} == {
        "x": [0.5],
        "y": [-1.0],
        "z": [1.5],
        "d_0": [4.0],
        "d_1": [5.0],
    }
    assert series["y"].field.unit == "m"


def test_arrays_of_cells_follow_each_other_in_a_line() -> None:
    framing = framing_from_table({"kind": "delimiter", "fields": [{"name": ["x", "y"], "at": 1}]})
    series = decode_fields(framing, find_frames(framing, b"7,1,2\n8,3,4\n"))
    assert (series["x"].raw.tolist(), series["y"].raw.tolist()) == ([1.0, 3.0], [2.0, 4.0])


@pytest.mark.parametrize("count", [1, 30, 500])
def test_elements_of_many_layouts_are_all_read(count: int) -> None:
    framing = framing_from_table(
        {
            "kind": "cobs",
            "tlv": {"from": 0, "len": "u8", "id": "u8"},
            "fields": [{"name": "a", "id": 1, "type": "u8"}, {"name": "b", "id": 2, "at": 1, "type": "u8"}],
        }
    )
    rng = np.random.default_rng(count)
    stream, a, b = b"", [], []
    for i in range(count):
        packet = b"".join(bytes([size, 9]) + b"\7" * size for size in rng.integers(0, 5, size=3))
        packet += bytes([2, 2, 7, i % 250 + 1]) if i % 3 else bytes([1, 2, 7])
        packet += bytes([1, 1, i % 251 + 1]) if i % 2 else b""
        packet += bytes([1, 1, 99]) + bytes([50, 1])
        a.append(i % 251 + 1 if i % 2 else 99)
        b += [(i, i % 250 + 1)] if i % 3 else []
        stream += cobs(packet)
    series = decode_fields(framing, find_frames(framing, stream))
    assert series["a"].raw.tolist() == a
    assert list(zip(series["b"].frames.tolist(), series["b"].raw.tolist(), strict=True)) == b
