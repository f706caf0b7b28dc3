import numpy as np
import pytest

from recoil_processing.alignment.motion_least_squares import MotionModel
from recoil_processing.alignment.motion_solver import MotionSolver
from recoil_processing.double_integral import DoubleIntegral
from tests.builders.motions import record_motion

DENSITY = 1.25e-3


def model_of(seed: int, **conditions: float) -> MotionModel:
    motion = record_motion(seed, **conditions)
    t = motion.camera_times_s
    integral = DoubleIntegral.of(motion.acceleration_m_s2, motion.start_s, motion.step_s)
    return MotionModel(t, motion.displacement_m, 0.5 * float(t[0] + t[-1]), integral)


def test_the_density_is_the_one_with_the_highest_likelihood():
    model = model_of(1, acceleration_sigma_m_s2=20.0)
    solver = MotionSolver(2.5e-9, [DENSITY, 16 * DENSITY, 4096 * DENSITY])
    found, density = solver.likeliest(model, 0.0531, 0.0, 5e-5)
    assert density == 16 * DENSITY
    each = [solver.converge(model, 0.0531, 0.0, d, 5e-5).log_likelihood for d in solver.densities]
    assert found.log_likelihood == pytest.approx(max(each))


def test_a_filter_serves_again_only_for_the_frames_that_it_was_made_for():
    solver = MotionSolver(2.5e-9, [DENSITY])
    whole, part = model_of(2), model_of(2, frames=700)
    first = solver.step(whole, 0.0531, 0.0, DENSITY, 5e-5)
    assert solver.step(whole, 0.0532, 0.0, DENSITY, 5e-5).walk is first.walk
    other = solver.step(part, 0.0531, 0.0, DENSITY, 5e-5)
    assert other.walk.steps_s.size == 700
    fresh = MotionSolver(2.5e-9, [DENSITY]).step(part, 0.0531, 0.0, DENSITY, 5e-5)
    assert other.shift_s == fresh.shift_s


def test_the_search_settles_from_milliseconds_away():
    solver = MotionSolver(2.5e-9, [DENSITY])
    near = solver.converge(model_of(3), 0.0531, 0.0, DENSITY, 5e-5)
    far = solver.converge(model_of(3), 0.0571, 0.0, DENSITY, 5e-5)
    assert near.converged
    assert far.converged
    assert far.shift_s == pytest.approx(near.shift_s, abs=1e-7)


def test_nothing_to_go_by_is_a_sentence():
    solver = MotionSolver(2.5e-9, [DENSITY])
    assert "only 0 frames fall into" in solver.converge(model_of(4), 100.0, 0.0, DENSITY, 5e-5)
    still = model_of(4)
    still = MotionModel(
        still.times_s, still.positions_m, still.origin_s, DoubleIntegral.of(np.zeros(18_000), 0.0, 5e-5)
    )
    assert "cannot be distinguished" in solver.likeliest(still, 0.05, 0.0, 5e-5)


def test_no_density_is_refused():
    with pytest.raises(ValueError, match="must be a noise density"):
        MotionSolver(2.5e-9, [])
