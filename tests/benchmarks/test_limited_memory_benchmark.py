"""Limited-memory least squares against a factorisation of every window, exact arithmetic, and statsmodels."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest

from recoil_identification.memory.limited_memory import limited_memory_least_squares
from tests.builders.beside import Beside, fastest_s
from tests.builders.window_oracles import direct_qr, exact, relative_error

WINDOW = 200

# processor time: what else the machine does is no part of the ratio
pytestmark = pytest.mark.benchmark(timer=process_time)


def shots_then_silence(n_samples: int, n_parameters: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Regressors correlated by 0.9995, of amplitude 2500 in bursts and 0.05 between; a response; where loud."""
    rng = np.random.default_rng(2)
    loud = np.arange(n_samples) % 99_991 < 3_001
    amplitude = np.where(loud, 2500.0, 0.05)
    shared = rng.standard_normal((n_samples, 1))
    own = rng.standard_normal((n_samples, n_parameters))
    regressors = (np.sqrt(0.9995) * shared + np.sqrt(0.0005) * own) * amplitude[:, np.newaxis]
    parameters = np.array([1.0, -2.0, 3.0, 0.5, -1.0])[:n_parameters]
    return regressors, regressors @ parameters + 0.01 * amplitude * rng.standard_normal(n_samples), loud


def nothing_large_to_subtract(loud: np.ndarray) -> np.ndarray:
    """Where the last two windows are alike, so that a scheme restarted once per window has lost nothing."""
    recent = np.lib.stride_tricks.sliding_window_view(loud, 2 * WINDOW)
    return np.concatenate([np.zeros(2 * WINDOW - 1, dtype=bool), recent.all(axis=1) | ~recent.any(axis=1)])


def test_a_million_windows_equal_their_own_factorisation_and_statsmodels(benchmark, capsys):
    from statsmodels.regression.rolling import RollingOLS

    regressors, response, loud = shots_then_silence(1_000_000)
    estimates = benchmark.pedantic(limited_memory_least_squares, (regressors, response, WINDOW), rounds=3)
    full = slice(WINDOW - 1, None)
    start = process_time()
    truth = direct_qr(regressors, response, WINDOW)
    direct_s = process_time() - start
    error = relative_error(estimates.parameters[full], truth[full])
    start = process_time()
    rolling = RollingOLS(response, regressors, window=WINDOW).fit(params_only=True, reset=WINDOW).params
    rolling_s = process_time() - start
    like = nothing_large_to_subtract(loud)
    difference = relative_error(estimates.parameters[like], rolling[like])
    ours_s = benchmark.stats.stats.min
    with capsys.disabled():
        print(
            f"\n1e6 samples, 5 parameters, window {WINDOW}:"
            f" {1.0 / ours_s:.2f} Msamples/s with standard errors"
            f"\n  against a QR of every window: largest relative difference {error.max():.1e}"
            f" ({direct_s / ours_s:.0f} times slower)"
            f"\n  against statsmodels, parameters only, restarted every window: {difference.max():.1e} in {like.sum()}"
            f" windows, {relative_error(rolling[full], truth[full]).max():.1e} from the QR where a shot has just left"
            f" ({rolling_s / ours_s:.0f} times slower)"
        )
    assert estimates.identified[full].all()
    assert error.max() < 1e-10
    assert like.mean() > 0.9
    assert difference.max() < 1e-9


def test_ten_million_samples_later_the_estimates_are_those_of_exact_arithmetic(benchmark, capsys):
    regressors, response, _ = shots_then_silence(10_000_000)
    last_shot = 99 * 99_991
    windows = [last_shot + k for k in (1, 3, 150, 2_000, 3_001, 3_100, 3_196, 3_198, 3_199, 3_201, 3_300)]
    windows += list(np.random.default_rng(3).integers(WINDOW, 10_000_000, 40))
    truth = np.array([exact(regressors[k - 199 : k + 1], response[k - 199 : k + 1]) for k in windows])
    found = benchmark.pedantic(limited_memory_least_squares, (regressors, response, WINDOW), rounds=1)
    error = relative_error(found.parameters[windows], truth)
    with capsys.disabled():
        print(
            f"\n1e7 samples, 5 parameters: largest relative error against rational arithmetic"
            f" {error.max():.1e} ({len(windows)} windows)"
        )
    assert error.max() < 1e-10


def beside_statsmodels(n_samples: int, n_parameters: int, window: int, *, rounds: int = 5) -> Beside:
    """Time estimates with standard errors, after checking that both give the same; statsmodels takes a fiftieth."""
    from statsmodels.regression.rolling import RollingOLS

    rng = np.random.default_rng(4)
    regressors = rng.standard_normal((n_samples, n_parameters))
    response = regressors.sum(axis=1) + 0.1 * rng.standard_normal(n_samples)
    some = max(n_samples // 50, 2 * window)
    start = process_time()
    theirs = RollingOLS(response[:some], regressors[:some], window=window).fit(reset=window)
    rolling_s = (process_time() - start) * n_samples / some
    ours = limited_memory_least_squares(regressors, response, window)
    full = slice(window - 1, some)
    np.testing.assert_allclose(ours.parameters[full], theirs.params[full], rtol=1e-9)
    np.testing.assert_allclose(ours.standard_errors[full], theirs.bse[full], rtol=1e-8)
    return Beside(fastest_s(lambda: limited_memory_least_squares(regressors, response, window), rounds), rolling_s)


def errors_after_bursts(n_samples: int) -> dict[str, np.ndarray]:
    """Return the relative error of each full window, by program, against a QR of that window."""
    from statsmodels.regression.rolling import RollingOLS

    regressors, response, _ = shots_then_silence(n_samples)
    truth = direct_qr(regressors, response, WINDOW)[WINDOW - 1 :]
    found = {"ours": limited_memory_least_squares(regressors, response, WINDOW).parameters}
    rolling = RollingOLS(response, regressors, window=WINDOW)
    found["statsmodels"] = rolling.fit(params_only=True).params
    found["statsmodels, reset"] = rolling.fit(params_only=True, reset=WINDOW).params
    return {name: relative_error(values[WINDOW - 1 :], truth) for name, values in found.items()}


@pytest.mark.parametrize("n_parameters", [1, 5])
@pytest.mark.parametrize("window", [200, 2_000])
def test_speed_with_standard_errors_against_statsmodels(capsys, n_parameters, window):
    took = beside_statsmodels(1_000_000, n_parameters, window)
    with capsys.disabled():
        print(
            f"\n{n_parameters} parameters, window {window}, with standard errors: {1.0 / took.ours_s:.2f} Msamples/s,"
            f" statsmodels {1.0 / took.theirs_s:.4f}: ratio {took.times:.0f}"
        )


def test_errors_after_bursts_beside_statsmodels(capsys):
    n_samples = 300_000
    errors = errors_after_bursts(n_samples)
    with capsys.disabled():
        print(f"\n{n_samples} samples, 5 parameters: relative error against a QR of every window, worst and median")
        for name, error in errors.items():
            print(f"  {name:20s} {np.nanmax(error):8.1e} {np.nanmedian(error):8.1e}")
    assert errors["ours"].max() < 1e-10
    assert np.nanmax(errors["statsmodels"]) > 1e-3
