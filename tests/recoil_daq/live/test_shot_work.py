"""Shots on their way to shot files: a conversion gives the document of `ingest --json`, or why there is none."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.store import read_shot
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.live.conversion import Conversion
from recoil_daq.warm_worker import WarmWorker
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot
from tests.builders.foreign_modules import hostile_folder, modules_run


def test_a_shot_is_converted_while_the_caller_goes_on_and_no_module_of_the_users_folder_is_run(
    field_shot: TwinShot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = hostile_folder(tmp_path / "user")
    monkeypatch.chdir(folder)
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0007", tmp_path)
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
    found = Conversion(load_rig("mixed"), [tmp_path / "x_dewetron.csv"], "0001", tmp_path).result(60.0)
    assert found is not None
    code, document = found
    assert code == 3
    assert "x_dewetron.csv" in document["message"]


def test_it_can_be_ended_and_leaves_nothing(field_shot: TwinShot, tmp_path: Path) -> None:
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0001", tmp_path / "out")
    time.sleep(0.2)
    conversion.end()
    assert not (tmp_path / "out" / "0001.h5").exists()


def kill(number: int) -> None:
    os.kill(number, signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)


@pytest.fixture
def worker() -> Iterator[WarmWorker]:
    made = WarmWorker()
    yield made
    made.close()


def outcome(conversion: Conversion) -> tuple[int, dict[str, Any]]:
    until_s = time.monotonic() + 120.0
    while time.monotonic() < until_s:
        if (found := conversion.result()) is not None:
            return found
        time.sleep(0.02)
    raise TimeoutError("the conversion does not end")


def test_a_worker_converts_as_the_command_does(field_shot: TwinShot, tmp_path: Path, worker: WarmWorker) -> None:
    rig = load_rig("field-2013")
    warm = outcome(Conversion(rig, field_shot.files, "0007", tmp_path / "warm", worker=worker))
    cold = outcome(Conversion(rig, field_shot.files, "0007", tmp_path / "cold"))
    assert json.loads(json.dumps(warm)) == [cold[0], {**cold[1], "file": str(tmp_path / "warm" / "0007.h5")}]
    assert read_shot(tmp_path / "warm" / "0007.h5").quality == read_shot(tmp_path / "cold" / "0007.h5").quality


def test_a_fault_of_a_worker_is_that_of_the_command(tmp_path: Path, worker: WarmWorker) -> None:
    (tmp_path / "x_dewetron.csv").write_text("nothing")
    files = [tmp_path / "x_dewetron.csv"]
    faults = [outcome(Conversion(load_rig("mixed"), files, "0001", tmp_path, worker=one)) for one in (worker, None)]
    assert faults[0] == faults[1]


@pytest.mark.parametrize("written", [False, True])
def test_a_shot_whose_worker_is_killed_is_converted_by_another_one_be_it_written_already_or_not(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker, written: bool
) -> None:
    target = tmp_path / "0001.h5"
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0001", tmp_path, worker=worker)
    (number,) = worker._processes._pool._processes  # type: ignore[union-attr]
    while written and not target.exists():
        time.sleep(0.001)
    kill(number)
    code, document = outcome(conversion)
    assert (code, document["usable"]) == (0, True)
    assert read_shot(target).name == "0001"
    assert not list(tmp_path.glob("*partial*"))
    assert [row.shot for row in ShotLog.beside(target).rows] == ["0001"]


def test_a_worker_that_ends_twice_leaves_the_shot_to_the_command(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.live.conversion._CONVERT", "tests.builders.pieces_of_work:ending")
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0001", tmp_path, worker=worker)
    assert outcome(conversion)[1]["usable"] is True


def test_a_shot_file_of_somebody_else_is_not_replaced_though_the_worker_was_killed(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker
) -> None:
    (tmp_path / "0001.h5").write_bytes(b"not mine")
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0001", tmp_path, worker=worker)
    (number,) = worker._processes._pool._processes  # type: ignore[union-attr]
    kill(number)
    code, document = outcome(conversion)
    assert (code, document["code"]) == (3, "exists")
    assert (tmp_path / "0001.h5").read_bytes() == b"not mine"


def test_a_worker_that_is_given_up_leaves_nothing_and_takes_the_next_shot(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker
) -> None:
    rig = load_rig("field-2013")
    conversion = Conversion(rig, field_shot.files, "0001", tmp_path / "out", worker=worker)
    time.sleep(0.5)
    conversion.end()
    assert not list((tmp_path / "out").glob("*"))
    assert outcome(Conversion(rig, field_shot.files, "0001", tmp_path / "out", worker=worker))[0] == 0


def test_a_shot_is_converted_with_the_rig_that_was_armed_though_its_file_was_edited_since(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(load_rig("field-2013").text, encoding="utf-8")
    armed = load_rig(path)
    path.write_text("edited = and not even", encoding="utf-8")
    code, document = outcome(Conversion(armed, field_shot.files, "0007", tmp_path / "warm", worker=worker))
    assert (code, document["shot"]) == (0, "0007")
    code, document = outcome(Conversion(armed, field_shot.files, "0007", tmp_path / "cold"))
    assert code == 3
    assert document["message"].startswith(f"{path} was changed since it was armed")
    assert not (tmp_path / "cold").exists()
