"""Files of an export appear together and verified, or not at all."""

import errno
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.exporters import publication
from recoil_acquisition.exporters.content import Content, gather
from recoil_acquisition.exporters.dewesoft_text import CsvExporter
from recoil_acquisition.exporters.exporter import ExportedTable, first_difference
from recoil_acquisition.exporters.publication import write_export
from recoil_acquisition.exporters.table import EXPORTERS, exporter_of
from tests.builders.shots import make_shot

CONTENT = gather(make_shot(), {})


@dataclass
class Failing(CsvExporter):
    """Writes the first files and then fails, or writes other numbers than it should."""

    after: int
    error: BaseException | None = None
    wrong: float = 0.0

    def write(self, content: Content, path: Path) -> None:
        super().write(content, path)
        self.after -= 1
        if self.after >= 0:
            return
        if self.error is not None:
            raise self.error
        path.write_text(path.read_text(encoding="utf-8").replace("\n0.0,", f"\n{self.wrong},", 1), encoding="utf-8")


def below(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*"))


@pytest.mark.parametrize("after", [0, 1, 4])
@pytest.mark.parametrize(
    ("error", "says"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (ValueError("an odd\nvalue"), "csv cannot hold this: an odd value"),
        (StoreError("is full"), "is full"),
        (ModuleNotFoundError("No module named 'x'", name="x"), "csv needs x"),
    ],
)
def test_nothing_is_left_where_a_later_file_cannot_be_written(after, error, says, tmp_path):
    with pytest.raises(StoreError, match=says):
        write_export(CONTENT, Failing(after, error), tmp_path / "a" / "b", "7")
    assert below(tmp_path) == []


def test_nothing_is_left_of_an_interrupted_export(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        write_export(CONTENT, Failing(2, KeyboardInterrupt()), tmp_path, "7")
    assert below(tmp_path) == []


@pytest.mark.parametrize("wrong", [-0.0, 1e-300])
def test_a_number_that_is_not_read_back_is_found(wrong, tmp_path):
    with pytest.raises(StoreError, match="does not read back as it was written: times of camera"):
        write_export(CONTENT, Failing(1, wrong=wrong), tmp_path, "7")
    assert below(tmp_path) == []


def test_what_exists_is_refused_before_anything_is_written_and_kept(tmp_path):
    (tmp_path / "7_can.csv").write_text("mine")
    with pytest.raises(StoreError, match=r"7_can\.csv: exists already.*--overwrite"):
        write_export(CONTENT, CsvExporter(), tmp_path, "7")
    assert below(tmp_path) == ["7_can.csv"]
    assert (tmp_path / "7_can.csv").read_text() == "mine"
    write_export(CONTENT, CsvExporter(), tmp_path, "7", overwrite=True)
    assert len(below(tmp_path)) == 5
    assert (tmp_path / "7_can.csv").read_text() != "mine"


def test_a_failed_export_leaves_what_it_was_to_replace(tmp_path):
    (tmp_path / "7_can.csv").write_text("mine")
    with pytest.raises(StoreError):
        write_export(CONTENT, Failing(3, OSError(errno.ENOSPC, "full")), tmp_path, "7", overwrite=True)
    assert below(tmp_path) == ["7_can.csv"]
    assert (tmp_path / "7_can.csv").read_text() == "mine"


def test_a_name_that_is_taken_meanwhile_is_not_overwritten_and_the_others_are_taken_back(tmp_path, monkeypatch):
    give_name = publication.give_name

    def taken(temporary: Path, path: Path, *, overwrite: bool) -> None:
        if path.name == "7_can.csv":
            path.write_text("theirs", encoding="utf-8")
        give_name(temporary, path, overwrite=overwrite)

    monkeypatch.setattr(publication, "give_name", taken)
    with pytest.raises(StoreError, match="exists already"):
        write_export(CONTENT, CsvExporter(), tmp_path, "7")
    assert below(tmp_path) == ["7_can.csv"]
    assert (tmp_path / "7_can.csv").read_text() == "theirs"


def test_a_folder_without_hard_links_takes_an_export_too(tmp_path, monkeypatch):
    def refused(*_: object) -> None:
        raise PermissionError(errno.EPERM, "no hard links here")

    monkeypatch.setattr(Path, "hardlink_to", refused)
    assert len(write_export(CONTENT, CsvExporter(), tmp_path, "7")) == 5
    assert len(below(tmp_path)) == 5


def test_a_folder_in_the_place_of_a_file_is_never_replaced(tmp_path):
    (tmp_path / "7.mat").mkdir()
    with pytest.raises(StoreError, match="exists already"):
        write_export(CONTENT, exporter_of("mat"), tmp_path, "7", overwrite=True)


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(StoreError, match="cannot be written"):
        write_export(CONTENT, CsvExporter(), tmp_path / "out", "7")
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("name", ["csv", "dewesoft-text", "uff58"])
def test_a_full_disk_is_one_line(name, tmp_path, monkeypatch):
    opened = Path.open

    def full(path: Path, mode: str = "r", **options: object):
        return opened(Path("/dev/full"), mode.replace("x", "w"), **options) if "x" in mode else opened(path, mode)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(StoreError, match="cannot be written: No space left on device"):
        write_export(CONTENT, exporter_of(name), tmp_path, "7")
    assert below(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "module", "requirement"),
    [("mdf4", "asammdf", "asammdf"), ("tdms", "nptdms", "npTDMS"), ("parquet", "pyarrow", "pyarrow")],
)
def test_a_missing_library_is_an_error_that_says_what_to_install(name, module, requirement, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(StoreError, match=rf"{name} needs {module}.*pip install '{requirement}>="):
        write_export(CONTENT, exporter_of(name), tmp_path / "out", "7")
    assert below(tmp_path) == []


def test_every_file_is_forced_to_the_disk_before_it_is_named(tmp_path, monkeypatch):
    forced = []
    fsync = os.fsync

    def counted(descriptor: int) -> None:
        forced.append(below(tmp_path))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", counted)
    write_export(CONTENT, CsvExporter(), tmp_path, "7")
    named = [sum(not name.startswith(".") for name in names) for names in forced]
    assert named == [0, 1, 1, 2, 2, 3, 3, 4, 4, 5]  # each file before it is named, the folder behind it


def test_signs_types_and_lost_samples_count_when_numbers_are_compared():
    def tables(*values: float, dtype: type = np.float64) -> list[ExportedTable]:
        return [ExportedTable("a", np.zeros(len(values)), {"x": np.array(values, dtype=dtype)})]

    assert first_difference(tables(1.0, np.nan), tables(1.0, -np.nan)) is None
    assert first_difference(tables(0.0), tables(-0.0)) == "samples of 'x'"
    assert first_difference(tables(np.nan), tables(np.inf)) == "samples of 'x'"
    assert first_difference(tables(1.0), tables(1.0, dtype=np.float32)) == "samples of 'x'"
    assert first_difference(tables(1.0), tables(1.0, dtype=np.float32), values_only=True) is None
    assert first_difference(tables(1.0), tables(1.0, 2.0)) == "times of a"
    assert first_difference(tables(1.0), []) == "time bases"


@pytest.mark.exhaustive
def test_only_the_format_that_is_asked_for_is_imported():
    script = """
import sys
from recoil_acquisition.exporters.table import exporter_names, exporter_of
assert exporter_names() and exporter_of("csv").name == "csv"
print(*sorted(name for name in sys.modules if name.startswith("recoil_acquisition.exporters.")))
"""
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    imported = {name.rpartition(".")[2] for name in said.stdout.split()}
    assert "dewesoft_text" in imported
    assert not imported & {"mdf4", "mat_file", "uff58", "tdms_file", "parquet_file"}


def test_every_exporter_is_found_by_its_name():
    assert [exporter_of(name).name for name in EXPORTERS] == list(EXPORTERS)
    with pytest.raises(ValueError, match="'flac' is none of mdf4, mat"):
        exporter_of("flac")
