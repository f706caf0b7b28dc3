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
    coherent_hz,
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


def test_a_tube_that_swings_bounds_it_below_a_third_of_its_first_mode_unless_another_was_asked_for() -> None:
    recorded = ringing(1)
    choice = choose_filter(recorded, bench_shot())
    assert mass_filter(recorded, choice).cutoff_hz > 33.0
    assert mass_filter(recorded, choice, tube_hz=100.0).cutoff_hz == pytest.approx(33.0, rel=0.35)
    assert mass_filter(recorded, choice, tube_hz=100.0).cutoff_hz < 100.0 / 3.0
    assert mass_filter(recorded, choice, tube_hz=1e5) == mass_filter(recorded, choice)
    # one for all shots of a rig is bounded by that rig's tube
    assert mass_filter(recorded, choice, 150.0, 300.0).cutoff_hz == pytest.approx(99.0)
    assert mass_filter(recorded, choice, 90.0, 300.0).cutoff_hz == 90.0
    asked = choose_filter(recorded, bench_shot(), given_hz=250.0)
    assert mass_filter(recorded, asked, tube_hz=300.0) == asked.low_pass


def test_a_cutoff_that_was_asked_for_and_a_record_with_losses_keep_one_band() -> None:
    recorded = ringing(1)
    asked = choose_filter(recorded, bench_shot(), given_hz=250.0)
    assert mass_filter(recorded, asked) == asked.low_pass
    trusted = recorded.trusted.copy()
    trusted[np.flatnonzero(recorded.inside)[50]] = False
    choice = choose_filter(recorded, bench_shot())
    lossy = replace(recorded, trusted=trusted)
    # within what both sides agree on, and not within the force's energy
    cutoff_hz = mass_filter(lossy, choice).cutoff_hz
    assert cutoff_hz == min(choice.low_pass.cutoff_hz, coherent_hz(lossy, choice.low_pass.cutoff_hz))
    assert cutoff_hz > mass_filter(recorded, choice).cutoff_hz


# ------------------------------------------------------------------------------------------ what both sides agree on


def two_sided(noise: float, above_hz: float, of: str = "acceleration", seed: int = 5) -> Regression:
    """Draw a motion that falls with the frequency, and put that times a share of it, as noise, on one of its sides."""
    truth = bench_regression()
    rng, n = np.random.default_rng(seed), truth.times_s.size
    hz = np.fft.rfftfreq(n, truth.step_s)

    def drawn(amplitude: np.ndarray) -> np.ndarray:
        spectrum = amplitude * (rng.standard_normal(hz.size) + 1j * rng.standard_normal(hz.size))
        return np.fft.irfft(spectrum, n) * np.sqrt(n)

    falling = 2000.0 / np.maximum(hz, 10.0) ** 1.5
    motion, wrong = drawn(falling), drawn(noise * falling * (hz > above_hz))
    forces = np.zeros_like(truth.forces_n)
    forces[:, 0] = 800.0 * (motion + wrong * (of == "force"))
    return replace(truth, acceleration_m_s2=motion + wrong * (of == "acceleration"), forces_n=forces)


def edges_hz(recorded: Regression, most_hz: float) -> list[float]:
    """Return the edges of bands that are 1.6 as wide, from two periods of the travel upward."""
    edges = [2.0 / (recorded.interval_s[1] - recorded.interval_s[0])]
    while edges[-1] < most_hz:
        edges.append(1.6 * edges[-1])
    return edges


@pytest.mark.parametrize("of", ["acceleration", "force"])
@pytest.mark.parametrize("above_hz", [60.0, 150.0, 300.0])
def test_where_one_side_shows_something_else_the_band_ends_at_an_edge_below_it(of: str, above_hz: float) -> None:
    recorded = two_sided(4.0, above_hz, of)
    found_hz = coherent_hz(recorded, 800.0)
    assert min(abs(found_hz / edge - 1.0) for edge in edges_hz(recorded, 800.0)) < 1e-9
    # noise that begins within a band spoils it, and reaches over an edge a little
    assert above_hz / 1.6**2 < found_hz < 1.2 * above_hz


def test_sides_that_show_the_same_keep_the_whole_band() -> None:
    assert coherent_hz(two_sided(0.0, 0.0), 700.0) == 700.0
    # noise of a third of the motion leaves a correlation of .95
    assert coherent_hz(two_sided(0.3, 0.0), 300.0) == 300.0
    assert coherent_hz(two_sided(4.0, 0.0), 300.0) == 300.0  # from the first band on: nothing can be told
    assert coherent_hz(two_sided(4.0, 500.0), 300.0) == 300.0  # noise beyond what is asked for
    recorded = two_sided(4.0, 60.0)
    below_first_hz = 0.9 * edges_hz(recorded, 20.0)[0]
    assert coherent_hz(recorded, below_first_hz) == below_first_hz


def test_rows_of_the_mass_reach_no_farther_than_both_sides_agree() -> None:
    quiet, loud = ringing(1), ringing(1)
    since = loud.times_s - loud.interval_s[0]
    humming = 0.3 * float(np.abs(loud.acceleration_m_s2).max()) * np.sin(2.0 * np.pi * 60.0 * since) * loud.inside
    loud = replace(loud, acceleration_m_s2=loud.acceleration_m_s2 + humming)
    choice = choose_filter(quiet, bench_shot())
    assert mass_filter(loud, choice).cutoff_hz < 60.0 < mass_filter(quiet, choice).cutoff_hz
