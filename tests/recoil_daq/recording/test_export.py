"""`export` through the command line: what it prints, what it leaves behind, and how it ends."""

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from recoil_acquisition.exporters import table
from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import ExportedTable, Representation
from recoil_acquisition.exporters.table import EXPORTERS
from recoil_acquisition.exporters.uff58 import Uff58Exporter
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.store import read_shot, write_shot
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal.file import size_text
from recoil_rigs.rig import load_rig
from tests.builders.shots import make_shot

FORMATS = list(EXPORTERS)


@pytest.fixture(scope="module")
def bench_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small shot of four clocks."""
    path = tmp_path_factory.mktemp("bench") / "0007.h5"
    write_shot(make_shot(), path)
    return path


@pytest.fixture
def bench(bench_file: Path, tmp_path: Path) -> Path:
    """A copy of it, in a folder of shots."""
    (tmp_path / "shots").mkdir()
    return Path(shutil.copy(bench_file, tmp_path / "shots"))


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_help_has_an_example_and_lists_every_format(run):
    result = run("export", "--help")
    assert result.exit_code == 0
    assert "Example: recoil-daq export" in result.output
    assert all(name in "".join(result.output.split()) for name in FORMATS)
    assert "|".join(FORMATS) in "".join(result.output.split())


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_written_and_told_file_by_file(run, bench: Path, tmp_path, name):
    result = run("export", bench, "--format", name, "--out", tmp_path / "out")
    document = json.loads(run("export", bench, "--format", name, "--out", tmp_path / "json", "--json").stdout)
    assert result.exit_code == (0 if document["complete"] else 1)
    assert document["schema"] == "recoil-daq/exported/1"
    assert names_in(tmp_path / "out") == names_in(tmp_path / "json")
    assert names_in(tmp_path / "out") == sorted(Path(f["file"]).name for f in document["files"])
    for file in document["files"]:
        path = Path(file["file"])
        assert path.stat().st_size == file["bytes"]
        (row,) = (line for line in result.output.splitlines() if line.startswith(f"{path.name} "))
        assert (tmp_path / "out" / path.name).stat().st_size > 0
        assert f" {file['samples']} " in row
        assert ("exact" in row) == file["exact"]
        for loss in file["losses"]:
            assert loss in result.output
    kept = {c for f in document["files"] for c in (*f["channels"], *f["left_out"])}
    assert kept == set(read_shot(bench).channels)
    assert any("raw counts" in n or "rig file" in n for n in document["notes"])


def test_columns_of_the_table_stand_below_each_other(run, bench: Path, tmp_path):
    lines = run("export", bench, "--format", "csv", "--out", tmp_path / "out").output.splitlines()
    at = lines[1].index("numbers")
    assert [line[at:].strip() for line in lines[2:7]] == ["exact"] * 5
    assert all(line[at - 1] == " " for line in lines[2:7])


def test_what_was_exported_as_csv_or_parquet_is_the_shot_bit_for_bit(run, stored: Path, tmp_path):
    shot = read_shot(stored)
    for name in ("csv", "parquet"):
        assert run("export", stored, "--format", name, "--out", tmp_path / name).exit_code == 0
        seen = []
        for path in sorted((tmp_path / name).iterdir()):
            recording = recognise(path).open(path, Declarations(path.stem.removeprefix("0001_")))
            for signal in recording.signals:
                channel = shot.channels[signal.name]
                np.testing.assert_array_equal(recording.read(signal.name), channel.samples.astype(np.float64))
                assert recording.time_base(signal.name).is_identical(channel.time_base)
                seen.append(signal.name)
        assert sorted(seen) == sorted(shot.channels)


class EvenAlone(Uff58Exporter):
    """Exporter of a format that has no place for an uneven spacing, as one of another package may be."""

    name = "even-alone"

    def carried(self, content: Content) -> Representation:
        names = [c.name for group in content.groups if group.time_base.step_s is None for c in group.channels]
        whole = super().carried(of_even(content))
        told = tuple(f"{name}: left out, its instants are not evenly spaced" for name in names)
        return Representation(whole.tables, (*told, *whole.losses), tuple(names))

    def write(self, content: Content, path: Path) -> None:
        super().write(of_even(content), path)

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        return super().read_back(of_even(content), path)


def of_even(content: Content) -> Content:
    return content.only([group for group in content.groups if group.time_base.step_s is not None])


def test_a_channel_that_the_format_cannot_carry_is_told_and_ends_with_1(run, bench: Path, tmp_path, monkeypatch):
    monkeypatch.setattr(table, "_of_others", lambda: (EvenAlone(),))
    words = ("--format", "even-alone", "--out", tmp_path / "out")
    result = run("export", bench, *words)
    assert result.exit_code == 1
    assert "4 channels left out" in result.output
    assert "lost: x_recoil: left out, its instants are not evenly spaced" in result.output
    alone = run("export", bench, *words, "--channel", "x_recoil", "--overwrite")
    assert alone.exit_code == 3
    assert "choose another --format" in alone.stderr


def test_all_channels_on_one_grid_say_what_it_took_off_them(run, bench: Path, tmp_path):
    words = ("--channel", "p_breech", "--channel", "x_recoil", "--rate", "2000", "--json")
    document = json.loads(run("export", bench, "--format", "csv", "--out", tmp_path / "out", *words).stdout)
    (file,) = document["files"]
    assert (document["aligned"], file["exact"], file["channels"]) == (True, False, ["p_breech", "x_recoil"])
    assert [loss.partition(":")[0] for loss in file["losses"][:2]] == ["p_breech", "x_recoil"]
    assert "what is above 800 Hz was taken out" in file["losses"][0]
    recording = recognise(Path(file["file"])).open(Path(file["file"]), Declarations("dewetron"))
    base, shot = recording.time_base("x_recoil"), read_shot(bench)
    assert base.step_s == 1 / 2000
    assert base.start_s * 2000 == pytest.approx(round(base.start_s * 2000), abs=1e-9)
    # of the camera there is what lies in its record, mapped to the reference clock
    own, read = shot.channels["x_recoil"], recording.read("x_recoil")
    mapped = shot.alignment("camera").to_reference(own.time_base.times_s)
    inside = (base.times_s > mapped[0]) & (base.times_s < mapped[-1])
    assert np.isfinite(read).any()
    assert np.isnan(read[~inside]).all()


@pytest.mark.parametrize(("rate", "code"), [("0", 2), ("-5", 2), ("nan", 2), ("1e15", 3)])
def test_a_rate_that_makes_no_grid_is_refused_in_one_line(run, bench: Path, tmp_path, rate, code):
    words = ("--channel", "p_breech", "--rate", rate)
    result = run("export", bench, "--format", "csv", "--out", tmp_path / "out", *words)
    assert result.exit_code == code
    assert "--rate" in result.stderr
    assert not (tmp_path / "out").exists()


def test_channels_can_be_chosen(run, bench: Path, tmp_path):
    words = ("--channel", "x_recoil", "--channel", "p_breech", "--json")
    result = run("export", bench, "--format", "csv", "--out", tmp_path / "out", *words)
    assert [f["channels"] for f in json.loads(result.stdout)["files"]] == [["p_breech"], ["x_recoil"]]


def test_an_unknown_channel_is_refused_with_the_nearest_names(run, bench: Path, tmp_path):
    result = run("export", bench, "--format", "csv", "--out", tmp_path / "out", "--channel", "p_breach")
    assert result.exit_code == 3
    (line,) = result.stderr.splitlines()
    assert "no channel 'p_breach' in this shot; found p_breech" in line
    assert str(bench) in line
    assert not (tmp_path / "out").exists()


def test_clocks_are_mapped_when_asked_and_it_is_said(run, bench: Path, tmp_path):
    words = ("--aligned", "--channel", "x_recoil", "--channel", "p_breech")
    result = run("export", bench, "--format", "csv", "--out", tmp_path / "out", *words)
    assert result.exit_code == 0, result.output
    assert "clock camera was mapped to dewetron: t_ref = (1 + 2e-05) t - 0.0123 s" in result.output
    refused = run("export", bench, "--format", "csv", "--out", tmp_path / "b", "--aligned")
    assert refused.exit_code == 3
    assert "the clock 'imu' was not aligned: no common motion" in refused.stderr
    assert not (tmp_path / "b").exists()


def test_clocks_that_keep_their_own_zero_are_told(run, bench: Path, tmp_path):
    result = run("export", bench, "--format", "mdf4", "--out", tmp_path / "out")
    assert "4 clocks, each with its own zero: dewetron, camera, can, imu" in result.output


def test_nothing_is_overwritten_unless_asked(run, bench: Path, tmp_path):
    target = tmp_path / "out" / "0007.mat"
    target.parent.mkdir()
    target.write_text("mine")
    result = run("export", bench, "--format", "mat", "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "--overwrite" in result.stderr
    assert target.read_text() == "mine"
    assert run("export", bench, "--format", "mat", "--out", tmp_path / "out", "--overwrite").exit_code == 0
    assert target.read_bytes()[:6] == b"MATLAB"
    assert names_in(tmp_path / "out") == ["0007.mat"]


@pytest.mark.parametrize("content", [b"", b"Time (s),a\n0,1\n", b"\x89HDF\r\n\x1a\n and nothing else"])
def test_a_file_that_is_no_shot_is_refused(run, tmp_path, content):
    foreign = tmp_path / "foreign.h5"
    foreign.write_bytes(content)
    result = run("export", foreign, "--format", "csv", "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert len(result.stderr.splitlines()) == 1
    assert str(foreign) in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_missing_library_is_named_with_its_extra(run, bench: Path, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    result = run("export", bench, "--format", "mdf4", "--out", tmp_path / "out", "--json")
    assert result.exit_code == 3
    assert json.loads(result.stdout)["remedy"] == "pip install 'asammdf>=8.6'"
    assert not (tmp_path / "out").exists()


def test_wrong_usage_ends_with_2(run, bench: Path):
    assert run("export", bench).exit_code == 2
    assert run("export", bench, "--format", "flac").exit_code == 2
    assert run("export", "--format", "csv").exit_code == 2


def test_a_folder_that_cannot_be_made_is_one_line(run, bench: Path, tmp_path):
    (tmp_path / "out").write_text("mine")
    result = run("export", bench, "--format", "csv", "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "--out" in result.stderr
    assert "Traceback" in run("export", bench, "--format", "csv", "--out", tmp_path / "out", "--debug").stderr


def test_ctrl_c_leaves_nothing(run, bench: Path, tmp_path, monkeypatch):
    import recoil_acquisition.exporters.dewesoft_text

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(recoil_acquisition.exporters.dewesoft_text.CsvExporter, "read_back", interrupted)
    assert run("export", bench, "--format", "csv", "--out", tmp_path / "out").exit_code == 130
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("size", "text"), [(999, "999 B"), (23_400, "23.4 kB"), (5_120_000, "5.12 MB"), (2e9, "2 GB")])
def test_sizes_are_written_as_people_read_them(size, text):
    assert size_text(int(size)) == text


def test_curves_are_exported_behind_a_channel_frequency_class(run, stored: Path, tmp_path):
    shot = read_shot(stored)
    result = run("export", stored, "--format", "parquet", "--filter", "cfc-180", "--out", tmp_path / "out")
    assert result.exit_code == 0
    (path,) = (p for p in (tmp_path / "out").iterdir() if p.stem.endswith("_dewetron"))
    recording = recognise(path).open(path, Declarations("dewetron"))
    recorded = shot.channels["acc_recoil"]
    rate_hz = 1.0 / recorded.time_base.step_s
    sections = butter(2, 2.0775 * 180, fs=rate_hz, output="sos")
    expected = sosfiltfilt(sections, recorded.measured)
    found = recording.read("acc_recoil")
    inner = slice(2000, -2000)
    assert np.abs(found - expected)[inner].max() < 1e-6 * np.abs(expected).max()
    assert np.abs(found - recorded.measured).max() > 0.01 * np.abs(expected).max()
    camera = next(name for name in shot.channels if shot.channels[name].time_base.clock == "camera")
    said = " ".join(result.output.split())
    assert re.search(rf"as recorded, not filtered by cfc-180 because [^:]*: [^:]*{camera}.*--rate HZ", said)


@pytest.mark.whole_way
def test_on_a_grid_the_class_filters_what_has_no_even_samples_of_its_own(run, mixed_shot, tmp_path):
    rig, rate_hz = load_rig(mixed_shot.rig_file), 4000.0
    ingested = ingest_files(rig, mixed_shot.files, shot="0001", out=tmp_path / "shots").path
    read = {}
    for name, words in (("plain", ()), ("filtered", ("--filter", "cfc-60"))):
        grid = ("--rate", str(rate_hz), "--format", "csv")
        result = run("export", ingested, *grid, *words, "--out", tmp_path / name)
        assert result.exit_code == 0, result.output
        assert "not filtered" not in result.output
        (path,) = (tmp_path / name).iterdir()
        read[name] = recognise(path).open(path, Declarations("dewetron"))
    for channel in ("p_brake", "gyro_tipping"):
        assert read_shot(ingested)[channel].time_base.step_s is None
        plain, filtered = (read[name].read(channel) for name in read)
        there = np.flatnonzero(np.isfinite(plain))
        assert np.diff(there).max() == 1
        expected = sosfiltfilt(butter(2, 2.0775 * 60, fs=rate_hz, output="sos"), plain[there])
        inner = there[200:-200]
        scale = np.abs(expected).max()
        assert np.abs(filtered[inner] - expected[200:-200]).max() < 1e-6 * scale
        assert np.abs(filtered[inner] - plain[inner]).max() > 1e-3 * scale
