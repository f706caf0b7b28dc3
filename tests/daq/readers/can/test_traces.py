"""Logs of CAN buses beyond Vector's and can-utils' own: PEAK, python-can, MDF, compressed; and their traps."""

from __future__ import annotations

import gzip
import math
import os
import sqlite3
import time
from datetime import UTC, datetime
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, NoSignalError, ReadError
from recoil_acquisition.readers.can import lines as can_lines
from recoil_acquisition.readers.can import log as can_log
from recoil_acquisition.readers.can.asc import read_asc
from recoil_acquisition.readers.can.blf_objects import read_blf
from recoil_acquisition.readers.can.candump import read_candump
from recoil_acquisition.readers.can.csv import read_can_csv, read_canedge_csv
from recoil_acquisition.readers.can.frames import CanFrames, CanLog
from recoil_acquisition.readers.can.mdf import read_mdf
from recoil_acquisition.readers.can.sqlite import read_can_sqlite
from recoil_acquisition.readers.can.trc import read_trc
from recoil_acquisition.readers.head import GZIP
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders import can_logs, mdf_logs
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, EXT, CanEntry, asc_log, blf_log, can_entries, candump_log

A = Path("a")
ENTRIES = can_entries(30)


ENDLESS = """
CREATE VIEW messages AS
WITH RECURSIVE n(ts) AS (SELECT 1 UNION ALL SELECT ts + 1 FROM n)
SELECT ts, ts AS arbitration_id, 0 AS extended, 0 AS remote, 0 AS error, 0 AS dlc, x'' AS data FROM n
"""


def trc(lines: str, version: str = "2.1") -> CanLog:
    head = can_logs.trc_log([], version=version)
    return read_trc(A, head.replace(b"\r", b"") + lines.encode())


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.3", "2.0", "2.1"])
def test_an_entry_without_a_line_end_is_whole_if_it_has_as_many_bytes_as_it_states(version: str) -> None:
    content = can_logs.trc_log(ENTRIES, version=version).replace(b"\r", b"").rstrip()
    log = read_trc(A, content)
    assert as_entries(log.frames) == as_entries(read_trc(A, content + b"\n").frames)
    assert log.frames.key.size == len(ENTRIES)
    assert not log.incomplete
    for less in (1, 2, 4):
        log = read_trc(A, content[:-less])
        assert (log.frames.key.size, bool(log.incomplete)) == (len(ENTRIES) - 1, True)


def as_entries(frames: CanFrames) -> list[CanEntry]:
    rows = zip(frames.time_s, frames.key, frames.data, frames.length, strict=True)
    return [(round(t * 1e9), int(key), bytes(data[:n])) for t, key, data, n in rows]


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.3", "2.0", "2.1"])
def test_every_version_of_a_trace_gives_the_same_frames(version: str) -> None:
    log = read_trc(A, can_logs.trc_log(ENTRIES, version=version).replace(b"\r", b""))
    assert as_entries(log.frames) == ENTRIES
    assert log.metadata["version"] == version
    assert set(log.frames.channel.tolist()) == {1}
    start = log.absolute_start
    assert (start is None) == (version == "1.0")
    if start is not None:
        assert (start.text, start.zone) == ("2023-11-14T22:13:20.250", "unknown")


def test_every_other_log_gives_the_same_frames(tmp_path: Path) -> None:
    csv = read_can_csv(can_logs.can_csv(ENTRIES))
    canedge = read_canedge_csv(can_logs.canedge_csv(ENTRIES, channel=2).replace(b"\r\n", b"\n"))
    sqlite = read_can_sqlite(written(tmp_path, "a.db", can_logs.can_sqlite(ENTRIES)))
    mdf = read_mdf(written(tmp_path, "a.mf4", mdf_logs.bus_log(ENTRIES, errors=2)))
    assert as_entries(csv.frames) == as_entries(canedge.frames) == ENTRIES
    assert set(canedge.frames.channel.tolist()) == {2}
    assert canedge.stores_buses
    assert canedge.absolute_start is not None
    assert canedge.absolute_start.zone == "UTC"
    for log in (sqlite, mdf):  # their stamps are float64 seconds
        assert [e[1:] for e in as_entries(log.frames)] == [e[1:] for e in ENTRIES]
        np.testing.assert_allclose(log.frames.time_s, [e[0] / 1e9 for e in ENTRIES], atol=3e-7, rtol=0)
    for log in (csv, sqlite, mdf):
        assert log.absolute_start is not None
        assert log.absolute_start.text == "2023-11-14T22:13:20.250000"
        assert log.absolute_start.zone == "UTC"
    assert mdf.metadata["error_frames"] == 2
    assert any("2 error frames" in note for note in mdf.notes)


def test_a_trace_of_an_unknown_version_or_without_columns_is_refused() -> None:
    with pytest.raises(ReadError, match=r"version '3\.0' of the trace is not known"):
        read_trc(A, b";$FILEVERSION=3.0\n")
    for columns in ("", ";$COLUMNS=N,O,T,B,d,R,L,D\n", ";$COLUMNS=N,O,T,I,D\n"):
        with pytest.raises(CorruptFileError, match="columns"):
            read_trc(A, f";$FILEVERSION=2.0\n{columns}".encode())


def test_error_status_and_remote_entries_of_a_trace_never_become_data() -> None:
    log = trc(
        "1 1.0 DT 1 0100 Rx - 2 01 02\n2 2.0 ER 1 - Rx - 5 04 00 02 00 00\n3 3.0 ST 1 - Rx - 4 00 00 00 02\n"
        "4 4.0 RR 1 0100 Rx - 8\n5 5.0 EC 1 - Rx - 2 01 02\n6 6.0 ST 1 - Rx - 4 00 00 00 08\n"
    )
    assert as_entries(log.frames) == [(1_000_000, 0x100, b"\1\2")]
    assert log.metadata["error_frames"] == log.metadata["remote_frames"] == 1
    assert (log.metadata["other_events"], log.metadata["overruns"]) == (3, 1)
    assert any("1 status entries report an overrun" in note for note in log.notes)
    old = read_trc(A, b";\n 1)  1 FFFFFFFF 4 00 00 00 08\n 2)  2 0100 8 RTR\n 3)  3 0100 1 0A\n")
    assert as_entries(old.frames) == [(3_000_000, 0x100, b"\n")]
    assert (old.metadata["other_events"], old.metadata["remote_frames"]) == (1, 1)
    error = trc("1) 1.0 Error 0008 4 00 19 08 08\n2) 2.0 Rx 0100 1 01\n3) 3.0 Warng FFFFFFFF 4 00 00 00 02\n", "1.1")
    assert (error.metadata["error_frames"], error.metadata["overruns"]) == (1, 1)


def test_the_length_code_of_an_fd_frame_in_a_trace_is_no_number_of_bytes() -> None:
    octets = bytes(range(64)).hex(" ")
    log = trc(f"1 1.0 FB 1 0100 Rx - 15 {octets}\n2 2.0 FD 1 00000101 Rx - 9 {octets[:35]}\n")
    assert log.frames.length.tolist() == [64, 12]
    assert log.frames.data[0].tolist() == list(range(64))
    assert log.frames.key.tolist() == [0x100, 0x80000101]
    lengths = trc(f"1 1.0 FB 0100 Rx 64 {octets}\n", "2.0")
    assert lengths.frames.length.tolist() == [64]


def test_negative_times_of_a_trace_are_kept() -> None:
    assert trc("1 -2.5 DT 1 0100 Rx - 0\n2 0.5 DT 1 0100 Rx - 0\n").frames.time_s.tolist() == [-2.5e-3, 5e-4]


@pytest.mark.parametrize(
    "line",
    [
        "1 1.0 DT 1 0900 Rx - 1 00",
        "1 1.0 DT 1 3FFFFFFF Rx - 1 00",
        "1 1.0 DT 1 0100 Rx - 3 00 01",
        "1 1.0 DT 1 0100 Rx - 1 0g",
        "1 x.0 DT 1 0100 Rx - 1 00",
        "1 1.0 FD 1 0100 Rx - 16 00",
        "1 1.0 DT 1 0100",
        "1 9999999999999.0 DT 1 0100 Rx - 1 00",
        "1 1.0 DT a 0100 Rx - 1 00",
    ],
)
def test_a_damaged_entry_of_a_trace_is_counted(line: str) -> None:
    log = trc(f"{line}\n2 2.0 DT 1 0100 Rx - 1 05\n")
    assert log.frames.data[:, 0].tolist() == [5]
    assert log.metadata["damaged_entries"] == 1


def test_messages_longer_than_a_frame_are_other_events_of_a_trace() -> None:
    octets = " ".join(["00"] * 100)
    assert trc(f"1 1.0 DT 1 0100 Rx - 100 {octets}\n").metadata["other_events"] == 1


def test_python_cans_writer_of_traces_is_read_with_its_channel_numbering(tmp_path: Path) -> None:
    path = tmp_path / "a.trc"
    with can.TRCWriter(str(path)) as writer:
        for i in range(5):
            writer.on_message_received(
                can.Message(timestamp=1.7e9 + i * 1e-3, arbitration_id=0x1FF0000 + i, data=[i], channel=1)
            )
    log = read_trc(path, path.read_bytes().replace(b"\r", b""))
    assert log.frames.channel.tolist() == [2] * 5
    assert log.frames.key.tolist() == [0x81FF0000 + i for i in range(5)]


@pytest.mark.parametrize("stamp", ["1e-05", "np.float64(1e-05)", "1.0E-5".lower()])
def test_stamps_that_no_clock_gave_are_kept_as_they_are_stored(stamp: str) -> None:
    log = read_can_csv(f"{can_logs.can_csv([]).decode()}{stamp},0x100,0,0,0,1,BQ==\n".encode())
    assert log.frames.time_s.tolist() == [1e-5]
    assert log.absolute_start is None


def test_stamps_that_python_can_cannot_read_back_are_read() -> None:
    rows = "".join(f"np.float64(1700000000.25{i}),0x100,0,0,0,1,BQ==\n" for i in range(3))
    assert read_can_csv((can_logs.can_csv([]).decode() + rows).encode()).frames.time_s.tolist() == [0.0, 1e-3, 2e-3]


def test_error_and_remote_rows_of_a_table_never_become_data(tmp_path: Path) -> None:
    rows = ["1.7e9,0x4,1,0,1,8,AAEAAAAAAAA=", "1.7e9,0x100,0,1,0,8,", "1.7e9,0x100,0,0,0,2,BQ==", "nonsense"]
    log = read_can_csv(can_logs.can_csv(ENTRIES, extra=rows))
    base = can_logs.can_sqlite(
        ENTRIES,
        extra=[
            (1.7e9, 4, 1, 0, 1, 8, bytes(8)),
            (1.7e9, 0x100, 0, 1, 0, 8, b""),
            (1.7e9, 0x100, 0, 0, 0, 2, b"1"),
            (None, 0x100, 0, 0, 0, 1, b"1"),
        ],
    )
    for one in (log, read_can_sqlite(written(tmp_path, "a.db", base))):
        assert one.frames.key.size == len(ENTRIES)
        counts = [one.metadata[k] for k in ("error_frames", "remote_frames", "damaged_entries")]
        assert counts == [1, 1, 2]


def test_a_table_appended_to_with_its_header_again_is_read() -> None:
    content = can_logs.can_csv(ENTRIES[:5]) + can_logs.can_csv(ENTRIES[5:])
    assert as_entries(read_can_csv(content).frames) == ENTRIES


@pytest.mark.parametrize(
    ("schema", "problem"),
    [
        ("CREATE TABLE messages (ts REAL, arbitration_id INTEGER)", "the table has the columns ts, arbitration_id"),
        ("CREATE TABLE other (ts REAL, arbitration_id INTEGER)", "'messages' is no plain table"),
        (ENDLESS, "'messages' is no plain table"),
    ],
)
def test_a_database_without_the_table_is_refused(schema: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=problem):
        read_can_sqlite(written(tmp_path, "a.db", can_logs.can_sqlite([], schema=schema)))


def test_a_database_is_never_written_to_and_a_journal_beside_it_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, "a.db", can_logs.can_sqlite(ENTRIES))
    path.chmod(0o444)
    written(tmp_path, "a.db-wal", b"")
    log = read_can_sqlite(path)
    assert "a.db-wal beside it was not read" in log.notes[-1]
    assert log.incomplete
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.db", "a.db-wal"]


def test_a_database_of_python_can_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    writer = can.SqliteWriter(path)
    for i in range(20):
        writer(can.Message(timestamp=1.7e9 + i * 1e-3, arbitration_id=i, is_extended_id=i % 2 == 0, data=[i]))
    writer.stop()
    assert recognise(path).name == "python-can SQLite log"
    log = read_can_sqlite(path)
    with sqlite3.connect(path) as base:
        assert log.frames.key.size == base.execute("SELECT COUNT(*) FROM messages").fetchone()[0] == 20
    base.close()
    assert log.frames.key.tolist() == [i | (0x80000000 if i % 2 == 0 else 0) for i in range(20)]


def test_several_members_of_a_compressed_log_are_read_and_a_cut_one_is_told(tmp_path: Path) -> None:
    text = candump_log(ENTRIES)
    content = gzip.compress(text[:500]) + gzip.compress(text[500:])
    assert can_log.read_unpacked(written(tmp_path, "a.gz", content)) == (text, "")
    path = written(tmp_path, "a.gz", content[:-20])
    recording = recognise(path).open(path, Declarations("can", database=DBC))
    assert "the compressed file is cut" in recording.incomplete
    assert any("the compressed file is cut" in note for note in recording.notes)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    texts=st.lists(st.binary(max_size=60), min_size=1, max_size=6), padding=st.integers(0, 20), part=st.integers(1, 40),
    cut=st.integers(0, 30),
)  # fmt: skip
def test_members_of_a_compressed_log_may_lie_in_any_part_of_it(
    texts: list[bytes], padding: int, part: int, cut: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    members = [gzip.compress(text, mtime=0) for text in texts]
    monkeypatch.setattr(can_log, "PART_BYTES", part)
    path = written(tmp_path, "a.gz", b"".join(members) + bytes(padding))
    assert can_log.read_unpacked(path) == (b"".join(texts), "")
    whole = b"".join(members[:-1])
    if cut >= len(GZIP):
        content, told = can_log.read_unpacked(written(tmp_path, "a.gz", whole + members[-1][: min(cut, 12)]))
        assert content.startswith(b"".join(texts[:-1]))
        assert "the compressed file is cut" in told
    monkeypatch.undo()


@pytest.mark.exhaustive
def test_a_compressed_log_of_many_members_takes_time_by_its_size(tmp_path: Path) -> None:
    lines = [b"%d,1.5,2.5\n" % i for i in range(40_000)]
    members = [gzip.compress(line, 1, mtime=0) for line in lines]
    took_s = []
    for count in (10_000, 40_000):
        path = written(tmp_path, "a.gz", b"".join(members[:count]))
        before = time.process_time()
        assert can_log.read_unpacked(path) == (b"".join(lines[:count]), "")
        took_s.append(time.process_time() - before)
    assert took_s[1] < 9 * took_s[0] + 0.2


@pytest.mark.exhaustive
def test_compressed_logs_that_are_damaged_or_grow_without_bound_are_refused(tmp_path: Path) -> None:
    content = bytearray(gzip.compress(candump_log(ENTRIES)))
    content[-6] ^= 1
    with pytest.raises(CorruptFileError, match="does not unpack"):
        can_log.read_unpacked(written(tmp_path, "a.gz", bytes(content)))
    once = gzip.compress(b"x")
    with pytest.raises(CorruptFileError, match=f"byte {len(once) + 7}: something else follows"):
        can_log.read_unpacked(written(tmp_path, "a.gz", once + bytes(7) + b"junk"))
    assert can_log.read_unpacked(written(tmp_path, "a.gz", once + bytes(7))) == (b"x", "")
    with pytest.raises(ReadError, match="unpacks to more than 3 MB"):
        can_log.read_unpacked(written(tmp_path, "a.gz", gzip.compress(bytes(20_000_000))))
    with pytest.raises(ReadError, match="unpacks to more than 94 MB"):
        can_log.read_unpacked(written(tmp_path, "a.gz", gzip.compress(bytes(100_000_000) + os.urandom(900_000), 1)))


LINES = st.lists(
    st.one_of(
        st.builds(
            "{}{:>11.6f} {}  {:<15} {}   d {} {}{}".format,
            st.sampled_from(["", " ", "\t"]),
            st.floats(-2, 2000),
            st.sampled_from("12a"),
            st.sampled_from(["100", "7FF", "800", "18FF0100x", "3FFFFFFFx", "name", "ab"]),
            st.sampled_from(["Rx", "Tx", "TxRq"]),
            st.sampled_from("0128"),
            st.sampled_from(["00", "00 01", "00 11 22 33 44 55 66 77", "0g 01", "001 2"]),
            st.sampled_from(["", " ", "  Length = 240015 BitCount = 124 ID = 1785", "x"]),
        ),
        st.sampled_from(["", "   1.5 1 ErrorFrame", "   1.0 1  Statistic: D 0", "// a note", "1.0 1 100 Rx r"]),
    ),
    max_size=60,
)


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(lines=LINES)
def test_lines_of_an_asc_log_mean_the_same_whether_read_together_or_alone(lines: list[str]) -> None:
    """A line that states the base anew makes the reader take every line in turn."""
    text = "date x\nbase hex timestamps absolute\n" + "".join(f"{line}\n" for line in lines)
    together = read_asc(text.encode())
    alone = read_asc(f"base dec timestamps absolute\n{text}".encode())
    assert as_entries(together.frames) == as_entries(alone.frames)
    assert together.frames.channel.tolist() == alone.frames.channel.tolist()
    assert together.metadata == alone.metadata


CANDUMP = st.lists(
    st.builds(
        "({}.{}) {} {}#{}{}".format,
        st.integers(10**9, 10**11),
        st.sampled_from(["000001", "123456", "123456789", "12345"]),
        st.sampled_from(["can0", "can1", "vcan10"]),
        st.sampled_from(["100", "7FF", "FFF", "18FF0100", "20000004", "A0000004", "98FF0100", "zzz"]),
        st.sampled_from(["", "00", "0011223344556677", "0011223344556677_C", "R", "R8", "#1AABB", "0", "0g", "#"]),
        st.sampled_from(["", " R", " T"]),
    ),
    max_size=60,
)


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=CANDUMP)
def test_lines_of_a_candump_mean_the_same_whether_read_together_or_alone(
    lines: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "".join(f"{line}\n" for line in lines).encode()
    together = read_candump(text)
    with monkeypatch.context() as patch:
        patch.setattr(can_lines, "_FRUITLESS", 0)
        alone = read_candump(text)
    assert as_entries(together.frames) == as_entries(alone.frames)
    assert together.frames.channel.tolist() == alone.frames.channel.tolist()
    assert together.metadata == alone.metadata


@settings(max_examples=40, deadline=None)
@given(at=st.integers(0, 29), data=st.sampled_from([b"LOBJ", b"LOBJ\x20\0\1\0", b"xLOBJxxx"]))
def test_data_that_looks_like_the_next_object_of_a_blf_log_is_data(at: int, data: bytes) -> None:
    entries = list(ENTRIES)
    entries[at] = (entries[at][0], EXT, data)
    log = read_blf(A, blf_log(entries))
    assert [e[1] for e in as_entries(log.frames)] == [e[1] for e in entries]
    assert as_entries(log.frames)[at][2] == data


# the faults of python-can's own readers, each by its name


def pythons(path: Path) -> list[can.Message]:
    with can.LogReader(path) as log:
        return list(log)


def test_candump_rx_overflow_is_an_error_frame_where_python_can_reads_data(tmp_path: Path) -> None:
    text = b"(1.000000) can0 20000004#0001000000000000\n(1.000000) can0 100#00\n"
    path = written(tmp_path, "a.log", text)
    assert not pythons(path)[0].is_error_frame
    assert read_candump(text).metadata["error_frames"] == 1


def test_relative_asc_stamps_are_summed_where_python_can_takes_them_for_absolute(tmp_path: Path) -> None:
    path = written(tmp_path, "a.asc", asc_log(ENTRIES, relative=True))
    theirs = [m.timestamp for m in pythons(path)]
    ours = read_asc(path.read_bytes()).frames.time_s
    np.testing.assert_allclose(ours, [t / 1e9 for t, _, _ in ENTRIES], atol=1e-9)
    assert max(theirs) < 0.01 < ours[-1]


def test_negative_asc_times_are_kept_where_python_can_drops_them(tmp_path: Path) -> None:
    entries = [(t, 0x100, bytes(8)) for t in (-2_000_000, 1_000_000)]
    path = written(tmp_path, "a.asc", asc_log(entries))
    assert len(pythons(path)) == 1
    assert read_asc(path.read_bytes()).frames.time_s.tolist() == [-2e-3, 1e-3]


def test_negative_blf_times_are_kept_where_python_can_wraps_them(tmp_path: Path) -> None:
    path = written(tmp_path, "a.blf", blf_log([(-2_000_000, 0x100, bytes(8))]))
    assert read_blf(path, path.read_bytes()).frames.time_s.tolist() == [-2e-3]
    assert pythons(path)[0].timestamp > 1e10


def test_blf_start_is_of_an_unknown_zone_where_python_can_says_utc(tmp_path: Path) -> None:
    path = written(tmp_path, "a.blf", blf_log(ENTRIES))
    with can.BLFReader(path) as theirs:
        assert theirs.start_timestamp == datetime(2023, 11, 14, 22, 13, 20, 250_000, tzinfo=UTC).timestamp()
    start = read_blf(path, path.read_bytes()).absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2023-11-14T22:13:20.250", "unknown")


def test_trace_start_is_of_an_unknown_zone_where_python_can_says_utc() -> None:
    start = read_trc(A, can_logs.trc_log(ENTRIES).replace(b"\r", b"")).absolute_start
    assert start is not None
    assert start.zone == "unknown"


def test_a_cut_compressed_log_is_read_to_its_end_where_python_can_raises(tmp_path: Path) -> None:
    path = written(tmp_path, "a.log.gz", gzip.compress(candump_log(ENTRIES), mtime=0)[:-12])
    with pytest.raises(EOFError):
        pythons(path)
    recording = recognise(path).open(path, Declarations("can", database=DBC))
    assert recording.metadata["data_frames"] > len(ENTRIES) // 2
    assert recording.incomplete


def test_channels_are_numbered_as_the_log_has_them_where_python_can_counts_from_nought(tmp_path: Path) -> None:
    path = written(tmp_path, "a.asc", asc_log(ENTRIES))
    assert {m.channel for m in pythons(path)} == {0}
    assert set(read_asc(path.read_bytes()).frames.channel.tolist()) == {1}


# every real log


@pytest.mark.parametrize(
    ("name", "frames", "errors", "remote", "others"),
    [
        ("00000170.MF4", 2010, 0, 0, 0),
        ("logfile.asc", 12, 4, 4, 12),
        ("logfile_errorframes.asc", 7, 3, 2, 3),
        ("single_frame_us_locale.asc", 1, 0, 0, 1),
        ("test_CanFdMessage.asc", 3, 0, 0, 1),
        ("test_CanFdMessage.blf", 2, 0, 0, 2),
        ("test_CanMessage.asc.gz", 2, 0, 0, 1),
        ("test_CanMessage.blf", 2, 0, 0, 2),
        ("test_CanMessage.trc", 2, 0, 0, 0),
        ("test_CanMessage_V2_1.trc", 10, 0, 0, 1),
        ("rig_shot/rig_shot.asc", 2999, 1, 0, 1),
        ("rig_shot/rig_shot.blf", 2999, 1, 0, 0),
        ("rig_shot/rig_shot.csv", 2999, 1, 0, 0),
        ("rig_shot/rig_shot.log", 2999, 1, 0, 0),
        ("rig_shot/rig_shot.mf4", 2999, 1, 0, 0),
        ("rig_shot/rig_shot.trc", 2999, 0, 0, 0),
    ],
)
def test_every_real_log_holds_what_it_should(name: str, frames: int, errors: int, remote: int, others: int) -> None:
    path = shared_file(f"can/{name}")
    recording = recognise(path).open(path, Declarations("can", database=DBC))
    keys = ("data_frames", "error_frames", "remote_frames", "other_events", "damaged_entries")
    assert [recording.metadata[key] for key in keys] == [frames, errors, remote, others, 0]


@pytest.mark.parametrize(
    ("name", "errors"), [("test_CanErrorFrames.asc", 4), ("test_CanErrorFrameExt.blf", 2)], ids=["asc", "blf"]
)
def test_a_real_log_of_nothing_but_errors_is_refused(name: str, errors: int) -> None:
    path = shared_file(f"can/{name}")
    with pytest.raises(NoSignalError, match=f"no data frames.*found {errors} error frames"):
        recognise(path).open(path, Declarations("can", database=DBC))


@pytest.mark.parametrize("suffix", ["asc", "blf", "log", "trc", "csv", "mf4"])
def test_all_logs_of_the_generated_shot_agree_with_its_truth(suffix: str) -> None:
    path = shared_file(f"can/rig_shot/rig_shot.{suffix}")
    truth = np.load(path.parent / "rig_shot_truth.npz")
    declared = Declarations("can", database=(path.parent / "rig.dbc").read_text())
    recording = recognise(path).open(path, declared)
    kept = np.delete(np.arange(1500), truth["dropped_acc_index"])
    whole = ~np.isnan(recording.read("ACC.p_brake"))
    assert math.isclose((~whole).sum(), 1)
    assert any("ACC.p_brake: 1 frames are too short" in note for note in recording.notes)
    for name in ("ax", "ay", "az", "p_brake"):
        np.testing.assert_allclose(recording.read(f"ACC.{name}")[whole], truth[name][kept], rtol=1e-12)
    for name in ("gx", "gy", "gz", "temp"):
        np.testing.assert_allclose(recording.read(f"GYR.{name}"), truth[name], rtol=1e-12)
    times_s = recording.time_base("ACC.ax").times_s[whole]
    np.testing.assert_allclose(times_s - times_s[0], truth["t"][kept] - truth["t"][0], atol=1e-6)
    assert recording.metadata["unknown_identifiers"] == {"0x18fef100 (29 bit)": 1}
    assert recording.absolute_start is not None
    assert abs(datetime.fromisoformat(recording.absolute_start.text) - datetime(2023, 11, 14, 22, 13, 20, 250_000)) < (
        datetime(2023, 1, 1, 0, 0, 0, 2000) - datetime(2023, 1, 1)
    )
