from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimate.mass import reverse_mass
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.filters import LowPass, filter_alike
from recoil_processing.shot.regression import MOST_TURNED, build_regression, spaced_rows
from recoil_processing.shot.release import FREE_TRAVEL_M, end_of_travel, release_index, stop_release_impulse
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import (
    ELEVATION_RAD,
    FIRE_S,
    GRAVITY_M_S2,
    MASS_KG,
    bench_motion,
    bench_regression,
    bench_rig,
    bench_shot,
    bench_signals,
)

NOTHING = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
STATIC = -GRAVITY_M_S2 * math.sin(ELEVATION_RAD)


@pytest.mark.parametrize("cutoff_hz", [None, 40.0, 300.0, 2000.0])
def test_newtons_law_holds_before_and_behind_any_low_pass(cutoff_hz):
    # without friction: the sample in which it turns is found to a sample only
    regression = bench_regression(bench_shot(bench_motion(friction=0.0)), bench_rig(friction=0.0))
    if cutoff_hz is not None:
        regression = regression.filtered(LowPass(cutoff_hz))
    error = MASS_KG * regression.acceleration_m_s2 - regression.force_n
    assert np.abs(error).max() < 1e-9 * np.abs(regression.force_n).max()


def test_while_the_part_is_held_both_sides_are_zero():
    motion, regression = bench_motion(), bench_regression()
    held = np.arange(motion.times_s.size) < motion.release
    assert np.abs(regression.acceleration_m_s2[held]).max() < 1e-12
    assert not regression.forces_n[held].any()
    assert not regression.released[held].any()
    assert not regression.friction_direction[held].any()
    assert regression.released[~held].all()


def test_the_forces_are_signed_and_the_friction_turns_with_the_motion():
    motion, rig = bench_motion(), bench_rig()
    regression = bench_regression()
    m = rig.mechanism
    free = slice(motion.release, None)
    expected = [motion.breech_pa * m.bore_area, -motion.brake_pa * m.brake_area]
    expected.append(-motion.recuperator_pa * m.recuperator_area)
    np.testing.assert_allclose(regression.forces_n[free, :3], np.array(expected).T[free], rtol=1e-12, atol=1e-6)
    end = regression.interval_s[1]
    assert (regression.forces_n[free, 3][motion.times_s[free] <= end] == -1500.0).all()
    assert (regression.forces_n[motion.times_s > end + 1e-3, 3] == 1500.0).all()
    np.testing.assert_array_equal(regression.forces_n[:, 3], 1500.0 * regression.friction_direction)
    # what stop and packing give on average while they let go
    assert regression.release_n_s == pytest.approx(np.sqrt(3) * regression.u_release_n_s)


def test_the_interval_reaches_from_force_to_the_end_of_travel():
    motion, regression = bench_motion(), bench_regression()
    last = motion.times_s[np.flatnonzero(motion.velocity_m_s > 0)[-1]]
    assert regression.interval_s[0] == pytest.approx(FIRE_S, abs=1e-4)
    assert regression.interval_s[1] == pytest.approx(last, abs=2e-4)
    assert regression.used.sum() == regression.inside.sum()


@pytest.mark.parametrize("role", ["breech_pressure", "brake_pressure", "recuperator_pressure"])
def test_a_missing_pressure_is_named(role):
    signals = bench_signals()
    series = {k: v for k, v in signals.series.items() if k != role}
    with pytest.raises(IdentificationError, match=f"no usable channel of role {role}"):
        build_regression(
            replace(signals, series=series), bench_rig().mechanism, signals.series["recoil_acceleration"],
            bench_motion().velocity_m_s, STATIC,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "gap"),
    [
        ("p_breech", slice(640, 700)),
        ("p_brake", slice(900, 1000)),
        ("acc", slice(700, 760)),
        ("p_breech", slice(598, 620)),  # over the release itself
    ],
)
def test_a_gap_takes_rows_away_but_leaves_the_mass(name, gap):
    motion = bench_motion()
    whole = {"p_breech": motion.breech_pa, "p_brake": motion.brake_pa, "acc": motion.acceleration_m_s2}
    lossy = whole[name].copy()
    lossy[gap] = np.nan
    recorded = bench_regression(bench_shot(**{name: lossy}))
    assert not recorded.trusted[gap].any()
    low_pass = LowPass(300.0)
    filtered = recorded.filtered(low_pass)
    reach = math.ceil(low_pass.reach_s * filtered.rate_hz)
    near = np.zeros(motion.times_s.size, dtype=bool)
    near[max(gap.start - reach, 0) : gap.stop + reach] = True
    # what stands beyond the filter's reach is as if nothing were lost
    assert filtered.trusted[~near].all()
    assert not filtered.trusted[gap].any()
    assert filtered.used.sum() < filtered.inside.sum()
    assert reverse_mass(filtered, NOTHING).mass_kg == pytest.approx(MASS_KG, rel=2e-4)


@pytest.mark.exhaustive
def test_a_gap_lowers_the_identified_share_and_not_the_validity_of_what_is_left():
    motion = bench_motion()
    lossy = motion.breech_pa.copy()
    lossy[2000:2400] = np.nan
    found = identify_shot(FiredShot(bench_shot(p_breech=lossy), bench_rig()), Options(window_s=0.01))
    whole = identify_shot(FiredShot(bench_shot(), bench_rig()), Options(window_s=0.01))
    assert whole.chosen.trace.share == pytest.approx(1.0)
    assert 0.5 < found.chosen.trace.share < 0.95
    assert found.chosen.estimate.mass_kg == pytest.approx(MASS_KG, rel=3e-4)


def test_another_acceleration_is_taken_for_zero_while_the_part_is_held():
    regression = bench_regression().filtered(LowPass(100.0))
    motion = bench_motion()
    lossy = np.where(np.arange(motion.acceleration_m_s2.size) < motion.acceleration_m_s2.size - 50,
                     motion.acceleration_m_s2, np.nan)  # fmt: skip
    made_of = filter_alike(LowPass(100.0), {"acceleration": lossy}, regression.rate_hz)
    other = regression.with_acceleration(made_of["acceleration"], made_of)
    known = made_of.trusted
    np.testing.assert_allclose(other.acceleration_m_s2[known], regression.acceleration_m_s2[known], atol=0.15)
    assert not other.trusted[-50:].any()


def test_an_acceleration_behind_another_filter_is_refused():
    regression = bench_regression().filtered(LowPass(100.0))
    made_of = filter_alike(LowPass(120.0), {"acceleration": bench_motion().acceleration_m_s2}, regression.rate_hz)
    for one in (regression, bench_regression()):
        with pytest.raises(ValueError, match="has passed"):
            one.with_acceleration(made_of["acceleration"], made_of)


def test_another_acceleration_is_taken_as_it_is_where_the_part_was_never_held():
    regression = bench_regression().filtered(LowPass(100.0))
    free = replace(regression, released=np.ones(regression.times_s.size))
    assert regression.table is not None
    other = free.with_acceleration(regression.acceleration_m_s2, regression.table)
    np.testing.assert_array_equal(other.acceleration_m_s2, regression.acceleration_m_s2)


def test_rows_are_spaced_by_the_filters_memory_and_keep_to_the_trusted_interval():
    recorded = bench_regression()
    np.testing.assert_array_equal(spaced_rows(recorded), np.flatnonzero(recorded.inside))
    filtered = recorded.filtered(LowPass(300.0))
    rows = spaced_rows(filtered)
    np.testing.assert_allclose(rows, rows[0] + 20_000 / 600 * np.arange(rows.size), atol=0.5)
    trusted = filtered.trusted.copy()
    trusted[1000:1500] = False
    left = spaced_rows(replace(filtered, trusted=trusted))
    np.testing.assert_array_equal(left, rows[(rows < 1000) | (rows >= 1500)])


@pytest.mark.parametrize("every", [2, 7])
def test_rows_are_at_the_same_instants_at_any_rate(every: int):
    fast = bench_regression().filtered(LowPass(270.0))
    kept = slice(int(np.argmax(fast.inside)) % every, None, every)
    names = ("times_s", "acceleration_m_s2", "forces_n", "released", "friction_direction", "release_per_s", "trusted")
    slow = replace(fast, step_s=every * fast.step_s, **{name: getattr(fast, name)[kept] for name in names})
    at, same = fast.times_s[spaced_rows(fast)], slow.times_s[spaced_rows(slow)]
    assert at.size == pytest.approx(same.size, abs=1)
    both = min(at.size, same.size)
    assert np.abs(at[:both] - same[:both]).max() <= 0.51 * (slow.step_s + fast.step_s)


def test_no_row_is_behind_the_first_sample_that_the_turn_reaches():
    filtered = bench_regression().filtered(LowPass(300.0))
    reached = np.abs(1.0 + filtered.friction_direction) / 2.0 > MOST_TURNED
    reached &= filtered.times_s > np.mean(filtered.interval_s)
    first = int(np.argmax(reached))
    # what the filter spreads rings: it crosses zero behind
    assert reached[first]
    assert not reached[first:].all()
    np.testing.assert_array_equal(filtered.before_the_turn, np.arange(reached.size) < first)


def test_a_packing_that_turns_later_than_the_part_changes_no_row():
    recorded = bench_regression()
    end_s = recorded.interval_s[1]
    still_slides = (recorded.times_s > end_s) & (recorded.times_s < end_s + 2e-3)
    forces_n = np.array(recorded.forces_n)
    forces_n[still_slides, 3] = -1500.0
    direction = np.where(still_slides, -1.0, recorded.friction_direction)
    as_declared = recorded.filtered(LowPass(250.0))
    late = replace(recorded, forces_n=forces_n, friction_direction=direction).filtered(LowPass(250.0))
    moved_n = np.abs(late.forces_n[:, 3] - as_declared.forces_n[:, 3])
    rows = spaced_rows(as_declared)
    assert moved_n[as_declared.used].max() > 0.4 * 3000.0
    assert moved_n[rows].max() < 0.03 * 3000.0
    # one reach of the filter at the most
    assert recorded.times_s[rows[-1]] > end_s - 2 / 250.0


TIMES = 1e-3 * np.arange(200)


def test_the_release_is_the_first_of_ten_driving_samples():
    force = np.where(np.arange(200) < 60, -10e3, 50e3)
    force[[40, 45, 46]] = 1e3  # noise
    assert release_index(TIMES, force, 0.030) == 60


def test_where_samples_are_far_apart_fewer_of_them_are_the_release():
    times_s = 4e-3 * np.arange(60)
    force = np.where((np.arange(60) >= 20) & (np.arange(60) < 24), 900e3, -10e3)
    force[[15, 16]] = 1e3  # noise
    assert release_index(times_s, force, 0.040) == 20
    # so many of a fast recorder are none
    with pytest.raises(IdentificationError, match=r"at most 900\.0 kN, over 4 samples.*or record faster"):
        release_index(1e-3 * np.arange(60), force, 0.010)


def test_before_the_onset_nothing_is_released():
    force = np.full(200, 5e3)
    assert release_index(TIMES, force, 0.050) == 50


def test_a_lost_sample_does_not_drive():
    force = np.where(np.arange(200) < 60, -10e3, 50e3)
    force[55:75] = np.nan
    assert release_index(TIMES, force, 0.030) == 75


@pytest.mark.parametrize(
    ("force", "found"), [(np.full(200, -3e3), "at most -3.0 kN"), (np.full(200, np.nan), "no sample of all three")]
)
def test_a_part_that_is_never_driven_is_an_error_that_says_where_to_look(force, found):
    with pytest.raises(IdentificationError, match=found) as caught:
        release_index(TIMES, force, 0.030)
    assert "areas, units and polarities" in str(caught.value)


def test_a_stop_pushes_with_what_it_held_at_most_until_the_part_has_left_it():
    times = 1e-5 * np.arange(20_000)
    force = np.interp(times, [0.0, 0.03, 0.09, 0.2], [-10e3, -10e3, 50e3, 50e3])
    found = stop_release_impulse(times, force, 0.030, mass_kg=500.0)
    # released at 40 ms, and then driven by 1 kN more each ms: x = (1e6 N/s) t^3 / (6 m), 0.2 mm after 8.4 ms
    free_s = (6 * 500.0 * FREE_TRAVEL_M / 1e6) ** (1 / 3)
    at = np.flatnonzero(found.per_s)
    assert times[at[0]] == pytest.approx(0.04, abs=2e-5)
    assert times[at[-1]] - times[at[0]] == pytest.approx(free_s, rel=0.01)
    assert found.mean_n_s == pytest.approx(10e3 * free_s / 2, rel=0.01)
    # every impulse from none to the most is as likely as any other
    assert found.u_n_s == pytest.approx(10e3 * free_s / np.sqrt(12), rel=0.01)
    # it dies away
    assert np.all(np.diff(found.per_s[at]) < 0)
    assert found.per_s.sum() * 1e-5 == pytest.approx(1.0)


@pytest.mark.parametrize(("at_rest", "driven", "onset"), [(-10e3, 5.0, 0.03), (-10e3, 50e3, 0.0), (0.0, 5e4, 0.03)])
def test_where_rest_or_rise_are_not_recorded_or_nothing_is_held_there_is_nothing_to_tell(at_rest, driven, onset):
    found = stop_release_impulse(TIMES, np.where(TIMES < 0.03, at_rest, driven), onset, mass_kg=1e3)
    assert (found.mean_n_s, found.u_n_s) == (0.0, 0.0)
    assert not found.per_s.any()


@given(end=st.floats(0.101, 0.198), onset=st.floats(0.0, 0.05))
@settings(max_examples=30, deadline=None)
def test_the_end_of_travel_lies_between_samples(end, onset):
    velocity = np.where(onset <= TIMES, end - TIMES, 0.0)
    assert end_of_travel(TIMES, velocity, onset) == pytest.approx(end, abs=1e-12)


def test_what_moved_before_the_onset_or_after_the_return_does_not_count():
    velocity = np.interp(TIMES, [0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2], [0, 5, 0, 10, 0, -4, 3])
    assert end_of_travel(TIMES, velocity, 0.03) == pytest.approx(0.1)


def test_a_record_that_ends_before_the_recoil_ends_the_interval():
    assert end_of_travel(TIMES, TIMES, 0.03) == TIMES[-1]


@pytest.mark.parametrize(
    ("velocity", "onset"), [(-TIMES, 0.03), (np.zeros(200), 0.0), (-np.ones(200), 0.0), (TIMES, 0.5)]
)
def test_a_part_that_never_moves_to_the_rear_is_an_error(velocity, onset):
    with pytest.raises(IdentificationError, match="never moves to the rear") as caught:
        end_of_travel(TIMES, velocity, onset)
    assert "polarity" in str(caught.value)
