import numpy as np
import pytest

import recoil_processing.motion.jerk_smoother as module
from recoil_processing.motion.derivative import ScaledTrack
from recoil_processing.motion.jerk_smoother import smooth_jerk
from tests.builders.sharp_recoil import motion, record_recoil

SIGMA = 5e-5


def jerk_motion(seed: int, times: np.ndarray, intensity: float) -> np.ndarray:
    """Draw positions, velocities and accelerations of a motion whose jerk is white, exactly in distribution."""
    rng = np.random.default_rng(seed)
    states = np.zeros((times.size, 3))
    for i, h in enumerate(np.diff(times), 1):
        states[i] = np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]]) @ states[i - 1]
        states[i] += np.linalg.cholesky(intensity * growth(h)) @ rng.standard_normal(3)
    return states


def growth(h: float) -> np.ndarray:
    return np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])


def uneven(count: int, seed: int = 0) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, count)) / 2000


def scaled(count: int = 30, seed: int = 2) -> ScaledTrack:
    times = uneven(count)
    rng = np.random.default_rng(seed)
    return ScaledTrack.of(times, 1e-3 * np.cumsum(np.cumsum(rng.standard_normal(count))), SIGMA, 8)


def test_states_and_covariances_are_those_of_least_squares_over_all_steps():
    track = scaled()
    log_q = np.random.default_rng(3).normal(0.0, 2.0, track.times.size - 1)
    found = module._smooth(track, log_q)
    n = track.times.size
    rows, target = [], []
    first = np.array(module._start(track))
    prior = np.zeros((3, 3))
    prior[np.triu_indices(3)] = first[3:]
    prior = np.triu(prior) + np.triu(prior, 1).T
    whiten = np.linalg.inv(np.linalg.cholesky(prior))
    rows.append(np.hstack([whiten, np.zeros((3, 3 * n - 3))]))
    target += (whiten @ first[:3]).tolist()
    for i, h in enumerate(np.diff(track.times)):
        whiten = np.linalg.inv(np.linalg.cholesky(np.exp(log_q[i]) * growth(h)))
        block = np.zeros((3, 3 * n))
        block[:, 3 * i : 3 * i + 3] = -whiten @ np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]])
        block[:, 3 * i + 3 : 3 * i + 6] = whiten
        rows.append(block)
        target += [0.0, 0.0, 0.0]
    for i, z in enumerate(track.positions):
        row = np.zeros((1, 3 * n))
        row[0, 3 * i] = 1.0
        rows.append(row)
        target.append(float(z))
    q, r = np.linalg.qr(np.vstack(rows))
    inverse = np.linalg.inv(r)
    states = (inverse @ (q.T @ np.array(target))).reshape(n, 3)
    covariance = (inverse @ inverse.T).reshape(n, 3, n, 3)
    assert np.allclose(found.states, states, rtol=1e-6, atol=1e-6)
    for i in range(n):
        assert np.allclose(found.covariances[i], covariance[i, :, i], rtol=1e-6, atol=1e-7)


def test_the_score_is_the_slope_of_the_likelihood():
    track = scaled()
    log_q = np.random.default_rng(4).normal(0.0, 2.0, track.times.size - 1)
    found = module._smooth(track, log_q)
    for i in (0, 7, 28):
        step = np.zeros(log_q.size)
        step[i] = 1e-4
        slope = (module._filter(track, log_q + step)[1] - module._filter(track, log_q - step)[1]) / 2e-4
        assert found.score[i] == pytest.approx(slope, rel=1e-4, abs=1e-6)
    assert np.all(found.information >= 0)


def test_the_intensity_of_a_motion_of_one_intensity_is_found():
    times = uneven(1500)
    intensity = 1e9
    positions = jerk_motion(5, times, intensity)[:, 0] + SIGMA * np.random.default_rng(6).standard_normal(times.size)
    track = ScaledTrack.of(times, positions, SIGMA, 8)
    true = np.log(intensity * track.step_s**5 / SIGMA**2)
    assert module._likeliest_constant(track) == pytest.approx(true, abs=0.5)


@pytest.mark.parametrize(("adaptive", "most"), [(False, 1.15), (True, 1.4)])
def test_uncertainties_are_those_of_the_errors_of_a_motion_of_white_jerk(adaptive, most):
    z = []
    for seed in range(6):
        times = uneven(300, seed)
        states = jerk_motion(seed, times, 1e9)
        noise = SIGMA * np.random.default_rng(100 + seed).standard_normal(times.size)
        found = smooth_jerk(times, states[:, 0] + noise, sigma_m=SIGMA, adaptive=adaptive)
        z.append(
            [
                (found.position - states[:, 0]) / found.u_position,
                (found.velocity - states[:, 1]) / found.u_velocity,
                (found.acceleration - states[:, 2]) / found.u_acceleration,
            ]
        )
    for errors in np.moveaxis(np.array(z), 1, 0):
        assert 0.85 < np.sqrt(np.mean(errors**2)) < most


@pytest.mark.parametrize("sigma", [5e-5, 2e-4])
def test_following_the_motion_halves_the_errors_of_a_recoil(sigma):
    ratios, covered = [], []
    for seed in range(4):
        recorded = record_recoil(seed, begin_s=0.06, end_s=0.3, marker_sigma_m=sigma)
        _, v, a = motion(recorded.frame_times_s)
        following, constant = (
            smooth_jerk(recorded.frame_times_s, recorded.displacement_m, adaptive=adaptive)
            for adaptive in (True, False)
        )
        ratios.append(
            [
                np.std(following.velocity - v) / np.std(constant.velocity - v),
                np.std(following.acceleration - a) / np.std(constant.acceleration - a),
            ]
        )
        covered.append(np.mean(np.abs(following.velocity - v) < 2 * following.u_velocity))
        assert following.peak_acceleration()[1] == pytest.approx(a.max(), rel=0.12)
    assert np.mean(ratios, axis=0)[0] < 0.5
    assert np.mean(ratios, axis=0)[1] < 0.7
    assert np.mean(covered) > 0.92


def test_a_lost_frame_widens_the_uncertainty():
    recorded = record_recoil(1, begin_s=0.06, end_s=0.2)
    lost = recorded.displacement_m.copy()
    lost[83:86] = np.nan
    whole = smooth_jerk(recorded.frame_times_s, recorded.displacement_m)
    holed = smooth_jerk(recorded.frame_times_s, lost)
    assert holed.u_velocity[82] > 1.1 * whole.u_velocity[82]
