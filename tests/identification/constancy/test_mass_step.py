"""The test for one step: its distribution, its power, and the instant and size that it gives."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.constancy.mass_step import StepTest, step_test

N = 200
TIMES = 1e-3 * np.arange(N)
NONE = np.zeros((N, 0))
SLOPE = 300.0 * np.exp(-TIMES / 0.03) - 60.0
"""Much energy early, little later on, as a shot has it."""


def outcome(response: np.ndarray, sigma: float = 1.0, known: np.ndarray = NONE, **more) -> StepTest:
    return step_test(TIMES, response, more.pop("slope", SLOPE), known, NONE, np.full(N, sigma), **more)


def stepped(change: float, at_s: float, seed: int, sigma: float = 1.0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, sigma, N)
    return SLOPE * np.where(at_s <= TIMES, 1.0 + change, 1.0) + noise


def test_the_statistic_of_an_instant_is_the_squared_step_over_its_variance() -> None:
    y = stepped(0.01, 0.0605, 1)
    found = outcome(y, draws=100)
    at = int(np.argmin(np.abs(found.instants_s - 0.06)))
    X = np.column_stack([SLOPE, SLOPE * (found.instants_s[at] <= TIMES)])
    covariance = np.linalg.inv(X.T @ X)
    step = (covariance @ X.T @ y)[1]
    assert found.statistics[at] == pytest.approx(step**2 / covariance[1, 1], rel=1e-9)


def test_calibrated_errors_enter_as_rows_with_a_prior() -> None:
    known = np.column_stack([np.where(TIMES < 0.05, 0.02 * SLOPE, 0.0), np.ones(N)])
    y = stepped(0.01, 0.0605, 2)
    found = outcome(y, known=known, draws=100)
    at = int(np.argmax(found.statistics))
    covariance = np.eye(N) + known @ known.T
    X = np.column_stack([SLOPE, SLOPE * (found.instants_s[at] <= TIMES)])
    inverse = np.linalg.inv(X.T @ np.linalg.solve(covariance, X))
    step = (inverse @ X.T @ np.linalg.solve(covariance, y))[1]
    assert found.statistics[at] == pytest.approx(step**2 / inverse[1, 1], rel=1e-8)


def test_the_critical_value_of_an_even_slope_is_that_of_the_limit() -> None:
    # the limit of a slope whose energy comes at an even rate: the squared Brownian bridge over its variance
    found = outcome(np.ones(N), slope=np.ones(N))
    rng = np.random.default_rng(3)
    share = np.linspace(0.02, 0.98, 120)
    steps = np.sqrt(np.diff(share, prepend=0.0, append=1.0)) * rng.standard_normal((40_000, 121))
    walks = np.cumsum(steps, axis=1)
    bridges = walks[:, :-1] - share * walks[:, -1:]
    largest = np.max(bridges**2 / (share * (1 - share)), axis=1)
    assert found.critical_5 == pytest.approx(np.quantile(largest, 0.95), rel=0.06)
    assert found.critical_1 == pytest.approx(np.quantile(largest, 0.99), rel=0.08)
    assert found.p_value == 1.0


def test_without_a_step_p_is_even_whatever_the_slope_and_the_sensors() -> None:
    rng = np.random.default_rng(4)
    known = np.column_stack([np.where(TIMES < 0.05, 0.02 * SLOPE, 0.0), np.ones(N)])
    p = []
    for _ in range(300):
        y = 1.03 * SLOPE + known @ rng.standard_normal(2) + rng.standard_normal(N)
        p.append(outcome(y, known=known, draws=1000).p_value)
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.04)
    assert np.mean(np.array(p) < 0.5) == pytest.approx(0.5, abs=0.1)
    wrong = 1.03 * SLOPE + 2 * known[:, 0] + rng.standard_normal(N)
    assert outcome(wrong, draws=1000).p_value < 0.01
    assert outcome(wrong, known=known, draws=1000).p_value > 0.05


@pytest.mark.parametrize("at_s", [0.0205, 0.0605])
def test_instant_and_size_are_found_within_their_uncertainty(at_s: float) -> None:
    found = [outcome(stepped(0.08, at_s, seed), draws=200) for seed in range(60)]
    assert all(f.p_value < 0.02 for f in found)
    held = np.mean([f.interval_s[0] - 1e-3 <= at_s <= f.interval_s[1] + 1e-3 for f in found])
    assert held > 0.85
    z = np.array([(f.change - 0.08) / f.u_change for f in found])
    assert abs(z.mean()) < 0.6
    assert 0.6 < z.std() < 1.5
    assert np.mean([f.slope for f in found]) == pytest.approx(1.0, abs=0.003)
    assert all(f.interval_s[0] <= f.instant_s <= f.interval_s[1] for f in found)


def test_what_a_filter_makes_of_a_step_is_taken_for_one() -> None:
    def slow(since_s: np.ndarray) -> np.ndarray:
        return np.clip(0.5 + since_s / 0.02, 0.0, 1.0)

    y = SLOPE * (1 + 0.1 * slow(TIMES - 0.05))
    smooth, sharp = outcome(y, transition=slow, draws=100), outcome(y, draws=100)
    assert np.abs(smooth.residual).max() < 0.3 * np.abs(sharp.residual).max()
    assert smooth.change == pytest.approx(0.1, rel=0.05)
    assert smooth.instant_s == pytest.approx(0.05, abs=1e-3)


def test_what_the_step_leaves_is_noise_alone() -> None:
    found = outcome(stepped(0.3, 0.0605, 9, sigma=0.5), sigma=0.5, draws=100)
    assert np.std(found.residual) == pytest.approx(1.0, abs=0.15)


def test_the_callers_mistakes_are_named() -> None:
    few = np.ones(8)
    with pytest.raises(ValueError, match="too few to look for a step"):
        step_test(few, few, few, np.zeros((8, 0)), np.zeros((8, 0)), few)
    with pytest.raises(ValueError, match="none could be told"):
        step_test(TIMES, SLOPE, SLOPE, NONE, np.eye(N), np.ones(N))
