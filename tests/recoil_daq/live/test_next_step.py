"""The next step: the weightiest of what there is to do, in one sentence, for screen, page and file alike."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from recoil_daq.live.next_step import NextStep, StepKind, next_step
from recoil_daq.live.range_state import source_state
from recoil_daq.live.shot import ShotState
from recoil_daq.live.state_file import StateFile
from tests.builders.live_status import CAN
from tests.builders.range_states import CLIPPED, MASS, SOURCES, STATES, day, usable

READY = day(shots=(usable("0003"),), sources=SOURCES[:3])


def test_a_range_that_waits_for_nothing_fires() -> None:
    assert next_step(READY) == NextStep(StepKind.FIRE, "fire shot 0004: everything is ready", "0004")


@pytest.mark.parametrize(
    ("changes", "kind", "text"),
    [
        ({"asked": "ARMED: end the session? y yes, n go on"}, "do", "answer at the keys: ARMED: end the session?"),
        ({"state": "disarmed"}, "do", "arm with key a"),
        ({"state": "recording"}, "wait", "wait: shot 0004 is being recorded"),
        ({"cautions": ("zero of p_breech moved", "b")}, "do", "look at this before shot 0004: zero of p_breech moved"),
        ({"disk_free_bytes": 300_000_000}, "mend", "make room on the disk: 0.3 GB are free"),
        ({"shots": (CLIPPED,)}, "do", "shot 0001 is not usable: p_breech at the high end of its range"),
        ({"shots": (usable("0003", mass={**MASS, "valid": False, "reason": "a clock is ambiguous"}),)}, "do",
         "the mass of shot 0003 is not valid: a clock is ambiguous"),
        ({"shots": (usable("0003", state=ShotState.CONVERTING),)}, "wait", "wait for the verdict on shot 0003"),
        ({"state": "stopped"}, "end", "the session has ended: copy the folder shots"),
    ],
)  # fmt: skip
def test_what_is_to_be_done_is_said_in_one_sentence(changes: dict[str, Any], kind: str, text: str) -> None:
    step = next_step(replace(READY, **changes))
    assert (step.kind, step.text[: len(text)]) == (kind, text)
    assert not step.text.endswith(".")


@pytest.mark.parametrize("state", ["stopped", "lost", "not understood", "silent"])
def test_a_source_with_which_something_is_wrong_goes_before_the_last_shot(state: str) -> None:
    step = next_step(replace(READY, sources=(replace(SOURCES[1], state=state), *SOURCES[2:3]), shots=(CLIPPED,)))
    assert step.kind is StepKind.MEND
    assert "can" in step.text
    assert step.about == "can"


def test_what_keeps_shots_from_being_made_goes_before_a_source_that_is_away() -> None:
    lost = replace(READY, sources=(replace(SOURCES[2], state="lost"),), alert="ALARM: p_breech crossed, imu LOST")
    assert next_step(replace(lost, alarms=1)).text.startswith("ALARM: p_breech crossed")
    assert next_step(replace(lost, alert="imu LOST")).text.startswith("plug imu in again")


def test_files_that_nobody_has_brought_are_asked_for_with_their_folder() -> None:
    assert next_step(STATES["waiting"]).text == (
        "save the file of camera of shot 0003 into incoming, 108 s left, or go on without by key c"
    )


def test_a_session_that_completes_its_shots_is_waited_for() -> None:
    step = next_step(replace(READY, state="stopped", shots=(usable("0003", mass=None, mass_to_come=True),)))
    assert (step.kind, step.text) == (StepKind.WAIT, "wait: 0003 is being completed")


@pytest.mark.parametrize("name", list(STATES))
def test_every_state_of_a_day_has_a_step_of_one_line(name: str) -> None:
    assert "\n" not in next_step(STATES[name]).text


def test_other_programs_read_it_in_the_file(tmp_path: Path) -> None:
    file = StateFile(tmp_path)
    file.write(READY)
    step = json.loads(file.path.read_text())["next_step"]
    assert step == {"kind": "fire", "text": "fire shot 0004: everything is ready", "about": "0004"}


@pytest.mark.parametrize(
    ("age_s", "without_sample_s", "state"),
    [(0.01, 0.7, "live"), (0.01, 0.9, "not understood"), (1.2, 9.0, "silent"), (None, 9.0, "silent")],
)
def test_bytes_of_which_none_is_good_are_a_state_of_their_own(age_s, without_sample_s: float, state: str) -> None:
    assert source_state(replace(CAN, age_s=age_s), lost=False, without_sample_s=without_sample_s) == state
