from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.arx.estimation import estimate_arx, residuals
from recoil_identification.arx.model import ArxOrders
from recoil_identification.arx.orders import compare_orders, halves, order_grid, usable_rows
from tests.builders.arx_systems import arx_record

GRID = order_grid(range(4), range(3), range(4))


@pytest.mark.parametrize("criterion", ["bic", "aicc"])
def test_the_orders_and_the_delay_of_a_known_system_are_recovered(criterion):
    right = 0
    for seed in range(20):
        u, y = arx_record(400, 50 + seed, noise=0.3)
        right += compare_orders(u, y, GRID, criterion=criterion).best.orders == ArxOrders(2, 1, 1)
    assert right >= (16 if criterion == "bic" else 8)


@settings(max_examples=20)
@given(st.integers(0, 5), st.integers(0, 2**31))
def test_a_delay_is_recovered(delay, seed):
    u, y = arx_record(300, seed, system=((-0.6,), (1.0,), delay))
    assert compare_orders(u, y, order_grid([1], [0], range(6))).best.orders.delay == delay


def test_every_candidate_is_fitted_to_the_same_rows():
    u, y = arx_record(200, 1)
    u[50], y[120] = np.nan, np.nan
    table = compare_orders(u, y, GRID)
    assert {c.model.n_rows for c in table.candidates} == {int(table.estimation.sum())}
    # the largest candidate needs y to k - 3 and u to k - 5
    expected = np.arange(200) >= 5
    expected[50:56] = False
    expected[120:124] = False
    np.testing.assert_array_equal(table.estimation, expected)
    np.testing.assert_array_equal(usable_rows(u, y, GRID), expected)


def test_a_candidates_model_is_the_one_estimated_alone_on_the_tables_rows():
    u, y = arx_record(200, 2)
    table = compare_orders(u, y, GRID, step_s=0.01)
    one = next(c for c in table.candidates if c.orders == ArxOrders(2, 1, 1))
    alone = estimate_arx(u, y, ArxOrders(2, 1, 1), step_s=0.01, rows=table.estimation)
    np.testing.assert_array_equal(one.model.parameters, alone.parameters)
    assert one.model.step_s == 0.01
    assert one.score("bic") == alone.bic


def test_the_ranking_ascends_and_near_models_are_within_the_margin():
    u, y = arx_record(300, 3)
    table = compare_orders(u, y, GRID, criterion="aic")
    scores = [c.score("aic") for c in table.ranked]
    assert scores == sorted(scores)
    assert table.best.aic == scores[0]
    near = table.near(4.0)
    assert len(near) == sum(score <= scores[0] + 4.0 for score in scores) > 0


def test_validation_rows_are_not_fitted_and_decide():
    u, y = arx_record(400, 4, noise=0.5)
    earlier, later = halves(np.ones(400, dtype=bool))
    table = compare_orders(u, y, GRID, criterion="validation", validation=later)
    assert not (table.estimation & table.validation).any()
    assert table.validation.sum() == 200
    one = table.ranked[0]
    errors = residuals(one.model, u, y)[table.validation]
    assert one.validation_loss == pytest.approx(np.mean(errors**2))
    assert one.validation_loss == min(c.validation_loss for c in table.candidates)
    assert earlier.sum() == 200


def test_an_order_that_is_too_large_wins_by_loss_but_not_by_validation():
    u, y = arx_record(160, 5, noise=1.0)
    _, later = halves(np.ones(160, dtype=bool))
    grid = [ArxOrders(2, 1, 1), ArxOrders(15, 12, 0)]
    table = compare_orders(u, y, grid, criterion="validation", validation=later)
    small, large = table.candidates
    assert large.model.loss < small.model.loss
    assert table.best.orders == small.orders


def test_halves_split_chosen_rows_in_time():
    rows = np.zeros(20, dtype=bool)
    rows[[2, 5, 6, 11, 18]] = True
    earlier, later = halves(rows)
    assert list(np.flatnonzero(earlier)) == [2, 5]
    assert list(np.flatnonzero(later)) == [6, 11, 18]


def test_a_model_that_is_too_small_leaves_residuals_that_are_not_white():
    u, y = arx_record(400, 6)
    table = compare_orders(u, y, [ArxOrders(0, 0, 1), ArxOrders(2, 1, 1)])
    assert table.candidates[0].whiteness_p < 1e-6
    assert table.candidates[1].whiteness_p > 0.01


def test_a_candidate_that_cannot_be_estimated_stays_in_the_table_with_its_reason():
    u = np.ones(60)
    y = np.random.default_rng(1).standard_normal(60)
    table = compare_orders(u, y, [ArxOrders(0, 0, 0), ArxOrders(0, 1, 0)])
    assert table.candidates[1].model is None
    assert "told apart" in table.candidates[1].refusal
    assert table.candidates[1].score("bic") == np.inf
    assert [c.orders for c in table.ranked] == [ArxOrders()]


def test_a_record_that_no_candidate_fits_is_refused_with_the_cause():
    with pytest.raises(IdentificationError, match="no model of any order"):
        compare_orders(np.zeros(40), np.ones(40), GRID)


def test_a_perfect_fit_has_no_whiteness_but_wins():
    u = np.random.default_rng(1).standard_normal(60)
    table = compare_orders(u, 0.5 * u, [ArxOrders(0, 1), ArxOrders()])
    assert table.best.parameters[-1] == pytest.approx(0.5) or table.best.orders.nb == 1


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"criterion": "r2"}, "criterion"),
        ({"criterion": "validation"}, "rows are kept"),
        ({"rows": np.ones(3, dtype=bool)}, "shape"),
        ({"validation": np.ones(3, dtype=bool)}, "shape"),
    ],
)
def test_mistakes_of_the_caller_are_value_errors(options, match):
    u, y = arx_record(40, 1)
    with pytest.raises(ValueError, match=match):
        compare_orders(u, y, GRID, **options)


def test_no_candidates_are_refused():
    with pytest.raises(ValueError, match="no candidate"):
        compare_orders(*arx_record(40, 1), [])
    with pytest.raises(ValueError, match="one order each"):
        order_grid([], [1])


def test_validation_without_a_row_is_refused():
    u, y = arx_record(40, 1)
    only_first = np.arange(40) < 2
    with pytest.raises(IdentificationError, match="validation"):
        compare_orders(u, y, GRID, validation=only_first)
