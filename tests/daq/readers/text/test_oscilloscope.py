"""Waveforms that oscilloscopes save as text are read with the numbers, units and instants that stand in them."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError, UnknownFormatError
from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from tests.builders import oscilloscope_texts as build
from tests.builders.oscilloscope_texts import WAVEFORMS, WrittenWaveform


def opened(folder: Path, content: bytes) -> Recording:
    path = folder / "wave.csv"
    path.write_bytes(content)
    return recognise(path).open(path, Declarations("scope"))


def check(recording: Recording, written: WrittenWaveform) -> None:
    assert [(s.name, s.unit) for s in recording.signals] == [(n, unit) for n, (unit, _) in written.signals.items()]
    for name, (unit, values) in written.signals.items():
        assert recording.read(name).tolist() == list(values), name
        base = recording.time_base(name)
        assert base.step_s == pytest.approx(written.step_s, rel=1e-6)
        np.testing.assert_allclose(
            base.times_s, written.start_s + written.step_s * np.arange(len(values)), atol=1e-3 * written.step_s
        )
        assert not unit or find_unit(unit) is not None


@pytest.mark.parametrize("name", WAVEFORMS)
def test_a_waveform_has_the_numbers_units_and_instants_of_its_text(name: str, tmp_path: Path) -> None:
    written = WAVEFORMS[name](300)
    recording = opened(tmp_path, written.content)
    assert recording.reader == written.maker
    assert recording.incomplete == ""
    check(recording, written)


@pytest.mark.parametrize("name", WAVEFORMS)
def test_one_row_fewer_than_stated_is_told(name: str, tmp_path: Path) -> None:
    written = WAVEFORMS[name](50)
    short = written.content[: written.content[:-1].rstrip(b"\r\n").rfind(b"\n") + 1]
    recording = opened(tmp_path, short)
    states = not name.startswith(("keysight", "rohde-schwarz", "picoscope", "rigol"))
    assert recording.incomplete == ("1 of the stated 50 rows are not in the file" if states else "")
    assert {header.sample_count for header in recording.signals} == {49}


def test_digital_channels_behind_a_second_time_are_left_out_and_named(tmp_path: Path) -> None:
    notes = [str(note) for note in opened(tmp_path, build.tektronix().content).notes]
    assert notes == ["columns of a second time were left out: D0"]


def test_a_head_in_comments_and_a_part_of_the_record_are_read(tmp_path: Path) -> None:
    text = build.tektronix().content.decode()
    head, rows = text.split("TIME", 1)
    commented = "".join(f"#{line}\r\n" for line in head.split("\r\n")[:-1]) + "#TIME" + rows
    check(opened(tmp_path, commented.encode()), build.tektronix())
    gated = text.replace("0.0% to 100.0%", "20.0% to 60.0%").replace("Record Length,40,40", "Record Length,100,100")
    assert opened(tmp_path, gated.encode()).incomplete == ""


@pytest.mark.parametrize(("interval", "units"), [(b"2e-06,", ["V", "V"]), (b"2e-06,2e-06", ["V", ""])])
def test_a_unit_stated_once_is_that_of_every_channel_where_each_key_has_one_value(
    interval: bytes, units: list[str], tmp_path: Path
) -> None:
    content = build.tektronix().content.replace(b"Vertical Units,V,A", b"Vertical Units,V,")
    content = content.replace(b"2e-06,2e-06", interval)
    assert [header.unit for header in opened(tmp_path, content).signals] == units


def test_the_trigger_dates_a_waveform(tmp_path: Path) -> None:
    start = opened(tmp_path, build.lecroy().content).absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2026-11-05T16:34:00", "unknown")
    german = build.lecroy().content.replace(b"05-Nov-2026", b"05-Dez-2026")
    assert opened(tmp_path, german).absolute_start is None


@pytest.mark.parametrize(("segments", "count"), [(3, 300), (500, 20)])
def test_segments_are_at_the_instants_of_their_triggers(segments: int, count: int, tmp_path: Path) -> None:
    content = build.lecroy(count, segments).content
    recording = opened(tmp_path, content)
    # read independently: rows of a time that begins anew, and the table of triggers above them
    stamps = pd.read_csv(io.BytesIO(content), sep=";", decimal=",", skiprows=2, nrows=segments, dtype=str)
    triggers_s = stamps["TimeSinceSegment1"].str.strip().str.replace(",", ".").astype(float).to_numpy()
    rows = pd.read_csv(io.BytesIO(content), sep=";", decimal=",", skiprows=3 + segments)
    assert [(one.name, one.unit, one.sample_count) for one in recording.signals] == [("Ampl", "", segments * count)]
    assert recording.read("Ampl").tolist() == rows["Ampl"].tolist()
    assert recording.read("Ampl", count - 2, count + 3).tolist() == rows["Ampl"][count - 2 : count + 3].tolist()
    wanted_s = rows["Time"].to_numpy() + np.repeat(triggers_s, count)
    np.testing.assert_allclose(recording.time_base("Ampl").times_s, wanted_s, rtol=0, atol=1e-12)
    assert recording.absolute_start is not None
    assert recording.absolute_start.text == "2026-11-05T16:34:00"
    assert recording.incomplete == ""
    assert any("segments, each at the time of its trigger" in str(note) for note in recording.notes)


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        (b"#2;05-Nov-2026 16:34:01;0,75", b"#2;05-Nov-2026 16:34:01;0,00", "a segment begins before the one before it"),
        (b"#2;05-Nov-2026 16:34:01;0,75", b"#2;05-Nov-2026 16:34:01;x", "waveforms follow each other"),
        (b"Segments;3;", b"Segments;2;", "no reader recognises"),
        (b"Segments;3;", b"Segments;2000000;", "waveforms follow each other"),
    ],
)
def test_damaged_segments_end_in_one_line(old: bytes, new: bytes, error: str, tmp_path: Path) -> None:
    content = build.lecroy(30, segments=3).content
    assert old in content
    with pytest.raises(ReadError, match=error) as caught:
        opened(tmp_path, content.replace(old, new, 1)).time_base("Ampl")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_a_missing_segment_dates_no_other(missing: int, tmp_path: Path) -> None:
    lines = build.lecroy(30, segments=3).content.splitlines(keepends=True)
    first = 7 + 30 * missing
    recording = opened(tmp_path, b"".join(lines[:first] + lines[first + 30 :]))
    with pytest.raises(CorruptFileError, match=r"segments are missing, and the rows do not show which.*3, found 2"):
        recording.time_base("Ampl")


def test_a_segment_that_runs_into_the_next_is_refused(tmp_path: Path) -> None:
    lines = build.lecroy(30, segments=3).content.splitlines(keepends=True)
    cells = [line.decode().split(";") for line in lines[37:67]]
    later = [f"{float(t.replace(',', '.')) + 1.0:.9f};{a}".replace(".", ",").encode() for t, a in cells]
    recording = opened(tmp_path, b"".join([*lines[:37], *later, *lines[67:]]))
    with pytest.raises(CorruptFileError, match="a segment is longer than the head states"):
        recording.time_base("Ampl")


def test_a_cut_last_segment_is_told(tmp_path: Path) -> None:
    content = build.lecroy(30, segments=3).content
    recording = opened(tmp_path, content[: content[:-1].rfind(b"\n") + 1])
    assert recording.incomplete == "1 of the stated 90 rows are not in the file"
    assert recording.time_base("Ampl").count == recording.read("Ampl").size == 89


def test_blocks_whose_instants_the_file_does_not_state_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"waveforms follow each other.*save each in a file of its own"):
        opened(tmp_path, build.yokogawa(blocks=2).content)


def test_rows_without_their_first_cell_are_read_too(tmp_path: Path) -> None:
    check(opened(tmp_path, build.yokogawa(leads=False).content), build.yokogawa(leads=False))


def test_a_sample_beyond_the_range_is_an_overload(tmp_path: Path) -> None:
    content = (
        build.picoscope()
        .content.replace(b",100.3125,", ",\u221e,".encode())
        .replace(b",100.3750,", ",-\u221e,".encode())
    )
    recording = opened(tmp_path, content)
    assert np.flatnonzero(np.isnan(recording.read("Channel A"))).tolist() == [1, 2]
    assert recording.overloads("Channel A") == 2


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"x-axis,1,2", b"x-axis,1"),
        (b"second,Volt", b"furlong,Volt"),
    ],
)
def test_a_head_of_other_words_is_not_said_to_be_a_maker_s(old: bytes, new: bytes, tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError) as caught:
        opened(tmp_path, build.keysight().content.replace(old, new))
    assert "Keysight" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        b"Time,Channel 1\n(s),(V)\n\n0,1\n1,2\n",
        b"time in s,CH1 in V\n0,1\n1,2\n",
        b"TIME,CH1\n0.1,1\n0.2,2\n",
        b"Second,Volt\n0.1,1\n0.2,2\n",
        b"X,CH1\n1,2\n3,4\n",
        b"Y,CH1\nSecond,Volt\n1,2\n3,4\n",
        b"LECROY was here\n1,2\n3,4\n5,6\n7,8\n",
        b'"HResolution",1\n1,2\n3,4\n',
        b"XInc: 5\nData:\n1,2\n",
    ],
)
def test_a_table_without_a_maker_s_marks_bears_no_maker_s_name(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(UnknownFormatError) as caught:
        recognise(path)
    assert not any(
        word in str(caught.value) for word in ("Tektronix", "LeCroy", "PicoScope", "Rohde", "Rigol", "Yokogawa")
    )


def test_rows_that_are_missing_by_their_numbers_are_refused(tmp_path: Path) -> None:
    head = "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-1e-2,1e-3\n"
    rows = [f"{k},{k}.5,{k}.25,\n" for k in range(5, 65)]
    whole = opened(tmp_path, (head + "".join(rows)).encode())
    assert whole.time_base("CH1").times_s[[0, -1]] == pytest.approx([-5e-3, 54e-3])
    with pytest.raises(CorruptFileError, match=r"rows are missing by their numbers; expected 60 rows.*found 58"):
        opened(tmp_path, (head + "".join(rows[:20] + rows[22:])).encode())


@pytest.mark.parametrize(
    "head",
    [
        "Model,MSO58\nSample Interval,{step}\nRecord Length,{count}\nVertical Units,V\n\nTIME,CH1\n",
        "Record Length,Analog:{count}\nSample Interval,Analog:{step}\nSource,CH1\nSecond,Volt\n",
        "Type:,raw\nPoints:,{count}\nXInc:,{step}\nXOrg:,0\nX Units:,second\nY Units:,Volt\nData:\n",
    ],
    ids=["Tektronix", "Siglent", "Infiniium"],
)
def test_a_head_that_contradicts_its_rows_is_told_and_the_rows_count(head: str, tmp_path: Path) -> None:
    rows = "".join(f"{k * 1e-3:.6e},{k}.5\n" for k in range(60))
    sound = opened(tmp_path, (head.format(step="1e-3", count=60) + rows).encode())
    assert [note for note in sound.notes if "the head states" in note] == []
    other = opened(tmp_path, (head.format(step="2e-3", count=50) + rows).encode())
    assert other.time_base(other.signals[0].name).rate_hz == pytest.approx(1000.0)
    told = [note for note in other.notes if "the head states" in note]
    assert told == [
        "the head states 50 rows, and 60 are there",
        "the head states a step of 0.002 s, the column of time has 0.001 s: it counts",
    ]
