"""Shots with two weights hand back how each gauge reads in them, whatever its certificate says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.remark import NoteCode
from recoil_identification.campaign.campaign import Campaign
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import combine
from recoil_identification.report.content import campaign_tables
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.sections import CAMPAIGN_SECTIONS
from tests.builders.campaign_summaries import BRAKE, BREECH, MASS_KG, RECUPERATOR, at_rest, campaign_of
from tests.builders.planted_changes import moved

WEIGHED, PLAIN = (0.0, 310.0) * 4, (0.0,) * 8
BORE = "rig:made up:bore_friction"


def reading(shots: Sequence[CampaignShot], by: float) -> list[CampaignShot]:
    """Let the breech gauge read its force by so much too large in all shots."""
    return [moved(one, "ln breech_pressure", by) for one in shots]


@cache
def off_by(percent: float, added_kg: tuple[float, ...] = WEIGHED, seed: int = 7) -> Campaign:
    return combine(at_rest(reading(campaign_of(added_kg, seed=seed, unread=1.0).shots, 0.01 * percent)))


@pytest.mark.whole_way
def test_the_scale_of_each_gauge_is_told_as_well_as_is_said() -> None:
    z = []
    for seed in range(20):
        drawn = campaign_of((0.0, 310.0) * 2, seed=seed)
        found = combine(drawn.shots)
        for one, identity in zip(found.gauges, (BREECH, BRAKE, RECUPERATOR), strict=True):
            assert (one.force, one.sensors) == (identity.split(":")[1], identity.split(":")[2])
            assert (one.value, one.u, one.beside) == (one.gauge, one.u_gauge, ())
            z.append((one.value - drawn.errors[identity]) / one.u)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.25)
    assert np.mean(np.abs(z) < 1.96) >= 0.9


def test_a_breech_gauge_that_reads_low_is_handed_back_with_the_mass_by_the_weight() -> None:
    found = off_by(-1.5)
    breech, *others = found.gauges
    assert abs(found.mass.mass_kg - MASS_KG) < 2.0 * found.mass.u_kg
    assert found.valid
    sound = off_by(0.0).gauges[0]
    assert breech.value - sound.value == pytest.approx(-0.015, abs=0.005)  # the rest is what was known
    assert breech.known_u == pytest.approx(0.005 * 2**0.5)
    assert breech.is_told
    assert not any(one.is_told for one in (sound, *others))
    (note,) = [one for one in found.notes if one.code is NoteCode.GAUGE_SCALE]
    assert note.about == "breech_pressure"
    assert note.startswith(f"breech_pressure, sensor 1, reads {-100 * breech.value:.2f} % too little of its force")


def test_on_a_plain_day_a_scale_is_known_by_its_certificate_alone_and_nothing_is_said() -> None:
    found = off_by(-1.5, PLAIN)
    assert found.gauges[0].u > 0.8 * found.gauges[0].known_u
    assert not [one for one in found.notes if one.code is NoteCode.GAUGE_SCALE]


def test_what_turns_a_reading_into_a_force_is_in_it_and_the_gauges_part_is_told_apart() -> None:
    shots = at_rest(reading(campaign_of(WEIGHED, seed=7, unread=1.0).shots, -0.015), **{BORE: 0.006})
    breech = combine(shots).gauges[0]
    assert breech.beside == ("bore_friction",)
    assert breech.value == pytest.approx(off_by(-1.5).gauges[0].value, abs=0.003)
    # of the bore no more is told than what was stated of it
    assert breech.gauge == pytest.approx(breech.value, rel=0.01)
    assert breech.u_gauge == pytest.approx(np.hypot(breech.u, 0.006), rel=0.1)


def test_a_gauge_that_was_exchanged_has_a_scale_of_its_own() -> None:
    def with_sensor_9(shot: CampaignShot) -> CampaignShot:
        assert shot.summary is not None
        of = "breech_pressure"
        parameters = tuple(
            replace(one, influences=tuple((name.replace(f"{of}:1", f"{of}:9"), u) for name, u in one.influences))
            for one in shot.summary.parameters
        )
        return replace(shot, summary=replace(shot.summary, parameters=parameters))

    shots = at_rest(campaign_of(WEIGHED, seed=3).shots)
    other = [with_sensor_9(one) for one in shots[4:]]
    sensors = [one.sensors for one in combine([*shots[:4], *other]).gauges if one.force == "breech_pressure"]
    assert sensors == ["1", "9"]


def test_the_answer_and_its_page_have_a_row_for_each_gauge() -> None:
    found = off_by(-1.5)
    document = campaign_document(found, version="1", inputs=[], parameters={})
    row, breech = document["gauges"][0], found.gauges[0]
    assert (row["force"], row["sensors"], row["told"]) == ("breech_pressure", "1", True)
    assert (row["value"], row["u"], row["gauge"]) == (
        breech.value,
        breech.u,
        {"value": breech.gauge, "u": breech.u_gauge},
    )
    assert row["U95"][0] < row["value"] < row["U95"][1] < 0.0
    rows = campaign_tables.gauges(document)
    assert [one["gauge"] for one in rows] == [
        "breech_pressure, sensor 1", "brake_pressure, sensor 2", "recuperator_pressure, sensor 3",
    ]  # fmt: skip
    (section,) = [one for one in CAMPAIGN_SECTIONS if one.key == "gauges"]
    assert {one.key for one in section.columns} == rows[0].keys()
    assert campaign_tables.gauges({key: value for key, value in document.items() if key != "gauges"}) == []


def test_the_mass_is_by_the_weight_and_a_certificate_that_is_off_does_not_draw_it_to_itself() -> None:
    masses = [off_by(percent).mass for percent in (-1.5, 0.0, 1.5)]
    low, sound, high = (one.mass_kg for one in masses)
    assert abs(low - sound) < 0.1 * masses[1].u_kg
    assert abs(high - sound) < 0.1 * masses[1].u_kg
    (said,) = [one for one in off_by(-1.5).notes if "by the weight of 310 kg" in one]
    assert "what was stated of breech_pressure scale, sensor 1 is not used; with it the mass is" in said


def test_a_certificate_is_used_where_there_is_one_weight_or_too_light_a_one() -> None:
    for added_kg in (PLAIN, (310.0,) * 8, (0.0, 8.0) * 4):
        found = off_by(-1.5, added_kg)
        assert found.fit.rows.forgotten == frozenset()
        assert not any("by the weight" in one for one in found.notes)
    assert off_by(-1.5).fit.rows.forgotten == {BREECH}


def test_the_budget_has_nothing_of_a_certificate_that_is_not_used() -> None:
    found = off_by(0.0)
    rows = {row.source: row.u_kg for row in found.budget}
    assert rows["breech_pressure scale, sensor 1"] < 0.05 * found.mass.u_kg
    assert np.hypot.reduce(list(rows.values())) == pytest.approx(found.mass.u_kg)


def test_a_gauge_that_is_off_beyond_its_certificate_is_named_with_the_weight_that_looks_the_same() -> None:
    found = off_by(-6.0)
    (reason,) = found.reasons
    assert reason.startswith("breech_pressure scale, sensor 1 is off by -")
    assert reason.endswith("goes with it, and what 310 kg really weigh")
    assert found.mass.mass_kg == pytest.approx(off_by(0.0).mass.mass_kg, abs=0.1 * found.mass.u_kg)
    assert found.gauges[0].value == pytest.approx(off_by(0.0).gauges[0].value - 0.06, abs=0.003)
    assert "really weigh" not in " ".join(combine(reading(campaign_of(PLAIN, seed=7).shots, -0.05)).reasons)
