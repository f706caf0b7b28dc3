import csv
import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import judge_motion
from recoil_processing.alignment.motion_alignment import SPAN_S, align_motion, camera_velocity, velocity_shift
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.alignment.motion_least_squares import MotionModel
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.noise import noise_sigma
from tests.builders.motions import ONSET_S, RecordedMotion, record_motion, travel, velocity
from tests.builders.shared_data import shared_file

SEEDS = range(12)


def align(
    motion: RecordedMotion,
    *,
    drift_allowance: float = 5e-5,
    onset_s: float | None = None,
    kicks_s: tuple[float, ...] = (),
    u_bend_m: float = 0.0,
) -> MotionFit | str:
    return align_motion(
        motion.camera_times_s,
        motion.displacement_m,
        motion.start_s,
        motion.step_s,
        motion.acceleration_m_s2,
        acceleration_sigma_m_s2=motion.acceleration_sigma_m_s2,
        drift_allowance=drift_allowance,
        onset_s=onset_s,
        kicks_s=kicks_s,
        u_bend_m=u_bend_m,
    )


def fit_of(
    motion: RecordedMotion,
    *,
    drift_allowance: float = 5e-5,
    onset_s: float | None = None,
    kicks_s: tuple[float, ...] = (),
    u_bend_m: float = 0.0,
) -> MotionFit:
    fit = align(motion, drift_allowance=drift_allowance, onset_s=onset_s, kicks_s=kicks_s, u_bend_m=u_bend_m)
    assert isinstance(fit, MotionFit), fit
    return fit


def verdict_on(motion: RecordedMotion, fit: MotionFit | str) -> ClockAlignment:
    density = motion.acceleration_sigma_m_s2**2 * motion.step_s
    return judge_motion("camera", fit, u_gain=0.01, noise_density=density, frame_period_s=5e-4)


def error_s(motion: RecordedMotion, fit: MotionFit) -> float:
    """Error of the mapped time in the middle of the motion, where its uncertainty is stated."""
    speed = velocity((1 + motion.drift) * motion.camera_times_s + motion.offset_s)
    middle = float(np.average(motion.camera_times_s, weights=speed**2))
    return fit.offset_s - motion.offset_s + (fit.drift - motion.drift) * middle


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "conditions",
    [
        {},
        {"lost_share": 0.3},
        {"marker_sigma_m": 2e-4, "acceleration_sigma_m_s2": 20.0},
        {"frame_rate_hz": 1000.0, "frames": 750},
        {"rate_hz": 5000.0},
    ],
    ids=["usual", "a third lost", "noisy", "1000 frames per second", "slow recorder"],
)
def test_errors_are_what_the_uncertainty_says(conditions):
    offsets, gains, biases, drifts = [], [], [], []
    for seed in SEEDS:
        drift = float(5e-5 * np.random.default_rng(500 + seed).standard_normal())
        motion = record_motion(seed, drift=drift, **conditions)
        fit = fit_of(motion)
        offsets.append(error_s(motion, fit) / fit.u_offset_s)
        gains.append((fit.gain - motion.gain) / fit.u_gain)
        # the accelerometer felt 2 m/s^2 too much: the camera's scale takes them off
        biases.append((fit.integration_constants[2] + 2.0 * motion.gain) / fit.u_bias_m_s2)
        drifts.append((fit.drift - drift) / fit.u_drift)
        assert verdict_on(motion, fit).status == "ok", verdict_on(motion, fit).reasons
    for pulls in (offsets, gains, biases, drifts):
        # the root of chi-square over 12 stays between 0.43 and 1.66 in 999 of 1000 cases
        assert 0.43 < rms(pulls) < 1.66
    assert abs(np.mean(offsets)) < 1.0


def bent(motion: RecordedMotion, bow_m: float, s_m: float) -> RecordedMotion:
    """Let optics bend a travel: by a bow, and by an S."""
    share = motion.displacement_m / np.max(motion.displacement_m)
    bow = 4.0 * share * (1.0 - share)
    return replace(motion, displacement_m=motion.displacement_m + bow_m * bow + s_m * 2.6 * bow * (1.0 - 2.0 * share))


@pytest.mark.exhaustive
def test_what_optics_bend_is_no_other_frame_rate_where_it_is_known_that_they_may():
    pulls, without = [], []
    for seed in SEEDS:
        drawn = np.random.default_rng(700 + seed).standard_normal(2) * (1e-3, 5e-4)
        motion = bent(record_motion(seed), *drawn)
        fit = fit_of(motion, u_bend_m=1e-3)
        pulls.append(error_s(motion, fit) / fit.u_offset_s)
        unknown = fit_of(motion)
        without.append(error_s(motion, unknown) / unknown.u_offset_s)
        assert verdict_on(motion, fit).status == "ok", verdict_on(motion, fit).reasons
    assert 0.43 < rms(pulls) < 1.66
    assert rms(without) > 1.3 * rms(pulls)


def test_a_bend_that_may_be_counts_as_so_much_more_covariance():
    """Against generalised least squares whose covariance holds the bends, no unknown of their own."""
    motion = record_motion(5, acceleration_sigma_m_s2=1e-3, bias_m_s2=0.0, gain=1.0)
    fit = fit_of(motion, drift_allowance=1e-12, u_bend_m=3e-4)
    reference = motion.camera_times_s + motion.offset_s
    since = motion.camera_times_s - motion.camera_times_s.mean()
    jacobian = np.column_stack([velocity(reference), travel(reference), np.ones(since.size), since, since**2])
    share = travel(reference) / np.max(travel(reference))
    bow = 4.0 * share * (1.0 - share)
    bends = np.column_stack([3e-4 * bow, 1.5e-4 * 2.6 * bow * (1.0 - 2.0 * share)])
    covariance = motion.marker_sigma_m**2 * np.eye(since.size) + bends @ bends.T
    bound = np.sqrt(np.linalg.inv(jacobian.T @ np.linalg.solve(covariance, jacobian))[0, 0])
    assert fit.u_offset_s == pytest.approx(bound, rel=0.08)
    assert fit.u_offset_s > 1.1 * fit_of(motion, drift_allowance=1e-12).u_offset_s


def test_a_drift_within_reach_of_the_record_is_found():
    motion = record_motion(4, drift=0.004)
    fit = fit_of(motion, drift_allowance=0.01)
    assert abs(fit.drift - 0.004) < 4 * fit.u_drift
    assert fit.u_drift < 1e-3
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s


def test_the_uncertainty_reaches_the_bound_of_a_known_reference():
    motion = record_motion(5, acceleration_sigma_m_s2=1e-3, bias_m_s2=0.0, gain=1.0)
    fit = fit_of(motion, drift_allowance=1e-12)
    reference = motion.camera_times_s + motion.offset_s
    since = motion.camera_times_s - motion.camera_times_s.mean()
    jacobian = np.column_stack([velocity(reference), travel(reference), np.ones(since.size), since, since**2])
    bound = motion.marker_sigma_m * np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[0, 0])
    # the marker's noise is estimated from the record, to about 3 %
    assert fit.u_offset_s == pytest.approx(bound, rel=0.08)


def test_the_bound_of_a_known_reference_is_reached_with_drift_among_the_unknowns():
    motion = record_motion(5, acceleration_sigma_m_s2=1e-3, bias_m_s2=0.0, gain=1.0)
    fit = fit_of(motion, drift_allowance=10.0)
    reference = motion.camera_times_s + motion.offset_s
    since = motion.camera_times_s - motion.camera_times_s.mean()
    v = velocity(reference)
    jacobian = np.column_stack([v, v * since, travel(reference), np.ones(since.size), since, since**2])
    covariance = motion.marker_sigma_m**2 * np.linalg.inv(jacobian.T @ jacobian)
    pick = np.array([1.0, np.average(since, weights=v**2), 0, 0, 0, 0])
    assert fit.u_offset_s == pytest.approx(np.sqrt(pick @ covariance @ pick), rel=0.08)
    assert fit.u_drift == pytest.approx(np.sqrt(covariance[1, 1]), rel=0.08)
    assert fit.u_gain == pytest.approx(np.sqrt(covariance[2, 2]), rel=0.08)
    # c2 counts half the square
    assert fit.u_bias_m_s2 == pytest.approx(2 * np.sqrt(covariance[5, 5]), rel=0.08)
    correlation = covariance[2, 5] / np.sqrt(covariance[2, 2] * covariance[5, 5])
    assert fit.gain_bias_correlation == pytest.approx(correlation, abs=0.02)


@pytest.mark.parametrize("drift_allowance", [1e-12, 5e-5, 10.0])
@pytest.mark.parametrize("acceleration_sigma_m_s2", [1e-3, 1.0, 5.0, 20.0])
def test_the_uncertainty_is_never_below_the_bound_and_a_perfect_accelerometer_reaches_it(
    acceleration_sigma_m_s2, drift_allowance
):
    """Cramer-Rao with scale, constants and drift unknown: ``(J'J)^-1 sigma^2``, the drift's allowance added."""
    for seed in (40, 41):
        motion = record_motion(seed, acceleration_sigma_m_s2=acceleration_sigma_m_s2)
        fit = fit_of(motion, drift_allowance=drift_allowance)
        reference = motion.camera_times_s + motion.offset_s
        since = motion.camera_times_s - motion.camera_times_s.mean()
        v = velocity(reference)
        jacobian = np.column_stack([v, v * since, travel(reference), np.ones(since.size), since, since**2])
        jacobian = np.vstack([jacobian / fit.marker_sigma_m, [0, 1 / drift_allowance, 0, 0, 0, 0]])
        scale = np.sqrt((jacobian**2).sum(axis=0))
        covariance = np.linalg.inv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
        pick = np.array([1.0, np.average(since, weights=v**2), 0, 0, 0, 0])
        bound = float(np.sqrt(pick @ covariance @ pick))
        # the middle is weighted by the recorded velocity, and the residuals may call for more
        assert fit.u_offset_s > 0.99 * bound
        if acceleration_sigma_m_s2 == 1e-3:
            assert fit.u_offset_s < 1.1 * bound


@pytest.mark.exhaustive
@pytest.mark.parametrize("acceleration_sigma_m_s2", [0.3, 1.0, 2.0])
def test_a_frame_rate_a_tenth_of_a_percent_off_never_passes_where_the_record_can_tell_it(acceleration_sigma_m_s2):
    for seed in range(3):
        motion = record_motion(seed, acceleration_sigma_m_s2=acceleration_sigma_m_s2)
        assert verdict_on(motion, fit_of(motion)).status == "ok"
        wrong = replace(motion, camera_times_s=motion.camera_times_s / 1.001)
        verdict = verdict_on(wrong, fit_of(wrong))
        assert verdict.status == "ambiguous"
        assert "check the frame rate" in verdict.reasons[0]
        assert verdict.details["drift_told_from"] < 1e-3


def test_a_drift_is_earned_where_the_record_knows_it_better_than_the_clocks_quality():
    calm = fit_of(record_motion(4, drift=4e-5, acceleration_sigma_m_s2=0.1))
    assert calm.drift_earned
    assert abs(calm.drift - 4e-5) < 3 * calm.u_drift
    usual = fit_of(record_motion(4, drift=4e-5))
    assert not usual.drift_earned
    assert usual.u_drift == pytest.approx(5e-5, rel=0.05)
    assert abs(usual.drift) < 5e-5


@cache
def fit_of_the_sixth() -> MotionFit:
    return fit_of(record_motion(6))


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=10)
@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5))
def test_where_the_clocks_have_their_zeros_changes_nothing(camera_zero, reference_zero):
    motion, here = record_motion(6), fit_of_the_sixth()
    there = fit_of(
        replace(
            motion,
            camera_times_s=motion.camera_times_s + camera_zero,
            start_s=motion.start_s + reference_zero,
            offset_s=motion.offset_s - camera_zero + reference_zero,
        )
    )
    mapped = (1 + there.drift) * (motion.camera_times_s[700] + camera_zero) + there.offset_s - reference_zero
    # float64 tells instants at 1e5 s to 1.5e-11 s; the search grid begins at another fraction of a frame
    assert mapped == pytest.approx((1 + here.drift) * motion.camera_times_s[700] + here.offset_s, abs=2e-7)
    assert there.u_offset_s == pytest.approx(here.u_offset_s, rel=0.01)
    assert verdict_on(motion, there).status == "ok"


@pytest.mark.parametrize(
    "conditions",
    [
        {"first_frame_s": 0.05, "frames": 200},
        {"frames": 4000},
        {"first_frame_s": -0.4, "frames": 2000},
        {"duration_s": 0.3},
        {"start_s": 0.09, "duration_s": 0.5},
    ],
    ids=["camera within the motion", "camera goes on", "camera begins before", "recorder ends", "recorder begins late"],
)
def test_records_that_overlap_in_part_are_aligned(conditions):
    motion = record_motion(7, **conditions)
    fit = fit_of(motion)
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s
    assert fit.u_offset_s < 5e-5


@pytest.mark.parametrize(("marker_sigma_m", "wide"), [(5e-5, False), (3e-3, True)])
def test_the_likelihood_falls_with_half_the_square_of_standard_uncertainties_and_is_shown_for_eight(
    marker_sigma_m, wide
):
    fit = fit_of(record_motion(8, marker_sigma_m=marker_sigma_m), drift_allowance=1e-12)
    away = (fit.candidates_s - fit.offset_s) / fit.u_offset_s
    assert fit.innovation_statistic < 1.0
    np.testing.assert_allclose(fit.log_likelihood, -0.5 * away**2, rtol=0.02, atol=0.01)
    # or 0.2 ms, where that is more
    assert -away[0] == pytest.approx(away[-1]) == pytest.approx(8.0 if wide else 2e-4 / fit.u_offset_s)


def test_what_the_bias_adds_to_the_velocity_is_no_motion_that_tells_the_offset():
    one, other = (fit_of(record_motion(5, bias_m_s2=bias), drift_allowance=10.0) for bias in (0.0, 20.0))
    assert other.u_offset_s == pytest.approx(one.u_offset_s, rel=2e-3)
    assert other.offset_s == pytest.approx(one.offset_s, abs=1e-9)


@pytest.mark.parametrize("bias_m_s2", [-12.0, 30.0])
def test_a_zero_that_was_never_taken_off_costs_the_offset_nothing_but_is_told(bias_m_s2):
    motion = record_motion(5, bias_m_s2=bias_m_s2)
    fit = fit_of(motion)
    assert fit.bias_m_s2 == pytest.approx(bias_m_s2, abs=4 * fit.u_bias_m_s2)
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s
    verdict = verdict_on(motion, fit)
    assert verdict.status != "ok"
    assert any("take its zero from the time before the shot" in reason for reason in verdict.reasons)


@pytest.mark.exhaustive
@pytest.mark.parametrize("bias_m_s2", [-100.0, 100.0])
def test_a_zero_so_far_off_that_it_hides_the_motion_fails(bias_m_s2):
    motion = record_motion(5, bias_m_s2=bias_m_s2)
    assert verdict_on(motion, align(motion)).status == "failed"


def test_gain_and_bias_are_as_uncertain_and_as_alike_as_a_regression_on_the_true_motion_has_it():
    motion = record_motion(19, bias_m_s2=0.0, acceleration_sigma_m_s2=1e-3)
    fit = fit_of(motion)
    times_s = motion.camera_times_s + motion.offset_s
    since, moves = motion.camera_times_s - fit.origin_s, velocity(times_s)
    columns = [travel(times_s) / motion.gain, np.ones_like(since), since, 0.5 * since**2, moves, moves * since]
    information = np.array([[a @ b for a in columns] for b in columns]) / fit.marker_sigma_m**2
    information[5, 5] += 5e-5**-2
    covariance = np.linalg.inv(information) * max(1.0, fit.innovation_statistic)
    u = np.sqrt(np.diag(covariance))
    assert (fit.u_gain, fit.u_bias_m_s2, fit.u_drift) == pytest.approx((u[0], u[3], u[5]), rel=0.02)
    assert fit.gain_bias_correlation == pytest.approx(covariance[0, 3] / (u[0] * u[3]), rel=0.02)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("sigmas", "moves"), [(19.0, False), (21.0, True)])
def test_a_marker_must_move_by_twenty_times_its_noise(sigmas, moves):
    motion = record_motion(20)
    noise = record_motion(20, pulses=()).displacement_m
    later = np.arange(noise.size) >= noise.size // 2
    sigma_m = noise_sigma(noise + 20 * motion.marker_sigma_m * later)
    stroke_m = sigmas * sigma_m - (noise[later].max() - noise[~later].min())
    found = align(replace(motion, displacement_m=noise + stroke_m * later))
    assert (isinstance(found, str) and "does not move" in found) is not moves


def shifted_from_the_onset(motion: RecordedMotion, by_m_s2: float) -> RecordedMotion:
    felt = motion.acceleration_m_s2 + by_m_s2 * (motion.reference_times_s >= ONSET_S)
    return replace(motion, acceleration_m_s2=felt)


@pytest.mark.exhaustive
@pytest.mark.parametrize("by_m_s2", [8.0, -20.0])
def test_a_zero_that_shifts_at_the_onset_is_found_and_costs_nothing(by_m_s2):
    motion = record_motion(3, gain=1.25)
    whole = fit_of(motion, drift_allowance=10.0)
    shifted = shifted_from_the_onset(motion, by_m_s2)
    fit = fit_of(shifted, onset_s=ONSET_S)
    assert fit.shifted_zero_m_s2 == pytest.approx(by_m_s2, abs=0.1)
    assert fit.acceleration_density == pytest.approx(25.0 * motion.step_s)
    assert abs(error_s(shifted, fit)) < 4 * fit.u_offset_s
    assert fit.best_log_likelihood > fit_of(shifted).best_log_likelihood + 12.0
    # it is no motion that tells the offset, either
    assert fit_of(shifted, drift_allowance=10.0, onset_s=ONSET_S).u_offset_s == pytest.approx(
        whole.u_offset_s, rel=3e-3
    )


@pytest.mark.exhaustive
def test_noise_that_was_stated_too_low_is_no_shift_of_the_zero():
    motion = replace(record_motion(14, acceleration_sigma_m_s2=40.0), acceleration_sigma_m_s2=5.0)
    fit = fit_of(motion, onset_s=ONSET_S)
    assert fit.shifted_zero_m_s2 is None
    assert fit.offset_s == fit_of(motion).offset_s


def test_the_likelihood_has_its_maximum_at_the_offset():
    fit = fit_of(record_motion(8))
    assert fit.candidates_s[np.argmax(fit.log_likelihood)] == pytest.approx(fit.offset_s, abs=1e-12)
    assert fit.log_likelihood.max() == 0.0
    assert fit.log_likelihood[[0, -1]].max() < -10


@pytest.mark.parametrize("gain", [1.01, 1.25])
def test_a_spike_and_a_duplicated_picture_are_set_aside_and_counted(gain):
    motion = record_motion(9, gain=gain)
    clean = fit_of(motion)
    faulty = motion.displacement_m.copy()
    faulty[655] += 0.012
    faulty[160] = faulty[159]
    fit = fit_of(replace(motion, displacement_m=faulty))
    assert fit.frames_set_aside == 2
    assert fit.frames == 1498
    assert abs(fit.offset_s - clean.offset_s) < 0.5 * clean.u_offset_s
    verdict = judge_motion("camera", fit, u_gain=0.3, noise_density=25.0 * motion.step_s, frame_period_s=5e-4)
    assert verdict.status == "ok"
    assert verdict.details["frames_set_aside"] == 2


@pytest.mark.parametrize(("frame_rate_hz", "frames"), [(1000.0, 750), (250.0, 188)])
def test_a_spike_within_the_shot_is_told_from_the_motion_by_the_accelerometer(frame_rate_hz, frames):
    motion = record_motion(9, gain=1.25, frame_rate_hz=frame_rate_hz, frames=frames)
    assert fit_of(motion).frames_set_aside == 0
    faulty = motion.displacement_m.copy()
    faulty[round((ONSET_S + 0.01 - motion.offset_s) * frame_rate_hz)] += 0.005
    fit = fit_of(replace(motion, displacement_m=faulty))
    assert fit.frames_set_aside == 1
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s


@pytest.mark.exhaustive
def test_a_dropped_frame_with_uncorrected_times_shows_in_the_residuals():
    motion = record_motion(10)
    assert 0.8 < fit_of(motion).innovation_statistic < 1.2
    at = round((ONSET_S + 0.025 - motion.offset_s) * 2000)
    dropped = replace(
        motion, displacement_m=np.delete(motion.displacement_m, at), camera_times_s=motion.camera_times_s[:-1]
    )
    fit = fit_of(dropped)
    assert fit.innovation_statistic > 1.6
    assert verdict_on(dropped, fit).status in ("ambiguous", "failed")


@pytest.mark.exhaustive
@pytest.mark.parametrize("factor", [0.5, 0.99, 1.01, 2.0])
def test_a_wrong_frame_rate_is_noticed(factor):
    motion = record_motion(11)
    wrong = replace(motion, camera_times_s=factor * motion.camera_times_s)
    verdict = verdict_on(wrong, align(wrong))
    assert verdict.status in ("ambiguous", "failed")
    if 0.9 < factor < 1.1:
        assert "check the frame rate" in "".join(verdict.reasons)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "pulses",
    [
        ((2000.0, ONSET_S, 0.010), (-100.0, ONSET_S + 0.003, 0.200), (-8.0, 0.35, 0.3), (8.0, 0.7, 0.3)),
        ((1800.0, ONSET_S, 0.008), (-120.0, ONSET_S + 0.004, 0.120), (-15.0, 0.25, 0.2), (15.0, 0.53, 0.2)),
        ((60.0, ONSET_S, 0.100), (-60.0, ONSET_S + 0.3, 0.100)),
        ((-2400.0, ONSET_S, 0.008), (160.0, ONSET_S + 0.004, 0.120), (20.0, 0.25, 0.2), (-20.0, 0.53, 0.2)),
    ],
    ids=["another charge", "three quarters of it", "a push", "the other way round"],
)
def test_another_motion_is_not_ok(pulses):
    motion = record_motion(12)
    other = replace(motion, displacement_m=record_motion(13, pulses=pulses).displacement_m)
    verdict = verdict_on(other, align(other))
    assert verdict.status in ("ambiguous", "failed")
    assert verdict.reasons


@pytest.mark.exhaustive
@pytest.mark.parametrize("acceleration_sigma_m_s2", [10.0, 20.0, 40.0, 80.0, 160.0])
def test_noise_that_was_stated_too_low_is_found_and_widens_the_uncertainty(acceleration_sigma_m_s2):
    motion = record_motion(14, acceleration_sigma_m_s2=acceleration_sigma_m_s2)
    fit = fit_of(replace(motion, acceleration_sigma_m_s2=5.0))
    assert fit.acceleration_density == pytest.approx(acceleration_sigma_m_s2**2 * motion.step_s)
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s


def test_positions_that_were_held_tell_nothing_of_the_markers_noise():
    motion = record_motion(15, frames=2400, duration_s=1.4)
    held = motion.displacement_m.copy()
    held[:90], held[1200:] = held[89], held[1199]
    fit = fit_of(replace(motion, displacement_m=held))
    assert fit.marker_sigma_m == pytest.approx(motion.marker_sigma_m, rel=0.1)
    assert abs(error_s(motion, fit)) < 2e-5


def test_never_four_frames_in_a_row_still_give_an_offset():
    motion = record_motion(16)
    thinned = motion.displacement_m.copy()
    thinned[::3] = np.nan
    motion = replace(motion, displacement_m=thinned)
    fit = fit_of(motion)
    assert abs(error_s(motion, fit)) < 4 * fit.u_offset_s


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"displacement_m": 5e-5 * np.random.default_rng(1).standard_normal(1500)}, "does not move"),
        ({"displacement_m": np.zeros(1500)}, "does not move"),
        ({"displacement_m": np.full(1500, np.nan)}, "only 0 frames have a position"),
        ({"displacement_m": np.append(np.arange(49.0), np.full(1451, np.nan))}, "only 49 frames have a position"),
        ({"displacement_m": np.empty(0), "camera_times_s": np.empty(0)}, "only 0 frames have a position"),
        ({"acceleration_m_s2": np.zeros(18_000)}, "a constant signal cannot be aligned"),
        ({"acceleration_m_s2": np.empty(0)}, "only 0 samples of the acceleration"),
        ({"acceleration_m_s2": np.ones(1)}, "only 1 samples of the acceleration"),
        ({"acceleration_m_s2": np.ones(2)}, "the reference has only 2 samples"),
        ({"acceleration_m_s2": np.ones(5)}, "only 5 samples"),
    ],
)
def test_nothing_to_align_by_gives_a_sentence_and_a_failed_clock(changes, sentence):
    motion = replace(record_motion(17), **changes)
    found = align(motion)
    assert isinstance(found, str)
    assert sentence in found
    verdict = verdict_on(motion, found)
    assert verdict.status == "failed"
    assert verdict.reasons == (found,)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"camera_times_s": np.zeros(1500)}, "camera_times_s must increase strictly"),
        ({"camera_times_s": np.arange(3.0)}, "equally many"),
        ({"acceleration_m_s2": np.full(100, np.nan)}, "acceleration_m_s2 must be finite"),
        ({"acceleration_sigma_m_s2": 0.0}, "acceleration_sigma_m_s2 must be positive"),
        ({"acceleration_sigma_m_s2": np.inf}, "acceleration_sigma_m_s2 must be positive"),
        ({"step_s": -1.0}, "step_s must be positive"),
        ({"step_s": np.nan}, "step_s must be positive"),
    ],
)
def test_a_callers_mistakes_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        align(replace(record_motion(17), **changes))


def test_the_inputs_are_left_alone():
    motion = record_motion(18, lost_share=0.1)
    kept = motion.displacement_m.copy(), motion.acceleration_m_s2.copy(), motion.camera_times_s.copy()
    align(motion)
    assert np.array_equal(motion.displacement_m, kept[0], equal_nan=True)
    assert np.array_equal(motion.acceleration_m_s2, kept[1])
    assert np.array_equal(motion.camera_times_s, kept[2])


@pytest.mark.parametrize("corrected", [True, False], ids=["faults taken out by hand", "faults left in"])
def test_a_track_of_another_hand_is_aligned_within_its_uncertainty(corrected):
    truth = json.loads(shared_file("tracks/SYNTHETIC_truth.json").read_text(encoding="utf-8"))
    numbers, positions = [], []
    with shared_file("tracks/SYNTHETIC_proanalyst_like_2000fps.csv").open(encoding="utf-8", newline="") as file:
        for row in list(csv.reader(file))[1:]:
            lost = row[2] == row[3] == truth["missing_marker"]
            faulty = corrected and int(row[0]) in (truth["spike_frame"], truth["duplicated_picture_frame"])
            numbers.append(int(row[0]))
            positions.append(np.nan if lost or faulty else 1e-3 * float(row[2]))
    record = np.loadtxt(shared_file("tracks/SYNTHETIC_accel_20kHz.csv"), delimiter=",", skiprows=1)
    silent = record[:1000, 1]
    fit = align_motion(
        np.array(numbers) / truth["fps"],
        np.array(positions),
        record[0, 0],
        1.0 / truth["accel_fs"],
        record[:, 1] - silent.mean(),
        acceleration_sigma_m_s2=float(silent.std()),
        drift_allowance=5e-5,
    )
    assert isinstance(fit, MotionFit), fit
    # at the camera time where the motion has its weight, 0.1 s into the record
    error = fit.offset_s - truth["offset_s"] + 0.1 * (fit.drift - 1e-6 * truth["ppm"])
    assert abs(error) < 3 * fit.u_offset_s
    assert fit.u_offset_s < 1e-5
    assert abs(fit.gain - 1 / (1 + truth["accel_gain_error"])) < 4 * fit.u_gain
    assert fit.marker_sigma_m == pytest.approx(1e-3 * truth["sigma_track_mm"], rel=0.1)
    assert corrected == (fit.frames_set_aside == 0)


@pytest.mark.exhaustive
@pytest.mark.parametrize("kick_m_s", [0.2, -0.3])
def test_a_velocity_that_a_bridged_gap_got_wrong_costs_nothing_where_the_gap_is_told(kick_m_s):
    motion = record_motion(3)
    at_s = ONSET_S + 0.06
    index = round((at_s - motion.start_s) / motion.step_s)
    wrong = motion.acceleration_m_s2.copy()
    wrong[index - 10 : index + 11] += kick_m_s / (21 * motion.step_s)
    kicked = replace(motion, acceleration_m_s2=wrong)
    untold, told = fit_of(kicked), fit_of(kicked, kicks_s=(at_s,))
    assert told.acceleration_density < untold.acceleration_density
    assert verdict_on(kicked, told).status == "ok", verdict_on(kicked, told).reasons
    assert abs(error_s(kicked, told)) < 4 * told.u_offset_s
    assert told.u_offset_s < 1.5 * fit_of(motion).u_offset_s


def test_a_kick_counts_where_ten_frames_saw_what_was_before_and_after_it():
    motion = record_motion(3)
    plain = fit_of(motion)
    assert plain.corrected is None
    mapped = motion.camera_times_s + plain.coarse_offset_s
    for frames, counts in ((9.5, False), (10.5, True)):
        for at in (frames, mapped.size - 1 - frames):
            kicked = fit_of(motion, kicks_s=(float(np.interp(at, np.arange(mapped.size), mapped)),))
            assert (kicked.best_log_likelihood != plain.best_log_likelihood) is counts


def test_a_velocity_that_was_never_there_tells_nothing_of_a_clock_of_which_nothing_is_known():
    motion = record_motion(3)
    at_s = ONSET_S + 0.06
    index = round((at_s - motion.start_s) / motion.step_s)
    wrong = motion.acceleration_m_s2.copy()
    wrong[index - 10 : index + 11] += 2.0 / (21 * motion.step_s)
    kicked = replace(motion, acceleration_m_s2=wrong)
    told = fit_of(kicked, drift_allowance=10.0, kicks_s=(at_s,))
    assert told.u_offset_s == pytest.approx(fit_of(motion, drift_allowance=10.0).u_offset_s, rel=0.1)
    assert abs(error_s(kicked, told)) < 2 * told.u_offset_s


def model_of(seed: int, **conditions: float) -> tuple[MotionModel, float, float, float]:
    motion = record_motion(seed, **conditions)
    integral = DoubleIntegral.of(motion.acceleration_m_s2, motion.start_s, motion.step_s)
    t = motion.camera_times_s
    density = motion.acceleration_sigma_m_s2**2 * motion.step_s
    middle = float(np.average(t, weights=velocity(t + motion.offset_s) ** 2))
    return MotionModel(t, motion.displacement_m, 0.5 * float(t[0] + t[-1]), integral), motion.offset_s, density, middle


def shift_of(model: MotionModel, start_s: float, density: float, *, sigma_m: float = 5e-5, **more: float):
    known = {"u_drift": 0.0, "since_s": 0.0, **more}
    return velocity_shift(model, start_s, 0.0, marker_variance=sigma_m**2, density=density, **known)


@pytest.mark.parametrize(
    "conditions",
    [{}, {"marker_sigma_m": 2e-4}, {"acceleration_sigma_m_s2": 20.0}, {"acceleration_sigma_m_s2": 0.01}],
    ids=["usual", "noisy marker", "noisy accelerometer", "marker alone"],
)
def test_errors_by_velocities_are_what_the_uncertainty_says(conditions):
    pulls = []
    for seed in range(40):
        model, offset_s, density, _ = model_of(seed, **conditions)
        shift_s, u_s = shift_of(model, offset_s + 3e-4, density, sigma_m=conditions.get("marker_sigma_m", 5e-5))
        pulls.append((shift_s - offset_s) / u_s)
    assert 0.75 < math.sqrt(np.mean(np.square(pulls))) < 1.25


def test_a_drift_that_is_not_known_widens_the_uncertainty_where_the_motion_is_not():
    model, offset_s, density, middle = model_of(1)
    _, plain = shift_of(model, offset_s, density)
    since = middle - model.origin_s
    _, near = shift_of(model, offset_s, density, u_drift=5e-5, since_s=since)
    _, far = shift_of(model, offset_s, density, u_drift=5e-5, since_s=since + 10.0)
    assert plain <= near < 3 * plain
    assert far == pytest.approx(10.0 * 5e-5, rel=0.02)


def test_velocities_are_those_over_the_span():
    t = np.arange(200) / 2000.0
    times, speeds = camera_velocity(t, travel(t))
    span = round(SPAN_S * 2000.0)
    assert times.size == 200 - span
    assert times == pytest.approx(t[:-span] + 0.5 * SPAN_S)
    assert speeds == pytest.approx((travel(t[span:]) - travel(t[:-span])) / SPAN_S)
    assert np.abs(speeds - velocity(times)).max() < 0.6


def test_where_nothing_moves_the_velocities_say_nothing():
    model, offset_s, density, _ = model_of(2)
    still = replace(model, integral=DoubleIntegral.of(np.zeros(18_000), 0.0, 5e-5))
    shift_s, u_s = shift_of(still, offset_s, density)
    assert math.isnan(shift_s)
    assert u_s == math.inf
    few = replace(model, times_s=model.times_s[:10], positions_m=model.positions_m[:10])
    assert shift_of(few, offset_s, density)[1] == math.inf
