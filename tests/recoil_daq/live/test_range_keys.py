"""What the keys do while a session goes on: which ask first, and what an alarm is."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.trigger import Decision
from recoil_acquisition.trigger.decision import Suppression
from recoil_daq.live import range_keys, range_states
from recoil_daq.live.range_state import RangeState
from recoil_rigs.rig import load_rig
from tests.builders.live_status import CAN, IMU, status
from tests.builders.range_session import PlayedSession, Range, Told


class Steps:
    """Presses a key, or does something, each time when a state was shown; keeps the states."""

    def __init__(self, one: Range, *steps: Any) -> None:
        self._display, self._steps = one.display, list(steps)
        self.states: list[RangeState] = []

    def __call__(self, state: RangeState) -> None:
        self.states.append(state)
        assert len(self.states) < 500
        if self._steps and not self._display._pressed:
            step = self._steps.pop(0)
            if callable(step):
                step()
            else:
                self._display._pressed.append(step)

    @property
    def asked(self) -> list[str]:
        return list(dict.fromkeys(state.asked for state in self.states if state.asked))


def stepped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *steps: Any) -> tuple[Range, Steps]:
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, Told(has_keys=True))
    shown = Steps(one, *(step(one) if getattr(step, "of_range", False) else step for step in steps))
    monkeypatch.setattr(one.display, "show", shown)
    one.session.fires = 0  # type: ignore[attr-defined]
    monkeypatch.setattr(
        one.session, "fire", lambda: setattr(one.session, "fires", one.session.fires + 1), raising=False
    )
    return one, shown


def crossed(channel: str = "p_brake", at_s: float = 5.0) -> Any:
    """Return a step that has the trigger's channel cross its level while it is disarmed."""

    def of(one: Range) -> Any:
        decision = Decision(at_s, "suppressed", Suppression.NOT_ARMED, channel, 0, 1, 2e6, at_s)
        return lambda: one.live._decisions.take(decision)

    of.of_range = True  # type: ignore[attr-defined]
    return of


def test_leaving_while_armed_is_asked_and_any_other_key_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "q", "n", "q", "a", "q", "y")
    one.run()
    assert shown.asked == ["ARMED: end the session? y yes, n go on"]
    assert sum(before.asked == "" != after.asked for before, after in pairwise(shown.states)) == 3
    assert one.session.stopped


def test_disarmed_it_ends_without_a_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "d", "q")
    one.run()
    assert shown.asked == []


def test_a_question_that_nobody_answers_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(range_keys, "ASKED_FOR_S", 0.3)
    idle = [lambda: None] * 40
    one, shown = stepped(tmp_path, monkeypatch, "q", *idle, "y", lambda: None, "d", "q")
    one.run()
    assert shown.asked == ["ARMED: end the session? y yes, n go on"]
    assert sum(bool(state.asked) for state in shown.states) < 30


def test_a_manual_trigger_while_disarmed_is_asked_and_arms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "t", "d", "t", "n", "t", "y", "d", "q")
    one.run()
    assert shown.asked == ["DISARMED: arm, and trigger a shot now? y yes, n no"]
    assert one.session.fires == 2  # type: ignore[attr-defined]  # at once while armed, and after the answer
    assert one.display.told("armed")


def test_a_crossing_while_disarmed_is_an_alarm_until_somebody_saw_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "d", crossed(), crossed(), lambda: None, "d", lambda: None, "q")
    one.run()
    alerts = [state.alert for state in shown.states]
    twice = next(alert for alert in alerts if "2 times" in alert)
    assert twice.startswith("ALARM: p_brake crossed while disarmed at ")
    assert ", at 2 MPa, 2 times: no shot is made; a arms, d takes this away" in twice
    assert alerts[-1] == ""
    assert one.display.told("ALARM: p_brake crossed while disarmed, at 2 MPa: no shot is made")
    counted = [state.decision.count for state in shown.states if state.decision is not None]
    assert max(counted) == 2


def test_arming_takes_an_alarm_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "d", crossed(), lambda: None, "a", lambda: None, "d", "q")
    one.run()
    alerts = list(dict.fromkeys(state.alert for state in shown.states))
    assert len(alerts) == 2
    assert alerts[1].startswith("ALARM: ")
    assert shown.states[-1].alert == ""


def test_overdue_calibrations_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = load_rig("mixed")
    first, *others = rig.channels
    late = first.model_copy(update={"sensor": first.sensor.model_copy(update={"due": dt.date(2020, 1, 1)})})
    one = Range(monkeypatch, replace(rig, channels=(late, *others)), tmp_path, Told(has_keys=True))
    shown = Steps(one, "d", "q")
    monkeypatch.setattr(one.display, "show", shown)
    one.run()
    assert f"{first.name} (was due 2020-01-01)" in shown.states[0].cautions[0]


def test_every_silent_source_on_which_a_role_hangs_is_an_alert_armed_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = replace(CAN, age_s=3.0)
    monkeypatch.setattr(range_states, "is_virtual_rig", lambda _: False)
    monkeypatch.setattr(PlayedSession, "status", property(lambda s: status(
        state="armed" if s.armed else "disarmed", sources=(silent, replace(IMU, age_s=None)),
    )))  # fmt: skip
    one, shown = stepped(tmp_path, monkeypatch, lambda: None, "d", lambda: None, "q")
    one.run()
    assert {state.alert for state in shown.states} == {
        "can SILENT: the trigger looks at it, imu SILENT: check its supply and its cable"
    }


def test_a_clock_that_was_set_since_it_was_armed_is_a_caution(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "d", "q")
    now = anchor()
    one.live._states.armed = replace(now, wall_ns=now.wall_ns - 3600 * 10**9)
    one.run()
    assert "this computer's clock was set by +3600 s, or it slept" in shown.states[0].cautions[0]
    one.live._states.armed = now
    assert one.live._states._clock_set() == ()


def test_a_state_that_other_programs_cannot_be_given_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, _ = stepped(tmp_path, monkeypatch, *[lambda: None] * 5, "d", "q")
    (tmp_path / "live.json").mkdir()
    one.run()
    assert one.display.told("live.json cannot be written, what it says is old: ") == [
        f"{tmp_path}/live.json cannot be written, what it says is old: Is a directory"
    ]


def logged(folder: Path, shot: str) -> tuple[str, str]:
    row = ShotLog.read(folder / SHOT_LOG, [shot]).row(shot)
    assert row is not None
    return row.exclude, row.notes


def typing(display: Told, words: str, keys: str) -> None:
    """Have keys pressed as soon as something is told."""
    display.then[words] = lambda: display._pressed.extend(keys)


def test_a_note_and_a_reason_to_leave_a_shot_out_end_in_its_row_of_the_shot_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True)
    typing(display, "0001 captured", "lWind, 5 m/s\n")
    typing(display, "note on shot 0001: Wind", "lq and t\n")
    typing(display, "note on shot 0001: q and t", "xmis\x7f\x7f\x7fhang fire\n")
    typing(display, "shot 0001 excluded: hang fire", "qy")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    one.session.fired(1.0)
    outcome = one.run()
    assert logged(tmp_path, "0001") == ("hang fire", "Wind, 5 m/s; q and t")
    assert outcome.shots[0].excluded == "hang fire"


def test_a_reason_is_taken_back_by_a_dash_and_nothing_is_written_for_an_empty_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True)
    typing(display, "0001 captured", "l\nx\nxmisfire\n")
    typing(display, "shot 0001 excluded: misfire", "x-\n")
    typing(display, "shot 0001 not excluded any more", "qy")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    asked: list[str] = []
    show = display.show
    monkeypatch.setattr(display, "show", lambda state: (asked.append(state.asked), show(state)))
    one.session.fired(1.0)
    outcome = one.run()
    assert logged(tmp_path, "0001") == ("", "")
    assert outcome.shots[0].excluded == ""
    assert any("why (now: misfire; - takes it back)" in text for text in asked)


def test_words_that_cannot_be_written_are_said_and_so_is_that_there_is_no_shot_yet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / SHOT_LOG).mkdir()
    display = Told(has_keys=True)
    typing(display, "0001 captured", "xmisfire\n")
    typing(display, "excluded: misfire is NOT in the shot log", "qy")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    typing(display, "no shot yet", "")
    display._pressed.extend("x")
    display.then["no shot yet"] = lambda: one.session.fired(1.0)
    outcome = one.run()
    assert outcome.shots[0].excluded == ""


def test_the_last_shot_is_the_one_that_was_fired_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    display = Told(has_keys=True)
    typing(display, "0002 captured", "xmisfire\n")
    typing(display, "shot 0002 excluded: misfire", "qy")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    one.session.fired(1.0, 2.0)
    assert [shot.excluded for shot in one.run().shots] == ["", "misfire"]


def test_a_key_says_seen_of_an_alarm_and_leaves_it_disarmed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, shown = stepped(tmp_path, monkeypatch, "d", crossed(), lambda: None, " ", lambda: None, "q")
    one.run()
    assert any(state.alert.startswith("ALARM: ") for state in shown.states)
    assert shown.states[-1].alert == ""
    assert {state.state for state in shown.states[3:]} == {"disarmed"}


def test_it_is_armed_before_anybody_says_what_was_added_and_the_keys_work_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True)
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, asks_mass=True)
    shown = Steps(one, "d", "a", "1", "2", ".", "5", "\n", lambda: None, "q", "y")
    monkeypatch.setattr(display, "show", shown)
    one.run()
    assert (shown.states[0].state, shown.asked[0]) == (
        "armed", "added mass of the next shots, kg, and u; Enter: not now"
    )  # fmt: skip
    assert display.told("disarmed: nothing will trigger")
    assert display.told("added mass of the shots to come: 12.5 kg, taken as exact")
    assert shown.states[-1].added_mass.startswith("12.5 kg")
    assert not any("Enter: not now" in state.asked for state in shown.states[-3:])


def test_the_question_for_the_added_mass_goes_by_enter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, Told(has_keys=True), asks_mass=True)
    shown = Steps(one, lambda: None, "\n", lambda: None, "q", "y")
    monkeypatch.setattr(one.display, "show", shown)
    one.run()
    assert "Enter: not now" in shown.states[0].asked
    assert shown.states[2].asked == ""
    assert shown.states[2].added_mass == ""


def test_a_full_disk_is_an_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PlayedSession, "status", property(lambda _: status(disk_free_bytes=1 << 20)))
    one, shown = stepped(tmp_path, monkeypatch, "d", "q", "y")
    one.run()
    assert shown.states[0].alert == "DISK FULL: shots stay in the journal, make room"


def test_what_is_typed_into_a_text_is_asked_for_as_it_was_pressed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True)
    typing(display, "0001 captured", "lW\n")
    typing(display, "note on shot 0001: W", "qy")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    key, asked = display.key, list[tuple[str, bool]]()

    def noted(*, typed: bool = False) -> str:
        pressed = key(typed=typed)
        asked.extend([(pressed, typed)] if pressed else [])
        return pressed

    monkeypatch.setattr(display, "key", noted)
    one.session.fired(1.0)
    one.run()
    assert asked[:4] == [("l", False), ("W", True), ("\n", True), ("q", False)]
