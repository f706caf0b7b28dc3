from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.arx.model import ArxModel, ArxOrders, estimate_arx
from recoil_identification.targets.arx.response import Gain, dc_gain, frequency_response, inverse, poles, zeros
from tests.builders.arx_systems import arx_record

ORDERS = ArxOrders(2, 1, 1)
TRUE = np.array([-1.5, 0.7, 1.0, 0.5])


def with_parameters(parameters: np.ndarray, orders: ArxOrders = ORDERS, step_s: float = 0.01) -> ArxModel:
    size = orders.n_parameters
    factor = np.random.default_rng(1).standard_normal((size, size))
    return ArxModel(orders, np.asarray(parameters, dtype=float), 1e-6 * factor @ factor.T, 1.0, 100, step_s)


MODEL = with_parameters(TRUE)


def by_differences(of, model: ArxModel = MODEL) -> np.ndarray:
    """Propagate the covariance by central differences of the parameters."""
    columns = []
    for i in range(model.orders.n_parameters):
        step = np.zeros(model.orders.n_parameters)
        step[i] = 1e-6
        high, low = (
            of(ArxModel(model.orders, model.parameters + sign * step, model.covariance, 1.0, 100, model.step_s))
            for sign in (1, -1)
        )
        columns.append((np.atleast_1d(high) - np.atleast_1d(low)) / 2e-6)
    slopes = np.array(columns).T
    return np.sqrt(np.einsum("ni,ij,nj->n", slopes, model.covariance, slopes))


def test_the_gain_at_zero_frequency_is_the_ratio_of_the_sums():
    gain = dc_gain(MODEL)
    assert gain.value == pytest.approx(1.5 / 0.2)
    assert gain.u == pytest.approx(by_differences(lambda m: dc_gain(m).value)[0], rel=1e-6)
    wide = dc_gain(MODEL, 4.0 * MODEL.covariance)
    assert wide.u == pytest.approx(2.0 * gain.u)


def test_a_pole_at_one_has_an_infinite_gain():
    assert dc_gain(with_parameters([-1.0, 1.0], ArxOrders(1, 0))) == Gain(np.inf, np.inf)


def test_one_over_a_gain_keeps_its_relative_uncertainty():
    assert inverse(Gain(0.002, 0.00001)) == Gain(500.0, pytest.approx(2.5))
    assert inverse(Gain(0.0, 0.1)) == Gain(np.inf, np.inf)


def test_the_frequency_response_is_that_of_scipy():
    from scipy.signal import freqz

    f = np.linspace(0.0, 50.0, 101)
    ours = frequency_response(MODEL, f)
    _, theirs = freqz(MODEL.numerator, MODEL.denominator, worN=2 * np.pi * f * 0.01)
    np.testing.assert_allclose(ours.values, theirs, rtol=1e-12)
    np.testing.assert_allclose(ours.magnitude, np.abs(theirs), rtol=1e-12)
    np.testing.assert_allclose(np.exp(1j * ours.phase_rad), theirs / np.abs(theirs), atol=1e-12)
    assert np.abs(np.diff(ours.phase_rad)).max() < np.pi


def test_the_bands_of_the_frequency_response_are_the_covariances():
    f = np.array([0.0, 1.0, 7.0, 20.0, 49.0])
    ours = frequency_response(MODEL, f)
    log_magnitude = by_differences(lambda m: np.log(frequency_response(m, f).magnitude))
    phase = by_differences(lambda m: np.angle(frequency_response(m, f).values))
    np.testing.assert_allclose(ours.u_log_magnitude, log_magnitude, rtol=1e-5)
    np.testing.assert_allclose(ours.u_phase_rad, phase, rtol=1e-5, atol=1e-12)
    low, high = ours.magnitude_band(1.96)
    assert (low > 0).all()
    np.testing.assert_allclose(low * high, ours.magnitude**2, rtol=1e-12)
    assert ours.u_log_magnitude[0] == pytest.approx(dc_gain(MODEL).u / dc_gain(MODEL).value)


def test_poles_and_zeros_are_the_roots():
    found = poles(MODEL)
    np.testing.assert_allclose(np.abs(found.values), np.sqrt(0.7), rtol=1e-12)
    np.testing.assert_allclose(found.values.real, 0.75, rtol=1e-12)
    np.testing.assert_allclose(zeros(MODEL), [-0.5], rtol=1e-12)
    assert found.stable
    s = np.log(found.values[0]) / 0.01
    assert found.frequency_hz[0] == pytest.approx(abs(s) / (2 * np.pi))
    assert found.damping[0] == pytest.approx(-s.real / abs(s))


def test_an_unstable_model_is_told():
    assert not poles(with_parameters([-1.01, 1.0], ArxOrders(1, 0))).stable
    assert not poles(with_parameters([-1.0, 1.0], ArxOrders(1, 0))).stable


def test_a_model_without_past_outputs_has_no_poles_and_is_stable():
    found = poles(with_parameters([1.0], ArxOrders()))
    assert found.values.size == 0
    assert found.stable
    assert zeros(with_parameters([1.0], ArxOrders())).size == 0


def test_a_pole_at_the_origin_has_no_frequency():
    found = poles(with_parameters([-0.5, 0.0, 1.0], ArxOrders(2, 0)))
    np.testing.assert_allclose(found.values, [0.5, 0.0])
    assert np.isnan(found.frequency_hz[1])


@settings(max_examples=25)
@given(st.floats(-6, 6), st.floats(-6, 6), st.integers(0, 2**31))
def test_the_gain_scales_with_the_signals_and_the_poles_do_not(log_u, log_y, seed):
    u, y = arx_record(100, seed)
    one = estimate_arx(u, y, ORDERS)
    scaled = estimate_arx(10.0**log_u * u, 10.0**log_y * y, ORDERS)
    ratio = 10.0 ** (log_y - log_u)
    assert dc_gain(scaled).value == pytest.approx(ratio * dc_gain(one).value, rel=1e-7)
    assert dc_gain(scaled).u == pytest.approx(ratio * dc_gain(one).u, rel=1e-7)
    np.testing.assert_allclose(np.abs(poles(scaled).values), np.abs(poles(one).values), rtol=1e-6)


@pytest.mark.whole_way
def test_the_bands_hold_the_truth_as_often_as_stated():
    f = np.array([0.0, 0.1, 0.3])
    truth = frequency_response(ArxModel(ORDERS, TRUE, np.zeros((4, 4)), 1.0, 100), f)
    held_gain, held = 0, np.zeros(3)
    for seed in range(300):
        u, y = arx_record(400, 3000 + seed, noise=0.3)
        model = estimate_arx(u, y, ORDERS)
        gain = dc_gain(model)
        held_gain += abs(gain.value - 7.5) <= 1.96 * gain.u
        low, high = frequency_response(model, f).magnitude_band(1.96)
        held += (low <= truth.magnitude) & (truth.magnitude <= high)
    assert abs(held_gain / 300 - 0.95) < 0.04
    assert (np.abs(held / 300 - 0.95) < 0.04).all()
