"""`predict`: what a campaign will tell, by the command and in Python, of the virtual rig and of a recorded shot."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_acquisition.remark import NoteCode
from recoil_daq import Predicted, ReadError, RigError, load_rig, predict
from recoil_daq.campaigns import prediction
from recoil_identification.campaign.advice import U_WEIGHED_KG, FailedAdviceWarning
from recoil_rigs.rig import Rig
from recoil_rigs.twin import CampaignPlan
from tests.builders.campaigns import RING, ring_campaign
from tests.builders.virtual_shots import SHORTER, with_twin

Run = Callable[..., Result]


def shorter() -> Rig:
    return with_twin("field-2013", **SHORTER)


FIRED: list[Any] = []
"""The nominal shots of `expected`."""


@cache
def expected() -> Predicted:
    fire = prediction._simulated

    def kept(*of_plan: Any) -> Any:
        FIRED.append(fire(*of_plan))
        return FIRED[-1]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(prediction, "_simulated", kept)
        return predict(shorter(), shots=4, plan=RING)


def words_of(change: str) -> list[str]:
    """Return the options that do what a line says, of the campaign that is expected."""
    plan = {"--shots": "4", "--added-mass": "120", "--u-added-mass": "0.05"}
    number = r"([0-9.e-]+)"
    if found := re.fullmatch(rf"(\S+) calibrated (?:twice as well(?: at rest)?:|to) {number} %(?: at rest)?", change):
        plan["--with"] = f"{found[1]}.u_rel={float(found[2]) / 100}"
    elif found := re.fullmatch(rf"\S+ known (?:twice as well|to be none): (\S+) {number}", change):
        plan["--with"] = f"{found[1]}={found[2]}"
    elif found := re.fullmatch(
        rf"{number} kg \(\d+ % of the mass\), weighed to {number} kg, added to every second shot", change
    ):
        plan |= {"--added-mass": found[1], "--u-added-mass": found[2]}
    elif change.endswith((': calibration = "dynamic"', "u_linearity_rel = 0", "gauge_ahead with u_share = 0")):
        pass  # a line of the rig file, see `as_said`
    elif change == "nothing added to any shot":
        plan = {"--shots": "4"}
    elif found := re.fullmatch(r"(\d+) shots", change):
        plan["--shots"] = found[1]
    elif found := re.fullmatch(rf"gains that repeat to {number} % only", change):
        plan["--repeatability"] = str(float(found[1]) / 100)
    else:
        pytest.fail(f"nothing says how this is done: {change}")
    return [word for option in plan.items() for word in option]


def as_said(text: str, change: str) -> str:
    """Write into a rig file what a line says of it."""
    channel, _, key = change.partition(" with a certificate as good of pulses like the shot's: ")
    if not key:
        channel, _, key = change.partition(" with a line that a calibration found straight: ")
    if change.endswith("gauge_ahead with u_share = 0"):
        channel, key = (
            change.split(maxsplit=1)[0],
            "gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15, u_share = 0 }",
        )
    if not key:
        return text
    begins = text.index("sensor = {", text.index(f'name = "{channel}"')) + len("sensor = {")
    return f"{text[:begins]} {key},{text[begins:]}"


def promised(document: dict[str, Any]) -> tuple[float, float]:
    """Return u of a shot and of the campaign that was asked for."""
    asked = document["shots"], document["added_mass_kg"]
    (u_rel,) = (one["u_rel"] for one in document["campaign"] if (one["shots"], one["added_mass_kg"]) == asked)
    return document["u_rel"], u_rel


def u_rel_of(done: Predicted, shots: int, added_kg: float) -> float:
    (u_rel,) = (
        one["u_rel"] for one in done.document["campaign"] if (one["shots"], one["added_mass_kg"]) == (shots, added_kg)
    )
    return float(u_rel)


@pytest.mark.indispensable("predict")
def test_a_prediction_has_what_is_promised_of_it() -> None:
    document = expected().to_json()
    assert document["schema"] == "recoil-daq/predict/1"
    assert 0.0037 < document["u_rel"] < 0.0041  # a share, not percent
    told = [(one["shots"], one["added_mass_kg"]) for one in document["campaign"]]
    assert told == [(1, 0), *((n, added) for n in (4, 8, 16, 32) for added in (0, 120))]
    assert all(set(one) == {"change", "u_rel_shot", "u_rel_campaign"} for one in document["what_if"])
    assert expected().what_if.u_rel_campaign.is_monotonic_increasing
    assert expected().campaign.u_rel.max() == expected().u_rel
    assert expected().valid
    assert repr(expected()).startswith("Predicted('field-2013': u 0.3")
    json.dumps(document, allow_nan=False)


def test_what_is_printed_ends_with_what_to_expect() -> None:
    *_, last = str(expected()).splitlines()
    u = 100 * u_rel_of(expected(), 4, 120)
    assert last.startswith(f"u {100 * expected().u_rel:.3f} % (3.0")
    assert f"u {u:.3f} %" in last
    assert last.endswith("from 4 shots, 120 kg added to every second")
    assert "p_breech calibrated twice as well at rest: 0.25 %" in str(expected())


@pytest.mark.whole_way
def test_a_campaign_states_what_was_predicted_of_it() -> None:
    fired, answer = ring_campaign().fired, ring_campaign().answer
    mass = json.loads((answer / "campaign.json").read_text(encoding="utf-8"))["mass"]
    stated = mass["u"] / mass["value"]
    assert u_rel_of(expected(), 4, 120) == pytest.approx(stated, rel=0.1)
    by_shot = predict(fired.rig, from_shot=fired.files[0], shots=4, plan=RING)
    assert u_rel_of(by_shot, 4, 120) == pytest.approx(stated, rel=0.1)
    # a shot that carried the mass tells what a bare one will
    by_heavier = predict(fired.rig, from_shot=fired.files[1], shots=4, plan=RING)
    # but for its own noise of the motion
    assert by_heavier.u_rel == pytest.approx(expected().u_rel, rel=0.1)
    assert by_heavier.document["mass_kg"] == pytest.approx(782, rel=0.02)


@pytest.mark.whole_way
def test_options_and_python_predict_the_same_of_a_recorded_shot(run: Run, stored: Path) -> None:
    words = ("--from", stored, "--shots", "6", "--added-mass", "60", "--u-added-mass", "0.1", "--repeatability", "5e-4")
    result = run("predict", "field-2013", *words, "--with", "p_breech.u_rel=0.002", "--with", "u_friction=75", "--json")
    assert result.exit_code == 0, result.output
    done = predict(
        load_rig("field-2013"),
        from_shot=stored,
        shots=6,
        plan=CampaignPlan(added_mass_kg=60.0, u_added_mass_kg=0.1, repeatability=5e-4),
        uncertainties={"p_breech.u_rel": 0.002, "u_friction": 75.0},
    )
    assert json.loads(result.stdout) == json.loads(json.dumps(done.to_json()))
    plain = predict(load_rig("field-2013"), from_shot=stored, shots=6, plan=CampaignPlan(added_mass_kg=60.0))
    # what is left is what no gauge reads
    assert done.u_rel < 0.92 * plain.u_rel
    assert [shot["file"] for shot in done.document["provenance"]["inputs"]] == ["0001.h5"]
    shown = run("predict", "field-2013", "--from", stored, "--shots", "1")
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.splitlines()[-1].endswith("from one shot")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--shots", "1", "--added-mass", "120"), "there is only one"),
        (("--added-mass", "-5"), "--added-mass: "),
        (("--added-mass", "120", "--u-added-mass", "50"), "a fifth of the added mass"),
        (("--added-mass", "nan"), "'--added-mass': 'nan' does not begin with a number"),
        (("--added-mass", "12,500"), "'12,500' may be thousands or decimals, 12500 or 12.5"),
        (("--with", "u_friction=75 m"), "has the unit 'm', which is none of a value in N"),
        (("--repeatability", "5"), "--repeatability: "),
        (("--from", "0001.h5", "--charges", "1,0.8"), "tells of its own only"),
        (("--charges", "1,0.9,0.8,0.7,0.6"), "5 different ones, and at most 4"),
        (("--shots", "0"), "greater than or equal to 1"),
        (("--with", "p_breech.u_rel"), "is not KEY=VALUE"),
        (("--with", "p_breech.u_rel=few"), "KEY=NUMBER"),
        (("--with", "u_friction=1", "--with", "u_friction=2"), "given twice"),
    ],
)
def test_a_number_that_no_campaign_can_have_is_a_wrong_usage(run: Run, words: tuple[str, ...], told: str) -> None:
    result = run("predict", "field-2013", *words)
    assert result.exit_code == 2
    assert told in " ".join(result.stderr.split())


def test_an_uncertainty_that_the_rig_does_not_have_is_named_with_the_nearest(run: Run) -> None:
    result = run("predict", "field-2013", "--with", "p_brech.u_rel=0.002")
    assert result.exit_code == 3
    assert "p_brech.u_rel: no such uncertainty" in result.stderr
    assert "did you mean 'p_breech.u_rel'?" in result.stderr


def test_what_nobody_expects_of_shots_to_come_is_refused() -> None:
    rig = shorter()
    for plan, told in (
        (CampaignPlan(mass_steps={2: -4.0}), "mass_steps: nobody expects"),
        (CampaignPlan(charges=(1.0, 0.9, 0.8, 0.7, 0.6)), "5 different ones"),
    ):
        with pytest.raises(ValueError, match=told):
            predict(rig, plan=plan)
    with pytest.raises(RigError, match="120000 kg are more than 2 times the recoiling mass"):
        predict(rig, plan=CampaignPlan(added_mass_kg=120e3))


@pytest.mark.whole_way
def test_weaker_charges_tell_less() -> None:
    done = predict(shorter(), shots=4, plan=CampaignPlan(charges=(0.65, 1.0)))
    assert done.u_rel > 1.1 * expected().u_rel
    assert u_rel_of(expected(), 4, 0) < u_rel_of(done, 4, 0) < done.u_rel
    assert "charges 0.65, 1" in str(done)


@pytest.mark.whole_way
def test_a_rig_of_which_nothing_says_how_it_moves_needs_a_shot(run: Run, stored: Path, tmp_path: Path) -> None:
    head, _, _ = load_rig("field-2013").text.partition("[twin]\n")
    path = tmp_path / "rig.toml"
    path.write_text(head, encoding="utf-8")
    result = run("predict", path)
    assert result.exit_code == 3
    assert "twin: is missing" in result.stderr
    assert "recorded shot" in result.stderr
    assert run("predict", path, "--from", stored).exit_code == 0


def test_a_shot_of_another_rig_or_none_is_refused(run: Run, stored: Path, tmp_path: Path) -> None:
    other = run("predict", "mixed", "--from", stored)
    assert other.exit_code == 3
    assert "recorded on another rig" in other.stderr
    rig = load_rig("field-2013")
    lacking = rig.without_channel("x_camera")
    with pytest.raises(ReadError, match="expected x_camera missing, found x_camera recoil_displacement"):
        predict(lacking, from_shot=stored)
    with pytest.raises(ReadError, match=r"expected b 0\.9, found b 0\.8"):
        predict(replace(rig, mechanism=replace(rig.mechanism, b=0.9)), from_shot=stored)
    missing = run("predict", "mixed", "--from", tmp_path / "none.h5")
    assert missing.exit_code == 3
    assert "no such file" in missing.stderr


def test_a_virtual_rig_that_cannot_move_is_refused_and_leaves_nothing() -> None:
    with pytest.raises(RigError, match="orifice"):
        predict(with_twin("field-2013", orifice_m2=-1.0))


@pytest.mark.whole_way
def test_every_line_of_what_could_be_done_can_be_done_and_keeps_its_promise(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = expected().document["what_if"]
    monkeypatch.setattr(prediction, "_simulated", lambda *_: FIRED[0])
    path = tmp_path / "rig.toml"
    assert len(lines) > 10
    assert any("pulses" in line["change"] for line in lines)
    for line in lines:
        path.write_text(as_said(shorter().text, line["change"]), encoding="utf-8")
        result = run("predict", path, *words_of(line["change"]), "--json")
        assert result.exit_code == 0, (line, result.output)
        document = json.loads(result.stdout)
        assert promised(document) == pytest.approx((line["u_rel_shot"], line["u_rel_campaign"]), rel=5e-3), line


@pytest.mark.whole_way
def test_a_line_that_cannot_be_worked_out_costs_itself_and_not_the_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    document = expected().document
    told = prediction.predicted_u_rel

    def without_16(nominal: Any, plan: Any) -> float:
        if plan.shots == 16:
            raise ValueError("each unknown needs a name of its own")
        return told(nominal, plan)

    monkeypatch.setattr(prediction, "_simulated", lambda *_: FIRED[0])
    monkeypatch.setattr(prediction, "predicted_u_rel", without_16)
    with pytest.warns(FailedAdviceWarning):
        found = predict(shorter(), shots=4, plan=RING)
    assert (found.u_rel, promised(found.document)) == (document["u_rel"], promised(document))
    assert {one["shots"] for one in found.document["campaign"]} == {1, 4, 8, 32}
    assert [one["code"] for one in found.document["findings"]] == [NoteCode.NO_ADVICE] * 2
    assert "note: left out of what could be done, since it could not be worked out: 16 shots, 120 kg added" in str(
        found
    )


def test_a_mass_that_is_advised_is_weighed_as_well_as_one_that_is_planned() -> None:
    assert CampaignPlan(added_mass_kg=310.0).u_added_mass_kg == U_WEIGHED_KG
