"""What the commands say of files that are not read, and of every file of other makers that is at hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers.foreign_formats import foreign_formats
from recoil_daq.recording.file_summary import is_database, summarise_file
from tests.builders.foreign_files import FOREIGN_FILES
from tests.builders.shared_data import shared_file


@pytest.mark.parametrize("name", FOREIGN_FILES)
def test_show_names_a_file_that_is_not_read_and_says_what_to_do(name: str, tmp_path: Path, run) -> None:
    path = tmp_path / "measured.dat"
    path.write_bytes(FOREIGN_FILES[name][0])
    remedy = next(one.remedy for one in foreign_formats() if one.name == name)
    shown = run("show", path)
    assert shown.exit_code == 3
    assert shown.stdout == ""
    assert shown.stderr.endswith(f"measured.dat: this is {name}, which is not read; {remedy}; or leave it out\n")
    assert shown.stderr.count("\n") == 1


@pytest.mark.parametrize("name", ["an imc FAMOS file", "a SavvyCAN log (GVRET)", "an archive of NumPy arrays"])
def test_check_and_ingest_say_the_same(name: str, tmp_path: Path, run) -> None:
    path = tmp_path / "measured.dat"
    path.write_bytes(FOREIGN_FILES[name][0])
    for words in (("check", "mixed", path), ("ingest", "mixed", path, "--out", tmp_path / "shots")):
        done = run(*words)
        assert done.exit_code == 3
        assert f"this is {name}, which is not read" in " ".join(done.stderr.split())


def test_a_rig_in_the_place_of_a_file_is_said_to_be_one(tmp_path: Path, run) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('schema = "recoil-daq/rig/1"\n', encoding="utf-8")
    assert "this is a rig file" in run("show", path).stderr


@pytest.mark.whole_way
def test_every_file_of_other_makers_is_read_or_named_with_what_to_do() -> None:
    unnamed = []
    for path in sorted(shared_file("README.md").parent.rglob("*")):
        if not path.is_file() or is_database(path):
            continue
        try:
            summarise_file(path)
        except UnknownFormatError as error:
            unnamed += [] if error.foreign or error.found else [path.name]
        except ReadError as error:
            unnamed += [] if error.remedy or error.found else [path.name]
    assert unnamed == []
