"""How good and how quick the stress-wave stage is, on records that it was not developed on."""

from __future__ import annotations

import time

import numpy as np
import pytest

from recoil_processing.filters import LowPass
from recoil_processing.spectra.cutoff import choose_cutoff
from recoil_processing.stress_waves.ringing import ringing_modes
from recoil_processing.stress_waves.stress_wave import filter_about_onset, strip_stress_waves
from tests.builders import ringing as builder
from tests.builders.ringing import PRE_TRIGGER_S, RATE_HZ, modal_acceleration, ringing_record

SEEDS = range(200, 224)
SCENARIOS = {
    "1x": {"ringing": 1.0},
    "2x": {"ringing": 2.0},
    "3x": {"ringing": 3.0},
    "smooth 2x": {"ringing": 2.0, "smooth": True},
    "close450": {"ringing": 1.0, "lowest_hz": 450.0},
}
CUTOFFS_HZ = np.geomspace(200.0, 900.0, 50)


def errors(scenario: str, u_onset_s: float | None) -> dict[str, np.ndarray]:
    """Error, the oracle's error, the predicted one, relative peak error and peak shift of every seed."""
    rows = []
    for seed in SEEDS:
        record = ringing_record(seed, **SCENARIOS[scenario])
        choice = choose_cutoff(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
        assert choice.low_pass is not None
        if u_onset_s is None:
            filtered = choice.low_pass.apply(record.recorded_m_s2, RATE_HZ)
        else:
            known_s = PRE_TRIGGER_S + u_onset_s * np.random.default_rng(seed).standard_normal()
            filtered, used = filter_about_onset(
                record.recorded_m_s2, RATE_HZ, choice.low_pass, onset_s=known_s, u_onset_s=u_onset_s
            )
            assert used
        oracle = min(record.error(LowPass(f).apply(record.recorded_m_s2, RATE_HZ)) for f in CUTOFFS_HZ)
        rows.append(
            (
                record.error(filtered),
                oracle,
                choice.predicted_error,
                filtered.max() / record.truth_m_s2.max() - 1.0,
                (np.argmax(filtered) - np.argmax(record.truth_m_s2)) / RATE_HZ,
            )
        )
    return dict(zip(("error", "oracle", "predicted", "peak", "shift_s"), np.array(rows).T, strict=True))


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_chosen_cutoff_against_the_best_one(scenario, capsys):
    for u_onset_s in (None, 0.0, 2e-5, 5e-5):
        found = errors(scenario, u_onset_s)
        error, oracle = found["error"], found["oracle"]
        onset = "unknown" if u_onset_s is None else f"known to {1e3 * u_onset_s:.2f} ms"
        with capsys.disabled():
            print(
                f"\n{scenario}, onset {onset}: error {100 * error.mean():.2f} % "
                f"(worst {100 * error.max():.2f}), best cut-off {100 * oracle.mean():.2f} %, "
                f"ratio {error.mean() / oracle.mean():.3f} (worst {np.max(error / oracle):.3f}), "
                f"predicted {100 * found['predicted'].mean():.2f} %, "
                f"peak {100 * np.abs(found['peak']).mean():.2f} % (worst {100 * np.abs(found['peak']).max():.2f}), "
                f"shift {1e3 * found['shift_s'].mean():.2f} ms (worst {1e3 * np.abs(found['shift_s']).max():.2f})",
                end="",
            )
        if u_onset_s is None:
            assert error.mean() < (1.06 if scenario == "close450" else 1.05) * oracle.mean()
        elif u_onset_s is not None and scenario == "2x":
            assert error.mean() < 0.013


def test_records_without_ringing_are_left_alone(capsys):
    left = 0
    for seed in SEEDS:
        for smooth in (False, True):
            record = ringing_record(seed, ringing=0.0, smooth=smooth)
            choice = choose_cutoff(record.recorded_m_s2, RATE_HZ, onset_index=record.onset_index)
            left += choice.nothing_to_take_off
    with capsys.disabled():
        print(f"\nwithout ringing: {left} of {2 * len(SEEDS)} left alone", end="")
    assert left == 2 * len(SEEDS)


def test_modes_at_20_db(capsys):
    times = np.arange(10_000) / RATE_HZ - 0.01
    knocks = np.array([[0.0, 1.2e-4, 1.0], [8e-3, 1.5e-4, 0.6], [60e-3, 1e-4, 0.8]])
    frequency_errors, damping_errors, spurious = [], [], 0
    for seed in range(300, 400):
        rng = np.random.default_rng(seed)
        frequencies = np.array([950.0, 1350.0, 1900.0, 2700.0, 3800.0]) * rng.uniform(0.95, 1.05, 5)
        damping = rng.uniform(0.006, 0.03, 5)
        waves = modal_acceleration(times, frequencies, damping, rng.uniform(0.6, 1.0, 5), knocks)
        waves += 0.1 * np.sqrt(np.mean(waves[500:1500] ** 2)) * rng.standard_normal(times.size)
        modes = ringing_modes(waves, RATE_HZ, lowest_hz=600.0, first=500)
        spurious += len(modes) - 5
        for frequency, ratio in zip(frequencies, damping, strict=True):
            mode = min(modes, key=lambda m: abs(m.frequency_hz - frequency))
            frequency_errors.append(abs(mode.frequency_hz / frequency - 1.0))
            damping_errors.append(abs(mode.damping_ratio / ratio - 1.0))
    within = np.mean((np.array(frequency_errors) < 0.01) & (np.array(damping_errors) < 0.2))
    with capsys.disabled():
        print(
            f"\n500 modes at 20 dB: frequency off by {100 * np.median(frequency_errors):.3f} % in the median, "
            f"{100 * np.quantile(frequency_errors, 0.99):.2f} % in 99 of 100, damping by "
            f"{100 * np.median(damping_errors):.1f} % and {100 * np.quantile(damping_errors, 0.99):.0f} %; "
            f"within 1 % and 20 %: {within:.3f}; "
            f"{spurious / 100:.2f} modes too many a record",
            end="",
        )
    assert np.quantile(frequency_errors, 0.99) < 0.01
    assert np.quantile(damping_errors, 0.99) < 0.2


@pytest.fixture(scope="module")
def long_record():
    """One second at 200 kHz."""
    kept = builder.DURATION_S
    builder.DURATION_S = 1.0
    try:
        return ringing_record(250, rate_hz=200_000.0)
    finally:
        builder.DURATION_S = kept


def test_a_window_of_15000_samples_is_chosen_for(benchmark):
    record = ringing_record(250)
    choice = benchmark(choose_cutoff, record.recorded_m_s2, RATE_HZ)
    assert choice.cutoff_hz is not None


def test_choice_and_modes_of_200000_samples(benchmark, long_record):
    samples, onset = long_record.recorded_m_s2, round(PRE_TRIGGER_S * 200_000.0)

    def choice_and_modes():
        choice = choose_cutoff(samples, 200_000.0, onset_index=onset)
        assert choice.low_pass is not None
        residual = samples - choice.low_pass.apply(samples, 200_000.0)
        return ringing_modes(residual, 200_000.0, lowest_hz=choice.valley_hz, recorded=samples, first=onset)

    assert benchmark(choice_and_modes)


def test_sixteen_channels_of_200000_samples_are_stripped(long_record, capsys):
    samples = long_record.recorded_m_s2
    strip_stress_waves(samples, 200_000.0, onset_s=PRE_TRIGGER_S, u_onset_s=2e-5)
    spent = {}
    for find_modes in (False, True):
        begin = time.perf_counter()
        for _ in range(16):
            strip_stress_waves(samples, 200_000.0, onset_s=PRE_TRIGGER_S, u_onset_s=2e-5, find_modes=find_modes)
        spent[find_modes] = time.perf_counter() - begin
    with capsys.disabled():
        print(
            f"\n16 channels of 200,000 samples: {spent[False]:.2f} s for choices, filtering and spectra, "
            f"{spent[True]:.2f} s with the modes of each",
            end="",
        )
    assert spent[False] < 1.5
