from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.arx.model import ArxModel, ArxOrders, information_criteria


def model(rss: float = 2.0, n_rows: int = 50) -> ArxModel:
    return ArxModel(ArxOrders(1, 1, 2), np.array([-0.5, 1.0, 2.0]), np.diag([0.01, 0.04, 0.09]), rss, n_rows, 0.1)


def test_orders_count_their_parameters_and_their_memory():
    orders = ArxOrders(2, 1, 3)
    assert (orders.n_parameters, orders.memory, orders.names) == (4, 4, ("a1", "a2", "b0", "b1"))
    assert ArxOrders(5, 1, 3).memory == 5
    assert str(orders) == "na 2, nb 1, d 3"
    assert ArxOrders() == ArxOrders(0, 0, 0)
    assert ArxOrders(np.int64(2)).na == 2


@pytest.mark.parametrize("wrong", [(-1, 0, 0), (0, -1, 0), (0, 0, -1)])
def test_negative_orders_are_refused(wrong):
    with pytest.raises(ValueError, match="not be negative"):
        ArxOrders(*wrong)


@pytest.mark.parametrize("wrong", [1.0, True, "1"])
def test_orders_that_are_no_whole_numbers_are_a_type_error(wrong):
    with pytest.raises(TypeError, match="integer"):
        ArxOrders(wrong)


def test_a_model_gives_its_polynomials_and_standard_errors():
    one = model()
    np.testing.assert_array_equal(one.denominator, [1.0, -0.5])
    np.testing.assert_array_equal(one.numerator, [0.0, 0.0, 1.0, 2.0])
    np.testing.assert_allclose(one.standard_errors, [0.1, 0.2, 0.3])


def test_loss_and_final_prediction_error_are_akaikes():
    one = model()
    assert one.loss == 0.04
    assert one.noise_variance == pytest.approx(2.0 / 47)
    assert one.fpe == pytest.approx(0.04 * (1 + 3 / 50) / (1 - 3 / 50))


def test_the_criteria_are_those_of_the_normal_likelihood():
    from scipy.stats import norm

    errors = np.random.default_rng(1).standard_normal(50)
    rss = float(errors @ errors)
    log_likelihood = norm(scale=math.sqrt(rss / 50)).logpdf(errors).sum()
    found = information_criteria(rss, 50, 3)
    assert found.aic == pytest.approx(2 * 3 - 2 * log_likelihood)
    assert found.bic == pytest.approx(3 * math.log(50) - 2 * log_likelihood)
    assert found.aicc == pytest.approx(found.aic + 2 * 3 * 4 / 46)
    one = model(rss)
    assert (one.aic, one.aicc, one.bic) == tuple(found)


def test_a_perfect_fit_is_the_least_and_too_few_rows_have_no_correction():
    assert information_criteria(0.0, 50, 3).bic == -math.inf
    assert information_criteria(1.0, 4, 3).aicc == math.inf
    assert information_criteria(0.0, 4, 3).aicc == math.inf
