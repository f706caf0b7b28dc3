import math

import numpy as np
import pytest

from recoil_processing.motion.savitzky_golay import local_polynomials, local_weights


@pytest.mark.parametrize(("window", "order"), [(5, 2), (11, 3), (15, 4), (21, 5)])
def test_on_whole_windows_it_is_the_usual_filter_ends_included(window, order):
    from scipy.signal import savgol_filter

    times, positions = np.arange(120) / 2000, np.random.default_rng(0).standard_normal(120)
    found = local_polynomials(times, positions, window=window, order=order, sigma_m=1.0)
    for values, power in ((found.position, 0), (found.velocity, 1), (found.acceleration, 2)):
        expected = savgol_filter(positions, window, order, deriv=power, delta=1 / 2000)
        assert np.allclose(values, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("window", [5, 9, 13, 25])
def test_noise_gains_are_those_of_the_closed_forms(window):
    n, rate, sigma = window, 2000.0, 3e-5
    times, positions = np.arange(60) / rate, np.zeros(60)
    middle = 30
    velocity = {
        2: math.sqrt(12 / (n * (n**2 - 1))),
        3: math.sqrt(25 * (3 * n**4 - 18 * n**2 + 31) / (n * (n**2 - 1) * (n**2 - 4) * (n**2 - 9))),
    }
    acceleration = math.sqrt(720 / (n * (n**2 - 1) * (n**2 - 4)))
    for order in (2, 3, 4):
        found = local_polynomials(times, positions, window=n, order=order, sigma_m=sigma)
        assert found.u_velocity[middle] == pytest.approx(sigma * rate * velocity[min(order, 3)], rel=1e-9)
        if order < 4:
            assert found.u_acceleration[middle] == pytest.approx(sigma * rate**2 * acceleration, rel=1e-9)


def test_uncertainties_are_those_of_noise_beside_gaps_and_at_ends_too():
    rng = np.random.default_rng(1)
    times = np.arange(60) / 2000
    lost = np.isin(np.arange(60), [20, 21, 40])
    values = []
    for _ in range(800):
        noise = np.where(lost, np.nan, 1e-4 * rng.standard_normal(60))
        found = local_polynomials(times, noise, window=11, sigma_m=1e-4)
        values.append([found.velocity[~lost], found.acceleration[~lost]])
    spread = np.std(np.array(values), axis=0)
    assert np.allclose(spread[0], found.u_velocity[~lost], rtol=0.12)
    assert np.allclose(spread[1], found.u_acceleration[~lost], rtol=0.12)


def test_a_polynomial_of_its_order_is_reproduced_beside_gaps_and_at_ends():
    times = np.arange(80) / 2000
    cubic = np.polynomial.Polynomial([0.2, -3.0, 40.0, 900.0])
    positions = np.where(np.isin(np.arange(80), [3, 30, 31, 32, 77]), np.nan, cubic(times))
    found = local_polynomials(times, positions, window=11, sigma_m=1e-6)
    seen = np.isfinite(positions)
    assert np.allclose(found.velocity[seen], cubic.deriv(1)(times[seen]), rtol=1e-9)
    assert np.allclose(found.acceleration[seen], cubic.deriv(2)(times[seen]), rtol=1e-7)
    assert not np.any(np.isfinite(found.velocity[~seen]))


def test_edges_are_half_a_window_wide():
    positions = np.sin(np.arange(60.0))
    positions[30] = np.nan
    found = local_polynomials(np.arange(60.0), positions, window=11, sigma_m=1.0)
    assert np.flatnonzero(~found.edge).tolist() == [*range(6, 24), *range(37, 54)]


def test_where_too_few_frames_are_near_there_is_no_result():
    positions = np.sin(np.arange(60.0))
    positions[[*range(20, 29), *range(31, 40)]] = np.nan
    found = local_polynomials(np.arange(60.0), positions, window=9, sigma_m=1.0)
    assert np.all(np.isnan(found.velocity[[29, 30]]))
    assert np.all(found.edge[[29, 30]])
    weights, _ = local_weights(np.arange(9.0), 4, 3)
    assert np.all(np.isfinite(weights))


@pytest.mark.parametrize(("window", "order"), [(10, 3), (3, 3), (5, 1), (5, 5)])
def test_windows_that_are_none_are_refused(window, order):
    with pytest.raises(ValueError, match="the window must be odd"):
        local_polynomials(np.arange(60.0), np.zeros(60), window=window, order=order, sigma_m=1.0)
