import numpy as np
import pytest

from recoil_processing.motion.walk_smoother import WalkSmoother

SIGMA, DENSITY = 5e-5, 1.25e-3


def nodes(seed: int = 0, count: int = 24) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(3e-4, 1e-3, count))
    seen = rng.random(count) < 0.7
    return times, seen, DENSITY * rng.choice([1.0, 1.0, 30.0], count - 1)


def growth(step: float) -> np.ndarray:
    return np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])


def dense_covariance(times: np.ndarray, densities: np.ndarray) -> np.ndarray:
    """Covariance of all states ``w_0 w'_0 w_1 ...`` of a walk from zero, by its definition."""
    n = times.size
    total = np.zeros((2 * n, 2 * n))
    for j, (step, density) in enumerate(zip(np.diff(times), densities, strict=True), 1):
        effect = np.zeros((2 * n, 2))
        for i in range(j, n):
            effect[2 * i : 2 * i + 2] = [[1.0, times[i] - times[j]], [0.0, 1.0]]
        total += density * effect @ growth(step) @ effect.T
    return total


def conditioned(times, seen, densities, values):
    """Mean and covariance of all states given the positions, by the normal distribution's own formula."""
    total = dense_covariance(times, densities)
    at = 2 * np.flatnonzero(seen)
    gain = np.linalg.solve(total[np.ix_(at, at)] + SIGMA**2 * np.eye(at.size), total[at]).T
    return gain @ values, total - gain @ total[at], total[np.ix_(at, at)] + SIGMA**2 * np.eye(at.size)


def test_states_and_covariances_are_those_of_the_conditioned_normal_distribution():
    times, seen, densities = nodes()
    values = SIGMA * np.random.default_rng(1).standard_normal((int(seen.sum()), 2))
    smoother = WalkSmoother.design(times, seen, SIGMA**2, densities)
    states, _ = smoother.smooth(values)
    mean, covariance, _ = conditioned(times, seen, densities, values)
    assert np.allclose(states.reshape(-1, 2), mean, rtol=1e-8, atol=1e-9 * np.abs(mean).max())
    blocks = covariance.reshape(times.size, 2, times.size, 2)
    for i in range(times.size):
        assert np.allclose(smoother.covariances[i], blocks[i, :, i], rtol=1e-7, atol=1e-16)
    for i in range(times.size - 1):
        assert np.allclose(smoother.lagged[i], blocks[i, :, i + 1], rtol=1e-7, atol=1e-16)


def test_rows_have_the_likelihood_of_the_positions():
    times, seen, densities = nodes(3)
    values = SIGMA * np.random.default_rng(2).standard_normal((int(seen.sum()), 1))
    smoother = WalkSmoother.design(times, seen, SIGMA**2, densities)
    _, rows = smoother.smooth(values)
    _, _, total = conditioned(times, seen, densities, values)
    assert float(rows[:, 0] @ rows[:, 0]) == pytest.approx(float(values[:, 0] @ np.linalg.solve(total, values[:, 0])))
    assert smoother.log_determinant == pytest.approx(np.linalg.slogdet(total)[1])


def test_between_nodes_it_says_what_a_node_there_would_say():
    times, seen, densities = nodes(4)
    values = SIGMA * np.random.default_rng(5).standard_normal((int(seen.sum()), 1))
    instants = np.concatenate([times[:-1] + share * np.diff(times) for share in (0.0, 0.13, 0.5, 0.9)])
    smoother = WalkSmoother.design(times, seen, SIGMA**2, densities)
    states, _ = smoother.smooth(values)
    at = smoother.between(instants)
    position, velocity = smoother.interpolate(states, at)
    u2, w2 = smoother.variances(at)
    for k, instant in enumerate(instants[times.size - 1 :], times.size - 1):
        i = int(np.searchsorted(times, instant))
        finer = WalkSmoother.design(
            np.insert(times, i, instant), np.insert(seen, i, False), SIGMA**2, np.insert(densities, i, densities[i - 1])
        )
        there = finer.smooth(values)[0][i]
        assert position[0, k] == pytest.approx(there[0, 0], rel=1e-7, abs=1e-12)
        assert velocity[0, k] == pytest.approx(there[1, 0], rel=1e-7, abs=1e-9)
        assert u2[k] == pytest.approx(finer.covariances[i, 0, 0], rel=1e-6, abs=1e-17)
        assert w2[k] == pytest.approx(finer.covariances[i, 1, 1], rel=1e-6, abs=1e-14)
    assert np.allclose(position[0, : times.size - 1], states[:-1, 0, 0], rtol=0, atol=1e-15)


def test_a_node_where_nothing_was_seen_changes_nothing_however_near_another_it_is():
    times, seen, densities = nodes(6)
    values = SIGMA * np.random.default_rng(7).standard_normal((int(seen.sum()), 1))
    plain = WalkSmoother.design(times, seen, SIGMA**2, densities).smooth(values)[0]
    near = np.insert(times, 6, times[6] - 1e-12)
    added = WalkSmoother.design(near, np.insert(seen, 6, False), SIGMA**2, np.insert(densities, 6, densities[5]))
    assert np.allclose(np.delete(added.smooth(values)[0], 6, axis=0), plain, rtol=1e-6, atol=1e-12)


def test_a_long_record_before_the_first_frame_leaves_variances_positive():
    times = np.concatenate([[0.0], 10.0 + np.arange(300) / 2000])
    seen = np.arange(301) > 0
    smoother = WalkSmoother.design(times, seen, SIGMA**2, np.full(300, DENSITY))
    assert np.all(smoother.covariances[1:, 0, 0] > 0)
    assert np.all(smoother.covariances[1:, 0, 0] < SIGMA**2)


@pytest.mark.parametrize(
    ("times", "seen", "variance", "densities", "message"),
    [
        ([0.0], [True], 1.0, [], "n at least 2"),
        ([0.0, 1.0], [True], 1.0, [1.0], "are needed"),
        ([0.0, 1.0], [True, True], 1.0, [1.0, 1.0], "are needed"),
        ([0.0, 0.0], [True, True], 1.0, [1.0], "increase strictly"),
        ([0.0, 1.0], [True, True], 0.0, [1.0], "marker_variance must be positive"),
        ([0.0, 1.0], [True, True], np.nan, [1.0], "marker_variance must be positive"),
        ([0.0, 1.0], [True, True], 1.0, [0.0], "least_density must be positive"),
        ([0.0, 1.0], [True, True], 1.0, [np.inf], "density must be positive"),
    ],
)
def test_what_cannot_be_smoothed_is_refused(times, seen, variance, densities, message):
    with pytest.raises(ValueError, match=message):
        WalkSmoother.design(np.array(times), np.array(seen, dtype=bool), variance, np.array(densities))
