import numpy as np
import pytest

from recoil_processing.alignment.velocity_walk import WalkFilter

MARKER_VARIANCE, DENSITY = 2.5e-9, 1.25e-3


def uneven_times(count: int, seed: int = 0) -> np.ndarray:
    return 5.0 + np.cumsum(np.random.default_rng(seed).uniform(2e-4, 2e-3, count))


def walk_covariance(times: np.ndarray, density: float) -> np.ndarray:
    """Covariance of the double integral of white noise from the first instant on, at all pairs of instants."""
    since = times - times[0]
    early, late = np.minimum.outer(since, since), np.maximum.outer(since, since)
    return density * early**2 * (3 * late - early) / 6


def test_whitened_rows_are_those_of_the_dense_covariance():
    times = uneven_times(60)
    columns = np.random.default_rng(1).standard_normal((60, 4))
    walk = WalkFilter.design(times, MARKER_VARIANCE, DENSITY)
    dense = walk_covariance(times, DENSITY) + MARKER_VARIANCE * np.eye(60)
    factor = np.linalg.cholesky(dense)
    # Cholesky's factor is the only lower triangle that whitens, so the rows agree one by one
    assert np.allclose(walk.whiten(columns), np.linalg.solve(factor, columns), rtol=1e-8, atol=1e-8 * 2e4)
    assert walk.log_determinant == pytest.approx(2 * np.log(np.diag(factor)).sum(), rel=1e-12)


def test_the_transpose_is_the_transpose_and_tails_have_their_energy():
    rng = np.random.default_rng(3)
    walk = WalkFilter.design(uneven_times(60), MARKER_VARIANCE, DENSITY)
    matrix = walk.whiten(np.eye(60))
    rows = rng.standard_normal((60, 3))
    assert np.allclose(walk.whiten_transposed(rows), matrix.T @ rows, rtol=1e-9, atol=1e-9 * np.abs(matrix).max())
    column = rng.standard_normal(60)
    tails = np.tril(np.ones((60, 60))) * column[:, None]
    assert np.allclose(walk.tail_energies(column), ((matrix @ tails) ** 2).sum(axis=0), rtol=1e-9)


def test_one_instant_is_marker_noise_alone():
    walk = WalkFilter.design(np.array([3.0]), 4.0, 1.0)
    assert walk.whiten(np.array([[6.0]])).tolist() == [[3.0]]


def test_a_walk_far_above_the_markers_noise_keeps_its_variances_positive():
    walk = WalkFilter.design(np.arange(2000) * 1e-3, 1e-18, 1e6)
    assert np.all(walk.gains[1:] > 0)
    assert np.all(walk.variances > 0)


def test_no_instants_are_refused():
    with pytest.raises(ValueError, match="no instants"):
        WalkFilter.design(np.empty(0), 1.0, 1.0)


@pytest.mark.parametrize("times", [[0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, np.nan, 1.0]])
def test_instants_that_do_not_increase_are_refused(times):
    with pytest.raises(ValueError, match="increase strictly"):
        WalkFilter.design(np.array(times), 1.0, 1.0)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_noise_levels_that_are_none_are_refused(value):
    with pytest.raises(ValueError, match="marker_variance must be positive"):
        WalkFilter.design(np.arange(3.0), value, 1.0)
    with pytest.raises(ValueError, match="density must be positive"):
        WalkFilter.design(np.arange(3.0), 1.0, value)
