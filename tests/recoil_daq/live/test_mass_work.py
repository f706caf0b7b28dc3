"""The mass after a shot: by a process that stays warm, in nobody's way, and that may be killed at any moment."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from recoil_daq.live.mass_work import MassWork, mass_line
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.reports.identify import identify_file
from recoil_daq.workers import WarmWorker
from recoil_rigs.rig import load_rig
from tests.builders.range_session import Range, Told
from tests.builders.virtual_shots import settling_soon

PID = "tests.builders.pieces_of_work:process"


def waited(condition: Callable[[], bool], limit_s: float = 120.0) -> None:
    until_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert condition()


@pytest.fixture
def worker() -> Iterator[WarmWorker]:
    made = WarmWorker()
    yield made
    made.close(at_once=True)


@pytest.mark.skipif(sys.platform == "win32", reason="priorities are classes there")
def test_it_stays_has_the_lowest_priority_and_is_started_anew_when_it_was_killed(worker: WarmWorker) -> None:
    first = worker.submit(PID, None).result()[0]
    assert worker.submit(PID, None).result()[0] == first
    assert os.getpriority(os.PRIO_PROCESS, first) == 19
    os.kill(first, signal.SIGKILL)
    time.sleep(0.5)
    assert worker.submit(PID, None).result()[0] != first


@pytest.fixture
def masses(tmp_path: Path) -> Iterator[tuple[MassWork, Told]]:
    display = Told()
    made = MassWork(tmp_path, display)
    yield made, display
    made.close()


def shot_of(stored: Path, folder: Path) -> LiveShot:
    path = folder / "0001.h5"
    shutil.copy(stored, path)
    return LiveShot("0001", state=ShotState.USABLE, document={"file": str(path)})


def test_the_mass_is_that_of_identify_to_the_last_bit_though_its_worker_is_killed_once(
    masses: tuple[MassWork, Told], stored: Path, tmp_path: Path
) -> None:
    work, display = masses
    work.prewarm()
    shot = shot_of(stored, tmp_path)
    pid = work._worker.submit(PID, None).result()[0]
    work.begin(shot)
    os.kill(pid, signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)

    def looked() -> bool:
        work.look()
        return not work.pending

    waited(looked)
    assert shot.mass is not None
    own = identify_file(shot.document["file"], out=tmp_path / "own")  # type: ignore[index]
    assert (shot.mass["value"], shot.mass["u"], shot.mass["valid"]) == (own.mass_kg, own.u_kg, own.valid)
    written = json.loads((tmp_path / "reports" / own.shot / "report.json").read_text())
    assert written["mass"] == own.document["mass"]
    assert display.notices == [mass_line("0001", shot.mass)]


def test_a_shot_that_allows_no_mass_is_said_and_ends_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    display = Told()
    rig = settling_soon(load_rig("mixed"), 0.1)
    monkeypatch.setattr("recoil_daq.live.dropped_files.source_of", lambda _, f: f.path.stem.rpartition("_")[2])
    monkeypatch.setattr("recoil_daq.live.folder_watch.LOOK_EVERY_S", 0.02)
    one = Range(monkeypatch, rig, tmp_path, display, watch=tmp_path / "in", shots=1, identify=True)

    def files() -> None:
        for name in ("0001_dewetron.csv", "0001_camera.csv"):
            (tmp_path / "in" / name).write_text("x")

    display.then["0001 captured"] = files
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(shot.state, shot.mass) for shot in outcome.shots] == [("usable", None)]
    (said,) = display.told("has no mass")
    assert "0001.h5" in said


def test_a_mass_is_one_line() -> None:
    mass: dict[str, Any] = {
        "value": 783.04, "u": 2.6, "U95": [777.81, 788.2], "E_n": 0.31, "valid": True, "reason": "", "report": "r",
    }  # fmt: skip
    assert mass_line("0003", mass) == "0003 mass 783.0 kg, 95 % 777.8 to 788.2, E_n 0.3, VALID"
    assert mass_line("0003", mass, preview={"daq"}).endswith("E_n 0.3, provisional: preview of daq, VALID")
    refused = mass_line("0003", {**mass, "E_n": None, "valid": False, "reason": "p_brake: low; raise the range"})
    assert refused.endswith("788.2, NOT VALID: p_brake: low; raise the range")
