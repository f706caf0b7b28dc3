"""The noise of a regression's rows: that of the baseline behind the filter, its size told by the shot within limits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.row_noise import (
    LARGEST_SIZE,
    LEAST_SIZE,
    PROPORTIONAL,
    RowNoise,
    correlation_of,
    row_noise,
)
from recoil_processing.filters import LowPass
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression, spaced_rows
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.correlations import lower_factor
from tests.identification.test_camera_rows import rows_of

SIGMA_M_S2 = 20.0
"""Of the accelerometer, per sample."""
LOW_PASS = LowPass(300.0)


@cache
def exact() -> Regression:
    """As recorded, with Newton's law in every sample."""
    recorded = bench_regression()
    return replace(recorded, acceleration_m_s2=recorded.force_n / MASS_KG)


def noisy(seed: int, sigma_m_s2: float = SIGMA_M_S2, **changed: np.ndarray) -> Regression:
    """Filter the shot with white noise on the accelerometer."""
    recorded = replace(exact(), **changed)
    noise = np.random.default_rng(seed).normal(0.0, sigma_m_s2, recorded.times_s.size)
    return replace(recorded, acceleration_m_s2=recorded.acceleration_m_s2 + noise).filtered(LOW_PASS)


def found(regression: Regression, sigma_m_s2: float = SIGMA_M_S2, force_n: float = 0.0) -> RowNoise:
    return row_noise(regression, MASS_KG, BaselineNoise(slow_acceleration=sigma_m_s2, slow_force=force_n))


def test_the_baselines_noise_is_what_the_filter_leaves_of_it():
    errors = np.concatenate([
        (noisy(seed).acceleration_m_s2 - noisy(seed, 0.0).acceleration_m_s2)[spaced_rows(noisy(seed))]
        for seed in range(20)
    ])  # fmt: skip
    one = found(noisy(0))
    rigid = np.argmin(np.abs(noisy(0).acceleration_m_s2))
    assert one.sigma_m_s2[rigid] == pytest.approx(np.clip(one.size, LEAST_SIZE, LARGEST_SIZE) * errors.std(), rel=0.05)


def test_rows_as_far_apart_as_they_are_taken_have_errors_of_their_own():
    errors = [
        (noisy(seed).acceleration_m_s2 - noisy(seed, 0.0).acceleration_m_s2)[spaced_rows(noisy(seed))]
        for seed in range(40)
    ]
    neighbours = np.mean([one[1:] @ one[:-1] / (one @ one) for one in errors])
    assert abs(neighbours) < 0.1


def test_noise_of_the_gauges_is_in_it_as_the_mass_takes_it():
    quiet, loud = (found(noisy(0), force_n=force_n) for force_n in (0.0, MASS_KG * SIGMA_M_S2))
    still = np.argmin(np.abs(noisy(0).acceleration_m_s2))
    assert loud.size / quiet.size == pytest.approx(1 / np.sqrt(2), rel=0.02)
    assert found(noisy(0), 1.0, MASS_KG).sigma_m_s2[still] == pytest.approx(
        np.sqrt(2) * found(noisy(0), 1.0).sigma_m_s2[still], rel=1e-9
    )  # both at the largest size


def test_what_is_proportional_to_the_motion_counts_where_the_motion_is():
    regression = noisy(1, 0.01)
    one = found(regression, 0.01)
    peak = np.argmax(np.abs(regression.acceleration_m_s2))
    share = PROPORTIONAL * np.clip(one.size, LEAST_SIZE, LARGEST_SIZE)
    assert one.sigma_m_s2[peak] == pytest.approx(share * abs(regression.acceleration_m_s2[peak]), rel=0.01)
    assert one.sigma_m_s2.min() < 0.01 * one.sigma_m_s2[peak]


@pytest.mark.parametrize("seed", range(5))
def test_the_size_is_one_if_the_shot_is_as_quiet_as_the_baseline(seed):
    one = found(noisy(seed))
    assert one.size == pytest.approx(1.0, abs=4 / np.sqrt(2 * one.degrees_of_freedom))


@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_gauge_that_is_off_is_not_excused_as_noise(column):
    forces = exact().forces_n.copy()
    forces[:, column] *= 1.15
    assert found(noisy(2, forces_n=forces)).size == pytest.approx(found(noisy(2)).size, rel=1e-3)


def test_a_mass_that_changes_is_not_excused_as_noise():
    r = exact()
    drifting = MASS_KG * (1.0 - 0.04 * np.clip((r.times_s - r.interval_s[0]) / np.ptp(r.interval_s), 0.0, 1.0))
    changing = noisy(2, acceleration_m_s2=r.force_n / drifting)
    assert found(changing).size == pytest.approx(found(noisy(2)).size, rel=0.02)


def test_the_shot_moves_the_noise_within_limits_only():
    quieter, louder = found(noisy(3), 10 * SIGMA_M_S2), found(noisy(3), 0.01 * SIGMA_M_S2)
    assert quieter.size < LEAST_SIZE
    assert louder.size > LARGEST_SIZE
    expected = found(noisy(3)).sigma_m_s2 / np.clip(found(noisy(3)).size, LEAST_SIZE, LARGEST_SIZE)
    still = np.argmin(np.abs(noisy(3).acceleration_m_s2))
    assert quieter.sigma_m_s2[still] == pytest.approx(LEAST_SIZE * 10 * expected[still], rel=1e-6)
    assert louder.sigma_m_s2[still] == pytest.approx(LARGEST_SIZE * 0.01 * expected[still], rel=1e-2)


def test_without_a_baseline_the_shot_alone_tells():
    one = row_noise(noisy(4), MASS_KG)
    assert np.ptp(one.sigma_m_s2) == 0
    assert one.sigma_m_s2[0] == pytest.approx(
        found(noisy(4)).size
        * found(noisy(4), SIGMA_M_S2).sigma_m_s2.min()
        / np.clip(found(noisy(4)).size, LEAST_SIZE, LARGEST_SIZE),
        rel=0.1,
    )
    assert one.degrees_of_freedom < spaced_rows(noisy(4)).size - 8


def test_a_record_without_any_error_has_a_noise_all_the_same():
    assert row_noise(exact().filtered(LOW_PASS), MASS_KG).sigma_m_s2.min() > 0


def test_rows_and_frames_are_correlated_as_noise_that_is_filtered_and_integrated_is():
    """The noise of an accelerometer is drawn, sample by sample; nothing of the covariance's formula is used."""
    regression = noisy(0)
    times_s, step_s, onset_s = regression.times_s, regression.step_s, regression.interval_s[0]
    rows = spaced_rows(regression)
    noise = found(regression)
    at = np.searchsorted(times_s, onset_s + 1e-3 * np.arange(-3.5, 60.5, 3.0))
    sigma_m = 2e-5
    camera = replace(
        rows_of("mixed"), times_s=times_s[at], sigma_m=np.full(at.size, sigma_m), onset_s=onset_s, density=0.0
    )
    correlation = correlation_of(regression, rows, noise, camera)
    assert correlation is not None
    rng, drawn = np.random.default_rng(5), []
    scale = np.concatenate([noise.sigma_m_s2[rows], camera.sigma_m])
    for _ in range(600):
        felt = rng.normal(0.0, np.sqrt(noise.density / step_s), times_s.size)
        proportional = np.sqrt(noise.sigma_m_s2[rows] ** 2 - noise.sensors_m_s2**2) * rng.standard_normal(rows.size)
        moved = np.cumsum(np.cumsum(felt * (times_s >= onset_s))) * step_s**2
        of_rows = LOW_PASS.apply(felt, regression.rate_hz)[rows] + proportional
        of_frames = sigma_m * rng.standard_normal(at.size) - moved[at]
        drawn.append(np.concatenate([of_rows, of_frames]) / scale)
    white = correlation.whitened(np.array(drawn).T).T
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.02)
    slow = np.cos(np.pi * np.outer(np.arange(6), np.arange(rows.size) + 0.5) / rows.size)
    slowest = np.hstack([slow, np.zeros((6, at.size))]), np.hstack([np.zeros((6, rows.size)), np.eye(at.size)[-6:]])
    for some in slowest:
        spread = np.linalg.eigvalsh(np.cov(some / np.linalg.norm(some, axis=1, keepdims=True) @ white.T))
        assert 0.7 < spread[0] <= spread[-1] < 1.35
    across = white[:, : rows.size].T @ white[:, rows.size :] / len(drawn)
    assert np.abs(across).max() < 5.0 / np.sqrt(len(drawn))


def test_frames_may_be_noisier_than_the_accelerometers_own_noise_makes_them_and_rows_alone_are_correlated_too():
    regression, camera = noisy(0), rows_of("mixed")
    rows, noise = spaced_rows(regression), found(regression)
    quiet, loud = (
        correlation_of(regression, rows, noise, replace(camera, onset_s=regression.interval_s[0], density=density))
        for density in (0.0, 10 * noise.density)
    )
    alone = correlation_of(regression, rows, noise, None)
    assert quiet is not None
    assert loud is not None
    assert alone is not None
    n = rows.size
    factors = [lower_factor(one) for one in (quiet, loud)]
    np.testing.assert_allclose(factors[0][:n, :n], lower_factor(alone), atol=1e-12)
    variances = [np.diag(one @ one.T)[n:] - 1.0 for one in factors]
    np.testing.assert_allclose(variances[1], 10 * variances[0], rtol=1e-6, atol=1e-9)
    assert correlation_of(regression, rows, replace(noise, sensors_m_s2=0.0), camera) is None
