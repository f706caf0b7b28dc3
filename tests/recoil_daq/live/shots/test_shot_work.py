"""Shots on their way to shot files: a conversion gives the document of `ingest --json`, or why there is none."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from recoil_acquisition.store import read_shot
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.live.shots.conversion import Conversion
from recoil_daq.warm_worker import WarmWorker
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot
from tests.builders.foreign_modules import hostile_folder, modules_run


class Converted(NamedTuple):
    """What a process of its own made of a shot, asked for in a folder with modules that it must not run."""

    folder: Path
    went_on: bool
    code: int
    document: dict[str, Any]
    modules_run: set[str]


@pytest.fixture(scope="module")
def converted(field_shot: TwinShot, tmp_path_factory: pytest.TempPathFactory) -> Converted:
    folder = tmp_path_factory.mktemp("cold")
    user = hostile_folder(folder / "user")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(user)
        conversion = Conversion(load_rig("field-2013"), field_shot.files, "0007", folder)
        went_on = conversion.result() is None
        found = conversion.result(60.0)
    assert found is not None
    return Converted(folder, went_on, *found, modules_run(user))


@pytest.mark.real_time
def test_a_shot_is_converted_while_the_caller_goes_on_and_no_module_of_the_users_folder_is_run(
    converted: Converted,
) -> None:
    assert converted.went_on
    assert converted.code == 0
    assert converted.document["shot"] == "0007"
    assert Path(converted.document["file"]) == converted.folder / "0007.h5"
    assert not converted.modules_run


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


@pytest.fixture(scope="module")
def unharmed() -> Iterator[WarmWorker]:
    """A worker that serves several tests; none may end it."""
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


@pytest.mark.real_time
def test_a_worker_converts_as_the_command_does(
    field_shot: TwinShot, converted: Converted, tmp_path: Path, unharmed: WarmWorker
) -> None:
    file = tmp_path / "0007.h5"
    warm = outcome(Conversion(load_rig("field-2013"), field_shot.files, "0007", tmp_path, worker=unharmed))
    assert json.loads(json.dumps(warm)) == [converted.code, {**converted.document, "file": str(file)}]
    assert read_shot(file).quality == read_shot(converted.folder / "0007.h5").quality


@pytest.mark.real_time
def test_a_fault_of_the_files_comes_back_as_its_message_from_the_command_and_from_a_worker(
    tmp_path: Path, unharmed: WarmWorker
) -> None:
    (tmp_path / "x_dewetron.csv").write_text("nothing")
    files = [tmp_path / "x_dewetron.csv"]
    cold, warm = (
        outcome(Conversion(load_rig("mixed"), files, "0001", tmp_path, worker=one)) for one in (None, unharmed)
    )
    assert cold == warm
    code, document = cold
    assert code == 3
    assert "x_dewetron.csv" in document["message"]


@pytest.mark.real_time
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


@pytest.mark.real_time
def test_a_worker_that_ends_twice_leaves_the_shot_to_the_command(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.live.shots.conversion._CONVERT", "tests.builders.pieces_of_work:ending")
    conversion = Conversion(load_rig("field-2013"), field_shot.files, "0001", tmp_path, worker=worker)
    assert outcome(conversion)[1]["usable"] is True


@pytest.mark.real_time
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


@pytest.mark.real_time
def test_a_worker_that_is_given_up_leaves_nothing_and_takes_the_next_shot(
    field_shot: TwinShot, tmp_path: Path, worker: WarmWorker
) -> None:
    rig = load_rig("field-2013")
    conversion = Conversion(rig, field_shot.files, "0001", tmp_path / "out", worker=worker)
    time.sleep(0.5)
    conversion.end()
    assert not list((tmp_path / "out").glob("*"))
    assert outcome(Conversion(rig, field_shot.files, "0001", tmp_path / "out", worker=worker))[0] == 0
