import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import LowPass
from recoil_processing.stress_waves.stress_wave import (
    MOST_PERIODS_OFF,
    filter_about_onset,
    onset_known_well_enough,
)
from tests.builders.ringing import MASS_KG, PRE_TRIGGER_S, RATE_HZ, ringing_record

LOW_PASS = LowPass(450.0)
ONSETS_S = st.floats(0.005, 0.095)


def about(samples: np.ndarray, onset_s: float, u_onset_s: float = 1e-5) -> np.ndarray:
    filtered, used = filter_about_onset(samples, 10_000.0, LOW_PASS, onset_s=onset_s, u_onset_s=u_onset_s)
    assert used
    return filtered


@settings(max_examples=25)
@given(st.integers(0, 1000), ONSETS_S, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_it_is_linear(seed, onset_s, a, b):
    x, y = np.random.default_rng(seed).standard_normal((2, 1000))
    together = about(a * x + b * y, onset_s)
    assert np.allclose(together, a * about(x, onset_s) + b * about(y, onset_s), atol=1e-9 * (abs(a) + abs(b) + 1))


@settings(max_examples=25)
@given(ONSETS_S, st.floats(-1e6, 1e6))
def test_a_constant_passes_unchanged(onset_s, level):
    assert np.allclose(about(np.full(1000, level), onset_s), level, rtol=1e-6, atol=1e-9)


@settings(max_examples=25)
@given(ONSETS_S, st.integers(0, 1000))
def test_nothing_of_the_shot_is_seen_before_it(onset_s, seed):
    times = np.arange(1000) / 10_000.0
    shot = np.where(times > onset_s + 1e-4, np.random.default_rng(seed).standard_normal(1000), 0.0)
    before = about(shot, onset_s)[times < onset_s - 1e-4]
    assert np.max(np.abs(before), initial=0.0) < 1e-12


def test_every_column_is_filtered_as_if_it_were_alone():
    table = np.random.default_rng(1).standard_normal((1000, 3))
    together = about(table, 0.03)
    assert together.shape == table.shape
    for i in range(3):
        assert np.allclose(together[:, i], about(table[:, i], 0.03), atol=1e-12)


def test_it_commutes_with_the_force_balance():
    record = ringing_record(5, noise_share=0.0)
    filtered, used = filter_about_onset(
        np.column_stack([record.truth_m_s2, MASS_KG * record.truth_m_s2]),
        RATE_HZ,
        LOW_PASS,
        onset_s=PRE_TRIGGER_S,
        u_onset_s=1e-5,
    )
    assert used
    assert np.allclose(filtered[:, 1], MASS_KG * filtered[:, 0], rtol=1e-9, atol=1e-6)


def test_a_break_of_slope_at_the_onset_is_kept():
    times = np.arange(2000) / 10_000.0
    ramp = np.maximum(times - 0.05, 0.0)
    plain = LOW_PASS.apply(ramp, 10_000.0)
    near = np.abs(times - 0.05) < 2e-3
    assert np.max(np.abs(about(ramp, 0.05) - ramp)[near]) < 0.02 * np.max(np.abs(plain - ramp)[near])


@pytest.mark.parametrize("ringing", [1.0, 2.0, 3.0])
def test_a_known_onset_halves_the_error(ringing):
    plain, known = [], []
    for seed in range(3):
        record = ringing_record(seed, ringing=ringing)
        plain.append(record.error(LOW_PASS.apply(record.recorded_m_s2, RATE_HZ)))
        filtered, used = filter_about_onset(
            record.recorded_m_s2, RATE_HZ, LOW_PASS, onset_s=PRE_TRIGGER_S, u_onset_s=2e-5
        )
        assert used
        known.append(record.error(filtered))
    assert np.mean(known) < 0.6 * np.mean(plain)


def errors_when_off(share_of_period: float) -> tuple[float, float]:
    """Root mean square error of the plain filter, and of the reflection about an onset wrong by so much."""
    plain, off = [], []
    for seed in range(4):
        record = ringing_record(seed)
        plain.append(record.error(LOW_PASS.apply(record.recorded_m_s2, RATE_HZ)))
        for sign in (-1, 1):
            onset_s = PRE_TRIGGER_S + sign * share_of_period / LOW_PASS.cutoff_hz
            filtered, used = filter_about_onset(record.recorded_m_s2, RATE_HZ, LOW_PASS, onset_s=onset_s, u_onset_s=0.0)
            assert used
            off.append(record.error(filtered))
    return float(np.sqrt(np.mean(np.square(plain)))), float(np.sqrt(np.mean(np.square(off))))


def test_at_the_limit_of_the_uncertainty_the_reflection_still_helps_and_at_three_times_that_it_harms():
    plain, off = errors_when_off(MOST_PERIODS_OFF)
    assert off < 0.8 * plain
    plain, off = errors_when_off(3 * MOST_PERIODS_OFF)
    assert off > 1.1 * plain


@pytest.mark.parametrize(
    ("onset_s", "u_onset_s"), [(0.03, 1e-3), (0.03, np.inf), (0.0005, 1e-5), (-1.0, 1e-5), (0.1, 1e-5), (5.0, 1e-5)]
)
def test_an_onset_that_is_badly_known_or_not_in_the_record_is_not_used(onset_s, u_onset_s):
    samples = np.random.default_rng(2).standard_normal(1000)
    filtered, used = filter_about_onset(samples, 10_000.0, LOW_PASS, onset_s=onset_s, u_onset_s=u_onset_s)
    assert not used
    assert np.array_equal(filtered, LOW_PASS.apply(samples, 10_000.0))


def test_how_well_the_onset_must_be_known_depends_on_the_cutoff():
    assert onset_known_well_enough(LowPass(300.0), 5e-5)
    assert not onset_known_well_enough(LowPass(3000.0), 5e-5)


@pytest.mark.parametrize("u_onset_s", [-1e-6, np.nan])
def test_an_uncertainty_that_is_none_is_refused(u_onset_s):
    with pytest.raises(ValueError, match="u_onset_s must not be negative"):
        onset_known_well_enough(LOW_PASS, u_onset_s)


def test_an_onset_that_is_none_is_refused():
    with pytest.raises(ValueError, match="onset_s must be finite"):
        filter_about_onset(np.zeros(100), 1e4, LOW_PASS, onset_s=np.nan, u_onset_s=0.0)
