from __future__ import annotations

import binascii
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.checksum import CHECKSUMS


@pytest.mark.parametrize("checksum", CHECKSUMS.values(), ids=lambda c: c.name)
def test_the_customary_check_value_is_met(checksum) -> None:  # type: ignore[no-untyped-def]  # the ids need no type
    assert checksum.of(b"123456789") == checksum.check
    assert 0 <= checksum.check < 256**checksum.size


@pytest.mark.parametrize("checksum", CHECKSUMS.values(), ids=lambda c: c.name)
@settings(max_examples=40, deadline=None)
@given(data=st.binary(min_size=0, max_size=60), count=st.integers(1, 3))
def test_rows_give_the_same_as_bytes(checksum, data: bytes, count: int) -> None:  # type: ignore[no-untyped-def]  # as above
    rows = np.frombuffer(data * count, dtype=np.uint8).reshape(count, len(data))
    assert checksum.of_rows(rows).tolist() == [checksum.of(data)] * count


@settings(max_examples=60, deadline=None)
@given(data=st.binary(max_size=200))
def test_the_standard_librarys_crcs_agree(data: bytes) -> None:
    assert CHECKSUMS["crc32"].of(data) == zlib.crc32(data)
    assert CHECKSUMS["crc16-xmodem"].of(data) == binascii.crc_hqx(data, 0)
    assert CHECKSUMS["crc16-ccitt-false"].of(data) == binascii.crc_hqx(data, 0xFFFF)


def test_a_negative_sum_completes_the_message_to_zero() -> None:
    data = bytes([0xFF, 0x36, 0x02, 0x10, 0x20])
    assert (sum(data) + CHECKSUMS["neg-sum8"].of(data)) % 256 == 0
