"""A banded correlation against the whole matrix."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_identification.inference.correlation import Correlation
from tests.builders.correlations import lower_factor


def written_out(seed: int, near: int, last: int, band: int) -> np.ndarray:
    """Draw a correlation of which the first rows are correlated with the `band` rows about them at most."""
    rng = np.random.default_rng(seed)
    factor = np.tril(rng.normal(size=(near + last, near + last)))
    rows, columns = np.indices(factor.shape)
    factor[(rows < near) & (rows - columns >= band)] = 0.0
    factor[np.diag_indices(near + last)] = rng.uniform(1.0, 2.0, near + last)
    return factor @ factor.T


def banded(whole: np.ndarray, near: int, band: int) -> np.ndarray:
    return np.array([np.append(np.diag(whole[:near, :near], -later), np.zeros(later)) for later in range(band)])


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(0, 8), st.integers(1, 6))
def test_it_whitens_as_the_whole_matrix_does(seed, near, last, band):
    band = min(band, near)
    whole = written_out(seed, near, last, band)
    more = (whole[:near, near:], whole[near:, near:]) if last else ()
    correlation = Correlation.of(banded(whole, near, band), *more)
    assert correlation.near.shape == (band, near)
    assert correlation.across.shape == (near, last)
    assert correlation.last.shape == (last, last)
    rows = np.random.default_rng(seed).normal(size=(near + last, 3))
    white = correlation.whitened(rows)
    np.testing.assert_allclose(white.T @ white, rows.T @ np.linalg.solve(whole, rows), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(lower_factor(correlation), np.linalg.cholesky(whole), rtol=1e-6, atol=1e-9)


def test_what_is_no_correlation_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        Correlation.of(np.array([[1.0, 1.0], [2.0, 0.0]]))


def test_one_of_which_nothing_is_zero_is_taken_as_it_is():
    whole = written_out(1, 5, 0, 5)
    np.testing.assert_allclose(lower_factor(Correlation.whole(whole)), np.linalg.cholesky(whole), rtol=1e-9)


def test_rows_keep_their_shape():
    correlation = Correlation.of(np.ones((1, 4)))
    rows = np.arange(8.0).reshape(4, 2)
    np.testing.assert_array_equal(correlation.whitened(rows), rows)
