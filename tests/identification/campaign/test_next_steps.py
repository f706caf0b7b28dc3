"""What would make a campaign surer is what a campaign that did it states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.remark import NoteCode
from recoil_identification.campaign import next_steps as steps
from recoil_identification.campaign.advice import FailedAdviceWarning
from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.joint_fit import joint_fit
from recoil_identification.campaign.joint_rows import JointRows
from recoil_identification.campaign.mechanisms import mechanisms_of
from recoil_identification.campaign.next_steps import next_steps
from recoil_identification.campaign.prediction import ADDED_SHARES
from recoil_identification.report.document.campaign_document import campaign_document
from tests.builders.campaign_summaries import MASS_KG, campaign_of


def test_steps_are_those_that_help_the_most_helpful_first() -> None:
    found = combine(campaign_of((0.0,) * 4, seed=4).shots)
    sizes = [step.u_kg for step in found.next_steps.lines]
    assert sizes == sorted(sizes)
    assert 1 <= len(sizes) <= 6
    assert all(size < found.mass.u_kg for size in sizes)
    assert "weighed and added" in found.next_steps.lines[0].change


@pytest.mark.whole_way
def test_more_shots_with_a_mass_added_make_it_as_sure_as_they_are_said_to() -> None:
    alike = (1.0,)  # the steps suppose shots like the last one
    before = campaign_of((0.0,) * 4, seed=None, charges=alike).shots
    fit = joint_fit(JointRows.of(before, mechanisms_of(before)))
    added_kg = float(f"{0.2 * MASS_KG:.2g}")
    (step,) = (one for one in next_steps(fit).lines if f"with {added_kg:g} kg" in one.change)
    after = campaign_of((*[0.0] * 4, *[added_kg] * 4), seed=None, charges=alike, u_added_kg=0.0).shots
    again = joint_fit(JointRows.of(after, mechanisms_of(after)))
    # the scatter that four shots leave possible is larger than what eight do
    assert step.u_kg == pytest.approx(again.mass_kg("as built")[1], rel=0.12)


@pytest.fixture
def all_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """List every step that is tried, be it worth its name or not."""
    monkeypatch.setattr(steps, "LEAST_GAIN", -1.0)
    monkeypatch.setattr(steps, "MOST_STEPS", 100)


@pytest.mark.usefixtures("all_steps")
@pytest.mark.parametrize(("share", "u_added_kg"), list(zip(ADDED_SHARES, (3.0, 0.05, 0.0), strict=True)))
def test_a_mass_that_is_advised_may_be_the_one_that_the_shots_carry(share: float, u_added_kg: float) -> None:
    added_kg = float(f"{share * MASS_KG:.2g}")
    found = combine(campaign_of((0.0, added_kg), seed=None, u_added_kg=u_added_kg).shots)
    assert found.next_steps.notes == ()
    assert (
        f"2 more shots with {added_kg:g} kg ({100 * share:.0f} % of the mass) weighed and added, u {u_added_kg:g} kg"
    ) in {step.change for step in found.next_steps.lines}


@pytest.mark.whole_way
@pytest.mark.usefixtures("all_steps")
def test_a_mass_that_the_shots_carry_is_no_surer_in_the_shots_to_come() -> None:
    """It is one weight: weighing it badly is nothing that more shots average away."""
    sizes = {}
    for u_added_kg in (0.05, 3.0):
        found = combine(campaign_of((0.0, 180.0) * 2, seed=5, u_added_kg=u_added_kg).shots)
        (sizes[u_added_kg],) = (one.u_kg for one in found.next_steps.lines if "with 180 kg" in one.change)
    assert sizes[3.0] > 1.2 * sizes[0.05]


@pytest.mark.whole_way
def test_a_step_that_cannot_be_worked_out_costs_itself_and_not_the_mass(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_such(*_: object) -> None:
        raise np.linalg.LinAlgError("singular")

    drawn = campaign_of((0.0,) * 4, seed=4).shots
    sound = combine(drawn)
    expected = [one for one in sound.next_steps.lines if "known" not in one.change]
    monkeypatch.setattr(steps, "_knowing", no_such)
    with pytest.raises(FailedAdviceWarning, match="known twice as well"):  # which is an error in tests
        _ = combine(drawn).next_steps
    found = combine(drawn)
    with pytest.warns(FailedAdviceWarning):
        found.next_steps  # noqa: B018 it is worked out here
    assert list(found.next_steps.lines) == expected
    assert found.mass == sound.mass
    assert {one.code for one in found.next_steps.notes} == {NoteCode.NO_ADVICE}
    assert "breech_pressure scale, sensor 1 known twice as well (LinAlgError('singular'))" in " ".join(
        found.next_steps.notes
    )
    document = campaign_document(found, version="1", inputs=(), parameters={})
    told = [one["text"] for one in document["findings"] if one["code"] == "no advice"]
    assert told == list(found.next_steps.notes) == document["notes"][-len(told) :]


@pytest.mark.whole_way
def test_two_weighings_of_one_mass_are_two_weights_with_names_that_tell_them_apart() -> None:
    drawn = campaign_of((0.0, 120.0, 120.0, 60.0), seed=6)
    shots = [*drawn.shots[:2], replace(drawn.shots[2], u_added_mass_kg=0.5), drawn.shots[3]]
    rows = JointRows.of(shots, mechanisms_of(shots))
    assert rows.added == (
        "added mass of 120 kg (u 0.05 kg)",
        "added mass of 120 kg (u 0.5 kg)",
        "added mass of 60 kg",
    )
    found = combine(shots)
    assert {row.source for row in found.budget} >= set(rows.added)


def test_masses_that_round_to_the_same_are_told_apart_by_all_their_digits() -> None:
    kg = (120.0, 120.0000001)
    drawn = campaign_of((0.0, *kg), seed=6)
    assert JointRows.of(drawn.shots, mechanisms_of(drawn.shots)).added == (
        "added mass of 120.0 kg (u 0.05 kg)",
        "added mass of 120.0000001 kg (u 0.05 kg)",
    )


@pytest.mark.whole_way
def test_what_was_taken_off_is_counted_as_what_was_added_is() -> None:
    found = combine(campaign_of((0.0, -90.0) * 2, seed=7).shots)
    added = combine(campaign_of((0.0, 90.0) * 2, seed=7).shots)
    assert found.changes == ()
    assert found.valid
    assert abs(found.mass.mass_kg - MASS_KG) < 2.5 * found.mass.u_kg
    assert found.mass.u_kg == pytest.approx(added.mass.u_kg, rel=0.2)
