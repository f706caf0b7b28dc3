from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.byte_stuffing import (
    decode_cobs,
    decode_slip,
    longest_packet,
)
from tests.builders.serial_packets import cobs, slip


@pytest.mark.exhaustive
@settings(max_examples=200, deadline=None)
@given(
    st.one_of(st.binary(max_size=40), st.lists(st.sampled_from([0, 1, 0xC0, 0xDB, 0xDC, 0xDD]), max_size=40).map(bytes))
)
def test_what_was_stuffed_is_undone(data: bytes) -> None:
    assert decode_cobs(cobs(data)[:-1]) == data
    assert decode_slip(slip(data)[:-1]) == data
    assert len(cobs(data)) - 1 <= longest_packet("cobs", len(data))
    assert len(slip(data)) - 1 <= longest_packet("slip", len(data))


@pytest.mark.parametrize("size", [253, 254, 255, 508, 509, 762])
def test_long_blocks_without_a_zero_are_undone(size: int) -> None:
    for data in (b"\x07" * size, b"\x07" * size + b"\0", b"\0" + b"\x07" * size):
        packet = cobs(data)
        assert 0 not in packet[:-1]
        assert decode_cobs(packet[:-1]) == data
        assert len(packet) - 1 <= longest_packet("cobs", len(data))


def test_the_papers_rule_is_met_byte_for_byte() -> None:
    assert decode_cobs(bytes.fromhex("0311220233")) == bytes.fromhex("11220033")
    assert decode_cobs(bytes.fromhex("0101")) == b"\0"
    assert decode_slip(bytes.fromhex("01dbdcdbdd02")) == bytes.fromhex("01c0db02")


@pytest.mark.parametrize("packet", ["05112233", "0211000233", "ff01"])
def test_a_code_that_points_beyond_the_packet_is_damage(packet: str) -> None:
    assert decode_cobs(bytes.fromhex(packet)) is None


@pytest.mark.parametrize("packet", ["db", "01db", "dbdb", "db01", "dbdcdb"])
def test_an_escape_of_nothing_is_damage(packet: str) -> None:
    assert decode_slip(bytes.fromhex(packet)) is None
