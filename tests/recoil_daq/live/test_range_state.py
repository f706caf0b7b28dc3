"""The state of the range: one value for the screen, the log and `live.json`, and a file that is whole at any moment."""

from __future__ import annotations

import json
import math
import re
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import pytest

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.files.new_file import partial_path
from recoil_acquisition.quantities.unit_choice import UnitChoice
from recoil_daq.live.range_state import RangeShot, source_state
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.state_file import StateFile
from tests.builders.live_status import BRAKE, CAN, state_of, status
from tests.builders.range_states import day, lines_of, usable

DOCUMENT = {
    "shot": "0001", "usable": True, "reasons": [], "quality": [],
    "channels": [{"name": "p_brake", "low": -120.0, "high": 7.4e6}, {"name": "gone", "low": None, "high": None}],
}  # fmt: skip
SHOTS = (
    LiveShot("0001", state=ShotState.USABLE, document=DOCUMENT),
    LiveShot("0002", state=ShotState.WAITING, wanted={"camera"}),
)


def test_the_peak_of_the_last_converted_shot_stands_beside_the_channel() -> None:
    state = state_of(status(), SHOTS)
    assert [channel.peak for channel in state.channels] == [(-120.0, 7.4e6), None, None]
    assert state.shots[0].peaks == {"p_brake": (-120.0, 7.4e6)}
    with pytest.raises(FrozenInstanceError):
        state.alert = "late"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("changes", "lost", "state"),
    [
        ({}, False, "live"),
        ({"age_s": None}, False, "silent"),
        ({"age_s": 1.2}, False, "silent"),
        ({"age_s": 1.2}, True, "lost"),
        ({"error": "gone"}, True, "stopped"),
    ],
)
def test_the_state_of_a_source_is_the_worst_that_is_known(changes, lost: bool, state: str) -> None:
    assert source_state(replace(CAN, **changes), lost=lost) == state


def test_a_shot_that_waits_says_for_how_long() -> None:
    assert RangeShot.of(SHOTS[1], 108.0).left_s == 108.0
    assert RangeShot.of(SHOTS[0], 108.0).left_s is None


def test_a_state_is_a_document_that_any_program_reads() -> None:
    level = Level(math.nan, -math.inf, 1.0)
    text = json.dumps(state_of(status(channels=(replace(BRAKE, level=level),)), SHOTS).to_json(), allow_nan=False)
    document = json.loads(text)
    assert document["schema"] == "recoil-daq/live/1"
    assert document["channels"][0]["level"] == {"last": None, "low": None, "high": 1.0}
    assert [shot["missing"] for shot in document["shots"]] == [[], ["camera"]]
    assert document["sources"][0]["losses"] == "none"


def test_the_file_is_whole_or_that_of_a_moment_ago(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = StateFile(tmp_path)
    file.write(state_of(status()))

    def refused(_: Path, target: Path) -> Path:
        raise PermissionError(13, "a reader has it open", str(target))

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", refused)
        file.write(state_of(status(state="recording")))
    assert json.loads(file.path.read_text())["state"] == "armed"
    assert not list(tmp_path.glob(".*"))
    file.write(state_of(status(state="stopped")))
    assert json.loads(file.path.read_text())["state"] == "stopped"


def test_what_a_killed_session_left_of_the_file_is_taken_away(tmp_path: Path) -> None:
    killed = StateFile(tmp_path)
    partial_path(killed.path).write_text("{", encoding="ascii")
    StateFile(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_gone_ends_nothing(tmp_path: Path) -> None:
    StateFile(tmp_path / "gone").write(state_of(status()))
    assert not (tmp_path / "gone").exists()


def test_what_people_read_is_in_the_units_that_the_rig_chose_and_the_file_in_si() -> None:
    state = day(units=UnitChoice.named(["bar", "g"]), shots=(usable("0003"),), notices=())
    read = {channel.name: channel for channel in state.as_read().channels}
    p_breech, acc = read["p_breech"], read["acc_recoil"]
    assert (p_breech.unit, p_breech.triggers_at, acc.unit) == ("bar", pytest.approx(50.0), "g")
    assert p_breech.range == pytest.approx((0.0, 3000.0))
    assert p_breech.peak == pytest.approx((-8.0, 1314.0))
    assert acc.level is not None
    assert acc.level.last == pytest.approx(-2.1 / 9.80665)
    (shot,) = state.as_read().shots
    assert [(figure.unit, round(figure.value, 3)) for figure in shot.figures][:2] == [("bar", 1314.0), ("m", 0.822)]
    document = state.to_json()
    assert {one["unit"] for one in document["channels"]} == {"m/s^2", "Pa", "rad/s"}
    bar = next(one for one in document["units"] if one["unit"] == "bar")
    assert bar == {"quantity": "pressure", "unit": "bar", "si_per_unit": 1e5}
    drawn = "\n".join(lines_of(state))
    assert "1310 bar" in drawn
    assert not re.search(r"Pa\b|kbar|m/s2", drawn)
