"""All shots at once give what a dense least-squares problem with every own error as an unknown gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.campaign.agreement import Agreement, Misfit, weighed
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.joint_fit import FORCES, Trial, joint_fit, joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.mechanisms import mechanisms_of
from tests.builders.campaign_summaries import BREECH, INFLUENCES, MASS_KG, NAMES, SHARE, U, campaign_of
from tests.builders.dense_campaign import densities

ADDED = (0.0, 120.0) * 4


def rows_of(shots: tuple[CampaignShot, ...]) -> JointRows:
    return JointRows.of(shots, mechanisms_of(shots))


def trial_of(rows: JointRows, scatter: Scatter) -> Trial:
    return next(one for one in joint_fit(rows).trials if one.scatter == scatter)


def dense(
    shots: tuple[CampaignShot, ...], scatter: Scatter, known_beforehand: tuple[float, ...] = (0.0,) * 6
) -> tuple[float, float]:
    """Mass and its standard uncertainty by the normal equations of everything, own errors among the unknowns.

    `known_beforehand` is what is expected of the added mass's error and of the influences, in their uncertainties.
    """
    own_sd = np.array([0.0, *[scatter.gain_rel] * 3, scatter.friction_rel, scatter.gain_rel])
    x = np.zeros(1 + 1 + 5)  # logarithm of the mass over its nominal value, added mass's error, influences
    for _ in range(5):
        rows, left = [], []
        for i, shot in enumerate(shots):
            summary = shot.summary
            assert summary is not None
            bare = MASS_KG * np.exp(x[0])
            whole = bare + shot.added_mass_kg + shot.u_added_mass_kg * x[1]
            theta = np.array([np.log(whole), *(np.array(U) * x[2:7])])
            jacobian = np.zeros((6, 7 + 5 * len(shots)))
            jacobian[0, 0], jacobian[0, 1] = bare / whole, shot.u_added_mass_kg / whole
            jacobian[1:, 2:7] = np.diag(U)
            jacobian[1:, 7 + 5 * i : 12 + 5 * i] = np.diag(own_sd[1:])
            rows.append(summary.triangle @ jacobian)
            left.append(summary.seen - summary.triangle @ (theta - summary.reference))
        known = np.eye(7 + 5 * len(shots))[1:]
        rows.append(known)
        left.append(np.concatenate([np.array(known_beforehand) - x[1:], np.zeros(5 * len(shots))]))
        stacked = np.vstack(rows)
        step = np.linalg.lstsq(stacked, np.concatenate(left), rcond=None)[0]
        x = x + step[:7]
    u = np.sqrt(np.linalg.inv(stacked.T @ stacked)[0, 0])
    return MASS_KG * float(np.exp(x[0])), MASS_KG * float(np.exp(x[0]) * u)


@pytest.mark.parametrize("scatter", [Scatter(), Scatter(1e-3, 0.05), Scatter(3e-3, 0.0)])
@pytest.mark.parametrize("added", [ADDED, (0.0,) * 5])
def test_mass_and_uncertainty_are_those_of_the_dense_problem(added: tuple[float, ...], scatter: Scatter) -> None:
    shots = campaign_of(added, seed=4, gain_rel=1e-3, friction_rel=0.03).shots
    rows = rows_of(shots)
    estimate = trial_of(rows, scatter).estimate
    mass_kg, u_kg = dense(shots, scatter)
    name = rows.masses[0]
    assert rows.reference_kg * np.exp(estimate.value(name)) == pytest.approx(mass_kg, rel=1e-9)
    assert rows.reference_kg * np.exp(estimate.value(name)) * estimate.u(name) == pytest.approx(u_kg, rel=1e-5)


def test_each_row_of_the_budget_is_what_a_refit_with_that_influence_moved_gives() -> None:
    shots, scatter = campaign_of(ADDED, seed=4, gain_rel=1e-3, friction_rel=0.03).shots, Scatter(1e-3, 0.05)
    rows = rows_of(shots)
    budget = {str(row.source): row for row in joint_fit_under(rows, scatter).budget("as built")}
    names = ["added mass of 120 kg", *(str(one.source) for one in rows.influences)]
    assert list(budget) == ["random errors of the shots", *names[1:], names[0]]
    as_it_is, u_kg = dense(shots, scatter)
    for number, name in enumerate(names):
        moved = tuple(float(at == number) for at in range(6))
        rise_kg = dense(shots, scatter, moved)[0] - as_it_is
        row = budget[name]
        assert row.u_kg == pytest.approx(abs(rise_kg), rel=0.02, abs=1e-3)
        assert row.sensitivity is not None
        # a gauge that is known to read high makes its force smaller; what was weighed heavier leaves less
        assert row.sensitivity * rise_kg * (-1.0 if number else 1.0) > 0.0
    assert np.linalg.norm([row.u_kg for row in budget.values()]) == pytest.approx(u_kg, rel=1e-5)
    assert {row.group for row in budget.values()} == {"sensors", "unread forces", "motion noise", "geometry"}


def test_the_budget_over_all_scatters_adds_up_to_the_uncertainty() -> None:
    fit = joint_fit(rows_of(campaign_of(ADDED, seed=5, gain_rel=2e-3).shots))
    budget = fit.budget("as built")
    assert np.linalg.norm([row.u_kg for row in budget]) == pytest.approx(fit.mass_kg("as built")[1], rel=1e-12)
    # it is no sum that the random row alone makes right
    assert budget[0].u_kg < 0.8 * fit.mass_kg("as built")[1]


@pytest.mark.whole_way
def test_scatters_are_weighed_by_the_density_of_the_rows() -> None:
    drawn = campaign_of((0.0,) * 4, seed=2, gain_rel=1e-3)
    rows = rows_of(drawn.shots)
    # the mass has no prior: give it one that is all but none, the same for every scatter
    wide = 10.0
    found = {}
    for scatter in (Scatter(), Scatter(1e-3, 0.0), Scatter(7e-4, 0.02)):
        blocks, values = [], []
        own = np.array([0.0, *[scatter.gain_rel] * 3, scatter.friction_rel, scatter.gain_rel])
        for shot in drawn.shots:
            assert shot.summary is not None
            sees = np.zeros((6, 6))
            sees[0, 0], sees[1:, 1:] = wide, np.diag(U)
            kept = shot.summary.triangle[:5]  # the last row is a direction that no record tells
            blocks.append((kept @ sees, kept @ np.diag(own)))
            at = shot.summary.reference - np.array([np.log(rows.reference_kg), *[0.0] * 5])
            values.append(shot.summary.seen[:5] + kept @ at)
        common = np.vstack([one for one, _ in blocks])
        covariance = common @ common.T + np.eye(common.shape[0])
        for i, (_, mine) in enumerate(blocks):
            covariance[5 * i : 5 * i + 5, 5 * i : 5 * i + 5] += mine @ mine.T
        whitened = np.linalg.solve(np.linalg.cholesky(covariance), np.concatenate(values))
        density = -0.5 * (whitened @ whitened + np.linalg.slogdet(covariance)[1])
        trial = trial_of(rows, scatter)
        beforehand = scatter.gain_rel / 5e-4 + scatter.friction_rel / 0.03
        found[scatter] = trial.log_likelihood + beforehand - density
    assert np.ptp(list(found.values())) < 1e-3


@pytest.mark.parametrize("force", [0.5, 3.0])
def test_the_size_of_the_force_that_no_gauge_reads_is_integrated_over(force: float) -> None:
    shots = campaign_of(ADDED, seed=8, unread=force).shots
    fit = joint_fit_under(rows_of(shots), Scatter(2e-4, 0.03))
    found = [densities(shots, one, 0.03, 2e-4) for one in FORCES]
    prior = np.array([one / (1.0 + one**2) for one in FORCES])
    weights = prior * np.exp(np.array([one[0] for one in found]) - max(one[0] for one in found))
    weights /= weights.sum()
    assert list(fit.forces.values()) == pytest.approx(weights.tolist(), abs=2e-3)
    masses, u = (np.array([one[at] for one in found]) for at in (2, 3))
    name = fit.rows.masses[0]
    assert fit.value(name) + np.log(fit.rows.reference_kg) == pytest.approx(float(weights @ masses), abs=2e-5)
    variance = float(weights @ (u**2 + (masses - weights @ masses) ** 2))
    assert fit.u(name) == pytest.approx(variance**0.5, rel=5e-3)


@pytest.mark.whole_way
def test_a_larger_force_is_believed_where_the_shots_show_it() -> None:
    small, large = (joint_fit(rows_of(campaign_of(ADDED, seed=9, unread=force).shots)) for force in (0.7, 4.0))
    sizes = [sum(force * weight for force, weight in fit.forces.items()) for fit in (small, large)]
    assert sizes[0] < 2.0
    assert sizes[1] > 2.5


@pytest.mark.whole_way
def test_the_share_that_no_gauge_reads_is_learnt_by_charges_and_an_added_mass() -> None:
    drawn = campaign_of(ADDED, seed=10, unread=1.0)
    fit = joint_fit(rows_of(drawn.shots))
    known = next(one.u for one in fit.rows.influences if one.identity == SHARE)
    assert fit.u(SHARE) < 0.6
    assert fit.value(SHARE) * known == pytest.approx(drawn.errors[SHARE], abs=3 * fit.u(SHARE) * known)


def test_shots_without_errors_give_the_mass_and_no_error_of_a_sensor() -> None:
    rows = rows_of(campaign_of(ADDED, seed=None).shots)
    fit = joint_fit(rows)
    mass_kg, _ = fit.mass_kg(rows.mechanisms[0])
    assert mass_kg == pytest.approx(MASS_KG, rel=1e-9)
    assert [fit.value(name) for name in INFLUENCES] == pytest.approx([0.0] * 5, abs=1e-6)


@pytest.mark.whole_way
def test_an_added_mass_tells_the_scales_that_more_shots_do_not() -> None:
    one, plain, weighed = (
        joint_fit(rows_of(campaign_of(added).shots)) for added in ((0.0,) * 2, (0.0,) * 16, (0.0, 120.0) * 8)
    )
    u_one, u_plain, u_weighed = (fit.mass_kg(fit.rows.mechanisms[0])[1] for fit in (one, plain, weighed))
    # the breech gauge and the accelerometer alone leave half of a percent, and the mean of them no less than its floor
    assert u_plain > 0.75 * u_one
    assert u_weighed < 0.6 * u_plain
    assert weighed.u(BREECH) < plain.u(BREECH)


@pytest.mark.whole_way
def test_the_scatter_that_was_drawn_is_found_and_makes_the_mass_less_sure() -> None:
    still, moving = (joint_fit(rows_of(campaign_of((0.0, 120.0) * 8, seed=5, gain_rel=rel).shots)) for rel in (0, 2e-3))
    assert still.scatter("gain_rel")[0] < 4e-4
    mean, low, high = moving.scatter("gain_rel")
    assert low <= 2e-3 <= high
    assert mean == pytest.approx(2e-3, rel=0.4)
    assert moving.mass_kg("as built")[1] > 1.2 * still.mass_kg("as built")[1]


def test_the_difference_of_two_mechanisms_is_surer_than_either() -> None:
    names = ["before"] * 4 + ["after"] * 4
    drawn = campaign_of((0.0,) * 8, seed=3, step_kg={4: -6.0}, configurations=names)
    fit = joint_fit(rows_of(drawn.shots))
    size, u = fit.difference_kg("after", "before")
    assert abs(size + 6.0) < 3 * u
    assert u < 0.2 * min(fit.mass_kg(name)[1] for name in ("before", "after"))


@pytest.mark.whole_way
@settings(max_examples=5, deadline=None)
@given(st.permutations(range(6)))
def test_the_order_of_a_summarys_parameters_changes_nothing(order: list[int]) -> None:
    drawn = campaign_of((0.0, 60.0, 0.0), seed=1)
    turned = []
    for shot in drawn.shots:
        assert shot.summary is not None
        one = shot.summary
        named = tuple(one.parameters[at] for at in order)
        other = type(one)(named, one.reference[order], one.triangle[:, order], one.seen, {})
        turned.append(replace(shot, summary=other))
    same, other = (trial_of(rows_of(shots), Scatter()).estimate for shots in (drawn.shots, tuple(turned)))
    name = "ln mass of as built"
    assert (other.value(name), other.u(name)) == pytest.approx((same.value(name), same.u(name)), rel=1e-8)


@pytest.mark.whole_way
def test_a_shot_that_lacks_a_parameter_tells_of_the_others() -> None:
    drawn = campaign_of((0.0, 120.0, 0.0, 120.0), seed=7)
    whole = joint_fit(rows_of(drawn.shots))
    blind = []
    for shot in drawn.shots:
        assert shot.summary is not None
        one, kept = shot.summary, [at for at, name in enumerate(NAMES) if name != "friction share"]
        lacking = type(one)(
            tuple(one.parameters[at] for at in kept), one.reference[kept], one.triangle[:5][:, kept], one.seen[:5], {}
        )
        blind.append(replace(shot, summary=lacking) if shot.name == "0002" else shot)
    fit = joint_fit(rows_of(tuple(blind)))
    mass, u = whole.mass_kg("as built")
    assert fit.mass_kg("as built")[0] == pytest.approx(mass, abs=2 * u)


def test_before_any_shot_each_size_of_the_force_is_as_likely_as_its_prior_says() -> None:
    shots = campaign_of(ADDED, seed=8, unread=3.0).shots
    fit = joint_fit_under(rows_of(shots), Scatter(2e-4, 0.03))
    assert fit.before_any_shot.weights == pytest.approx([0.2765, 0.2552, 0.2083, 0.1535, 0.1063], abs=1e-4)
    assert fit.weights != pytest.approx(fit.before_any_shot.weights, abs=0.05)


def test_divided_rows_are_handed_on_with_other_columns_alone() -> None:
    rows, usual = rows_of(campaign_of(ADDED).shots), Scatter(0.002, 0.01)
    divided = rows.whitened(usual).triangle
    assert rows.with_columns(()).divided is rows.divided
    disagreeing = weighed(rows, Agreement((), Misfit(90.0, 10)))
    for other in (disagreeing, rows.without(1)):
        assert other is not None
        assert not np.array_equal(other.whitened(usual).triangle[1:], divided[1:])


def test_the_first_mechanism_stays_the_first_whichever_shot_is_its_own() -> None:
    shots = [replace(one, configuration="old" if k == 0 else "new") for k, one in enumerate(campaign_of(ADDED).shots)]
    rows = JointRows.of(shots, {"new": "new", "old": "old"})
    assert rows.mechanisms == ("new", "old")
    assert list(rows.mechanism_of.items()) == [("new", "new"), ("old", "old")]
    assert JointRows.of(shots, rows.mechanism_of).mechanism.tolist() == [1] + [0] * (len(shots) - 1)
