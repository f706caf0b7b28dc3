"""The noise of a regression's rows: that of the baseline behind the filter, and what the motion adds to it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.rows.motion_noise import MotionParts
from recoil_identification.rows.row_noise import (
    LEAST_NOISE_M_S2,
    PROPORTIONAL,
    RowNoise,
    by_filter,
    correlation_of,
    rest_covariance,
    row_noise,
    walked,
)
from recoil_processing.filters import LowPass
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression, spaced_rows
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.correlations import lower_factor
from tests.identification.calibration.test_calibration import tracked

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
    assert one.rest_m_s2[rigid] == pytest.approx(errors.std(), rel=0.05)
    np.testing.assert_array_equal(one.sigma_m_s2, one.rest_m_s2)


@pytest.mark.exhaustive
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
    )


def test_what_is_proportional_to_the_motion_counts_where_the_motion_is():
    regression = noisy(1, 0.01)
    one = found(regression, 0.01)
    peak = np.argmax(np.abs(regression.acceleration_m_s2))
    assert one.sigma_m_s2[peak] == pytest.approx(PROPORTIONAL * abs(regression.acceleration_m_s2[peak]), rel=0.01)
    assert one.sigma_m_s2.min() < 0.01 * one.sigma_m_s2[peak]


@pytest.mark.parametrize("seed", range(5))
def test_the_size_is_one_if_the_shot_is_as_quiet_as_the_baseline(seed):
    one = found(noisy(seed))
    assert one.size == pytest.approx(1.0, abs=4 / np.sqrt(2 * one.degrees_of_freedom))


@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_gauge_that_is_off_is_not_excused_as_noise(column):
    forces = exact().forces_n.copy()
    forces[:, column] *= 1.15
    assert found(noisy(2, forces_n=forces)).size == pytest.approx(found(noisy(2)).size, rel=5e-3)


def test_a_mass_that_changes_is_not_excused_as_noise():
    r = exact()
    drifting = MASS_KG * (1.0 - 0.04 * np.clip((r.times_s - r.interval_s[0]) / np.ptp(r.interval_s), 0.0, 1.0))
    changing = noisy(2, acceleration_m_s2=r.force_n / drifting)
    assert found(changing).size == pytest.approx(found(noisy(2)).size, rel=0.02)


@pytest.mark.parametrize("factor", [0.5, 10.0])
def test_the_noise_at_rest_is_the_baselines_however_loud_the_shot_is(factor):
    still = np.argmin(np.abs(noisy(3).acceleration_m_s2))
    one, other = found(noisy(3)), found(noisy(3), factor * SIGMA_M_S2)
    assert other.size == pytest.approx(one.size / factor, rel=0.1)
    assert other.rest_m_s2[still] == pytest.approx(factor * one.rest_m_s2[still], rel=0.01)


def test_without_a_baseline_what_is_proportional_is_all_that_is_known():
    one = row_noise(noisy(4), MASS_KG)
    expected = np.maximum(PROPORTIONAL * np.abs(noisy(4).acceleration_m_s2), LEAST_NOISE_M_S2)
    np.testing.assert_allclose(one.rest_m_s2, expected, rtol=1e-12)
    assert (one.size, one.sensors_m_s2, one.density) == (1.0, 0.0, 0.0)
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
    camera = replace(tracked(), times_s=times_s[at], sigma_m=np.full(at.size, sigma_m), onset_s=onset_s, density=0.0)
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
    regression, camera = noisy(0), tracked()
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
    unknown = correlation_of(regression, rows, replace(noise, sensors_m_s2=0.0), camera)
    assert unknown is not None
    np.testing.assert_array_equal(unknown.factor, np.eye(n + camera.times_s.size))


# ------------------------------------------------------------------------------------------ covariance, written out


def filter_rows(low_pass: LowPass, rate_hz: float, size: int, at: np.ndarray) -> np.ndarray:
    """Weights with which the filter makes samples `at` of the recorded ones; without phase it spreads as it gathers."""
    impulses = np.zeros((size, at.size))
    impulses[at, np.arange(at.size)] = 1.0
    return low_pass.apply(impulses, rate_hz).T


def integral_rows(times_s: np.ndarray, onset_s: float, at_s: np.ndarray) -> np.ndarray:
    """Weights with which samples, each held for a step about its instant, enter their double integral from onset on."""
    half_s = 0.5 * (times_s[1] - times_s[0])
    starts = np.maximum(times_s - half_s, onset_s)[np.newaxis, :]
    stops = np.minimum(times_s + half_s, at_s[:, np.newaxis])
    length = np.maximum(stops - starts, 0.0)
    return length * (at_s[:, np.newaxis] - 0.5 * (starts + stops))


@pytest.mark.parametrize("force_n", [0.0, MASS_KG * SIGMA_M_S2])
@pytest.mark.parametrize("lost", [False, True])
def test_the_correlation_is_that_of_filtered_and_integrated_noise_written_out(force_n, lost):
    regression = noisy(0)
    if lost:
        in_gap = np.abs(regression.times_s - regression.interval_s[0] - 0.03) < 0.01
        regression = replace(regression, trusted=regression.trusted & ~in_gap)
    times_s, step_s = regression.times_s, regression.step_s
    # half-way between samples, so that each is integrated whole or not at all
    onset_s = times_s[np.searchsorted(times_s, regression.interval_s[0])] - 0.5 * step_s
    rows, noise = spaced_rows(regression), found(regression, force_n=force_n)
    camera_s = onset_s + 1e-3 * np.arange(-3.4, 60.0, 2.0)
    sigma_m = np.linspace(1e-5, 3e-5, camera_s.size)
    camera = replace(tracked(), times_s=camera_s, sigma_m=sigma_m, onset_s=onset_s, density=0.0)
    correlation = correlation_of(regression, rows, noise, camera)
    assert correlation is not None
    own = noise.density / step_s
    weights = filter_rows(LOW_PASS, regression.rate_hz, times_s.size, rows)
    travel = integral_rows(times_s, onset_s, camera_s)
    # the gauges' noise is in the rows as the accelerometer's is, and in no frame
    all_sensors = noise.sensors_m_s2**2 / (weights[0] @ weights[0])
    assert all_sensors / own == pytest.approx(1.0 + (force_n / MASS_KG / SIGMA_M_S2) ** 2, rel=0.01)
    of_rows = all_sensors * weights @ weights.T + np.diag(noise.sigma_m_s2[rows] ** 2 - noise.sensors_m_s2**2)
    of_frames = own * travel @ travel.T + np.diag(sigma_m**2)
    across = -own * weights @ travel.T
    scale = np.concatenate([noise.sigma_m_s2[rows], sigma_m])
    expected = np.block([[of_rows, across], [across.T, of_frames]]) / np.outer(scale, scale)
    factor = lower_factor(correlation)
    np.testing.assert_allclose(factor @ factor.T, expected, rtol=2e-3, atol=2e-3)


def test_a_walk_is_as_wide_as_the_double_integral_of_white_noise():
    moving_s = np.array([0.0, 0.01, 0.03, 0.2])
    since_s = (np.arange(20_000) + 0.5) * 1e-5
    reached = np.maximum(moving_s[:, np.newaxis] - since_s, 0.0)
    np.testing.assert_allclose(walked(moving_s), reached @ reached.T * 1e-5, rtol=1e-4)


@pytest.mark.parametrize("cutoff_hz", [300.0, 6000.0])
def test_the_sensors_noise_behind_the_filter_is_what_the_filters_weights_make_of_it(cutoff_hz):
    low_pass = LowPass(cutoff_hz)
    regression = replace(noisy(0), acceleration_m_s2=noisy(0).acceleration_m_s2).filtered(low_pass)
    one = found(regression)
    (weights,) = filter_rows(low_pass, regression.rate_hz, regression.times_s.size, np.array([2000]))
    assert one.sensors_m_s2 == pytest.approx(SIGMA_M_S2 * np.linalg.norm(weights), rel=2e-3)
    assert one.density == pytest.approx(SIGMA_M_S2**2 * regression.step_s)


def test_noise_as_recorded_is_the_baselines_own_and_nothing_correlates_it():
    recorded = exact()
    rng = np.random.default_rng(7)
    loud = replace(recorded, acceleration_m_s2=recorded.acceleration_m_s2 + rng.normal(0.0, SIGMA_M_S2, 4000))
    one = found(loud)
    assert one.size == pytest.approx(1.0, abs=4 / np.sqrt(2 * one.degrees_of_freedom))
    assert one.sensors_m_s2 == pytest.approx(SIGMA_M_S2)
    assert correlation_of(loud, spaced_rows(loud), one, None) is None


def test_a_noise_that_is_not_known_to_be_white_is_of_each_row_by_itself():
    regression = noisy(0)
    plain = correlation_of(
        regression, spaced_rows(regression), RowNoise(np.ones(regression.times_s.size), 1.0, 9.0), None
    )
    assert plain is not None
    np.testing.assert_array_equal(plain.factor, np.eye(spaced_rows(regression).size))


# ------------------------------------------------------------------------------------------ its size


def left_by_hand(regression: Regression, sigma: np.ndarray, *, changes: bool = True) -> tuple[float, int]:
    """Fit all that is released by least squares; root mean square of what is left, and its degrees of freedom."""
    rows, start_s = spaced_rows(regression), regression.interval_s[0]
    columns = [*regression.forces_n[:, :3].T, regression.friction_direction, regression.released]
    columns += [regression.release_per_s, *(() if regression.shifts is None else regression.shifts.T)]
    if changes:
        # a mass that changes anywhere in a twelfth of the travel is felt as a share of the slow force
        slow_n = LowPass(75.0).apply(regression.force_n, regression.rate_hz)
        piece_s = (regression.interval_s[1] - start_s) / 12
        columns += [slow_n * np.clip((regression.times_s - start_s) / piece_s - i, 0.0, 1.0) for i in range(12)]
    table = np.column_stack(columns)[rows] / sigma[rows, np.newaxis]
    table = table / np.where(np.any(table, axis=0), np.linalg.norm(table, axis=0), 1.0)
    response = regression.acceleration_m_s2[rows] / sigma[rows]
    solution, _, rank, _ = np.linalg.lstsq(table, response, rcond=1e-9)
    left = response - table @ solution
    return float(np.sqrt(left @ left / (rows.size - rank))), int(rows.size - rank)


def with_step(regression: Regression) -> Regression:
    late = regression.times_s >= regression.interval_s[0] + 0.02
    return regression.with_shifts(late.astype(np.float64)[:, np.newaxis])


@pytest.mark.parametrize("regression", [noisy(5), with_step(noisy(5))], ids=["none", "shift"])
def test_the_size_is_what_least_squares_leave_with_everything_released(regression):
    sigma = np.hypot(found(regression).sensors_m_s2, 1e-3 * regression.acceleration_m_s2)
    size, degrees_of_freedom = left_by_hand(regression, sigma)
    assert found(regression).size == pytest.approx(size, rel=1e-6)
    assert found(regression).degrees_of_freedom == degrees_of_freedom
    alone = row_noise(regression, MASS_KG)
    _, degrees_of_freedom = left_by_hand(regression, np.ones(regression.times_s.size))
    assert (alone.size, alone.degrees_of_freedom) == (1.0, degrees_of_freedom)


@pytest.mark.parametrize(("count", "changes"), [(28, True), (27, False)])
def test_a_mass_that_changes_is_released_where_ten_rows_are_left_beyond_all_columns(count, changes):
    regression = noisy(5)
    trusted = np.zeros(regression.times_s.size, dtype=bool)
    # gauges, friction, zero and release, twelve changes, and ten
    trusted[spaced_rows(regression)[:count]] = True
    few = replace(regression, trusted=trusted)
    level = found(few).sensors_m_s2
    size, degrees_of_freedom = left_by_hand(few, np.hypot(level, 1e-3 * few.acceleration_m_s2), changes=changes)
    assert found(few).degrees_of_freedom == degrees_of_freedom
    assert found(few).size == pytest.approx(size, rel=1e-6)


def test_where_the_columns_take_all_rows_one_degree_of_freedom_is_said():
    regression = noisy(5)
    trusted = np.zeros(regression.times_s.size, dtype=bool)
    trusted[spaced_rows(regression)[:40:10]] = True
    assert row_noise(replace(regression, trusted=trusted), MASS_KG).degrees_of_freedom == 1.0


def test_a_zero_that_shifted_at_the_shot_is_not_excused_as_noise():
    shaped = with_step(noisy(2))
    assert shaped.shifts is not None
    shifted = replace(shaped, acceleration_m_s2=shaped.acceleration_m_s2 + 50.0 * shaped.shifts[:, 0])
    assert found(shifted).size == pytest.approx(found(shaped).size, rel=1e-3)


def test_a_baseline_without_any_noise_tells_as_little_as_none():
    silent = row_noise(noisy(4), MASS_KG, BaselineNoise())
    alone = row_noise(noisy(4), MASS_KG)
    np.testing.assert_array_equal(silent.sigma_m_s2, alone.sigma_m_s2)
    assert (silent.size, silent.sensors_m_s2, silent.density) == (1.0, 0.0, 0.0)


def test_a_sample_is_never_taken_to_be_better_than_a_thousandth_of_the_acceleration():
    regression = noisy(1, 0.01)
    one = found(regression, 0.01)
    peak = np.argmax(np.abs(regression.acceleration_m_s2))
    assert one.sigma_m_s2[peak] == pytest.approx(1e-3 * abs(regression.acceleration_m_s2[peak]), rel=0.01)


# ------------------------------------------------------------------------------------------ what the motion adds


def test_what_the_motion_adds_is_in_the_rows_and_in_no_frame_nor_in_what_both_share():
    """The whole covariance is written down again from the shapes, part by part."""
    regression, camera = noisy(0), replace(tracked(), onset_s=noisy(0).interval_s[0])
    rows = spaced_rows(regression)
    rest = found(regression)
    parts = MotionParts.of(regression, rows, MASS_KG, float(np.median(rest.rest_m_s2[rows])))
    sizes = np.array([3.0, 5.0, 7.0, 11.0, 13.0])
    noise = replace(rest, parts=parts, sizes_m_s2=sizes)
    n, at_rest = rows.size, rest_covariance(regression, rows, rest, camera)
    times_s = regression.times_s[rows]
    apart_s = np.abs(np.subtract.outer(times_s, times_s))
    behind = by_filter(regression, times_s)
    travel_s = regression.interval_s[1] - regression.interval_s[0]
    correlations = [behind, behind, behind, np.exp(-apart_s / (0.03 * travel_s)), np.exp(-apart_s / (0.1 * travel_s))]
    expected = at_rest.copy()
    for size, shape, near in zip(sizes, parts.shapes[rows].T, correlations, strict=True):
        expected[:n, :n] += size**2 * shape[:, np.newaxis] * near * shape
    found_correlation = correlation_of(regression, rows, noise, camera)
    assert found_correlation is not None
    sigma = np.concatenate([noise.sigma_m_s2[rows], np.ones(camera.times_s.size)])
    factor = lower_factor(found_correlation) * sigma[:, np.newaxis]
    np.testing.assert_allclose(factor @ factor.T, expected, rtol=1e-6, atol=1e-6)
    # the standard deviation of a sample is the root of what stands on the diagonal
    np.testing.assert_allclose(noise.sigma_m_s2[rows] ** 2, np.diag(expected)[:n], rtol=1e-9)
    np.testing.assert_allclose(expected[n:], at_rest[n:], rtol=1e-12)


def test_parts_without_any_size_leave_the_noise_at_rest():
    regression = noisy(0)
    rows, rest = spaced_rows(regression), found(regression)
    added = replace(rest, parts=MotionParts.of(regression, rows, MASS_KG, 1.0), sizes_m_s2=np.zeros(5))
    np.testing.assert_array_equal(added.sigma_m_s2, rest.rest_m_s2)
    one, other = (correlation_of(regression, rows, noise, None) for noise in (rest, added))
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.factor, other.factor)
