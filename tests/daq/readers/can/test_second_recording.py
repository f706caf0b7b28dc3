"""Two recordings in one log: each at its own time, or a refusal that says where the second one begins."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.can.asc import month_of, read_asc
from recoil_acquisition.readers.can.recording import CanRecording
from recoil_acquisition.readers.can.second_recording import second_begins
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from recoil_acquisition.remark import CautionCode
from tests.builders.can_logs import can_csv, can_sqlite, canedge_csv, trc_log
from tests.builders.mdf_logs import bus_log
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, CanEntry, asc_log, blf_log, can_entries, candump_log


def entries(first: int, count: int = 6, from_ms: int = 100) -> list[CanEntry]:
    """Frames 100 ms apart whose first signal counts in 0.01 from a number."""
    return [((from_ms + 100 * k) * 1_000_000, 0x100, struct.pack("<hHHH", first + k, 0, 0, 0)) for k in range(count)]


def opened(path: Path, content: bytes, database: str = DBC) -> CanRecording:
    path.write_bytes(content)
    recording = surest_claim(Head.of(path))[1][0].open(path, Declarations("can", database=database))
    assert isinstance(recording, CanRecording)
    return recording


def asc(first: int, date: str, *, relative: bool = False) -> bytes:
    return asc_log(entries(first), relative=relative).replace(b"Tue Nov 14 22:13:20.250 2023", date.encode("cp1252"))


@pytest.mark.parametrize("packed", [bytes, gzip.compress], ids=["plain", "gzip"])
@pytest.mark.parametrize("relative", [False, True])
def test_asc_logs_that_were_put_together_are_each_at_their_own_time(
    relative: bool, packed: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    parts = [
        asc(0, "Thu Apr 16 01:59:01.000 pm 2020", relative=relative),
        asc(100, "Thu Apr 16 02:59:01.000 pm 2020", relative=relative),
        asc(200, "jeu. avr. 16 16:00:00.500 2020"),
    ]
    recording = opened(tmp_path / "a.asc", b"".join(map(packed, parts)))
    own_s = 0.1 * np.arange(1, 7)
    expected_s = np.concatenate([own_s, 3600.0 + own_s, 7259.5 + own_s])
    assert recording.time_base("ACC.ax").times_s == pytest.approx(expected_s)
    assert recording.read("ACC.ax") == pytest.approx(0.01 * np.r_[0:6, 100:106, 200:206])
    assert any("a second recording begins in line" in note and "3600 s after the first" in note
               for note in recording.notes)  # fmt: skip
    assert recording.absolute_start is not None
    assert recording.absolute_start.text == "2020-04-16T13:59:01.000"


@pytest.mark.parametrize(
    ("second", "found"),
    [
        ("Xyz Foo 16 14:59:01.000 2020", "and when is not understood or not said"),
        ("Thu Apr 16 13:59:01.300 2020", "at 2020-04-16T13:59:01.300, before the one in front of it ended"),
        ("Thu Apr 16 12:59:01.000 2020", "at 2020-04-16T12:59:01.000, before the one in front of it ended"),
    ],
)
def test_asc_logs_whose_order_is_not_known_are_refused(second: str, found: str, tmp_path: Path) -> None:
    first = asc(0, "Thu Apr 16 13:59:01.000 2020")
    with pytest.raises(CorruptFileError, match=f"line 13: a second recording begins in this log, {found}; take"):
        opened(tmp_path / "a.asc", first + asc(100, second))


def test_trigger_blocks_of_one_measurement_go_on_in_its_time() -> None:
    head = "date Thu Apr 16 13:59:01.000 2020\nbase hex  timestamps absolute\n"
    block = "Begin Triggerblock Thu Apr 16 13:59:01.000 2020\n   {0}00000 1  100 Rx   d 1 0{1}\nEnd TriggerBlock\n"
    log = read_asc((head + block.format("1.0", 1) + block.replace("59:01", "59:31").format("31.0", 2)).encode())
    assert log.frames.time_s.tolist() == [1.0, 31.0]
    anew = read_asc((head + block.format("1.0", 1) + block.replace("59:01", "59:31").format("0.5", 2)).encode())
    assert anew.frames.time_s.tolist() == [1.0, 30.5]


def test_the_joined_logs_of_the_reports() -> None:
    path, database = shared_file("reports/asc_joined.asc"), shared_file("reports/two_bus.dbc").read_text()
    recording = surest_claim(Head.of(path))[1][0].open(path, Declarations("can", database=database))
    assert recording.read("IMU.Accel") == pytest.approx([0.01, 0.02, 0.03, 0.17, 0.18, 0.19, 0.2, 0.21, 0.22])
    expected_s = [0.1, 0.2, 0.3, *(3600.0 + 0.1 * k for k in range(1, 7))]
    assert recording.time_base("IMU.Accel").times_s == pytest.approx(expected_s)


@pytest.mark.parametrize("version", ["1.1", "1.3", "2.0", "2.1"])
def test_traces_that_were_put_together_are_each_at_their_own_time(version: str, tmp_path: Path) -> None:
    first, second = (trc_log(entries(number), version=version) for number in (0, 100))
    recording = opened(tmp_path / "a.trc", first + second.replace(b"45244.925928819444", b"45244.967595486111"))
    own_s = 0.1 * np.arange(1, 7)
    assert recording.time_base("ACC.ax").times_s == pytest.approx(np.r_[own_s, 3600.0 + own_s], abs=1e-4)
    assert recording.read("ACC.ax") == pytest.approx(0.01 * np.r_[0:6, 100:106])
    with pytest.raises(CorruptFileError, match="a second recording begins in this log, before the one in front"):
        opened(tmp_path / "b.trc", first + second)
    with pytest.raises(CorruptFileError, match="a second recording begins in this log, and when is not understood"):
        opened(tmp_path / "c.trc", first + second.replace(b";$STARTTIME=45244.925928819444", b";$STARTTIME=Tue"))


def without_header(content: bytes, lines: int) -> bytes:
    return content.split(b"\n", lines)[lines]


LATER = 3_600_000_000
ANEW: dict[str, Callable[[], bytes]] = {
    "a.log": lambda: candump_log(entries(0, from_ms=9000)) + candump_log(entries(100)),
    "b.log": lambda: candump_log(entries(0)) + candump_log(entries(100)),
    "a.csv": lambda: can_csv(entries(0), zero_us=0) + without_header(can_csv(entries(100), zero_us=0), 1),
    "b.csv": lambda: can_csv(entries(0), zero_us=0) + can_csv(entries(100), zero_us=0),
    "c.csv": lambda: canedge_csv(entries(0, from_ms=9000)) + canedge_csv(entries(100)),
    "a.db": lambda: can_sqlite([*entries(0, from_ms=9000), *entries(100)]),
    "a.trc": lambda: trc_log(entries(0), version="1.0") + trc_log(entries(100), version="1.0"),
    "a.asc": lambda: asc_log(entries(0)) + without_header(asc_log(entries(100)), 5),
    "a.blf": lambda: blf_log([*entries(0), *entries(100)]),
    "b.blf": lambda: blf_log(entries(0)) + blf_log(entries(100)),
    "a.mf4": lambda: bus_log([*entries(0), *entries(100)]),
}


@pytest.mark.parametrize("name", ANEW)
def test_a_log_whose_stamps_begin_anew_is_refused_with_the_place(name: str, tmp_path: Path) -> None:
    place = r"byte \d+" if name == "b.blf" else "frame 7 of"
    with pytest.raises(CorruptFileError, match=rf"{place}.*: a second recording begins in this log, .*; take the rec"):
        opened(tmp_path / name, ANEW[name]())


APPENDED: dict[str, Callable[[], bytes]] = {
    "a.log": lambda: candump_log(entries(0)) + candump_log(entries(100, from_ms=3_600_100)),
    "a.csv": lambda: can_csv(entries(0)) + can_csv(entries(100), zero_us=1_700_000_000_250_000 + LATER),
    "a.db": lambda: can_sqlite([*entries(0), *entries(100, from_ms=3_600_100)]),
    "a.mf4": lambda: bus_log([*entries(0), *entries(100, from_ms=3_600_100)]),
    "a.blf": lambda: blf_log([*entries(0), *entries(100, from_ms=3_600_100)]),
}


@pytest.mark.parametrize("name", APPENDED)
def test_a_log_with_stamps_of_a_clock_may_be_gone_on_with(name: str, tmp_path: Path) -> None:
    recording = opened(tmp_path / name, APPENDED[name]())
    own_s = 0.1 * np.arange(6)
    times_s = recording.time_base("ACC.ax").times_s
    assert times_s - times_s[0] == pytest.approx(np.r_[own_s, 3600.0 + own_s], abs=1e-5)
    assert recording.read("ACC.ax") == pytest.approx(0.01 * np.r_[0:6, 100:106])


def test_a_stamp_that_is_off_and_a_frame_that_waited_begin_no_second_recording() -> None:
    times_ns = np.arange(20) * 10_000_000
    channel = np.zeros(20, dtype=np.int64)
    assert second_begins(times_ns, channel) is None
    for at, wrong_ns in ((5, 10**15), (9, -(10**15)), (19, 0), (0, 10**15)):
        spoilt = times_ns.copy()
        spoilt[at] = wrong_ns
        assert second_begins(spoilt, channel) is None
    waited = times_ns.copy()
    waited[[6, 7, 8, 9]] = waited[[8, 9, 6, 7]]
    assert second_begins(waited, channel) is None
    two_queues = np.r_[times_ns, times_ns]
    assert second_begins(two_queues, np.repeat([0, 1], 20)) is None  # one bus behind the other
    assert second_begins(two_queues, np.zeros(40, dtype=np.int64)) == 20


@pytest.mark.parametrize(
    ("names", "language"),
    [
        ("Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec", "en"),
        ("Jan Feb Mrz Apr Mai Jun Jul Aug Sep Okt Nov Dez", "de"),
        ("Jan Feb Mär Apr Mai Jun Jul Aug Sep Okt Nov Dez", "de"),
        ("janv févr mars avr mai juin juil août sept oct nov déc", "fr"),
        ("gen feb mar apr mag giu lug ago set ott nov dic", "it"),
        ("ene feb mar abr may jun jul ago sep oct nov dic", "es"),
        ("jan fev mar abr mai jun jul ago set out nov dez", "pt"),
        ("jan feb mrt apr mei jun jul aug sep okt nov dec", "nl"),
        ("jan feb mar apr maj jun jul aug sep okt nov dec", "sv"),
        ("jan feb mar apr mai jun jul aug sep okt nov des", "no"),
        ("January February March April May June July August September October November December", "en"),
        ("janvier février mars avril mai juin juillet août septembre octobre novembre décembre", "fr"),
        ("Januar Februar März April Mai Juni Juli August September Oktober November Dezember", "de"),
    ],
)
def test_months_are_known_in_the_languages_of_the_recorders_computers(names: str, language: str) -> None:
    assert [month_of(name) for name in names.split()] == list(range(1, 13)), language


@pytest.mark.parametrize("name", ["xyz", "ju", "j", "lis", ""])
def test_a_name_that_is_of_no_month_or_of_several_is_none(name: str) -> None:
    assert month_of(name) is None


def test_a_french_date_and_one_that_is_not_understood() -> None:
    path, database = shared_file("reports/asc_fr.asc"), shared_file("reports/two_bus.dbc").read_text()
    recording = surest_claim(Head.of(path))[1][0].open(path, Declarations("can", database=database))
    assert recording.absolute_start is not None
    assert recording.absolute_start.text.startswith("2020-04-16T13:59:01")
    assert (recording.read("IMU.Accel")[0], recording.time_base("IMU.Accel").start_s) == (0.01, 0.5)
    log = read_asc("date Чт апр 16 13:59:01.000 2020\nbase hex  timestamps absolute\n 0.5 1 100 Rx d 0\n".encode())
    assert log.absolute_start is None
    assert any("when the log began is not understood: 'Чт апр 16" in note for note in log.notes)


def asc_lines() -> list[str]:
    return asc_log(can_entries()).decode().splitlines(keepends=True)


def test_a_trigger_block_that_is_dated_apart_from_its_stamps_is_noted() -> None:
    lines = asc_lines()
    for date, noted in (("Tue Nov 14 23:13:20.250 2023", 1), ("Tue Nov 14 22:13:20.265 2023", 0)):
        block = ["End TriggerBlock\n", f"Begin Triggerblock {date}\n"]
        log = read_asc("".join([*lines[:40], *block, *lines[40:]]).encode())
        told = [str(note) for note in log.notes if "its stamps go on from" in note]
        assert len(told) == noted
        assert all("line 42 is dated 2023-11-14T23:13:20.250, +3600 s from the first" in one for one in told)


def test_a_frame_that_was_requested_and_sent_counts_once_and_a_name_is_no_damage() -> None:
    plain = read_asc("".join(asc_lines()).encode())
    twice = [
        part for line in asc_lines() for part in ([line.replace(" Rx ", " TxRq "), line] if " Rx " in line else [line])
    ]
    log = read_asc("".join(twice).encode())
    assert log.frames.key.tolist() == plain.frames.key.tolist()
    assert log.metadata["other_kinds"]["TxRq"] == plain.frames.key.size
    named = read_asc("".join(asc_lines()).replace(" 100 ", " Engine_1 ").encode())
    assert named.metadata["damaged_entries"] == 0
    assert [note.code for note in named.notes] == [CautionCode.UNKNOWN_ENTRIES]
