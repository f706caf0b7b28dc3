"""What is found in bytes of a port that no ready-made framing explains."""

from __future__ import annotations

import binascii
import struct
import tomllib
import zlib
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, UnknownFormatError
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.serial.raw_bytes import look_into, look_into_file
from recoil_acquisition.readers.table import BY_LAYOUT
from recoil_daq.recording.ingest import explained_reader_of
from tests.builders.serial_packets import witmotion_frame
from tests.builders.shared_data import shared_file

RNG = np.random.default_rng(11)
NOISE = RNG.integers(0, 256, 40000, dtype=np.uint8).tobytes()


def body(i: int) -> bytes:
    return b"\xaa\x55\x10" + struct.pack("<H3h", i, *RNG.integers(-300, 300, 3).tolist())


BODIES = [body(i) for i in range(300)]
LONGER = [b"\xa5\x5a" + bytes([n]) + RNG.bytes(n) for n in RNG.integers(4, 30, 300).tolist()]


def stuffed(packet: bytes) -> bytes:
    """Return a packet by the definition of COBS: each code says how far the next zero is."""
    return b"".join(bytes([len(part) + 1]) + part for part in packet.split(b"\0")) + b"\0"


SENTENCES = [b"GPVTG,%d.5,T,%d,M" % (i, 2 * i) for i in range(60)]


@pytest.mark.parametrize(
    ("stream", "frames", "table"),
    [
        (
            b"".join(one + struct.pack("<I", zlib.crc32(one)) for one in BODIES),
            300,
            {"kind": "sync", "sync": "AA 55 10", "length": {"fixed": 15},
             "checksum": {"algo": "crc32", "order": "little"}},
        ),
        (
            b"".join(one + struct.pack(">H", binascii.crc_hqx(one[2:], 0xFFFF)) for one in BODIES)[9:],
            299,
            {"kind": "sync", "sync": "AA 55 10", "length": {"fixed": 13},
             "checksum": {"algo": "crc16-ccitt-false", "from": 2, "order": "big"}},
        ),
        (
            b"".join(one + bytes([sum(one[2:]) & 0xFF]) for one in LONGER),
            300,
            {"kind": "sync", "sync": "A5 5A", "length": {"at": 2, "type": "u8", "add": 4},
             "checksum": {"algo": "sum8", "from": 2}},
        ),
        (
            b"".join(stuffed(one + struct.pack("<I", zlib.crc32(one))) for one in BODIES),
            299,
            {"kind": "cobs", "checksum": {"algo": "crc32", "order": "little"}},
        ),
        (
            b"".join(b"$%b*%02X\r\n" % (one, reduce(lambda a, c: a ^ c, one)) for one in SENTENCES),
            60,
            {"kind": "delimiter", "start": "$", "checksum": {"algo": "xor8", "from": 1}},
        ),
    ],
    ids=["fixed length", "opened within a frame", "length stated", "cobs", "sentences"],
)  # fmt: skip
def test_frames_of_an_unknown_device_are_found_by_their_checksum(
    stream: bytes, frames: int, table: dict[str, Any]
) -> None:
    held = look_into(stream)
    (fits,) = held.framings
    assert fits.table == table
    assert not fits.is_ready_made
    assert fits.frames >= frames
    assert tomllib.loads(str(fits)) == {"framing": table}
    field = {"name": "first", "at": 1} if table["kind"] == "delimiter" else {"name": "first", "at": 0, "type": "u8"}
    assert find_frames(framing_from_table({**table, "fields": [field]}), stream).begins.size == fits.frames
    assert f"{fits.frames} good frames of" in held.found
    assert held.marks == ()


def test_frames_without_a_checksum_are_told_by_their_mark() -> None:
    held = look_into(NOISE[:50] + b"".join(BODIES))
    assert held.framings == ()
    assert str(held.marks[0]) == "300 times AA 55 10, 11 bytes from one to the next in 100 %"
    assert held.found.startswith("no framing that fits, but 300 times AA 55 10")


@pytest.mark.parametrize(
    "stream",
    [b"", b"\0", NOISE, bytes(5000), b"\xfa" * 5000, b"time,ax,p\r\n" * 400, b"one line of words\n" * 300],
    ids=["nothing", "one byte", "noise", "zeros", "one byte again and again", "headings", "words"],
)
def test_of_bytes_without_an_order_nothing_is_said(stream: bytes) -> None:
    held = look_into(stream)
    assert (held.framings, held.marks, held.found) == ((), (), "")


def test_a_framing_that_is_ready_made_comes_first() -> None:
    held = look_into(b"".join(witmotion_frame(0x51 + i % 3, i, -i, 2 * i, 100) for i in range(60)))
    assert [one.table for one in held.framings] == [{"ready_made": "witmotion"}]
    assert held.found == "60 good frames of witmotion, 100 % of the bytes"


def test_a_generated_stream_of_another_maker_is_found_by_its_checksum() -> None:
    held = look_into_file(shared_file("serial/generated/cobs_crc16_u32_6f.bin"))
    assert held is not None
    (fits,) = held.framings
    assert fits.table == {"kind": "cobs", "checksum": {"algo": "crc16-xmodem", "order": "little"}}
    assert fits.frames == 1498  # of 1,500, one is missing and one is damaged


def test_what_was_found_stands_in_the_errors(tmp_path: Path) -> None:
    path = tmp_path / "imu.raw"
    path.write_bytes(b"".join(one + struct.pack("<I", zlib.crc32(one)) for one in BODIES))
    with pytest.raises(UnknownFormatError) as unknown:
        explained_reader_of(path, None)
    assert "found 300 good frames of 15 bytes behind AA 55 10 with the checksum crc32" in str(unknown.value)
    assert '`kind = "serial"`, `match = "*.raw"` and `framing = { kind = "sync", sync = "AA 55 10"' in str(
        unknown.value
    )
    assert "with the `fields` that the device's manual tells" in str(unknown.value)
    with pytest.raises(CorruptFileError, match="not one frame fits") as wrong:
        BY_LAYOUT["serial"].open(path, Declarations("imu", framing={"ready_made": "xsens-mti"}))
    assert "found 300 good frames of 15 bytes behind AA 55 10" in str(wrong.value)
    path.write_bytes(b"".join(BODIES))
    with pytest.raises(UnknownFormatError) as marked:
        explained_reader_of(path, None)
    assert "found no framing that fits, but 300 times AA 55 10, 11 bytes from one to the next" in str(marked.value)
    assert "the `framing` that the device's manual tells" in str(marked.value)
    assert look_into_file(tmp_path / "none.bin") is None
