"""Shots of before a session stand in its table: after a crash, and after a break."""

from __future__ import annotations

import shutil
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_daq.live.range_state import FigureCode, RangeShot
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.earlier_shots import EarlierShots
from recoil_daq.live.shots.mass_work import MassWork
from recoil_daq.reports.shot_mass import earlier_shots
from tests.builders.range_session import Told
from tests.recoil_daq.conftest import Identified


@pytest.fixture
def day(stored: Path, identified: Identified, tmp_path: Path) -> Path:
    shutil.copy(stored, tmp_path / "0001.h5")
    shutil.copytree(identified.reports / "0001", tmp_path / "reports" / "0001")
    return tmp_path


@dataclass
class Asked:
    """Piece of work of the worker that stays warm, done or not."""

    found: Any = None
    done: bool = True

    def result(self) -> Any:
        if isinstance(self.found, Exception):
            raise self.found
        return self.found


@dataclass
class Asking:
    """A worker that only notes what it is asked for."""

    asked: list[tuple[str, Any]] = field(default_factory=list)

    def ask(self, work: str, item: Any, **_: Any) -> Any:
        self.asked.append((work, item))
        return Asked(Future(), done=False)

    def look(self) -> None: ...

    def drop(self, _: Any) -> bool:
        return True


@pytest.mark.whole_way
def test_a_shot_of_before_has_its_verdict_its_figures_and_its_mass(day: Path, identified: Identified) -> None:
    (day / SHOT_LOG).write_text("shot,exclude\n0001,misfire\n")
    found = EarlierShots(Asked(earlier_shots(day)))  # type: ignore[arg-type]
    (shot,) = found.look([])
    assert found.shots == (shot,)
    assert found.look([]) == ()
    shown = RangeShot.of(shot)
    assert (shown.name, shown.state, shown.settled, shown.excluded) == ("0001", ShotState.USABLE, True, "misfire")
    assert shown.age_s is None  # nobody is to be called by it
    assert shown.mass is not None
    assert shown.mass["value"] == identified.report["mass"]["value"]
    assert {figure.code for figure in shown.figures} == {FigureCode.BREECH, FigureCode.STROKE, FigureCode.SPEED}


@pytest.mark.whole_way
def test_a_report_of_another_shot_file_is_not_its_mass_and_a_broken_file_costs_itself_alone(day: Path) -> None:
    (day / "0002.h5").write_bytes(b"broken")
    shutil.copytree(day / "reports" / "0001", day / "reports" / "0002")
    with (day / "0001.h5").open("ab") as stream:
        stream.write(bytes(8))
    (only,) = earlier_shots(day)
    assert (only["shot"], only["mass"]) == ("0001", None)


def test_what_is_the_session_s_own_is_not_there_twice_and_a_worker_that_ended_ends_nothing() -> None:
    document = {"usable": True, "reasons": [], "quality": []}
    told = [{"shot": name, "document": document, "mass": None, "excluded": ""} for name in ("0001", "0002")]
    waiting = Asked(told, done=False)
    found = EarlierShots(waiting)  # type: ignore[arg-type]
    assert found.look([]) == ()
    waiting.done = True
    assert [shot.name for shot in found.look([LiveShot("0002")])] == ["0001"]
    assert EarlierShots(Asked(RuntimeError("gone"))).look([]) == ()  # type: ignore[arg-type]
    assert EarlierShots(None).look([]) == ()


def test_usable_shots_of_before_count_in_what_the_shots_say_together(tmp_path: Path) -> None:
    worker = Asking()
    masses = MassWork(worker, tmp_path, Told())  # type: ignore[arg-type]
    mass = {"value": 780.0, "valid": True}
    one, two = (LiveShot(name, state=ShotState.USABLE, mass=mass) for name in ("0001", "0002"))
    masses.know([one, LiveShot("0003", state=ShotState.NOT_USABLE, mass=mass)])
    assert worker.asked == []
    masses.know([one, two])
    assert worker.asked == [("recoil_daq.campaigns.running:running_campaign", (tmp_path, ("0001", "0002")))]


def test_the_mass_of_a_shot_that_is_not_usable_is_for_comparison_and_never_valid(tmp_path: Path) -> None:
    worker, display = Asking(), Told()
    masses = MassWork(worker, tmp_path, display)  # type: ignore[arg-type]
    document = {"file": "0001.h5", "usable": False, "reasons": ["p_breech is cut off"], "quality": []}
    shot = LiveShot("0001", state=ShotState.NOT_USABLE, document=document)
    masses.begin(shot)
    asked = masses._asked["0001"]
    asked.work.found = {"value": 780.0, "u": 2.0, "valid": True, "reason": "", "thinned_hz": 50e3}  # type: ignore[attr-defined]
    asked.work.done = True  # type: ignore[misc]
    masses.look()
    assert shot.mass is not None
    assert (shot.mass["value"], shot.mass["valid"], shot.mass["reason"]) == (780.0, False, "p_breech is cut off")
    assert display.notices == []
    assert len(worker.asked) == 1  # neither the full rate nor a campaign


def test_a_shot_of_before_that_is_of_a_preview_stays_provisional(day: Path) -> None:
    (found,) = earlier_shots(day)
    for check, provisional in (("preview", ["preview of daq"]), ("preview compared", [])):
        quality = [*found["document"]["quality"], {"channel": "daq", "check": check, "verdict": "warn", "detail": "x"}]
        one = {**found, "document": {**found["document"], "quality": quality}}
        (shot,) = EarlierShots(Asked([one])).look(())  # type: ignore[arg-type]
        assert shot.mass is not None
        assert shot.mass["provisional"] == provisional
