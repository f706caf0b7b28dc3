import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.quality.loss_checks import check_held, check_time_steps

RATE_HZ = 10_000.0


def record(seed: int = 1, count: int = 5000, resolution: float = 0.01, noise: float = 0.5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = 50 * np.sin(2 * np.pi * np.arange(count) / 1700) + noise * rng.normal(size=count)
    return np.round(values / resolution) * resolution


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-6, 0.01, 0.05, 0.1, 0.3, 1.0, 5.0]))
def test_noise_at_any_resolution_holds_nothing(seed, resolution):
    assert check_held(record(seed, resolution=resolution), RATE_HZ)[0] == "ok"


@pytest.mark.parametrize("length", [10, 40, 400])
def test_a_held_stretch_is_found_with_its_length(length):
    samples = record()
    samples[1200 : 1200 + length] = samples[1200]
    verdict, detail = check_held(samples, RATE_HZ)
    assert verdict == "warn"
    assert f"longest {length}, {0.1 * length:.2f} ms" in detail
    assert "before the next shot" in detail


def test_what_is_held_at_an_extreme_is_clipping_and_not_meant_here():
    samples = np.minimum(record(), 30.0)
    assert check_held(samples, RATE_HZ)[0] == "ok"


@pytest.mark.parametrize("times", [2, 3])
def test_values_that_are_sent_more_often_than_measured_are_found(times):
    samples = np.repeat(record(), times)
    verdict, detail = check_held(samples, RATE_HZ)
    assert verdict == "warn"
    assert "held" in detail or "updated more slowly" in detail


@pytest.mark.parametrize("samples", [np.empty(0), np.full(50, np.nan), np.full(500, 2.0), np.arange(30.0)])
def test_too_little_to_tell_is_no_fault(samples):
    assert check_held(samples, RATE_HZ)[0] == "ok"


def test_lost_samples_are_no_held_ones():
    samples = record()
    samples[::3] = np.nan
    assert check_held(samples, RATE_HZ)[0] == "ok"


def test_even_instants_are_ok_and_a_step_that_is_off_by_two_percent_is_not():
    times = np.arange(1000) / RATE_HZ
    assert check_time_steps(times, even=True)[0] == "ok"
    times[500:] += 0.02 / RATE_HZ
    verdict, detail = check_time_steps(times, even=True)
    assert verdict == "warn"
    assert "1 of 999 time steps" in detail


def test_messages_may_be_late_but_not_missing():
    rng = np.random.default_rng(1)
    times = np.arange(1000) / 1000 + 3e-4 * rng.random(1000)
    assert check_time_steps(times, even=False)[0] == "ok"
    verdict, detail = check_time_steps(np.delete(times, np.arange(300, 309)), even=False)
    assert verdict == "warn"
    assert "about 9 instants are missing" in detail


@pytest.mark.parametrize("even", [True, False])
def test_two_instants_have_no_steps_to_compare(even):
    assert check_time_steps(np.array([0.0, 1.0]), even=even)[0] == "ok"


def test_jitter_of_a_recorders_stamps_is_stated_with_its_size():
    rng = np.random.default_rng(2)
    for share, verdict in ((0.008, "ok"), (0.05, "warn")):
        found, detail = check_time_steps((np.arange(21_000) + share * rng.standard_normal(21_000)) / 50_000, even=True)
        assert found == verdict
        assert f"jitter by {20 * share:.2g} us, {100 * share:.1g} % of the step of 0.02 ms" in detail


def test_a_gap_between_stamps_that_jitter_is_counted():
    rng = np.random.default_rng(2)
    times = np.delete((np.arange(5000) + 0.008 * rng.standard_normal(5000)) / RATE_HZ, np.arange(300, 309))
    verdict, detail = check_time_steps(times, even=True)
    assert verdict == "warn"
    assert detail.startswith("about 9 instants are missing between 4991; longest step 1 ms;")


def test_stamps_in_bursts_are_stated_and_nothing_is_counted_as_missing():
    number = np.arange(1262)
    verdict, detail = check_time_steps(1e-2 * (number // 10) + 1e-4 * (number % 10), even=False)
    assert verdict == "warn"
    assert detail.startswith("the stamps come in bursts: half of the steps are below 0.1 ms, the mean is 1 ms")


def test_a_rest_without_noise_is_no_held_value():
    values = record()
    values[:1500] = values[1500]
    verdict, detail = check_held(values, RATE_HZ)
    assert verdict == "ok"
    assert detail.endswith("; the rest at its begin, 150.1 ms, has no noise")
    values[3000:3400] = values[3000]
    assert check_held(values, RATE_HZ)[0] == "warn"
