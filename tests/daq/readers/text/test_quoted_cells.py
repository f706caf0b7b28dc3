"""Cells in quotes (RFC 4180), and columns of text, in every table of text."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers import text_file
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.readers.text import text_table
from tests.builders import can_logs, exported_files, track_files
from tests.builders import text_tables as tables
from tests.builders.opened_files import open_table
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, can_entries

LAYOUT = {"separator": ";", "header_row": 1, "first_row": 2, "time_column": 1, "time_unit": "s"}
TRACK_LAYOUT = {"separator": ";", "header_row": 1, "frame_column": 1, "features": [{"name": "tip", "x": 2, "y": 3}]}


def everything(recording: Recording) -> dict[str, tuple[str, list[float], list[float]]]:
    return {
        s.name: (s.unit, recording.read(s.name).tolist(), recording.time_base(s.name).times_s.tolist())
        for s in recording.signals
    }


def in_quotes(content: bytes, separator: str, *, above: int = 0) -> bytes:
    """Put every cell in quotes, but for some lines above."""
    lines = content.decode().splitlines()
    text = io.StringIO()
    writer = csv.writer(text, delimiter=separator, quoting=csv.QUOTE_ALL, lineterminator="\r\n")
    writer.writerows(csv.reader(lines[above:], delimiter=separator))
    return ("".join(line + "\r\n" for line in lines[:above]) + text.getvalue()).encode()


DEWESOFT = tables.table(["Time (s);AI 1/acc (m/s2);p (MPa)"], tables.seconds(","), separator=";", decimal=",")
TRACKS = b"".join(b"%d;%d.5;2.25\n" % (i, i) for i in range(9))
TABLES = {
    "dewesoft": (DEWESOFT, ";", "dewetron", {}),
    "dewesoft-comma": (tables.table(["Time (s),a (g),p (MPa)"], tables.seconds()), ",", "dewetron", {}),
    "oxygen": (tables.OXYGEN, ",", "dewetron", {}),
    "declared": (DEWESOFT, ";", "dewetron", {"layout": LAYOUT | {"decimal": ","}}),
    "proanalyst": (b"Frame;tip - X;tip - Y\n" + TRACKS, ";", "camera", {}),
    "declared tracks": (
        b"Frame;x;y\n" + TRACKS, ";", "camera", {"layout": TRACK_LAYOUT}
    ),
    "deeplabcut": (track_files.deeplabcut(), ",", "camera", {}),
    "dltdv": (track_files.dltdv(lost=(3,)), ",", "camera", {}),
    "tracker": (track_files.tracker(), "\t", "camera", {}),
    "sleap": (track_files.sleap_text(), ",", "camera", {}),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("piece", [300, 3 << 20])
def test_quotes_around_cells_change_nothing(name, piece, tmp_path, monkeypatch):
    content, separator, kind, declared = TABLES[name]
    plain = open_table(tmp_path, content, kind, **declared)
    expected, notes = everything(plain), plain.notes
    monkeypatch.setattr(text_table, "PIECE_BYTES", piece)
    recording = open_table(tmp_path, in_quotes(content, separator, above=int(name == "tracker")), kind, **declared)
    assert str(everything(recording)) == str(expected)
    assert recording.notes == notes
    assert recording.reader == plain.reader


def test_our_own_csv_after_a_program_put_quotes_around_its_cells(tmp_path):
    content = exported_files.csv_file()
    above = sum(line.startswith(b"#") for line in content.splitlines())
    expected = everything(open_table(tmp_path, content))
    assert str(everything(open_table(tmp_path, in_quotes(content, ",", above=above)))) == str(expected)


def test_stamps_in_quotes_are_stamps(tmp_path):
    content = tables.OXYGEN_ABSOLUTE.decode("utf-16").encode()
    quoted = in_quotes(content, "\t")
    expected = open_table(tmp_path, content)
    values, start = everything(expected), expected.absolute_start
    found = open_table(tmp_path, quoted)
    assert str(everything(found)) == str(values)
    assert found.absolute_start == start


def test_the_shared_file_is_a_sine():
    path = shared_file("reports/q_dewesoft.csv")
    recording = recognise(path).open(path, Declarations("dewetron"))
    np.testing.assert_allclose(recording.read("acc"), np.sin(np.arange(80)), atol=6e-5)
    assert recording.time_base("acc").step_s == 1e-3


def test_separators_and_quotes_within_a_cell_do_not_part_it(tmp_path):
    rows = "".join(f'{1e-3 * i:.3f};"gut; ""sehr"" gut";{i}.5\n' for i in range(30))
    recording = open_table(tmp_path, f'Time (s);"Note; of the ""crew""";"a; b (V)"\n{rows}')
    assert [s.name for s in recording.signals] == ["a; b"]
    np.testing.assert_array_equal(recording.read("a; b"), np.arange(30) + 0.5)
    assert recording.notes == ("""columns that hold text were left out: Note; of the "crew" ('gut; "sehr" gut')""",)


def test_a_decimal_comma_in_quotes_between_commas_is_one(tmp_path):
    rows = "".join(f'"{0.5 * i:.1f}","{i},25"\n'.replace(".", ",") for i in range(30))
    recording = open_table(tmp_path, '"Time (s)","a (V)"\n' + rows)
    np.testing.assert_array_equal(recording.read("a"), np.arange(30) + 0.25)
    assert recording.time_base("a").step_s == 0.5


# ---- columns of text


STATES = ("OK", "warm", "OK", "", "n/a")


def test_a_column_of_text_is_left_out_and_named():
    path = shared_file("reports/text_column.csv")
    recording = recognise(path).open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals] == ["acc"]
    np.testing.assert_allclose(recording.read("acc"), np.sin(np.arange(60)), atol=6e-4)
    assert recording.notes == ("columns that hold text were left out: Status ('OK')",)


@pytest.mark.parametrize(
    ("head", "declared"),
    [
        ("Time (s);a (V);Status;b (V)", {}),
        ("Time [s];AI 1/1 [V];Status;AI 1/2 [V]", {}),
        ("Measurement time[s];a [V];Status;b [V]", {}),
        ("Time;a;Status;b", {"layout": LAYOUT}),
    ],
)
@pytest.mark.parametrize("count", [30, 3000])
def test_every_recorders_table_leaves_text_out(head, declared, count, tmp_path):
    rows = "".join(f"{1e-3 * i:.3f};{i}.5;{STATES[i % 5]};{i}.25\n" for i in range(count))
    recording = open_table(tmp_path, f"{head}\n{rows}", **declared)
    assert len(recording.signals) == 2
    for signal, part in zip(recording.signals, (0.5, 0.25), strict=True):
        np.testing.assert_array_equal(recording.read(signal.name), np.arange(count) + part)
    assert recording.notes == ("columns that hold text were left out: Status ('OK')",)


@pytest.mark.parametrize(
    "head",
    [
        "Frame;tip - X;State;tip - Y",
        "scorer;n;n;n\nbodyparts;tip;tip;tip\ncoords;x;state;y",
        "cm A\nt;x;state;y",
        "frame_idx;tip.x;tip.state;tip.y",
    ],
)
def test_every_table_of_tracks_leaves_text_out(head, tmp_path):
    rows = "".join(f"{i};{i}.5;{STATES[i % 5]};{2 * i}.25\n" for i in range(30))
    recording = open_table(tmp_path, f"{head}\n{rows}", "camera")
    (track,) = recording.tracks()
    np.testing.assert_array_equal(track.positions, np.column_stack([np.arange(30) + 0.5, 2 * np.arange(30) + 0.25]))
    assert len(recording.signals) == 2
    assert any(note.startswith("columns that hold text were left out:") for note in recording.notes)


def test_a_workbook_leaves_text_out(tmp_path):
    rows = [["Frame", "tip - X (mm)", "tip - Y (mm)", "State"], *([i, i + 0.5, 0.25, "OK"] for i in range(12))]
    recording = open_table(tmp_path, track_files.workbook({"s": rows}), "camera")
    np.testing.assert_array_equal(recording.read("tip - X"), np.arange(12) + 0.5)
    assert "columns that hold text were left out: State" in recording.notes


def test_a_cell_of_text_among_numbers_is_refused_with_its_place(tmp_path):
    rows = "".join(f"{1e-3 * i:.3f};{'OK' if i == 17 else i}\n" for i in range(30))
    with pytest.raises(CorruptFileError, match=r"line 19, column 'a.*found 'OK'.*declare `missing`"):
        open_table(tmp_path, f"Time (s);a (V)\n{rows}").read("a")


def test_numbers_that_are_not_understood_are_no_text(tmp_path):
    for cell in ("1'000", "1.000,5", "12 345", "1,00,000"):
        rows = "".join(f"{1e-3 * i:.3f};{cell};{i}\n" for i in range(30))
        with pytest.raises(CorruptFileError, match="line 2, column 'a"):
            open_table(tmp_path, f"Time (s);a (V);b (V)\n{rows}").read("b")


def test_a_table_of_text_alone_holds_no_channel(tmp_path):
    rows = "".join(f"{1e-3 * i:.3f};OK\n" for i in range(30))
    with pytest.raises(ReadError, match=r"no column holds numbers beside the time.*Status: 'OK'"):
        open_table(tmp_path, f"Time (s);Status\n{rows}")


# ---- line breaks within quotes


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("count", [30, 3000])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_line_that_ends_within_quotes_goes_on(end, count, encoding, tmp_path, monkeypatch):
    monkeypatch.setattr(text_file, "CHUNK_BYTES", 1000)
    rows = [f'{1e-3 * i:.3f};"shot {i}{end}fired ""well""";{i}.5' for i in range(count)]
    text = end.join([f'"Time{end}(s)";Note;"acc{end}(g)"', *rows, ""])
    recording = open_table(tmp_path, text.encode(encoding))
    assert [(s.name, s.unit) for s in recording.signals] == [("acc", "g")]
    np.testing.assert_array_equal(recording.read("acc"), np.arange(count) + 0.5)
    assert recording.time_base("acc").step_s == 1e-3
    assert recording.notes == ("""columns that hold text were left out: Note ('shot 0 fired "well"')""",)


def test_a_quote_that_is_none_joins_nothing(tmp_path):
    rows = "".join(f"{1e-3 * i:.3f};{i}.5;{2 * i}.5\n" for i in range(300))
    recording = open_table(tmp_path, f'Stand;"3\nTime (s);a (V);"tube" (V)\n{rows}')
    np.testing.assert_array_equal(recording.read("a"), np.arange(300) + 0.5)


def test_a_track_table_with_line_breaks_in_its_headings_is_read(tmp_path):
    rows = "".join(f"{i};{i}.5;2.25\n" for i in range(12))
    recording = open_table(tmp_path, f'Frame;"tip -\nX";"tip -\nY"\n{rows}', "camera")
    np.testing.assert_array_equal(recording.read("tip - X"), np.arange(12) + 0.5)


def test_a_log_of_frames_as_csv_is_read_in_quotes_too(tmp_path):
    content = can_logs.can_csv(can_entries(30)).replace(b"\r\n", b"\n")
    expected = everything(open_table(tmp_path, content, "can", database=DBC))
    found = open_table(tmp_path, in_quotes(content, ","), "can", database=DBC)
    assert found.reader == "python-can CSV log"
    assert str(everything(found)) == str(expected)
