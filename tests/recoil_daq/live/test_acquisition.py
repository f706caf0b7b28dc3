"""A range day with virtual devices: what goes wrong on the way is counted, said, and costs no shot.

The virtual rig plays in real time, and a shot takes some seconds: tests share days on which several things go wrong.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.capture import live_session
from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.errors import DeviceError, RigError
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.store import read_shot, shot_summary
from recoil_acquisition.store.shot_log import ShotLog
from recoil_acquisition.trigger import find_triggers
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.shot import LiveOptions, LiveOutcome
from recoil_daq.live.shots import folder_watch
from recoil_daq.live.tables import print_acquisition
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.twin import range_day
from recoil_rigs.twin.faults import ClockStep, Faults, Interval
from recoil_rigs.twin.range_day import RangeDay
from tests.builders.machine_stalls import stalls_kept
from tests.builders.virtual_shots import SHORTER, settling_soon, with_twin

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port"),
]

RECORD_BEGINS_S = 0.7
SILENCE_AFTER_S = 0.9
"""A source that falls silent sooner after a shot's end is waited for, longer than this."""
STALL_S = 2.0


class Watched:
    """A display that keeps what it is shown, presses keys when told, and stalls once, at the first trigger."""

    def __init__(self, *, keys: Mapping[str, str] | None = None, stall_s: float = 0.0) -> None:
        self.notices: list[str] = []
        self.documents: list[Mapping[str, Any]] = []
        self.states: list[str] = []
        self.last: RangeState | None = None
        self._keys = dict(keys or {})
        self._pressed: list[str] = []
        self._stall_s = stall_s
        self.stalled_s = 0.0
        self.has_keys = False

    def show(self, state: RangeState) -> None:
        assert all(shot.name for shot in state.shots)
        self.last = state
        if not self.states or self.states[-1] != state.state:
            self.states.append(state.state)
        heard = all(source.age_s is not None for source in state.live)
        if heard and "heard" in self._keys:
            self._pressed += self._keys.pop("heard")

    def notice(self, text: str, same: object = None) -> None:  # noqa: ARG002 - none is left out
        self.notices.append(text)
        if text.startswith("trigger"):
            began_s = time.monotonic()
            time.sleep(self._stall_s)
            self.stalled_s += time.monotonic() - began_s
            self._stall_s = 0.0
        for begin in [b for b in self._keys if text.startswith(b)]:
            self._pressed += self._keys.pop(begin)

    def verdict(self, document: Mapping[str, Any]) -> None:
        self.documents.append(document)

    @property
    def noticed(self) -> tuple[Notice, ...]:
        return ()

    def key(self, *, typed: bool = False) -> str:  # noqa: ARG002 - a display has it
        return self._pressed.pop(0) if self._pressed else ""


def found(document: Mapping[str, Any], check: str, channel: str) -> tuple[str, str]:
    """Return verdict and detail of a check."""
    (one,) = (q for q in document["quality"] if (q["check"], q["channel"]) == (check, channel))
    return one["verdict"], one["detail"]


@dataclass(frozen=True, eq=False)
class Day:
    """What a range day left, what its display was shown, and what its devices truly sent."""

    out: Path
    display: Watched
    outcome: LiveOutcome
    truth: Mapping[str, Any]

    @property
    def received(self) -> dict[str, int]:
        """Frames of a bus and bytes of a port that the host has read."""
        assert self.display.last is not None
        return {source.name: source.counters.received for source in self.display.last.live}


@pytest.fixture(scope="module", autouse=True)
def soon_whole() -> Iterator[None]:
    """Let the dropped files be written soon and fast, and be looked at often, and no shot be converted beforehand."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("recoil_daq.live.acquisition._WARM", "builtins:repr")
        patch.setattr(range_day, "FILES_AFTER_S", 0.1)
        patch.setattr(range_day, "PIECE_EVERY_S", 0.03)
        patch.setattr(folder_watch, "LOOK_EVERY_S", 0.05)
        yield


def day(out: Path, display: Watched, *, shots: int = 1, rig: Rig | None = None, **play: Any) -> Day:
    days: list[RangeDay] = []
    silence = {"silence_before_s": RECORD_BEGINS_S, "silence_after_s": SILENCE_AFTER_S}
    rig = settling_soon(rig or with_twin("mixed", **SHORTER))
    options = LiveOptions(out, shots, files_within_s=60.0)
    outcome = run_live(rig, options, display, play={**silence, **play}, watch_day=days.append)
    return Day(out, display, outcome, days[0].player.truth()["sources"])


SECOND_S = 2 * RECORD_BEGINS_S + SHORTER["duration_s"] + SILENCE_AFTER_S
"""When the second shot's record begins, on the play's clock."""

STEPS_S = {"imu": 0.5, "can": -0.25}


@pytest.fixture(scope="module")
def two_shots(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Day:
    """A day in a folder with a shot 7, whose display stalls at the first shot, and whose clocks step in the second."""
    out = tmp_path_factory.mktemp("day")
    (out / "captures").mkdir()
    (out / "captures" / "0007.rdlog").write_bytes(b"of another session")
    faults = {
        "imu": Faults(clock_steps=(ClockStep(SECOND_S + 0.25, STEPS_S["imu"]),)),
        "can": Faults(clock_steps=(ClockStep(SECOND_S + 0.2, STEPS_S["can"]),)),
    }
    with stalls_kept(request):
        return day(out, Watched(stall_s=STALL_S), shots=2, faults=faults)


def test_two_shots_are_triggered_cut_matched_with_their_files_and_converted(two_shots: Day) -> None:
    outcome, names = two_shots.outcome, ("0008", "0009")
    assert outcome.error is None
    assert [shot.state for shot in outcome.shots] == ["usable", "usable"]
    assert outcome.journal is None
    assert outcome.log is not None
    log = json.loads(outcome.log.read_text())
    assert [d["outcome"] for d in log["decisions"]] == ["trigger", "trigger"]
    assert [shot["shot"] for shot in log["shots"]] == list(names)
    assert not list(two_shots.out.glob("journal/*"))
    trigger = load_rig("mixed").trigger
    assert trigger is not None
    for name in names:
        shot = read_shot(two_shots.out / f"{name}.h5")
        assert isinstance(shot.acquisition, Acquisition)
        assert shot.acquisition.shot == name
        assert shot.acquisition.pre_actual_s == pytest.approx(0.3, abs=0.02)
        assert set(shot.clock_fits) == {"can", "imu"}
        assert {one.status for one in shot.alignments} == {"ok"}
        brake = shot.channels["p_brake"]
        offline = find_triggers(trigger, {"p_brake": (brake.time_base.times_s, brake.samples)})
        assert [d.outcome for d in offline] == [d.outcome for d in shot.acquisition.decisions]
        assert [d.value for d in offline] == pytest.approx([d.value for d in shot.acquisition.decisions])
    rows = [(row.shot, row.time) for row in ShotLog.beside(two_shots.out / "0008.h5").rows]
    assert rows == [(name, read_shot(two_shots.out / f"{name}.h5").started) for name in names]
    assert all(time for _, time in rows)
    assert {"armed", "recording", "disarmed"} <= set(two_shots.display.states)


def test_the_state_of_the_session_stays_for_others_to_read(two_shots: Day) -> None:
    left = json.loads((two_shots.out / "live.json").read_text())
    assert (left["state"], left["virtual"], left["next_shot"]) == ("stopped", True, "0010")
    assert [(shot["shot"], shot["state"]) for shot in left["shots"]] == [("0008", "usable"), ("0009", "usable")]
    files = {source["name"]: source["last_file"] for source in left["sources"]}
    assert files == {"dewetron": "0009_dewetron.csv", "can": "", "imu": "", "camera": "0009_camera.csv"}
    brake = read_shot(two_shots.out / "0009.h5").channels["p_brake"].samples
    (peak,) = (channel["peak"] for channel in left["channels"] if channel["name"] == "p_brake")
    assert peak == pytest.approx([brake.min(), brake.max()])
    assert left["decision"]["text"].startswith("trigger (p_brake at ")
    seen = two_shots.display.last
    assert seen is not None
    assert {source.state for source in seen.sources} <= {"live", "silent", "stopped", "for files"}


def test_numbers_go_on_where_a_folder_already_has_shots(two_shots: Day) -> None:
    assert [shot.name for shot in two_shots.outcome.shots] == ["0008", "0009"]
    assert (two_shots.out / "incoming" / "0008_dewetron.csv").exists()


def test_a_consumer_that_stalls_for_two_seconds_loses_nothing(two_shots: Day) -> None:
    display = two_shots.display
    assert display.stalled_s > STALL_S
    truth = two_shots.truth
    assert two_shots.received == {"can": truth["can"]["sent"], "imu": truth["imu"]["bytes_sent"]}
    assert display.last is not None
    assert display.last.unseen_bytes == 0
    for document in display.documents:
        assert found(document, "missing frames", "can")[0] == "ok"


def test_clocks_that_step_within_a_shot_are_found_taken_out_and_aligned(
    two_shots: Day, capsys: pytest.CaptureFixture[str]
) -> None:
    fits = read_shot(two_shots.out / "0009.h5").clock_fits
    for source, step_s in STEPS_S.items():
        assert [step["step_s"] for step in fits[source]["steps"]] == pytest.approx([step_s], abs=1e-3)
    assert found(two_shots.display.documents[1], "clock steps", "imu")[0] == "warn"
    print_acquisition(shot_summary(two_shots.out / "0009.h5"))
    told = capsys.readouterr().out
    assert "+0.5" in told
    assert "-0.2" in told
    assert "trigger" in told
    assert not any(fit["steps"] for fit in read_shot(two_shots.out / "0008.h5").clock_fits.values())


@pytest.fixture(scope="module")
def unplugged(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Day:
    """A shot over python-can's serial-line driver, in whose middle the inertial sensor is unplugged."""
    # for long: where a busy host reads the bus late, the shot that it triggers is late beside the loss by as much
    faults = {"imu": Faults(unplugged=(Interval(RECORD_BEGINS_S + 0.15, 0.6),))}
    with stalls_kept(request):
        return day(tmp_path_factory.mktemp("unplugged"), Watched(), transports={"can": "slcan"}, faults=faults)


@pytest.fixture(scope="module")
def lossy(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Day:
    """A shot over python-can's multicast driver, of sources that lose frames and bytes, which has the whole play."""
    folder, rig = tmp_path_factory.mktemp("lossy"), with_twin("mixed", **SHORTER)
    assert "pre_s = 0.3 " in rig.text
    (folder / "mixed.dbc").write_text(rig.databases["mixed.dbc"])
    (folder / "rig.toml").write_text(rig.text.replace("pre_s = 0.3 ", "pre_s = 9.0 "))
    faults = {"imu": Faults(dropped_bytes=0.01), "can": Faults(lost_frames=0.01)}
    with stalls_kept(request), pytest.MonkeyPatch.context() as patch:
        # the play is over before the shot's end, and nothing more comes
        patch.setattr(live_session, "CaptureEngine", partial(CaptureEngine, patience_s=0.5))
        return day(
            folder / "out", Watched(), rig=load_rig(folder / "rig.toml"), faults=faults, silence_after_s=0.2,
            transports={"can": "udp_multicast"},
        )  # fmt: skip


def assert_every_frame_was_delivered(one: Day) -> None:
    assert one.received["can"] == one.truth["can"]["sent"] > 1000
    assert one.display.documents, one.outcome.shots
    quality = one.display.documents[0]["quality"]
    failed = {q["check"] for q in quality if q["verdict"] == "fail" and q["channel"] != "imu"}
    # what the host dates may be late by milliseconds on a busy machine, the pressures with it: that alone may be said
    assert failed - {"missing frames"} <= {"alignment", "force"}


def test_python_cans_serial_line_driver_delivers_every_frame_into_the_shot(unplugged: Day) -> None:
    assert_every_frame_was_delivered(unplugged)
    assert found(unplugged.display.documents[0], "missing frames", "can")[0] == "ok"


def test_python_cans_multicast_driver_delivers_every_frame_into_the_shot(lossy: Day) -> None:
    assert_every_frame_was_delivered(lossy)
    missing = found(lossy.display.documents[0], "missing frames", "can")[1]
    assert int(missing.split()[0]) <= lossy.truth["can"]["lost"]


def test_a_device_that_is_unplugged_in_the_middle_of_a_shot_costs_its_own_frames_alone(unplugged: Day) -> None:
    assert unplugged.outcome.shots[0].state == "not usable"
    assert (unplugged.out / "0001.h5").exists()
    (document,) = unplugged.display.documents
    of_device = [one for one in document["quality"] if one["channel"] == "imu" and one["verdict"] != "ok"]
    # where all of the shot falls into the loss, it delivered nothing
    assert {one["check"] for one in of_device} & {"connection", "delivery"}, of_device
    failed = {one["channel"] for one in document["quality"] if one["verdict"] == "fail"}
    assert any(channel.startswith(("imu", "gyro")) for channel in failed), failed
    assert unplugged.truth["imu"]["unplugged"] > 300
    assert found(document, "missing frames", "can")[0] == "ok"


def test_every_lost_frame_is_counted_and_the_shot_says_so(lossy: Day) -> None:
    (shot,), (document,), truth = lossy.outcome.shots, lossy.display.documents, lossy.truth
    assert shot.state == "not usable"
    assert lossy.received == {"can": truth["can"]["sent"], "imu": truth["imu"]["bytes_sent"]}
    verdict, detail = found(document, "missing frames", "imu")
    # what the virtual sensor itself damages in each record, and leaves out of its count, comes on top; what is lost
    # before the first frame that was heard, or behind the last, leaves no gap
    failed = {check["check"] for check in document["quality"] if check["verdict"] == "fail"}
    # where a busy machine stamped the bus so late that no force is seen, or that its clock cannot be aligned, no mass
    # can be asked, and the loss warns
    assert verdict == ("warn" if failed & {"force", "alignment"} else "fail")
    assert int(detail.split()[0]) - truth["imu"]["damaged"] - truth["imu"]["lost"] in range(-3, 3)
    verdict, detail = found(document, "missing frames", "can")
    assert verdict in ("warn", "fail")
    assert 0 < int(detail.split()[0]) <= truth["can"]["lost"]
    assert shot.acquisition is not None
    assert shot.acquisition.pre_actual_s < 9.0
    assert found(document, "pre-time", "shot")[0] == "warn"


def test_a_manual_trigger_makes_a_shot_and_q_ends_the_session(tmp_path: Path) -> None:
    display = Watched(keys={"heard": "t", "shot 0001 captured": "qy"})
    outcome = day(tmp_path, display, silence_before_s=8.0).outcome
    (shot,) = outcome.shots
    assert shot.state == "incomplete"
    assert shot.problem == "no file of camera, dewetron"
    assert [path.name for path in (tmp_path / "captures").iterdir()] == ["0001.rdlog"]
    assert outcome.journal is not None
    assert outcome.journal.exists()
    assert shot.acquisition is not None
    assert shot.acquisition.decisions[-1].channel == ""


def test_a_rig_without_trigger_or_device_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    rig = replace(load_rig("mixed"), trigger=None)
    with pytest.raises(RigError, match="trigger: is missing"):
        run_live(rig, LiveOptions(tmp_path / "out"), Watched())
    with pytest.raises((DeviceError, RigError)):
        run_live(load_rig("field-2013"), LiveOptions(tmp_path / "out"), Watched())
