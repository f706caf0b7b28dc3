import numpy as np
import pytest

from recoil_processing.stress_waves.ringing import LONGEST_WINDOW, free_windows
from tests.builders.ringing import modal_acceleration

RATE_HZ = 10_000.0


def rung(instants_s: list[float], *, noise: float = 1e-4) -> np.ndarray:
    times = np.arange(3000) / RATE_HZ
    knocks = np.array([[instant, 2e-4, 1.0] for instant in instants_s])
    waves = modal_acceleration(times, np.array([700.0, 1500.0]), np.array([0.01, 0.02]), np.array([1.0, 0.7]), knocks)
    return waves / np.abs(waves).max() + noise * np.random.default_rng(1).standard_normal(times.size)


@pytest.mark.parametrize("instants_s", [[0.001], [0.001, 0.02], [0.001, 0.0085, 0.03], [0.05, 0.1, 0.15]])
def test_no_window_holds_a_knock_and_each_knock_has_one_behind_it(instants_s):
    windows = free_windows(rung(instants_s), 40)
    for instant in instants_s:
        begin, end = instant * RATE_HZ, (instant + 2e-4) * RATE_HZ
        assert not any(first < begin < last - 1 or first < end < last for first, last in windows)
        assert any(0 <= first - end < 40 for first, _ in windows)


def test_windows_are_long_enough_and_no_longer_than_allowed():
    windows = free_windows(rung([0.001, 0.0085, 0.03]), 40)
    assert all(40 <= last - first <= LONGEST_WINDOW for first, last in windows)
    assert free_windows(rung([0.001, 0.0085, 0.03]), 5000) == ()


def test_what_has_died_away_is_in_no_window():
    windows = free_windows(rung([0.001], noise=0.01), 40)
    # of the slower mode a thousandth is left after 157 ms
    assert max(last for _, last in windows) < 1600
