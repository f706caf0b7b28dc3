import math

import numpy as np
import pytest

from recoil_processing.spectra.campaign_cutoff import channel_cutoff
from recoil_processing.spectra.cutoff import CutoffChoice, choose_cutoff
from recoil_processing.spectra.spectral_gap import ShotSpectrum, find_gap, rest_level, shot_spectrum
from recoil_processing.stress_waves.stress_wave import strip_stress_waves
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
