"""LabVIEW measurement files are read with the samples, units and instants that stand in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, NoSignalError, ReadError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from tests.builders.lvm_files import Column, Lvm, columns, seconds

BARE = {"trailing": False, "line_end": "\n"}


def opened(folder: Path, file: Lvm | bytes) -> Recording:
    path = folder / "shot.lvm"
    path.write_bytes(file if isinstance(file, bytes) else file.content())
    return recognise(path).open(path, Declarations("recorder"))


def read_all(folder: Path, file: Lvm | bytes) -> None:
    recording = opened(folder, file)
    for header in recording.signals:
        recording.time_base(header.name)
        recording.read(header.name)


@pytest.mark.parametrize(
    "file",
    [
        Lvm([columns()]),
        Lvm([columns()], "One", [seconds()]),
        Lvm([columns()], "Multi", [seconds()]),
        Lvm([columns()], decimal=","),
        Lvm([columns()], decimal=",", states_decimal=False),
        Lvm([columns()], "One", [seconds()], {0: "begin", 5: "12,5 OK\tstill OK", 39: "LOST"}),
        Lvm([columns()], "Multi", [seconds()], {3: "1.5"}),
        Lvm([columns()], "One", [seconds()], separator=",", trailing=False),
        Lvm([columns()], trailing=False, line_end="\n"),
    ],
    ids=[
        "no x",
        "one x",
        "multi x",
        "comma",
        "comma unsaid",
        "comments",
        "comment of multi",
        "commas apart",
        "bare",
    ],
)
def test_samples_units_and_instants_are_those_of_the_text(file: Lvm, tmp_path: Path) -> None:
    recording = opened(tmp_path, file)
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [("acc", "m/s^2", 40), ("p", "Newtons", 40)]
    assert recording.read("acc").tolist() == [100.25 + i for i in range(40)]
    assert recording.read("p", 3, 5).tolist() == [-3 / 8, -4 / 8]
    base = recording.time_base("p")
    assert base.step_s == pytest.approx(1e-3)
    np.testing.assert_allclose(base.times_s, 1e-3 * np.arange(40), atol=1e-9)
    assert recording.absolute_start is not None
    assert (recording.absolute_start.text, recording.absolute_start.zone) == ("2026-08-03T12:23:05.757000", "unknown")
    assert recording.incomplete == ""


def test_segments_are_each_at_their_own_time(tmp_path: Path) -> None:
    later = [replace(one, time="12:23:07.257") for one in columns(20, 20.0)]
    recording = opened(tmp_path, Lvm([columns(20), later]))
    assert recording.read("acc").tolist() == [100.25 + i for i in range(40)]
    assert recording.read("acc", 18, 23).tolist() == [118.25, 119.25, 120.25, 121.25, 122.25]
    expected = [*(1e-3 * np.arange(20)), *(1.5 + 1e-3 * np.arange(20))]
    np.testing.assert_allclose(recording.time_base("p").times_s, expected, atol=1e-9)
    assert recording.metadata["segments"] == 2


def test_rows_that_were_added_under_the_first_head_count(tmp_path: Path) -> None:
    own = [replace(one, samples="4") for one in columns(40)]
    recording = opened(tmp_path, Lvm([own], "One", [seconds()]))
    assert recording.signals[0].sample_count == 40
    assert recording.incomplete == ""


def test_a_channel_of_fewer_samples_has_lost_ones_and_one_of_none_is_left_out(tmp_path: Path) -> None:
    short = replace(columns()[0], name="slow", cells=columns()[0].cells[:4])
    nothing = Column("Untitled", "", [], samples="0", date="1903/12/31", time="19:00:00")
    recording = opened(tmp_path, Lvm([[nothing, columns()[1], short]], "One", [seconds()], **BARE))
    assert [header.name for header in recording.signals] == ["p", "slow"]
    assert np.isnan(recording.read("slow")[4:]).all()
    assert recording.read("slow")[:4].tolist() == [100.25, 101.25, 102.25, 103.25]
    notes = [str(note) for note in recording.notes]
    assert "channels without samples were left out: Untitled" in notes
    assert "slow: 36 of 40 cells are empty: lost samples" in notes


def test_channels_of_their_own_step_and_start_keep_them(tmp_path: Path) -> None:
    other = replace(columns()[1], x0="0.5000000000000000E+0", delta_x="2.0000000E-3")
    recording = opened(tmp_path, Lvm([[columns()[0], other]]))
    np.testing.assert_allclose(recording.time_base("acc").times_s, 1e-3 * np.arange(40), atol=1e-9)
    np.testing.assert_allclose(recording.time_base("p").times_s, 0.5 + 2e-3 * np.arange(40), atol=1e-9)


def test_a_column_of_seconds_since_1904_dates_itself(tmp_path: Path) -> None:
    times = [f"{3868676585.25 + i / 8:.6f}" for i in range(40)]
    recording = opened(tmp_path, Lvm([columns()], "One", [times]))
    base = recording.time_base("acc")
    np.testing.assert_allclose(base.times_s, np.arange(40) / 8, atol=1e-6)
    assert base.absolute_start is not None
    # 1904 lies 2,082,844,800 s before 1970, and `date -u -d @1785831785` says the rest
    assert (base.absolute_start.text[:22], base.absolute_start.zone) == ("2026-08-04T08:23:05.25", "UTC")


def test_a_step_of_few_printed_digits_is_said(tmp_path: Path) -> None:
    coarse = [replace(one, delta_x="0.000977") for one in columns()]
    notes = [str(note) for note in opened(tmp_path, Lvm([coarse])).notes]
    assert "`Delta_X` is printed as 0.000977: the rate is known to 0.051 % only" in notes
    fine = [replace(one, delta_x="9.765625E-4") for one in columns()]
    assert not any("printed" in str(note) for note in opened(tmp_path, Lvm([fine])).notes)


def test_special_blocks_and_notes_of_a_head_are_passed(tmp_path: Path) -> None:
    special = b"***Start_Special***\r\nX0\t7\r\nmade up\t3\r\n***End_Special***\r\nNotes\ttwo words\r\n"
    content = Lvm([columns()]).content().replace(b"Channels\t", special + b"Channels\t")
    assert opened(tmp_path, content).time_base("acc").start_s == 0.0


def test_what_is_not_over_time_is_no_signal(tmp_path: Path) -> None:
    spectrum = [replace(one, dimension="Frequency") for one in columns()]
    with pytest.raises(NoSignalError, match=r"over Frequency, not over time, were left out: acc, p"):
        opened(tmp_path, Lvm([spectrum]))
    mixed = opened(tmp_path, Lvm([[columns()[0], spectrum[1]]]))
    assert [header.name for header in mixed.signals] == ["acc"]


def test_rows_that_are_stated_and_not_there_are_told(tmp_path: Path) -> None:
    content = Lvm([columns()]).content()
    rows = content[: content.rstrip(b"\r\n\t").rfind(b"\n") + 1]
    assert opened(tmp_path, rows).incomplete == "1 of the stated 40 rows are not in the file"
    two = Lvm([columns(20), [replace(one, time="12:23:07.257") for one in columns(20, 20.0)]]).content()
    cut = two[: two.rfind(b"Samples")]
    assert "begins what is no whole segment: it is cut off" in opened(tmp_path, cut).incomplete


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (Lvm([columns(20), columns(20, 20.0)]), "a segment begins before the one before it ends"),
        (
            Lvm([columns(20), [replace(one, date="", time="") for one in columns(20)]]),
            "a second recording begins in line .*, and nothing says when it was",
        ),
        (
            Lvm([columns(20), [replace(one, name="x", time="12:23:09.0") for one in columns(20)]]),
            "a second recording begins in line .*: it has other channels",
        ),
        (Lvm([[replace(one, delta_x="0.000000") for one in columns()]]), "states no step of time"),
        (Lvm([columns()]).content().replace(b"X_Columns\tNo", b"X_Columns\tPerhaps"), "the head .* is not understood"),
        (b"LabVIEW Measurement\t\r\nWriter_Version\t2\r\n", "the head of the file does not end"),
        (Lvm([columns()]).content().replace(b"110.250000", b"11O.250000"), "a cell is not a number"),
        (Lvm([columns()]).content().replace(b"X_Value", b"Y_Value"), "there is no segment of samples"),
    ],
)
def test_what_does_not_go_together_is_refused(file: Lvm | bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match=said):
        read_all(tmp_path, file)


def test_a_missing_file_is_a_read_error(tmp_path: Path) -> None:
    with pytest.raises(ReadError):
        recognise(tmp_path / "none.lvm")


def changed(**values: str) -> list[Column]:
    one, other = columns()
    return [one, replace(other, **values)]


@pytest.mark.parametrize("values", [{"delta_x": "0.002000"}, {"x0": "0.5"}])
def test_channels_of_other_times_do_not_share_a_column_of_times(values: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="channels of other times share one column of times"):
        read_all(tmp_path, Lvm([changed(**values)], "One", [seconds()]))


def test_a_column_of_times_that_contradicts_the_head_counts_and_is_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, Lvm([columns()], "One", [seconds(step_s=2e-3)]))
    assert recording.time_base("p").step_s == pytest.approx(2e-3)
    assert any(
        "`Delta_X` states a step of 0.001 s, the column of times has 0.002 s" in note for note in recording.notes
    )


def test_each_channel_without_a_column_of_times_begins_at_its_own_date(tmp_path: Path) -> None:
    later = changed(time="12:23:06.0070000000000000001")
    recording = opened(tmp_path, Lvm([later]))
    assert recording.time_base("acc").times_s[0] == 0.0
    assert recording.time_base("p").times_s[0] == pytest.approx(0.25)
    with pytest.raises(ReadError, match=r"begin at different times.*p \+0.25 s from the first"):
        read_all(tmp_path, Lvm([later], "Multi", [seconds()]))


def test_more_rows_than_the_head_states_are_told(tmp_path: Path) -> None:
    few = [replace(one, samples="10") for one in columns()]
    assert any("the head states 10 rows, and 40 are there" in note for note in opened(tmp_path, Lvm([few])).notes)


@pytest.mark.parametrize(("date", "time"), [("2026/08/03", "12:23:05.757 PM"), ("08/13/2026", "12:23:05.757")])
def test_a_head_in_halves_of_the_day_or_with_slashes_dates_its_channels(date: str, time: str, tmp_path: Path) -> None:
    one, other = (replace(column, date=date, time=time) for column in columns())
    recording = opened(tmp_path, Lvm([[one, replace(other, time=time.replace("05.757", "06.007"))]]))
    assert recording.time_base("p").times_s[0] == pytest.approx(0.25)
    start = recording.absolute_start
    assert start is not None
    assert start.text.startswith(f"2026-08-{'03' if date.endswith('3') else '13'}T12:23:05.757")


def test_a_head_whose_date_is_not_understood_gives_no_start_and_parts_no_channels(tmp_path: Path) -> None:
    one, other = (replace(column, date="08/03/2026") for column in columns())
    recording = opened(tmp_path, Lvm([[one, other]]))
    assert recording.absolute_start is None
    assert any("'08/03/2026 12:23:05" in note and "the start is not known" in note for note in recording.notes)
    with pytest.raises(ReadError, match="channels of one segment begin at times that are not understood"):
        read_all(tmp_path, Lvm([[one, replace(other, time="12:23:06.0070000000000000001")]]))


SLOW_X = ["0.125000", "0.127000", "0.129000", "0.131000"]


def of_own_times(**values: str) -> list[Column]:
    fast, slow = columns(10)
    slow = replace(slow, cells=slow.cells[:4], times=SLOW_X, x0="0.125", delta_x="0.002", **values)
    return [replace(fast, times=seconds(10)), slow]


def test_each_channel_of_its_own_column_of_times_has_its_own_time_base(tmp_path: Path) -> None:
    recording = opened(tmp_path, Lvm([of_own_times()], "Multi"))
    assert [(one.name, one.unit, one.sample_count) for one in recording.signals] == [
        ("acc", "m/s^2", 10),
        ("p", "Newtons", 4),
    ]
    fast, slow = (recording.time_base(name) for name in ("acc", "p"))
    assert (fast.start_s, fast.step_s) == (0.0, 1e-3)
    assert (slow.start_s, slow.step_s) == (pytest.approx(0.125), pytest.approx(2e-3))
    np.testing.assert_array_equal(recording.read("p"), [0.0, -0.125, -0.25, -0.375])
    assert not [note for note in recording.notes if "empty" in note]


def test_columns_of_times_since_the_date_of_each_channel_begin_there(tmp_path: Path) -> None:
    later = {"time": "12:23:06.0070000000000000001"}
    recording = opened(tmp_path, Lvm([of_own_times(**later)], "Multi", preference="Relative"))
    assert recording.time_base("p").start_s == pytest.approx(0.375)
    with pytest.raises(ReadError, match=r"begin at different times.*p \+0.25 s from the first"):
        read_all(tmp_path, Lvm([of_own_times(**later)], "Multi"))
    alike = Lvm([changed(**later)], "Multi", [seconds()], preference="Relative")
    assert opened(tmp_path, alike).time_base("p").start_s == pytest.approx(0.25)


def test_columns_of_seconds_since_1904_have_one_zero(tmp_path: Path) -> None:
    zero_s = 3_868_000_000
    fast, slow = of_own_times(time="12:23:06.0070000000000000001")
    own = [replace(one, times=[f"{zero_s + float(x):.6f}" for x in one.times]) for one in (fast, slow)]
    recording = opened(tmp_path, Lvm([own], "Multi"))
    assert recording.time_base("acc").start_s == 0.0
    assert recording.time_base("p").start_s == pytest.approx(0.125, abs=1e-6)
    starts = {recording.time_base(name).absolute_start for name in ("acc", "p")}
    assert len(starts) == 1
    second = [replace(one, times=[f"{10 + float(x):.6f}" for x in one.times], date="2026/08/04") for one in own]
    recording = opened(tmp_path, Lvm([own, second], "Multi"))
    assert recording.time_base("acc").times_s[[0, 10]] == pytest.approx([0.0, 10.0], abs=1e-5)


def test_names_of_channels_with_columns_of_their_own_are_told_apart_and_others_left_out(tmp_path: Path) -> None:
    one, other = of_own_times()
    empty = replace(one, name="none", cells=[], times=[], samples="0")
    recording = opened(tmp_path, Lvm([[one, replace(other, name="acc"), empty]], "Multi"))
    assert [signal.name for signal in recording.signals] == ["acc", "acc#2"]
    assert any("channels without samples were left out: none" in note for note in recording.notes)
