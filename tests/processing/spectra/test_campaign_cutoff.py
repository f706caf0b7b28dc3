import numpy as np
import pytest

from recoil_processing.spectra.campaign_cutoff import campaign_cutoff, channel_cutoff
from recoil_processing.spectra.cutoff import cutoff_of
from recoil_processing.spectra.spectral_gap import ShotSpectrum, shot_spectrum
from recoil_processing.spectra.spectrum import Spectrum
from tests.builders.ringing import RATE_HZ, ringing_record


def shots(seeds, *, noise_seed: int | None = None, **options) -> list[ShotSpectrum]:
    """Spectra of several shots; with `noise_seed` of one and the same structure, each shot as loud as it likes."""
    spectra = []
    for seed in seeds:
        record = ringing_record(seed if noise_seed is None else noise_seed, **options)
        samples = record.recorded_m_s2
        if noise_seed is not None:
            rng = np.random.default_rng(seed)
            samples = rng.uniform(0.9, 1.1) * record.truth_m_s2 + rng.uniform(0.7, 1.3) * record.ringing_m_s2
            samples = samples + 25.0 * rng.standard_normal(samples.size)
        shot = shot_spectrum(samples, RATE_HZ, onset_index=record.onset_index)
        assert isinstance(shot, ShotSpectrum)
        spectra.append(shot)
    return spectra


def test_the_lowest_cutoff_of_the_channels_is_taken():
    channels = {"near": shots(range(5), noise_seed=60), "far": shots(range(5), noise_seed=61, lowest_hz=450.0)}
    choice = campaign_cutoff(channels)
    assert choice.confidence == "sure"
    assert choice.cutoff_hz == channel_cutoff(channels["far"]).cutoff_hz
    assert choice.cutoff_hz is not None
    assert choice.cutoff_hz < (channel_cutoff(channels["near"]).cutoff_hz or 0.0)
    assert choice.reason.startswith("far needs the lowest of 2 cut-offs")


def test_the_mean_of_shots_agrees_with_each_of_them():
    spectra = shots(range(5), noise_seed=62)
    together = channel_cutoff(spectra)
    single = [cutoff_of(shot).cutoff_hz or 0.0 for shot in spectra]
    assert together.cutoff_hz == pytest.approx(np.median(single), rel=0.1)


def test_channels_that_need_no_filter_do_not_lower_it():
    ringing = shots(range(3), noise_seed=63)
    alone = campaign_cutoff({"rings": ringing})
    both = campaign_cutoff({"rings": ringing, "quiet": shots(range(3), ringing=0.0)})
    assert both.cutoff_hz == alone.cutoff_hz
    assert both.confidence == "sure"


def test_without_ringing_anywhere_nothing_is_taken_off():
    choice = campaign_cutoff({"a": shots(range(3), ringing=0.0), "b": shots(range(3, 6), ringing=0.0)})
    assert choice.cutoff_hz is None
    assert choice.nothing_to_take_off


def overlapping() -> ShotSpectrum:
    """Flat up to a kilohertz above where a gap could be looked for, then falling: no frequency parts it."""
    f = 2.0 ** (np.arange(24 * 4, 24 * 14) / 24)
    return ShotSpectrum(Spectrum(f, 1.0 / (1.0 + (f / 1000.0) ** 4), 5.0), 150.0, 0.01, 4.0)


def test_a_channel_that_is_refused_makes_the_choice_doubtful_by_name():
    choice = campaign_cutoff({"rings": shots(range(3), noise_seed=64), "mixed": [overlapping()] * 3})
    assert choice.cutoff_hz is not None
    assert choice.confidence == "doubtful"
    assert "mixed: no gap" in choice.reason
    refused = campaign_cutoff({"mixed": [overlapping()] * 3})
    assert refused.cutoff_hz is None
    assert not refused.nothing_to_take_off
    assert refused.confidence == "none"


def shallow(depth_db: float, lowest_hz: float = 150.0) -> ShotSpectrum:
    """Motion, a valley at 1 kHz, and a broad hump of ringing."""
    f = 2.0 ** (np.arange(24 * 4, 24 * 15) / 24)
    octaves = np.log2(f / 1000.0)
    level = np.where(octaves < 0, -24.0 * octaves, depth_db * np.minimum(octaves, 1.0))
    level = np.where(octaves > 3, level - 30.0 * (octaves - 3), level)
    return ShotSpectrum(Spectrum(f, 10 ** (level / 10), 5.0), lowest_hz, 0.01, 4.0)


def test_7_db_are_doubtful_in_one_shot_and_sure_in_the_mean_of_three():
    assert cutoff_of(shallow(7.0)).confidence == "doubtful"
    assert channel_cutoff([shallow(7.0)] * 2).confidence == "doubtful"
    assert channel_cutoff([shallow(7.0)] * 3).confidence == "sure"
    assert channel_cutoff([shallow(5.0)] * 3).confidence == "none"


def test_where_the_mean_has_no_gap_most_shots_must_be_sure():
    # a search that begins beyond the valley finds nothing in the mean
    late = shallow(12.0, lowest_hz=1e4)
    mostly = channel_cutoff([shallow(12.0), shallow(12.0), shallow(12.0), late, late])
    assert mostly.cutoff_hz is not None
    blind = [shallow(12.0), shallow(12.0), late, late, late]
    assert channel_cutoff(blind).cutoff_hz is None


def test_a_campaign_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one channel"):
        campaign_cutoff({})
    with pytest.raises(ValueError, match="a shot for each"):
        campaign_cutoff({"a": []})
