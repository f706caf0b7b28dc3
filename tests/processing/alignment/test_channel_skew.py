from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.channel_skew import Skew, measure_skew
from tests.builders.motions import ONSET_S, acceleration
from tests.builders.shared_data import shared_file

RATE_HZ = 20_000.0
TIMES_S = np.arange(9000) / RATE_HZ


def pair(seed: int, skew_s: float, *, gain: float = 1.3, sigma: float = 4.0, ringing: float = 300.0):
    """Two accelerometers on one body: noise and ringing of their own, the second later."""
    rng = np.random.default_rng(seed)
    channels = []
    for late, scale in ((0.0, 1.0), (skew_s, gain)):
        after = np.maximum(TIMES_S - ONSET_S - late, 0.0)
        ring = rng.normal(1.0, 0.3) * np.sin(2 * np.pi * rng.uniform(1800.0, 2600.0) * after + rng.uniform(0, 6))
        felt = acceleration(TIMES_S - late) + ringing * ring * np.exp(-after / 0.01) * (after > 0)
        channels.append(scale * (felt + sigma * rng.standard_normal(TIMES_S.size)) + 7.0)
    return channels


def skew_of(first, second, cutoff_hz: float = 300.0, rate_hz: float = RATE_HZ) -> Skew:
    found = measure_skew(first, second, rate_hz, cutoff_hz)
    assert isinstance(found, Skew), found
    return found


@pytest.mark.exhaustive
@pytest.mark.parametrize("skew_s", [0.0, 1e-4, -7e-4])
def test_a_skew_is_found_within_its_uncertainty(skew_s):
    pulls, significant = [], []
    for seed in range(30):
        found = skew_of(*pair(seed, skew_s))
        pulls.append((found.skew_s - skew_s) / found.u_s)
        significant.append(found.significant)
        assert found.u_s < 3e-5
        assert found.gain == pytest.approx(1.3, rel=0.05)
    assert 0.4 < np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert np.mean(significant) == 1.0 if skew_s else np.mean(significant) < 0.15


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=20)
@given(st.floats(-2e-3, 2e-3))
def test_without_noise_any_skew_is_found(skew_s):
    found = skew_of(acceleration(TIMES_S), 2.0 * acceleration(TIMES_S - skew_s))
    assert found.skew_s == pytest.approx(skew_s, abs=1e-7)
    assert found.gain == pytest.approx(2.0, rel=1e-3)


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=15)
@given(st.floats(1e-3, 1e3), st.floats(-1e4, 1e4), st.sampled_from([-1.0, 1.0]))
def test_units_zeros_and_signs_change_nothing(scale, zero, sign):
    first, second = pair(3, 3e-4)
    one, other = skew_of(first, second), skew_of(first, sign * scale * second + zero)
    assert other.skew_s == pytest.approx(one.skew_s, abs=0.05 * one.u_s)
    assert other.u_s == pytest.approx(one.u_s, rel=1e-2)
    assert other.gain == pytest.approx(sign * scale * one.gain, rel=1e-3)
    assert np.sign(other.correlation) == sign


def test_the_skew_of_the_one_is_the_others_turned_round():
    first, second = pair(5, 4e-4)
    there, back = skew_of(first, second), skew_of(second, first)
    assert back.skew_s == pytest.approx(-there.skew_s, abs=0.5 * there.u_s)


@settings(deadline=None, max_examples=10)
@given(st.integers(-400, 400))
def test_when_the_shot_was_changes_nothing(shift):
    first, second = pair(6, 2e-4)
    one = skew_of(first, second)
    other = skew_of(np.roll(first, shift), np.roll(second, shift))
    assert other.skew_s == pytest.approx(one.skew_s, abs=one.u_s)


def test_lost_samples_are_left_out():
    first, second = pair(7, 2e-4)
    second[3000:3400] = np.nan
    first[5200:5203] = np.nan
    found = skew_of(first, second)
    assert abs(found.skew_s - 2e-4) < 4 * found.u_s


@pytest.mark.parametrize(
    ("first", "second", "sentence"),
    [
        (np.zeros(9000), acceleration(TIMES_S), "constant"),
        (np.full(9000, np.nan), acceleration(TIMES_S), "only 0 samples"),
        (acceleration(TIMES_S), np.random.default_rng(1).standard_normal(9000), "not proportional"),
        (acceleration(TIMES_S), acceleration(TIMES_S - 0.03), "no skew of two channels"),
    ],
    ids=["constant", "lost", "noise", "apart"],
)
def test_what_has_no_skew_says_so(first, second, sentence):
    found = measure_skew(first, second, RATE_HZ, 300.0)
    assert isinstance(found, str)
    assert sentence in found


def test_a_callers_mistakes_are_refused():
    first = acceleration(TIMES_S)
    with pytest.raises(ValueError, match="equally many"):
        measure_skew(first, first[1:], RATE_HZ, 300.0)
    with pytest.raises(ValueError, match="a quarter of rate_hz"):
        measure_skew(first, first, RATE_HZ, 6000.0)


@pytest.mark.parametrize("name", ["4mps_sphere_1", "6mps_150degcone_1"])
def test_the_two_accelerometers_of_a_real_recorder_lag_each_other(name):
    record = np.load(shared_file(f"shock/{name}_event.npz"))
    times, slow_times = record["t_pr100"], record["t_dc40"]
    grid = np.arange(slow_times[0], slow_times[-1], 1 / RATE_HZ)
    fast = np.interp(grid, times, record["pr100_g"][:, 0].astype(np.float64))
    slow = np.interp(grid, slow_times, record["dc40_g"][:, 0].astype(np.float64))
    found = skew_of(fast, slow)
    assert 0.70e-3 <= found.skew_s <= 0.80e-3
    assert found.significant
    assert found.gain == pytest.approx(1.0, abs=0.04)
    # the slow one is clipped for a few samples: what is near them left out, it is the same
    clipped = np.abs(record["dc40_g"][:, 0]) > 41.5
    slow[np.interp(grid, slow_times, clipped.astype(np.float64)) > 0] = np.nan
    assert skew_of(fast, slow).skew_s == pytest.approx(found.skew_s, abs=3 * found.u_s)
