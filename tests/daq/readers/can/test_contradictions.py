"""Entries that say a thing twice and not the same are damaged, in every format; what is not known is said so."""

from __future__ import annotations

import base64
import math
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.can.asc import read_asc
from recoil_acquisition.readers.can.blf_objects import read_blf
from recoil_acquisition.readers.can.candump import read_candump
from recoil_acquisition.readers.can.csv import HEADER, read_can_csv, read_canedge_csv
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.can.log import ASC, BLF, TRC, LogReader
from recoil_acquisition.readers.can.sqlite import read_can_sqlite
from recoil_acquisition.readers.can.trc import read_trc
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders import can_logs
from tests.builders.can_logs import can_sqlite
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, blf_log, blf_object, can_entries

EIGHT = "01 02 03 04 05 06 07 08"


def asc(lines: list[str]) -> CanLog:
    head = "date Thu Apr 16 13:59:01.000 2020\nbase hex  timestamps absolute\n"
    return read_asc((head + "".join(f"   0.{k:06d} {line}\n" for k, line in enumerate(lines))).encode())


def candump(lines: list[str]) -> CanLog:
    return read_candump("".join(f"(1700000000.{k:06d}) {line}\n" for k, line in enumerate(lines)).encode())


def trc(columns: str) -> Callable[[list[str]], CanLog]:
    def read(lines: list[str]) -> CanLog:
        head = f";$FILEVERSION=2.1\n;$STARTTIME=45244.9\n;$COLUMNS={columns}\n"
        text = head + "".join(f" {k + 1} {k}.000 {line}\n" for k, line in enumerate(lines))
        return read_trc(Path("a.trc"), text.encode())

    return read


def csv(lines: list[str]) -> CanLog:
    rows = []
    for k, line in enumerate(lines):
        length, octets = line.split(" ", 1)
        rows.append(f"{k}.5,0x100,0,0,0,{length},{base64.b64encode(bytes.fromhex(octets)).decode()}")
    return read_can_csv("\n".join([HEADER, *rows, ""]).encode())


def canedge(lines: list[str]) -> CanLog:
    return read_canedge_csv(
        "\n".join([can_logs.CANEDGE, *(f"{k}.5;{line}" for k, line in enumerate(lines)), ""]).encode()
    )


CASES = {
    "asc more": (asc, f"1  100  Rx   d 4 {EIGHT}"),
    "asc one more, as wide as another line": (asc, "1  100  Rx   d 7 01 02 03 04 05 06 07 08"),
    "asc fewer": (asc, "1  100  Rx   d 8 01 02 03 04"),
    "asc fd code": (asc, f"CANFD 1 Rx 100 1 0 9 8 {EIGHT} 0 0 3000 0 0 0 0 0".replace(" 9 8 ", " 4 8 ")),
    "asc fd length": (asc, f"CANFD 1 Rx 100 1 0 d 12 {EIGHT} 09 0a 0b 0c 0 0 3000 0 0 0 0 0"),
    "candump classic": (candump, "can0 100#0102030405060708090A0B0C"),
    "candump code": (candump, "can0 100#01020304_9"),
    "candump fd": (candump, "can0 100##1010203040506070809"),
    "candump screen more": (candump, f"can0  100   [4]  {EIGHT}"),
    "candump screen fewer": (candump, "can0  100   [8]  01 02"),
    "trc more": (trc("N,O,T,I,d,l,D"), f"DT 0100 Rx 4 {EIGHT}"),
    "trc both lengths": (trc("N,O,T,I,d,L,l,D"), f"FD 0100 Rx 9 8 {EIGHT}".replace(" 9 8 ", " 7 8 ")),
    "trc fd length": (trc("N,O,T,I,d,l,D"), f"FD 0100 Rx 9 {EIGHT} 09"),
    "csv": (csv, "4 0102030405060708"),
    "csv fd": (csv, "9 010203040506070809"),
    "canedge more": (canedge, "1;100;0;4;4;0;0;0;0102030405060708"),
    "canedge code": (canedge, "1;100;0;4;8;0;0;0;0102030405060708"),
    "canedge half a byte": (canedge, "1;100;0;8;8;0;0;0;010203040506070"),
    "canedge wide": (canedge, "1;FFF;0;8;8;0;0;0;0102030405060708"),
}  # fmt: skip

SOUND = {
    asc: f"1  100  Rx   d 8 {EIGHT}",
    candump: "can0 100#0102030405060708",
    csv: "8 0102030405060708",
    canedge: "1;100;0;8;8;0;0;0;0102030405060708",
}


@pytest.mark.parametrize("name", CASES)
def test_an_entry_that_contradicts_itself_is_damaged_and_left_out(name: str) -> None:
    read, line = CASES[name]
    sound = SOUND.get(read)
    if sound is None:
        sound = f"DT 0100 Rx {'8 8' if 'both' in name else '8'} {EIGHT}"
    log = read([sound, sound, line, sound, line, sound])
    assert log.metadata["damaged_entries"] == 2
    assert log.frames.length.tolist() == [8] * 4
    assert (log.frames.data[:, :8] == [1, 2, 3, 4, 5, 6, 7, 8]).all()
    assert any("2 entries are damaged and were left out" in note for note in log.notes)


@pytest.mark.parametrize(
    ("read", "line", "count"),
    [
        (asc, f"1  100  Rx   d 8 {EIGHT}  Length = 240015 BitCount = 124 ID = 256", 8),
        (asc, "1  100  Rx   d 2 01 02  Length = 240015", 2),
        (asc, f"1  100  Rx   d 9 {EIGHT}", 8),
        (asc, f"CANFD 1 Rx 100 1 0 d 32 {' '.join(['05'] * 32)} 0 0 3000 0 0 0 0 0", 32),
        (asc, f"CANFD 1 Rx 100 0 0 c 8 {EIGHT} 0 0 0 0 0 0 0 0", 8),
        (candump, "can0 100#0102030405060708_E R", 8),
        (candump, f"can0 100##1{'05' * 12}", 12),
        (candump, f"can0  100   [12]  {' '.join(['05'] * 12)}", 12),
        (candump, f"can0  100   [8]  {EIGHT}   '........'", 8),
    ],
)
def test_an_entry_that_says_the_same_twice_is_data(read: Callable[[list[str]], CanLog], line: str, count: int) -> None:
    log = read([line, line])
    assert (log.frames.length.tolist(), log.metadata["damaged_entries"]) == ([count, count], 0)


def test_a_row_of_a_database_contradicts_itself_by_its_length(tmp_path: Path) -> None:
    rows = [
        (1.5, 0x100, 0, 0, 0, 9, bytes(9)),
        (1.6, 0x100, 0, 0, 0, 4, bytes(8)),
        (1.7, 0x100, 0, 0, 0, 12, bytes(12)),
    ]
    path = tmp_path / "a.db"
    path.write_bytes(can_sqlite([], extra=rows))
    log = read_can_sqlite(path)
    assert (log.frames.length.tolist(), log.metadata["damaged_entries"]) == ([12], 2)


def fd_object(code: int, valid: int) -> bytes:
    return blf_object(100, 5, struct.pack("<HBBLLBBB5x64s", 1, 0, code, 0x100, 0, 0, 1, valid, bytes(64)))


def wide_object(code: int, valid: int) -> bytes:
    fields = [1, code, valid, 0, 0x100, 0, 0x1000, *[0] * 8]
    return blf_object(101, 5, struct.pack("<BBBBLLLLLLLHBBL", *fields) + bytes(valid))


@pytest.mark.parametrize("made", [fd_object, wide_object])
def test_a_blf_frame_contradicts_itself_by_its_length(made: Callable[[int, int], bytes]) -> None:
    objects = made(15, 64) + made(9, 8) + made(9, 12) + made(4, 8) + made(8, 64) + made(15, 63)
    log = read_blf(Path("a.blf"), blf_log([], extra=objects))
    assert (log.frames.length.tolist(), log.metadata["damaged_entries"]) == ([64, 8, 12], 3)


def test_a_blf_header_contradicts_its_version_by_its_size() -> None:
    sound = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 0x100, bytes(8)))
    wrong = bytearray(sound)
    wrong[4:6] = struct.pack("<H", 24)
    log = read_blf(Path("a.blf"), blf_log([], extra=sound + bytes(wrong) + sound))
    assert (log.frames.key.size, log.metadata["damaged_entries"]) == (2, 1)


def of_version(version: int) -> bytes:
    made = bytearray(blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 0x100, bytes(8))))
    made[6:8] = struct.pack("<H", version)
    return bytes(made)


def test_a_header_version_that_is_not_known_is_said(tmp_path: Path) -> None:
    log = read_blf(Path("a.blf"), blf_log(can_entries(4), extra=of_version(3) * 5))
    assert any("object header version 3 is not known: 5 frames were not read" in note for note in log.notes)
    assert log.metadata["other_events"] == log.metadata["damaged_entries"] == 0
    path = tmp_path / "a.blf"
    path.write_bytes(blf_log([], extra=of_version(3) * 5))
    with pytest.raises(ReadError, match="header version 3 is not known: 5 frames were not read; let the program"):
        BLF.open(path, Declarations("can", database=DBC))


def test_the_log_of_header_version_3() -> None:
    path = shared_file("reports/blf_v3hdr.blf")
    with pytest.raises(ReadError, match="object header version 3 is not known"):
        BLF.open(path, Declarations("can", database=DBC))


def test_objects_that_are_no_frames_are_named_where_a_log_has_no_others(tmp_path: Path) -> None:
    path = tmp_path / "a.blf"
    path.write_bytes(blf_log([], extra=blf_object(65, 5, bytes(16)) * 3))
    with pytest.raises(ReadError, match=r"no data frames; found 3 other events \(other events by kind: 65 x3\)"):
        BLF.open(path, Declarations("can", database=DBC))


def test_a_trace_or_log_whose_date_is_not_understood_says_so() -> None:
    log = read_trc(Path("a.trc"), b";$FILEVERSION=1.1\n;$STARTTIME=Tuesday\n 1) 1.0 Rx 0100 1 00 \n")
    assert log.absolute_start is None
    assert any("when the trace began is not understood: 'Tuesday'" in note for note in log.notes)
    content = bytearray(blf_log(can_entries(2)))
    content[42:44] = struct.pack("<H", 13)  # the month of the measurement's start
    blf = read_blf(Path("a.blf"), bytes(content))
    assert blf.absolute_start is None
    assert any("when the measurement began is not understood: 2023-13-14T" in note for note in blf.notes)


ASC_OF_OTHERS = """date Thu Apr 16 13:59:01.000 2020
base hex  timestamps absolute
 0.1 CANXL 1 Rx x
 0.2 ETH 1 x
"""
TRC_OF_OTHERS = """;$FILEVERSION=2.0
;$STARTTIME=45244.9
;$COLUMNS=N,O,T,I,d,l,D
 1 0.1 XL 0100 Rx 1 00
"""


@pytest.mark.parametrize(
    ("reader", "text", "kinds"), [(ASC, ASC_OF_OTHERS, "CANXL x1, ETH x1"), (TRC, TRC_OF_OTHERS, "XL x1")]
)
def test_what_a_log_holds_in_the_place_of_frames_is_named(
    reader: LogReader, text: str, kinds: str, tmp_path: Path
) -> None:
    path = tmp_path / "a"
    path.write_text(text)
    with pytest.raises(ReadError, match=rf"no data frames; found \d other events \(other events by kind: {kinds}\)"):
        reader.open(path, Declarations("can", database=DBC))


RIGHT = {
    "blf_neg.blf": ([-60.0, -59.9, 0.1], [0.01, 0.02, 0.03], ()),
    "savvy1045.trc": ([0.0, 1.2e-3], [0.05, 38.4], ("1 error frames",)),
    "cd_misc.log": (
        [0.0, 0.1, 0.5, 0.8],
        [5.13, 5.13, 5.13, math.nan],
        ("1 error frames", "2 entries are damaged", "1 frames are too short"),
    ),
}


@pytest.mark.parametrize("name", RIGHT)
def test_logs_of_public_reports_are_read_as_they_are(name: str) -> None:
    path, database = shared_file(f"reports/{name}"), shared_file("reports/two_bus.dbc").read_text()
    recording = recognise(path).open(path, Declarations("can", database=database))
    times_s, values, notes = RIGHT[name]
    assert recording.time_base("IMU.Accel").times_s == pytest.approx(times_s)
    assert recording.read("IMU.Accel") == pytest.approx(values, nan_ok=True)
    assert len(recording.notes) == len(notes)
    assert all(any(note in said for said in recording.notes) for note in notes)


def test_data_beyond_its_length_is_not_taken_for_the_free_end_of_a_line_as_long() -> None:
    sound, longer = ("1  100  Rx   d 4 01 02 03 04" + end for end in ("   Length", " 05 06 07"))
    assert len(sound) == len(longer)
    log = asc([sound, longer, sound, longer, sound])
    assert (log.frames.length.tolist(), log.metadata["damaged_entries"]) == ([4, 4, 4], 2)
