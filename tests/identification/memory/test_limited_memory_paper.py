from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.errors import RecoilDaqError
from recoil_identification.memory import limited_memory_paper
from recoil_identification.memory.limited_memory import WindowStatus, limited_memory_least_squares
from tests.builders.window_oracles import relative_error


def white(seed, n_samples, n_parameters, n_outputs=None):
    rng = np.random.default_rng(seed)
    regressors = rng.standard_normal((n_samples, n_parameters))
    response = regressors @ rng.standard_normal((n_parameters, n_outputs or 1))
    response += 0.1 * rng.standard_normal(response.shape)
    return regressors, response if n_outputs else response[:, 0]


def bursts(n_samples):
    """Five regressors correlated by 0.9995, of amplitude 2500 in bursts and 0.05 between."""
    rng = np.random.default_rng(2)
    loud = np.arange(n_samples) % 5_000 < 600
    amplitude = np.where(loud, 2500.0, 0.05)[:, np.newaxis]
    shared = np.sqrt(0.9995) * rng.standard_normal((n_samples, 1))
    regressors = (shared + np.sqrt(0.0005) * rng.standard_normal((n_samples, 5))) * amplitude
    response = regressors @ [1.0, -2.0, 3.0, 0.5, -1.0] + 0.01 * amplitude[:, 0] * rng.standard_normal(n_samples)
    quiet = np.concatenate(
        [np.zeros(199, dtype=bool), ~np.lib.stride_tricks.sliding_window_view(loud, 200).any(axis=1)]
    )
    return regressors, response, quiet


@pytest.mark.parametrize("engine", ["numpy", "auto"])
@pytest.mark.parametrize("n_outputs", [None, 2])
@pytest.mark.parametrize("partial", [True, False])
def test_on_a_short_benign_record_the_textbook_gives_what_two_stacks_give(engine, n_outputs, partial):
    regressors, response = white(1, 300, 3, n_outputs)
    response[40:45] = np.nan
    weights = np.random.default_rng(1).uniform(0.5, 2.0, 300)
    options = {"weights": weights, "partial": partial}
    ours = limited_memory_least_squares(regressors, response, 30, **options)
    paper = limited_memory_least_squares(regressors, response, 30, method="paper", engine=engine, **options)
    np.testing.assert_array_equal(paper.status, ours.status)
    np.testing.assert_array_equal(paper.count, ours.count)
    for name in ("parameters", "standard_errors", "residual_sum_of_squares"):
        np.testing.assert_allclose(getattr(paper, name), getattr(ours, name), rtol=1e-9, err_msg=name)


def test_the_textbook_drifts_where_bursts_are_followed_by_silence_and_two_stacks_do_not():
    regressors, response, quiet = bursts(60_000)
    truth = limited_memory_least_squares(regressors, response, 200, operator="qr").parameters[quiet]
    ours = limited_memory_least_squares(regressors, response, 200).parameters[quiet]
    paper = limited_memory_least_squares(regressors, response, 200, method="paper")
    assert relative_error(ours, truth).max() < 1e-10
    there = paper.identified[quiet]
    drift = relative_error(paper.parameters[quiet][there], truth[there])
    assert drift.max() > 0.1
    assert np.mean(drift > 1e-3) > 0.2
    # exact arithmetic knows no such windows: here they restart the recursion, which hides the drift for a while
    assert (paper.status[199:] == WindowStatus.COLLINEAR).any()


def test_it_begins_where_the_regressors_first_carry_signal_and_can_be_told_apart():
    regressors, response = white(3, 200, 2)
    regressors[:60] = 0.0
    regressors[60:70, 1] = regressors[60:70, 0]
    paper = limited_memory_least_squares(regressors, response, 20, method="paper", engine="numpy")
    assert (paper.status[19:70] != WindowStatus.IDENTIFIED).all()
    assert paper.identified[70:].all()
    truth = np.linalg.lstsq(regressors[130:150], response[130:150], rcond=None)[0]
    np.testing.assert_allclose(paper.parameters[149], truth, rtol=1e-6)


def test_a_denominator_that_is_not_positive_is_told_and_the_recursion_begun_anew():
    regressors, response = white(4, 120, 1)
    regressors[50:80] *= 1e-9
    paper = limited_memory_least_squares(regressors, response, 10, method="paper", engine="numpy")
    assert (paper.status[9:] == WindowStatus.COLLINEAR).any()
    assert paper.identified[100:].all()
    # the inverse of the silence is 1e18 times that of the signal that follows, and two digits of it are left
    ours = limited_memory_least_squares(regressors, response, 10)
    np.testing.assert_allclose(paper.parameters[110], ours.parameters[110], rtol=0.2)


def test_a_relative_error_that_is_too_large_is_no_number():
    regressors, response = white(5, 200, 2)
    free = limited_memory_least_squares(regressors, response, 10, method="paper")
    ratio = free.standard_errors[9:, 0] / np.abs(free.parameters[9:, 0])
    limit = float(np.median(ratio)) * (1 + 1e-9)
    limited = limited_memory_least_squares(regressors, response, 10, method="paper", max_relative_error=limit)
    np.testing.assert_array_equal(limited.identified[9:], ratio <= limit)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"operator": "qr"}, "no other operator"),
        ({"min_excitation": 1.0}, "takes no min_excitation"),
        ({"method": "book"}, 'method must be "two-stack" or "paper"'),
    ],
)
def test_what_the_textbook_does_not_have_is_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        limited_memory_least_squares(np.ones((20, 1)), np.ones(20), 5, **({"method": "paper"} | changed))


def test_the_compiled_recursion_without_numba_says_what_to_do(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "numba", None)
    limited_memory_paper._recursion.cache_clear()
    with pytest.raises(RecoilDaqError, match=r"needs numba; install it by .*recoil-daq\[fast\]"):
        limited_memory_least_squares(np.ones((20, 1)), np.ones(20), 5, method="paper", engine="numba")
    limited_memory_paper._recursion.cache_clear()
