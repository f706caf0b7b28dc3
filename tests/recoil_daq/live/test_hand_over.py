"""At its end a session writes the page of the day, and whatever becomes of that costs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import StoreError
from recoil_daq.live import acquisition as module
from recoil_daq.live.shot import LiveOptions, LiveOutcome
from tests.builders.range_session import Told
from tests.builders.range_states import day

DONE = LiveOutcome("mixed")


@pytest.fixture(autouse=True)
def shots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a day with a shot, be it of an earlier session."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shots").mkdir()
    (tmp_path / "shots" / "0001.h5").write_bytes(b"")
    return tmp_path / "shots"


class Work:
    """A worker and what it was asked for: it is done at the third look."""

    def __init__(self, result: str | BaseException) -> None:
        self._result, self._looks = result, 0
        self.asked: list[tuple[str, Any]] = []

    def ask(self, work: str, item: Any) -> Work:
        self.asked.append((work, item))
        return self

    def look(self) -> None:
        self._looks += 1
        if isinstance(self._result, KeyboardInterrupt):
            raise self._result

    @property
    def done(self) -> bool:
        return self._looks > 2

    def result(self) -> str:
        if isinstance(self._result, BaseException):
            raise self._result
        return self._result


def handed_over(work: Work, display: Told, outcome: LiveOutcome = DONE, **options: Any) -> None:
    chosen = LiveOptions(**{"out": Path("shots"), "identify": True, **options})
    module._hand_over(work, chosen, outcome, display, day(state="stopped"))  # type: ignore[arg-type]


def test_the_page_is_made_by_the_worker_and_the_screen_says_so_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    display, work, asked = Told(), Work("shots/day.html"), []
    monkeypatch.setattr(display, "show", lambda state: asked.append(state.asked))
    handed_over(work, display)
    assert work.asked == [("recoil_daq.handover.day:day_page", Path("shots"))]
    assert {text.split(";")[0] for text in asked} == {"making the page of the day"}
    assert display.notices[-1] == "the day, and what to copy of it: shots/day.html"


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (KeyboardInterrupt(), "left out: `recoil-daq day shots` makes the page of the day"),
        (StoreError("cannot be written", path="shots"), "no page of the day: shots: cannot be written"),
        (ValueError("odd"), "no page of the day: ValueError: odd"),
    ],
)
def test_what_is_wrong_with_it_is_said_and_ends_nothing(result: BaseException, said: str) -> None:
    display = Told()
    handed_over(Work(result), display)
    assert display.notices[-1] == said


def test_nothing_is_made_of_a_session_without_masses_with_an_error_or_of_a_folder_without_shots(shots: Path) -> None:
    work, display = Work(""), Told()
    handed_over(work, display, identify=False)
    handed_over(work, display, LiveOutcome("mixed", error=StoreError("full")))
    (shots / "0001.h5").unlink()
    handed_over(work, display)
    assert (work.asked, display.notices) == ([], [])
