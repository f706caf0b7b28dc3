from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.checksum import CHECKSUMS


@pytest.mark.parametrize("checksum", CHECKSUMS.values(), ids=lambda c: c.name)
def test_the_customary_check_value_is_met(checksum) -> None:  # type: ignore[no-untyped-def]  # the ids need no type
    assert checksum.of(b"123456789") == checksum.check
    assert 0 <= checksum.check < 256**checksum.size


def bit_by_bit(data: bytes, width: int, polynomial: int, value: int, *, reflected: bool) -> int:
    """The remainder as it is defined, one bit after the other (Rocksoft model)."""
    for byte in data:
        for bit in f"{byte:08b}"[::-1] if reflected else f"{byte:08b}":
            carried = value >> (width - 1) ^ int(bit)
            value = (value << 1 & (1 << width) - 1) ^ polynomial * carried
    return int(f"{value:0{width}b}"[::-1], 2) if reflected else value


@settings(max_examples=40, deadline=None)
@given(data=st.binary(max_size=60))
def test_crcs_are_remainders_bit_by_bit(data: bytes) -> None:
    for name, width, polynomial, initial, reflected in (
        ("crc8", 8, 0x07, 0, False), ("crc16-modbus", 16, 0x8005, 0xFFFF, True), ("crc16-xmodem", 16, 0x1021, 0, False),
        ("crc16-ccitt-false", 16, 0x1021, 0xFFFF, False), ("crc16-kermit", 16, 0x1021, 0, True),
    ):  # fmt: skip
        assert CHECKSUMS[name].of(data) == bit_by_bit(data, width, polynomial, initial, reflected=reflected), name
    assert CHECKSUMS["crc32"].of(data) == bit_by_bit(data, 32, 0x04C11DB7, 0xFFFFFFFF, reflected=True) ^ 0xFFFFFFFF


def test_a_negative_sum_completes_the_message_to_zero() -> None:
    data = bytes([0xFF, 0x36, 0x02, 0x10, 0x20])
    assert (sum(data) + CHECKSUMS["neg-sum8"].of(data)) % 256 == 0
