"""What changed among the shots is found where it was planted, and nothing where nothing was."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.campaign.changes import (
    ADDED,
    DRIFT,
    OUTLIER,
    STEP,
    Change,
    candidates_of,
    joint_fit_with_changes,
    least_gain,
    normalised_residuals,
)
from recoil_identification.campaign.joint_fit import joint_fit
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.mechanisms import mechanisms_of
from tests.builders.campaign_summaries import MASS_KG, Drawn, campaign_of

PLAIN, WEIGHED = (0.0,) * 8, (0.0, 120.0) * 4
RAMP = np.arange(8) / 7


def rows_of(drawn: Drawn) -> JointRows:
    return JointRows.of(drawn.shots, mechanisms_of(drawn.shots))


def changes_of(drawn: Drawn) -> tuple[Change, ...]:
    return joint_fit_with_changes(rows_of(drawn))[1]


@pytest.mark.parametrize("added", [PLAIN, WEIGHED])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_changed_in_sound_campaigns(added: tuple[float, ...], seed: int) -> None:
    assert changes_of(campaign_of(added, seed=seed)) == ()


@pytest.mark.whole_way
@pytest.mark.parametrize("added", [PLAIN, WEIGHED])
def test_a_step_of_the_mass_is_found_with_its_place_and_size(added: tuple[float, ...]) -> None:
    (change,) = changes_of(campaign_of(added, seed=4, step_kg={4: -4.0}))
    assert (change.kind, change.influence, change.unit) == (STEP, "mass", "kg")
    assert change.shots == ("0005", "0006", "0007", "0008")
    assert abs(change.size + 4.0) < 3 * change.u
    assert change.u < 0.6
    assert "drift" in change.instead


@pytest.mark.whole_way
@pytest.mark.parametrize("parameter", ["ln breech_pressure", "ln brake_pressure"])
def test_a_sensor_that_drifts_is_named(parameter: str) -> None:
    drawn = campaign_of(WEIGHED, seed=5, moved={(i, parameter): 0.01 * RAMP[i] for i in range(8)})
    (change,) = changes_of(drawn)
    assert (change.kind, change.unit, change.shots) == (DRIFT, "1", ("0001", "0008"))
    assert change.influence.startswith(parameter[3:])
    assert abs(change.size - 0.01) < 3 * change.u


@pytest.mark.whole_way
def test_one_shot_that_lies_apart_is_named_with_its_sensor() -> None:
    (change,) = changes_of(campaign_of(WEIGHED, seed=6, moved={(3, "ln breech_pressure"): -0.01}))
    assert (change.kind, change.shots) == (OUTLIER, ("0004",))
    assert change.influence.startswith("breech_pressure")
    assert abs(change.size + 0.01) < 3 * change.u
    assert "shot 0004 lies apart: its breech_pressure scale, sensor 1 is off by -0.9" in str(change)


@pytest.mark.whole_way
def test_two_changes_are_told_apart_and_the_mass_is_right() -> None:
    moved = {(i, "ln breech_pressure"): 0.01 * RAMP[i] for i in range(8)} | {(2, "ln brake_pressure"): -0.05}
    rows = rows_of(campaign_of(WEIGHED, seed=7, moved=moved))
    fit, changes = joint_fit_with_changes(rows)
    assert {(one.kind, one.influence.partition("_")[0]) for one in changes} == {(DRIFT, "breech"), (OUTLIER, "brake")}
    mass_kg, u_kg = fit.mass_kg("as built")
    assert abs(mass_kg - MASS_KG) < 2.5 * u_kg


@pytest.mark.whole_way
@pytest.mark.parametrize(("stated", "missing"), [(0.12, 119.88), (100.0, 20.0)])
def test_a_weight_that_is_wrong_in_the_shot_log_is_noticed(stated: float, missing: float) -> None:
    from dataclasses import replace

    drawn = campaign_of(WEIGHED, seed=8)
    shots = tuple(replace(one, added_mass_kg=stated if one.added_mass_kg else 0.0) for one in drawn.shots)
    (change,) = joint_fit_with_changes(JointRows.of(shots, mechanisms_of(shots)))[1]
    assert (change.kind, change.shots) == (ADDED, ("0002", "0004", "0006", "0008"))
    assert change.size == pytest.approx(missing, rel=0.05)


@pytest.mark.whole_way
def test_a_weight_on_the_wrong_shots_is_noticed() -> None:
    from dataclasses import replace

    drawn = campaign_of(WEIGHED, seed=9)
    swapped = {"0003": 120.0, "0004": 0.0}
    shots = tuple(
        replace(one, added_mass_kg=swapped.get(one.name, one.added_mass_kg), u_added_mass_kg=0.05)
        for one in drawn.shots
    )
    changes = joint_fit_with_changes(JointRows.of(shots, mechanisms_of(shots)))[1]
    sizes = {one.shots: one.size for one in changes if one.kind == OUTLIER and one.influence == "mass"}
    assert sizes == {("0003",): pytest.approx(-120.0, abs=2.0), ("0004",): pytest.approx(120.0, abs=2.0)}


def test_a_configuration_that_was_declared_is_no_change() -> None:
    names = ["before"] * 4 + ["after"] * 4
    assert changes_of(campaign_of(PLAIN, seed=3, step_kg={4: -6.0}, configurations=names)) == ()


@pytest.mark.whole_way
@pytest.mark.parametrize("kind", [STEP, DRIFT, OUTLIER])
def test_what_a_candidate_promises_is_what_a_fit_with_its_column_gains(kind: str) -> None:
    drawn = campaign_of(WEIGHED, seed=10, step_kg={4: -0.5})
    fit = joint_fit(rows_of(drawn))
    candidate = next(one for one in candidates_of(fit) if one.kind == kind)
    again = joint_fit(rows_of(drawn), [candidate.column])
    # of one scatter: the information on the column is in the fit's likelihood, and not in what is compared
    with_column = {trial.scatter: trial.level for trial in again.trials}
    levels = [
        one.log_likelihood - one.level + with_column[one.scatter] for one in fit.trials if one.scatter in with_column
    ]
    gained = max(levels) - max(trial.log_likelihood for trial in fit.trials)
    assert candidate.gain == pytest.approx(gained, abs=2e-3 * max(1.0, gained))


@pytest.mark.whole_way
def test_the_residual_of_a_shot_is_what_it_says_apart_from_all_others() -> None:
    rows = rows_of(campaign_of(WEIGHED, seed=11))
    fit = joint_fit(rows)
    at = fit.trials.index(fit.likeliest)
    for shot in (0, 5):
        column = next(
            one.column
            for one in candidates_of(fit)
            if one.kind == OUTLIER and one.influence == "mass" and one.shots == (rows.shots[shot].name,)
        )
        apart = joint_fit(rows, [column]).trials[at].estimate
        expected = apart.value(column.name) / apart.u(column.name)
        assert normalised_residuals(fit)[shot] == pytest.approx(expected, rel=5e-3, abs=5e-3)


@pytest.mark.whole_way
def test_the_residuals_are_standard_normal() -> None:
    found = np.concatenate(
        [normalised_residuals(joint_fit(rows_of(campaign_of(WEIGHED, seed=s)))) for s in range(20, 32)]
    )
    assert 0.75 < np.sqrt(np.mean(found**2)) < 1.25


def test_more_candidates_need_more_evidence() -> None:
    assert least_gain(53) == pytest.approx(0.5 * 3.905**2, abs=0.01)  # of a probability of 0.005 / 53 on both sides
    assert least_gain(6000) > least_gain(53) + 4


@pytest.mark.whole_way
def test_gains_that_scatter_raise_no_alarm() -> None:
    drawn = [campaign_of(WEIGHED, seed=seed, gain_rel=1e-3, friction_rel=0.05) for seed in range(40, 46)]
    assert sum(bool(changes_of(one)) for one in drawn) <= 1
    assert joint_fit(rows_of(drawn[0])).likeliest.scatter != Scatter()
