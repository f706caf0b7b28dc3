"""A score says of columns without unknowns what a new fit with unknowns for them finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.score import Scores
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown

NAMES, FURTHER = ("a", "b"), ("p", "q")


@pytest.mark.exhaustive
@given(st.integers(0, 2**32 - 1))
def test_the_misfit_falls_by_as_much_as_the_score_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table, seen = rng.normal(size=(12, 4)), rng.normal(size=12)
    known = [Prior.of("known", "a", 0.7, 0.3)]
    block = LinearBlock(NAMES, table[:, :2], seen, 1.0)
    found = solve([Unknown(name) for name in NAMES], [block], known)
    left, derivatives = block.linearised(dict(zip(NAMES, found.values, strict=True)))
    scores = Scores.of(left, derivatives, found.covariance, table[:, 2:])
    for chosen in ((0,), (1,), (0, 1)):
        names = (*NAMES, *(FURTHER[number] for number in chosen))
        more = LinearBlock(names, table[:, [0, 1, *(2 + number for number in chosen)]], seen, 1.0)
        with_more = solve([Unknown(name) for name in names], [more], known)
        assert scores.fall(chosen) == pytest.approx(found.misfit - with_more.misfit, rel=1e-6, abs=1e-8)
    assert scores.normalised[0] ** 2 == pytest.approx(scores.fall((0,)))


def test_a_column_that_the_unknowns_explain_is_not_told() -> None:
    table = np.random.default_rng(1).normal(size=(12, 2))
    block = LinearBlock(NAMES, table, np.ones(12), 1.0)
    found = solve([Unknown(name) for name in NAMES], [block], [])
    left, derivatives = block.linearised(dict(zip(NAMES, found.values, strict=True)))
    scores = Scores.of(left, derivatives, found.covariance, np.column_stack([table @ [2.0, -1.0], np.arange(12.0)]))
    assert scores.identifiable.tolist() == [False, True]
    assert scores.normalised[0] == scores.fall((0,)) == 0.0
    np.testing.assert_allclose(scores.correlation, [[0.0, 0.0], [0.0, 1.0]])


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-8, 1.0, 1e8]))
def test_a_column_is_told_if_more_than_a_ten_thousandth_of_its_energy_is_its_own(seed: int, size: float) -> None:
    explained, own = np.linalg.qr(np.random.default_rng(seed).normal(size=(12, 2)))[0].T
    # the share of a column's energy that is its own
    shares = np.array([1.1e-4, 0.9e-4])
    columns = size * (explained[:, np.newaxis] * np.sqrt(1.0 - shares) + own[:, np.newaxis] * np.sqrt(shares))
    scores = Scores.of(own, explained[:, np.newaxis], np.eye(1), np.column_stack([columns, np.zeros(12)]))
    assert scores.identifiable.tolist() == [True, False, False]
    # all that is left of the rows is one of what the column has of its own
    np.testing.assert_allclose(scores.normalised, [1.0, 0.0, 0.0], atol=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_a_column_that_nobody_tells_moves_the_unknowns_by_as_much_as_is_said(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table, column, seen = rng.normal(size=(12, 2)), rng.normal(size=12), rng.normal(size=12)
    known = [Prior.of("known", "a", 0.7, 0.3)]
    without, within = (
        solve([Unknown(name) for name in NAMES], [LinearBlock(NAMES, table, rows, 1.0)], known)
        for rows in (seen, seen + 0.4 * column)
    )
    left, derivatives = LinearBlock(NAMES, table, seen, 1.0).linearised(dict(zip(NAMES, without.values, strict=True)))
    moves = Scores.of(left, derivatives, without.covariance, column[:, np.newaxis]).moves
    np.testing.assert_allclose(np.abs(0.4 * moves[:, 0]), np.abs(within.values - without.values), atol=1e-9)


def test_what_two_columns_say_alike_counts_once() -> None:
    rng = np.random.default_rng(2)
    left, column = rng.normal(size=12), rng.normal(size=12)
    alike = np.column_stack([column, -3.0 * column])
    scores = Scores.of(left, np.zeros((12, 0)), np.zeros((0, 0)), alike)
    np.testing.assert_allclose(scores.correlation, [[1.0, -1.0], [-1.0, 1.0]], atol=1e-12)
    by_hand = (column @ left) ** 2 / (column @ column)
    assert scores.fall((0, 1)) == pytest.approx(scores.fall((0,))) == pytest.approx(by_hand)


def test_without_any_column_the_misfit_falls_by_nothing() -> None:
    scores = Scores.of(np.ones(3), np.zeros((3, 0)), np.zeros((0, 0)), np.eye(3))
    assert scores.fall(()) == 0.0
