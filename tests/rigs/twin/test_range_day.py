"""A day at a virtual range: what ends it before its time is said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recoil_acquisition.errors import DeviceError
from recoil_daq.live import acquisition
from recoil_daq.live.acquisition import LiveOptions, run_live
from recoil_rigs.twin import range_day
from recoil_rigs.twin.range_day import RangeDay
from tests.builders.virtual_shots import SHORTER, with_twin

RIG = with_twin("mixed", **SHORTER)


@pytest.fixture
def incoming(tmp_path: Path) -> Path:
    (tmp_path / "incoming").mkdir()
    return tmp_path / "incoming"


def at_once(day: RangeDay, **failures: BaseException) -> RangeDay:
    """Let the day's files be due now, and its sources have ended by some failures."""
    timeline = SimpleNamespace(starts_s=[0.0], record_s=0.0)
    player: Any = SimpleNamespace(
        fired_ns=[0], timeline=timeline, failures=failures, close=day.player.close, played_s=0.0
    )
    day.player = player
    day._drop()
    return day


@pytest.mark.whole_way
def test_the_shots_of_a_day_share_their_sensors_and_nothing_else(incoming: Path) -> None:
    with RangeDay(RIG, 2, incoming) as day:
        first, second = (shot.truth for shot in day.shots)
    assert first["gains"] == second["gains"]
    assert first["seed"] != second["seed"]
    assert first["clocks"] != second["clocks"]


def test_a_file_that_cannot_be_dropped_is_said(incoming: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(range_day, "PIECE_EVERY_S", 0.0)
    with RangeDay(RIG, 1, incoming) as day:
        at_once(day).raise_failure()
        assert {path.name for path in incoming.iterdir()} == {"0001_dewetron.csv", "0001_camera.csv"}
        with pytest.raises(DeviceError, match=r"^the virtual rig's files ended early: .*File exists"):
            at_once(day).raise_failure()


def test_no_file_is_there_before_its_shot_was_played(incoming: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy host the buses and ports are played late, and their trigger comes as late."""
    monkeypatch.setattr(range_day, "PIECE_EVERY_S", 0.0)
    monkeypatch.setattr(range_day, "LATE_LOOK_S", 0.0)
    looks: list[list[str]] = []

    class Late:
        fired_ns, timeline = (0,), SimpleNamespace(starts_s=[0.0], record_s=1.0)

        @property
        def played_s(self) -> float:
            looks.append([path.name for path in incoming.iterdir()])
            return 0.4 * len(looks)

    with RangeDay(RIG, 1, incoming) as day:
        played, day.player = day.player, Late()  # type: ignore[assignment]
        day._drop()
        day.player = played
    assert looks == [[], [], []]
    assert len(list(incoming.iterdir())) == 2


def test_a_source_whose_play_ended_is_said() -> None:
    failure, said = OSError(5, "Input/output error"), r"^the virtual rig's imu ended early: .*Input/output error"
    with RangeDay(RIG, 1, None) as day, pytest.raises(DeviceError, match=said):
        at_once(day, imu=failure).raise_failure()


@pytest.mark.exhaustive
@pytest.mark.parametrize(("over", "said"), [(True, True), (False, False)])
def test_a_live_session_ends_with_what_ended_its_day_unless_somebody_interrupted_it(
    over: bool, said: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failed(RangeDay):
        over = property(lambda _: over)  # type: ignore[assignment]

        def raise_failure(self) -> None:
            raise DeviceError("ended early")

    monkeypatch.setattr(acquisition, "_WARM", "builtins:repr")  # nobody fires: nothing need be fast
    monkeypatch.setattr(acquisition, "RangeDay", Failed)
    monkeypatch.setattr(acquisition, "LiveRange", lambda *_, **__: SimpleNamespace(run=lambda _: "outcome", last=None))
    display: Any = SimpleNamespace(notice=lambda _: None)
    if not said:
        assert run_live(RIG, LiveOptions(tmp_path, 1), display) == "outcome"
        return
    with pytest.raises(DeviceError, match="ended early"):
        run_live(RIG, LiveOptions(tmp_path, 1), display)
