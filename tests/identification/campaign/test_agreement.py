"""Whether shots agree, asked twice: of the rows that are each shot's own, and of what is left between the shots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from recoil_acquisition.remark import NoteCode, ReasonCode
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.shot.shot_summary import LN_MASS_DRIFT
from tests.builders.campaign_summaries import MASS_KG, NAMES, campaign_of

RING = (0.0, 120.0) * 4
FIRST_OF_CHANGES = 12
"""Place of the first row that is about changes alone: before it stand mass, scales, share and five shapes."""


def sound(seed: int) -> tuple[CampaignShot, ...]:
    return campaign_of(RING, seed=seed, unread=1.0).shots


def with_seen(shot: CampaignShot, rows: slice, factor: float = 1.0, by: float | np.ndarray = 0.0) -> CampaignShot:
    """Make what a shot leaves of some of its rows larger."""
    assert shot.summary is not None
    seen = shot.summary.seen.copy()
    seen[rows] = factor * seen[rows] + by
    return replace(shot, summary=replace(shot.summary, seen=seen))


def noisy(shots: Sequence[CampaignShot], number: int, factor: float) -> list[CampaignShot]:
    """Make one shot's whole noise larger than its rows say."""
    found = list(shots)
    found[number] = with_seen(found[number], slice(None), factor)
    return found


def test_the_names_of_a_summary_put_the_rows_about_changes_last():
    summary = sound(0)[0].summary
    assert summary is not None
    assert [one.name for one in summary.parameters].index(LN_MASS_DRIFT) == FIRST_OF_CHANGES


@pytest.mark.whole_way
def test_probabilities_of_sound_campaigns_are_those_of_chance():
    between, own = [], []
    for seed in range(12):
        found = combine(sound(seed))
        assert found.valid, found.reasons
        between.append(found.agreement.between.probability)
        own += [one.probability for _, one in found.agreement.own]
    # uniform: by the mean, to four of its standard deviations
    assert np.mean(between) == pytest.approx(0.5, abs=4 * 0.289 / np.sqrt(len(between)))
    assert np.mean(own) == pytest.approx(0.5, abs=4 * 0.289 / np.sqrt(len(own)))


@pytest.mark.whole_way
def test_what_a_shot_leaves_of_its_own_rows_is_their_square_where_no_mass_changes():
    shots = sound(3)
    found = dict(combine(shots).agreement.own)
    for shot in shots:
        assert shot.summary is not None
        left = shot.summary.seen[FIRST_OF_CHANGES:]
        one = found[shot.name]
        # but for the little that the likeliest shared change takes
        assert one.size == pytest.approx(float(left @ left), abs=4.0)
        assert one.probability == pytest.approx(chi2.sf(one.size, left.size), rel=1e-9)


@pytest.mark.whole_way
def test_a_shot_that_is_noisier_than_its_rows_say_weighs_less_and_is_no_contradiction():
    shots = sound(1)
    loud = noisy(shots, 2, 4.0)
    found, before = combine(loud), combine(shots)
    assert found.valid, found.reasons
    (note,) = (one for one in found.notes if one.code == NoteCode.AGREEMENT)
    assert note.about == "0003"
    assert "not each is as noisy as it says, shot 0003 least" in str(found.agreement)
    assert found.agreement.noisy["0003"] == pytest.approx(4.0, rel=0.5)
    own_u_kg = {shot.shot.name: shot.own_u_kg for shot in found.shots}
    assert own_u_kg["0003"] > 2.0 * max(u for name, u in own_u_kg.items() if name != "0003" and u is not None)
    assert abs(found.mass.mass_kg - MASS_KG) < 3 * found.mass.u_kg
    assert found.mass.u_kg > before.mass.u_kg


@pytest.mark.whole_way
def test_a_shot_that_differs_from_the_others_is_named_with_the_mass_without_it():
    shots = list(sound(2))
    summary = shots[4].summary
    assert summary is not None
    # in no direction that a gauge, the mass or the friction of one shot can explain
    rng = np.random.default_rng(5)
    shots[4] = with_seen(shots[4], slice(len(NAMES), FIRST_OF_CHANGES), by=15.0 * rng.standard_normal(6))
    found = combine(shots)
    assert not found.valid
    (reason,) = (one for one in found.reasons if one.code == ReasonCode.AGREEMENT)
    assert reason.about == "0005"
    assert found.agreement.apart[0].shot == "0005"
    without = combine([one for one in shots if one.name != "0005"])
    assert found.agreement.apart[0].mass_kg == pytest.approx(without.mass.mass_kg, abs=0.2 * without.mass.u_kg)
    assert found.agreement.apart[0].u_kg == pytest.approx(without.mass.u_kg, rel=0.1)


@pytest.mark.whole_way
def test_where_none_lies_apart_all_of_them_weigh_less_and_nothing_is_said_against_the_mass():
    quiet = campaign_of(2 * RING, seed=6, unread=1.0).shots
    found, before = combine([with_seen(shot, slice(0, FIRST_OF_CHANGES), 1.35) for shot in quiet]), combine(quiet)
    assert found.agreement.between.probability < 1e-4
    assert not [one for one in found.reasons if one.code == ReasonCode.AGREEMENT]
    assert found.agreement.unexplained == pytest.approx(1.35, rel=0.1)
    assert [one.about for one in found.notes if one.code == NoteCode.AGREEMENT] == [None]
    assert found.mass.u_kg > before.mass.u_kg


def test_shots_whose_summaries_tell_of_no_change_are_asked_for_what_is_between_them_alone():
    found = combine(campaign_of(RING, seed=4).shots)
    assert found.agreement.own == ()
    assert 0.0 < found.agreement.between.probability <= 1.0
    assert "noisy" not in str(found.agreement)
