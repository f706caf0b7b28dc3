import numpy as np
import pytest

from recoil_processing.alignment.motion_least_squares import LONGEST_STEP_S, MotionModel, gauss_newton_step, profile
from recoil_processing.double_integral import DoubleIntegral
from tests.builders.motions import RecordedMotion, record_motion


def model_of(motion: RecordedMotion) -> MotionModel:
    integral = DoubleIntegral.of(motion.acceleration_m_s2, motion.start_s, motion.step_s)
    t = motion.camera_times_s
    return MotionModel(t, motion.displacement_m, 0.5 * float(t[0] + t[-1]), integral)


def step(model: MotionModel, shift_s: float, drift: float = 0.0, *, density: float = 1.25e-3, allowance: float = 1e-7):
    return gauss_newton_step(model, shift_s, drift, marker_variance=2.5e-9, density=density, drift_allowance=allowance)


def test_one_step_from_nearby_goes_to_the_truth():
    motion = record_motion(1)
    solution = step(model_of(motion), motion.offset_s + 1e-4)
    assert not solution.converged
    assert abs(solution.shift_s - motion.offset_s) < 5 * solution.u_mapped_s(0.0)
    again = step(model_of(motion), solution.shift_s, solution.drift)
    assert abs(again.shift_s - solution.shift_s) < 0.2 * solution.u_mapped_s(0.0)
    assert step(model_of(motion), again.shift_s, again.drift).converged


def test_a_step_is_never_longer_than_the_model_reaches():
    motion = record_motion(1)
    solution = step(model_of(motion), motion.offset_s + 0.02)
    assert abs(solution.shift_s - motion.offset_s - 0.02) == pytest.approx(LONGEST_STEP_S)


def test_the_covariance_is_that_of_the_dense_normal_equations():
    motion = record_motion(2, frames=300, first_frame_s=0.02)
    model = model_of(motion)
    solution = step(model, motion.offset_s, allowance=5e-5)
    t = model.times_s
    since = t - t[0]
    early, late = np.minimum.outer(since, since), np.maximum.outer(since, since)
    dense = 1.25e-3 * early**2 * (3 * late - early) / 6 + 2.5e-9 * np.eye(t.size)
    travel, velocity = model.integral.at(model.mapped_s(motion.offset_s, 0.0))
    middle = t - model.origin_s
    columns = np.column_stack([travel, velocity, velocity * middle, np.ones(t.size), middle, middle**2 / 2])
    weighted = np.linalg.solve(dense, columns)
    gain = np.linalg.lstsq(
        np.linalg.solve(np.linalg.cholesky(dense), columns[:, [0, 3, 4, 5]]),
        np.linalg.solve(np.linalg.cholesky(dense), model.positions_m),
        rcond=None,
    )[0][0]
    columns[:, 1:3] *= gain
    weighted[:, 1:3] *= gain
    information = columns.T @ weighted
    information[2, 2] += 1 / 5e-5**2
    scale = 1 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    expected = covariance * max(1.0, solution.innovation_statistic)
    assert np.allclose(solution.covariance, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_the_profile_peaks_at_the_solution_and_falls_as_its_uncertainty_says():
    motion = record_motion(3)
    model = model_of(motion)
    solution = step(model, motion.offset_s)
    solution = step(model, solution.shift_s, solution.drift)
    u = np.sqrt(solution.covariance[1, 1] / max(1.0, solution.innovation_statistic))
    curve = profile(model, solution, u * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))
    assert np.argmax(curve) == 2
    assert np.allclose(curve - curve[2], [-2.0, -0.5, 0.0, -0.5, -2.0], atol=0.1)


def test_no_frame_in_the_record_gives_nothing():
    assert step(model_of(record_motion(1)), 100.0) is None


def test_a_motion_that_is_not_there_gives_nothing():
    motion = record_motion(1)
    integral = DoubleIntegral.of(np.zeros(18_000), 0.0, motion.step_s)
    t = motion.camera_times_s
    assert step(MotionModel(t, motion.displacement_m, 0.4, integral), motion.offset_s) is None


def test_the_mapping_is_about_the_origin():
    model = MotionModel(np.array([9.0, 10.0, 11.0]), np.zeros(3), 10.0, DoubleIntegral.of(np.zeros(2), 0.0, 1.0))
    assert model.mapped_s(0.5, 0.1) == pytest.approx([9.4, 10.5, 11.6])
