"""Clipped tips of waves are repaired, clipped pulses refused, and both are told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import LowPass
from recoil_processing.quality.clipping_checks import check_clipping
from recoil_processing.repairs.autoregressive import MOST_ORDER
from recoil_processing.repairs.clipping import END_SHARE, LARGEST_PEAK, ClippingRepair, find_clipped, repair_clipping
from recoil_processing.repairs.repair import Repaired, changed
from tests.builders.faulty_records import FULL_SCALE_G, twin_record
from tests.builders.ringing import MASS_KG, PULSE_M_S2, RATE_HZ, RingingRecord, ringing_record
from tests.builders.shared_data import shared_file

LOW_PASS = LowPass(450.0)


def sine(amplitude: float, period: float = 40.0, count: int = 1200) -> np.ndarray:
    t = np.arange(count)
    return np.asarray(amplitude * np.sin(2 * np.pi * t / period) * np.exp(-t / 2000.0))


def repaired_ringing(record: RingingRecord, level: float) -> ClippingRepair:
    limit = level * PULSE_M_S2
    return repair_clipping(np.clip(record.recorded_m_s2, -limit, limit), -limit, limit, unit="m/s^2")


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_a_record_within_its_range_comes_back_bit_for_bit(seed):
    samples = np.random.default_rng(seed).normal(0.0, 1.0, 500)
    samples[:3] = np.nan
    found = repair_clipping(samples, -10.0, 10.0)
    assert found.samples.tobytes() == samples.tobytes()
    assert found.runs == ()
    assert found.repairs == ()
    assert not found.u.any()


@pytest.mark.exhaustive
@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1), st.floats(0.6, 0.98))
def test_only_flagged_samples_are_touched_and_none_lies_inside_its_clip_level(seed, share):
    samples = sine(1.0, 40.0) + 0.01 * np.random.default_rng(seed).standard_normal(1200)
    limit = share * float(np.abs(samples).max())
    clipped = np.clip(samples, -limit, limit)
    found = repair_clipping(clipped, -limit, limit)
    flags = find_clipped(clipped, -limit, limit).flags
    touched = np.zeros(1200, dtype=bool)
    for repair in found.repairs:
        touched |= repair.flags
    assert np.array_equal(touched, flags)
    Repaired(clipped).then(found.samples, *found.repairs)
    there = flags & np.isfinite(found.samples)
    assert np.all(np.abs(found.samples[there]) >= np.abs(clipped[there]) * (1 - 1e-9))
    assert np.all(np.abs(found.samples[there]) <= LARGEST_PEAK * limit * (1 + 1e-9))


@pytest.mark.exhaustive
@settings(max_examples=10)
@given(st.integers(-30, 30), st.sampled_from([-1.0, 1.0]))
def test_units_and_sign_do_not_matter(exponent, sign):
    factor = sign * 2.0**exponent
    clipped = np.clip(sine(1.1), -1.0, 1.0)
    one = repair_clipping(clipped, -1.0, 1.0)
    other = repair_clipping(factor * clipped, -abs(factor), abs(factor))
    assert np.allclose(other.samples / factor, one.samples, rtol=1e-6, atol=1e-6, equal_nan=True)
    assert [bool(run.refusal) for run in other.runs] == [bool(run.refusal) for run in one.runs]


def test_tips_of_a_wave_are_found_again():
    truth = sine(1.1)
    found = repair_clipping(np.clip(truth, -1.0, 1.0), -1.0, 1.0, unit="Pa")
    assert not any(run.refusal for run in found.runs)
    assert np.max(np.abs(found.samples - truth)) < 0.01
    (repair,) = found.repairs
    assert repair.kind == "clipped repaired"
    assert "no peak may be claimed from them" in repair.sentence
    assert repair.count == find_clipped(np.clip(truth, -1.0, 1.0), -1.0, 1.0).flags.sum()
    assert Repaired(truth).then(found.samples, repair).repairs == (repair,)


@pytest.mark.exhaustive
def test_a_run_of_a_quarter_of_its_wave_is_masked_and_says_so():
    found = repair_clipping(np.clip(sine(2.0), -1.0, 1.0), -1.0, 1.0, unit="Pa")
    early = [run for run in found.runs if run.start < 200]
    assert all("not less than a quarter of the wave's" in run.refusal for run in early)
    masked = next(r for r in found.repairs if r.kind == "clipped masked")
    assert np.isnan(found.samples[masked.flags]).all()
    assert "left out" in masked.sentence


def test_a_wave_that_would_reach_too_far_is_masked():
    t = np.arange(-300.0, 301.0)
    summit = 1.5 / (1.0 + (t / 25.0) ** 2)
    found = repair_clipping(np.minimum(summit, 1.0), -1.0, 1.0)
    (run,) = found.runs
    assert run.count < 0.25 * run.width
    assert run.peak > LARGEST_PEAK
    assert f"more than {LARGEST_PEAK:g}: too far beyond what was seen" in run.refusal
    assert np.isnan(found.samples[run.start : run.stop]).all()


def test_a_wave_that_the_record_cuts_tells_nothing():
    samples = np.minimum(1.05 * np.cos(np.arange(300) / 9.0), 1.0)
    first, second, *_ = repair_clipping(samples, -2.0, 1.0).runs
    assert "it begins or ends with the record, or in a gap" in first.refusal
    assert second.refusal == ""
    samples[second.stop] = np.nan
    assert "or in a gap" in repair_clipping(samples, -2.0, 1.0).runs[1].refusal


def test_a_run_that_goes_on_beyond_the_range_was_not_clipped_there():
    found = repair_clipping(sine(1.1), -1.0, 1.0)
    assert all("that range is wrong" in run.refusal for run in found.runs if run.count > 6)
    assert np.isnan(found.samples).any()


def test_a_sample_as_near_to_an_end_as_the_margin_is_clipped_and_one_that_is_farther_is_not():
    margin = END_SHARE * 20.0
    samples = np.array(
        [10.0, 10.0 - margin, 10.0 - 1.01 * margin, -10.0 + 1.01 * margin, -10.0 + margin, np.inf, np.nan]
    )
    found = find_clipped(samples, -10.0, 10.0)
    assert found.above.tolist() == [True, True, False, False, False, True, False]
    assert found.below.tolist() == [False, False, False, False, True, False, False]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_an_end_at_zero_only_what_lies_beyond_it_by_more_than_the_margin_is_clipped(side):
    margin = END_SHARE * 10.0
    samples = side * np.array([0.0, -margin, -1.01 * margin, 5.0, 10.0])
    found = find_clipped(samples, *sorted((0.0, side * 10.0)))
    beyond, end = (found.below, found.above) if side > 0 else (found.above, found.below)
    assert beyond.tolist() == [False, False, True, False, False]
    assert end.tolist() == [False, False, False, False, True]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_beyond_an_end_at_zero_what_was_read_stays_and_what_is_infinite_is_masked(side):
    samples = side * (2.0 + sine(1.0))
    samples[600], samples[700] = -side * 3.0, -side * np.inf
    found = repair_clipping(samples, *sorted((0.0, side * 10.0)))
    assert found.samples[600] == samples[600]
    (repair,) = found.repairs
    assert np.flatnonzero(repair.flags).tolist() == [700]


def test_below_a_range_that_begins_at_zero_a_gauge_still_reads():
    samples = np.maximum(sine(1.0), -0.2)
    found = repair_clipping(samples, 0.0, 5.0)
    assert found.samples.tobytes() == samples.tobytes()
    assert find_clipped(samples, 0.0, 5.0).below.any()


def test_the_check_counts_what_is_found_here():
    samples = np.clip(sine(1.3), -1.0, 1.0)
    count = int(find_clipped(samples, -1.0, 1.0).flags.sum())
    assert f"{count} samples" in check_clipping(samples, -1.0, 1.0, unit="Pa")[1]
    with pytest.raises(ValueError, match="a range needs low < high"):
        find_clipped(samples, 1.0, 1.0)


@pytest.mark.exhaustive
def test_a_record_that_is_clipped_throughout_is_refused_and_quickly():
    samples = np.clip(sine(1.05, 20.0, 20_000) * np.exp(np.arange(20_000) / 2000.0), -1.0, 1.0)
    found = repair_clipping(samples, -1.0, 1.0)
    assert all(run.refusal for run in found.runs)
    assert sum("too much is clipped to be estimated" in run.refusal for run in found.runs) > 100
    assert np.isnan(found.samples).sum() == find_clipped(samples, -1.0, 1.0).flags.sum()


@pytest.mark.exhaustive
def test_with_what_is_repaired_and_what_is_left_out_the_mass_is_right():
    """Ringing that is clipped at 1.5 times the pulse: as recorded the mass is high by 3 % and more in the mean."""
    biases, as_recorded = [], []
    for seed in range(100, 106):
        record = ringing_record(seed)
        found = repaired_ringing(record, 1.5)
        force = LOW_PASS.apply(record.force_n, RATE_HZ)
        a, trusted = LOW_PASS.apply_with_gaps(found.samples, RATE_HZ)
        used = trusted & (record.times_s > -5e-3) & (record.times_s < 0.12)
        biases.append(force[used] @ a[used] / (a[used] @ a[used]) / MASS_KG - 1)
        limit = 1.5 * PULSE_M_S2
        a = LOW_PASS.apply(np.clip(record.recorded_m_s2, -limit, limit), RATE_HZ)
        used = (record.times_s > -5e-3) & (record.times_s < 0.12)
        as_recorded.append(force[used] @ a[used] / (a[used] @ a[used]) / MASS_KG - 1)
    assert np.mean(as_recorded) > 0.02
    assert abs(np.mean(biases)) < 0.002
    assert np.max(np.abs(biases)) < 0.005


def test_tips_that_are_left_out_alone_bias_the_mass_more_than_clipped_ones():
    record = ringing_record(101)
    found = repaired_ringing(record, 1.5)
    there = np.isfinite(found.samples) & (record.times_s > -5e-3) & (record.times_s < 0.12)
    force, a = record.force_n[there], found.samples[there]
    assert force @ force / (force @ a) / MASS_KG - 1 > 0.04


@pytest.mark.parametrize(
    ("name", "count", "error"), [("4mps_sphere_1_event", 8, -0.035), ("6mps_150degcone_1_event", 4, -0.023)]
)
def test_the_impulse_of_a_real_clipped_impact_is_right_within_one_percent(name, count, error):
    twin = twin_record(shared_file(f"shock/{name}.npz"))
    found = repair_clipping(twin.clipped_g, -FULL_SCALE_G, FULL_SCALE_G, unit="g")
    (run,) = found.runs
    assert run.count == count
    assert run.refusal == ""
    assert twin.impulse_error(twin.clipped_g) == pytest.approx(error, abs=0.003)
    assert abs(twin.impulse_error(found.samples)) < 0.01
    assert not changed(twin.clipped_g, found.samples)[~found.repairs[0].flags].any()


@pytest.mark.parametrize("name", ["4mps_sphere_1_event", "6mps_150degcone_1_event"])
def test_a_real_pulse_that_is_clipped_at_two_thirds_is_refused(name):
    """As a 63 g impact on a 42 g range: 13 samples or so of a pulse of 35."""
    twin = twin_record(shared_file(f"shock/{name}.npz"))
    limit = twin.truth_g.max() / 1.5
    found = repair_clipping(np.minimum(twin.truth_g, limit), -limit, limit, unit="g")
    (run,) = found.runs
    assert run.count >= 8
    assert run.refusal
    assert np.isnan(found.samples[run.start : run.stop]).all()


def pulse() -> np.ndarray:
    """A lone pulse of 1.05 on a ripple, 600 samples."""
    t = np.arange(-300.0, 300.0)
    return np.asarray(1.05 * np.exp(-0.5 * (t / 25.0) ** 2) + 0.01 * np.sin(t) + 0.01 * np.sin(0.31 * t))


def repaired_tip(samples: np.ndarray, number: int = 0) -> bytes:
    """What one run of a record that is clipped at 1 is repaired by."""
    found = repair_clipping(samples, -2.0, 1.0)
    run = found.runs[number]
    assert run.refusal == ""
    return found.samples[run.start : run.stop].tobytes()


@pytest.mark.parametrize("step", [1, -1], ids=["behind it", "before it"])
def test_160_samples_beside_a_run_have_a_say_in_its_repair_and_none_beyond(step):
    samples = np.minimum(pulse(), 1.0)[::step]
    (run,) = repair_clipping(samples, -2.0, 1.0).runs
    last = run.stop + 159 if step > 0 else run.start - 160
    for index, has_a_say in ((last, True), (last + step, False)):
        other = samples.copy()
        other[index] += 0.1
        assert (repaired_tip(other) != repaired_tip(samples)) is has_a_say


@pytest.mark.parametrize(("between", "has_a_say"), [(319, True), (320, False)])
def test_runs_whose_surroundings_do_not_overlap_are_repaired_each_by_its_own(between, has_a_say):
    one = np.minimum(pulse(), 1.0)
    (run,) = repair_clipping(one, -2.0, 1.0).runs
    rest = between - (one.size - run.stop)
    samples = np.concatenate([one, one[run.start - rest :]])
    assert [r.start for r in repair_clipping(samples, -2.0, 1.0).runs] == [run.start, run.stop + between]
    other = samples.copy()
    other[run.start - 50] += 0.1
    assert (repaired_tip(other, 1) != repaired_tip(samples, 1)) is has_a_say


@pytest.mark.parametrize(("length", "has_a_say"), [(MOST_ORDER, True), (MOST_ORDER + 1, False)])
@pytest.mark.parametrize("filled", [np.nan, -2.0], ids=["a gap", "a plateau"])
@pytest.mark.parametrize("step", [1, -1], ids=["behind it", "before it"])
def test_what_lies_beyond_more_unknown_samples_than_the_model_has_coefficients_has_no_say(
    step, filled, length, has_a_say
):
    samples = np.minimum(pulse(), 1.0)
    samples[390 : 390 + length] = filled
    other = samples.copy()
    other[390 + length :] *= 1.5
    number = -1 if step < 0 else 0
    assert (repaired_tip(other[::step], number) != repaired_tip(samples[::step], number)) is has_a_say


@pytest.mark.exhaustive
@pytest.mark.parametrize(("lost", "refused"), [(250, False), (251, True)])
def test_a_piece_with_more_than_250_unknown_samples_is_not_estimated(lost, refused):
    samples = np.minimum(np.tile(pulse()[180:420], 6), 1.0)
    unknown = int(find_clipped(samples, -2.0, 1.0).above.sum())
    troughs = np.flatnonzero(np.abs(samples) < 0.03)
    samples[troughs[:: troughs.size // (lost - unknown)][: lost - unknown]] = np.nan
    assert np.isnan(samples).sum() + unknown == lost
    found = repair_clipping(samples, -2.0, 1.0)
    assert ["too much is clipped" in run.refusal for run in found.runs] == [refused] * 6


@pytest.mark.parametrize(("margins", "refused"), [(1.9, False), (2.1, True)])
def test_a_run_may_be_as_uneven_as_the_margin_on_both_sides_of_the_end(margins, refused):
    samples = np.minimum(pulse(), 1.0)
    (run,) = repair_clipping(samples, -2.0, 1.0).runs
    samples[run.start + 2], samples[run.start + 4] = 1.0 - 0.003, 1.0 - 0.003 + margins * 0.003
    (run,) = repair_clipping(samples, -2.0, 1.0).runs
    assert ("that range is wrong" in run.refusal) is refused


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("end", "rests"), [(1.0, True), (-1.0, True), (1.01, False)])
def test_an_end_as_near_to_zero_as_the_margin_counts_as_zero(end, rests, sign):
    """Of a range of 1000 the margin is 1."""
    samples = sign * np.array([end, end - 1.5])
    low, high = sorted((sign * end, sign * (end + 1000.0)))
    found = find_clipped(samples, low, high)
    at_the_end, beyond = (found.below if sign > 0 else found.above).tolist()
    assert at_the_end is not rests
    assert beyond
    kept = np.isfinite(repair_clipping(samples, low, high).samples).tolist()
    assert kept == [rests, rests]


def test_the_level_on_which_a_wave_rides_does_not_matter():
    samples = np.minimum(sine(1.1), 1.0)
    here, there = repair_clipping(samples, -2.0, 1.0), repair_clipping(samples + 7.0, 5.0, 8.0)
    assert np.allclose(there.samples - 7.0, here.samples, atol=1e-6)
    assert [run.refusal for run in there.runs] == [run.refusal for run in here.runs] == [""] * len(here.runs)


def test_runs_are_in_order_of_time_and_what_is_masked_has_no_uncertainty():
    found = repair_clipping(np.clip(sine(1.6), -1.0, 1.0), -1.0, 1.0)
    starts = [run.start for run in found.runs]
    assert starts == sorted(starts)
    assert {run.side for run in found.runs} == {-1, 1}
    repaired, masked = found.repairs
    assert (repaired.kind, masked.kind) == ("clipped repaired", "clipped masked")
    assert np.array_equal(found.u > 0.0, repaired.flags)


def test_a_record_upside_down_is_repaired_upside_down_whatever_small_waves_are_on_it():
    t = np.arange(-300.0, 300.0)
    centres = np.array([[-150.0], [-110.0], [110.0], [150.0]])
    small = 0.15 * np.exp(-0.5 * ((t - centres) / 6.0) ** 2).sum(axis=0)
    samples = np.minimum(pulse() + small, 1.0)
    up, down = repair_clipping(samples, -2.0, 1.0), repair_clipping(-samples, -1.0, 2.0)
    assert np.allclose(down.samples, -up.samples, rtol=0.0, atol=1e-9)
    assert [run.peak for run in down.runs] == pytest.approx([-run.peak for run in up.runs])


@pytest.mark.parametrize("step", [1, -1], ids=["behind it", "before it"])
def test_what_lies_beyond_a_long_plateau_at_the_other_end_has_no_say_even_where_that_begins_at_once(step):
    samples = np.minimum(pulse(), 1.0)
    (run,) = repair_clipping(samples, -2.0, 1.0).runs
    behind = run.stop + MOST_ORDER + 1
    samples[run.stop : behind] = -2.0
    other = samples.copy()
    other[behind:] += 0.2
    number = -1 if step < 0 else 0
    assert repaired_tip(other[::step], number) == repaired_tip(samples[::step], number)
