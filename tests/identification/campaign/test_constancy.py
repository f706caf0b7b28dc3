"""Whether the mass changes within all shots of a campaign: power, false alarms, and a second opinion in one formula."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.constancy import SharedConstancy, shared_constancy
from recoil_identification.campaign.joint_fit import FORCES, joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.mechanisms import mechanisms_of
from recoil_identification.shot.shot_summary import STEPS_AT
from tests.builders.campaign_summaries import campaign_of
from tests.builders.dense_campaign import densities

RING = (0.0, 120.0) * 4
STEP = f"step of ln mass at {STEPS_AT[5]:g}"
CHANGES = [("drift of ln mass", 0.03), *((f"step of ln mass at {share:g}", 0.02) for share in STEPS_AT)]


def rows_of(shots: tuple[CampaignShot, ...]) -> JointRows:
    return JointRows.of(shots, mechanisms_of(shots))


def told(seed: int, force: float, changing: dict[str, float] | None = None) -> SharedConstancy:
    found = combine(campaign_of(RING, seed=seed, unread=force, friction_rel=0.03, changing=changing).shots).constancy
    assert found is not None
    return found


@pytest.mark.parametrize("changing", [{}, {"drift of ln mass": -0.006}, {STEP: 0.003}])
def test_the_bayes_factor_is_that_of_the_density_of_all_rows(changing: dict[str, float]) -> None:
    shots = campaign_of(RING, seed=6, unread=1.5, changing=changing).shots
    found = shared_constancy(joint_fit_under(rows_of(shots), Scatter(3e-4, 0.02)))
    assert found is not None
    ln_constant, ln_changes = [], []
    for force in FORCES:
        constant, changes, *_ = densities(shots, force, 0.02, 3e-4, CHANGES)
        prior = math.log(force / (1.0 + force**2))
        ln_constant.append(constant + prior)
        ln_changes.append([one + prior for one in changes])
    each = np.logaddexp.reduce(np.array(ln_changes)) - np.logaddexp.reduce(ln_constant)
    steps = float(np.logaddexp.reduce(each[1:]) - math.log(len(STEPS_AT)))
    expected = float(np.logaddexp(each[0], steps) - math.log(2.0))
    assert found.ln_bayes_factor == pytest.approx(expected, abs=0.02)
    assert found.step_explains_more == (steps > each[0])


@pytest.mark.whole_way
def test_changes_that_all_shots_have_are_found_with_their_sizes() -> None:
    # more seeds: the benchmark of a shared change
    drift = told(0, 1.0, {"drift of ln mass": -0.015})
    assert not drift.constant
    assert not drift.step_explains_more
    assert drift.drift.size_percent == pytest.approx(-1.5, abs=3 * drift.drift.u_percent)
    assert f"a drift of {drift.drift}" in str(drift)
    step = told(0, 1.0, {STEP: 0.005})
    assert not step.constant
    assert step.step_explains_more
    assert step.step_at == STEPS_AT[5]
    assert step.step.size_percent == pytest.approx(0.5, abs=3 * step.step.u_percent)


@pytest.mark.whole_way
@pytest.mark.parametrize("force", [0.0, 1.0, 3.5])
def test_a_force_that_no_gauge_reads_is_no_changing_mass(force: float) -> None:
    found = told(0, force)
    assert found.constant
    # a change is no larger than what may hide
    assert abs(found.drift.size_percent) < found.could_hide_percent["drift"]


def test_without_a_word_of_changes_in_the_summaries_nothing_is_said_of_them() -> None:
    assert combine(campaign_of(RING, seed=1).shots).constancy is None


@pytest.mark.whole_way
def test_a_shot_in_which_alone_the_mass_changes_is_set_aside_and_the_others_are_one_mass() -> None:
    drawn = campaign_of(RING, seed=2, unread=1.0, changing={STEP: -0.03}, changing_in=(3,), told=(3,))
    found = combine(drawn.shots)
    assert [used.shot.name for used in found.shots if used.excluded is not None] == ["0004"]
    assert "otherwise than in the others" in str(found.shots[3].excluded)
    assert found.constancy is not None
    assert found.constancy.constant
    assert found.mass.mass_kg == pytest.approx(drawn.mass_kg, abs=3 * found.mass.u_kg)
    # the same shots without it give the same digits
    others = combine([shot for shot in drawn.shots if shot.name != "0004"])
    assert (found.mass.mass_kg, found.mass.u_kg) == (others.mass.mass_kg, others.mass.u_kg)


@pytest.mark.whole_way
def test_two_shots_that_change_each_in_its_own_way_are_both_set_aside() -> None:
    first = campaign_of(RING, seed=2, unread=1.0, changing={STEP: -0.03}, changing_in=(3,), told=(3, 6))
    second = campaign_of(RING, seed=2, unread=1.0, changing={"drift of ln mass": 0.05}, changing_in=(6,), told=(3, 6))
    shots = [*first.shots[:6], second.shots[6], first.shots[7]]
    assert [used.shot.name for used in combine(shots).shots if used.excluded is not None] == ["0004", "0007"]


@pytest.mark.whole_way
def test_what_each_shot_alone_calls_a_changing_mass_is_judged_by_all_together() -> None:
    every = tuple(range(8))
    changing = combine(campaign_of(RING, seed=1, unread=1.0, changing={"drift of ln mass": -0.015}, told=every).shots)
    assert all(used.excluded is None for used in changing.shots)
    assert "constancy" in [reason.code for reason in changing.reasons]
    # a force that all share is none, whatever each shot's report makes of it
    forced = combine(campaign_of(RING, seed=3, unread=3.5, told=every).shots)
    assert all(used.excluded is None for used in forced.shots)
    assert forced.constancy is not None
    assert forced.constancy.constant


@pytest.mark.whole_way
def test_a_change_that_no_report_tells_of_sets_no_shot_aside() -> None:
    drawn = campaign_of(RING, seed=2, unread=1.0, changing={STEP: -0.03}, changing_in=(3,))
    assert all(used.excluded is None for used in combine(drawn.shots).shots)


@pytest.mark.whole_way
def test_a_change_is_a_reason_that_names_the_other_readings_and_none_where_as_much_is_left_in_a_coloured_way() -> None:
    drawn = campaign_of(RING, seed=1, unread=1.0, changing={"drift of ln mass": -0.015}).shots
    left = [replace(shot, summary=replace(shot.summary, unexplained_share=0.02)) for shot in drawn if shot.summary]
    changing, found = combine(drawn), combine(left).constancy
    assert not changing.valid
    (reason,) = [one for one in changing.reasons if one.code == "constancy"]
    assert "or the friction, or what the breech chain reads" in reason
    assert reason.about == "shots"
    told = changing.constancy
    assert told is not None
    assert found is not None
    assert not told.constant
    assert found.ln_bayes_factor == told.ln_bayes_factor
    assert found.constant
    assert found.reasons == ()
    assert "forces and motion leave 2 % of one another" in str(found)
