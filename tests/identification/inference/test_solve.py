"""Blocks and priors are solved as generalized least squares, and what follows of them is what a refit shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from recoil_identification.inference.block import JointBlock, LinearBlock
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.estimate import ROWS, Estimate
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown

NAMES = ("a", "b", "c", "d")
UNKNOWNS = tuple(Unknown(name) for name in NAMES)
SEEDS = st.integers(0, 2**32 - 1)


def covariance(rng: np.random.Generator, size: int) -> np.ndarray:
    root = np.tril(rng.normal(size=(size, size))) + 2.0 * np.eye(size)
    return root @ root.T


def problem(seed: int) -> tuple[list[LinearBlock], list[Prior]]:
    """Two blocks about three of four unknowns each, and priors: a pair that is correlated, and one alone."""
    rng = np.random.default_rng(seed)
    blocks = [
        LinearBlock(names, rng.normal(size=(9, 3)), rng.normal(size=9), float(rng.uniform(0.1, 3.0)))
        for names in (("a", "b", "c"), ("d", "c", "a"))
    ]
    pair = Prior(("p", "q"), ("b", "d", "a"), rng.normal(size=(2, 3)), rng.normal(size=2), covariance(rng, 2))
    return blocks, [pair, Prior.of("r", "c", float(rng.uniform(0.1, 3.0)), float(rng.normal()))]


def dense(blocks: list[LinearBlock], priors: list[Prior]) -> tuple[np.ndarray, np.ndarray]:
    """Values and covariance by normal equations, summed up one by one."""
    information, right = np.zeros((4, 4)), np.zeros(4)
    for part in [*blocks, *priors]:
        if isinstance(part, LinearBlock):
            rows, seen, weight = part.columns, part.recorded, np.eye(part.recorded.size) / part.sigma**2
        else:
            rows, seen, weight = part.rows, part.values, np.linalg.inv(part.covariance)
        full = np.zeros((seen.size, 4))
        for column, name in zip(rows.T, part.unknowns, strict=True):
            full[:, NAMES.index(name)] = column
        information += full.T @ weight @ full
        right += full.T @ weight @ seen
    return np.linalg.solve(information, right), np.linalg.inv(information)


@given(SEEDS)
def test_it_is_generalized_least_squares(seed: int) -> None:
    blocks, priors = problem(seed)
    found = solve(UNKNOWNS, blocks, priors)
    values, expected = dense(blocks, priors)
    np.testing.assert_allclose(found.values, values, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-8, atol=1e-10)
    assert found.converged
    assert found.rows == 18
    assert found.value("c") == found.values[2]
    assert found.u("c") == pytest.approx(np.sqrt(expected[2, 2]))


@pytest.mark.exhaustive
@given(SEEDS)
def test_rows_whose_errors_are_correlated_count_by_the_inverse_of_their_covariance(seed: int) -> None:
    blocks, priors = problem(seed)
    factors = np.random.default_rng(seed).normal(size=(18, 3))
    correlation = np.eye(18) + factors @ factors.T
    joint = JointBlock(tuple(blocks), Correlation.of(correlation))
    found = solve(UNKNOWNS, [joint], priors)
    columns, seen = np.zeros((18, 4)), np.concatenate([block.recorded / block.sigma for block in blocks])
    for number, block in enumerate(blocks):
        at = [NAMES.index(name) for name in block.unknowns]
        columns[9 * number : 9 * (number + 1), at] = block.columns / block.sigma
    weight = np.linalg.inv(correlation)
    together = LinearBlock(NAMES, np.linalg.cholesky(weight).T @ columns, np.linalg.cholesky(weight).T @ seen, 1.0)
    values, expected = dense([together], priors)
    np.testing.assert_allclose(found.values, values, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-6, atol=1e-9)
    apart, without = solve(UNKNOWNS, [JointBlock(tuple(blocks))], priors), solve(UNKNOWNS, blocks, priors)
    np.testing.assert_allclose(apart.values, without.values, rtol=1e-10, atol=1e-12)


@given(SEEDS)
def test_the_contributions_add_up_to_the_variance(seed: int) -> None:
    found = solve(UNKNOWNS, *problem(seed))
    for at, name in enumerate(NAMES):
        total = found.u_random(name) ** 2 + float((found.contributions[at] ** 2).sum())
        assert total == pytest.approx(found.u(name) ** 2, rel=1e-9)


@given(SEEDS)
def test_the_parts_of_a_quantity_are_those_of_its_variance_by_sources(seed: int) -> None:
    blocks, priors = problem(seed)
    found = solve(UNKNOWNS, blocks, priors)
    slope = np.array([0.0, -2.0, 0.5, 0.0])
    parts = found.parts_of({"b": -2.0, "c": 0.5})
    assert [*parts] == [ROWS, "p", "q", "r"]
    assert sum(part**2 for part in parts.values()) == pytest.approx(float(slope @ found.covariance @ slope), rel=1e-8)
    moved = solve(UNKNOWNS, blocks, [priors[0], replace(priors[1], values=priors[1].values + found.u_sources[2])])
    assert abs(float(slope @ (moved.values - found.values))) == pytest.approx(parts["r"], rel=1e-6, abs=1e-9)


def test_a_quantity_that_hangs_on_what_nothing_determines_is_infinitely_uncertain() -> None:
    found = solve((Unknown("a"), Unknown("b")), [LinearBlock(("a",), np.ones((2, 1)), np.ones(2), 1.0)], [])
    assert math.isinf(found.parts_of({"b": 1.0})[ROWS])
    assert found.parts_of({"a": 1.0})[ROWS] == pytest.approx(found.u("a"))


@pytest.mark.exhaustive
@given(SEEDS)
def test_a_contribution_is_what_a_refit_finds_when_the_source_moves_by_its_uncertainty(seed: int) -> None:
    blocks, priors = problem(seed)
    found = solve(UNKNOWNS, blocks, priors)
    moved = solve(UNKNOWNS, blocks, [priors[0], replace(priors[1], values=priors[1].values + found.u_sources[2])])
    np.testing.assert_allclose(moved.values - found.values, found.contributions[:, 2], rtol=1e-6, atol=1e-9)
    # of a correlated pair the first takes along what it shares with the second
    root = np.linalg.cholesky(priors[0].covariance)
    moved = solve(UNKNOWNS, blocks, [replace(priors[0], values=priors[0].values + root[:, 0]), priors[1]])
    np.testing.assert_allclose(moved.values - found.values, found.contributions[:, 0], rtol=1e-6, atol=1e-9)


@pytest.mark.exhaustive
@given(SEEDS)
def test_the_square_of_a_normalised_residual_is_what_the_misfit_falls_by_without_the_source(seed: int) -> None:
    blocks, (pair, alone) = problem(seed)
    found = solve(UNKNOWNS, blocks, [pair, alone])
    only_q = Prior(("q",), pair.unknowns, pair.rows[1:], pair.values[1:], pair.covariance[1:, 1:])
    for source, others in (("p", [only_q, alone]), ("r", [pair])):
        fall = found.misfit - solve(UNKNOWNS, blocks, others).misfit
        assert found.normalised_residual(source) ** 2 == pytest.approx(fall, rel=1e-6, abs=1e-8)
    off = found.value("c") - alone.values[0]
    assert found.pulls[found.sources.index("r")] == pytest.approx(off / np.sqrt(alone.covariance[0, 0]))
    assert np.sign(found.normalised_residual("r")) == np.sign(off)


@given(SEEDS)
def test_the_triangle_holds_all_that_the_blocks_say(seed: int) -> None:
    blocks, priors = problem(seed)
    found = solve(UNKNOWNS, blocks, priors)
    again = LinearBlock(
        NAMES, found.triangle[:, :-1], found.triangle[:, -1] + found.triangle[:, :-1] @ found.values, 1.0
    )
    summarised = solve(UNKNOWNS, [again], priors)
    np.testing.assert_allclose(summarised.values, found.values, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(summarised.covariance, found.covariance, rtol=1e-8, atol=1e-10)


@pytest.mark.exhaustive
@given(SEEDS)
def test_what_is_left_of_some_unknowns_holds_all_that_the_blocks_and_some_priors_say_of_them(seed: int) -> None:
    blocks, (pair, alone) = problem(seed)
    found = solve(UNKNOWNS, blocks, [pair, alone])
    for priors in ([pair], [pair, Prior.of("drawing", "d", 0.0, found.value("d"))]):
        whole = solve(UNKNOWNS, blocks, [*priors, alone])
        rows, seen = whole.about(["c", "a"], priors)
        assert rows.shape == (2, 2)
        at = np.array([whole.value("c"), whole.value("a")])
        left = solve([Unknown("c"), Unknown("a")], [LinearBlock(("c", "a"), rows, seen + rows @ at, 1.0)], [alone])
        np.testing.assert_allclose(left.values, at, rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(left.covariance, whole.covariance[np.ix_([2, 0], [2, 0])], rtol=1e-7, atol=1e-9)


def test_what_is_known_exactly_is_neither_moved_nor_a_source() -> None:
    blocks, priors = problem(1)
    found = solve(UNKNOWNS, blocks, [*priors, Prior.of("drawing", "a", 0.0, 0.25)])
    assert found.value("a") == 0.25
    assert found.u("a") == 0.0
    assert found.sources == ("p", "q", "r")
    nearly = solve(UNKNOWNS, blocks, [*priors, Prior.of("drawing", "a", 1e-7, 0.25)])
    np.testing.assert_allclose(found.values, nearly.values, atol=1e-6)
    np.testing.assert_allclose(found.covariance, nearly.covariance, atol=1e-6)
    with pytest.raises(ValueError, match=r"a cannot be exactly 0\.25 and 0\.5"):
        solve(UNKNOWNS, blocks, [Prior.of("one", "a", 0.0, 0.25), Prior.of("other", "a", 0.0, 0.5)])


def test_what_nothing_determines_says_so_and_disturbs_nothing_else() -> None:
    blocks, priors = problem(2)
    with_another = solve([*UNKNOWNS, Unknown("e")], blocks, priors)
    found = solve(UNKNOWNS, blocks, priors)
    assert with_another.u("e") == np.inf
    np.testing.assert_allclose(with_another.values[:4], found.values, rtol=1e-9)
    np.testing.assert_allclose(with_another.covariance[:4, :4], found.covariance, rtol=1e-9)
    # of a sum of which only the whole is seen neither part is determined
    both = LinearBlock(("a", "b"), np.ones((5, 2)), np.arange(5.0), 1.0)
    found = solve(UNKNOWNS[:3], [both], [Prior.of("r", "c", 1.0)])
    assert [found.u(name) for name in "abc"] == [np.inf, np.inf, pytest.approx(1.0)]


def test_a_source_that_nothing_else_says_anything_about_has_no_normalised_residual() -> None:
    found = solve([Unknown("a")], [], [Prior.of("only", "a", 2.0, 3.0)])
    assert (found.value("a"), found.u("a")) == (3.0, 2.0)
    assert found.normalised_residual("only") == 0.0
    assert found.pulls[found.sources.index("only")] == 0.0


@dataclass(frozen=True)
class Decay:
    """``e^size e^(-rate t)``, seen with errors."""

    seen: np.ndarray
    times: np.ndarray
    unknowns: tuple[str, ...] = ("size", "rate")

    def linearised(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        modelled = np.exp(values["size"] - values["rate"] * self.times)
        return (self.seen - modelled) / 0.01, np.column_stack([modelled, -self.times * modelled]) / 0.01


def test_a_model_that_is_not_linear_is_solved_to_the_minimum() -> None:
    times = np.linspace(0.0, 3.0, 40)
    seen = 2.0 * np.exp(-0.7 * times) + 0.01 * np.random.default_rng(4).standard_normal(40)
    unknowns = [Unknown("size", largest_step=0.3), Unknown("rate", largest_step=0.3)]
    found = solve(unknowns, [Decay(seen, times)], [Prior.of("guess", "rate", 0.5, 1.0)])
    peer = least_squares(
        lambda p: np.append((seen - np.exp(p[0] - p[1] * times)) / 0.01, (p[1] - 1.0) / 0.5), [0.0, 0.0], xtol=1e-14
    )
    np.testing.assert_allclose(found.values, peer.x, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(peer.jac.T @ peer.jac), rtol=1e-5)
    assert found.misfit == pytest.approx(2.0 * peer.cost, rel=1e-9)
    assert found.converged
    # no step was longer than it may be: from 0 to 0.7 in thirds at best
    assert found.steps >= 3
    assert solve(unknowns, [Decay(seen, times)], [], {"size": peer.x[0], "rate": peer.x[1]}).steps < found.steps


@given(SEEDS)
def test_draws_are_those_of_the_estimate(seed: int) -> None:
    found = solve(UNKNOWNS, *problem(seed))
    drawn = found.draws("b", np.random.default_rng(seed), 20_000)
    assert drawn.mean() == pytest.approx(found.value("b"), abs=5 * found.u("b") / np.sqrt(20_000))
    assert drawn.std() == pytest.approx(found.u("b"), rel=0.03)


def test_a_size_of_the_errors_that_is_hardly_known_widens_the_draws() -> None:
    blocks, _ = problem(3)
    wide = Prior(("w",), ("d",), np.ones((1, 1)), np.zeros(1), np.array([[1e6]]))
    found = solve(UNKNOWNS, blocks, [wide])
    drawn = found.draws("a", np.random.default_rng(5), 200_000, degrees_of_freedom=5.0)
    # the variance of Student's t of five degrees of freedom is 5 / 3
    assert drawn.std() == pytest.approx(np.sqrt(5 / 3) * found.u_random("a"), rel=0.03)


@pytest.mark.parametrize(
    ("unknowns", "priors", "says"),
    [
        ((*UNKNOWNS, Unknown("a")), [], "each unknown needs a name of its own"),
        (UNKNOWNS, [Prior.of("r", "c", 1.0), Prior.of("r", "a", 1.0)], "each source needs a name of its own"),
        (UNKNOWNS, [Prior.of("r", "mass", 1.0)], "no unknown: mass; there are a, b, c, d"),
        (UNKNOWNS[:3], [], "no unknown: d"),
    ],
)
def test_names_must_be_known_and_single(unknowns: tuple[Unknown, ...], priors: list[Prior], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        solve(unknowns, problem(1)[0], priors)


@pytest.mark.parametrize(
    ("rows", "values", "matrix", "says"),
    [
        (np.ones((1, 1)), np.zeros(2), np.eye(2), "cannot have the shapes"),
        (np.ones((2, 1)), np.array([0.0, np.nan]), np.eye(2), "must be finite"),
        (np.ones((2, 1)), np.zeros(2), np.diag([1.0, 0.0]), "positive definite"),
        (np.ones((2, 1)), np.zeros(2), np.array([[1.0, 0.5], [0.2, 1.0]]), "symmetric"),
    ],
)
def test_a_prior_that_is_none_is_refused(rows: np.ndarray, values: np.ndarray, matrix: np.ndarray, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Prior(("p", "q"), ("a",), rows, values, matrix)


def test_a_covariance_whose_halves_differ_by_rounding_is_one() -> None:
    matrix = np.array([[1.0, 1e-16], [-1e-16, 4.0]])
    Prior(("p", "q"), ("a", "b"), np.eye(2), np.zeros(2), matrix)


def test_an_estimate_prints_its_unknowns() -> None:
    found: Estimate = solve([Unknown("zero", "m/s^2")], [], [Prior.of("baseline", "zero", 0.158, 0.02)])
    assert str(found).splitlines()[1].split() == ["zero", "0.02", "0.16", "m/s^2"]


def test_a_step_that_would_raise_the_misfit_is_halved_until_it_does_not() -> None:
    times = np.linspace(0.0, 3.0, 40)
    seen = 2.0 * np.exp(-0.7 * times)
    # from so far off the linear model overshoots by orders of magnitude
    unknowns = [Unknown("size", largest_step=20.0), Unknown("rate", largest_step=20.0)]
    found = solve(unknowns, [Decay(seen, times)], [], {"size": -2.0, "rate": 2.0})
    assert found.converged
    assert found.steps < 12  # steps that it may not take back go astray for 39
    np.testing.assert_allclose(found.values, [np.log(2.0), 0.7], rtol=1e-6)


@dataclass(frozen=True)
class Saturating:
    """One row that sees the arc tangent of an unknown: far from zero a Gauss-Newton step goes far beyond."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        return ("a",)

    def linearised(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        a = values["a"]
        return np.array([-math.atan(a)]), np.array([[1.0 / (1.0 + a**2)]])


def test_a_step_that_would_raise_the_misfit_is_halved() -> None:
    found = solve([Unknown("a")], [Saturating()], [Prior.of("guess", "a", 1e3, 3.0)], {"a": 3.0})
    assert found.converged
    assert found.value("a") == pytest.approx(0.0, abs=1e-4)
    assert found.steps < 10


def test_what_is_known_beforehand_counts_when_a_step_is_judged() -> None:
    known = Prior.of("guess", "a", 10.0, 3.0)
    found = solve([Unknown("a")], [Saturating()], [known], {"a": 3.0})
    grid = np.linspace(-20.0, 20.0, 400_001)
    best = grid[np.argmin(np.arctan(grid) ** 2 + ((grid - 3.0) / 10.0) ** 2)]
    assert found.converged
    assert found.value("a") == pytest.approx(best, abs=1e-3)


@dataclass(frozen=True)
class Limited:
    """One row of 100 that is modelled by a hyperbolic tangent: no step explains it, however far from the guess."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        return ("a",)

    def linearised(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        modelled = math.tanh(values["a"] / 2)
        return np.array([100.0 - modelled]), np.array([[0.5 * (1.0 - modelled**2)]])


def test_a_step_that_costs_more_beforehand_than_it_explains_is_halved() -> None:
    found = solve([Unknown("a")], [Limited()], [Prior.of("guess", "a", 1.0)])
    grid = np.linspace(0.0, 10.0, 1_000_001)
    best = grid[np.argmin((100.0 - np.tanh(grid / 2)) ** 2 + grid**2)]
    assert found.value("a") == pytest.approx(best, abs=1e-3)


def test_no_step_is_larger_than_an_unknowns_largest() -> None:
    seen = LinearBlock(("a",), np.ones((1, 1)), np.array([3.0]), 1.0)
    near, far = (solve([Unknown("a", largest_step=step)], [seen], []) for step in (math.inf, 0.3))
    assert near.steps == 2  # the second one moves nothing
    assert 10 <= far.steps <= 12
    assert far.value("a") == pytest.approx(3.0)


def test_it_begins_with_zero_where_nothing_is_given_and_gives_up_after_fifty_steps() -> None:
    begun: list[dict[str, float]] = []

    class Watched(LinearBlock):
        def linearised(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
            begun.append(dict(values))
            return super().linearised(values)

    far = Watched(("a", "b"), np.eye(2), np.array([1.0, 0.5]), 0.1)
    found = solve([Unknown("a", largest_step=1e-3), Unknown("b")], [far], [], {"b": 0.25})
    assert begun[0] == {"a": 0.0, "b": 0.25}
    assert (found.steps, found.converged) == (50, False)
    assert found.value("a") == pytest.approx(50e-3)


def test_a_prior_of_one_unknown_says_zero_unless_it_is_told_a_value() -> None:
    for prior, value in ((Prior.of("s", "a", 0.5), 0.0), (Prior.of("s", "a", 0.5, 2.0), 2.0)):
        found = solve([Unknown("a")], [], [prior])
        assert (found.value("a"), found.u("a")) == (pytest.approx(value, abs=1e-15), pytest.approx(0.5))


def test_the_halves_of_a_covariance_may_differ_by_rounding_alone() -> None:
    def stated(apart: float) -> Prior:
        matrix = np.array([[4.0, 1.0], [1.0 + 6.0 * apart, 9.0]])
        return Prior(("p", "q"), ("a", "b"), np.eye(2), np.zeros(2), matrix)

    assert stated(0.95e-9).sources == ("p", "q")
    with pytest.raises(ValueError, match="the covariance of p, q must be symmetric"):
        stated(1.05e-9)
