from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.forces.input_smoother import (
    InputModel,
    follow_intensities,
    log_likelihood,
    smooth_inputs,
)


def random_model(seed: int, steps: int = 12) -> InputModel:
    rng = np.random.default_rng(seed)
    push = rng.normal(size=(2, 3))
    seen = np.sort(rng.integers(0, steps, 15))
    return InputModel(
        transition=np.eye(3) + 0.2 * rng.normal(size=(3, 3)),
        inputs=rng.normal(size=(steps - 1, 3)),
        growths=np.einsum("di,dj->dij", push, push),
        start=rng.normal(size=3),
        start_covariance=np.diag([1.0, 0.5, 2.0]),
        steps=seen,
        rows=rng.normal(size=(seen.size, 3)),
        values=rng.normal(size=seen.size),
        variances=rng.uniform(0.1, 1.0, seen.size),
    )


def joint(model: InputModel, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Means, covariances and log-likelihood by conditioning the one normal distribution of all states at once."""
    n, count = model.start.size, model.count
    mean, covariance = np.zeros((count, n)), np.zeros((count, n, count, n))
    mean[0], covariance[0, :, 0] = model.start, model.start_covariance
    for t in range(1, count):
        F = model.transition
        mean[t] = F @ mean[t - 1] + model.inputs[t - 1]
        grown = np.einsum("d,dij->ij", q[:, t - 1], model.growths)
        for s in range(t):
            covariance[t, :, s] = F @ covariance[t - 1, :, s]
            covariance[s, :, t] = covariance[t, :, s].T
        covariance[t, :, t] = F @ covariance[t - 1, :, t - 1] @ F.T + grown
    m, C = mean.ravel(), covariance.reshape(count * n, count * n)
    H = np.zeros((model.values.size, count * n))
    for i, step in enumerate(model.steps):
        H[i, step * n : (step + 1) * n] = model.rows[i]
    S = H @ C @ H.T + np.diag(model.variances)
    gain = np.linalg.solve(S, H @ C).T
    off = model.values - H @ m
    likelihood = -0.5 * (np.linalg.slogdet(S)[1] + off @ np.linalg.solve(S, off))
    after = (C - gain @ H @ C).reshape(count, n, count, n)
    return (m + gain @ off).reshape(count, n), np.array([after[t, :, t] for t in range(count)]), float(likelihood)


@settings(max_examples=15)
@given(st.integers(0, 10_000))
def test_the_smoother_is_the_conditional_distribution_of_all_states_at_once(seed):
    model = random_model(seed)
    log_q = np.random.default_rng(seed + 1).normal(-1.0, 1.0, (2, model.count - 1))
    found = smooth_inputs(model, log_q)
    states, covariances, likelihood = joint(model, np.exp(log_q))
    np.testing.assert_allclose(found.states, states, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(found.covariances, covariances, rtol=1e-6, atol=1e-8)
    assert found.log_likelihood == pytest.approx(likelihood, rel=1e-9, abs=1e-9)
    assert log_likelihood(model, log_q) == pytest.approx(likelihood, rel=1e-9, abs=1e-9)


def test_the_score_is_the_derivative_of_the_likelihood_by_each_intensity():
    model = random_model(4)
    log_q = np.full((2, model.count - 1), -1.0)
    score = smooth_inputs(model, log_q).score
    for driver in range(2):
        for step in (0, 5, model.count - 2):
            more, less = log_q.copy(), log_q.copy()
            more[driver, step] += 1e-4
            less[driver, step] -= 1e-4
            slope = (log_likelihood(model, more) - log_likelihood(model, less)) / 2e-4
            assert score[driver, step] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_intensities_follow_a_walk_that_wakes_up():
    rng = np.random.default_rng(0)
    steps, wakes = 400, 200
    sigma = np.where(np.arange(steps - 1) < wakes, 0.01, 1.0)
    walk = np.concatenate([[0.0], np.cumsum(sigma * rng.normal(size=steps - 1))])
    model = InputModel(
        transition=np.eye(1),
        inputs=np.zeros((steps - 1, 1)),
        growths=np.ones((1, 1, 1)),
        start=np.zeros(1),
        start_covariance=np.ones((1, 1)),
        steps=np.arange(steps),
        rows=np.ones((steps, 1)),
        values=walk + 0.1 * rng.normal(size=steps),
        variances=np.full(steps, 0.01),
    )
    constant = smooth_inputs(model, np.array([-2.0]))
    found = follow_intensities(model, np.array([-2.0]))
    assert found.log_likelihood > constant.log_likelihood + 50
    early, late = found.log_intensities[0, :150], found.log_intensities[0, 250:]
    assert np.median(late) - np.median(early) > 5.0
    assert np.median(late) == pytest.approx(0.0, abs=1.0)
    z = (found.states[:, 0] - walk) / np.sqrt(found.covariances[:, 0, 0])
    assert np.mean(np.abs(z[wakes:]) < 1.96) > 0.85
    assert np.max(np.abs(z)) < 5.0


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"start_covariance": np.eye(2)}, "start_covariance must have the shape"),
        ({"variances": np.zeros(15)}, "variances must be positive"),
        ({"steps": np.arange(15)[::-1].copy()}, "steps must ascend"),
        ({"steps": np.arange(15) + 100}, "steps must ascend"),
    ],
)
def test_a_model_that_does_not_fit_together_is_refused(changes, says):
    with pytest.raises(ValueError, match=says):
        replace(random_model(1), **changes)


def test_intensities_of_another_number_are_refused():
    with pytest.raises(ValueError, match="log_intensities must have the shape"):
        smooth_inputs(random_model(1), np.zeros((2, 3)))
