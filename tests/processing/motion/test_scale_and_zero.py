"""A camera tells an accelerometer's scale, its zero, and how that shifted."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.scale_and_zero import CameraMotion, ScaleAndZero, camera_motion

STEP_S, RATE_HZ = 1e-4, 1e4
TIMES_S = STEP_S * np.arange(5000)
ONSET_S = 0.1
SIGMA_ACCELERATION, SIGMA_MARKER = 5.0, 5e-5
DENSITY = SIGMA_ACCELERATION**2 * STEP_S


def acceleration() -> np.ndarray:
    since = TIMES_S - ONSET_S
    push = np.where((since > 0) & (since < 0.012), 1200.0 * np.sin(np.pi * since / 0.012), 0.0)
    brake = np.where((since > 0.012) & (since < 0.2), -48.0 * (1 + 0.1 * np.sin(60 * since)), 0.0)
    return push + brake


def shapes() -> np.ndarray:
    since = np.maximum(TIMES_S - ONSET_S, 0.0)
    after = (TIMES_S >= ONSET_S).astype(float)
    return np.column_stack([after, after * np.exp(-since / 0.02)])


def tracked(seed: int, *, gain=1.0, bias=0.0, shifts=(0.0, 0.0), lost=0, u_bias=0.1) -> CameraMotion:
    """Gain is the camera's scale over the accelerometer's, here all the camera's."""
    rng = np.random.default_rng(seed)
    true = acceleration()
    read = true + bias + shapes() @ np.array(shifts) + rng.normal(0.0, SIGMA_ACCELERATION, true.size)
    frames = 0.01 + np.arange(1800) / 4000.0
    path = DoubleIntegral.of(true, 0.0, STEP_S).at(frames)[0]
    positions = gain * path + 0.02 + rng.normal(0.0, SIGMA_MARKER, frames.size)
    positions[rng.choice(frames.size, lost, replace=False)] = np.nan
    integral = DoubleIntegral.of(read, 0.0, STEP_S)
    return camera_motion(
        frames, positions, integral, gain=1.0, marker_sigma_m=SIGMA_MARKER, u_offset_s=5e-6, u_bias_m_s2=u_bias
    )


def solved(motion: CameraMotion, columns: np.ndarray | None = None) -> ScaleAndZero:
    found = motion.solve(shapes() if columns is None else columns, DENSITY)
    assert found is not None
    return found


def test_scale_zero_and_shifts_come_back_within_their_uncertainties() -> None:
    truth = np.array([1.004, 0.05, 12.0, -20.0])
    normalised = []
    for seed in range(30):
        bias = float(np.random.default_rng(1000 + seed).normal(0.0, 0.1))
        found = solved(tracked(seed, gain=truth[0], bias=bias, shifts=tuple(truth[2:]), lost=60))
        values = np.array([found.gain, found.bias_m_s2, *found.shifts_m_s2])
        normalised.append((values - [truth[0], bias, *truth[2:]]) / np.sqrt(np.diag(found.covariance)))
        assert found.innovation_statistic == pytest.approx(1.0, abs=0.15)
    rms = np.sqrt(np.mean(np.square(normalised), axis=0))
    assert np.all((rms > 0.6) & (rms < 1.4)), rms


def test_a_shift_that_is_left_out_shows_in_the_misfit_and_none_does_not() -> None:
    nothing = np.zeros((TIMES_S.size, 0))
    shifted, sound = tracked(1, shifts=(10.0, 0.0)), tracked(1)
    assert solved(shifted, nothing).misfit - solved(shifted).misfit > 50
    assert solved(sound, nothing).misfit - solved(sound).misfit < 12


def test_the_likeliest_density_is_the_accelerometers_own() -> None:
    found = tracked(2).likeliest(shapes(), [0, 1], [DENSITY * f for f in (0.01, 1.0, 100.0)])
    assert found is not None
    assert found.density == DENSITY


def test_without_a_baseline_the_bias_is_estimated_by_the_camera_alone() -> None:
    nothing = np.zeros((TIMES_S.size, 0))
    found = solved(tracked(3, bias=4.0, u_bias=math.inf), nothing)
    assert found.bias_m_s2 == pytest.approx(4.0, abs=5 * math.sqrt(found.covariance[1, 1]))
    assert math.sqrt(found.covariance[1, 1]) < 1.0


def test_too_few_frames_and_columns_that_repeat_one_another_give_nothing() -> None:
    motion = tracked(4, lost=1780)
    assert motion.solve(shapes(), DENSITY) is None
    twice = np.column_stack([shapes()[:, 0], shapes()[:, 0]])
    assert tracked(4).solve(twice, DENSITY) is None


def test_bad_arguments_are_refused() -> None:
    integral = DoubleIntegral.of(acceleration(), 0.0, STEP_S)
    with pytest.raises(ValueError, match="equally many"):
        camera_motion(TIMES_S, TIMES_S[1:], integral, gain=1.0, marker_sigma_m=1e-5, u_offset_s=0.0, u_bias_m_s2=0.1)
    with pytest.raises(ValueError, match="positive"):
        camera_motion(TIMES_S, TIMES_S, integral, gain=1.0, marker_sigma_m=0.0, u_offset_s=0.0, u_bias_m_s2=0.1)


def test_one_factorisation_serves_every_choice_of_shapes() -> None:
    motion = tracked(5, shifts=(8.0, 5.0))
    track = motion.whitened(shapes(), DENSITY)
    assert track is not None
    for chosen in ([], [0], [1], [0, 1]):
        once, alone = track.solve(chosen), motion.solve(shapes()[:, chosen], DENSITY)
        assert once is not None
        assert alone is not None
        assert once.misfit == pytest.approx(alone.misfit, abs=1e-5)
        np.testing.assert_allclose(once.covariance, alone.covariance, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(once.shifts_m_s2, alone.shifts_m_s2, rtol=1e-6)
