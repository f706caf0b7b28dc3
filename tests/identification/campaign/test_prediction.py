"""What is predicted of a campaign: laws, closed forms, and what the virtual rig's shots of another mass tell."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.changes import candidates_of, least_gain
from recoil_identification.campaign.joint_fit import joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.prediction import (
    NominalShot,
    Plan,
    found_by,
    predicted_fit,
    predicted_u_rel,
    what_ifs,
)
from recoil_identification.shot.shot_summary import Parameter, ShotSummary
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.shots.stated_uncertainty import with_uncertainties
from tests.builders.campaign_summaries import MASS_KG, rows_of_shot, summary_of
from tests.builders.virtual_shots import identified, virtual_shot

NOTHING = Scatter()
KEYS = ("p_breech.u_rel", "p_brake.u_rel", "p_recuperator.u_rel", "acc_recoil.u_rel", "u_friction")


def made_up(charge: float = 1.0) -> NominalShot:
    """A shot that tells the forces apart, with the certificates of a bundled rig."""
    summary = summary_of(rows_of_shot(charge), np.zeros(6), np.random.default_rng(0))
    return NominalShot.of(MASS_KG, 0.0, summary).known_by(load_rig("field-2013"))


def of_one_row(scatter: float, **u: float) -> NominalShot:
    """A shot that tells nothing but the mass over all scales together, to a given share."""
    row = np.array([1.0, *[-1.0] * len(u)]) / scatter
    triangle = np.zeros((row.size, row.size))
    triangle[0] = row
    parameters = (Parameter("ln mass"), *(Parameter(f"ln {name}", ((name, one),)) for name, one in u.items()))
    return NominalShot.of(MASS_KG, 0.0, ShotSummary(parameters, np.zeros(row.size), triangle, np.zeros(row.size), {}))


def virtual(**settings: float) -> ShotSummary:
    """The summary of a shot of the virtual rig."""
    return identified("field-2013", **settings).summary


@settings(max_examples=15, deadline=None)
@given(
    st.integers(1, 12),
    st.integers(1, 12),
    st.sampled_from([0.0, 60.0, 300.0]),
    st.sampled_from([NOTHING, Scatter(1e-3, 0.03)]),
)
def test_more_shots_never_make_the_mass_less_sure(few: int, more: int, added_kg: float, scatter: Scatter) -> None:
    nominal = [made_up()]
    u_few, u_more = (predicted_u_rel(nominal, Plan(shots, added_kg, 0.05, scatter)) for shots in (few, few + more))
    assert u_more <= u_few * (1 + 1e-9)


@pytest.mark.whole_way
@settings(max_examples=20, deadline=None)
@given(st.sampled_from(KEYS), st.floats(0.0, 1.0), st.sampled_from([1, 8]), st.sampled_from([0.0, 120.0]))
def test_a_better_certificate_never_makes_the_mass_less_sure(key: str, by: float, shots: int, added_kg: float) -> None:
    rig, nominal, plan = load_rig("field-2013"), made_up(), Plan(shots, added_kg)
    stated = {"u_friction": 150.0, "p_breech.u_rel": 0.005, "acc_recoil.u_rel": 0.005}.get(key, 0.004)
    better = nominal.known_by(with_uncertainties(rig, {key: by * stated}))
    assert predicted_u_rel([better], plan) <= predicted_u_rel([nominal], plan) * (1 + 1e-9)


@given(st.floats(1e-4, 1e-2), st.floats(1e-4, 1e-2), st.integers(1, 20))
@settings(max_examples=15, deadline=None)
def test_half_the_uncertainty_of_an_influence_is_half_its_share(u: float, other: float, shots: int) -> None:
    def variance(u: float) -> float:
        return predicted_u_rel([of_one_row(1e-4, gauge=u, other=other)], Plan(shots, scatter=NOTHING)) ** 2

    rest = other**2 + 1e-8 / shots
    assert variance(u) == pytest.approx(u**2 + rest, rel=1e-6)
    assert variance(0.5 * u) == pytest.approx((0.5 * u) ** 2 + rest, rel=1e-6)


@pytest.mark.parametrize("added_kg", [30.0, 120.0, 450.0])
@pytest.mark.parametrize("shots", [4, 16])
def test_where_no_scale_is_known_the_added_mass_alone_tells_the_mass(added_kg: float, shots: int) -> None:
    s, u_added_kg = 4e-4, 0.2
    # M = d / (r - 1) with the ratio r of the apparent masses; a heavier part is accelerated less, by the same noise
    heavier = s * (MASS_KG + added_kg) / MASS_KG
    u_ln_r = math.sqrt((s**2 + heavier**2) / (shots / 2))
    u = math.hypot((MASS_KG + added_kg) / added_kg * u_ln_r, u_added_kg / added_kg)
    plan = Plan(shots, added_kg, u_added_kg, NOTHING)
    assert predicted_u_rel([of_one_row(s, scale=100.0)], plan) == pytest.approx(u, rel=1e-4)


def test_what_the_certificates_know_together_is_the_floor_of_any_number_of_equal_shots() -> None:
    forces = 1 / math.sqrt(1 / (0.5**2 + 0.5**2) + 2 / 0.4**2 + 1 / 10**2)
    motion = 1 / math.sqrt(1 / 0.1**2 + 1 / 0.5**2)
    nominal = NominalShot.of(782.0, 0.0, virtual())
    # n equal shots are one whose triangle is as large as the root of n
    endless = replace(nominal, summary=replace(nominal.summary, triangle=1e4 * nominal.summary.triangle))
    floor = 100 * predicted_u_rel([endless], Plan(1, scatter=NOTHING))
    assert floor == pytest.approx(math.hypot(forces, motion), rel=0.01)
    assert floor == pytest.approx(0.280, abs=0.002)
    u_rel = [predicted_u_rel([nominal], Plan(shots, scatter=NOTHING)) for shots in (1, 8, 64)]
    assert 0.40 > 100 * u_rel[0] > 100 * u_rel[1] > 100 * u_rel[2] > floor


def test_the_same_forces_on_a_heavier_part_turn_the_triangle_as_they_turn_its_rows() -> None:
    rows, s = rows_of_shot(1.0), MASS_KG / (MASS_KG + 120.0)
    zero = np.ones((rows.shape[0], 1))  # the shot's own, which does not hang on the mass

    def information(rows: np.ndarray) -> np.ndarray:
        left = rows - zero @ np.linalg.lstsq(zero, rows, rcond=None)[0]
        return np.asarray(left.T @ left)

    triangle = np.linalg.qr(np.hstack([zero, rows]), mode="r")[1:, 1:]
    nominal = made_up()
    bare = NominalShot.of(MASS_KG, 0.0, replace(nominal.summary, triangle=triangle))
    turned = bare.carrying(120.0).summary.triangle
    expected = information(s * rows)
    assert turned.T @ turned == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())
    assert bare.carrying(120.0).carrying(0.0).summary.triangle == pytest.approx(triangle)


def test_lengths_that_optics_bend_do_not_hang_on_the_mass() -> None:
    nominal = NominalShot.of(782.0, 0.0, virtual())
    ratio = np.linalg.norm(nominal.carrying(782.0).summary.triangle, axis=0)
    ratio /= np.linalg.norm(nominal.summary.triangle, axis=0)
    moved = {one.name: size for one, size in zip(nominal.summary.parameters, ratio.tolist(), strict=True)}
    unmoved = [name for name, size in moved.items() if size == pytest.approx(1.0)]
    assert [name.split()[0] for name in unmoved] == ["the", "bow", "S"]
    assert {round(size, 9) for name, size in moved.items() if name not in unmoved} == {0.5}


@pytest.mark.whole_way
def test_a_heavier_part_is_predicted_as_the_virtual_rig_moves_it() -> None:
    bare = NominalShot.of(782.0, 0.0, virtual())
    moved = NominalShot.of(782.0, 120.0, virtual(m3_true=902.0))
    plan = Plan(8, 120.0, 0.05)
    by_forces, simulated = (predicted_u_rel(nominal, plan) for nominal in ([bare], [bare, moved]))
    assert by_forces == pytest.approx(simulated, rel=0.1)
    assert 0.17 < 100 * simulated < 0.23


def test_a_mass_step_of_the_size_that_is_found_gains_just_the_limit() -> None:
    nominal, plan = [made_up()], Plan(8, 120.0, 0.05)
    size_kg = found_by(nominal, plan).mass_step_kg
    assert size_kg is not None
    planted: list[CampaignShot] = []
    for number, shot in enumerate(predicted_fit(nominal, plan).rows.shots):
        summary = shot.summary
        assert summary is not None
        reference = summary.reference.copy()
        reference[0] = math.log(math.exp(reference[0]) + (size_kg if number >= 4 else 0.0))
        planted.append(replace(shot, summary=replace(summary, reference=reference)))
    rows = JointRows.of(planted, {"as built": "as built"})
    candidates = candidates_of(joint_fit_under(rows, plan.scatter))
    assert (candidates[0].kind, candidates[0].shots[0]) == ("mass step", "0005")
    assert candidates[0].gain == pytest.approx(least_gain(len(candidates)), rel=0.02)


def test_two_configurations_differ_by_what_is_left_when_all_scales_are_common() -> None:
    found = found_by([of_one_row(4e-4, scale=0.005)], Plan(8, scatter=NOTHING))
    assert found.u_difference_kg == pytest.approx(MASS_KG * 4e-4 * math.sqrt(2 / 4), rel=1e-4)
    assert found_by([made_up()], Plan(3)).mass_step_kg is None


def test_a_smaller_scatter_of_the_gains_lets_smaller_changes_be_found() -> None:
    still, moving = (found_by([made_up()], Plan(8, scatter=Scatter(rel, 0.01))) for rel in (1e-4, 1e-3))
    assert still.mass_step_kg is not None
    assert moving.mass_step_kg is not None
    assert still.mass_step_kg < moving.mass_step_kg
    assert len(still.drifts) == len(moving.drifts) == 4
    for (label, size), larger in zip(
        still.drifts, (dict(moving.drifts)[label] for label, _ in still.drifts), strict=True
    ):
        assert size < larger, label


def test_what_could_be_done_is_listed_with_what_helps_most_first_and_only_what_the_shots_hang_on() -> None:
    rig, nominal, plan = load_rig("field-2013"), [made_up()], Plan(8)
    listed = what_ifs(nominal, rig, plan).lines
    sizes = [one.u_rel_campaign for one in listed]
    assert sizes == sorted(sizes)
    named = " ".join(one.change for one in listed)
    for part in (
        "p_breech",
        "to 0.1 %",
        "p_brake",
        "p_recuperator",
        "acc_recoil",
        "u_friction 75",
        "91 kg",
        "32 shots",
    ):
        assert part in named
    assert "camera" not in named  # these shots have none
    assert "area" not in named  # taken as exact
    u_shot, u_campaign = (predicted_u_rel(nominal, replace(plan, shots=shots)) for shots in (1, 8))
    for one in listed:
        if "repeat" not in one.change:
            assert one.u_rel_shot <= u_shot * (1 + 1e-9), one
        if "repeat" not in one.change and one.change != "4 shots":
            assert one.u_rel_campaign <= u_campaign * (1 + 1e-9), one


def test_a_weighed_mass_is_worth_more_than_any_certificate_and_the_one_at_hand_is_the_one_that_is_advised() -> None:
    rig, nominal = load_rig("field-2013"), [made_up()]
    first, *others = what_ifs(nominal, rig, Plan(8)).lines
    assert first.change.endswith("added to every second shot")
    assert any("certificate" in one.change for one in others)
    stated = parse_rig(f"{rig.text}\n[knowledge]\nweighed_mass_kg = 250.5\nu_weighed_mass_kg = 0.2\n", rig.path)
    at_hand = [one for one in what_ifs(nominal, stated, Plan(8)).lines if "weighed" in one.change]
    (said,) = at_hand
    assert said.change == "250.5 kg (27 % of the mass), weighed to 0.2 kg, added to every second shot"
    assert said.u_rel_campaign == predicted_u_rel(nominal, Plan(8, 250.5, 0.2))


@pytest.mark.whole_way
def test_what_no_gauge_reads_is_worth_knowing() -> None:
    rig, plan = virtual_shot("field-2013", kind=False).rig, Plan(8, 120.0, 0.05)
    nominal = [NominalShot.of(782.0, 0.0, identified("field-2013", kind=False).summary).known_by(rig)]
    u_rel = predicted_u_rel(nominal, plan)
    listed = {one.change: one for one in what_ifs(nominal, rig, plan).lines}
    share, force = (
        listed[f"{name} known to be none: {key} 0"]
        for name, key in (("unread_share", "u_unread_share"), ("unread_force", "unread_force"))
    )
    assert share.u_rel_campaign < 0.99 * u_rel
    assert share.u_rel_shot < 0.95 * predicted_u_rel(nominal, replace(plan, shots=1, added_mass_kg=0.0))
    assert force.u_rel_campaign < u_rel
    assert listed["unread_share known twice as well: u_unread_share 0.005"].u_rel_campaign > share.u_rel_campaign
    assert not any("carried" in change for change in listed)
    # a rig that states twice the force has twice the sizes of its shapes
    doubled = nominal[0].known_by(with_uncertainties(rig, {"unread_force": 0.004}))
    (u,) = (u for one in doubled.summary.parameters if one.name == "unread force 1" for _, u in one.influences)
    assert u == pytest.approx(2.0)
