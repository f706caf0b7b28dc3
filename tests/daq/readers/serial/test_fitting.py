"""Bytes that nothing explains are tried with the ready-made framings; what fits is named as a rig file writes it."""

from __future__ import annotations

import binascii
import struct
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, UnknownFormatError
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.serial import fitting
from recoil_acquisition.readers.serial.fitting import fitting_framings
from recoil_acquisition.readers.table import BY_LAYOUT
from recoil_daq.recording.ingest import explained_reader_of
from tests.builders.serial_packets import witmotion_frame
from tests.builders.shared_data import shared_file

NOISE = np.random.default_rng(5).integers(0, 256, 4000, dtype=np.uint8).tobytes()


def vectornav(header: str, count: int, floats: int) -> bytes:
    """Return messages of a VectorNav with so many numbers; the checksum is Python's own."""
    frames = b""
    for i in range(count):
        body = bytes.fromhex(header)[1:] + struct.pack(f"<{floats}f", *(0.1 * i + k for k in range(floats)))
        frames += b"\xfa" + body + struct.pack(">H", binascii.crc_hqx(body, 0))
    return frames


def lines(count: int) -> bytes:
    return "".join(f"{i},{0.5 * i:.2f},{-i}\r\n" for i in range(count)).encode()


WIT = b"".join(witmotion_frame(0x51 + i % 3, i, -i, 2 * i, 100) for i in range(60))


@pytest.mark.parametrize(
    ("stream", "table"),
    [
        (vectornav("FA 01 20 01", 40, 6), {"ready_made": "vectornav-vn100-binary", "header": "FA 01 20 01"}),
        (
            b"S,Booting!\r\n" + vectornav("FA 04 04 00", 40, 3),
            {"ready_made": "vectornav-vn100-binary", "header": "FA 04 04 00"},
        ),
        (WIT, {"ready_made": "witmotion"}),
        (b"7.5,-3\r\n" + lines(30), {"ready_made": "csv-lines", "columns": ["column_1", "column_2", "column_3"]}),
    ],
    ids=["vectornav", "vectornav after text", "witmotion", "lines"],
)
def test_the_framing_that_fits_is_found_with_its_parameters(stream: bytes, table: dict[str, Any]) -> None:
    found, *_ = fitting_framings(stream)
    assert found.table == table
    assert found.frames == find_frames(framing_from_table(table), stream).begins.size
    assert tomllib.loads(str(found)) == {"framing": table}


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "frames", "table"),
    [
        ("vn100_F00379.bin", 8895, {"ready_made": "vectornav-vn100-binary", "header": "FA 14 3E 00 3A 00"}),
        ("mip_data.bin", 8384, {"ready_made": "microstrain-mip"}),
        ("output1.bin", 100, {"ready_made": "xsens-mti", "precision": "f32"}),
        ("output2.bin", 100, {"ready_made": "xsens-mti", "precision": "fp12.20"}),
        ("output3.bin", 100, {"ready_made": "xsens-mti", "precision": "fp16.32"}),
    ],
)
def test_real_logs_are_told_with_their_frames(name: str, frames: int, table: dict[str, Any]) -> None:
    found, *_ = fitting_framings(shared_file(f"serial/{name}").read_bytes())
    assert (found.frames, found.table, found.where) == (frames, table, "")


@pytest.mark.parametrize(
    "stream",
    [
        b"",
        NOISE,
        NOISE + WIT[:55],
        b"time,ax,p\r\n" + lines(30),
        lines(30).replace(b"7,", b"OK,", 1),
        b"\xfa" * 5000,
        bytes(5000),
    ],
    ids=["nothing", "noise", "too few", "a table with names", "a row of words", "sync bytes alone", "zeros"],
)
def test_what_is_no_stream_of_a_port_is_not_guessed(stream: bytes) -> None:
    assert fitting_framings(stream) == ()


def test_damaged_frames_are_counted_beside_the_good_ones() -> None:
    damaged = bytearray(WIT)
    damaged[11 * 7 + 3] ^= 0x10
    damaged[11 * 30 + 5] ^= 0x01
    found, *_ = fitting_framings(bytes(damaged))
    assert (found.frames, found.bad >= 2) == (58, True)
    assert found.found.startswith(f"58 good frames of witmotion, {found.bad} with a wrong checksum")


def test_of_a_long_file_the_first_part_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "MOST_BYTES", 1 << 18)
    found, *_ = fitting_framings(WIT * 500)
    assert found.found == f"{(1 << 18) // 11:,} good frames of witmotion in the first 0.25 MB"


def test_unknown_bytes_and_a_wrong_framing_say_which_one_fits(tmp_path: Path) -> None:
    path = tmp_path / "imu.bin"
    path.write_bytes(WIT)
    with pytest.raises(UnknownFormatError) as unknown:
        explained_reader_of(path, None)
    text = str(unknown.value)
    assert "found 60 good frames of witmotion" in text
    assert (
        'declare a source with `kind = "serial"`, `match = "*.bin"` and `framing = { ready_made = "witmotion" }`'
        in text
    )
    wrong = Declarations("imu", framing={"ready_made": "xsens-mti"})
    with pytest.raises(CorruptFileError, match="not one frame fits the declared framing") as caught:
        BY_LAYOUT["serial"].open(path, wrong)
    assert str(caught.value).endswith(
        'found 60 good frames of witmotion, 100 % of the bytes; declare `framing = { ready_made = "witmotion" }`'
    )
    path.write_bytes(NOISE)
    with pytest.raises(UnknownFormatError) as unexplained:
        explained_reader_of(path, None)
    assert "framing" not in str(unexplained.value)
