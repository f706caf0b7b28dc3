from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_identification.targets.arx.mass import fitted_model, mass_of_gain, noise_attenuation
from recoil_identification.targets.arx.model import ArxOrders, robust_covariance
from recoil_identification.targets.arx.response import dc_gain
from tests.builders.arx_systems import PULSE_MASS_KG as MASS_KG
from tests.builders.arx_systems import pulse_record as record


def test_the_mass_is_one_over_the_gain_with_the_larger_of_both_errors():
    one = record(colour=(1.0, 0.8, 0.6, 0.4))
    model = fitted_model(one, ArxOrders())
    found = mass_of_gain(one, ArxOrders(), (), 0.003)
    robust = robust_covariance(model, one.force_n, one.acceleration_m_s2, rows=one.rows)
    gain, wide = dc_gain(model), dc_gain(model, robust)
    assert found.mass_kg == pytest.approx(1.0 / gain.value)
    assert found.u_random_kg == pytest.approx(max(gain.u, wide.u) / gain.value**2)
    assert found.u_other_kg == pytest.approx(0.003 * found.mass_kg)
    assert found.u_orders_kg == 0.0
    assert found.u_kg == pytest.approx(np.hypot(found.u_random_kg, found.u_other_kg))


def test_other_orders_widen_the_interval_by_their_rectangular_distribution():
    one = record()
    orders = [ArxOrders(na, na) for na in range(3)]
    masses = [1.0 / dc_gain(fitted_model(one, each)).value for each in orders]
    found = mass_of_gain(one, orders[0], orders[1:])
    assert found.u_orders_kg == pytest.approx((max(masses) - min(masses)) / 2 / np.sqrt(3))


@pytest.mark.whole_way
@pytest.mark.parametrize("orders", [ArxOrders(), ArxOrders(1, 1), ArxOrders(3, 3)])
def test_the_interval_by_the_residuals_holds_the_mass_as_often_as_stated(orders):
    held = 0
    for seed in range(200):
        one = record(seed)
        found = mass_of_gain(one, orders)
        held += abs(found.mass_kg - MASS_KG) <= 1.96 * found.u_random_kg
    assert held / 200 > 0.91


@pytest.mark.whole_way
def test_correlated_errors_are_allowed_for():
    plain = robust = 0
    for seed in range(200):
        one = record(seed, colour=(1.0, 0.9, 0.8, 0.7))
        model = fitted_model(one, ArxOrders())
        error = abs(1.0 / dc_gain(model).value - MASS_KG)
        plain += error <= 1.96 * dc_gain(model).u * MASS_KG**2
        robust += error <= 1.96 * mass_of_gain(one, ArxOrders()).u_random_kg
    assert plain < 160
    assert robust > plain + 15


def test_noise_of_the_force_raises_the_mass_by_its_share_of_the_energy():
    noise = 3e4
    masses, shares = [], []
    for seed in range(100):
        one = record(seed, noise_m_s2=0.1, force_noise_n=noise)
        masses.append(1.0 / dc_gain(fitted_model(one, ArxOrders())).value)
        shares.append(noise_attenuation(one, noise))
    assert np.mean(masses) / MASS_KG - 1.0 == pytest.approx(np.mean(shares) / (1 - np.mean(shares)), rel=0.1)


def test_a_force_without_energy_is_all_noise():
    one = record()
    silent = DecimatedRecord(one.times_s, np.zeros(250), one.acceleration_m_s2, one.rows, 1e-3, 20, None)
    assert noise_attenuation(silent, 1.0) == np.inf


@settings(max_examples=20)
@given(st.floats(0.1, 10.0), st.integers(0, 2**31))
def test_a_force_that_reads_high_raises_the_mass_in_proportion(scale, seed):
    one = record(seed)
    high = DecimatedRecord(one.times_s, scale * one.force_n, one.acceleration_m_s2, one.rows, 1e-3, 20, None)
    orders = ArxOrders(2, 2)
    plain, scaled = (mass_of_gain(each, orders) for each in (one, high))
    assert scaled.mass_kg == pytest.approx(scale * plain.mass_kg, rel=1e-7)
    assert scaled.u_random_kg == pytest.approx(scale * plain.u_random_kg, rel=1e-6)


def test_other_orders_that_cannot_be_estimated_say_nothing():
    one = record()
    few = DecimatedRecord(
        one.times_s, one.force_n, one.acceleration_m_s2, np.isin(np.arange(250), [25, 30, 35]), 1e-3, 20, one.low_pass
    )
    assert mass_of_gain(few, ArxOrders(), [ArxOrders(3, 3)]).u_orders_kg == 0.0
