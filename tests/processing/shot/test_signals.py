from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.shot.onset import find_onset
from recoil_processing.shot.signals import at_instants, collect_signals, on_grid
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import ELEVATION_RAD, FIRE_S, bench_motion, bench_rig, bench_shot, bench_signals
from tests.builders.virtual_shots import virtual_shot

GRID = 1e-3 * np.arange(200)


def channel(times_s: np.ndarray, samples: np.ndarray) -> Channel:
    return Channel("c", "pressure", samples, TimeBase.stamped("bus", times_s))


def aligned(offset_s: float, drift: float = 0.0) -> ClockAlignment:
    return ClockAlignment("bus", offset_s, 1e-6, drift, 1e-6, "ok", "fixed")


# ---- on_grid


@given(offset=st.floats(-0.05, 0.05), drift=st.floats(-1e-3, 1e-3))
@settings(max_examples=30, deadline=None)
def test_a_channel_on_the_grid_is_the_signal_at_the_time_on_the_reference_clock(offset, drift):
    stamps = np.arange(-0.1, 0.35, 4e-4)
    samples = np.sin(40 * ((1 + drift) * stamps + offset))
    values = on_grid(channel(stamps, samples), aligned(offset, drift), GRID)
    np.testing.assert_allclose(values, np.sin(40 * GRID), atol=1e-6)


def test_beyond_the_record_there_is_nothing():
    stamps = np.arange(0.02, 0.1, 1e-3) + 1e-4
    values = on_grid(channel(stamps, np.ones(stamps.size)), None, GRID)
    assert np.isnan(values[stamps[0] > GRID]).all()
    assert np.isnan(values[stamps[-1] < GRID]).all()
    assert np.isfinite(values[(stamps[0] < GRID) & (stamps[-1] > GRID)]).all()


def test_one_lost_sample_is_interpolated_and_a_longer_gap_is_not():
    stamps = np.arange(0.0, 0.2, 1e-3) + 3e-4
    samples = np.cos(20 * stamps)
    samples[50] = np.nan
    samples[100:104] = np.nan
    values = on_grid(channel(stamps, samples), None, GRID)
    missing = np.flatnonzero(np.isnan(values[1:]))
    assert (GRID[missing + 1] > stamps[99]).all()
    assert (GRID[missing + 1] < stamps[104]).all()
    assert missing.size == 5
    assert values[51] == pytest.approx(math.cos(20 * GRID[51]), abs=1e-6)


def test_samples_at_the_grids_instants_are_taken_as_they_are_with_their_losses():
    samples = np.linspace(0.0, 1.0, GRID.size)
    samples[7] = np.nan
    np.testing.assert_array_equal(on_grid(channel(GRID, samples), None, GRID), samples)


def test_a_channel_with_hardly_a_sample_gives_nothing_at_all():
    samples = np.full(100, np.nan)
    samples[[3, 50]] = 1.0
    assert np.isnan(on_grid(channel(1e-3 * np.arange(100) + 2e-4, samples), None, GRID)).all()


def test_a_delay_is_taken_off_the_stamps_and_no_delay_changes_nothing():
    shot, rig = bench_shot(), bench_rig(acc="delay_s = 5e-4")
    late, prompt = shot.channels["acc"], shot.channels["p_brake"]
    assert at_instants(prompt, FiredShot(shot, rig)) is prompt
    moved = at_instants(late, FiredShot(shot, rig)).time_base.times_s
    np.testing.assert_allclose(moved, late.time_base.times_s - 5e-4, rtol=0, atol=1e-15)


# ---- static values and offsets


def test_at_rest_accelerometers_feel_gravity_and_the_recuperator_is_not_known():
    mechanism = replace(bench_rig().mechanism, phi10=0.1)
    g = mechanism.g
    assert mechanism.at_rest.get("recoil_acceleration") == pytest.approx(-g * math.sin(ELEVATION_RAD))
    x, y = (mechanism.at_rest.get(f"carriage_acceleration_{axis}") for axis in "xy")
    assert (x, y) == pytest.approx((g * math.sin(0.1), g * math.cos(0.1)))
    assert mechanism.at_rest.get("brake_pressure") == 0.0
    assert mechanism.at_rest.get("recuperator_pressure") is None


def test_offsets_are_taken_off_with_the_uncertainty_of_the_baselines_mean():
    motion = bench_motion()
    noise = np.random.default_rng(1).normal(0.0, 2.0, motion.times_s.size)
    signals = bench_signals(bench_shot(acc=motion.acceleration_m_s2 + 7.0 + noise, p_brake=motion.brake_pa - 3e4))
    silent = motion.times_s < signals.baseline_s[1]
    offset = signals.offsets["recoil_acceleration"]
    assert offset.value == pytest.approx(7.0 + noise[silent].mean(), abs=1e-12)
    assert offset.u == pytest.approx(noise[silent].std() / math.sqrt(silent.sum()))
    assert offset.noise == pytest.approx(2.0, rel=0.15)
    np.testing.assert_allclose(signals.series["brake_pressure"], motion.brake_pa, atol=1e-6)
    np.testing.assert_array_equal(signals.series["recuperator_pressure"], motion.recuperator_pa)


def test_without_a_baseline_nothing_is_taken_off_and_the_zeros_are_unknown():
    motion = bench_motion()
    first = np.searchsorted(motion.times_s, FIRE_S - 2e-3)
    late = {
        "acc": motion.acceleration_m_s2,
        "p_breech": motion.breech_pa,
        "p_brake": motion.brake_pa,
        "p_recuperator": motion.recuperator_pa,
    }
    shot = bench_shot()
    base = TimeBase.uniform("recorder", float(motion.times_s[first]), 5e-5, motion.times_s.size - first)
    channels = {n: replace(c, samples=late[n][first:], time_base=base) for n, c in shot.channels.items()}
    signals = bench_signals(replace(shot, channels=channels))
    assert signals.baseline_s[0] == signals.baseline_s[1]
    assert signals.offsets["recoil_acceleration"].u == math.inf
    np.testing.assert_array_equal(signals.series["recoil_acceleration"], motion.acceleration_m_s2[first:])


@pytest.mark.parametrize("gap", [slice(0, 0), slice(760, 800)])
def test_the_droop_of_a_piezoelectric_chain_is_restored(gap):
    motion = bench_motion()
    constant_s = 0.05
    # y' = u' - y / T from rest: exact over a step in which u is linear
    u, step = motion.acceleration_m_s2 - motion.acceleration_m_s2[0], 5e-5
    decay = math.exp(-step / constant_s)
    y = np.zeros_like(u)
    for k in range(1, u.size):
        y[k] = decay * y[k - 1] + (u[k] - u[k - 1]) * (1 - decay) * constant_s / step
    assert np.abs(y - u).max() > 0.1 * u.max()
    lossy = y + 12.0
    lossy[gap] = np.nan
    rig = bench_rig(acc=f"time_constant_s = {constant_s}")
    restored = bench_signals(bench_shot(acc=lossy), rig).series["recoil_acceleration"]
    seen = np.isfinite(lossy)
    assert np.isnan(restored[~seen]).all()
    assert np.abs(restored - motion.acceleration_m_s2)[seen].max() < 1e-3 * motion.acceleration_m_s2.max()


# ---- onset


def test_the_onset_is_the_last_sample_at_rest_before_the_force():
    motion = bench_motion()
    noise = np.random.default_rng(2).normal(0.0, 1e5, motion.times_s.size)
    onset = find_onset(motion.times_s, {"breech_pressure": motion.breech_pa + noise})
    assert onset == pytest.approx(FIRE_S, abs=3e-4)
    assert find_onset(motion.times_s, {"recoil_acceleration": motion.acceleration_m_s2}) == pytest.approx(
        motion.times_s[motion.release], abs=1e-4
    )


def test_a_spark_before_the_shot_is_no_onset():
    motion = bench_motion()
    pressure = motion.breech_pa.copy()
    pressure[200:202] = 2e7
    assert find_onset(motion.times_s, {"breech_pressure": pressure}) == pytest.approx(FIRE_S, abs=2e-4)


def test_an_onset_is_found_although_the_channels_record_begins_late_and_has_losses():
    motion = bench_motion()
    pressure = motion.breech_pa + np.random.default_rng(3).normal(0.0, 1e4, motion.times_s.size)
    pressure[: motion.times_s.size // 10] = np.nan
    pressure[500:520] = np.nan
    assert find_onset(motion.times_s, {"breech_pressure": pressure}) == pytest.approx(FIRE_S, abs=2e-4)


@pytest.mark.parametrize(
    ("pressure", "message"),
    [
        (np.random.default_rng(4).normal(0.0, 1e5, 4000), "breech_pressure shows no shot"),
        (np.zeros(4000), "breech_pressure shows no shot"),
        (np.full(4000, np.nan), "breech_pressure has 0 samples"),
    ],
)
def test_a_record_without_a_shot_is_refused_with_what_to_do(pressure, message):
    with pytest.raises(IdentificationError, match=message) as caught:
        find_onset(5e-5 * np.arange(4000), {"breech_pressure": pressure})
    assert caught.value.remedy


# ---- the grid


def test_without_a_carrier_on_the_reference_clock_there_is_no_grid():
    shot = bench_shot()
    elsewhere = {
        n: replace(c, time_base=replace(c.time_base, clock="bus")) if n in ("acc", "p_breech") else c
        for n, c in shot.channels.items()
    }
    with pytest.raises(IdentificationError, match="nothing to build the regression's grid on") as caught:
        collect_signals(FiredShot(replace(shot, channels=elsewhere), bench_rig()), {})
    assert "recoil_acceleration on bus" in str(caught.value)


def test_a_record_of_a_few_samples_is_refused():
    shot = bench_shot()
    short = {
        n: replace(c, samples=c.samples[:3], time_base=TimeBase.uniform("recorder", 0.0, 5e-5, 3))
        for n, c in shot.channels.items()
    }
    with pytest.raises(IdentificationError, match="acc has 3 samples"):
        collect_signals(FiredShot(replace(shot, channels=short), bench_rig()), {})


def test_a_channel_whose_clock_failed_is_left_out():
    virtual = virtual_shot("mixed")
    alignments = {a.clock: a for a in virtual.shot.alignments}
    alignments["can"] = replace(alignments["can"], status="failed")
    del alignments["imu"]
    series = collect_signals(FiredShot(virtual.shot, virtual.rig), alignments).series
    assert "brake_pressure" not in series
    assert "tipping_rate" not in series
    assert "breech_pressure" in series


def test_the_signals_of_all_clocks_are_those_of_the_motion():
    virtual = virtual_shot("mixed")
    signals = collect_signals(FiredShot(virtual.shot, virtual.rig), {a.clock: a for a in virtual.shot.alignments})
    assert signals.onset_s == pytest.approx(virtual.truth["t_fire"], abs=1e-3)
    assert signals.rate_hz == pytest.approx(25_000.0)
    assert {s.size for s in signals.series.values()} == {signals.times_s.size}
    # the brake's pressure, by the bus, has its peak where the recorder's clock has the largest travel velocity
    peak = signals.times_s[np.nanargmax(signals.series["brake_pressure"])]
    assert virtual.truth["t_fire"] + 5e-3 < peak < virtual.truth["t_end"]
    np.testing.assert_array_equal(signals.get("no such role", 3.0), np.full(signals.times_s.size, 3.0))
