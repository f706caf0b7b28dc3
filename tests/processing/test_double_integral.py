import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.double_integral import DoubleIntegral, integrate
from tests.builders.motions import acceleration, travel, velocity


@pytest.mark.parametrize("count", [0, 1])
def test_no_interval_gives_no_integral(count):
    assert integrate(np.ones(count), 0.1).tolist() == [0.0] * count


def test_a_straight_line_is_integrated_exactly():
    times = np.arange(11) * 0.1
    assert np.allclose(integrate(2 * times, 0.1), times**2, rtol=0, atol=1e-15)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=20), st.floats(-100.0, 100.0), st.floats(1e-4, 1.0))
def test_straight_lines_are_integrated_twice_exactly_at_and_between_the_samples(values, start_s, step_s):
    samples = np.array(values)
    integral = DoubleIntegral.of(samples, start_s, step_s)
    s, v, x = 0.3 * step_s, 0.0, 0.0
    for i in range(samples.size - 1):
        slope = (samples[i + 1] - samples[i]) / step_s
        found = integral.at(np.array([start_s + i * step_s, start_s + i * step_s + s]))
        scale = 1e3 * (step_s * samples.size) ** 2
        assert np.allclose(found[0], [x, x + v * s + samples[i] * s**2 / 2 + slope * s**3 / 6], atol=1e-8 * scale)
        assert np.allclose(found[1], [v, v + samples[i] * s + slope * s**2 / 2], atol=1e-8 * scale / step_s)
        x += v * step_s + samples[i] * step_s**2 / 2 + slope * step_s**3 / 6
        v += samples[i] * step_s + slope * step_s**2 / 2


def test_a_recoil_is_integrated_to_its_travel():
    times = np.arange(18_000) / 20_000
    integral = DoubleIntegral.of(acceleration(times), 0.0, 1 / 20_000)
    between = np.linspace(0.0, 0.89, 1237)
    x, v = integral.at(between)
    assert np.allclose(x, travel(between), rtol=0, atol=1e-6)
    assert np.allclose(v, velocity(between), rtol=0, atol=3e-4)


def test_it_says_which_instants_it_covers():
    integral = DoubleIntegral.of(np.zeros(3), -1.0, 0.5)
    assert integral.covers(np.array([-1.1, -1.0, -0.3, 0.0, 0.1])).tolist() == [False, True, True, True, False]


def test_beyond_the_ends_the_outermost_lines_go_on():
    integral = DoubleIntegral.of(np.full(5, 2.0), 0.0, 1.0)
    x, v = integral.at(np.array([-2.0, 6.0]))
    assert np.allclose(x, [4.0, 36.0])
    assert np.allclose(v, [-4.0, 12.0])
