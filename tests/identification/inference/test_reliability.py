"""The smallest error that is told is that of a refit, and the effect of an error is what a refit with it shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.estimate import residual_against_none
from recoil_identification.inference.reliability import NONCENTRALITY, POWER, reliability
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from tests.identification.inference.test_solve import NAMES, SEEDS, UNKNOWNS, problem


def moved(priors: list[Prior], error: dict[str, float], size: float) -> list[Prior]:
    """State every value too large by its part of an error."""
    return [
        replace(one, values=one.values + size * np.array([error.get(source, 0.0) for source in one.sources]))
        for one in priors
    ]


def with_the_error_as_an_unknown(priors: list[Prior], error: dict[str, float]) -> list[Prior]:
    """Let the size of an error be found: what it adds to each value is a column."""
    return [
        replace(
            one,
            unknowns=(*one.unknowns, "size"),
            rows=np.column_stack([one.rows, [error.get(source, 0.0) for source in one.sources]]),
        )
        for one in priors
    ]


@given(st.floats(-5.0, 5.0).filter(lambda far: abs(far) > 1e-3), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_a_residual_against_none_forgets_the_prior(far: float, u: float, u_seen: float) -> None:
    value = far * u**2 / (u**2 + u_seen**2)
    w = far / math.hypot(u, u_seen)
    assert residual_against_none(w, value / u) == pytest.approx(far / u_seen, rel=1e-6)


@pytest.mark.exhaustive
@given(SEEDS)
def test_an_error_is_told_as_surely_as_its_size_could_be_found(seed: int) -> None:
    blocks, priors = problem(seed)
    rng = np.random.default_rng(seed)
    for error in ({"r": 1.0}, {"p": 1.0}, {"p": 1.0, "q": -0.5, "r": float(rng.uniform(0.5, 2.0))}):
        found = reliability(solve(UNKNOWNS, blocks, priors), priors, error, "a")
        beside = solve([*UNKNOWNS, Unknown("size")], blocks, with_the_error_as_an_unknown(priors, error))
        assert found.smallest_told == pytest.approx(NONCENTRALITY * beside.u("size"), rel=1e-6)


@pytest.mark.exhaustive
@given(SEEDS)
def test_a_refit_with_the_smallest_error_moves_its_test_by_the_noncentrality_and_the_unknown_as_said(seed: int) -> None:
    blocks, priors = problem(seed)
    before = solve(UNKNOWNS, blocks, priors)
    for source in ("r", "p"):
        found = reliability(before, priors, {source: 1.0}, "b")
        after = solve(UNKNOWNS, blocks, moved(priors, {source: 1.0}, found.smallest_told))
        shift = after.normalised_residual(source) - before.normalised_residual(source)
        assert abs(shift) == pytest.approx(NONCENTRALITY, rel=1e-6)
        assert after.value("b") - before.value("b") == pytest.approx(found.answer * found.smallest_told, rel=1e-6)


def test_the_power_is_the_chance_that_a_normal_deviate_about_the_noncentrality_is_beyond_the_limit() -> None:
    beyond = stats.norm.sf(3.29, loc=NONCENTRALITY) + stats.norm.cdf(-3.29, loc=NONCENTRALITY)
    assert beyond == pytest.approx(POWER, abs=1e-6)


def test_what_only_its_own_prior_says_is_never_told() -> None:
    alone = [Prior.of("certificate", "a", 0.3)]
    found = reliability(solve(UNKNOWNS[:1], [], alone), alone, {"certificate": 1.0}, "a")
    assert found.smallest_told == math.inf
    assert found.answer == pytest.approx(1.0)


def test_rows_that_tell_an_unknown_better_tell_a_smaller_error() -> None:
    prior = [Prior.of("certificate", "a", 1.0)]
    told = []
    for sigma in (2.0, 0.5, 0.01):
        block = LinearBlock(("a",), np.ones((1, 1)), np.zeros(1), sigma)
        told.append(reliability(solve(UNKNOWNS[:1], [block], prior), prior, {"certificate": 1.0}, "a").smallest_told)
    # the difference of the two has both variances
    assert told == pytest.approx([NONCENTRALITY * math.hypot(1.0, sigma) for sigma in (2.0, 0.5, 0.01)])


def test_strangers_are_refused() -> None:
    blocks, priors = problem(1)
    found = solve(UNKNOWNS, blocks, priors)
    with pytest.raises(ValueError, match="no unknown: m; there are a, b, c, d"):
        reliability(found, priors, {"r": 1.0}, "m")
    with pytest.raises(ValueError, match="no source: gauge; there are p, q, r"):
        reliability(found, priors, {"gauge": 1.0}, NAMES[0])
