from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.uncertainty import contributions, corrected_mass, note_on_cutoff, other_cutoffs
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.rows.causes import SKEW, causes_of, moving_zero
from recoil_processing.filters import LowPass
from recoil_processing.shot.gauge_zero import zero_moves
from recoil_processing.shot.regression import LEAST_ROWS, Regression, spaced_rows
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_rig, bench_shot, bench_signals
from tests.builders.calibrations import a_calibration

LOW_PASS = LowPass(300.0)
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


def rows_of(shot: Shot, record: Shot | None = None) -> dict[str, BudgetRow]:
    """State the contributions of a shot, whose clocks are of it and whose signals are of the bench shot or another."""
    record = record or bench_shot()
    recorded = bench_regression(record)
    filtered = recorded.filtered(LOW_PASS)
    causes = causes_of(filtered, recorded, bench_signals(record), FiredShot(shot, bench_rig()))
    return {row.source: row for row in contributions(filtered, causes)}


def mass_kg(recorded: Regression) -> float:
    """Regress acceleration on force behind the low-pass, written out."""
    filtered = recorded.filtered(LOW_PASS)
    at = spaced_rows(filtered)
    acceleration, force = filtered.acceleration_m_s2[at], filtered.force_n[at]
    return 1.0 / np.linalg.lstsq(force[:, np.newaxis], acceleration, rcond=None)[0][0]


def late_kg(*names: str) -> float:
    """Half the difference of the masses of a shot whose channels are late and early."""
    motion = bench_motion()
    whole = {"acc": motion.acceleration_m_s2, "p_breech": motion.breech_pa, "p_brake": motion.brake_pa}

    def late(by_s: float) -> float:
        moved = {n: np.interp(motion.times_s - by_s, motion.times_s, whole[n]) for n in names}
        return mass_kg(bench_regression(bench_shot(**moved)))

    return (late(U_CLOCK_S) - late(-U_CLOCK_S)) / 2


@pytest.mark.parametrize("name", ["p_breech", "p_brake", "acc"])
def test_a_clocks_row_is_what_a_record_that_is_late_does_to_the_mass(name):
    row = rows_of(on_a_bus(name))["alignment of clock bus"]
    # a shift of a record also moves the release that is found from it
    assert row.u_kg == pytest.approx(abs(late_kg(name)), rel=0.1)
    assert row.u_kg > 0.02


def test_a_clock_that_all_share_does_no_harm_and_the_reference_has_none():
    everything = rows_of(on_a_bus(*bench_shot().channels))["alignment of clock bus"]
    alone = rows_of(on_a_bus("acc"))["alignment of clock bus"]
    assert everything.u_kg < 0.1 * alone.u_kg
    assert not any(source.startswith("alignment") for source in rows_of(bench_shot()))


@pytest.mark.parametrize("source", ["brake_pressure zero", moving_zero("brake_pressure", 0.03)])
def test_a_zeros_row_is_what_a_gauge_that_reads_so_much_higher_does_to_the_mass(source):
    motion, rng = bench_motion(), np.random.default_rng(1)
    noisy = bench_shot(p_brake=motion.brake_pa + rng.normal(0.0, 1e6, motion.times_s.size))
    recorded, row = bench_regression(noisy), rows_of(noisy, noisy)[source]
    shape = recorded.released
    if source != "brake_pressure zero":
        shape = zero_moves(recorded.times_s, recorded.interval_s[0])[:, 1]

    def moved(sign: float) -> float:
        forces = recorded.forces_n.copy()
        forces[:, 1] -= sign * row.u_source * bench_rig().mechanism.brake_area * shape
        return mass_kg(replace(recorded, forces_n=forces))

    assert row.sensitivity is not None
    assert row.sensitivity * row.u_source == pytest.approx((moved(1.0) - moved(-1.0)) / 2, rel=0.02)


def test_an_acceleration_that_is_late_has_a_row():
    row = rows_of(bench_shot())[SKEW]
    assert row.sensitivity is not None
    assert row.sensitivity * U_CLOCK_S == pytest.approx(late_kg("acc"), rel=0.1)


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


def test_a_cutoff_that_leaves_no_row_between_lost_samples_is_said_to_tell_nothing():
    recorded = bench_regression()
    acceleration = recorded.acceleration_m_s2.copy()
    # a lower cut-off reaches farther, and leaves nothing between these
    acceleration[:: 2 * LowPass(210.0).reach_samples(recorded.rate_hz)] = np.nan
    spoilt = replace(recorded, acceleration_m_s2=acceleration)
    assert spaced_rows(spoilt.filtered(LowPass(300.0))).size >= LEAST_ROWS
    note = note_on_cutoff(spoilt, spoilt.filtered(LowPass(300.0)), calibration())
    assert note is not None
    assert "a cut-off of 210 Hz would move the mass cannot be told" in note


def test_the_corrected_mass_takes_the_sensors_errors_off():
    filtered = bench_regression().filtered(LowPass(300.0))
    assert corrected_mass(filtered, calibration(acceleration=0.01)) == pytest.approx(1.01 * MASS_KG, rel=1e-4)
    # the breech reads 2 % high: without it the part is lighter
    assert corrected_mass(filtered, calibration(breech=0.02)) < 0.995 * MASS_KG
