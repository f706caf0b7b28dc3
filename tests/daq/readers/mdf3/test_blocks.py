"""Blocks and fields that end with the file, and those that would end behind it."""

from __future__ import annotations

import struct

import pytest

from recoil_acquisition.readers.mdf.channel_groups import MdfDamageError
from recoil_acquisition.readers.mdf3.groups import OldBlocks
from tests.builders.mdf3_files import OldFile


def test_fields_may_end_with_the_file_and_not_behind_it() -> None:
    content = bytes(OldFile().closed(0))
    end, blocks = len(content), OldBlocks(content)
    assert blocks.unpacked("2I", end - 8) == struct.unpack_from("<2I", content, end - 8)
    with pytest.raises(MdfDamageError, match=f"fields at byte {end - 7} lie beyond its {end} bytes"):
        blocks.unpacked("2I", end - 7)


def test_a_block_may_end_with_the_file_and_not_behind_it() -> None:
    content = bytearray(OldFile().closed(0))
    at = len(content)
    content += b"TX" + struct.pack("<H", 10) + b"speed\0"
    assert OldBlocks(bytes(content)).block(at, "TX") == (10, ())
    assert OldBlocks(bytes(content)).text(at) == "speed"
    with pytest.raises(MdfDamageError, match=f"the block at byte {at} has no 10 bytes: 4 to 9"):
        OldBlocks(bytes(content[:-1])).block(at, "TX")
