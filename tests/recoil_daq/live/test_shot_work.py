"""Shots on their way to shot files: a conversion gives the document of `ingest --json`, or why there is none."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from recoil_daq.live.shot_work import Conversion
from recoil_rigs.rig import find_rig
from recoil_rigs.twin import TwinShot
from tests.builders.foreign_modules import hostile_folder, modules_run


def test_a_shot_is_converted_while_the_caller_goes_on_and_no_module_of_the_users_folder_is_run(
    field_shot: TwinShot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = hostile_folder(tmp_path / "user")
    monkeypatch.chdir(folder)
    conversion = Conversion(find_rig("field-2013"), field_shot.files, "0007", tmp_path)
    assert conversion.result() is None
    found = conversion.result(60.0)
    assert found is not None
    code, document = found
    assert code == 0
    assert document["shot"] == "0007"
    assert Path(document["file"]) == tmp_path / "0007.h5"
    assert not modules_run(folder)


def test_a_fault_of_the_files_comes_back_as_its_message(tmp_path: Path) -> None:
    (tmp_path / "x_dewetron.csv").write_text("nothing")
    found = Conversion(find_rig("mixed"), [tmp_path / "x_dewetron.csv"], "0001", tmp_path).result(60.0)
    assert found is not None
    code, document = found
    assert code == 3
    assert "x_dewetron.csv" in document["message"]


def test_it_can_be_ended_and_leaves_nothing(field_shot: TwinShot, tmp_path: Path) -> None:
    conversion = Conversion(find_rig("field-2013"), field_shot.files, "0001", tmp_path / "out")
    time.sleep(0.2)
    conversion.end()
    assert not (tmp_path / "out" / "0001.h5").exists()
