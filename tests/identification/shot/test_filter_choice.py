"""The low-pass is chosen from the spectra, one for all shots, and the report says why."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.shot.filter_choice import (
    DEFAULT_CUTOFF_HZ,
    campaign_choice,
    choose_filter,
    force_spectra,
    mass_filter,
)
from recoil_processing.shot.regression import Regression
from recoil_processing.spectra.cutoff import refusal
from tests.builders.bench_shots import bench_regression, bench_shot

RATE_HZ = 20_000.0


def ringing(seed: int, size: float = 1.0) -> Regression:
    """The bench shot whose accelerometer rings at 1.2 and 2.6 kHz from the release on."""
    truth = bench_regression()
    rng = np.random.default_rng(seed)
    since = truth.times_s - truth.interval_s[0]
    peak = float(np.abs(truth.acceleration_m_s2).max())
    waves = sum(
        share * np.sin(2 * np.pi * f * since) * np.exp(-2 * np.pi * f * zeta * np.maximum(since, 0.0)) * (since > 0)
        for f, zeta, share in ((1200.0, 0.01, 0.6), (2600.0, 0.01, 0.4))
    )
    noise = rng.normal(0.0, 0.002 * peak, since.size)
    return replace(truth, acceleration_m_s2=truth.acceleration_m_s2 + size * peak * waves + noise)


def test_the_cutoff_lies_between_the_motion_and_what_rings() -> None:
    choice = choose_filter(ringing(1), bench_shot())
    assert choice.basis == "shot"
    assert choice.cutoff is not None
    assert choice.cutoff.confidence == "sure"
    assert 100.0 < choice.low_pass.cutoff_hz < 1100.0
    assert choice.to_json()["cutoff_hz"] == choice.low_pass.cutoff_hz


def test_several_shots_are_given_one_cutoff() -> None:
    campaign = campaign_choice([force_spectra(ringing(seed)) for seed in range(4)])
    assert campaign is not None
    choices = {choose_filter(ringing(seed), bench_shot(), campaign=campaign).low_pass for seed in range(4)}
    (low_pass,) = choices
    assert low_pass.cutoff_hz == campaign.cutoff_hz
    assert choose_filter(ringing(0), bench_shot(), campaign=campaign).basis == "campaign"


def test_a_cutoff_that_was_asked_for_is_taken_as_it_is() -> None:
    choice = choose_filter(ringing(1), bench_shot(), given_hz=123.0)
    assert (choice.low_pass.cutoff_hz, choice.basis, choice.cutoff) == (123.0, "given", None)
    assert choice.to_json()["confidence"] is None


def test_where_the_spectra_tell_nothing_a_fixed_one_stands_in_and_says_so() -> None:
    choice = choose_filter(ringing(1), bench_shot(), campaign=refusal("no gap at all", 4))
    assert choice.low_pass.cutoff_hz == DEFAULT_CUTOFF_HZ
    assert choice.basis == "default"
    assert "no gap at all" in choice.reason
    assert choice.to_json()["depth_db"] is None


def test_a_force_that_is_sampled_slowly_lowers_the_cutoff() -> None:
    shot = bench_shot()
    channels = dict(shot.channels)
    slow = channels["p_brake"]
    every = slice(None, None, 20)
    base = replace(slow.time_base, count=len(range(0, slow.time_base.count, 20)), step_s=20 / RATE_HZ)
    channels["p_brake"] = replace(slow, samples=slow.samples[every], time_base=base, raw=None)
    choice = choose_filter(ringing(1), replace(shot, channels=channels))
    assert choice.low_pass.cutoff_hz == pytest.approx(0.2 * 1000.0)
    assert "1000" in choice.reason


def test_a_shot_without_any_spectrum_has_none() -> None:
    flat = replace(
        bench_regression(),
        acceleration_m_s2=np.zeros(bench_regression().times_s.size),
        forces_n=np.zeros_like(bench_regression().forces_n),
    )
    assert force_spectra(flat) == {}
    assert campaign_choice([{}, {}]) is None
    assert math.isfinite(choose_filter(flat, bench_shot()).low_pass.cutoff_hz)


def test_the_mass_is_fitted_where_the_force_has_its_energy() -> None:
    recorded = ringing(1)
    choice = choose_filter(recorded, bench_shot())
    narrow = mass_filter(recorded, choice)
    assert narrow.cutoff_hz < choice.low_pass.cutoff_hz
    assert narrow.half_order == choice.low_pass.half_order
    force = recorded.force_n[recorded.inside]
    power = np.abs(np.fft.rfft(force, 4 * force.size)) ** 2
    below = np.fft.rfftfreq(4 * force.size, recorded.step_s) <= narrow.cutoff_hz
    assert power[below].sum() / power.sum() == pytest.approx(0.99, abs=0.002)


def test_a_cutoff_that_was_asked_for_and_a_record_with_losses_keep_one_band() -> None:
    recorded = ringing(1)
    asked = choose_filter(recorded, bench_shot(), given_hz=250.0)
    assert mass_filter(recorded, asked) == asked.low_pass
    trusted = recorded.trusted.copy()
    trusted[np.flatnonzero(recorded.inside)[50]] = False
    choice = choose_filter(recorded, bench_shot())
    assert mass_filter(replace(recorded, trusted=trusted), choice) == choice.low_pass
