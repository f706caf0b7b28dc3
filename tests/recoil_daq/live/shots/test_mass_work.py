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
from types import SimpleNamespace
from typing import Any

import pytest

from recoil_acquisition.errors import WorkerError
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.mass_work import MassWork, campaign_line, mass_line, provisional, whole_line
from recoil_daq.live.shots.preview import mass_by_file
from recoil_daq.reports.identify import identify_file
from recoil_daq.warm_worker import WarmWork, WarmWorker
from recoil_rigs.rig import load_rig
from tests.builders.range_session import Range, Told
from tests.builders.virtual_shots import settling_soon

PID = "tests.builders.pieces_of_work:process"
WORKED = "tests.builders.pieces_of_work:told"
ENDING = "tests.builders.pieces_of_work:ending"


def waited(condition: Callable[[], bool], limit_s: float = 120.0) -> None:
    until_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert condition()


@pytest.fixture
def worker() -> Iterator[WarmWorker]:
    made = WarmWorker()
    yield made
    made.close()


def done(worker: WarmWorker, work: WarmWork) -> Any:
    """Wait for a piece of work."""

    def looked() -> bool:
        worker.look()
        return work.done

    waited(looked)
    return work.result()


def pid(worker: WarmWorker) -> int:
    found: int = done(worker, worker.ask(PID, None))[0]
    return found


def kill(number: int) -> None:
    os.kill(number, signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="priorities are classes there")
def test_it_stays_gives_way_to_others_and_is_started_anew_when_it_was_killed(worker: WarmWorker) -> None:
    first = pid(worker)
    assert pid(worker) == first
    assert os.getpriority(os.PRIO_PROCESS, first) == os.getpriority(os.PRIO_PROCESS, 0) + 5
    kill(first)
    time.sleep(0.5)
    assert pid(worker) != first


@pytest.mark.real_time
def test_what_has_a_lower_rank_goes_first_and_what_may_be_put_off_is_begun_anew(
    worker: WarmWorker, tmp_path: Path
) -> None:
    pid(worker)
    log = tmp_path / "log"
    long = worker.ask(WORKED, (log, "long", 1.0), rank=2, puts_off=True)
    waited(lambda: log.exists() and "long begun" in log.read_text())
    others = [worker.ask(WORKED, (log, name, 0.0), rank=rank) for name, rank in (("mass", 1), ("shot", 0))]
    for work in (*others, long):
        done(worker, work)
    assert log.read_text().splitlines() == [
        "long begun", "shot begun", "shot done", "mass begun", "mass done", "long begun", "long done",
    ]  # fmt: skip


@pytest.mark.real_time
def test_what_may_not_be_put_off_is_completed_first(worker: WarmWorker, tmp_path: Path) -> None:
    pid(worker)
    log = tmp_path / "log"
    one = worker.ask(WORKED, (log, "mass", 0.5), rank=1)
    waited(log.exists)
    done(worker, worker.ask(WORKED, (log, "shot", 0.0)))
    assert one.result() is None
    assert log.read_text().splitlines() == ["mass begun", "mass done", "shot begun", "shot done"]


def test_work_whose_process_ends_twice_is_a_worker_error_and_ends_nothing_else(worker: WarmWorker) -> None:
    again: list[Any] = []

    def once_more(item: Any) -> Any:
        again.append(item)
        return item

    deadly = worker.ask(ENDING, None, again=once_more)
    after = worker.ask(PID, None, rank=1)
    with pytest.raises(WorkerError, match="ended before it was done"):
        done(worker, deadly)
    assert again == [None]
    assert done(worker, after)


@pytest.mark.real_time
def test_what_waits_can_be_taken_back_and_what_is_under_way_given_up(worker: WarmWorker, tmp_path: Path) -> None:
    pid(worker)
    log = tmp_path / "log"
    running = worker.ask(WORKED, (log, "running", 60.0))
    waiting = worker.ask(WORKED, (log, "waiting", 0.0))
    waited(log.exists)
    assert worker.drop(waiting)
    assert not worker.drop(running)
    worker.give_up(running)
    assert pid(worker)
    assert log.read_text().splitlines() == ["running begun"]


@pytest.fixture
def masses(worker: WarmWorker, tmp_path: Path) -> tuple[MassWork, Told]:
    display = Told()
    return MassWork(worker, tmp_path, display), display


def shot_of(stored: Path, folder: Path) -> LiveShot:
    path = folder / "0001.h5"
    shutil.copy(stored, path)
    return LiveShot("0001", state=ShotState.USABLE, document={"file": str(path)})


@pytest.mark.real_time
def test_the_mass_is_that_of_identify_to_the_last_bit_though_its_worker_is_killed_once(
    masses: tuple[MassWork, Told], worker: WarmWorker, stored: Path, tmp_path: Path
) -> None:
    work, display = masses
    shot = shot_of(stored, tmp_path)
    number = pid(worker)
    work.begin(shot)
    kill(number)

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
    assert "specification as bare rig" in display.notices[0]


@pytest.mark.real_time
def test_a_shot_that_allows_no_mass_is_said_and_ends_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    display = Told()
    rig = settling_soon(load_rig("mixed"), 0.1)
    monkeypatch.setattr("recoil_daq.live.shots.dropped_files.source_of", lambda _, f: f.path.stem.rpartition("_")[2])
    monkeypatch.setattr("recoil_daq.live.shots.folder_watch.LOOK_EVERY_S", 0.02)
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


MASS: dict[str, Any] = {
    "value": 783.04, "u": 2.6, "U95": [777.81, 788.2], "E_n": 0.31, "valid": True, "reason": "", "report": "r",
    "thinned_hz": None, "bare": False, "provisional": [],
}  # fmt: skip


def test_a_mass_is_one_line() -> None:
    assert mass_line("0003", MASS) == "0003 mass 783.0 kg, 95 % 777.8 to 788.2, E_n 0.3, VALID"
    of_less = {**MASS, "thinned_hz": 50e3, "bare": True}
    of_less["provisional"] = provisional(of_less, {"daq"})
    assert mass_line("0003", of_less).endswith(
        "E_n 0.3, VALID (provisional: thinned to 50 kHz, preview of daq; specification as bare rig)"
    )
    refused = mass_line("0003", {**MASS, "E_n": None, "valid": False, "reason": "p_brake: low; raise the range"})
    assert refused.endswith("788.2, NOT VALID: p_brake: low; raise the range")


@pytest.mark.parametrize(
    ("value", "end"),
    [(783.16, "50 kHz gave the same"), (783.20, "which CHANGES IT by -0.16 kg, 0.06 u from what 50 kHz gave")],
)
def test_the_full_rate_says_whether_it_changes_what_was_said_before_it(value: float, end: str) -> None:
    line = whole_line("0003", {**MASS, "value": value, "thinned_hz": 50e3}, MASS)
    assert line == f"0003 mass 783.0 kg, 95 % 777.8 to 788.2, E_n 0.3, VALID; by the full rate, {end}"


def test_the_mass_by_the_file_is_told_beside_that_of_the_preview_in_u() -> None:
    assert mass_by_file({**MASS, "value": 783.05}, MASS) == "the file gives the mass of the preview: -0.01 kg, 0.0038 u"
    changed = mass_by_file({**MASS, "value": 780.44}, MASS)
    assert changed == "the file CHANGES THE MASS of the preview by +2.6 kg, 1 u"


@pytest.mark.parametrize(("before_hz", "told_after"), [(None, 2), (50e3, 1)])
def test_a_preview_and_its_file_are_compared_as_alike_as_they_can_be(
    tmp_path: Path, before_hz: float | None, told_after: int
) -> None:
    display, answers = Told(), [{**MASS, "value": 785.64, "thinned_hz": 50e3}, {**MASS, "value": 785.64}]
    found = iter(answers)
    worker = SimpleNamespace(
        ask=lambda *_, **__: SimpleNamespace(done=True, result=lambda: next(found)), look=lambda: None,
        drop=lambda _: None,
    )  # fmt: skip
    work = MassWork(worker, tmp_path, display)  # type: ignore[arg-type]
    document = {"file": str(tmp_path / "0001.h5"), "channels": [{"rate_hz": 200e3}]}
    shot = LiveShot("0001", state=ShotState.USABLE, document=document, previewed=frozenset({"daq"}))
    shot.captured = tmp_path / "0001.rdlog"
    shot.files = {"daq": tmp_path / "0001.dmd"}
    shot.mass = {**MASS, "thinned_hz": before_hz}
    work.begin(shot)
    for looked in (1, 2):
        work.look()
        told = display.told("the file CHANGES THE MASS of the preview by +2.6 kg, 1 u")
        assert len(told) == (looked >= told_after)


def test_a_campaign_is_one_line() -> None:
    campaign: dict[str, Any] = {
        "shots": ["0001", "0003"], "value": 782.41, "u": 1.84, "U95": [778.8, 786.02], "changes": [], "valid": True,
        "reason": "", "expected": {"shots": 4, "u": 1.532},
    }  # fmt: skip
    together = "campaign of 2: 782.4 +- 3.6 kg, "
    expected = "; 4 shots are expected to give u 1.53 kg"
    assert campaign_line(campaign) == f"{together}nothing changed{expected}"
    changed = {**campaign, "changes": ["the mass changed by +6.0 kg"], "valid": False, "reason": "why"}
    assert campaign_line(changed) == f"{together}the mass changed by +6.0 kg; NOT VALID: why{expected}"
