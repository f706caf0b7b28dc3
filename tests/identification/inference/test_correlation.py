"""Rows that a correlation whitens, against the inverse of the whole matrix."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_identification.inference.correlation import Correlation
from tests.builders.correlations import lower_factor


def drawn(seed: int, size: int) -> np.ndarray:
    """Draw a covariance."""
    rng = np.random.default_rng(seed)
    factor = np.tril(rng.normal(size=(size, size)))
    factor[np.diag_indices(size)] = rng.uniform(1.0, 2.0, size)
    return factor @ factor.T


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_it_whitens_as_the_inverse_of_the_whole_matrix_does(seed, size):
    whole = drawn(seed, size)
    correlation = Correlation.of(whole)
    rows = np.random.default_rng(seed).normal(size=(size, 3))
    white = correlation.whitened(rows)
    np.testing.assert_allclose(white.T @ white, rows.T @ np.linalg.solve(whole, rows), rtol=1e-6, atol=1e-9)
    # the first rows are whitened by themselves alone, so that those of the motion do not hang on the frames behind them
    np.testing.assert_allclose(np.triu(lower_factor(correlation), 1), 0.0, atol=1e-9)


def test_what_is_no_correlation_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        Correlation.of(np.array([[1.0, 2.0], [2.0, 1.0]]))


def test_rows_without_any_correlation_are_kept_as_they_are():
    rows = np.arange(8.0).reshape(4, 2)
    np.testing.assert_array_equal(Correlation.of(np.eye(4)).whitened(rows), rows)
