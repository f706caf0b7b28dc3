from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, NoSignalError, ReadError
from recoil_acquisition.readers.can import blf_objects
from recoil_acquisition.readers.can.asc import read_asc
from recoil_acquisition.readers.can.blf_objects import read_blf
from recoil_acquisition.readers.can.candump import read_candump
from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanFrames
from recoil_acquisition.readers.can.log import ASC, BLF, CANDUMP, CanRecording
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import (
    DBC,
    EXT,
    CanEntry,
    asc_log,
    blf_log,
    blf_object,
    can_entries,
    candump_log,
)

READERS = {"asc": ASC, "blf": BLF, "log": CANDUMP}
NAMES = {"asc": "Vector ASC log", "blf": "Vector BLF log", "log": "candump log"}
WRITERS = {"asc": asc_log, "blf": blf_log, "log": candump_log}


def opened(tmp_path: Path, suffix: str, content: bytes, database: str | None = DBC) -> CanRecording:
    return open_bytes(READERS[suffix], f"a.{suffix}", tmp_path, content, Declarations("can", database=database))


def as_entries(frames: CanFrames) -> list[CanEntry]:
    rows = zip(frames.time_s, frames.key, frames.data, frames.length, strict=True)
    return [(round(t * 1e9), int(key), bytes(data[:n])) for t, key, data, n in rows]


@pytest.mark.parametrize("suffix", READERS)
def test_every_format_gives_the_same_signals(suffix: str, tmp_path: Path) -> None:
    content = WRITERS[suffix](can_entries(30))
    assert [reader.name for reader in surest_claim(Head(content[:65536]))[1]] == [NAMES[suffix]]
    recording = opened(tmp_path, suffix, content)
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [
        ("ACC.ax", "m/s^2", 30),
        ("ACC.p", "bar", 30),
        ("GYR.gx", "deg/s", 30),
        ("EXT.kind", "", 10),
        ("EXT.low", "V", 5),
        ("EXT.high", "V", 5),
    ]
    i = np.arange(30)
    np.testing.assert_allclose(recording.read("ACC.ax"), 0.01 * (10 * i - 50), rtol=1e-14)
    np.testing.assert_allclose(recording.read("ACC.p"), 0.1 * (100 + i) - 5, rtol=1e-14)
    np.testing.assert_allclose(recording.time_base("GYR.gx").times_s, 1e-3 * i + 2.5e-4, atol=1e-12)
    np.testing.assert_allclose(recording.time_base("EXT.high").times_s, 1e-3 * i[3::6] + 5e-4, atol=1e-12)
    np.testing.assert_array_equal(recording.read("EXT.high"), 2 * i[3::6])
    raw = recording.raw("ACC.ax")
    assert raw is not None
    np.testing.assert_array_equal(raw.counts, 10 * i - 50)
    assert recording.notes == ()
    start = recording.absolute_start
    assert start is not None
    assert start.text.startswith("2023-11-14T22:13:20.25")
    assert start.zone == ("UTC" if suffix == "log" else "unknown")


@pytest.mark.parametrize("suffix", READERS)
def test_a_frame_too_short_for_a_signal_is_a_lost_sample(suffix: str, tmp_path: Path) -> None:
    entries = can_entries(10)
    entries[0] = (0, 0x100, entries[0][2][:4])
    recording = opened(tmp_path, suffix, WRITERS[suffix](entries))
    assert np.isnan(recording.read("ACC.p")).tolist() == [True] + [False] * 9
    assert not np.isnan(recording.read("ACC.ax")).any()
    assert recording.raw("ACC.p") is None
    assert any("ACC.p: 1 frames are too short" in note for note in recording.notes)


@pytest.mark.parametrize("suffix", READERS)
def test_stamps_that_do_not_increase_are_left_out_and_counted(suffix: str, tmp_path: Path) -> None:
    entries: list[CanEntry] = [
        (t, 0x100, struct.pack("<hHHH", n, 0, 0, 0)) for n, t in enumerate([0, 5_000, 5_000, 3_000, 9_000])
    ]
    recording = opened(tmp_path, suffix, WRITERS[suffix](entries))
    np.testing.assert_allclose(recording.read("ACC.ax"), [0.0, 0.01, 0.04])
    assert any("2 of 5 frames do not increase" in note for note in recording.notes)


@pytest.mark.parametrize("suffix", READERS)
def test_unknown_identifiers_are_counted_by_name(suffix: str, tmp_path: Path) -> None:
    entries = [*can_entries(5), (6_000_000, 0x7F0, b"\1"), (7_000_000, 0x80000100, b"\1")]
    recording = opened(tmp_path, suffix, WRITERS[suffix](entries))
    assert recording.metadata["unknown_identifiers"] == {"0x7f0": 1, "0x100 (29 bit)": 1}
    assert any("unknown to the database: 2" in note for note in recording.notes)


def test_messages_that_the_log_does_not_hold_are_named(tmp_path: Path) -> None:
    recording = opened(tmp_path, "log", candump_log([(0, 0x100, bytes(8))]))
    assert recording.metadata["absent_messages"] == ["GYR", "EXT"]
    assert any("GYR, EXT" in note for note in recording.notes)


@pytest.mark.parametrize("suffix", READERS)
def test_a_log_without_data_frames_is_refused(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no data frames"):
        opened(tmp_path, suffix, WRITERS[suffix]([]))


def test_a_log_of_remote_frames_alone_says_so_in_a_sentence(tmp_path: Path) -> None:
    text = "(1700000000.000000) can0 123#R\n(1700000000.100000) can0 20000004#0001000000000000\n"
    with pytest.raises(NoSignalError, match="no data frames; found 1 error frames, 1 remote frames; check") as caught:
        opened(tmp_path, "log", text.encode())
    assert list(caught.value.contents) == ["1 error frames", "1 remote frames"]
    with pytest.raises(CorruptFileError, match="found no entries at all"):
        opened(tmp_path, "asc", b"date Tue Nov 14 22:13:20.250 2023\nbase hex\n")


def screen(entries: Sequence[CanEntry], stamp: str, *, extra: str = "") -> str:
    lines = []
    for time_ns, key, data in entries:
        number = f"{key & 0x1FFFFFFF:08X}" if key >> 31 else f"{key:03X}"
        octets = data.hex(" ").upper()
        lines.append(f" ({stamp}{time_ns // 1000:06d})  can0  {extra}{number}   [{len(data)}]  {octets}")
    return "".join(line + "\n" for line in lines)


@pytest.mark.parametrize(
    ("stamp", "zone", "text"),
    [
        ("1700000000.", "UTC", "2023-11-14T22:13:20.000000"),
        ("2023-11-14 22:13:20.", "unknown", "2023-11-14T22:13:20.000000"),
        ("000.", "", ""),
    ],
)
@pytest.mark.parametrize("extra", ["", "RX - -  ", "TX B E  "])
def test_what_candump_prints_on_a_screen_is_read(stamp: str, zone: str, text: str, extra: str) -> None:
    entries = [*can_entries(9), (900_000_000, 0x101, bytes(range(12))), (900_001_000, 0x102, b"")]
    printed = screen(entries, stamp, extra=extra)
    printed += f" ({stamp}950000)  can0  123   [0]  remote request\n ({stamp}960000)  can0  20000004   [8]  "
    printed += "00 01 00 00 00 00 00 00   ERRORFRAME\n"
    assert CANDUMP.claims(Head(printed.encode()))
    log = read_candump(printed.encode())
    assert as_entries(log.frames) == entries
    assert (log.metadata["remote_frames"], log.metadata["error_frames"]) == (1, 1)
    start = log.absolute_start
    assert (zone, text) == ("", "") if start is None else (start.zone, start.text) == (zone, text)


def test_text_beside_the_bytes_of_a_screen_is_no_data() -> None:
    log = read_candump(b" (1700000000.000000)  can0  123   [2]  41 42   'AB'\n (1700000000.1)  can0\n")
    assert as_entries(log.frames) == [(0, 0x123, b"AB")]
    assert log.metadata["damaged_entries"] == 1
    short = read_candump(b" (1700000000.000000)  can0  123   [3]  41 42   'AB'\n")
    assert short.metadata["damaged_entries"] == 1


def test_codes_of_lengths_beyond_eight_are_no_data() -> None:
    log = read_candump(b"(1700000000.000000) can0 123#1122334455667788_C\n(1700000000.000001) can0 124#R8_F\n")
    assert as_entries(log.frames) == [(0, 0x123, bytes.fromhex("1122334455667788"))]
    assert log.metadata["remote_frames"] == 1


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("  can0  123   [2]  41 42\n", "entries without stamps"),
        (
            "".join(f"(000.{t}) can0 123#00\n" for t in ("000000", "010000", "009000", "010000", "009000")),
            "differences",
        ),
    ],
)
def test_a_log_that_does_not_say_when_is_refused(text: str, found: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=f"does not say when.*{found}.*candump -L"):
        opened(tmp_path, "log", text.encode())


def test_stamps_from_the_programs_start_are_no_date(tmp_path: Path) -> None:
    recording = opened(
        tmp_path, "log", b"(000.000000) can0 100#0000000000000000\n(000.500000) can0 100#0100000000000000\n"
    )
    assert recording.absolute_start is None
    assert recording.time_base("ACC.ax").times_s.tolist() == [0.0, 0.5]


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("code", range(9, 16))
def test_a_length_code_of_an_asc_entry_stands_for_the_bytes_that_follow(code: int, base: str) -> None:
    """A classic frame of a code beyond eight has eight bytes, an FD frame those of its code; others are damage."""
    for count in (8, FD_LENGTHS[code], 9):
        octets = " ".join(f"{b:02X}" if base == "hex" else str(b) for b in range(count))
        stated = f"{code:x}" if base == "hex" else str(code)
        head = f"date Tue Nov 14 22:13:20.250 2023\nbase {base}  timestamps absolute\n"
        log = read_asc(f"{head}   0.1 1  100 Rx   d {stated} {octets}  Length = 240015\n".encode())
        assert log.frames.length.tolist() == ([] if count == 9 else [count])
        assert log.metadata["damaged_entries"] == (count == 9)
        if count != 9:
            assert bytes(log.frames.data[0, :count]) == bytes(range(count))


@pytest.mark.parametrize(("stated", "count"), [("64", 64), ("12", 12), ("64", 63), ("ff", 64), ("65", 65)])
def test_a_length_of_an_asc_entry_may_be_bytes(stated: str, count: int) -> None:
    head = "date Tue Nov 14 22:13:20.250 2023\nbase hex  timestamps absolute\n"
    octets = " ".join(f"{b:02X}" for b in range(count))
    log = read_asc(f"{head}   0.1 1  100 Rx   d {stated} {octets}\n".encode())
    assert log.frames.length.tolist() == [count] * (stated == str(count) and count in FD_LENGTHS)


def test_the_database_is_needed_and_read_strictly(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="without its database"):
        opened(tmp_path, "log", candump_log(can_entries(3)), None)
    with pytest.raises(ReadError, match="database cannot be read"):
        opened(tmp_path, "log", candump_log(can_entries(3)), "BO_ nonsense")
    overlapping = DBC.replace("SG_ p : 48|16", "SG_ p : 8|16")
    with pytest.raises(ReadError, match="overlapping"):
        opened(tmp_path, "log", candump_log(can_entries(3)), overlapping).read("ACC.ax")


def test_candump_error_frames_never_become_data() -> None:
    log = read_candump(
        b"(1.000000) can0 100#00\n(1.100000) can0 20000004#0001000000000000\n"
        b"(1.200000) can0 20000080#0000000000000000\n"
        b"(1.300000) can0 100#R8\n(1.400000) can0 101##1AABB\n(1.500000) can0 100#0\nrubbish\n"
    )
    assert log.frames.key.tolist() == [0x100, 0x101]
    assert log.frames.data[1, :3].tolist() == [0xAA, 0xBB, 0]
    assert (log.metadata["error_frames"], log.metadata["remote_frames"], log.metadata["damaged_entries"]) == (2, 1, 2)
    assert any("2 error frames" in note for note in log.notes)
    assert any("2 entries are damaged" in note for note in log.notes)


def test_candump_keeps_microseconds_of_epoch_stamps() -> None:
    log = read_candump(b"(1700000000.000001) can0 001#00\n(1700000000.000002) can0 001#00\n")
    assert log.frames.time_s.tolist() == [0.0, 1e-6]


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("relative", [False, True])
def test_asc_bases_and_relative_stamps_are_understood(base: str, relative: bool) -> None:
    entries = can_entries(20)
    log = read_asc(asc_log(entries, base=base, relative=relative))
    np.testing.assert_allclose(log.frames.time_s, [t / 1e9 for t, _, _ in entries], atol=1e-12)
    assert log.frames.key.tolist() == [key for _, key, _ in entries]
    assert [bytes(row[:n]) for row, n in zip(log.frames.data, log.frames.length, strict=True)] == [
        d for _, _, d in entries
    ]
    assert any("summed up" in note for note in log.notes) == relative


def test_relative_stamps_count_events_that_are_no_data_frames() -> None:
    text = (
        "date Sam Sep 30 15:06:13.191 2017\nbase hex timestamps relative\n"
        "1.000000 1 100 Rx d 1 00\n0.500000 1 ErrorFrame\n0.250000 1  Statistic: D 0 R 0\n0.250000 1 100 Rx d 1 00\n"
    )
    log = read_asc(text.encode())
    assert log.frames.time_s.tolist() == [1.0, 2.0]
    assert log.metadata["error_frames"] == 1
    assert log.metadata["other_events"] == 1


def test_negative_times_before_a_trigger_are_kept(tmp_path: Path) -> None:
    entries = [(t, 0x100, bytes(8)) for t in (-2_000_000, -500_000, 0, 1_000_000)]
    for suffix in ("asc", "blf"):
        recording = opened(tmp_path, suffix, WRITERS[suffix](entries))
        np.testing.assert_allclose(recording.time_base("ACC.ax").times_s, [-2e-3, -5e-4, 0.0, 1e-3], atol=1e-15)


@pytest.mark.parametrize(
    ("date", "iso"),
    [
        ("Sat Sep 30 15:06:13.191 2017", "2017-09-30T15:06:13.191"),
        ("Sam Okt 30 15:06:13 2017", "2017-10-30T15:06:13.000"),
        ("Sat Sep 30 03:06:13.191 pm 2017", "2017-09-30T15:06:13.191"),
        ("Sat Sep 30 12:06:13.191 am 2017", "2017-09-30T00:06:13.191"),
        ("2017-09-30", None),
        ("Sat Xyz 30 15:06:13.191 2017", None),
        ("Sat Sep 31 15:06:13.191 2017", None),
    ],
)
def test_asc_dates_are_local_time_of_an_unknown_zone(date: str, iso: str | None) -> None:
    start = read_asc(f"date {date}\nbase hex timestamps absolute\n0.1 1 1 Rx d 0\n".encode()).absolute_start
    assert (start is None) == (iso is None)
    if start is not None:
        assert (start.text, start.zone) == (iso, "unknown")


def test_asc_damage_is_counted() -> None:
    log = read_asc(
        b"base hex timestamps absolute\n1.0 1 100 Rx d 8 00 01\n1.1 1 100 Rx d 2 00 zz\n1.2 1 900 Rx d 1 00\n"
        b"1.3 1 100 Rx r\n1.4 1 Engine Rx d 1 00\n1.5 CANFD 1 Rx 300 1 0 8 7 00\n1.6 1 100 Rx d 1 05\n"
    )
    assert log.frames.time_s.tolist() == [1.6]
    assert (log.metadata["damaged_entries"], log.metadata["remote_frames"]) == (4, 1)
    # a name for an identifier is no damage
    assert [str(one).split(" and ")[0] for one in log.notes if "name for" in str(one)] == [
        "1 entries have a name for their identifier"
    ]


def test_blf_objects_that_are_no_data_frames_are_counted() -> None:
    extra = (
        blf_object(73, 0, bytes(32))
        + blf_object(1, 5, struct.pack("<HBBL8s", 1, 0x80, 8, 0x100, bytes(8)))
        + blf_object(96, 6, bytes(20))
        + blf_object(1, 7, b"\0")
    )
    log = read_blf(Path("a.blf"), blf_log(can_entries(3), extra=extra))
    counts = {key: log.metadata[key] for key in ("error_frames", "remote_frames", "other_events", "damaged_entries")}
    assert counts == {"error_frames": 1, "remote_frames": 1, "other_events": 1, "damaged_entries": 1}
    assert log.frames.key.size == len(can_entries(3))


def test_a_blf_frame_that_was_sent_is_data_as_one_that_was_received() -> None:
    sent, wide = 0x01, 0x1000 | 0x80  # the recorder sent it; in wide frames bit 7 is that of an acknowledgement
    frames = (
        blf_object(1, 5, struct.pack("<HBBL8s", 1, sent, 8, 0x100, bytes(8)))
        + blf_object(100, 6, struct.pack("<HBBLLBBB5x64s", 1, sent, 8, 0x200, 0, 0, 1, 8, bytes(64)))
        + blf_object(101, 7, struct.pack("<BBBBLLLLLLLHBBL", 1, 8, 8, 0, 0x300, 0, wide, *[0] * 8) + bytes(8))
    )
    log = read_blf(Path("a.blf"), blf_log([], extra=frames))
    assert log.frames.key.tolist() == [0x100, 0x200, 0x300]
    assert log.metadata["remote_frames"] == 0


def test_blf_objects_may_stand_outside_of_containers() -> None:
    frame = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 0x100, bytes(8)))
    log = read_blf(Path("a.blf"), blf_log(can_entries(3)) + frame + frame)
    assert log.frames.key.tolist()[-2:] == [0x100, 0x100]
    assert log.frames.key.size == read_blf(Path("a.blf"), blf_log(can_entries(3))).frames.key.size + 2


def test_what_a_blf_frame_holds_behind_its_length_is_no_data() -> None:
    left_over = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 3, 0x100, bytes(range(1, 9))))
    (data,) = read_blf(Path("a.blf"), blf_log([], extra=left_over)).frames.data
    assert data.tolist() == [1, 2, 3, 0, 0, 0, 0, 0]


def test_blf_fd_frames_and_ten_microsecond_stamps_are_read() -> None:
    head = struct.pack("<4sHHLLLHHq", b"LOBJ", 32, 1, 32 + 84, 100, 1, 0, 0, 7)
    fd = head + struct.pack("<HBBLLBBB5x64s", 1, 0, 15, 0x300, 0, 0, 1, 64, bytes(range(64)))
    wide = blf_object(101, 9, struct.pack("<BBBBLLLLLLLHBBL", 1, 9, 12, 0, EXT, 0, 0x1000, *[0] * 8) + bytes(range(12)))
    log = read_blf(Path("a.blf"), blf_log([], extra=fd + wide))
    assert log.frames.time_s.tolist() == [7e-5, 9e-9]
    assert log.frames.length.tolist() == [64, 12]
    assert log.frames.data[0].tolist() == list(range(64))
    assert log.frames.key.tolist() == [0x300, EXT]


def uncompressed(method: int) -> bytes:
    objects = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 0x100, bytes(8)))
    body = struct.pack("<H6xL4x", method, len(objects)) + objects
    whole = blf_log([])[:144]
    return whole + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body


@pytest.mark.parametrize(("valid", "stored"), [(64, 48), (64, 0), (12, 12), (8, 20)])
@pytest.mark.parametrize("extended", [False, True])
def test_zeros_that_a_blf_frame_leaves_off_are_given_back(valid: int, stored: int, extended: bool) -> None:
    """The length of the data is what the frame says of them; what follows at the extension's offset is no data."""
    body_at = 32 + 40
    fields = [
        1,
        FD_LENGTHS.index(valid),
        valid,
        0,
        0x123,
        0,
        0x1000,
        0,
        0,
        0,
        0,
        0,
        0,
        body_at + stored if extended else 0,
        0,
    ]
    body = struct.pack("<BBBBLLLLLLLHBBL", *fields) + bytes(range(1, stored + 1)) + b"\xee" * 8 * extended
    log = read_blf(Path("a.blf"), blf_log([], extra=blf_object(101, 9, body)))
    assert log.frames.length.tolist() == [valid]
    assert bytes(log.frames.data[0, :valid]) == bytes(range(1, stored + 1))[:valid].ljust(valid, b"\0")
    assert not log.incomplete


def test_python_can_gives_the_same_zeros_back() -> None:
    import can

    path = shared_file("can/issue_1905.blf")
    frames = read_blf(path, path.read_bytes()).frames
    with can.BLFReader(path) as log:
        expected = [bytes(message.data) for message in log]
    assert len(expected) == 22
    assert [bytes(row[:n]) for row, n in zip(frames.data, frames.length, strict=True)] == expected
    assert {len(data) for data in expected} == {64}


def test_blf_containers_may_be_uncompressed_and_unknown_ones_are_refused() -> None:
    assert read_blf(Path("a.blf"), uncompressed(0)).frames.key.tolist() == [0x100]
    with pytest.raises(ReadError, match="compression 7 of a container is not known"):
        read_blf(Path("a.blf"), uncompressed(7))
    with pytest.raises(CorruptFileError, match="does not inflate"):
        read_blf(Path("a.blf"), uncompressed(2))


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (lambda c: c[:60], "header is cut"),
        (lambda c: c[:180] + b"XXXX" + c[184:], "does not inflate"),
        (lambda c: c[:144] + b"JUNKJUNKJUNK" + c[144:], "no object follows"),
        (lambda c: c[:144] + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 0, 10) + c[160:], "smaller than its header"),
        (lambda c: c[:144] + container(b"LOBJ" + bytes(40)), "smaller than its header"),
        (lambda c: c[:144] + container(b"J" * 60), "no object follows"),
        (lambda c: c[:144] + container(bytes(60), stated=90), "incomplete"),
    ],
)
def test_blf_damage_is_named(damage: Any, problem: str) -> None:
    with pytest.raises(CorruptFileError, match=problem):
        read_blf(Path("a.blf"), damage(blf_log(can_entries(5))))


def test_a_blf_log_that_ends_inside_the_head_of_a_container_is_cut() -> None:
    whole = blf_log(can_entries(5))
    assert read_blf(Path("a.blf"), whole).incomplete == ""
    assert "ends inside an object" in read_blf(Path("a.blf"), whole + b"LOBJ\x10\0").incomplete


def test_a_blf_log_whose_start_is_no_date_has_none() -> None:
    content = bytearray(blf_log(can_entries(5)))
    assert read_blf(Path("a.blf"), bytes(content)).absolute_start is not None
    struct.pack_into("<H", content, content.index(struct.pack("<2H", 2023, 11)) + 2, 13)  # the month
    assert read_blf(Path("a.blf"), bytes(content)).absolute_start is None


MIXED = b"".join(
    blf_object(100, 9 * k, struct.pack("<HBBLLBBB5x64s", 1, 0, 9, 0x300, 0, 0, 1, 12, bytes(range(64))))
    + blf_object(96, k, bytes(5)).ljust(40, b"\0")
    + blf_object(1, 9 * k + 1, struct.pack("<HBBL8s", 1, 0, 5, 0x100, b"LOBJ\x20..."))
    for k in range(20)
)


@pytest.mark.parametrize("piece_bytes", range(1, 160, 13))
def test_a_blf_log_is_the_same_in_whatever_pieces_it_is_read(piece_bytes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    content = blf_log([], extra=MIXED + bytes(200)) + MIXED[:20]
    whole = read_blf(Path("a.blf"), content)
    assert whole.metadata["other_events"] == 20
    monkeypatch.setattr(blf_objects, "PIECE_BYTES", max(piece_bytes, 140))
    parts = read_blf(Path("a.blf"), content)
    assert as_entries(parts.frames) == as_entries(whole.frames)
    assert (parts.metadata, parts.notes) == (whole.metadata, whole.notes)


def test_a_large_blf_container_is_handed_to_zlib_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    class Counting:
        """Counts the bytes that it is given, of which zlib copies those that it does not use."""

        given = 0

        def __init__(self) -> None:
            self._inflate = decompressobj()

        def decompress(self, packed: bytes | memoryview, most: int) -> bytes:
            Counting.given += len(packed)
            return self._inflate.decompress(packed, most)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._inflate, name)

    decompressobj = zlib.decompressobj
    event = blf_object(65, 5, np.random.default_rng(1).bytes(100_000))
    content = blf_log([], extra=event, per_container=10**6)
    monkeypatch.setattr(blf_objects.zlib, "decompressobj", Counting)
    monkeypatch.setattr(blf_objects, "PIECE_BYTES", 1000)
    assert read_blf(Path("a.blf"), content).metadata["other_events"] == 1
    assert len(event) <= Counting.given < 3 * len(event)


@pytest.mark.parametrize(("kept", "incomplete"), [(3_000_000, False), (2_999_999, True)])
def test_a_blf_object_too_large_for_a_frame_is_an_event_that_takes_no_memory(kept: int, incomplete: bool) -> None:
    large = blf_object(65, 5, bytes(3_000_000 - 32))[:kept]
    log = read_blf(Path("a.blf"), blf_log([], extra=MIXED + large, per_container=10**7))
    assert log.metadata["other_events"] == 21
    assert log.frames.key.size == 40
    assert bool(log.incomplete) is incomplete


@pytest.mark.parametrize("left_over", [8, 23, 24, 40])
def test_what_is_no_object_behind_the_last_one_of_a_blf_log_is_damage(left_over: int) -> None:
    with pytest.raises(CorruptFileError, match=f"byte {len(MIXED)} of .* no object follows"):
        read_blf(Path("a.blf"), blf_log([], extra=MIXED + b"x" * left_over))


PLAIN = blf_object(1, 5, struct.pack("<HBBL8s", 1, 0, 8, 0x100, bytes(8)))


@pytest.mark.parametrize(("objects", "frames"), [(PLAIN, 1), (MIXED, 40)])
@pytest.mark.parametrize(("filled", "sound"), [(4, True), (5, False), (12, False)])
def test_blf_objects_are_filled_up_by_four_bytes_at_most(objects: bytes, frames: int, filled: int, sound: bool) -> None:
    content = blf_log([], extra=objects + bytes(filled) + objects)
    if sound:
        assert read_blf(Path("a.blf"), content).frames.key.size == 2 * frames
        return
    with pytest.raises(CorruptFileError, match="no object follows"):
        read_blf(Path("a.blf"), content)


@pytest.mark.parametrize("kept", [4, 8, 12, 16, 47])
def test_a_blf_log_that_ends_inside_an_object_says_so(kept: int) -> None:
    log = read_blf(Path("a.blf"), blf_log([], extra=2 * PLAIN + PLAIN[:kept]))
    assert log.frames.key.size == 2
    assert "ends inside an object" in log.incomplete


def test_ten_microsecond_stamps_of_a_classic_blf_frame_are_read() -> None:
    frame = PLAIN[:16] + struct.pack("<LHHq", 1, 0, 0, 7) + PLAIN[32:]
    assert read_blf(Path("a.blf"), blf_log([], extra=frame)).frames.time_s.tolist() == [7e-5]


def test_zeros_between_blf_objects_are_damage_and_behind_them_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blf_objects, "PIECE_BYTES", 140)
    assert not read_blf(Path("a.blf"), blf_log([], extra=MIXED + bytes(1000))).incomplete
    with pytest.raises(CorruptFileError, match="no object follows"):
        read_blf(Path("a.blf"), blf_log([], extra=MIXED + bytes(1000) + MIXED))


def container(objects: bytes, stated: int | None = None) -> bytes:
    body = struct.pack("<H6xL4x", 2, len(objects) if stated is None else stated) + zlib.compress(objects)
    return struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body


@pytest.mark.parametrize("suffix", READERS)
def test_logs_that_python_can_wrote_are_read_as_it_reads_them(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{suffix}"
    rng = np.random.default_rng(3)
    with can.Logger(path) as writer:
        for i in range(300):
            fd = i % 7 == 0
            message = can.Message(
                timestamp=1_700_000_000.25 + 1e-3 * i,
                arbitration_id=int(rng.integers(0x800)),
                is_extended_id=i % 5 == 0,
                is_fd=fd,
                data=rng.bytes(64 if fd else int(rng.integers(9))),
                channel=0,
            )
            writer.on_message_received(message)
    with can.LogReader(path) as messages:
        expected = list(messages)
    content = path.read_bytes()
    logs = {"asc": lambda: read_asc(content), "log": lambda: read_candump(content)}
    frames = (logs[suffix]() if suffix in logs else read_blf(path, content)).frames
    assert len(expected) == frames.key.size == 300
    for i, message in enumerate(expected):
        assert bytes(frames.data[i, : frames.length[i]]) == bytes(message.data)
        assert int(frames.key[i]) == message.arbitration_id | (message.is_extended_id << 31)
        assert frames.time_s[i] - frames.time_s[0] == pytest.approx(message.timestamp - expected[0].timestamp, abs=1e-6)


@pytest.mark.parametrize("suffix", READERS)
def test_the_generated_shot_agrees_with_its_truth(suffix: str) -> None:
    path = shared_file(f"can/rig_shot/rig_shot.{suffix}")
    truth = np.load(path.parent / "rig_shot_truth.npz")
    recording = READERS[suffix].open(path, Declarations("can", database=(path.parent / "rig.dbc").read_text()))
    kept = np.delete(np.arange(1500), truth["dropped_acc_index"])
    whole = ~np.isnan(recording.read("ACC.p_brake"))
    assert (~whole).sum() == 1
    for name in ("ax", "ay", "az", "p_brake"):
        np.testing.assert_allclose(recording.read(f"ACC.{name}")[whole], truth[name][kept], rtol=1e-12)
    for name in ("gx", "gy", "gz", "temp"):
        np.testing.assert_allclose(recording.read(f"GYR.{name}"), truth[name], rtol=1e-12)
    times_s = recording.time_base("ACC.ax").times_s[whole]
    np.testing.assert_allclose(times_s - times_s[0], truth["t"][kept] - truth["t"][0], atol=1e-6)
    assert recording.metadata["error_frames"] == 1
    assert recording.metadata["data_frames"] == 2999
    assert recording.metadata["unknown_identifiers"] == {"0x18fef100 (29 bit)": 1}


@pytest.mark.parametrize(
    ("name", "frames", "errors"),
    [
        ("logfile.asc", 12, 4),
        ("logfile_errorframes.asc", 7, 3),
        ("single_frame_us_locale.asc", 1, 0),
        ("test_CanFdMessage.asc", 3, 0),
        ("test_CanMessage.blf", 2, 0),
        ("test_CanFdMessage.blf", 2, 0),
        ("test_CanErrorFrameExt.blf", 0, 2),
        ("test_CanErrorFrames.asc", 0, 4),
    ],
)
def test_logs_of_other_programs_are_counted(name: str, frames: int, errors: int) -> None:
    path = shared_file(f"can/{name}")
    log = read_blf(path, path.read_bytes()) if path.suffix == ".blf" else read_asc(path.read_bytes())
    assert (log.frames.key.size, log.metadata["error_frames"]) == (frames, errors)
