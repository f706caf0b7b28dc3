import numpy as np
import pytest

from recoil_processing.motion.derivative import second_derivative


@pytest.mark.parametrize("share", [0.02, 0.05, 0.1])
def test_the_second_derivative_of_a_wave_is_right_where_two_gradients_are_not(share):
    times = np.arange(400) / 1000
    omega = 2 * np.pi * share * 1000
    wave, true = np.sin(omega * times), -(omega**2) * np.sin(omega * times)
    inner = slice(3, -3)
    error = np.abs(second_derivative(wave, 1e-3) - true)[inner].max() / omega**2
    gradients = np.abs(np.gradient(np.gradient(wave, 1e-3), 1e-3) - true)[inner].max() / omega**2
    assert error < 1.1 * (omega * 1e-3) ** 6 / 560
    assert gradients > 0.25 * (omega * 1e-3) ** 2


@pytest.mark.parametrize("count", [3, 6, 7, 20])
def test_the_second_derivative_of_a_short_parabola_is_its_constant_inside(count):
    found = second_derivative(3.0 * np.arange(float(count)) ** 2, 1.0)
    assert found.shape == (count,)
    assert np.allclose(found[3:-3], 6.0)
    assert np.all(np.isfinite(found))
