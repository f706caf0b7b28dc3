from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot import ClockAlignment, Shot
from recoil_identification.calibration import Calibration
from recoil_identification.mass import MassEstimate
from recoil_identification.uncertainty import (
    clock_contributions,
    corrected_mass,
    further_contributions,
    note_on_cutoff,
    other_cutoffs,
    zero_contributions,
)
from recoil_processing.filters import LowPass
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_rig, bench_shot, bench_signals
from tests.builders.calibrations import a_calibration

U_CLOCK_S = 2e-4


def calibration(**errors: float) -> Calibration:
    estimate = MassEstimate("calibrated", MASS_KG, (), 10, 0.0)
    return a_calibration(
        estimate, gauges=(errors.get("breech", 0.0), 0.0, 0.0), acceleration=errors.get("acceleration", 0.0)
    )


def on_a_bus(*names: str) -> Shot:
    """Say that some channels of the bench shot hang on another clock."""
    shot = bench_shot()
    channels = dict(shot.channels)
    for n in names:
        channels[n] = replace(channels[n], time_base=replace(channels[n].time_base, clock="bus"))
    bus = ClockAlignment("bus", 0.0, U_CLOCK_S, 0.0, 0.0, "ok", "fixed")
    return replace(shot, channels=channels, alignments=(bus,))


def shifted_mass(**shift_s: float) -> float:
    """Mass of a shot whose channels are late."""
    motion = bench_motion()
    whole = {"acc": motion.acceleration_m_s2, "p_breech": motion.breech_pa, "p_brake": motion.brake_pa}
    late = {n: np.interp(motion.times_s - s, motion.times_s, whole[n]) for n, s in shift_s.items()}
    return corrected_mass(bench_regression(bench_shot(**late)).filtered(LowPass(300.0)), calibration())


@pytest.mark.parametrize("name", ["p_breech", "p_brake", "acc"])
def test_a_clocks_uncertainty_counts_for_what_hangs_on_it(name):
    filtered = bench_regression().filtered(LowPass(300.0))
    (row,) = clock_contributions(filtered, calibration(), on_a_bus(name), "recoil_acceleration")
    expected = max(abs(shifted_mass(**{name: sign * U_CLOCK_S}) - MASS_KG) for sign in (1, -1))
    assert row.source == "alignment of clock bus"
    # a shift of a record also moves the release that is found from it
    assert row.u_kg == pytest.approx(expected, rel=0.25)
    assert row.u_kg > 0.05


def test_a_clock_that_all_share_does_no_harm_and_the_reference_has_none():
    filtered = bench_regression().filtered(LowPass(300.0))
    names = list(bench_shot().channels)
    (row,) = clock_contributions(filtered, calibration(), on_a_bus(*names), "recoil_acceleration")
    (alone,) = clock_contributions(filtered, calibration(), on_a_bus("acc"), "recoil_acceleration")
    assert row.u_kg < 0.1 * alone.u_kg
    assert clock_contributions(filtered, calibration(), bench_shot(), "recoil_acceleration") == []


def test_the_zeros_of_the_gauges_count_by_the_noise_of_the_baseline():
    motion, rng = bench_motion(), np.random.default_rng(1)
    shot = bench_shot(p_brake=motion.brake_pa + rng.normal(0.0, 1e6, motion.times_s.size))
    signals = bench_signals(shot)
    filtered = bench_regression(shot).filtered(LowPass(300.0))
    rows = {r.source: r.u_kg for r in zero_contributions(filtered, calibration(), signals, bench_rig())}
    u_pa = signals.offsets["brake_pressure"].u
    forces = filtered.forces_n.copy()
    forces[:, 1] += u_pa * 0.0056 * filtered.released
    expected = corrected_mass(replace(filtered, forces_n=forces), calibration())
    assert rows["brake_pressure zero"] == pytest.approx(abs(expected - corrected_mass(filtered, calibration())))
    assert "recuperator_pressure zero" not in rows  # its pressure at rest is not known to be zero


def test_cutoffs_that_the_grid_cannot_carry_are_not_tried():
    assert [f.cutoff_hz for f in other_cutoffs(LowPass(300.0), 20_000.0)] == pytest.approx([210.0, 420.0])
    assert [f.cutoff_hz for f in other_cutoffs(LowPass(300.0), 800.0)] == pytest.approx([210.0])


def test_a_cutoff_that_moves_the_mass_by_more_than_noise_does_is_a_note():
    recorded = bench_regression()
    filtered = recorded.filtered(LowPass(300.0))
    assert note_on_cutoff(recorded, filtered, calibration()) is None
    assert note_on_cutoff(recorded, recorded, calibration()) is None
    # a wave between the cut-offs that goes with the force
    pulse = np.exp(-(((recorded.times_s - 0.034) / 2e-3) ** 2)) * np.cos(2 * np.pi * 350.0 * (recorded.times_s - 0.034))
    waving = replace(recorded, acceleration_m_s2=recorded.acceleration_m_s2 + 2e3 * pulse)
    note = note_on_cutoff(waving, waving.filtered(LowPass(300.0)), calibration())
    assert note is not None
    assert "cut-off of 210 Hz would move the mass by" in note


def test_the_corrected_mass_takes_the_sensors_errors_off():
    filtered = bench_regression().filtered(LowPass(300.0))
    assert corrected_mass(filtered, calibration(acceleration=0.01)) == pytest.approx(1.01 * MASS_KG, rel=1e-4)
    # the breech reads 2 % high: without it the part is lighter
    assert corrected_mass(filtered, calibration(breech=0.02)) < 0.995 * MASS_KG


def test_all_contributions_of_a_sound_shot_are_finite_and_named_once():
    filtered = bench_regression().filtered(LowPass(300.0))
    rows = further_contributions(filtered, calibration(), bench_signals(), on_a_bus("p_brake"), bench_rig())
    assert all(math.isfinite(r.u_kg) and r.u_kg >= 0 for r in rows)
    assert len({r.source for r in rows}) == len(rows)
    assert "alignment of clock bus" in {r.source for r in rows}
