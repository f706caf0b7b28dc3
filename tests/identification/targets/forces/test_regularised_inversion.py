from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.forces.regularised_inversion import invert


def second_differences(n: int) -> np.ndarray:
    return np.diff(np.eye(n), 2, axis=0)


def smooth_truth(n: int) -> np.ndarray:
    return np.sin(np.linspace(0.0, 7.0, n)) * 20.0


@settings(max_examples=20)
@given(st.integers(0, 1000), st.floats(1e-3, 1e6))
def test_a_given_weight_gives_the_regularised_normal_equations(seed, weight):
    rng = np.random.default_rng(seed)
    rows, data, penalty = rng.normal(size=(30, 8)), rng.normal(size=30), second_differences(8)
    found = invert(rows, data, penalty, weight=weight)
    expected = np.linalg.solve(rows.T @ rows + weight * penalty.T @ penalty, rows.T @ data)
    np.testing.assert_allclose(found.solution, expected, rtol=1e-6, atol=1e-9)
    hat = rows @ np.linalg.solve(rows.T @ rows + weight * penalty.T @ penalty, rows.T)
    assert found.freedom == pytest.approx(30 - np.trace(hat), rel=1e-6)


@pytest.mark.whole_way
def test_the_weight_by_cross_validation_predicts_nearly_as_well_as_the_best_one():
    truth, apart = smooth_truth(120), []
    for seed in range(20):
        data = truth + np.random.default_rng(seed).normal(size=120)
        found = invert(np.eye(120), data, second_differences(120))
        errors = [
            np.mean((invert(np.eye(120), data, second_differences(120), weight=10.0**d).solution - truth) ** 2)
            for d in np.arange(-1.0, 6.0, 0.5)
        ]
        apart.append(np.mean((found.solution - truth) ** 2) / min(errors))
        assert not found.at_bound
    assert np.median(apart) < 1.4
    assert max(apart) < 4.0


@pytest.mark.whole_way
def test_the_stated_intervals_hold_the_truth_on_the_average():
    truth, inside = smooth_truth(120), []
    for seed in range(20):
        data = truth + np.random.default_rng(100 + seed).normal(size=120)
        found = invert(np.eye(120), data, second_differences(120))
        inside.append(np.mean(np.abs(found.solution - truth) < 1.96 * np.sqrt(np.diag(found.covariance))))
    assert 0.88 < np.mean(inside) < 0.995


def test_a_stiff_choice_is_never_less_stiff():
    data = smooth_truth(120) + np.random.default_rng(3).normal(size=120)
    loose, stiff = (invert(np.eye(120), data, second_differences(120), stiff=s) for s in (False, True))
    assert stiff.weight > loose.weight
    assert stiff.freedom > loose.freedom


def test_what_is_known_beforehand_restricts_an_unknown():
    rows = np.column_stack([np.ones(40), np.linspace(-1, 1, 40)])
    penalty = np.zeros((1, 2))
    penalty[0, 0] = 1e-9
    data = rows @ [3.0, 2.0]
    free = invert(rows, data, penalty, weight=1e-9)
    held = invert(rows, data, penalty, weight=1e-9, fixed=np.array([np.inf, 1e-6]))
    np.testing.assert_allclose(free.solution, [3.0, 2.0], rtol=1e-6)
    assert abs(held.solution[1]) < 1e-6
    assert held.solution[0] == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize(
    ("rows", "data", "penalty"),
    [
        (np.eye(4), np.zeros(3), np.eye(4)),
        (np.eye(4), np.zeros(4), np.eye(3)),
        (np.eye(2), np.zeros(2), np.eye(2)),
        (np.eye(4), np.array([0.0, np.nan, 0.0, 0.0]), np.eye(4)),
    ],
)
def test_a_problem_that_does_not_fit_together_is_refused(rows, data, penalty):
    with pytest.raises(ValueError, match=r"do not fit|finite rows"):
        invert(rows, data, penalty)
