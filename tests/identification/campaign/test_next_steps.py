"""What would make a campaign surer is what a campaign that did it states."""

from __future__ import annotations

import pytest

from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.joint_fit import joint_fit
from recoil_identification.campaign.joint_rows import JointRows
from recoil_identification.campaign.mechanisms import mechanisms_of
from recoil_identification.campaign.next_steps import next_steps
from tests.builders.campaign_summaries import MASS_KG, campaign_of


def test_steps_are_those_that_help_the_most_helpful_first() -> None:
    found = combine(campaign_of((0.0,) * 4, seed=4).shots)
    sizes = [step.u_kg for step in found.next_steps]
    assert sizes == sorted(sizes)
    assert 1 <= len(sizes) <= 6
    assert all(size < found.mass.u_kg for size in sizes)
    assert "weighed and added" in found.next_steps[0].change


def test_more_shots_with_a_mass_added_make_it_as_sure_as_they_are_said_to() -> None:
    alike = (1.0,)  # the steps suppose shots like the last one
    before = campaign_of((0.0,) * 4, seed=None, charges=alike).shots
    fit = joint_fit(JointRows.of(before, mechanisms_of(before)))
    added_kg = float(f"{0.2 * MASS_KG:.2g}")
    (step,) = (one for one in next_steps(fit) if f"with {added_kg:g} kg" in one.change)
    after = campaign_of((*[0.0] * 4, *[added_kg] * 4), seed=None, charges=alike, u_added_kg=0.0).shots
    again = joint_fit(JointRows.of(after, mechanisms_of(after)))
    # the scatter that four shots leave possible is larger than what eight do
    assert step.u_kg == pytest.approx(again.mass_kg("as built")[1], rel=0.12)
