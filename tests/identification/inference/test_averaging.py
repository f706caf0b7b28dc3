"""Averages over hypotheses against integrals that are written out over the size of each effect."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from recoil_identification.inference.averaging import Hypotheses
from recoil_identification.inference.score import Scores

sizes = st.floats(-4.0, 4.0)


def scores(z: list[float], information: list[float]) -> Scores:
    n, told = len(z), np.array(information) > 0
    return Scores(np.array(z), np.eye(n), told, np.array(information), np.zeros((1, n)))


def written_out(z: float, information: float, sd: float, one_sided: bool) -> tuple[float, float, float]:
    """Return the Bayes factor, and mean and variance of the size, by quadrature."""
    estimate, u = z / math.sqrt(information), 1.0 / math.sqrt(information)
    low = 0.0 if one_sided else -12.0 * sd
    twice = 2.0 if one_sided else 1.0

    def moment(order: int) -> float:
        def density(size: float) -> float:
            odds = norm.pdf(estimate, size, u) / norm.pdf(estimate, 0.0, u)
            return float(size**order * odds * twice * norm.pdf(size, 0.0, sd))

        near = np.clip([0.0, estimate - 4 * u, estimate, estimate + 4 * u], low, 12.0 * sd)
        return float(quad(density, low, 12.0 * sd, points=np.unique(near), limit=200)[0])

    factor, first, second = (moment(order) for order in range(3))
    return factor, first / factor, second / factor - (first / factor) ** 2


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize(("z", "information", "sd"), [(0.3, 4.0, 1.0), (3.0, 25.0, 0.5), (-1.5, 9.0, 0.7)])
def test_factor_and_size_are_those_of_the_integral_over_the_size(z, information, sd, one_sided) -> None:
    found = Hypotheses.of(scores([z], [information]), np.zeros(1, dtype=np.intp), np.array([sd]), np.array([one_sided]))
    factor, mean, variance = written_out(z, information, sd, one_sided)
    assert found.ln_bayes_factors[0] == pytest.approx(math.log(factor), abs=1e-6)
    assert found.sizes[0] == pytest.approx(mean, rel=1e-6, abs=1e-9)
    assert found.variances[0] == pytest.approx(variance, rel=1e-5)
    # what it moves is the mean over it and none, as likely as each other beforehand
    weight = factor / (1.0 + factor)
    moved, gained = found.moved(np.array([-2.0]))
    assert moved == pytest.approx(-2.0 * weight * mean, rel=1e-6)
    assert gained == pytest.approx(4.0 * (weight * (variance + mean**2) - (weight * mean) ** 2), rel=1e-5)


@given(st.lists(sizes, min_size=3, max_size=3), st.permutations(range(3)))
def test_the_order_of_the_effects_decides_nothing(z: list[float], order: list[int]) -> None:
    kinds, sd = np.array([0, 0, 1]), np.array([1.0, 0.5, 2.0])
    one_sided, by = np.array([True, False, False]), np.array([0.3, -1.0, 0.7])
    found = Hypotheses.of(scores(z, [4.0, 1.0, 9.0]), kinds, sd, one_sided)
    turned = Hypotheses.of(
        scores([z[at] for at in order], [[4.0, 1.0, 9.0][at] for at in order]),
        kinds[order], sd[order], one_sided[order],
    )  # fmt: skip
    assert turned.ln_bayes_factor == pytest.approx(found.ln_bayes_factor)
    np.testing.assert_allclose(turned.moved(by[order]), found.moved(by), atol=1e-12)
    assert 0.0 < found.weights.sum() < 1.0


def test_a_kind_counts_once_however_many_variants_it_has() -> None:
    sd, none = np.ones(4), np.zeros(4, dtype=np.bool_)
    found = Hypotheses.of(scores([3.0, 3.0, 3.0, 0.0], [4.0] * 4), np.array([0, 0, 0, 1]), sd, none)
    alone = Hypotheses.of(scores([3.0, 0.0], [4.0] * 2), np.array([0, 1]), sd[:2], none[:2])
    assert found.ln_bayes_factor == pytest.approx(alone.ln_bayes_factor)


def test_what_cannot_be_told_is_no_hypothesis_and_moves_nothing() -> None:
    found = Hypotheses.of(scores([0.0, 2.0], [0.0, 4.0]), np.array([0, 1]), np.ones(2), np.array([True, False]))
    assert found.weights[0] == 0.0
    assert found.moved(np.array([1e6, 0.0]))[0] == 0.0
