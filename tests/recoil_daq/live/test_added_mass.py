"""What the shots to come carry is stated at the keys, and stands in the shot log from the first of them on."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_daq.live.added_mass import AddedMass, mass_entry, weight_of
from recoil_daq.live.shots import shot_work
from recoil_rigs.rig import load_rig
from tests.builders.range_session import Range, Told


@pytest.mark.parametrize(
    ("text", "kg", "u_kg"),
    [
        ("12.5", 12.5, None), ("12,5 kg", 12.5, None), ("12.5 0,05", 12.5, 0.05), ("12.5 +- 0.05 kg", 12.5, 0.05),
        ("12.5 ± 0.05", 12.5, 0.05), ("-3", -3.0, None), ("0", 0.0, 0.0),
    ],
)  # fmt: skip
def test_a_mass_and_its_uncertainty_are_one_number_or_two(text: str, kg: float, u_kg: float | None) -> None:
    assert AddedMass.of(text) == AddedMass(kg, u_kg)


@pytest.mark.parametrize("text", ["", "none", "1 2 3", "12.5 -0.05", "12.5.1"])
def test_what_is_no_mass_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"no mass|not negative"):
        AddedMass.of(text)


def test_a_key_that_is_no_part_of_a_mass_is_not_taken_and_one_may_be_taken_back() -> None:
    entry = mass_entry()
    assert not any(entry.press(key) for key in ["1", "q", "", "2", "\x7f", "5"])
    assert entry.typed == "15"
    assert entry.press("\n")


def test_a_row_that_somebody_wrote_before_the_shot_stays(tmp_path: Path) -> None:
    (tmp_path / SHOT_LOG).write_text("shot,added_mass_kg\n0001,20\n")
    assert not AddedMass(12.5).note(tmp_path, "0001")
    assert not AddedMass(12.5, 0.05).note(tmp_path, "0002")
    rows = ShotLog.read(tmp_path / SHOT_LOG, ["0001", "0002"]).rows
    assert [(row.added_mass_kg, row.u_added_mass_kg) for row in rows] == [(20.0, 0.0), (12.5, 0.05)]


def test_a_log_that_is_at_fault_is_said(tmp_path: Path) -> None:
    (tmp_path / SHOT_LOG).write_text("number\n1\n")
    assert "0001, 12.5 kg, taken as exact, is not in the shot log" in AddedMass(12.5).note(tmp_path, "0001")


def test_the_key_m_asks_and_the_shots_from_then_on_carry_what_was_typed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True, keys={"0002 captured": "qy"})
    display.then["0001 captured"] = lambda: display._pressed.extend("m12.5 0.05\n")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, added_mass=AddedMass(3.0))
    display.then["of the shots to come: 12.5 kg, u 0.05 kg"] = lambda: one.session.fired(2.0)
    one.session.fired(1.0)
    one.run()
    rows = ShotLog.read(tmp_path / SHOT_LOG, ["0001", "0002"]).rows
    assert [(r.shot, r.added_mass_kg, r.u_added_mass_kg, r.u_added_mass_stated) for r in rows] == [
        ("0001", 3.0, 0.0, False), ("0002", 12.5, 0.05, True),
    ]  # fmt: skip


def test_a_session_ends_when_the_shot_log_has_the_mass_or_it_is_said_why_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = threading.Event()

    def note(_: AddedMass, _out: Path, shot: str) -> str:
        assert held.wait(10.0)
        return f"the added mass of shot {shot} is not in the shot log"

    monkeypatch.setattr(AddedMass, "note", note)
    monkeypatch.setattr(shot_work, "NOTED_WITHIN_S", 0.01)
    display = Told(has_keys=True, keys={"0001 captured": "qy"})
    display.then["the shot log is in use"] = held.set
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, added_mass=AddedMass(3.0))
    one.session.fired(1.0)
    one.run()
    assert display.notices[-2:] == [
        "the shot log is in use: it is waited for, for the added mass of 0001",
        "the added mass of shot 0001 is not in the shot log",
    ]


def test_an_empty_answer_leaves_it_and_a_dash_takes_it_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    display = Told(has_keys=True, keys={"not stated": "qy"})
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, added_mass=AddedMass(3.0))
    asked: list[tuple[str, str]] = []
    monkeypatch.setattr(display, "show", lambda state: asked.append((state.asked[-3:], state.added_mass)))
    one.run(lambda: display._pressed.extend("m\nmx7q\nm-\n"))
    assert ("kg", "3 kg, taken as exact") not in asked
    assert (": 7", "3 kg, taken as exact") in asked
    assert (": -", "7 kg, taken as exact") in asked
    assert asked[-1][1] == ""


WEIGHT = AddedMass(310.0, 0.05)


def test_a_weight_at_hand_is_put_on_in_turn_and_counts_as_soon_as_somebody_says_that_it_is_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True, keys={"0004 captured": "qy"})
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, weight=WEIGHT)
    asked: list[str] = []
    monkeypatch.setattr(display, "show", lambda state: asked.append(state.asked))

    def fires() -> None:
        one.session.fired(1.0 + len(display.told("captured")))

    def answer(words: str, keys: str) -> None:
        def said() -> None:
            display._pressed.extend(keys)
            display.then["of the shots to come"] = fires

        display.then[words] = said

    for shot, keys in (("0001", "y"), ("0002", "m250 0.1\n"), ("0003", "y")):
        answer(f"{shot} captured", keys)
    display._pressed.extend("y")
    display.then["of the shots to come"] = fires
    one.run()
    questions = [one for one in dict.fromkeys(asked) if "carry" in one]
    assert questions == [
        "does shot 0001 carry 0 kg? y yes, m another",
        "does shot 0002 carry 310 kg, u 0.05 kg? y yes, m another",
        "does shot 0003 carry 0 kg? y yes, m another",
        "does shot 0004 carry 0 kg? y yes, m another",  # as 0003 had another weight on
        "does shot 0005 carry 310 kg, u 0.05 kg? y yes, m another",
    ]
    rows = ShotLog.read(tmp_path / SHOT_LOG, ["0001", "0002", "0003", "0004"]).rows
    assert [(r.added_mass_kg, r.u_added_mass_kg) for r in rows] == [(0.0, 0.0), (310.0, 0.05), (250.0, 0.1), (0.0, 0.0)]


def test_of_a_shot_of_which_nobody_said_whether_it_carries_the_weight_nothing_is_logged_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(has_keys=True, keys={"0001 captured": "qy"})
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, weight=WEIGHT)
    one.session.fired(1.0)
    one.run()
    said = "shot 0001: nobody said whether it carries 310 kg, u 0.05 kg: write its `added_mass_kg` into the shot log"
    assert said in display.notices
    assert not (tmp_path / SHOT_LOG).exists()


def test_the_weight_is_what_the_rig_has_at_hand() -> None:
    rig = load_rig("mixed")
    assert weight_of(rig.knowledge) is None
    known = rig.knowledge.model_copy(update={"weighed_mass_kg": 310.0, "u_weighed_mass_kg": 0.05})
    assert weight_of(known) == WEIGHT
