"""The Monte Carlo method and its comparison with the linear budget."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.estimate.monte_carlo import LEAST_BLOCKS, MonteCarlo, numerical_tolerance, propagate
from recoil_identification.inference.solve import solve
from tests.builders.calibrations import a_calibration
from tests.builders.correlations import lower_factor
from tests.builders.virtual_shots import identified


def drawn_of(draw, **options) -> MonteCarlo:
    found = propagate(draw, **options)
    assert found is not None
    return found


def test_a_normal_measurand_has_its_known_interval():
    drawn = drawn_of(lambda rng, n: 5.0 + 2.0 * rng.standard_normal(n), seed=1)
    assert drawn.converged
    assert drawn.u == pytest.approx(2.0, abs=0.05)
    assert drawn.interval == pytest.approx(stats.norm.interval(0.95, 5.0, 2.0), abs=0.06)
    assert drawn.shortest == pytest.approx(drawn.interval, abs=0.1)


def test_the_shortest_interval_of_a_skewed_measurand_is_shorter_than_the_symmetric_one():
    drawn = drawn_of(lambda rng, n: rng.exponential(1.0, n), seed=2)
    assert drawn.interval == pytest.approx(stats.expon.interval(0.95), abs=0.05)
    assert drawn.shortest[0] < 0.01
    assert drawn.shortest[1] == pytest.approx(-math.log(0.05), abs=0.05)


def test_the_same_seed_gives_the_same_result_and_another_one_not():
    def draw(rng, n):
        return rng.standard_normal(n)

    assert drawn_of(draw, seed=3) == drawn_of(draw, seed=3)
    assert drawn_of(draw, seed=3).mean != drawn_of(draw, seed=4).mean


def test_draws_that_do_not_suffice_are_said_not_to():
    # u = 9.9: two digits ask for 0.05 in 9.9
    drawn = drawn_of(lambda rng, n: 9.9 * rng.standard_normal(n), seed=5, most_blocks=LEAST_BLOCKS)
    assert not drawn.converged
    assert drawn.scatter > drawn.tolerance == 0.05


@pytest.mark.parametrize(("u", "tolerance"), [(2.9, 0.05), (0.0123, 0.0005), (99.7, 5.0), (9.96, 0.5), (0.0, 0.0)])
def test_the_tolerance_is_half_of_the_last_digit_that_matters(u, tolerance):
    assert numerical_tolerance(u) == pytest.approx(tolerance, rel=1e-12)


def test_draws_that_are_not_finite_give_no_distribution_and_too_few_blocks_are_refused():
    assert propagate(lambda _, n: np.full(n, np.nan)) is None
    with pytest.raises(ValueError, match="most_blocks"):
        propagate(lambda rng, n: rng.standard_normal(n), most_blocks=1)


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_budget_of_a_shot_agrees_with_its_draws(name):
    found = identified(name)
    estimate, drawn = found.results["calibrated"].estimate, found.monte_carlo
    assert drawn is not None
    assert drawn.converged
    assert drawn.u == pytest.approx(estimate.u_kg, rel=0.02)
    low, high = drawn.differences(estimate.interval_kg)
    assert max(abs(low), abs(high)) < 0.05 * estimate.u_kg


def test_draws_of_a_strongly_uncertain_scale_keep_what_is_not_linear():
    uncertain = a_calibration(
        MassEstimate("calibrated", 100.0, (BudgetRow("random", 0.0, "A"),), 10, 0.0), u_ln_mass=0.15
    )
    masses = uncertain.draws()(np.random.default_rng(1), 40_000)
    assert np.log(masses).std() == pytest.approx(0.15, rel=0.02)
    # the mean of e^x
    assert masses.mean() == pytest.approx(100.0 * math.exp(0.15**2 / 2), rel=3e-3)


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_a_drawn_shot_that_is_solved_anew_is_where_the_linear_draw_has_it(name):
    found, rng = identified(name), np.random.default_rng(7)
    calibration = found.route.calibration
    inferred, together = calibration.inferred, calibration.rows
    block, camera = together.parts
    design = np.zeros((block.rows.size + camera.times_s.size, len(inferred.unknowns)))
    at = [[one.name for one in inferred.unknowns].index(unknown) for unknown in together.unknowns]
    design[:, at] = together.linearised(calibration.values)[1]
    factor, apart = lower_factor(together.correlation), []
    for _ in range(20):
        noise, drawn, moved = rng.standard_normal(design.shape[0]), [], []
        for prior in (*calibration.common, *calibration.own):
            errors = rng.standard_normal(len(prior.sources))
            drawn.append(errors)
            moved.append(replace(prior, values=prior.values + np.linalg.cholesky(prior.covariance) @ errors))
        recorded = factor @ noise
        acceleration = found.route.fitted.acceleration_m_s2.copy()
        acceleration[block.rows] += block.sigma_m_s2 * recorded[: block.rows.size]
        noisy = (
            replace(block, regression=replace(found.route.fitted, acceleration_m_s2=acceleration)),
            replace(camera, recorded_m=camera.recorded_m + camera.sigma_m * recorded[block.rows.size :]),
        )
        rows = [replace(together, parts=noisy), *calibration.further]
        solved = solve(inferred.unknowns, rows, moved, calibration.values).value("ln mass")
        linear = inferred.contributions[0] @ np.concatenate(drawn) + inferred.covariance[0] @ design.T @ noise
        apart.append(solved - inferred.value("ln mass") - linear)
    assert np.abs(apart).max() < 0.02 * inferred.u("ln mass")
