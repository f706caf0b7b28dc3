"""A campaign's answer: one mass, what was set aside and why, and what cannot be combined at all."""

from __future__ import annotations

import contextlib
import copy
import csv
import io
import itertools
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm, t

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.remark import ReasonCode
from recoil_identification.campaign.campaign import Campaign, Estimated, Learnt
from recoil_identification.campaign.campaign_shot import CampaignShot, in_order
from recoil_identification.campaign.combination import combine, contradictions, without_consequence
from recoil_identification.campaign.influence import Influence
from recoil_identification.report.content import campaign_tables
from recoil_identification.report.document.campaign_document import campaign_document, campaign_table
from recoil_identification.shot.shared_identity import source_of
from recoil_identification.shot.shot_summary import ShotSummary
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.tables.specification import Specification
from tests.builders.campaign_summaries import BREECH as OF_BREECH
from tests.builders.campaign_summaries import FRICTION, MASS_KG, campaign_of

WEIGHED = campaign_of((0.0, 120.0) * 4, seed=4).shots


def answer(shots: tuple[CampaignShot, ...]) -> dict[str, Any]:
    return document_of(combine(shots))


def document_of(found: Campaign) -> dict[str, Any]:
    return campaign_document(found, version="1", inputs=[], parameters={})


def report_of(shot: CampaignShot) -> dict[str, Any]:
    assert shot.summary is not None
    return {
        "shot": shot.name,
        "rig": shot.rig,
        "started": shot.started,
        "mass": {"value": shot.mass_kg, "u": shot.u_kg},
        "valid": shot.valid,
        "reasons": list(shot.reasons),
        "campaign": shot.summary.to_json(cutoff_hz=300.0, zero_shift=False),
        "shot_log": {"added_mass_kg": shot.added_mass_kg, "u_added_mass_kg": shot.u_added_mass_kg},
    }


def test_the_mass_is_that_of_the_mechanism_without_what_was_added() -> None:
    found = combine(WEIGHED)
    assert abs(found.mass.mass_kg - MASS_KG) < 2.5 * found.mass.u_kg
    assert found.mass.u_kg < 0.003 * MASS_KG
    assert found.valid
    low, high = found.mass.interval_kg
    assert high - low == pytest.approx(2 * 1.96 * found.mass.u_kg, rel=1e-3)


@pytest.mark.whole_way
def test_an_added_mass_of_the_wrong_sign_is_the_first_reason() -> None:
    wrong = tuple(replace(one, added_mass_kg=-120.0) if one.name == "0002" else one for one in WEIGHED)
    found = combine(wrong)
    assert found.reasons[0] == (
        "shot 0002: is the sign of its added mass right? With +120 kg instead of -120 kg it agrees with the others; "
        "correct `added_mass_kg` in the shot log"
    )
    assert not any("sign" in reason for reason in combine(WEIGHED).reasons)


@pytest.mark.whole_way
def test_any_order_of_shots_gives_the_same_digits() -> None:
    whole = json.dumps(answer(WEIGHED))
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(WEIGHED))
        assert json.dumps(answer(tuple(WEIGHED[at] for at in order))) == whole


def test_shots_are_in_the_order_in_which_they_were_fired() -> None:
    names = [shot.name for shot in in_order([replace(WEIGHED[0], name=name) for name in ("10", "9", "a2", "a10", "1")])]
    assert names == ["1", "9", "10", "a2", "a10"]
    timed = [replace(WEIGHED[0], name=name, started=f"2026-11-0{day}T08:00:00") for name, day in (("1", 3), ("2", 1))]
    assert [shot.name for shot in in_order(timed)] == ["2", "1"]


@pytest.mark.whole_way
def test_a_shot_that_is_set_aside_is_listed_with_its_reason_and_counts_nothing() -> None:
    summary = WEIGHED[2].summary
    assert summary is not None
    shots = list(WEIGHED)
    shots[0] = replace(shots[0], excluded="warm-up round")
    shots[2] = replace(shots[2], summary=replace(summary, against=("clipped",)))
    shots[3] = replace(shots[3], summary=None)
    document = answer(tuple(shots))
    aside = {one["shot"]: one["excluded"] for one in document["shots"] if one["excluded"]}
    assert aside == {
        "0001": "excluded in the shot log: warm-up round",
        "0003": "clipped",
        "0004": "its report has no summary for campaigns",
    }
    alone = answer(tuple(one for one in shots if not one.set_aside))
    assert document["mass"] == alone["mass"]


def test_what_the_campaign_learnt_of_a_sensor_is_never_less_than_was_known() -> None:
    for one in combine(WEIGHED).common:
        assert one.u <= one.influence.u * 1.0001
        assert abs(one.value) < 4 * one.influence.u


@pytest.mark.whole_way
def test_a_step_that_nobody_declared_makes_the_mass_not_valid_and_a_drift_does_not() -> None:
    stepped = combine(campaign_of((0.0, 120.0) * 4, seed=4, step_kg={4: -6.0}).shots)
    assert not stepped.valid
    assert "from shot 0005 on" in stepped.reasons[0]
    drifting = {(i, "ln breech_pressure"): 0.01 * i / 7 for i in range(8)}
    drifted = combine(campaign_of((0.0, 120.0) * 4, seed=4, moved=drifting).shots)
    assert drifted.valid
    assert drifted.changes[0].kind == "sensor drift"


def test_configurations_with_other_parts_have_masses_of_their_own_and_a_difference() -> None:
    names = ["before"] * 4 + ["after"] * 4
    document = answer(campaign_of((0.0,) * 8, seed=3, step_kg={4: -6.0}, configurations=names).shots)
    first, second = document["configurations"]
    assert (first["name"], second["name"]) == ("before", "after")
    assert first["difference"] is None
    assert abs(second["difference"]["value"] + 6.0) < 3 * second["difference"]["u"]
    assert second["difference"]["u"] < 0.4
    assert document["mass"]["value"] == first["mass"]["value"]
    assert document["signals"] == []
    assert any("each has a mass of its own" in note for note in document["notes"])


@pytest.mark.whole_way
def test_certificates_that_all_shots_contradict_are_named() -> None:
    wrong = {(i, "ln brake_pressure"): 0.03 for i in range(8)}
    found = combine(campaign_of((0.0, 120.0) * 4, seed=4, moved=wrong).shots)
    assert not found.valid
    assert found.reasons[0].startswith("brake_pressure scale, sensor 2 is off by +")


def learnt(identity: str, u: float, off: float, residual: float) -> Learnt:
    return Learnt(Influence(identity, source_of(identity), u), off * u, u, residual)


BREECH, SHARE = ("sensor:breech_pressure:4711", 0.005, -2.0), ("rig:mixed:unread_share", 0.01, 1.5)
BRAKE = ("sensor:brake_pressure:4712", 0.004, 9.0, 8.0)


@pytest.mark.parametrize(("of_breech", "of_share", "first"), [(-3.9, 3.8, "breech"), (-3.1, 3.5, "share")])
def test_a_breech_gauge_and_unread_resistance_are_named_together(of_breech, of_share, first) -> None:
    (one,) = contradictions([learnt(*SHARE, of_share), learnt(*BREECH, of_breech), learnt(*BRAKE[:3], 0.5)])
    assert one.startswith("breech_pressure scale" if first == "breech" else "share of the resistance")
    assert "breech_pressure scale, sensor 4711" in one
    assert "share of the resistance that no gauge reads" in one
    assert "brake" not in one


def test_another_gauge_that_is_off_is_named_by_itself() -> None:
    (one,) = contradictions([learnt(*SHARE, 1.0), learnt(*BREECH, -1.0), learnt(*BRAKE)])
    assert one.about == "brake_pressure scale, sensor 4712"
    assert "share" not in one


def test_by_how_much_a_gauge_is_off_is_told_as_if_nothing_had_been_stated_of_it() -> None:
    # a certificate of .4 % holds it at -.82 of its u; the rest alone says -16.7 of them
    brake = Learnt(Influence(BRAKE[0], source_of(BRAKE[0]), 0.004), -0.82 * 0.004, 0.00391, -3.7, moves_kg=9.2)
    (one,) = contradictions([brake])
    assert "it is off by -16.7 of its standard uncertainties (-6.7 %) if they are right" in one
    assert one.endswith("without what is known of it the mass changes by +9.2 kg")


MASS = Estimated(788.0, 5.0)


def test_what_is_contradicted_speaks_against_the_mass_only_if_it_moves_it() -> None:
    def late(moves_kg: float, identity: str = "rig:mixed:recuperator_pressure delay") -> Learnt:
        return Learnt(Influence(identity, source_of(identity), 2e-5, "s"), 4.8e-6, 1.99e-5, 4.24, moves_kg)

    assert without_consequence([late(2.4)], MASS)
    assert not without_consequence([late(2.6)], MASS)
    # each alone would not, both together do
    assert not without_consequence([late(2.4), late(-2.4, "rig:mixed:friction")], MASS)
    # a certificate is one, and what drives is the mass's own scale
    assert not without_consequence([late(0.1, BRAKE[0])], MASS)
    assert not without_consequence([late(0.1, SHARE[0])], MASS)


def test_a_line_that_is_found_early_is_contradicted_by_what_all_else_says_against_no_delay() -> None:
    def found(name: str, ms: float) -> Learnt:
        # the rest says 1.25 times as much, with u of 0.9 ms / 0.89
        identity = f"rig:mixed:recuperator_pressure {name}"
        w = ms / 2.0 / math.sqrt(1.0 - 0.45**2)
        return Learnt(Influence(identity, source_of(identity), 0.002, "s"), 1e-3 * ms, 0.0009, w, moves_kg=3.0)

    (one,) = contradictions([found("delay of its line", -3.2)])
    assert one.about == "recuperator_pressure delay of its line"
    assert ", early, which no line and no orifice makes it (normalised residual 4.0, limit 3.29)" in one
    assert not contradictions([found("delay of its line", 3.2)])
    assert not contradictions([found("delay", -3.2)])  # of a chain nothing is said of the sign


@pytest.mark.whole_way
def test_what_the_mass_moves_by_without_a_certificate_is_what_a_fit_without_it_finds() -> None:
    moved = {(i, "ln brake_pressure"): 0.012 for i in range(8)}
    shots = campaign_of((0.0, 310.0) * 4, seed=4, moved=moved).shots
    found = combine(shots)
    (brake,) = [one for one in found.common if one.influence.source.of == "brake_pressure"]
    forgotten = combine([_with_wide(shot, "brake_pressure") for shot in shots])
    # to first order, under the likeliest scatter
    moved_kg = forgotten.mass.mass_kg - found.mass.mass_kg
    assert brake.moves_kg == pytest.approx(moved_kg, rel=0.35)
    (wide,) = [one for one in forgotten.common if one.influence.source.of == "brake_pressure"]
    assert brake.alone * brake.influence.u == pytest.approx(wide.value, rel=0.05)


def _with_wide(shot: CampaignShot, role: str) -> CampaignShot:
    """State nothing of a sensor."""
    parameters = tuple(
        replace(one, influences=tuple((name, 1e3 * u if role in name else u) for name, u in one.influences))
        for one in shot.summary.parameters
    )
    return replace(shot, summary=replace(shot.summary, parameters=parameters))


@pytest.mark.whole_way
def test_what_stands_in_a_shot_where_its_rows_say_nothing_is_no_disagreement() -> None:
    shots = campaign_of((0.0, 120.0) * 4, seed=4).shots
    assert combine(shots).valid
    loud = []
    for shot in shots:
        assert shot.summary is not None
        triangle, seen = shot.summary.triangle.copy(), shot.summary.seen.copy()
        # the last parameter is told by no row, and what rounding left stands beside it
        triangle[:, -1], triangle[-1, :], seen[-1] = 0.0, 0.0, 40.0
        loud.append(replace(shot, summary=replace(shot.summary, triangle=triangle, seen=seen)))
    assert combine(loud).valid


@pytest.mark.whole_way
def test_shots_that_do_not_agree_are_said_to_even_if_no_column_explains_it() -> None:
    rng = np.random.default_rng(0)
    wild = {(i, f"ln {role}_pressure"): 0.03 * rng.standard_normal() for i in range(8) for role in ("breech", "brake")}
    found = combine(campaign_of((0.0, 120.0) * 4, seed=4, moved=wild).shots)
    assert not found.valid
    assert any(reason.code == ReasonCode.AGREEMENT for reason in found.reasons)


def test_an_added_mass_without_an_uncertainty_is_taken_as_exact_and_said_so() -> None:
    found = combine(tuple(replace(shot, u_added_mass_kg=0.0) for shot in WEIGHED))
    assert any("120 kg is taken as exact" in note for note in found.notes)


def test_a_campaign_with_nothing_bare_says_so() -> None:
    found = combine(campaign_of((120.0,) * 4, seed=4).shots)
    assert any("every shot carries an added mass" in note for note in found.notes)
    assert abs(found.mass.mass_kg - MASS_KG) < 2.5 * found.mass.u_kg


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda shots: shots[:1], "at least two shots"),
        (lambda shots: shots[:0], "at least two shots"),
        (lambda shots: (*shots, shots[0]), "two reports of one shot"),
        (lambda shots: (*shots[:-1], replace(shots[-1], rig="other")), "a campaign is of one rig"),
        (lambda shots: (*shots[:-1], replace(shots[-1], cutoff_hz=100.0)), "filtered alike"),
        (lambda shots: tuple(replace(shot, excluded="no") for shot in shots), "at least two shots"),
    ],
)
def test_shots_that_cannot_be_combined_are_refused(
    change: Callable[[tuple[CampaignShot, ...]], tuple[CampaignShot, ...]], said: str
) -> None:
    with pytest.raises(IdentificationError, match=said):
        combine(change(WEIGHED))


def test_shots_of_two_geometries_are_refused_with_what_differs() -> None:
    shots = []
    for i, shot in enumerate(WEIGHED):
        assert shot.summary is not None
        shots.append(replace(shot, summary=replace(shot.summary, geometry={"bore_area": 0.01 if i == 5 else 0.009})))
    with pytest.raises(IdentificationError, match=r"shot 0006 with bore_area 0\.009 and 0\.01"):
        combine(tuple(shots))


def test_what_a_shot_does_not_state_of_the_geometry_is_not_compared() -> None:
    stated = [{"bore_area": 0.009}, {"bore_area": 0.009, "m1": 1450.0}, {}, {"m1": 1450.0}, {"bore_area": 0.009}]
    shots = []
    for shot, geometry in zip(WEIGHED, stated, strict=False):
        assert shot.summary is not None
        shots.append(replace(shot, summary=replace(shot.summary, geometry=geometry)))
    assert len(combine(shots).shots) == len(stated)
    shots[3] = replace(shots[3], summary=replace(shots[3].summary, geometry={"m1": 1451.0}))
    with pytest.raises(IdentificationError, match=r"of shot 0002, found shot 0004 with m1 1450\.0 and 1451\.0"):
        combine(shots)


def against(shots: Sequence[CampaignShot], *specifications: tuple[float, float] | None) -> tuple[CampaignShot, ...]:
    """State what the rigs of shots compare with, one after the other."""
    stated = itertools.cycle(specifications)
    return tuple(
        shot if one is None else replace(shot, specification=Specification(*one))
        for shot, one in zip(shots, stated, strict=False)
    )


@pytest.mark.whole_way
def test_the_mass_stands_beside_the_specification_without_what_was_added() -> None:
    document = answer(against(WEIGHED, (900.0, 2.5)))
    mass = document["mass"]
    assert (mass["specification"], mass["u_specification"]) == (900.0, 2.5)
    assert mass["U_kg"] == pytest.approx((mass["U95"][1] - mass["U95"][0]) / 2, rel=1e-12)
    assert mass["deviation_kg"] == mass["value"] - 900.0
    assert mass["deviation_percent"] == pytest.approx(100 * (mass["value"] - 900.0) / 900.0, rel=1e-9)
    expected = (mass["value"] - 900.0) / (2 * math.sqrt(mass["u"] ** 2 + 2.5**2))
    assert mass["E_n"] == pytest.approx(expected, rel=1e-12)
    assert mass["value"] == answer(WEIGHED)["mass"]["value"]


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("specifications", "said"),
    [
        (((900.0, 0.0), (905.0, 0.0)), "state several specification masses, 900 kg, 905 kg"),
        (((900.0, 0.0), None), "do not all state the specification"),
    ],
)
def test_a_specification_that_the_shots_do_not_agree_on_is_none(
    specifications: tuple[tuple[float, float] | None, ...], said: str
) -> None:
    document = answer(against(WEIGHED, *specifications))
    assert [document["mass"][key] for key in ("specification", "deviation_kg", "E_n")] == [None] * 3
    assert [note for note in document["notes"] if said in note]


def test_the_specification_of_a_report_is_taken_without_what_its_log_added() -> None:
    document = report_of(WEIGHED[1])
    document["mass"] |= {"specification": 782.0 + 120.0, "u_specification": math.hypot(1.5, 0.05)}
    document["shot_log"] = {"added_mass_kg": 120.0, "u_added_mass_kg": 0.05}
    shot = CampaignShot.of_report(document)
    assert shot.specification == Specification(782.0, 1.5)
    # oil and rods of the rig file are in it, and stay
    document["mass"] |= {"specification": 782.0 + 120.0 + 6.0, "u_specification": math.hypot(1.5, 0.05, 0.9)}
    document["mass"]["specification_of"] = Specification(782.0, 1.5, 120.0, 0.05, 6.0, 0.9).to_json()
    shot = CampaignShot.of_report(document)
    assert shot.specification == Specification(782.0, 1.5, carried_kg=6.0, u_carried_kg=0.9)
    document["mass"]["specification_of"]["carried_mass_kg"] = -1.0
    with pytest.raises(ValueError, match="carried along"):
        CampaignShot.of_report(document)
    document["mass"]["specification"] = -1.0
    with pytest.raises(ValueError, match="a specification of"):
        CampaignShot.of_report(document)


def test_a_campaign_says_what_mass_it_is_and_of_what_its_specification_consists() -> None:
    of = Specification(894.0, 0.0, carried_kg=6.0, u_carried_kg=1.5)
    document = answer(tuple(replace(shot, specification=of) for shot in WEIGHED))
    mass = document["mass"]
    assert document["measurand"].startswith("the mass that the forces move")
    assert (mass["specification"], mass["u_specification"]) == (900.0, 1.5)
    assert mass["specification_of"] == of.to_json()
    expected = (mass["value"] - 900.0) / (2 * math.sqrt(mass["u"] ** 2 + 1.5**2))
    assert mass["E_n"] == pytest.approx(expected, rel=1e-12)
    facts = dict(campaign_tables.facts(document))
    assert facts["specification"] == "m3 894 kg + 6 kg (u 1.5 kg) of oil and rods that go along, nothing added"
    assert facts["standard uncertainty by groups"].startswith("u 0.")
    assert sum(row["u_kg"] ** 2 for row in document["budget"]) == pytest.approx(mass["u"] ** 2)


@pytest.mark.whole_way
def test_a_shot_that_is_not_valid_by_itself_is_used_and_said_to_be() -> None:
    reason = "breech_pressure reads high"
    shots = [replace(WEIGHED[0], valid=False, reasons=(reason,)), *WEIGHED[1:]]
    shots[2] = replace(shots[2], valid=False, reasons=(reason,), excluded="wet powder")
    document = answer(tuple(shots))
    first, second, third = document["shots"][:3]
    assert (first["valid"], first["reasons"], first["excluded"]) == (False, [reason], None)
    assert first["use"].startswith("used: what speaks against it alone, all shots together judge better")
    assert (second["valid"], second["reasons"], second["use"]) == (True, [], None)
    assert (third["valid"], third["use"], third["excluded"]) == (False, None, "excluded in the shot log: wet powder")
    rows = list(csv.DictReader(io.StringIO(campaign_table(document))))
    assert [row["valid"] for row in rows[:3]] == ["false", "true", "false"]
    assert [row["reasons"] for row in rows[:3]] == [reason, "", reason]
    assert rows[0]["use"] == first["use"]
    table = campaign_tables.SHOTS.worded(document)
    assert [row["valid"] for row in table[:3]] == ["not valid", "valid", "not valid"]
    assert reason in table[0]["remarks"]


def test_a_report_comes_back_as_the_shot_that_it_is_of() -> None:
    shot = WEIGHED[1]
    again = CampaignShot.of_report(json.loads(json.dumps(report_of(shot))))
    assert (again.name, again.added_mass_kg, again.cutoff_hz) == ("0002", 120.0, 300.0)
    assert isinstance(again.summary, ShotSummary)
    assert isinstance(shot.summary, ShotSummary)
    assert again.summary.parameters == shot.summary.parameters
    assert np.array_equal(again.summary.triangle, shot.summary.triangle)


def test_a_campaign_names_the_shots_that_are_by_a_preview() -> None:
    live = {"code": "preview", "about": "dewetron", "severity": "warn", "text": "what was read live is a preview"}
    by_preview = [report_of(shot) | ({"findings": [live]} if i in (1, 3) else {}) for i, shot in enumerate(WEIGHED)]
    document = answer(tuple(map(CampaignShot.of_report, by_preview)))
    (note,) = (one for one in document["findings"] if one["code"] == "preview")
    assert note["about"] == "dewetron"
    assert "of dewetron, in shot 0002, 0004:" in note["text"]
    assert note["text"] in document["notes"]
    assert not [one for one in answer(WEIGHED)["findings"] if one["code"] == "preview"]


@pytest.mark.parametrize(
    "changes",
    [
        {"started": 7}, {"started": ["x"]}, {"peaks": {"recoil_time_s": "nan"}}, {"peaks": {"recoil_time_s": 10**400}},
        {"mass": {"value": 782.0, "u": 10**400}}, {"campaign": {"cutoff_hz": "x"}},
    ],
    ids=lambda changes: str(changes)[:40],
)  # fmt: skip
def test_a_report_with_something_else_where_a_number_belongs_is_refused(changes: dict[str, Any]) -> None:
    document = report_of(WEIGHED[1])
    if "campaign" in changes:
        changes = {"campaign": document["campaign"] | changes["campaign"]}
    with pytest.raises(ValueError, match=r"it (is no report|started at|has a peak)"):
        CampaignShot.of_report(document | changes)


@pytest.mark.whole_way
@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_report_is_refused_and_nothing_else(data: st.DataObject) -> None:
    document = copy.deepcopy(report_of(WEIGHED[1]))
    place: Any = document
    for _ in range(data.draw(st.integers(0, 3))):
        keys = list(place) if isinstance(place, dict) else list(range(len(place))) if isinstance(place, list) else []
        inner = [key for key in keys if isinstance(place[key], (dict, list)) and place[key]]
        if not inner:
            break
        place = place[data.draw(st.sampled_from(inner))]
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    key = data.draw(st.sampled_from(keys))
    place[key] = data.draw(
        st.sampled_from([None, "x", -1.0, 1e400, 1e308, 10**300, [], {}, True, [[1.0]], {"name": 3}])
    )
    with contextlib.suppress(ValueError):
        CampaignShot.of_report(document)


def test_the_table_has_a_row_a_shot_and_reads_as_a_spreadsheet_does() -> None:
    lines = campaign_table(answer(WEIGHED)).splitlines()
    assert len(lines) == 1 + len(WEIGHED)
    assert lines[0].startswith("shot,started,configuration,added_mass_kg,mass_kg,u_kg,joint_mass_kg,own_u_kg")
    assert all(line.count(",") == lines[0].count(",") for line in lines)


def test_identities_are_labelled_for_people() -> None:
    assert source_of("sensor:breech_pressure:4711:2026-03-01") == "breech_pressure scale, sensor 4711"
    assert source_of("sensor:brake_pressure:mixed/p_brake") == "brake_pressure scale, sensor mixed/p_brake"
    assert source_of("rig:mixed:bore_area") == "bore_area"
    assert source_of("standard:deadweight-7") == "standard deadweight-7"


def weighed(u: float, off: float, residual: float) -> Learnt:
    source = ErrorSource(SourceKind.ADDED_MASS, detail="310 kg")
    # what was weighed so well hardly moves
    return Learnt(Influence(source, source, 0.05, "kg"), off, u, residual)


@pytest.mark.parametrize(
    ("of_breech", "first", "code"),
    [
        ((-0.0098, 0.00411, -3.27), "breech_pressure scale", ReasonCode.SENSOR),
        ((-0.0008, 0.0049, -0.8), "added mass of 310 kg", ReasonCode.ADDED_MASS),
    ],
)
def test_a_weight_that_contradicts_the_sensors_is_blamed_only_if_no_gauge_is_likelier(of_breech, first, code) -> None:
    value, u, residual = of_breech
    breech = Learnt(Influence(BREECH[0], source_of(BREECH[0]), 0.005), value, u, residual)
    (one,) = contradictions([breech], [weighed(0.0499870, -0.0043, -3.49)])
    assert one.startswith(f"{first}")
    assert one.code is code
    assert "added mass of 310 kg" in one
    assert "(normalised residual 3.5, limit 3.29)" in one


def test_a_weight_that_agrees_is_not_spoken_of() -> None:
    (one,) = contradictions([learnt(*BREECH, -3.9)], [weighed(0.049987, 0.0, 0.1)])
    assert "added mass" not in one
    assert contradictions([learnt(*BREECH, 0.3)], [weighed(0.049987, 0.0, 0.1)]) == []


@pytest.mark.whole_way
@pytest.mark.parametrize("written_kg", [310.0, 311.0])
def test_a_breech_gauge_that_reads_low_is_named_and_not_the_mass_that_was_weighed(written_kg: float) -> None:
    low = {(i, "ln breech_pressure"): -0.03 for i in range(4)}
    drawn = campaign_of((0.0, 310.0) * 2, seed=4, moved=low).shots
    found = combine([replace(one, added_mass_kg=written_kg if one.added_mass_kg else 0.0) for one in drawn])
    assert not found.valid
    assert found.reasons[0].about == "breech_pressure scale, sensor 1"
    assert [one.code for one in found.reasons if one.code is ReasonCode.ADDED_MASS] == []


def guessed(shots: tuple[CampaignShot, ...], freedom: dict[str, float]) -> tuple[CampaignShot, ...]:
    told = [replace(one.summary, degrees_of_freedom=freedom) for one in shots if one.summary is not None]
    return tuple(replace(one, summary=summary) for one, summary in zip(shots, told, strict=True))


def test_a_guess_widens_the_interval_of_many_shots_by_students_factor_and_what_is_random_does_not() -> None:
    shots = campaign_of((0.0,) * 6, seed=5, gain_rel=1e-3).shots
    known, guess = combine(shots), combine(guessed(shots, {OF_BREECH: 8.0, FRICTION: 20.0}))
    assert guess.mass.mass_kg == known.mass.mass_kg
    assert guess.mass.u_kg == known.mass.u_kg
    assert known.mass.coverage_factor == pytest.approx(norm.ppf(0.975))
    rows = {str(row.source): row for row in guess.budget}
    breech, friction = rows["breech_pressure scale, sensor 1"], rows["packing friction"]
    assert [breech.degrees_of_freedom, friction.degrees_of_freedom] == [8.0, 20.0]
    assert math.isfinite(rows["random errors of the shots"].degrees_of_freedom)
    nu = guess.mass.u_kg**4 / (breech.u_kg**4 / 8.0 + friction.u_kg**4 / 20.0)
    assert guess.degrees_of_freedom == pytest.approx(nu)
    assert guess.mass.coverage_factor == pytest.approx(t.ppf(0.975, nu))
    assert guess.mass.coverage_factor > known.mass.coverage_factor + 2e-3
    document = document_of(guess)
    assert document["uncertainty"]["coverage_factor"] == guess.mass.coverage_factor
    assert document["mass"]["U_kg"] == guess.mass.coverage_factor * guess.mass.u_kg
    assert document["mass"]["U95"][1] - document["mass"]["value"] == pytest.approx(document["mass"]["U_kg"])
    assert "guess" in campaign_tables.coverage(document)[0]
    assert "guess" not in campaign_tables.coverage(document_of(known))[0]


def test_of_shots_that_state_it_otherwise_the_least_known_uncertainty_counts() -> None:
    shots = campaign_of((0.0,) * 4, seed=5).shots
    mixed = (*guessed(shots[:2], {OF_BREECH: 8.0}), *guessed(shots[2:], {OF_BREECH: 50.0}))
    found = combine(mixed)
    assert {row.degrees_of_freedom for row in found.budget if "breech" in str(row.source)} == {8.0}
