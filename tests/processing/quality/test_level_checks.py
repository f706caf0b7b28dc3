import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.quality.clipping_checks import check_flat_tops
from recoil_processing.quality.level_checks import (
    check_filtered_noise,
    check_level_after,
    check_steady_baseline,
    check_zero_shift,
)

COUNT = 4000
IN_BASELINE = np.arange(COUNT) < 800
PULSE = (np.arange(COUNT) >= 1000) & (np.arange(COUNT) < 1200)
AFTER = np.arange(COUNT) >= 3000


def pulse(height: float = 100.0, noise: float = 0.1, seed: int = 1) -> np.ndarray:
    samples = noise * np.random.default_rng(seed).normal(size=COUNT)
    samples[1000:1200] += height * np.sin(np.pi * np.arange(200) / 200) ** 2
    return samples


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 2.0), st.floats(-50.0, 50.0))
def test_a_baseline_of_one_level_and_noise_is_steady(seed, noise, level):
    assert check_steady_baseline(pulse(noise=noise, seed=seed) + level, IN_BASELINE, unit="Pa")[0] == "ok"


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_slow_noise_is_no_drift(seed):
    slow = np.cumsum(np.random.default_rng(seed).normal(size=COUNT))
    slow = slow - np.convolve(np.pad(slow, 25, mode="edge"), np.ones(51) / 51, mode="valid")
    assert check_steady_baseline(pulse() + 0.01 * slow, IN_BASELINE, unit="Pa")[0] == "ok"


@pytest.mark.parametrize(("drift", "verdict"), [(0.1, "ok"), (2.0, "warn"), (-2.0, "warn")])
def test_a_level_that_moves_counts_if_it_matters(drift, verdict):
    moved = pulse() + drift * np.minimum(np.arange(COUNT) / 800, 1.0)
    found, detail = check_steady_baseline(moved, IN_BASELINE, unit="Pa")
    assert found == verdict
    assert ("wait until the mechanism is at rest" in detail) == (verdict != "ok")


def test_noise_that_changes_is_a_loose_cable():
    samples = pulse()
    samples[400:800] *= 10
    verdict, detail = check_steady_baseline(samples, IN_BASELINE, unit="Pa")
    assert verdict == "warn"
    assert "look for a loose cable" in detail


def test_too_short_a_baseline_is_not_compared():
    assert check_steady_baseline(pulse(), np.arange(COUNT) < 20, unit="Pa")[0] == "ok"


@pytest.mark.parametrize(
    ("noise", "needed", "verdict"), [(0.1, True, "ok"), (2.0, True, "warn"), (2.0, False, "ok"), (20.0, False, "fail")]
)
def test_noise_behind_the_low_pass_counts_by_what_the_channel_is_needed_for(noise, needed, verdict):
    found, detail = check_filtered_noise(pulse(noise=noise), IN_BASELINE, PULSE, needed=needed)
    assert found == verdict
    assert ("before the next shot" in detail) == (verdict != "ok")


def test_without_a_baseline_or_noise_nothing_is_said():
    assert check_filtered_noise(pulse(), np.zeros(COUNT, dtype=bool), PULSE, needed=True)[0] == "ok"
    assert check_filtered_noise(pulse(noise=0.0), IN_BASELINE, PULSE, needed=True) == (
        "ok",
        "noise below the resolution",
    )


@pytest.mark.parametrize(("shift", "verdict"), [(0.0, "ok"), (0.1, "ok"), (1.0, "warn"), (-1.0, "warn"), (8.0, "fail")])
def test_a_zero_that_does_not_come_back_is_seen_after_the_shot(shift, verdict):
    found, detail = check_level_after(pulse() + shift * (np.arange(COUNT) > 1100), IN_BASELINE, AFTER, unit="Pa")
    assert found == verdict
    assert ("before the next shot" in detail) == (verdict != "ok")
    assert check_level_after(pulse(), IN_BASELINE, np.zeros(COUNT, dtype=bool), unit="Pa")[0] == "ok"


@pytest.mark.parametrize(("u_moving", "verdict"), [(0.0, "warn"), (0.3, "warn"), (0.5, "ok")])
def test_a_zero_that_moves_by_what_is_stated_of_it_is_no_warning(u_moving, verdict):
    shifted = pulse() + np.where(np.arange(COUNT) > 1100, 1.0, 0.0)
    found, detail = check_level_after(shifted, IN_BASELINE, AFTER, unit="Pa", u_moving=u_moving)
    assert found == verdict
    assert ("stated to move by" in detail) == (u_moving > 0)


def test_a_zero_shift_names_what_it_was_told_by():
    assert "against the forces" in check_zero_shift(10.0, 0.1, 100.0, unit="m/s^2", against="the forces")[1]


@settings(deadline=None, max_examples=40)
@given(st.sampled_from([0.01, 0.3, 1.0, 3.0]), st.floats(0.0, 0.5), st.integers(0, 2**32 - 1))
def test_the_rounded_top_of_a_slow_signal_is_no_clipping(resolution, noise, seed):
    slow = 100 * np.sin(np.pi * np.arange(COUNT) / COUNT) ** 2 + noise * np.random.default_rng(seed).normal(size=COUNT)
    assert check_flat_tops(np.round(slow / resolution) * resolution)[0] == "ok"


def test_clipping_short_of_the_declared_range_says_where_to_raise_it():
    verdict, detail = check_flat_tops(np.minimum(pulse(), 60.0), declared=True)
    assert verdict == "warn"
    assert "is set to less than the declared range; raise it there before the next shot" in detail
