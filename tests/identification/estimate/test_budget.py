"""Combination of contributions, effective degrees of freedom and coverage factors."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.estimate.budget import (
    COVERAGE_FACTOR,
    BudgetRow,
    combined_u,
    coverage_factor,
    effective_degrees_of_freedom,
)

CONTRIBUTIONS = st.lists(
    st.tuples(st.floats(1e-3, 10.0), st.floats(2.0, 200.0) | st.just(math.inf)), min_size=1, max_size=8
)


def rows_of(contributions: list[tuple[float, float]]) -> list[BudgetRow]:
    return [BudgetRow(f"{i}", u, "A", degrees_of_freedom=nu) for i, (u, nu) in enumerate(contributions)]


@given(CONTRIBUTIONS)
@settings(max_examples=60, deadline=None)
def test_combined_uncertainty_and_degrees_of_freedom_are_those_of_another_implementation_of_the_guide(contributions):
    gtc = pytest.importorskip("GTC", reason="GTC, the oracle of the budget, is not installed")
    total = sum(gtc.ureal(0.0, u, nu) for u, nu in contributions)
    rows = rows_of(contributions)
    assert combined_u(rows) == pytest.approx(gtc.uncertainty(total), rel=1e-12)
    assert effective_degrees_of_freedom(rows) == pytest.approx(gtc.dof(total), rel=1e-9)


@pytest.mark.parametrize(("nu", "k"), [(1.0, 12.706), (2.0, 4.303), (10.0, 2.228), (50.0, 2.009), (100.0, 1.984)])
def test_coverage_factors_are_those_of_the_guides_table_g2(nu, k):
    # JCGM 100:2008, table G.2, fraction p = 95 %
    assert coverage_factor(nu) == pytest.approx(k, abs=1e-3)


def test_known_uncertainties_have_the_normal_factor():
    assert effective_degrees_of_freedom(rows_of([(1.0, math.inf), (2.0, math.inf)])) == math.inf
    assert coverage_factor(math.inf) == COVERAGE_FACTOR


@given(st.floats(1.0, 1e6), st.floats(1.001, 100.0))
@settings(max_examples=50, deadline=None)
def test_fewer_degrees_of_freedom_never_make_an_interval_shorter(nu, factor):
    assert coverage_factor(nu) >= coverage_factor(nu * factor) - 1e-4


@pytest.mark.parametrize("nu", [0.0, -1.0, math.nan])
def test_less_than_one_degree_of_freedom_is_refused(nu):
    with pytest.raises(ValueError, match="at least one degree"):
        coverage_factor(nu)


def test_a_source_has_the_uncertainty_that_its_contribution_and_sensitivity_give():
    assert BudgetRow("breech", 3.9, "B", 780.0).u_source == pytest.approx(0.005)
    assert BudgetRow("random", 3.9, "A").u_source is None
