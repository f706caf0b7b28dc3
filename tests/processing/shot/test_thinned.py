"""Channels that are faster than a mass needs: thinned without a shift in time, and what was lost stays lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_processing.shot.onset import find_onset
from recoil_processing.shot.release import release_index
from recoil_processing.shot.thinned import (
    THINNED_ABOVE_HZ,
    THINNED_TO_HZ,
    factor_of,
    thinned,
    thinned_beside,
    thinned_samples,
    thinning_factor,
)
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import ExposureAlignment, TriggerAlignment
from tests.builders.shots import make_shot

RATE_HZ = 200e3


@given(factor=st.integers(2, 20), level=st.floats(-1e6, 1e6, allow_subnormal=False), size=st.integers(1, 500))
def test_a_level_stays_as_it_is_from_end_to_end(factor: int, level: float, size: int) -> None:
    found = thinned_samples(np.full(size, level), factor)
    assert found.size == -(-size // factor)
    np.testing.assert_allclose(found, level, rtol=1e-12)


@pytest.mark.parametrize("factor", [2, 4, 5])
def test_what_the_force_fills_is_not_shifted_and_what_would_be_folded_onto_it_is_taken_out(factor: int) -> None:
    times_s = np.arange(20_001) / RATE_HZ
    slow = np.sin(2 * np.pi * 2000.0 * times_s + 0.3)
    # a tone at so much over half the thinned rate would be folded as far below it
    fast = np.sin(2 * np.pi * 1.28 * 0.5 * RATE_HZ / factor * times_s)
    away = slice(50, -50)
    np.testing.assert_allclose(thinned_samples(slow, factor)[away], slow[::factor][away], atol=1e-3)
    assert np.abs(thinned_samples(fast, factor)[away]).max() < 2e-3


@pytest.mark.parametrize("factor", [2, 4, 10])
def test_noise_keeps_its_density_and_stays_nearly_white(factor: int) -> None:
    noise = np.random.default_rng(factor).standard_normal(200_000 * factor)
    found = thinned_samples(noise, factor)[20:-20]
    # the same density over a band that is so much narrower
    assert found.std() * np.sqrt(factor) == pytest.approx(1.0, abs=0.04)
    for lag in (1, 2, 3):
        assert np.mean(found[lag:] * found[:-lag]) / np.mean(found**2) == pytest.approx(0.0, abs=0.07)


def test_onset_and_release_are_those_of_the_thinned_record() -> None:
    """Counts of samples, and noise, mean the same whatever the recorder's rate is."""
    times_s = np.arange(40_003) / RATE_HZ
    pulse = np.where(times_s > 0.05, np.exp(-(times_s - 0.05) / 0.02) * (1.0 - np.exp(-(times_s - 0.05) / 1e-3)), 0.0)
    force = pulse + 2e-3 * np.random.default_rng(3).standard_normal(times_s.size)
    slower_s, slower = thinned_beside(times_s, force)
    assert slower_s.size == -(-times_s.size // thinning_factor(RATE_HZ)) < times_s.size
    onset_s = find_onset(times_s, {"breech_pressure": force})
    assert onset_s == find_onset(slower_s, {"breech_pressure": slower})
    released = release_index(times_s, force - 0.1, onset_s)
    assert times_s[released] == slower_s[release_index(slower_s, slower - 0.1, onset_s)]
    assert 0.05 < onset_s + 1e-3 < times_s[released] + 1e-3 < 0.06


def test_what_is_slow_enough_is_left_as_it_is() -> None:
    times_s, samples = np.arange(100) / 10e3, np.ones(100)
    assert thinned_beside(times_s, samples) == (times_s, samples)


@pytest.mark.parametrize("factor", [2, 4, 20])
def test_a_single_lost_sample_is_bridged_and_of_a_stretch_is_lost_what_lies_in_it(factor: int) -> None:
    samples = np.linspace(0.0, 1.0, 100 * factor)
    whole = thinned_samples(samples, factor)
    samples[[7 * factor, 20 * factor + 1]] = np.nan
    samples[40 * factor : 60 * factor + 1] = np.nan
    found = thinned_samples(samples, factor)
    lost = np.flatnonzero(np.isnan(found))
    assert set(range(41, 60)) <= set(lost) <= set(range(40, 61))
    there = ~np.isnan(found)
    np.testing.assert_allclose(found[there], whole[there], atol=1e-9)


def test_a_channel_of_which_nothing_is_there_stays_so() -> None:
    assert np.isnan(thinned_samples(np.full(10, np.nan), 4)).all()


def at_rate(rate_hz: float, *, jitter: float = 0.0) -> FiredShot:
    """Give every channel of a shot a rate, uniform or with stamps that are off by a share of a step."""
    fired = FiredShot(make_shot(), load_rig("mixed"))

    def base(old: TimeBase) -> TimeBase:
        if not jitter:
            return TimeBase.uniform(old.clock, old.start_s, 1.0 / rate_hz, old.count)
        off = jitter * (np.arange(old.count) % 2)
        return TimeBase.stamped(old.clock, old.start_s + (np.arange(old.count) + off) / rate_hz)

    channels = {name: replace(one, time_base=base(one.time_base)) for name, one in fired.shot.channels.items()}
    return replace(fired, shot=replace(fired.shot, channels=channels))


@pytest.mark.parametrize(
    ("rate_hz", "factor"), [(THINNED_ABOVE_HZ, 1), (102.4e3, 5), (199.99e3, 10), (200e3, 10), (250e3, 12), (1e6, 50)]
)
def test_only_what_is_faster_than_the_limit_is_thinned_and_never_below_the_rate(rate_hz: float, factor: int) -> None:
    fired = at_rate(rate_hz)
    found, names = thinned(fired)
    assert (found is fired) == (factor == 1)
    assert names == (() if factor == 1 else tuple(fired.shot.channels))
    for name, channel in found.shot.channels.items():
        before = fired.shot.channels[name]
        assert channel.time_base.rate_hz == pytest.approx(rate_hz / factor)
        assert channel.time_base.rate_hz > 0.99 * THINNED_TO_HZ
        np.testing.assert_allclose(channel.time_base.times_s, before.time_base.times_s[::factor], rtol=1e-12)
    assert thinned(found)[1] == ()


@pytest.mark.parametrize(
    "align",
    [TriggerAlignment(method="trigger", channel="p_breech"), ExposureAlignment(method="exposure", channel="p_breech")],
)
def test_a_line_whose_edges_align_a_clock_keeps_every_sample(align: TriggerAlignment | ExposureAlignment) -> None:
    fired = at_rate(200e3)
    sources = tuple(
        one.model_copy(update={"align": align}) if one.kind == "camera" else one for one in fired.rig.sources
    )
    found, names = thinned(replace(fired, rig=replace(fired.rig, sources=sources)))
    assert "p_breech" not in names
    assert found.shot.channels["p_breech"] is fired.shot.channels["p_breech"]
    assert "acc_recoil" in names


def test_what_a_body_on_a_line_does_is_not_thinned() -> None:
    fired = replace(at_rate(200e3), rig=load_rig("sled"))
    assert thinned(fired) == (fired, ())


def test_stamps_in_bursts_are_no_fast_record() -> None:
    """Of a bus at 1 kHz that hands over four frames at once."""
    times_s = (np.arange(4000) // 4) * 4e-3 + (np.arange(4000) % 4) * 1e-6
    assert factor_of(times_s) == 1


@pytest.mark.parametrize(("jitter", "is_thinned"), [(0.1, True), (0.8, False)])
def test_stamps_that_are_no_even_series_are_left_alone(jitter: float, is_thinned: bool) -> None:
    fired = at_rate(200e3, jitter=jitter)
    found, names = thinned(fired)
    assert bool(names) == is_thinned
    for name in ("p_breech", "acc_recoil") if is_thinned else ():
        before = fired.shot.channels[name].time_base.times_s
        np.testing.assert_array_equal(found.shot.channels[name].time_base.times_s, before[::10])
