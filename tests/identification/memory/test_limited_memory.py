from __future__ import annotations

import math
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.memory import limited_memory
from recoil_identification.memory.limited_memory import (
    WindowedEstimates,
    WindowStatus,
    least_squares,
    limited_memory_least_squares,
    window_sums,
)
from tests.builders.window_oracles import direct_qr, exact, relative_error

FIELDS = (
    "parameters",
    "standard_errors",
    "residual_sum_of_squares",
    "degrees_of_freedom",
    "count",
    "smallest_pivot",
    "factorised",
    "status",
)


@pytest.fixture(params=["as it is", "products", "rows"])
def way(request, monkeypatch) -> None:
    """Whether windows are solved as the guards say, all from sums of products, or all from their own rows."""
    if request.param != "as it is":
        least = -1.0 if request.param == "products" else np.inf
        monkeypatch.setattr(limited_memory, "GUARDED_PIVOT", least)
        monkeypatch.setattr(limited_memory, "GUARDED_RESIDUAL", least)


def shot_then_silence(n_samples: int, n_parameters: int = 5, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Regressors correlated by 0.9995, of amplitude 2500 in three bursts and 0.05 between them, and a response."""
    rng = np.random.default_rng(seed)
    amplitude = np.full(n_samples, 0.05)
    for start in range(n_samples // 10, n_samples, n_samples // 3):
        amplitude[start : start + n_samples // 50] = 2500.0
    shared = rng.standard_normal((n_samples, 1))
    own = rng.standard_normal((n_samples, n_parameters))
    regressors = (np.sqrt(0.9995) * shared + np.sqrt(0.0005) * own) * amplitude[:, np.newaxis]
    parameters = np.array([1.0, -2.0, 3.0, 0.5, -1.0])[:n_parameters]
    return regressors, regressors @ parameters + 0.01 * amplitude * rng.standard_normal(n_samples)


def white_record(seed: int, n_samples: int, n_parameters: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    regressors = rng.standard_normal((n_samples, n_parameters))
    return regressors, regressors @ rng.standard_normal(n_parameters) + 0.1 * rng.standard_normal(n_samples)


def assert_same(
    left: WindowedEstimates | SimpleNamespace, right: WindowedEstimates | SimpleNamespace, rtol: float = 0.0
) -> None:
    for name in FIELDS:
        np.testing.assert_allclose(
            getattr(left, name), getattr(right, name), rtol=rtol, atol=0, equal_nan=True, err_msg=name
        )


def rows_of(estimates: WindowedEstimates, rows: slice) -> SimpleNamespace:
    return SimpleNamespace(**{name: getattr(estimates, name)[rows] for name in FIELDS})


@pytest.fixture(scope="module")
def shot() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    regressors, response = shot_then_silence(30_000)
    return regressors, response, direct_qr(regressors, response, 200)


def test_every_window_of_a_shot_followed_by_silence_equals_its_own_factorisation(shot):
    regressors, response, truth = shot
    estimates = limited_memory_least_squares(regressors, response, 200)
    assert estimates.identified[199:].all()
    assert relative_error(estimates.parameters[199:], truth[199:]).max() < 1e-10
    assert 0.0 < estimates.factorised.mean() < 0.1


@pytest.mark.exhaustive
def test_reflections_are_exact_to_thirteen_digits_where_a_shot_enters_and_leaves_the_window(shot):
    regressors, response, _ = shot
    last = [1_000, 3_001, 3_003, 3_150, 3_500, 3_796, 3_797, 3_798, 3_799, 3_900, 23_001, 29_999]
    truth = np.array([exact(regressors[k - 199 : k + 1], response[k - 199 : k + 1]) for k in last])
    reflected = [least_squares(regressors[k - 199 : k + 1], response[k - 199 : k + 1]).parameters for k in last]
    assert relative_error(np.array(reflected), truth).max() < 1e-13


@pytest.mark.parametrize("tiny", [1e-6, 1e-12, 1e-30])
def test_a_block_may_begin_with_next_to_nothing_of_one_regressor(tiny):
    regressors, response = white_record(23, 60, 3)
    regressors[::10, 0] *= tiny
    estimates = limited_memory_least_squares(regressors, response, 10)
    truth = np.array([exact(regressors[k - 9 : k + 1], response[k - 9 : k + 1]) for k in range(9, 60)])
    assert relative_error(estimates.parameters[9:], truth).max() < 1e-10


@pytest.mark.parametrize("seed", [3207, 4430, 4704, 7915])  # products of these leave float64
@pytest.mark.usefixtures("way")
def test_magnitudes_over_three_hundred_decades_give_numbers_or_reasons_but_no_warning(seed):
    rng = np.random.default_rng(seed)
    regressors = rng.choice([-1.0, 1.0], (40, 4)) * 10.0 ** rng.uniform(-300, 0, (40, 4))
    response = rng.choice([-1.0, 1.0], 40) * 10.0 ** rng.uniform(-300, 0, 40)
    with np.errstate(all="raise"):
        estimates = limited_memory_least_squares(regressors, response, 8, partial=True)
    assert np.isfinite(estimates.parameters[estimates.identified]).all()
    assert np.isfinite(estimates.standard_errors[estimates.identified]).all()


def test_products_alone_fail_where_a_shot_leaves_the_window_and_say_so_by_the_pivot(shot, monkeypatch):
    regressors, response, truth = shot
    for guard in ("GUARDED_PIVOT", "GUARDED_RESIDUAL"):
        monkeypatch.setattr(limited_memory, guard, -1.0)
    alone = limited_memory_least_squares(regressors, response, 200)
    error = relative_error(alone.parameters[199:], truth[199:])
    assert not alone.factorised.any()
    assert error.max() > 1e-8
    assert (error < 1e-13 / alone.smallest_pivot[199:]).all()


@pytest.mark.exhaustive
def test_a_shot_followed_by_silence_agrees_with_statsmodels_where_that_has_nothing_large_to_subtract(shot):
    from statsmodels.regression.rolling import RollingOLS

    regressors, response, _ = shot
    ours = limited_memory_least_squares(regressors, response, 200)
    theirs = RollingOLS(response, regressors, window=200).fit(params_only=True, reset=200)
    # statsmodels subtracts until its next restart: it has lost what leaves the window within one window's length
    loud = np.abs(regressors[:, 0]) > 10.0
    recent = np.lib.stride_tricks.sliding_window_view(loud, 400).mean(axis=1)
    sound = np.concatenate([np.zeros(399, dtype=bool), (recent == 0.0) | (recent > 0.9)])
    assert sound.sum() > 27_000
    assert relative_error(ours.parameters[sound], theirs.params[sound]).max() < 1e-9


@pytest.mark.exhaustive
def test_standard_errors_agree_with_statsmodels():
    from statsmodels.regression.rolling import RollingOLS

    regressors, response = white_record(3, 2_000, 3)
    ours = limited_memory_least_squares(regressors, response, 50)
    theirs = RollingOLS(response, regressors, window=50).fit(reset=50)
    np.testing.assert_allclose(ours.standard_errors[49:], theirs.bse[49:], rtol=1e-10)
    np.testing.assert_allclose(ours.residual_sum_of_squares[49:], theirs.ssr[49:], rtol=1e-9)


@pytest.mark.usefixtures("way")
def test_weighted_windows_with_missing_samples_equal_lstsq_of_the_samples_present():
    rng = np.random.default_rng(11)
    regressors, response = white_record(11, 400, 3)
    weights = rng.uniform(0.1, 9.0, 400)
    regressors[rng.integers(0, 400, 15), rng.integers(0, 3, 15)] = np.nan
    response[rng.integers(0, 400, 15)] = np.nan
    weights[rng.integers(0, 400, 15)] = 0.0
    present = ~np.isnan(regressors).any(axis=1) & ~np.isnan(response) & (weights > 0)
    estimates = limited_memory_least_squares(regressors, response, 20, weights=weights)
    assert estimates.identified[19:].all()
    for k in range(19, 400):
        used = np.arange(k - 19, k + 1)[present[k - 19 : k + 1]]
        root = np.sqrt(weights[used])
        scaled = regressors[used] * root[:, np.newaxis]
        parameters, residual, _, _ = np.linalg.lstsq(scaled, response[used] * root, rcond=None)
        covariance = np.linalg.inv(scaled.T @ scaled) * residual[0] / (used.size - 3)
        assert estimates.count[k] == used.size
        assert estimates.degrees_of_freedom[k] == used.size - 3
        np.testing.assert_allclose(estimates.parameters[k], parameters, rtol=1e-10)
        np.testing.assert_allclose(estimates.residual_sum_of_squares[k], residual[0], rtol=1e-10)
        np.testing.assert_allclose(estimates.standard_errors[k], np.sqrt(np.diag(covariance)), rtol=1e-10)


def test_a_missing_sample_leaves_no_trace_once_its_window_has_passed():
    regressors, response = white_record(5, 400, 2)
    whole = limited_memory_least_squares(regressors, response, 20)
    response = response.copy()
    response[100] = np.nan
    gapped = limited_memory_least_squares(regressors, response, 20)
    covered = slice(100, 120)
    assert (gapped.count[covered] == 19).all()
    assert not np.isclose(gapped.parameters[covered], whole.parameters[covered], rtol=1e-6).all(axis=1).any()
    assert_same(rows_of(gapped, slice(100)), rows_of(whole, slice(100)), rtol=1e-11)
    assert_same(rows_of(gapped, slice(120, None)), rows_of(whole, slice(120, None)), rtol=1e-11)


def test_weight_zero_is_the_same_as_a_missing_sample_whatever_the_sample_says():
    regressors, response = white_record(6, 300, 2)
    lost = np.random.default_rng(6).random(300) < 0.1
    as_nan = limited_memory_least_squares(regressors, np.where(lost, np.nan, response), 30)
    sentinel = np.where(lost[:, np.newaxis], -1e300, regressors)
    assert_same(limited_memory_least_squares(sentinel, response, 30, weights=np.where(lost, 0.0, 1.0)), as_nan)


def test_windows_with_too_few_samples_present_say_so_and_count_what_there_is():
    regressors, response = white_record(7, 100, 2)
    response[40:52] = np.nan
    estimates = limited_memory_least_squares(regressors, response, 10)
    few = estimates.count < 3
    np.testing.assert_array_equal(np.flatnonzero(few), [0, 1, *range(47, 54)])
    assert (estimates.status[9:][few[9:]] == WindowStatus.TOO_FEW_SAMPLES).all()
    assert estimates.identified[9:][~few[9:]].all()
    assert np.isnan(estimates.parameters[few]).all()
    strict = limited_memory_least_squares(regressors, response, 10, minimum_count=10)
    np.testing.assert_array_equal(strict.identified[9:], strict.count[9:] == 10)


def test_the_first_windows_give_no_number_unless_partial_ones_are_asked_for():
    regressors, response = white_record(8, 60, 2)
    full = limited_memory_least_squares(regressors, response, 20)
    assert (full.status[:19] == WindowStatus.WINDOW_NOT_FULL).all()
    assert full.identified[19:].all()
    partial = limited_memory_least_squares(regressors, response, 20, partial=True)
    assert (partial.status[:2] == WindowStatus.TOO_FEW_SAMPLES).all()
    assert partial.identified[2:].all()
    for k in range(2, 19):
        truth = np.linalg.lstsq(regressors[: k + 1], response[: k + 1], rcond=None)[0]
        np.testing.assert_allclose(partial.parameters[k], truth, rtol=1e-9)
    assert_same(rows_of(partial, slice(19, None)), rows_of(full, slice(19, None)))


def test_a_window_longer_than_the_record_is_never_full():
    regressors, response = white_record(9, 30, 2)
    assert (limited_memory_least_squares(regressors, response, 1000).status == WindowStatus.WINDOW_NOT_FULL).all()
    partial = limited_memory_least_squares(regressors, response, 1000, partial=True)
    np.testing.assert_allclose(partial.parameters[-1], least_squares(regressors, response).parameters, rtol=1e-12)


@pytest.mark.parametrize("n_samples", [0, 1, 2])
@pytest.mark.usefixtures("way")
def test_a_record_of_next_to_nothing_gives_no_number_and_no_fault(n_samples):
    estimates = limited_memory_least_squares(np.ones((n_samples, 2)), np.ones(n_samples), 5, partial=True)
    assert estimates.parameters.shape == (n_samples, 2)
    assert not estimates.identified.any()


@pytest.mark.usefixtures("way")
def test_silence_gives_no_excitation_and_neither_infinity_nor_warning():
    regressors, response = white_record(10, 300, 2)
    regressors[100:200, 1] = 0.0
    with np.errstate(all="raise"):
        estimates = limited_memory_least_squares(regressors, response, 30)
    silent = np.zeros(300, dtype=bool)
    silent[129:200] = True
    assert (estimates.status[silent] == WindowStatus.NO_EXCITATION).all()
    assert estimates.identified[29:][~silent[29:]].all()
    for name in ("parameters", "standard_errors", "residual_sum_of_squares"):
        assert np.isnan(getattr(estimates, name)[silent]).all()
        assert np.isfinite(getattr(estimates, name)[estimates.identified]).all()
    assert (estimates.smallest_pivot[silent] == 0.0).all()


@pytest.mark.usefixtures("way")
def test_a_record_of_zeros_gives_no_excitation():
    estimates = limited_memory_least_squares(np.zeros((50, 2)), np.zeros(50), 10)
    assert (estimates.status[9:] == WindowStatus.NO_EXCITATION).all()


def test_regressors_that_are_the_same_are_collinear():
    regressors, response = white_record(14, 200, 3)
    regressors[80:160, 2] = 2.0 * regressors[80:160, 0] - regressors[80:160, 1]
    estimates = limited_memory_least_squares(regressors, response, 20)
    same = np.zeros(200, dtype=bool)
    same[99:160] = True
    assert (estimates.status[same] == WindowStatus.COLLINEAR).all()
    assert estimates.identified[19:][~same[19:]].all()
    assert np.isnan(estimates.parameters[same]).all()
    assert (estimates.smallest_pivot[same] < 1e-12).all()


def test_regressors_that_differ_by_a_hundred_thousandth_are_told_apart(monkeypatch):
    regressors, response = white_record(15, 2_000, 2)
    regressors[:, 1] = regressors[:, 0] + 1e-5 * regressors[:, 1]
    estimates = limited_memory_least_squares(regressors, response, 100)
    assert estimates.factorised[99:].all()
    assert relative_error(estimates.parameters[99:], direct_qr(regressors, response, 100)[99:]).max() < 1e-9
    monkeypatch.setattr(limited_memory, "GUARDED_PIVOT", -1.0)
    alone = limited_memory_least_squares(regressors, response, 100)
    assert relative_error(alone.parameters[99:], estimates.parameters[99:]).max() > 1e-7


def test_the_residual_sum_of_a_next_to_perfect_fit_is_not_lost_in_cancellation(monkeypatch):
    rng = np.random.default_rng(16)
    regressors = rng.standard_normal((300, 2)) + 5.0
    response = regressors @ [782.0, 3.0] + 1e-6 * rng.standard_normal(300)
    estimates = limited_memory_least_squares(regressors, response, 40)
    monkeypatch.setattr(limited_memory, "GUARDED_RESIDUAL", -1.0)
    alone = limited_memory_least_squares(regressors, response, 40)
    truth = np.empty(261)
    for k in range(39, 300):
        wide = regressors[k - 39 : k + 1].astype(np.longdouble)
        target = response[k - 39 : k + 1].astype(np.longdouble)
        (a, b), (_, d) = wide.T @ wide
        right = wide.T @ target
        solution = np.array([d * right[0] - b * right[1], a * right[1] - b * right[0]]) / (a * d - b * b)
        truth[k - 39] = ((target - wide @ solution) ** 2).sum()
    np.testing.assert_allclose(estimates.residual_sum_of_squares[39:], truth, rtol=1e-5)
    assert np.abs(alone.residual_sum_of_squares[39:] / truth - 1.0).max() > 0.1


def test_windows_without_a_response_are_zeros_from_sums_of_products():
    regressors, response = white_record(24, 300, 2)
    response[100:200] = 0.0
    estimates = limited_memory_least_squares(regressors, response, 30)
    silent = slice(129, 200)
    assert not estimates.factorised.any()
    for name in ("parameters", "standard_errors", "residual_sum_of_squares"):
        assert (getattr(estimates, name)[silent] == 0.0).all()


@pytest.mark.parametrize(("of_regressors", "of_response"), [(1e-200, 1e-180), (1e200, 1e-50), (1e-140, 1e140)])
@pytest.mark.usefixtures("way")
def test_units_far_from_one_change_nothing(of_regressors, of_response):
    regressors, response = white_record(17, 200, 2)
    plain = limited_memory_least_squares(regressors, response, 20)
    far = limited_memory_least_squares(regressors * of_regressors, response * of_response, 20)
    assert far.identified[19:].all()
    factor = of_response / of_regressors
    np.testing.assert_allclose(far.parameters, plain.parameters * factor, rtol=1e-11)
    np.testing.assert_allclose(far.standard_errors, plain.standard_errors * factor, rtol=1e-11)


def test_a_decay_down_to_the_end_of_float64_ends_without_excitation_and_without_warning():
    time = np.arange(3_000.0)
    regressors = np.column_stack([np.exp(-time / 4.0), np.sin(time) * np.exp(-time / 3.0)])
    with np.errstate(all="raise", under="ignore"):
        estimates = limited_memory_least_squares(regressors, regressors @ [2.0, 3.0], 10)
    assert estimates.identified[9:60].all()
    np.testing.assert_allclose(estimates.parameters[9:60], np.tile([2.0, 3.0], (51, 1)), rtol=1e-6)
    assert (estimates.status[-100:] == WindowStatus.NO_EXCITATION).all()
    assert np.isfinite(estimates.parameters[estimates.identified]).all()


def test_intervals_of_two_standard_errors_cover_as_student_says_where_errors_are_independent():
    from scipy import stats

    rng = np.random.default_rng(18)
    regressors = rng.standard_normal((200_000, 2))
    response = regressors @ [1.5, -0.5] + rng.standard_normal(200_000)
    estimates = limited_memory_least_squares(regressors, response, 20)
    apart = slice(19, None, 20)
    pull = (estimates.parameters[apart] - [1.5, -0.5]) / estimates.standard_errors[apart]
    assert estimates.degrees_of_freedom[19] == 18
    assert np.abs(pull).shape == (10_000, 2)
    assert np.mean(np.abs(pull) < stats.t.ppf(0.975, 18)) == pytest.approx(0.95, abs=0.006)


# ---------------------------------------------------------------------------------------------- laws

seeds = st.integers(0, 2**32 - 1)
shapes = st.tuples(st.integers(1, 4), st.integers(0, 40), st.integers(0, 150))  # parameters, window and record beyond


@settings(max_examples=40, deadline=None)
@given(seeds, shapes, st.floats(-1e6, 1e6).filter(lambda c: abs(c) > 1e-6))
def test_scaling_the_response_scales_the_parameters(seed, shape, factor):
    n_parameters, window = shape[0], shape[0] + 3 + shape[1]
    regressors, response = white_record(seed, window + shape[2], n_parameters)
    plain = limited_memory_least_squares(regressors, response, window)
    scaled = limited_memory_least_squares(regressors, factor * response, window)
    tolerance = 1e-9 * np.abs(plain.parameters[window - 1 :]).max() * abs(factor)
    np.testing.assert_allclose(scaled.parameters, factor * plain.parameters, rtol=1e-9, atol=tolerance)
    np.testing.assert_allclose(
        scaled.residual_sum_of_squares, factor**2 * plain.residual_sum_of_squares, rtol=1e-5, atol=0
    )


@settings(max_examples=40, deadline=None)
@given(seeds, shapes, st.randoms(use_true_random=False))
def test_permuting_the_regressors_permutes_the_parameters(seed, shape, random):
    n_parameters, window = shape[0], shape[0] + 3 + shape[1]
    regressors, response = white_record(seed, window + shape[2], n_parameters)
    order = random.sample(range(n_parameters), n_parameters)
    plain = limited_memory_least_squares(regressors, response, window)
    permuted = limited_memory_least_squares(regressors[:, order], response, window)
    tolerance = 1e-9 * np.abs(plain.parameters[window - 1 :]).max()
    np.testing.assert_allclose(permuted.parameters, plain.parameters[:, order], rtol=1e-9, atol=tolerance)
    np.testing.assert_allclose(permuted.standard_errors, plain.standard_errors[:, order], rtol=1e-5)


@settings(max_examples=40, deadline=None)
@given(seeds, shapes, st.integers(1, 100))
def test_what_came_before_a_window_does_not_change_it(seed, shape, lead):
    n_parameters, window = shape[0], shape[0] + 3 + shape[1]
    regressors, response = white_record(seed, lead + window + shape[2], n_parameters)
    response[:lead] *= 1e6
    whole = limited_memory_least_squares(regressors, response, window)
    later = limited_memory_least_squares(regressors[lead:], response[lead:], window)
    tolerance = 1e-9 * np.abs(later.parameters[window - 1 :]).max()
    np.testing.assert_allclose(
        whole.parameters[lead + window - 1 :], later.parameters[window - 1 :], rtol=1e-9, atol=tolerance
    )


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(6, 40), st.integers(1, 6))
def test_splitting_a_record_between_blocks_changes_nothing(seed, window, blocks):
    regressors, response = white_record(seed, window * (blocks + 3) + 5, 3)
    regressors[0], response[0] = 4.0, 8.0  # the largest of all: both parts are scaled alike
    regressors[window * blocks], response[window * blocks] = 4.0, 8.0
    whole = limited_memory_least_squares(regressors, response, window)
    cut = window * blocks
    later = limited_memory_least_squares(regressors[cut - window :], response[cut - window :], window)
    assert_same(rows_of(later, slice(window, None)), rows_of(whole, slice(cut, None)), rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 60), st.integers(0, 200))
def test_sums_of_windows_are_those_of_their_own_samples(seed, window, n_samples):
    values = np.random.default_rng(seed).standard_normal((2, n_samples))
    truth = [[math.fsum(row[max(k - window + 1, 0) : k + 1]) for k in range(n_samples)] for row in values]
    np.testing.assert_allclose(window_sums(values, window), np.reshape(truth, values.shape), rtol=0, atol=1e-13)


def test_a_record_is_worked_through_in_parts_that_leave_no_seam(monkeypatch):
    regressors, response = shot_then_silence(3_000, n_parameters=3)
    whole = limited_memory_least_squares(regressors, response, 70)
    monkeypatch.setattr(limited_memory, "NUMBERS_AT_ONCE", 1)
    assert_same(limited_memory_least_squares(regressors, response, 70), whole, rtol=1e-12)


# ------------------------------------------------------------------------------ contract with callers


def test_the_callers_arrays_are_never_modified():
    regressors, response = white_record(19, 200, 2)
    weights = np.ones(200)
    regressors[50, 0] = np.nan
    kept = regressors.copy(), response.copy(), weights.copy()
    for values in (regressors, response, weights):
        values.flags.writeable = False
    limited_memory_least_squares(regressors, response, 20, weights=weights)
    least_squares(regressors, response, weights)
    for values, copy in zip((regressors, response, weights), kept, strict=True):
        np.testing.assert_array_equal(values, copy)


@pytest.mark.exhaustive
def test_scratch_memory_beside_the_record_and_its_results_is_some_tens_of_megabytes():
    regressors, response = white_record(20, 400_000, 5)
    tracemalloc.start()
    limited_memory_least_squares(regressors, response, 200)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # rows, parameters, errors and what is found of each window, each twice at most
    assert peak < 2 * 400_000 * (6 + 5 * 5) * 8 + 64 * 2**20


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"regressors": np.ones(10)}, r"regressors must have the shape"),
        ({"regressors": np.ones((10, 0))}, r"regressors must have the shape"),
        ({"response": np.ones(9)}, r"response must have the shape"),
        ({"response": np.ones((10, 1, 1))}, r"response must have the shape"),
        ({"regressors": np.full((10, 2), np.inf)}, r"must be finite; a missing sample is NaN"),
        ({"response": np.full(10, -np.inf)}, r"must be finite; a missing sample is NaN"),
        ({"weights": np.ones(9)}, r"weights must have the shape"),
        ({"weights": np.full(10, np.nan)}, r"weights must be finite and not negative"),
        ({"weights": np.full(10, -1.0)}, r"weights must be finite and not negative"),
        ({"window": 2}, r"at least 3, found 2"),
        ({"minimum_count": 2}, r"minimum_count must lie between 3 and the window 5"),
        ({"minimum_count": 6}, r"minimum_count must lie between 3 and the window 5"),
    ],
)
def test_a_callers_mistake_is_named(changed, message):
    arguments = {"regressors": np.ones((10, 2)), "response": np.ones(10), "window": 5} | changed
    with pytest.raises(ValueError, match=message):
        limited_memory_least_squares(**arguments)


@pytest.mark.parametrize("changed", [{"window": 5.0}, {"window": True}, {"response": np.ones(10, dtype=complex)}])
def test_a_value_of_the_wrong_type_is_a_type_error(changed):
    arguments = {"regressors": np.ones((10, 2)), "response": np.ones(10), "window": 5} | changed
    with pytest.raises(TypeError):
        limited_memory_least_squares(**arguments)


# ------------------------------------------------------------------------------------ one whole record


def test_least_squares_of_a_whole_record_equals_lstsq_and_the_textbook_covariance():
    rng = np.random.default_rng(22)
    regressors, response = white_record(22, 500, 4)
    regressors *= [1e-3, 1.0, 1e4, 1e7]
    weights = rng.uniform(0.1, 10.0, 500)
    weights[3], response[7], regressors[9, 2] = 0.0, np.nan, np.nan
    fit = least_squares(regressors, response, weights)
    used = np.setdiff1d(np.arange(500), [3, 7, 9])
    root = np.sqrt(weights[used])
    scaled = regressors[used] * root[:, np.newaxis]
    expected, residual, _, _ = np.linalg.lstsq(scaled / [1e-3, 1.0, 1e4, 1e7], response[used] * root, rcond=None)
    np.testing.assert_allclose(fit.parameters, expected / [1e-3, 1.0, 1e4, 1e7], rtol=1e-11)
    np.testing.assert_allclose(fit.residual_sum_of_squares, residual[0], rtol=1e-11)
    np.testing.assert_allclose(fit.covariance_factor, np.linalg.inv(scaled.T @ scaled), rtol=1e-8, atol=0)
    assert fit.count == 497
    np.testing.assert_allclose(fit.variance, residual[0] / 493)


def test_least_squares_of_one_window_is_that_windows_estimate():
    regressors, response = shot_then_silence(600, n_parameters=3)
    windows = limited_memory_least_squares(regressors, response, 40)
    for last in (50, 75, 300):
        fit = least_squares(regressors[last - 39 : last + 1], response[last - 39 : last + 1])
        np.testing.assert_allclose(windows.parameters[last], fit.parameters, rtol=1e-9)
        np.testing.assert_allclose(
            windows.standard_errors[last], np.sqrt(fit.variance * np.diag(fit.covariance_factor)), rtol=1e-6
        )
        assert windows.smallest_pivot[last] == pytest.approx(fit.smallest_pivot, rel=1e-6)


@pytest.mark.parametrize(
    ("regressors", "message"),
    [
        (np.ones((2, 2)), r"too few samples .* expected 3 or more present, found 2"),
        (np.column_stack([np.ones(9), np.zeros(9)]), r"carries no signal.*number 1 zero throughout"),
        (np.column_stack([np.arange(9.0), 3.0 * np.arange(9.0)]), r"cannot be told apart"),
    ],
)
def test_a_whole_record_without_a_number_is_an_error_that_says_why(regressors, message):
    with pytest.raises(IdentificationError, match=message):
        least_squares(regressors, np.ones(len(regressors)))
