"""The compiled engine beside the plain arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import RecoilDaqError
from recoil_identification.memory import gram_kernel, limited_memory
from recoil_identification.memory.limited_memory import limited_memory_least_squares

FIELDS = (
    "parameters",
    "standard_errors",
    "residual_sum_of_squares",
    "degrees_of_freedom",
    "count",
    "smallest_pivot",
    "operator",
    "status",
)
needs_numba = pytest.mark.skipif(not gram_kernel.kernel_at_hand(), reason="numba, the extra fast, is not installed")


def assert_identical(left, right):
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name), err_msg=name)


def both(regressors, response, window, **options):
    compiled = limited_memory_least_squares(regressors, response, window, engine="numba", **options)
    plain = limited_memory_least_squares(regressors, response, window, engine="numpy", **options)
    return compiled, plain


def record(rng, n_samples, n_parameters, n_outputs):
    regressors = rng.standard_normal((n_samples, n_parameters)) * 10.0 ** rng.uniform(-6, 6, n_parameters)
    regressors *= np.where(rng.random(n_samples) < 0.3, 1.0, 10.0 ** rng.integers(-6, 1))[:, np.newaxis]
    response = regressors @ rng.standard_normal((n_parameters, n_outputs or 1))
    response += 0.01 * np.abs(response).mean() * rng.standard_normal(response.shape)
    return regressors, response if n_outputs else response[:, 0]


@needs_numba
@settings(max_examples=50, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([(1, 0), (2, 2)]),
    st.one_of(st.integers(4, 60), st.integers(250, 700)),
    st.integers(1, 1500),
    st.booleans(),
    st.booleans(),
    st.booleans(),
    st.sampled_from(["auto", "gram"]),
)
def test_compiled_sums_are_those_of_plain_arrays_to_the_last_bit(
    seed, shape, window, n_samples, weighted, lossy, partial, operator
):
    rng = np.random.default_rng(seed)
    regressors, response = record(rng, n_samples, *shape)
    if lossy:
        regressors[rng.random(n_samples) < 0.05] = np.nan
        regressors[n_samples // 3 : n_samples // 2] = 0.0
    weights = rng.uniform(0.0, 9.0, n_samples) * (rng.random(n_samples) > 0.1) if weighted else None
    limits = {"max_relative_error": 0.02} if partial else {"min_excitation": 1e-3}
    compiled, plain = both(regressors, response, window, weights=weights, partial=partial, operator=operator, **limits)
    assert_identical(compiled, plain)


@needs_numba
def test_collinear_regressors_agree_through_a_shot_and_the_silence_after_it():
    rng = np.random.default_rng(1)
    amplitude = np.where(np.arange(6_000) // 500 % 4 == 1, 2500.0, 0.05)[:, np.newaxis]
    shared = np.sqrt(0.9995) * rng.standard_normal((6_000, 1))
    regressors = (shared + np.sqrt(0.0005) * rng.standard_normal((6_000, 2))) * amplitude
    response = regressors @ [1.0, -2.0] + 0.01 * amplitude[:, 0] * rng.standard_normal(6_000)
    compiled, plain = both(regressors, response, 300)
    assert_identical(compiled, plain)
    assert 0 < plain.operator.sum() < 3_000


@needs_numba
@pytest.mark.parametrize("layout", ["F", "reversed", "read-only"])
def test_the_compiled_engine_takes_every_layout_of_the_callers_arrays(layout):
    regressors, response = record(np.random.default_rng(2), 1_000, 2, 0)
    plain = limited_memory_least_squares(regressors, response, 100, engine="numpy")
    if layout == "F":
        regressors = np.asfortranarray(regressors)
    elif layout == "reversed":
        regressors, response = regressors[::-1].copy()[::-1], response[::-1].copy()[::-1]
    else:
        regressors.flags.writeable, response.flags.writeable = False, False
    assert_identical(limited_memory_least_squares(regressors, response, 100, engine="numba"), plain)


@needs_numba
def test_long_records_are_compiled_unasked_and_short_ones_are_not(monkeypatch):
    asked = []
    load = gram_kernel.load_kernel
    monkeypatch.setattr(
        "recoil_identification.memory.limited_memory_batch.load_kernel", lambda *a: asked.append(a) or load(*a)
    )
    monkeypatch.setattr(limited_memory, "COMPILED_SAMPLES", 2_000)
    regressors, response = record(np.random.default_rng(3), 1_000, 1, 0)
    limited_memory_least_squares(regressors[1:], response[1:], 100)
    assert not asked
    limited_memory_least_squares(regressors, response, 100)
    assert asked == [(1, 1)]


def test_without_numba_the_plain_arrays_are_taken_and_the_compiled_engine_says_what_to_do(monkeypatch):
    monkeypatch.setattr(limited_memory, "COMPILED_SAMPLES", 2_000)
    regressors, response = record(np.random.default_rng(4), 1_000, 1, 0)
    monkeypatch.setattr(limited_memory, "kernel_at_hand", lambda: False)
    monkeypatch.setitem(__import__("sys").modules, "numba", None)
    gram_kernel.load_kernel.cache_clear()
    assert limited_memory_least_squares(regressors, response, 100).identified[99:].all()
    with pytest.raises(RecoilDaqError, match=r"needs numba; install it by .*recoil-daq\[fast\].*engine 'numpy'"):
        limited_memory_least_squares(regressors, response, 100, engine="numba")
    gram_kernel.load_kernel.cache_clear()
