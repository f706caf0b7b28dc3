import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import LowPass
from recoil_processing.spectra.campaign_cutoff import channel_cutoff
from recoil_processing.spectra.cutoff import CutoffChoice, choose_cutoff
from recoil_processing.spectra.spectral_gap import ShotSpectrum, find_gap, rest_level, shot_spectrum
from recoil_processing.stress_waves.stress_wave import (
    MOST_PERIODS_OFF,
    filter_about_onset,
    onset_known_well_enough,
    strip_stress_waves,
)
from tests.builders.ringing import MASS_KG, PRE_TRIGGER_S, RATE_HZ, RingingRecord, ringing_record
from tests.builders.shared_data import shared_file

DROP_RATE_HZ = 1e6
STANDARD_GRAVITY_M_S2 = 9.80665


def stripped(record: RingingRecord, **options):
    options = {"onset_s": PRE_TRIGGER_S, **options}
    return strip_stress_waves(record.recorded_m_s2, RATE_HZ, **options)


@pytest.mark.parametrize(("ringing", "limit"), [(1.0, 0.011), (2.0, 0.013), (3.0, 0.015)])
def test_with_a_known_onset_little_error_is_left(ringing, limit):
    errors = []
    for seed in range(70, 74):
        record = ringing_record(seed, ringing=ringing)
        report = stripped(record, u_onset_s=2e-5, find_modes=False)
        errors.append(record.error(report.filtered))
    assert np.mean(errors) < limit


def test_the_report_tells_what_was_taken_off():
    record = ringing_record(3)
    report = stripped(record)
    assert report.choice.confidence == "sure"
    inside = (record.times_s >= -5e-3) & (record.times_s <= 0.12)
    share = np.sum(record.ringing_m_s2[inside] ** 2) / np.sum(record.recorded_m_s2[inside] ** 2)
    assert report.ringing_share == pytest.approx(share, rel=0.05)
    assert sum(mode.energy_share for mode in report.modes) == pytest.approx(share, rel=0.2)
    for mode in report.modes[:3]:
        assert np.min(np.abs(record.frequencies_hz / mode.frequency_hz - 1.0)) < 0.01


def test_a_record_without_ringing_comes_back_as_it_was():
    record = ringing_record(70, ringing=0.0)
    report = stripped(record)
    assert report.choice.nothing_to_take_off
    assert np.array_equal(report.filtered, record.recorded_m_s2)
    assert report.filtered is not record.recorded_m_s2
    assert report.modes == ()
    assert report.ringing_share == 0.0
    assert report.trusted.all()


@pytest.mark.parametrize("u_onset_s", [math.inf, 2e-5])
def test_channels_with_one_choice_keep_the_force_balance(u_onset_s):
    record = ringing_record(71, noise_share=0.0)
    choice = choose_cutoff(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
    options = {"onset_s": PRE_TRIGGER_S, "u_onset_s": u_onset_s, "choice": choice, "find_modes": False}
    acceleration = strip_stress_waves(record.truth_m_s2, RATE_HZ, **options).filtered
    force = strip_stress_waves(MASS_KG * record.truth_m_s2, RATE_HZ, quantity="force", **options).filtered
    assert np.allclose(force, MASS_KG * acceleration, rtol=0, atol=1e-9 * np.abs(force).max())


def test_a_choice_made_before_is_kept():
    record = ringing_record(72)
    nan = math.nan
    choice = CutoffChoice(321.0, 6, nan, nan, nan, nan, "sure", "the project's own")
    report = stripped(record, choice=choice)
    assert report.choice is choice
    assert report.choice.low_pass is not None
    assert np.allclose(report.filtered, report.choice.low_pass.apply(record.recorded_m_s2, RATE_HZ))
    assert report.modes


def test_what_depends_on_lost_samples_is_not_trusted():
    record = ringing_record(72)
    lossy = record.recorded_m_s2.copy()
    lossy[6000:6004] = math.nan
    report = strip_stress_waves(lossy, RATE_HZ, onset_s=PRE_TRIGGER_S, find_modes=False)
    assert report.choice.low_pass is not None
    reach = report.choice.low_pass.reach_samples(RATE_HZ)
    assert np.flatnonzero(~report.trusted).tolist() == list(range(6000 - reach, 6004 + reach))
    assert np.all(np.isfinite(report.filtered))
    whole = report.choice.low_pass.apply(record.recorded_m_s2, RATE_HZ)
    assert np.max(np.abs(report.filtered - whole)[report.trusted]) < 0.02 * np.max(np.abs(whole))


@pytest.mark.parametrize(
    "samples", [np.full(1000, math.nan), np.r_[1.0, np.full(999, math.nan)], np.full(1000, 3.0), np.zeros(10)]
)
def test_a_record_that_tells_nothing_comes_back_with_the_reason(samples):
    report = strip_stress_waves(samples, 1e4)
    assert report.choice.cutoff_hz is None
    assert report.choice.reason
    assert np.array_equal(report.filtered, samples, equal_nan=True)
    assert np.array_equal(report.trusted, ~np.isnan(samples))


def test_an_onset_outside_the_record_is_refused_by_the_stage():
    with pytest.raises(ValueError, match="is not one of the record's"):
        strip_stress_waves(np.zeros(100), 1e4, onset_s=1.0)


@pytest.fixture(scope="module")
def drops() -> dict[int, np.ndarray]:
    """Sensor -> five drops of a drop tower, m/s^2, shape (5000, 5)."""
    return {
        sensor: 1000.0
        * STANDARD_GRAVITY_M_S2
        * np.genfromtxt(shared_file(f"shock/accel_{sensor}.csv.gz"), delimiter=",", skip_header=2)[:, 1:6]
        for sensor in (1, 3, 5)
    }


def drop_spectra(table: np.ndarray) -> list[ShotSpectrum]:
    spectra = [shot_spectrum(column, DROP_RATE_HZ) for column in table.T]
    assert all(isinstance(shot, ShotSpectrum) for shot in spectra)
    return [shot for shot in spectra if isinstance(shot, ShotSpectrum)]


def test_accepted_filters_keep_the_velocity_change_of_real_drops(drops):
    accepted = 0
    for table in drops.values():
        for column in table.T:
            report = strip_stress_waves(column, DROP_RATE_HZ, find_modes=False)
            if report.choice.cutoff_hz is None:
                continue
            accepted += 1
            rest = rest_level(column, None)
            before = np.sum(column - rest) / DROP_RATE_HZ
            after = np.sum(report.filtered - rest) / DROP_RATE_HZ
            assert 6.0 < before < 8.0
            assert after == pytest.approx(before, rel=0.02)
    assert accepted >= 5


def test_the_mean_over_five_real_drops_finds_the_gap_that_single_drops_doubt(drops):
    together = channel_cutoff(drop_spectra(drops[1]))
    assert together.confidence == "sure"
    assert together.cutoff_hz == pytest.approx(12_000.0, rel=0.1)
    single = [choose_cutoff(column, DROP_RATE_HZ) for column in drops[1].T]
    assert {choice.confidence for choice in single} == {"sure", "doubtful"}
    assert together.low_pass is not None
    peaks = np.abs(together.low_pass.apply(drops[1], DROP_RATE_HZ)).max(axis=0) / STANDARD_GRAVITY_M_S2
    raw = np.abs(drops[1]).max(axis=0) / STANDARD_GRAVITY_M_S2
    # the ringing made the peaks differ from drop to drop; the motion is nearly the same
    assert np.all((peaks > 12_000.0) & (peaks < 15_000.0))
    assert np.ptp(peaks) / np.mean(peaks) < 0.4 * np.ptp(raw) / np.mean(raw)


def test_a_real_sensor_whose_ringing_overlaps_the_pulse_is_refused_in_words(drops):
    single = [choose_cutoff(column, DROP_RATE_HZ) for column in drops[3].T]
    assert not any(choice.confidence == "sure" for choice in single)
    together = channel_cutoff(drop_spectra(drops[3]))
    assert together.cutoff_hz is None
    assert not together.nothing_to_take_off
    assert "no gap" in together.reason


def test_a_real_sensor_that_hardly_rings_is_left_alone(drops):
    for column in drops[5].T:
        choice = choose_cutoff(column, DROP_RATE_HZ)
        assert choice.cutoff_hz is None
        assert choice.nothing_to_take_off
    assert channel_cutoff(drop_spectra(drops[5])).nothing_to_take_off


def test_a_real_gap_is_found_by_the_quality_checks_door(drops):
    assert not isinstance(find_gap(drops[1][:, 0], DROP_RATE_HZ), str)
    lost = drops[1][:, 0].copy()
    lost[::3] = math.nan
    assert "lost samples" in str(find_gap(lost, DROP_RATE_HZ))


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
