"""A planned campaign of the virtual rig: which shot carries what, what is drawn, what moves, what is refused."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from recoil_acquisition.errors import RigError
from recoil_rigs.mechanism import model
from recoil_rigs.rig import Rig
from recoil_rigs.twin import CampaignPlan, TwinShot, draw_scene, simulate_shot
from recoil_rigs.twin.instruments import truth
from recoil_rigs.twin.sources import Scene
from tests.builders.mujoco_mechanism import mujoco_model
from tests.builders.virtual_shots import with_twin

FORCES = {"p_breech", "p_brake", "p_recuperator"}


@cache
def rig(**settings: float | bool) -> Rig:
    return with_twin("field-2013", **{"sample_rate_hz": 20e3, "duration_s": 0.3, "noise": 0.0, "bits": 0} | settings)


def drawn(plan: CampaignPlan, shots: int, seed: int = 1, campaign_seed: int = 7) -> tuple[Any, ...]:
    return plan.draw(rig(), shots, seed=seed, campaign_seed=campaign_seed)


def fired(folder: Path, plan: CampaignPlan | None, number: int = 1, shots: int = 4, seed: int = 11) -> TwinShot:
    """Fire one shot of a campaign, always with the same seed, so that shots differ by what was planned alone."""
    planned = None if plan is None else drawn(plan, shots)[number - 1]
    return simulate_shot(rig(), folder, seed=seed, shot="0001", campaign_seed=7, planned=planned)


def test_every_second_shot_carries_the_added_mass_and_charges_go_round() -> None:
    plan = CampaignPlan(added_mass_kg=120.0, charges=(1.0, 0.8, 0.65))
    shots = drawn(plan, 7)
    assert [s.added_mass_kg for s in shots] == [0, 120, 0, 120, 0, 120, 0]
    assert [s.u_added_mass_kg for s in shots] == [0, 0.05, 0, 0.05, 0, 0.05, 0]
    assert [s.charge for s in shots] == [1.0, 0.8, 0.65, 1.0, 0.8, 0.65, 1.0]


def test_steps_add_up_untold_and_a_configuration_holds_until_the_next() -> None:
    shots = drawn(CampaignPlan(mass_steps={3: -6.0, 5: 2.5}, configurations={2: "long rod", 5: "short rod"}), 6)
    assert [s.mass_step_kg for s in shots] == [0, 0, -6, -6, -3.5, -3.5]
    assert [s.configuration for s in shots] == ["", "long rod", "long rod", "long rod", "short rod", "short rod"]
    assert {s.added_mass_kg for s in shots} == {0.0}


@given(shots=st.integers(2, 30), drift=st.floats(-0.5, 0.5))
def test_a_drift_is_a_straight_line_from_nothing_to_all_of_it(shots: int, drift: float) -> None:
    factors = np.array([s.gain_factors["p_brake"] for s in drawn(CampaignPlan(drifts={"p_brake": drift}), shots)])
    assert factors[0] == 1.0
    assert factors[-1] == pytest.approx(1.0 + drift, rel=1e-15)
    np.testing.assert_allclose(np.diff(factors, 2), 0.0, atol=1e-14)


def test_an_outlier_is_in_its_shot_alone_and_comes_on_top_of_a_drift() -> None:
    plan = CampaignPlan(drifts={"p_breech": 0.03}, outliers={3: {"p_breech": -0.02, "x_camera": 0.01}})
    shots = drawn(plan, 4)
    assert [s.gain_factors["p_breech"] for s in shots] == pytest.approx([1.0, 1.01, 1.02 * 0.98, 1.03])
    assert [s.gain_factors.get("x_camera", 1.0) for s in shots] == [1.0, 1.0, 1.01, 1.0]


def test_the_true_added_mass_is_off_by_one_draw_of_its_u_in_each_campaign() -> None:
    plan = CampaignPlan(added_mass_kg=120.0, u_added_mass_kg=0.5)
    off = []
    for campaign_seed in range(400):
        bare, *others = drawn(plan, 4, campaign_seed=campaign_seed)
        assert bare.true_added_mass_kg == 0.0
        assert others[0].true_added_mass_kg == others[2].true_added_mass_kg
        off.append((others[0].true_added_mass_kg - 120.0) / 0.5)
    assert np.mean(off) == pytest.approx(0.0, abs=0.15)
    assert np.std(off) == pytest.approx(1.0, rel=0.1)
    assert drawn(CampaignPlan(added_mass_kg=120.0, u_added_mass_kg=0.0), 2)[1].true_added_mass_kg == 120.0


def test_friction_and_the_gains_that_concern_the_forces_scatter_on_their_own_from_shot_to_shot() -> None:
    shots = drawn(CampaignPlan(friction_scatter=0.03, repeatability=0.0005), 600)
    names = [*sorted(FORCES), "acc_recoil"]
    assert set(shots[0].gain_factors) == set(names)
    gains = np.array([[s.gain_factors[name] for name in names] for s in shots]) - 1.0
    friction = np.array([s.friction_factor for s in shots]) - 1.0
    np.testing.assert_allclose(np.std(gains, axis=0), 0.0005, rtol=0.1)
    assert np.std(friction) == pytest.approx(0.03, rel=0.1)
    together = np.corrcoef(np.column_stack([gains, friction]), rowvar=False)
    assert np.abs(together - np.eye(5)).max() < 0.15
    # what scatters is the shot's, not the campaign's
    assert drawn(CampaignPlan(repeatability=0.0005), 3, campaign_seed=8)[2].gain_factors == shots[2].gain_factors


@cache
def loaded() -> Scene:
    """A shot with 120 kg more, less a step of 4 kg."""
    plan = CampaignPlan(added_mass_kg=120.0, u_added_mass_kg=1.0, mass_steps={2: -4.0})
    return draw_scene(rig(), 11, "0002", 7, drawn(plan, 2)[1])


@pytest.mark.exhaustive
def test_what_is_added_moves_as_a_body_of_its_own_that_sits_on_the_recoiling_part() -> None:
    scene, base = loaded(), rig().mechanism
    motion, m = scene.motion, scene.mechanism
    more = scene.planned.true_added_mass_kg - 4.0
    assert more == pytest.approx(116.0, abs=5.0)
    assert more != 116.0
    simulator = mujoco_model(base, more)
    data = mujoco.MjData(simulator)
    loads = model.generalized_forces(
        m, motion.q, m.force_areas[0] * motion.breech_pressure_pa, motion.resistance_n(m), motion.elevating_moment_n_m,
        motion.ground_x_n, motion.ground_y_n, motion.ground_d_n, motion.ground_friction_n,
    )  # fmt: skip
    for i in range(0, motion.times_s.size, 97):
        weights = model.generalized_forces(m, motion.q[i], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        # the simulator knows of gravity itself
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = motion.q[i], motion.qd[i], loads[i] - weights
        mujoco.mj_forward(simulator, data)
        np.testing.assert_allclose(motion.qdd[i], data.qacc, rtol=1e-7, atol=1e-6)


def test_force_over_what_the_sensor_feels_is_the_mass_with_all_that_was_added() -> None:
    scene = loaded()
    motion, m = scene.motion, scene.mechanism
    felt = truth("recoil_acceleration", m, motion, (0.0, 0.0))
    force = m.force_areas[0] * motion.breech_pressure_pa - motion.resistance_n(m)
    moving = (motion.times_s > motion.t_fire_s + 0.01) & (motion.times_s < motion.t_end_s)
    expected = 782.0 - 4.0 + scene.planned.true_added_mass_kg
    np.testing.assert_allclose((force / felt)[moving], expected, rtol=1e-6)


@pytest.mark.exhaustive
def test_true_gains_of_two_shots_differ_by_exactly_what_was_planted(tmp_path: Path) -> None:
    plan = CampaignPlan(drifts={"p_brake": 0.01}, outliers={4: {"x_camera": -0.02, "acc_recoil": 0.005}})
    first, last = (fired(tmp_path / str(n), plan, n).truth for n in (1, 4))
    planted = {"p_brake": 1.01, "x_camera": 0.98, "acc_recoil": 1.005}
    for name, gain in first["gains"].items():
        assert last["gains"][name] == gain * planted.get(name, 1.0)
    assert first["offsets"] == last["offsets"]
    assert first["friction"] == last["friction"]


def test_the_recorded_numbers_have_the_planted_gain(tmp_path: Path) -> None:
    plan = CampaignPlan(outliers={1: {"p_breech": 0.02, "x_camera": -0.02}})
    shots = fired(tmp_path / "without", None), fired(tmp_path / "with", plan)
    for at, column, factor in ((0, "AI 6/p_breech (MPa)", 1.02), (1, "Feature #1 - X (mm)", 0.98)):
        before, after = (pd.read_csv(shot.files[at])[column].to_numpy() for shot in shots)
        large = before > 0.5 * before.max()
        offset = shots[0].truth["offsets"].get("p_breech", 0.0) if factor > 1 else 0.0
        ratio = (after - offset)[large] / (before - offset)[large]
        np.testing.assert_allclose(np.median(ratio), factor, atol=2e-4)


@pytest.mark.exhaustive
def test_charge_and_friction_are_those_of_the_shot(tmp_path: Path) -> None:
    plan = CampaignPlan(charges=(1.0, 0.65), friction_scatter=0.03)
    plain, weak = fired(tmp_path / "plain", None).truth, fired(tmp_path / "weak", plan, 2).truth
    assert weak["peak_breech_force_n"] == pytest.approx(0.65 * plain["peak_breech_force_n"], rel=1e-12)
    factor = weak["campaign"]["friction_factor"]
    assert factor != 1.0
    assert weak["friction"] == pytest.approx(factor * plain["friction"], rel=1e-9)
    assert weak["stroke_m"] < plain["stroke_m"]


def test_a_plan_without_anything_in_it_changes_no_recorded_byte_and_the_truth_by_its_own_keys(tmp_path: Path) -> None:
    without, planned = fired(tmp_path / "without", None), fired(tmp_path / "with", CampaignPlan())
    for one, other in zip(without.files, planned.files, strict=True):
        assert one.read_bytes() == other.read_bytes()
    more = {"added_mass_kg", "configuration", "campaign"}
    assert {k: v for k, v in planned.truth.items() if k not in more} == without.truth
    assert more <= set(planned.truth)


@pytest.mark.exhaustive
def test_the_truth_states_all_that_was_planned_and_drawn(tmp_path: Path) -> None:
    plan = CampaignPlan(
        added_mass_kg=120.0,
        repeatability=0.001,
        mass_steps={2: -6.0},
        configurations={1: "A"},
        drifts={"p_brake": 0.01},
    )
    told = json.loads(fired(tmp_path / "x", plan, 4).truth_file.read_text(encoding="utf-8"))
    shot = drawn(plan, 4)[3]
    assert told["m3"] == pytest.approx(782.0 - 6.0 + told["added_mass_kg"])
    assert told["added_mass_kg"] == shot.true_added_mass_kg != 120.0
    assert told["configuration"] == "A"
    campaign = told["campaign"]
    assert (campaign["shot"], campaign["shots"], campaign["mass_step_kg"], campaign["charge"]) == (4, 4, -6.0, 1.0)
    assert (campaign["weighed_added_mass_kg"], campaign["u_added_mass_kg"]) == (120.0, 0.05)
    assert campaign["gain_factors"] == dict(shot.gain_factors)
    assert CampaignPlan.model_validate(campaign["plan"]) == plan
    bare = CampaignPlan(charges=(1.0, 0.8))
    assert CampaignPlan.model_validate(drawn(bare, 2)[0].truth()["campaign"]["plan"]) == bare


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"added_mass_kg": 0.0}, "added_mass_kg"),
        ({"added_mass_kg": -120.0}, "added_mass_kg"),
        ({"added_mass_kg": math.inf}, "added_mass_kg"),
        ({"u_added_mass_kg": 0.1}, "of an added mass, of which there is none"),
        ({"added_mass_kg": 1.0, "u_added_mass_kg": 0.3}, "at most 0.2, a fifth of the added mass"),
        ({"charges": (1.0, 0.0)}, r"charges\.1"),
        ({"friction_scatter": -0.1}, "friction_scatter"),
        ({"repeatability": math.nan}, "repeatability"),
        ({"mass_steps": {0: 1.0}}, "mass_steps"),
        ({"mass_steps": {2: math.nan}}, "mass_steps"),
        ({"configurations": {2: ""}}, "configurations"),
        ({"configurations": {2: "two\nlines"}}, "must be a printable text"),
        ({"drifts": {"p_brake": 0.6}}, "drifts"),
        ({"outliers": {2: {"p_brake": -0.6}}}, "outliers"),
        ({"ring_kg": 1.0}, "ring_kg"),
    ],
)
def test_a_plan_with_values_that_cannot_be_is_refused(values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        CampaignPlan(**values)


@pytest.mark.parametrize(
    ("plan", "shots", "problem"),
    [
        (CampaignPlan(mass_steps={5: 1.0}), 4, "mass step at shot 5: the campaign ends with shot 4"),
        (CampaignPlan(configurations={9: "B"}), 4, "configuration at shot 9: the campaign ends"),
        (CampaignPlan(outliers={5: {"p_brake": 0.1}}), 4, "outlier at shot 5: the campaign ends"),
        (CampaignPlan(added_mass_kg=120.0), 1, "added mass: every second shot carries it, and there is only one"),
        (CampaignPlan(drifts={"p_brake": 0.1}), 1, "drift: it goes from the first shot to the last"),
    ],
)
def test_what_so_few_shots_cannot_have_is_refused(plan: CampaignPlan, shots: int, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        drawn(plan, shots)


@pytest.mark.parametrize(
    ("plan", "problem"),
    [
        (CampaignPlan(drifts={"p_brech": 0.1}), "campaign.drifts.p_brech: no such channel; did you mean 'p_breech'?"),
        (CampaignPlan(outliers={2: {"acc_recol": 0.1}}), "campaign.outliers.2.acc_recol: no such channel; did you"),
        (CampaignPlan(mass_steps={2: -782.0}), "campaign, shot 2: the recoiling mass would be 0 kg"),
        (CampaignPlan(mass_steps={2: 9e3}), "shot 2, twin.recuperator_pressure_pa: does not hold the recoiling part"),
    ],
)
def test_what_the_rig_cannot_have_is_a_fault_before_the_first_shot(plan: CampaignPlan, problem: str) -> None:
    with pytest.raises(RigError) as caught:
        drawn(plan, 2)
    assert problem in str(caught.value)


def test_a_step_may_not_leave_less_than_what_lets_go() -> None:
    releasing = with_twin("field-2013", released_mass_kg=40.0)
    with pytest.raises(RigError, match=r"shot 2, twin\.released_mass_kg: must be less than the recoiling mass, 32 kg"):
        CampaignPlan(mass_steps={2: -750.0}).draw(releasing, 2, seed=1, campaign_seed=1)
