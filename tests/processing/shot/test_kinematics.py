from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.alignment.motion_alignment import INFLATIONS
from recoil_processing.double_integral import integrate
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.noise import noise_sigma
from recoil_processing.repairs.bridged_gaps import bridge_errors
from recoil_processing.shot.kinematics import (
    MOST_KICKS,
    angular_motion,
    bridged_kicks,
    fused_motion,
    relative_to_tipping_part,
    travel_acceleration,
    travel_and_velocity,
)
from recoil_processing.shot.signals import Signals, collect_signals
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot


@cache
def tracked() -> tuple[VirtualShot, Signals, np.ndarray, Channel, ClockAlignment]:
    virtual = virtual_shot()
    signals = collect_signals(FiredShot(virtual.shot, virtual.rig), {a.clock: a for a in virtual.shot.alignments})
    camera = virtual.shot.by_role("recoil_displacement")
    assert camera is not None
    acceleration = travel_acceleration(signals, virtual.rig, angular_motion(signals, virtual.rig))
    return virtual, signals, acceleration, camera, virtual.shot.alignment(camera.time_base.clock)


def fuse_all(**changes) -> FusedMotion:
    _, signals, acceleration, camera, alignment = tracked()
    result = fused_motion(signals, acceleration, camera, replace(alignment, **changes))
    assert result is not None
    return result


def test_travel_and_velocity_are_the_fused_ones():
    _, signals, acceleration, *_ = tracked()
    fused = fuse_all()
    travel, velocity = travel_and_velocity(fused, acceleration, signals.step_s)
    assert np.array_equal(travel, fused.position_m)
    assert np.array_equal(velocity, fused.velocity_m_s)
    assert np.array_equal(fused.times_s, signals.times_s)


def test_the_fused_motion_is_the_true_one_within_its_uncertainty_and_the_cameras_scale():
    virtual, *_, camera, alignment = tracked()
    truth, fused = virtual.truth, fuse_all()
    end = int(np.argmin(np.abs(fused.times_s - truth["t_end"])))
    scale = camera.u_rel * truth["stroke_m"]
    assert abs(fused.position_m[end] - truth["stroke_m"]) < 3 * np.hypot(fused.u_position_m[end], scale)
    assert abs(fused.velocity_m_s[end]) < 4 * fused.u_velocity_m_s[end] + 5e-3
    assert fused.u_position_m[end] < 1e-4
    assert 0.7 < fused.innovation_statistic < 1.4
    assert fused.shift_statistic(alignment.u_offset_s) < 1
    assert fused.gain == pytest.approx(alignment.details["gain"], abs=2 * alignment.details["u_gain"])


def test_an_alignment_that_tells_no_noise_levels_is_enough():
    told, found = fuse_all(), fuse_all(method="trigger", details=None)
    assert told.acceleration_density == tracked()[4].details["acceleration_density"]
    assert 0.3 < found.acceleration_density / told.acceleration_density < 5
    assert np.abs(found.velocity_m_s - told.velocity_m_s).max() < 0.02
    assert np.abs(found.position_m - told.position_m).max() < 1e-4


@pytest.mark.parametrize(("samples", "sigma_m_s2"), [(49, None), (50, 4.0), (51, 4.0), (50, 0.0)])
def test_the_accelerometers_noise_is_that_of_fifty_samples_before_the_shot_or_else_of_the_record(samples, sigma_m_s2):
    _, signals, acceleration, camera, alignment = tracked()
    start_s = signals.times_s[10] - 0.5 * signals.step_s
    short = replace(signals, baseline_s=(start_s, start_s + samples * signals.step_s))
    felt = acceleration.copy()
    felt[10 : 10 + samples] = (sigma_m_s2 or 0.0) * np.where(np.arange(samples) % 2, 1.0, -1.0)
    sigma = noise_sigma(felt) if sigma_m_s2 is None else max(float(np.std(felt[10 : 10 + samples])), 1e-6)
    found = fused_motion(short, felt, camera, replace(alignment, details=None))
    assert found is not None
    inflations = found.acceleration_density / (sigma**2 * signals.step_s)
    assert min(abs(inflations / one - 1.0) for one in INFLATIONS) < 1e-9


def test_what_is_not_known_of_the_clocks_widens_the_uncertainty():
    sure, unsure = fuse_all(u_offset_s=0.0, u_drift=0.0), fuse_all(u_offset_s=1e-4, u_drift=0.0)
    fast = int(np.argmax(sure.velocity_m_s))
    added = np.sqrt(unsure.u_position_m[fast] ** 2 - sure.u_position_m[fast] ** 2)
    assert added == pytest.approx(1e-4 * sure.velocity_m_s[fast], rel=0.3)


def test_lost_samples_of_the_accelerometer_make_the_velocity_less_sure():
    virtual, signals, _, camera, alignment = tracked()
    lost = signals.series["recoil_acceleration"].copy()
    first = int(np.argmin(np.abs(signals.times_s - virtual.truth["t_fire"]))) + 400
    lost[first : first + 50] = np.nan
    holed = replace(signals, series={**signals.series, "recoil_acceleration": lost})
    acceleration = travel_acceleration(holed, virtual.rig, angular_motion(holed, virtual.rig))
    result = fused_motion(holed, acceleration, camera, alignment)
    assert result is not None
    assert result.u_velocity_m_s[first + 25] > fuse_all().u_velocity_m_s[first + 25]


def test_without_a_camera_or_its_clock_it_is_the_accelerometers_integral():
    _, signals, acceleration, camera, alignment = tracked()
    velocity = integrate(acceleration, signals.step_s)
    still = replace(camera, samples=np.zeros(camera.time_base.count))
    dark = replace(camera, samples=np.full(camera.time_base.count, np.nan))
    for seen, clock in (
        (None, None),
        (camera, None),
        (camera, replace(alignment, status="failed")),
        (camera, replace(alignment, offset_s=1e3)),
        (dark, alignment),
        (dark, replace(alignment, details=None)),
        (still, replace(alignment, details=None)),
    ):
        assert fused_motion(signals, acceleration, seen, clock) is None
        found = travel_and_velocity(None, acceleration, signals.step_s)
        assert np.array_equal(found[1], velocity)
        assert np.array_equal(found[0], integrate(velocity, signals.step_s))


@pytest.mark.exhaustive
def test_the_mass_by_the_camera_is_as_good_on_a_slow_recorder():
    masses = []
    for rate_hz in (2.5e3, 25e3):
        virtual = virtual_shot(seed=3, sample_rate_hz=rate_hz)
        found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
        masses.append(found.results["kinematic"].estimate.mass_kg)
    # two gradients one after the other would differ by 3 kg
    assert masses[0] == pytest.approx(masses[1], abs=2.4)


def test_a_part_that_is_held_does_not_move_until_it_is_free():
    virtual, signals, acceleration, *_ = tracked()
    free = np.where(signals.times_s < virtual.truth["t_fire"], 0.0, 1.0)
    motion = angular_motion(signals, virtual.rig)
    inertial = np.nan_to_num(signals.series["recoil_acceleration"])
    always = relative_to_tipping_part(inertial, virtual.rig.mechanism, motion, signals.step_s)
    held = relative_to_tipping_part(inertial, virtual.rig.mechanism, motion, signals.step_s, free)
    assert not held[free == 0.0].any()
    np.testing.assert_allclose(held[free == 1.0], always[free == 1.0], atol=1e-3 * np.abs(acceleration).max())


# ---- what the gyros and the carriage's accelerometers tell, and what is taken where they are missing


def signals_with(**series: np.ndarray | None) -> Signals:
    """Put other series in the place of some roles; None leaves a role out."""
    signals = tracked()[1]
    kept = {role: samples for role, samples in signals.series.items() if role not in series}
    return replace(signals, series=kept | {role: s for role, s in series.items() if s is not None})


def test_the_tipping_part_turns_on_the_carriage_by_the_integral_of_both_rates():
    virtual, signals, *_ = tracked()
    slow = np.sin(2 * np.pi * 5.0 * signals.times_s)
    motion = angular_motion(signals_with(carriage_rate=0.2 * slow, tipping_rate=0.5 * slow), virtual.rig)
    inside = slice(signals.times_s.size // 10, -signals.times_s.size // 10)
    np.testing.assert_allclose(motion.w2[inside], 0.5 * slow[inside], atol=1e-3)
    np.testing.assert_allclose(np.gradient(motion.beta, signals.step_s)[inside], 0.3 * slow[inside], atol=1e-3)


def test_angular_rates_pass_a_low_pass_of_150_hz():
    virtual, signals, *_ = tracked()
    fast = np.sin(2 * np.pi * 150.0 * signals.times_s)
    motion = angular_motion(signals_with(carriage_rate=fast), virtual.rig)
    inside = slice(signals.times_s.size // 10, -signals.times_s.size // 10)
    assert np.std(motion.w1[inside]) == pytest.approx(np.std(fast[inside]) / np.sqrt(2.0), rel=0.01)


def test_angular_rates_of_a_slow_recorder_pass_a_low_pass_of_a_tenth_of_its_rate():
    virtual, *_ = tracked()
    slow = replace(signals_with(), step_s=1e-3)
    fast = np.sin(2 * np.pi * 100.0 * slow.times_s)
    motion = angular_motion(replace(slow, series={"carriage_rate": fast}), virtual.rig)
    inside = slice(fast.size // 10, -fast.size // 10)
    assert np.std(motion.w1[inside]) == pytest.approx(np.std(fast[inside]) / np.sqrt(2.0), rel=0.01)


def test_an_accelerometer_that_was_lost_throughout_felt_nothing_of_its_own():
    virtual, signals, *_ = tracked()
    lost, still = (np.full(signals.times_s.size, value) for value in (np.nan, 0.0))
    motion = angular_motion(signals, virtual.rig)
    found, expected = (
        travel_acceleration(signals_with(recoil_acceleration=felt), virtual.rig, replace(motion, w2=still, dw2=still))
        for felt in (lost, still)
    )
    np.testing.assert_array_equal(found, expected)


def test_rates_that_were_lost_throughout_are_none_and_accelerations_those_of_rest():
    virtual, signals, *_ = tracked()
    lost = np.full(signals.times_s.size, np.nan)
    mechanism = replace(virtual.rig.mechanism, phi10=0.1)
    nothing = signals_with(
        carriage_rate=lost, tipping_rate=lost, carriage_acceleration_x=lost, carriage_acceleration_y=lost
    )
    motion = angular_motion(nothing, replace(virtual.rig, mechanism=mechanism))
    assert not motion.w1.any()
    assert not motion.w2.any()
    np.testing.assert_allclose(motion.f_x, mechanism.g * np.sin(0.1))
    np.testing.assert_allclose(motion.f_y, mechanism.g * np.cos(0.1))


def test_without_a_gyro_on_the_tipping_part_it_turns_with_the_carriage():
    virtual, *_ = tracked()
    motion = angular_motion(signals_with(tipping_rate=None), virtual.rig)
    assert np.abs(motion.w1).max() > 1e-3
    np.testing.assert_array_equal(motion.w2, motion.w1)
    assert not motion.beta.any()


def test_a_carriage_without_accelerometers_is_at_rest_under_gravity():
    virtual, *_ = tracked()
    missing = signals_with(carriage_acceleration_x=None, carriage_acceleration_y=None)
    mechanism = replace(virtual.rig.mechanism, phi10=0.1)
    motion = angular_motion(missing, replace(virtual.rig, mechanism=mechanism))
    np.testing.assert_allclose(motion.f_x, mechanism.g * np.sin(0.1))
    np.testing.assert_allclose(motion.f_y, mechanism.g * np.cos(0.1))


def test_the_place_of_the_carriages_accelerometer_is_that_of_the_rig_file():
    virtual, signals, *_ = tracked()
    spec = virtual.rig.by_role("carriage_acceleration_x")
    assert spec is not None
    assert spec.sensor.position != (0.0, 0.0)
    motion = angular_motion(signals, virtual.rig)
    assert (motion.r_x, motion.r_y) == spec.sensor.position
    bare = angular_motion(signals, virtual.rig.without_channel(spec.name))
    assert (bare.r_x, bare.r_y) == (0.0, 0.0)


def test_a_bridge_that_may_kick_the_velocity_is_known_by_its_middle():
    _, signals, acceleration, *_ = tracked()
    felt = signals.series["recoil_acceleration"].copy()
    peak = int(np.argmax(np.abs(np.where(np.isfinite(felt), felt, 0.0))))
    felt[peak : peak + 60] = np.nan
    assert bridged_kicks(signals, acceleration) == ()
    holed = signals_with(recoil_acceleration=felt)
    (kick_s,) = bridged_kicks(holed, acceleration)
    assert kick_s == pytest.approx(signals.times_s[peak] + 30 * signals.step_s, abs=1.01 * signals.step_s)
    (later_s,) = bridged_kicks(replace(holed, start_s=signals.start_s + 2.0), acceleration)
    assert later_s == pytest.approx(kick_s + 2.0)


def test_of_many_kicks_the_six_worst_are_taken_in_their_order():
    _, signals, acceleration, *_ = tracked()
    felt = signals.series["recoil_acceleration"].copy()
    start = int(np.searchsorted(signals.times_s, signals.onset_s))
    for number in range(9):
        at = start + 60 * number
        felt[at : at + 10 + 2 * number] = np.nan
    kicks = bridged_kicks(signals_with(recoil_acceleration=felt), acceleration)
    assert len(kicks) == MOST_KICKS == 6
    assert list(kicks) == sorted(kicks)
    gaps = bridge_errors(acceleration, np.isnan(felt), signals.step_s)
    least = sorted(g.error * g.duration_s for g in gaps)[3:]
    taken = [
        g.error * g.duration_s for g in gaps if any(abs(k - signals.start_s - g.start_s) < g.duration_s for k in kicks)
    ]
    assert sorted(taken) == pytest.approx(least)
