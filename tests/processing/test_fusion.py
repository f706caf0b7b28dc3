import numpy as np
import pytest

from processing.fusion import Walk, smooth_walk

SIGMA, DENSITY = 5e-5, 1.25e-3


def walk_sample(seed: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw a walk's position and velocity at the instants, exactly in distribution, from rest at the first."""
    rng = np.random.default_rng(seed)
    states = np.zeros((times.size, 2))
    for i, h in enumerate(np.diff(times), 1):
        growth = np.linalg.cholesky(DENSITY * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]]))
        states[i] = [states[i - 1, 0] + h * states[i - 1, 1], states[i - 1, 1]] + growth @ rng.standard_normal(2)
    return states[:, 0], states[:, 1]


def test_smoothing_solves_the_dense_least_squares_problem():
    times = np.cumsum(np.random.default_rng(0).uniform(3e-4, 1e-3, 25))
    residual = SIGMA * np.random.default_rng(1).standard_normal(25)
    walk = smooth_walk(times, residual, SIGMA**2, DENSITY)
    # unknowns: every state behind the first; rows: every step of the walk and every position, of unit variance
    rows, target = [], []
    for i, h in enumerate(np.diff(times), 1):
        whiten = np.linalg.inv(np.linalg.cholesky(DENSITY * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])))
        block = np.zeros((2, 50))
        block[:, 2 * i : 2 * i + 2] = whiten
        block[:, 2 * i - 2 : 2 * i] = -whiten @ np.array([[1.0, h], [0.0, 1.0]])
        rows.append(block)
        target += [0.0, 0.0]
    for i, z in enumerate(residual):
        row = np.zeros((1, 50))
        row[0, 2 * i] = 1 / SIGMA
        rows.append(row)
        target.append(z / SIGMA)
    design = np.vstack(rows)[:, 2:]
    scale = np.sqrt((design**2).sum(axis=0))
    q, r = np.linalg.qr(design / scale)
    states = np.linalg.solve(r, q.T @ np.array(target)) / scale
    deviations = np.sqrt((np.linalg.inv(r) ** 2).sum(axis=1)) / scale
    for found, expected in (
        (walk.position, np.append(0.0, states[0::2])),
        (walk.velocity, np.append(0.0, states[1::2])),
        (walk.u_position, np.append(0.0, deviations[0::2])),
        (walk.u_velocity, np.append(0.0, deviations[1::2])),
    ):
        assert np.allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


def test_its_uncertainty_is_that_of_its_errors():
    times = np.arange(400) / 2000
    errors, rates = [], []
    for seed in range(40):
        position, velocity = walk_sample(seed, times)
        noise = SIGMA * np.random.default_rng(1000 + seed).standard_normal(times.size)
        walk = smooth_walk(times, position + noise, SIGMA**2, DENSITY)
        errors.append((walk.position - position)[20:] / walk.u_position[20:])
        rates.append((walk.velocity - velocity)[20:] / walk.u_velocity[20:])
    assert 0.9 < np.std(errors) < 1.1
    assert 0.9 < np.std(rates) < 1.1


def test_lost_frames_are_left_out():
    times = np.arange(100) / 2000
    residual = SIGMA * np.random.default_rng(3).standard_normal(100)
    seen = np.ones(100, dtype=bool)
    seen[[0, 17, 18, 19, 99]] = False
    lossy = smooth_walk(times, np.where(seen, residual, np.nan), SIGMA**2, DENSITY)
    kept = smooth_walk(times[seen], residual[seen], SIGMA**2, DENSITY)
    assert np.array_equal(lossy.times_s, times[seen])
    assert np.array_equal(lossy.position, kept.position)


def test_a_single_frame_that_contradicts_its_neighbours_is_left_out():
    times = np.arange(100) / 2000
    residual = SIGMA * np.random.default_rng(3).standard_normal(100)
    spiked = residual.copy()
    spiked[40] += 0.012
    residual[40] = np.nan
    assert np.array_equal(
        smooth_walk(times, spiked, SIGMA**2, DENSITY).position, smooth_walk(times, residual, SIGMA**2, DENSITY).position
    )


@pytest.mark.parametrize("seen", [0, 1])
def test_fewer_than_two_frames_are_refused(seen):
    residual = np.full(5, np.nan)
    residual[:seen] = 0.0
    with pytest.raises(ValueError, match=f"{seen} of 5 frames have a position"):
        smooth_walk(np.arange(5.0), residual, 1.0, 1.0)


@pytest.mark.parametrize(("variance", "density"), [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (1.0, 0.0)])
def test_noise_levels_that_are_none_are_refused(variance, density):
    with pytest.raises(ValueError, match="must be positive"):
        smooth_walk(np.arange(9.0), np.zeros(9), variance, density)


def test_frames_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="increase strictly"):
        smooth_walk(np.array([0.0, 1.0, 1.0]), np.zeros(3), 1.0, 1.0)


def cubic_walk() -> tuple[Walk, np.polynomial.Polynomial]:
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 5.0])
    times = np.array([-1.0, -0.4, 0.0, 0.9, 1.0])
    return Walk(times, cubic(times), cubic.deriv()(times), np.zeros(5), np.zeros(5)), cubic


def test_interpolation_reproduces_the_frames():
    walk = smooth_walk(np.arange(50) / 2000, SIGMA * np.random.default_rng(3).standard_normal(50), SIGMA**2, DENSITY)
    position, velocity = walk.at(walk.times_s)
    assert np.allclose(position, walk.position, rtol=0, atol=1e-15)
    assert np.allclose(velocity, walk.velocity, rtol=0, atol=1e-12)


def test_interpolation_between_the_frames_is_exact_for_a_cubic():
    walk, cubic = cubic_walk()
    between = np.linspace(-1.0, 1.0, 57)
    position, velocity = walk.at(between)
    assert np.allclose(position, cubic(between))
    assert np.allclose(velocity, cubic.deriv()(between))


def test_beyond_the_frames_the_velocity_goes_on():
    walk, cubic = cubic_walk()
    position, velocity = walk.at(np.array([-3.0, 2.5]))
    rate = cubic.deriv()(np.array([-1.0, 1.0]))
    assert np.allclose(velocity, rate)
    assert np.allclose(position, cubic(np.array([-1.0, 1.0])) + rate * np.array([-2.0, 1.5]))
