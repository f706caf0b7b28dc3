"""Frames that a host stamped late are dated by their counter, whatever file they came from; else it is said."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.can.log import CANDUMP
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.remark import Caution, CautionCode
from tests.builders import can_captures, can_logs, mdf_logs
from tests.builders import vendor_files as build

Array = np.ndarray

DBC = """VERSION ""

NS_ :

BS_:

BU_: RIG

BO_ 256 IMU: 8 RIG
 SG_ number : 0|16@1+ (1,0) [0|0] "g" RIG
 SG_ few : 16|4@1+ (1,0) [0|0] "" RIG
 SG_ counter : 24|8@1+ (1,0) [0|0] "" RIG
"""
EVEN_S = 1e-3 * np.arange(1200)
STALLS_S = ((0.2001, 0.2799), (0.5101, 0.7299))


def stamped(ready_s: Array, apart_s: float = 20e-6) -> Array:
    """Stamps of a host that takes one frame after the other, each when it can."""
    place = apart_s * np.arange(ready_s.size)
    return np.maximum.accumulate(ready_s - place) + place


def stalled(sent_s: Array, stalls_s: tuple[tuple[float, float], ...] = STALLS_S) -> Array:
    """Stamps of a host that stood still now and then, and read all at once behind each stall."""
    ready_s = sent_s + 50e-6
    for start_s, stop_s in stalls_s:
        ready_s = np.where((ready_s >= start_s) & (ready_s < stop_s), stop_s, ready_s)
    return stamped(ready_s)


def entries(stamps_s: Array, few: Array | None = None, counter: Array | None = None) -> list[build.CanEntry]:
    number = np.arange(stamps_s.size)
    few = number % 16 if few is None else few
    counter = number % 256 if counter is None else counter
    return [
        (round(1e9 * at), 0x100, struct.pack("<HBB4x", int(k), int(f), int(c)))
        for at, k, f, c in zip(stamps_s.tolist(), number, few, counter, strict=True)
    ]


def host_capture(rows: list[build.CanEntry]) -> bytes:
    return can_captures.can_capture(can_captures.can_records(rows, device=False, drift=0.0), per_read=1)


FORMATS: dict[str, Callable[[list[build.CanEntry]], bytes]] = {
    "asc": build.asc_log,
    "blf": build.blf_log,
    "trc": can_logs.trc_log,
    "log": build.candump_log,
    "csv": can_logs.can_csv,
    "canedge.csv": can_logs.canedge_csv,
    "db": can_logs.can_sqlite,
    "mf4": mdf_logs.bus_log,
    "rdlog": host_capture,
}


def opened(folder: Path, content: bytes, *counters: str, suffix: str = "log") -> Recording:
    path = folder / f"a.{suffix}"
    path.write_bytes(content)
    return recognise(path, {"can"}).open(path, Declarations("can", database=DBC, counters=counters))


def candump(folder: Path, rows: list[build.CanEntry], *counters: str) -> Recording:
    path = folder / "a.log"
    path.write_bytes(build.candump_log(rows))
    return CANDUMP.open(path, Declarations("can", database=DBC, counters=counters))


def off(recording: Recording, sent_s: Array) -> float:
    """How far instants lie from those of the sender, but for what they share."""
    numbers = recording.read("IMU.number").astype(int)
    return float(np.ptp(recording.time_base("IMU.number").times_s - sent_s[numbers]))


def cautions(recording: Recording) -> list[CautionCode]:
    return [note.code for note in recording.notes if isinstance(note, Caution)]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_stalled_host_is_seen_through_by_the_counter_in_every_format(tmp_path: Path, suffix: str) -> None:
    content = FORMATS[suffix](entries(stalled(EVEN_S)))
    recording = opened(tmp_path, content, "IMU.counter", suffix=suffix)
    assert recording.read("IMU.number").size == EVEN_S.size
    assert off(recording, EVEN_S) < 2e-4
    assert any("samples are dated by IMU.counter instead" in note for note in recording.notes)
    assert cautions(recording) == []


def test_a_stalled_host_without_a_counter_is_a_warning(tmp_path: Path) -> None:
    recording = candump(tmp_path, entries(stalled(EVEN_S)))
    assert cautions(recording) == [CautionCode.LATE_STAMPS]
    (note,) = (note for note in recording.notes if isinstance(note, Caution))
    assert "the host stood still 2 times, for up to 220 ms" in note
    assert "declare a signal that counts them in `counters`" in note


@pytest.mark.parametrize("mean_wait_s", [1e-3, 3e-3])
def test_a_host_that_is_always_late_is_seen_through_by_the_counter(tmp_path: Path, mean_wait_s: float) -> None:
    rng = np.random.default_rng(4)
    stamps_s = stamped(EVEN_S + mean_wait_s * rng.exponential(1.0, EVEN_S.size))
    recording = candump(tmp_path, entries(stamps_s), "IMU.counter")
    assert off(recording, EVEN_S) < 5e-4
    assert recording.read("IMU.number").size == EVEN_S.size


def test_frames_of_one_stamp_are_kept_where_a_counter_tells_them_apart(tmp_path: Path) -> None:
    sent_s = np.arange(2000) / 1600.0
    rows = entries(np.floor(1e3 * sent_s) / 1e3)
    recording = candump(tmp_path, rows, "IMU.counter")
    assert recording.read("IMU.number").size == sent_s.size
    assert off(recording, sent_s) < 3e-4
    assert cautions(recording) == []
    blind = candump(tmp_path, rows)
    assert blind.read("IMU.number").size < 1300
    assert cautions(blind) == [CautionCode.NOT_INCREASING]


@pytest.mark.parametrize("suffix", ["log", "asc"])
def test_stamps_of_an_interface_stay_as_they_are(tmp_path: Path, suffix: str) -> None:
    """A bus delays a frame by less than half a step, and that is no lateness of a host."""
    rng = np.random.default_rng(4)
    stamps_s = np.round(EVEN_S + 3e-4 * rng.random(EVEN_S.size), 6)
    recording = opened(tmp_path, FORMATS[suffix](entries(stamps_s)), "IMU.counter", suffix=suffix)
    times_s = recording.time_base("IMU.number").times_s
    assert np.ptp(times_s - stamps_s) < 2e-6


@pytest.mark.parametrize(
    "sent_s",
    [
        np.cumsum(np.random.default_rng(5).exponential(1e-3, 1200)),
        np.cumsum(1e-3 * (1.0 + 0.05 * np.random.default_rng(6).standard_normal(1200))),
        np.cumsum(1e-3 * (1.0 + 0.5 * np.sin(np.arange(1200) / 200.0))),
        EVEN_S + np.where(np.arange(1200) >= 400, 0.3, 0.0),
        EVEN_S + np.where(np.arange(1200) >= 1190, 0.3, 0.0),
        EVEN_S + np.where(np.arange(1200) >= 700, 0.004, 0.0),
    ],
    ids=["at random", "wandering", "by speed", "a pause", "a late pause", "a short pause"],
)
def test_a_counter_of_what_is_not_even_moves_nothing(tmp_path: Path, sent_s: Array) -> None:
    stamps_s = np.round(np.maximum.accumulate(sent_s), 6)
    recording = candump(tmp_path, entries(stamps_s), "IMU.counter")
    times_s = recording.time_base("IMU.number").times_s
    kept = recording.read("IMU.number").astype(int)
    assert np.ptp(times_s - stamps_s[kept]) < 2e-6
    assert not any("instead" in note for note in recording.notes)


def packed(sent_s: Array) -> Array:
    """Stamps of a host that reads packets each 16 ms."""
    packet = np.ceil(sent_s / 16e-3 + 1e-9)
    first = np.r_[0, np.flatnonzero(np.diff(packet)) + 1]
    place = np.arange(sent_s.size) - np.repeat(first, np.diff(np.r_[first, sent_s.size]))
    return packet * 16e-3 + 0.1e-3 * place


@pytest.mark.parametrize("pause_s", [0.1, 5.0])
@pytest.mark.parametrize("at", [300, 480, 900])
def test_a_sender_that_paused_is_not_laid_on_one_beat_though_its_stamps_come_in_bursts(
    tmp_path: Path, at: int, pause_s: float
) -> None:
    stamps_s = packed(EVEN_S + np.where(np.arange(EVEN_S.size) >= at, pause_s, 0.0))
    recording = candump(tmp_path, entries(stamps_s), "IMU.counter")
    assert np.ptp(recording.time_base("IMU.number").times_s - stamps_s) < 2e-6
    assert cautions(recording) == [CautionCode.LATE_STAMPS]
    assert any("IMU.counter does not count frames of an even beat" in note for note in recording.notes)


@pytest.mark.parametrize("lost", [0, 6, 56])
def test_a_counter_that_restarted_is_not_trusted(tmp_path: Path, lost: int) -> None:
    number = np.arange(EVEN_S.size)
    counter = np.where(number < 200, number + 256 - lost, number) % 256
    counter[200:] = (number[200:] - 200) % 256
    stamps_s = packed(EVEN_S)
    recording = candump(tmp_path, entries(stamps_s, counter=counter), "IMU.counter")
    assert np.ptp(recording.time_base("IMU.number").times_s - stamps_s) < 2e-6
    assert cautions(recording) == [CautionCode.LATE_STAMPS]


COUNTS = {
    "from 0 to 14": (lambda number: number % 15, "IMU.few counts from 0 to 14 and begins anew"),
    "from 1 to 15": (lambda number: 1 + number % 15, "IMU.few counts from 1 to 15 and begins anew"),
    "by 2": (lambda number: 2 * number % 16, "IMU.few counts by 2"),
}


@pytest.mark.parametrize("way", COUNTS)
@pytest.mark.parametrize("stamps_s", [stalled(EVEN_S), packed(EVEN_S)], ids=["stalled", "in packets"])
def test_a_counter_of_few_numbers_dates_frames_and_finds_what_is_missing(
    tmp_path: Path, way: str, stamps_s: Array
) -> None:
    counts, told = COUNTS[way]
    kept = np.delete(np.arange(EVEN_S.size), [61, 62, 444])
    rows = entries(stamps_s, few=counts(np.arange(EVEN_S.size)))
    recording = candump(tmp_path, [rows[k] for k in kept], "IMU.few")
    assert off(recording, EVEN_S) < 1.5e-3
    assert (recording.metadata["counter_gaps"], recording.metadata["missing_frames"]) == (2, 3)
    assert any(told in note for note in recording.notes)
    assert cautions(recording) == []


def test_marks_of_a_fault_among_counts_are_no_counts(tmp_path: Path) -> None:
    few = np.arange(EVEN_S.size) % 15
    few[[100, 101, 702]] = 15
    recording = candump(tmp_path, entries(stalled(EVEN_S), few=few), "IMU.few")
    assert off(recording, EVEN_S) < 2e-4
    assert recording.metadata["missing_frames"] == 0
    assert any("3 messages have another number there, which is no count" in note for note in recording.notes)


def test_messages_of_several_buses_are_dated_by_their_own_counts(tmp_path: Path) -> None:
    stamps_s, other_s = stalled(EVEN_S), stalled(1.001 * EVEN_S + 3e-4)
    one = build.candump_log(entries(stamps_s)).decode().splitlines()
    other = build.candump_log(entries(other_s, counter=(np.arange(EVEN_S.size) + 77) % 256)).decode().splitlines()
    lines = sorted([*one, *(line.replace("can0", "can1") for line in other)])
    recording = opened(tmp_path, "\n".join(lines).encode() + b"\n", "IMU.counter")
    for bus, sent_s in (("can0", EVEN_S), ("can1", 1.001 * EVEN_S)):
        assert np.ptp(recording.time_base(f"IMU.number@{bus}").times_s - sent_s) < 2e-4
    assert cautions(recording) == []


def test_a_second_counter_counts_where_the_first_stands_still(tmp_path: Path) -> None:
    recording = candump(tmp_path, entries(stalled(EVEN_S), few=np.zeros(EVEN_S.size)), "IMU.few", "IMU.counter")
    assert off(recording, EVEN_S) < 2e-4
    assert any("samples are dated by IMU.counter instead" in note for note in recording.notes)


def test_frames_that_were_logged_twice_or_in_another_order_hide_no_beat(tmp_path: Path) -> None:
    rows = entries(stalled(EVEN_S))
    rows[100], rows[101] = rows[101], rows[100]
    rows[900:900] = [rows[900]]
    recording = candump(tmp_path, rows, "IMU.counter")
    assert off(recording, EVEN_S) < 2e-4
    assert recording.read("IMU.number").size == EVEN_S.size - 1
    assert any("2 of 1201 frames do not increase in time" in note for note in recording.notes)


@pytest.mark.parametrize("counters", [(), ("IMU.counter",)])
def test_a_single_stamp_far_ahead_costs_one_frame(tmp_path: Path, counters: tuple[str, ...]) -> None:
    rows = entries(EVEN_S)
    rows[40] = (rows[40][0] + 3_600_000_000_000, *rows[40][1:])
    recording = candump(tmp_path, rows, *counters)
    assert recording.read("IMU.number").tolist() == [k for k in range(EVEN_S.size) if k != 40]
    assert any("1 of 1200 frames do not increase in time" in note for note in recording.notes)


@pytest.mark.parametrize("counters", [(), ("IMU.counter",)])
@pytest.mark.parametrize("back_s", [0.005, 0.05])
def test_a_clock_that_was_set_back_by_little_is_refused(
    tmp_path: Path, back_s: float, counters: tuple[str, ...]
) -> None:
    stamps_s = EVEN_S - np.where(np.arange(EVEN_S.size) >= 600, back_s, 0.0)
    with pytest.raises(CorruptFileError, match="or a clock was set back: stamps of IMU go back by"):
        candump(tmp_path, entries(stamps_s), *counters)


def test_a_clock_that_was_set_ahead_is_told_by_the_counter(tmp_path: Path) -> None:
    stamps_s = EVEN_S + np.where(np.arange(EVEN_S.size) >= 600, 3600.0, 0.0)
    recording = candump(tmp_path, entries(stamps_s), "IMU.counter")
    (note,) = (note for note in recording.notes if "stamps jump ahead at one place, most by 3600" in note)
    assert "IMU.counter goes on: the sender paused, or a clock was set" in note
    lost = [one for k, one in enumerate(entries(stamps_s)) if not 600 <= k < 700]
    assert any("stamps jump ahead" in note for note in candump(tmp_path, lost, "IMU.counter").notes)
    gap = [one for k, one in enumerate(entries(EVEN_S)) if not 600 <= k < 700]
    assert not any("stamps jump ahead" in note for note in candump(tmp_path, gap, "IMU.counter").notes)
