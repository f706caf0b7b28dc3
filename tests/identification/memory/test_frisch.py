from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.memory.frisch import frisch_bracket

seeds = st.integers(0, 2**32 - 1)
ratios = st.floats(0.01, 1e4).flatmap(lambda r: st.sampled_from([r, -r]))


def noisy(seed, ratio, noise_of_regressor, noise_of_response, n_samples):
    """Signal of rms one and its multiple, each with errors of their own as a share of its rms."""
    rng = np.random.default_rng(seed)
    signal = rng.standard_normal(n_samples)
    regressor = signal + noise_of_regressor * rng.standard_normal(n_samples)
    response = ratio * (signal + noise_of_response * rng.standard_normal(n_samples))
    return regressor, response


@settings(max_examples=40, deadline=None)
@given(seeds, ratios, st.floats(0.1, 1.0), st.floats(0.1, 1.0))
def test_with_independent_errors_on_both_sides_the_bracket_of_many_samples_holds_the_truth(seed, ratio, ex, ey):
    bracket = frisch_bracket(*noisy(seed, ratio, ex, ey, 20_000), 20_000, engine="numpy")
    # attenuation is ex^2 / (1 + ex^2) >= 1 %, and the standard errors are 1 % at most
    assert bracket.holds(ratio, 5.0)[-1]
    np.testing.assert_allclose(bracket.forward[-1], ratio / (1 + ex**2), rtol=0.08)
    np.testing.assert_allclose(bracket.reverse[-1], ratio * (1 + ey**2), rtol=0.12)
    if min(ex, ey) > 0.4:
        assert bracket.holds(ratio)[-1]


@settings(max_examples=60, deadline=None)
@given(seeds, ratios, st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.integers(2, 60))
def test_the_reverse_estimate_is_never_the_smaller_in_magnitude(seed, ratio, ex, ey, window):
    bracket = frisch_bracket(*noisy(seed, ratio, ex, ey, 200), window)
    rows = bracket.identified
    assert rows[window - 1 :].all()
    assert (np.abs(bracket.forward[rows]) <= np.abs(bracket.reverse[rows]) * (1 + 1e-9)).all()
    assert (np.sign(bracket.forward[rows]) == np.sign(bracket.reverse[rows])).all()
    assert (bracket.lower[rows] <= bracket.upper[rows]).all()
    assert (bracket.squared_correlation[rows] <= 1 + 1e-9).all()


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(1e-6, 1e6), st.floats(1e-6, 1e6), st.sampled_from([1.0, -1.0]))
def test_units_of_either_side_scale_the_bracket_and_nothing_else(seed, of_regressor, of_response, sign):
    regressor, response = noisy(seed, 3.0, 0.3, 0.2, 150)
    plain = frisch_bracket(regressor, response, 20)
    scaled = frisch_bracket(of_regressor * regressor, sign * of_response * response, 20)
    factor = sign * of_response / of_regressor
    for name in ("forward", "reverse"):
        np.testing.assert_allclose(getattr(scaled, name), factor * getattr(plain, name), rtol=1e-9)
    np.testing.assert_allclose(scaled.squared_correlation, plain.squared_correlation, rtol=1e-9)
    np.testing.assert_array_equal(scaled.identified, plain.identified)


def test_the_bracket_is_the_textbook_one():
    regressor, response = noisy(1, 782.0, 0.24, 0.05, 300)
    regressor[70] = np.nan
    bracket = frisch_bracket(regressor, response, 50)
    for k in (60, 100, 299):
        x, y = regressor[k - 49 : k + 1], response[k - 49 : k + 1]
        x, y = x[~np.isnan(x)], y[~np.isnan(x)]
        assert bracket.forward[k] == pytest.approx(x @ y / (x @ x), rel=1e-12)
        assert bracket.reverse[k] == pytest.approx(y @ y / (x @ y), rel=1e-12)


def test_silence_on_either_side_gives_no_bracket():
    regressor, response = noisy(2, 2.0, 0.1, 0.1, 200)
    response[50:120] = 0.0
    bracket = frisch_bracket(regressor, response, 20)
    silent = np.zeros(200, dtype=bool)
    silent[:19], silent[69:120] = True, True
    np.testing.assert_array_equal(bracket.identified, ~silent)
    assert np.isnan(bracket.forward[silent]).all()
    assert not bracket.holds(2.0, 100.0)[silent].any()


def test_a_table_is_no_single_regressor():
    with pytest.raises(ValueError, match=r"one dimension, found shapes \(9, 1\) and \(9,\)"):
        frisch_bracket(np.ones((9, 1)), np.ones(9), 3)
