"""What no rig states, asked of many shots: named with its size, beside a mass that changes, and averaged over."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.remark import ReasonCode
from recoil_identification.campaign.campaign import Campaign
from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.joint_fit import joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.mechanisms import mechanisms_of
from recoil_identification.campaign.suspects import SharedSuspicion, shared_suspicion
from recoil_identification.shot.shot_summary import Parameter, Suspected
from recoil_processing.shot.error_source import SourceKind
from tests.builders.campaign_summaries import MASS_KG, SUSPECTS, campaign_of

RING = (0.0, 120.0) * 4
BENT, HANGING = (one.name for one in SUSPECTS)


def told(seed: int, suspected: dict[str, float], **changed: object) -> Campaign:
    shots = campaign_of(RING, seed=seed, unread=1.0, friction_rel=0.03, suspected=suspected, **changed).shots  # type: ignore[arg-type]
    return combine(shots)


def suspicion_of(campaign: Campaign) -> SharedSuspicion:
    assert campaign.suspicion is not None
    return campaign.suspicion


@pytest.mark.whole_way
def test_sound_shots_accuse_nobody_and_lose_little_by_being_asked() -> None:
    asked, plain = told(1, {}), combine(campaign_of(RING, seed=1, unread=1.0, friction_rel=0.03).shots)
    assert not suspicion_of(asked).suspected
    assert "Nothing of the breech chain" in str(suspicion_of(asked))
    assert asked.valid, asked.reasons
    assert asked.mass.u_kg == pytest.approx(plain.mass.u_kg, rel=0.1)
    assert plain.suspicion is None


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "size", "kind", "said"),
    [
        (BENT, 0.008, SourceKind.LINEARITY, "a breech gauge whose line is bent"),
        (HANGING, 0.012, SourceKind.HANGING_PART, "a part that hangs elastically"),
    ],
)
def test_a_shape_of_the_rig_is_named_with_its_size_in_the_place_of_a_mass_that_changes(name, size, kind, said) -> None:
    found = told(2, {name: size})
    suspicion = suspicion_of(found)
    assert suspicion.suspected
    assert suspicion.source.kind is kind
    value, u = suspicion.size
    assert value == pytest.approx(size, abs=3.0 * u)
    assert said in str(suspicion)
    # no other sensor is accused, no shot is set aside, and the mass holds it
    assert {one.code for one in found.reasons} <= {ReasonCode.BREECH_CHAIN}
    assert all(one.excluded is None for one in found.shots)
    assert any(said in one for one in (*found.reasons, *found.notes))
    assert found.constancy is not None
    assert found.constancy.constant
    assert abs(found.mass.mass_kg - MASS_KG) < 3.0 * found.mass.u_kg


@pytest.mark.whole_way
def test_a_mass_that_changes_in_every_shot_is_still_said() -> None:
    found = told(3, {}, changing={"drift of ln mass": -0.03})
    assert found.constancy is not None
    assert not found.constancy.constant
    assert ReasonCode.CONSTANCY in {one.code for one in found.reasons}


@pytest.mark.whole_way
def test_the_mass_is_the_mean_over_all_of_them_and_its_budget_adds_up_to_its_uncertainty() -> None:
    found = told(4, {})
    suspicion, plain_kg = suspicion_of(found), found.plain.mass_kg(found.mechanisms[0].name)
    moved, variance = suspicion.moved(0)
    assert found.mass.mass_kg == pytest.approx(plain_kg[0] * (1.0 + moved), rel=1e-12)
    assert math.hypot(*(row.u_kg for row in found.budget)) == pytest.approx(found.mass.u_kg, rel=1e-9)
    assert found.budget[-1].u_kg == pytest.approx(plain_kg[0] * math.sqrt(variance), rel=1e-12)


def test_a_fit_with_the_shape_finds_the_size_and_moves_the_mass_as_the_score_says() -> None:
    shots = campaign_of(RING, seed=5, unread=1.0, suspected={BENT: 0.006}).shots
    rows = JointRows.of(shots, mechanisms_of(shots))
    plain = joint_fit_under(rows, Scatter(3e-4, 0.02))
    alone = replace(plain, trials=plain.trials[:1], weights=np.ones(1))
    suspicion = shared_suspicion(alone)
    assert suspicion is not None
    at = suspicion.likeliest
    assert suspicion.shapes[at].name == BENT
    with_it = joint_fit_under(rows.with_columns([suspicion.column(len(shots))]), Scatter(3e-4, 0.02)).trials[0]
    free = suspicion.hypotheses[0]
    # the prior of the size shrinks it by its share of the information
    shrunk = with_it.values[BENT] * (1.0 - free.variances[at] / SUSPECTS[0].u ** 2)
    assert free.sizes[at] == pytest.approx(shrunk, rel=0.05)
    moved = with_it.values[rows.masses[0]] - plain.trials[0].values[rows.masses[0]]
    assert suspicion.by[0, 0, at] * with_it.values[BENT] == pytest.approx(moved, rel=0.1)


def test_what_is_suspected_goes_through_a_report_and_back() -> None:
    for one in SUSPECTS:
        assert Suspected.of_json(json.loads(json.dumps(one.to_json()))) == one
    assert Suspected.of_json(None) is None
    with pytest.raises(ValueError, match="of a size of -1"):
        Suspected.of_json({**SUSPECTS[0].to_json(), "u": -1.0})
    with pytest.raises(ValueError, match="a suspected 'ghost', of no kind that is known"):
        Suspected.of_json({**SUSPECTS[0].to_json(), "kind": "ghost"})
    assert Parameter("a").suspected is None
