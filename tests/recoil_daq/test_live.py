"""A range day with virtual devices: what goes wrong on the way is counted, said, and costs no shot.

The virtual rig plays in real time, so each test takes some seconds.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.acquisition import Acquisition
from recoil_acquisition.capture.status import LiveStatus
from recoil_acquisition.errors import DeviceError, RigError
from recoil_acquisition.store import read_shot, shot_summary
from recoil_acquisition.store.shot_log import ShotLog
from recoil_acquisition.trigger import find_triggers
from recoil_daq import folder_watch, live_range
from recoil_daq.live import run_live
from recoil_daq.live_shot import LiveOptions, LiveOutcome, LiveShot
from recoil_daq.live_tables import print_acquisition
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import range_day
from recoil_rigs.twin.faults import ClockStep, Faults, Interval
from recoil_rigs.twin.range_day import RangeDay
from tests.builders.range_session import PlayedConversion
from tests.builders.virtual_shots import SHORTER, with_twin

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port"),
]

RECORD_BEGINS_S = 1.0


class Watched:
    """A display that keeps what it is shown, and presses keys when told."""

    def __init__(self, *, keys: Mapping[str, str] | None = None, stall_s: float = 0.0) -> None:
        self.notices: list[str] = []
        self.documents: list[Mapping[str, Any]] = []
        self.states: list[str] = []
        self.last: LiveStatus | None = None
        self._keys = dict(keys or {})
        self._pressed: list[str] = []
        self._stall_s = stall_s

    def show(self, status: LiveStatus, shots: Sequence[LiveShot]) -> None:
        assert all(shot.name for shot in shots)
        self.last = status
        if not self.states or self.states[-1] != status.state:
            self.states.append(status.state)
        heard = all(source.age_s is not None for source in status.sources)
        if heard and "heard" in self._keys:
            self._pressed.append(self._keys.pop("heard"))

    def notice(self, text: str) -> None:
        self.notices.append(text)
        if text.startswith("trigger"):
            time.sleep(self._stall_s)
        for begin in [b for b in self._keys if text.startswith(b)]:
            self._pressed.append(self._keys.pop(begin))

    def verdict(self, document: Mapping[str, Any]) -> None:
        self.documents.append(document)

    def key(self) -> str:
        return self._pressed.pop(0) if self._pressed else ""

    def found(self, check: str, channel: str) -> list[tuple[str, str]]:
        return [
            (q["verdict"], q["detail"])
            for d in self.documents
            for q in d["quality"]
            if (q["check"], q["channel"]) == (check, channel)
        ]


@pytest.fixture(autouse=True)
def soon_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the dropped files be written fast, and be looked at often."""
    monkeypatch.setattr(range_day, "PIECE_EVERY_S", 0.03)
    monkeypatch.setattr(folder_watch, "LOOK_EVERY_S", 0.05)


def day(
    out: Path, display: Watched, *, shots: int = 1, rig: Rig | None = None, watch: bool = True, **play: Any
) -> tuple[LiveOutcome, dict[str, Any]]:
    days: list[RangeDay] = []
    options = LiveOptions(out, shots, watch=None if watch else out / "elsewhere", files_within_s=60.0 if watch else 0.5)
    silence = {"silence_before_s": RECORD_BEGINS_S, "silence_after_s": 0.6}
    rig = rig or with_twin("mixed", **SHORTER)
    outcome = run_live(rig, options, display, play={**silence, **play}, watch_day=days.append)
    return outcome, days[0].player.truth()["sources"]


def test_two_shots_are_triggered_cut_matched_with_their_files_and_converted(tmp_path: Path) -> None:
    display = Watched()
    outcome, truth = day(tmp_path, display, shots=2)
    assert outcome.error is None
    assert [shot.state for shot in outcome.shots] == ["usable", "usable"]
    assert outcome.journal is None
    assert outcome.log is not None
    log = json.loads(outcome.log.read_text())
    assert [d["outcome"] for d in log["decisions"]] == ["trigger", "trigger"]
    assert [shot["shot"] for shot in log["shots"]] == ["0001", "0002"]
    assert not list(tmp_path.glob("journal/*"))
    trigger = load_rig("mixed").trigger
    assert trigger is not None
    for name in ("0001", "0002"):
        shot = read_shot(tmp_path / f"{name}.h5")
        assert isinstance(shot.acquisition, Acquisition)
        assert shot.acquisition.shot == name
        assert shot.acquisition.pre_actual_s == pytest.approx(0.3, abs=0.02)
        assert set(shot.clock_fits) == {"can", "imu"}
        assert {one.status for one in shot.alignments} == {"ok"}
        brake = shot.channels["p_brake"]
        offline = find_triggers(trigger, {"p_brake": (brake.time_base.times_s, brake.samples)})
        assert [d.outcome for d in offline] == [d.outcome for d in shot.acquisition.decisions]
        assert [d.value for d in offline] == pytest.approx([d.value for d in shot.acquisition.decisions])
    rows = [(row.shot, row.time) for row in ShotLog.beside(tmp_path / "0001.h5").rows]
    assert rows == [(name, read_shot(tmp_path / f"{name}.h5").started) for name in ("0001", "0002")]
    assert all(time for _, time in rows)
    assert display.last is not None
    received = {source.name: source.counters.received for source in display.last.sources}
    assert received == {"can": truth["can"]["sent"], "imu": truth["imu"]["bytes_sent"]}
    assert {"armed", "recording", "disarmed"} <= set(display.states)


def test_every_lost_frame_is_counted_and_the_shot_says_so(tmp_path: Path) -> None:
    rig = load_rig("mixed")
    whole = rig.text.replace("pre_s = 0.3 ", "pre_s = 9.0 ").replace("post_s = 0.7 ", "post_s = 2.0 ")
    (tmp_path / "mixed.dbc").write_text(rig.databases["mixed.dbc"])
    (tmp_path / "rig.toml").write_text(whole)
    display = Watched()
    faults = {"imu": Faults(dropped_bytes=0.01), "can": Faults(lost_frames=0.01)}
    rig = parse_rig(whole, tmp_path / "rig.toml")
    outcome, truth = day(tmp_path / "out", display, rig=rig, faults=faults, silence_after_s=0.2)
    assert outcome.shots[0].state == "not usable"
    (imu,) = display.found("missing frames", "imu")
    # what the virtual sensor itself damages in each record, and leaves out of its count, comes on top; what is lost
    # before the first frame that was heard, or behind the last, leaves no gap
    record = truth["imu"]["damaged"] + truth["imu"]["lost"]
    assert imu[0] == "fail"
    assert int(imu[1].split()[0]) - record in range(-3, 3)
    (can,) = display.found("missing frames", "can")
    numbered = truth["can"]["lost"]
    assert can[0] in ("warn", "fail")
    assert 0 < int(can[1].split()[0]) <= numbered
    assert outcome.shots[0].acquisition is not None
    assert outcome.shots[0].acquisition.pre_actual_s < 9.0
    assert display.found("pre-time", "shot")[0][0] == "warn"


def test_a_device_that_is_unplugged_in_the_middle_of_a_shot_costs_its_own_frames_alone(tmp_path: Path) -> None:
    display = Watched()
    faults = {"imu": Faults(unplugged=(Interval(RECORD_BEGINS_S + 0.15, 0.2),))}
    outcome, truth = day(tmp_path, display, faults=faults)
    assert outcome.shots[0].state == "not usable"
    assert (tmp_path / "0001.h5").exists()
    (connection,) = display.found("connection", "imu")
    assert connection[0] == "fail"
    assert "lost 1 times, opened again 1 times" in connection[1]
    (missing,) = display.found("missing frames", "imu")
    assert int(missing[1].split()[0]) >= truth["imu"]["unplugged"]
    assert display.found("missing frames", "can")[0][0] == "ok"


def test_clocks_that_step_within_a_shot_are_found_taken_out_and_aligned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    display = Watched()
    faults = {
        "imu": Faults(clock_steps=(ClockStep(RECORD_BEGINS_S + 0.25, 0.5),)),
        "can": Faults(clock_steps=(ClockStep(RECORD_BEGINS_S + 0.2, -0.25),)),
    }
    outcome, _ = day(tmp_path, display, faults=faults)
    assert outcome.shots[0].state == "usable"
    fits = read_shot(tmp_path / "0001.h5").clock_fits
    assert [step["step_s"] for step in fits["imu"]["steps"]] == pytest.approx([0.5], abs=1e-3)
    assert [step["step_s"] for step in fits["can"]["steps"]] == pytest.approx([-0.25], abs=1e-3)
    assert display.found("clock steps", "imu")[0][0] == "warn"
    print_acquisition(shot_summary(tmp_path / "0001.h5"))
    told = capsys.readouterr().out
    assert "+0.5" in told
    assert "-0.2" in told
    assert "trigger" in told


@pytest.mark.parametrize("transport", ["slcan", "udp_multicast"])
def test_python_cans_real_drivers_deliver_every_frame_into_the_shot(tmp_path: Path, transport: str) -> None:
    display = Watched()
    outcome, truth = day(tmp_path, display, transports={"can": transport})
    assert display.last is not None
    received = {source.name: source.counters.received for source in display.last.sources}
    assert received == {"can": truth["can"]["sent"], "imu": truth["imu"]["bytes_sent"]}
    assert display.documents, outcome.shots
    assert display.found("missing frames", "can")[0][0] == "ok"
    # what the host dates may be late by milliseconds on a busy machine, the pressures with it: that alone may be said
    shot = read_shot(tmp_path / "0001.h5")
    assert shot.usable == (outcome.shots[0].state == "usable")
    assert {check.check for check in shot.quality if check.verdict == "fail"} <= {"alignment", "force"}, shot.reasons


def test_a_consumer_that_stalls_for_two_seconds_loses_nothing(tmp_path: Path) -> None:
    display = Watched(stall_s=2.0)
    outcome, truth = day(tmp_path, display)
    assert outcome.shots[0].state == "usable"
    assert display.last is not None
    received = {source.name: source.counters.received for source in display.last.sources}
    assert received == {"can": truth["can"]["sent"], "imu": truth["imu"]["bytes_sent"]}
    assert display.last.unseen_bytes == 0
    assert display.found("missing frames", "can")[0][0] == "ok"


def test_a_manual_trigger_makes_a_shot_and_q_ends_the_session(tmp_path: Path) -> None:
    display = Watched(keys={"heard": "t", "shot 0001 captured": "q"})
    outcome, _ = day(tmp_path, display, silence_before_s=8.0)
    (shot,) = outcome.shots
    assert shot.state == "incomplete"
    assert shot.problem == "no file of camera, dewetron"
    assert [path.name for path in (tmp_path / "captures").iterdir()] == ["0001.rdlog"]
    assert outcome.journal is not None
    assert outcome.journal.exists()
    assert shot.acquisition is not None
    assert shot.acquisition.decisions[-1].channel == ""


def test_numbers_go_on_where_a_folder_already_has_shots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_range, "Conversion", PlayedConversion)  # what becomes of the shot is not asked here
    (tmp_path / "captures").mkdir()
    (tmp_path / "captures" / "0007.rdlog").write_bytes(b"of another session")
    outcome, _ = day(tmp_path, Watched())
    assert [shot.name for shot in outcome.shots] == ["0008"]
    assert (tmp_path / "incoming" / "0008_dewetron.csv").exists()


def test_a_rig_without_trigger_or_device_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    rig = replace(load_rig("mixed"), trigger=None)
    with pytest.raises(RigError, match="trigger: is missing"):
        run_live(rig, LiveOptions(tmp_path / "out"), Watched())
    with pytest.raises((DeviceError, RigError)):
        run_live(load_rig("field-2013"), LiveOptions(tmp_path / "out"), Watched())
