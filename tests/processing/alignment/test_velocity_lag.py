import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.alignment.motion_alignment import SPAN_S, camera_velocity, velocity_shift
from recoil_processing.alignment.motion_least_squares import MotionModel
from recoil_processing.double_integral import DoubleIntegral
from tests.builders.motions import record_motion, travel, velocity


def model_of(seed: int, **conditions: float) -> tuple[MotionModel, float, float, float]:
    motion = record_motion(seed, **conditions)
    integral = DoubleIntegral.of(motion.acceleration_m_s2, motion.start_s, motion.step_s)
    t = motion.camera_times_s
    density = motion.acceleration_sigma_m_s2**2 * motion.step_s
    middle = float(np.average(t, weights=velocity(t + motion.offset_s) ** 2))
    return MotionModel(t, motion.displacement_m, 0.5 * float(t[0] + t[-1]), integral), motion.offset_s, density, middle


def shift_of(model: MotionModel, start_s: float, density: float, *, sigma_m: float = 5e-5, **more: float):
    known = {"u_drift": 0.0, "since_s": 0.0, **more}
    return velocity_shift(model, start_s, 0.0, marker_variance=sigma_m**2, density=density, **known)


@pytest.mark.parametrize(
    "conditions",
    [{}, {"marker_sigma_m": 2e-4}, {"acceleration_sigma_m_s2": 20.0}, {"acceleration_sigma_m_s2": 0.01}],
    ids=["usual", "noisy marker", "noisy accelerometer", "marker alone"],
)
def test_errors_are_what_the_uncertainty_says(conditions):
    pulls = []
    for seed in range(40):
        model, offset_s, density, _ = model_of(seed, **conditions)
        shift_s, u_s = shift_of(model, offset_s + 3e-4, density, sigma_m=conditions.get("marker_sigma_m", 5e-5))
        pulls.append((shift_s - offset_s) / u_s)
    assert 0.75 < math.sqrt(np.mean(np.square(pulls))) < 1.25


def test_a_drift_that_is_not_known_widens_the_uncertainty_where_the_motion_is_not():
    model, offset_s, density, middle = model_of(1)
    _, plain = shift_of(model, offset_s, density)
    since = middle - model.origin_s
    _, near = shift_of(model, offset_s, density, u_drift=5e-5, since_s=since)
    _, far = shift_of(model, offset_s, density, u_drift=5e-5, since_s=since + 10.0)
    assert plain <= near < 3 * plain
    assert far == pytest.approx(10.0 * 5e-5, rel=0.02)


def test_velocities_are_those_over_the_span():
    t = np.arange(200) / 2000.0
    times, speeds = camera_velocity(t, travel(t))
    span = round(SPAN_S * 2000.0)
    assert times.size == 200 - span
    assert times == pytest.approx(t[:-span] + 0.5 * SPAN_S)
    assert speeds == pytest.approx((travel(t[span:]) - travel(t[:-span])) / SPAN_S)
    assert np.abs(speeds - velocity(times)).max() < 0.6


def test_where_nothing_moves_the_velocities_say_nothing():
    model, offset_s, density, _ = model_of(2)
    still = replace(model, integral=DoubleIntegral.of(np.zeros(18_000), 0.0, 5e-5))
    shift_s, u_s = shift_of(still, offset_s, density)
    assert math.isnan(shift_s)
    assert u_s == math.inf
    few = replace(model, times_s=model.times_s[:10], positions_m=model.positions_m[:10])
    assert shift_of(few, offset_s, density)[1] == math.inf
