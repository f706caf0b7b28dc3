"""A shift of the zero is found with the force, only where it is earned, and never by a high-pass."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.repair import Repaired
from processing.shifted_zero import STEP, ZeroShift
from processing.zero_shift import FALSE_ALARM, MARGIN, fit_zero_shift, zero_shift_columns
from tests.builders.faulty_records import ShiftedRecord, high_passed, shifted_record
from tests.builders.ringing import MASS_KG, PULSE_M_S2

TABLE = [(0.01, 0.0, 1.0), (0.03, 0.0, 1.0), (0.0, 0.03, 0.05), (0.0, 0.05, 0.02)]
"""Step, decaying part, time constant: shares of the pulse and seconds."""
SEEDS = range(100, 106)


def found(record: ShiftedRecord) -> ZeroShift:
    return fit_zero_shift(record.recorded_m_s2, record.force_n, record.times_s, 0.0)


@pytest.mark.parametrize(("step", "decaying", "tau_s"), TABLE)
def test_the_velocity_is_right_behind_a_shift(step, decaying, tau_s):
    errors = []
    for seed in SEEDS:
        record = shifted_record(seed, step=step, decaying=decaying, time_constant_s=tau_s)
        shift = found(record)
        assert shift.earned
        assert "the zero shifted by" in shift.reason
        zero = shift.level_m_s2 + shift.shift_m_s2(record.times_s)
        errors.append([record.velocity_error(zero, t) for t in (0.085, 0.44)])
        for error, u in zip(errors[-1], shift.u_velocity_m_s(np.array([0.085, 0.44])), strict=True):
            assert error < 4 * u / np.abs(record.velocity_m_s).max()
    mean = np.mean(errors, axis=0)
    assert mean[0] < 0.006
    assert mean[1] < 0.010


@pytest.mark.parametrize(("step", "decaying", "tau_s"), [(0.0, 0.0, 1.0), *TABLE])
def test_a_high_pass_takes_the_recoil_with_the_shift(step, decaying, tau_s):
    """Even without a shift: 2 Hz have a time constant of 80 ms, as long as the recoil."""
    record = shifted_record(100, step=step, decaying=decaying, time_constant_s=tau_s)
    error = record.velocity_error(record.recorded_m_s2 - high_passed(record.recorded_m_s2), 0.085)
    assert 0.15 < error < 0.35
    shift = found(record)
    assert record.velocity_error(shift.level_m_s2 + shift.shift_m_s2(record.times_s), 0.085) < 0.1 * error


def test_a_shift_that_is_not_there_is_not_earned():
    """Ringing twice as high as the pulse and 0.5 % of noise on the force."""
    shifts = [found(shifted_record(seed)) for seed in range(30)]
    assert sum(shift.earned for shift in shifts) <= 1
    none = next(shift for shift in shifts if not shift.earned)
    assert none.step_m_s2 == none.decaying_m_s2 == 0
    assert math.isinf(none.time_constant_s)
    assert none.bic_difference <= MARGIN or none.p_value >= FALSE_ALARM
    assert none.reason.startswith("no shift of the zero is earned")


def test_where_none_is_earned_the_record_comes_back_bit_for_bit():
    record = shifted_record(3)
    samples, repairs = found(record).repair(record.recorded_m_s2, record.times_s)
    assert samples.tobytes() == record.recorded_m_s2.tobytes()
    assert repairs == ()


def test_the_repair_touches_what_is_behind_the_onset_only():
    record = shifted_record(4, step=0.02)
    samples, repairs = found(record).repair(record.recorded_m_s2, record.times_s)
    done = Repaired(record.recorded_m_s2).then(samples, *repairs)
    assert done.repairs[0].kind == "zero shift fitted"
    assert np.array_equal(done.repairs[0].flags, record.times_s >= 0)
    assert done.repairs[0].figures["step_m_s2"] == pytest.approx(0.02 * PULSE_M_S2, rel=0.1)
    assert not done.unmeasured.any()


def test_the_uncertainty_covers_the_step():
    off = []
    for seed in range(20):
        shift = found(shifted_record(seed, step=0.03))
        if shift.u_decaying_m_s2 == 0:
            off.append((shift.step_m_s2 - 0.03 * PULSE_M_S2) / shift.u_step_m_s2)
    assert len(off) > 14
    assert 0.6 < np.std(off) < 1.6
    assert shift.covariance[STEP, STEP] == pytest.approx(shift.u_step_m_s2**2)


def test_residuals_that_hang_together_count_for_fewer_rows():
    record = shifted_record(5)
    rng = np.random.default_rng(6)
    wander = np.interp(record.times_s, np.linspace(-0.04, 0.46, 60), rng.normal(0.0, 30.0, 60))
    drifting = fit_zero_shift(record.recorded_m_s2 + wander, record.force_n, record.times_s, 0.0)
    assert drifting.effective_rows < 0.5 * drifting.rows
    assert found(record).effective_rows > 0.7 * drifting.rows


def test_lost_samples_and_what_is_not_used_are_left_out():
    record = shifted_record(7, step=0.03)
    acceleration = record.recorded_m_s2.copy()
    acceleration[10_000:10_200] = np.nan
    knocked = record.times_s > 0.4
    acceleration[knocked] += 500.0
    shift = fit_zero_shift(acceleration, record.force_n, record.times_s, 0.0, used=record.times_s < 0.39)
    assert shift.step_m_s2 == pytest.approx(0.03 * PULSE_M_S2, rel=0.1)
    assert 1 / shift.inverse_mass_per_kg == pytest.approx(MASS_KG, rel=0.01)


@settings(max_examples=8)
@given(st.integers(-20, 20), st.floats(-100.0, 100.0))
def test_units_and_the_origin_of_time_do_not_matter(exponent, start_s):
    record = shifted_record(8, decaying=0.04, time_constant_s=0.04)
    factor = 2.0**exponent
    one = found(record)
    other = fit_zero_shift(factor * record.recorded_m_s2, record.force_n, record.times_s + start_s, start_s)
    assert other.decaying_m_s2 == pytest.approx(factor * one.decaying_m_s2, rel=0.02)
    assert other.time_constant_s == one.time_constant_s
    assert other.f_statistic == pytest.approx(one.f_statistic, rel=0.05)


def test_columns_are_released_at_the_onset():
    times = np.array([-1.0, -1e-9, 0.0, 0.02, 0.04])
    columns = zero_shift_columns(times, 0.0, (0.02,))
    assert columns.tolist() == [[0, 0], [0, 0], [1, 1], [1, math.exp(-1)], [1, math.exp(-2)]]
    with pytest.raises(ValueError, match="time constants must be positive"):
        zero_shift_columns(times, 0.0, (0.0,))


def test_what_no_shift_can_be_told_from_is_refused():
    record = shifted_record(9)
    with pytest.raises(ValueError, match="times and both records must be equally many"):
        fit_zero_shift(record.recorded_m_s2[1:], record.force_n, record.times_s, 0.0)
    with pytest.raises(ValueError, match="times_s must be even"):
        fit_zero_shift(record.recorded_m_s2, record.force_n, np.sort(record.times_s**3), 0.0)
    with pytest.raises(ValueError, match="0 independent rows before the onset"):
        fit_zero_shift(record.recorded_m_s2, record.force_n, record.times_s, -1.0)
