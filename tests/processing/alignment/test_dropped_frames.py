from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.alignment import motion_alignment
from recoil_processing.alignment.motion_alignment import align_motion
from recoil_processing.alignment.motion_fit import MotionFit
from tests.builders.motions import ONSET_S, RecordedMotion, record_motion

RATE_HZ = 6000.0
PERIOD_S = 1.0 / RATE_HZ


def recorded(seed: int, **changes: float) -> RecordedMotion:
    return record_motion(seed, **{"frame_rate_hz": RATE_HZ, "frames": 2000, "marker_sigma_m": 6e-5, **changes})


def fit_of(motion: RecordedMotion) -> MotionFit:
    fit = align_motion(
        motion.camera_times_s,
        motion.displacement_m,
        motion.start_s,
        motion.step_s,
        motion.acceleration_m_s2,
        acceleration_sigma_m_s2=motion.acceleration_sigma_m_s2,
        drift_allowance=5e-5,
    )
    assert isinstance(fit, MotionFit), fit
    return fit


def frame_at(motion: RecordedMotion, since_onset_s: float) -> int:
    return round((ONSET_S + since_onset_s - motion.offset_s) * RATE_HZ)


def without(motion: RecordedMotion, *indices: int) -> RecordedMotion:
    left = np.delete(motion.displacement_m, indices)
    return replace(motion, displacement_m=left, camera_times_s=motion.camera_times_s[: left.size])


def with_twice(motion: RecordedMotion, index: int) -> RecordedMotion:
    more = np.insert(motion.displacement_m, index + 1, motion.displacement_m[index])
    return replace(motion, displacement_m=more, camera_times_s=np.arange(more.size) / RATE_HZ)


@pytest.mark.exhaustive
@pytest.mark.parametrize("since_onset_s", [0.004, 0.02, 0.06, 0.08])
@pytest.mark.parametrize("lost_share", [0.0, 0.3])
def test_a_missing_frame_is_located(since_onset_s, lost_share):
    motion = recorded(1, lost_share=lost_share)
    at = frame_at(motion, since_onset_s)
    (fault,) = fit_of(without(motion, at)).frame_faults
    assert fault.missing == 1
    assert fault.first <= at <= fault.last
    assert fault.first <= fault.index <= fault.last
    assert fault.last - fault.first < (6 if lost_share == 0 else 20)
    assert fault.period_s == pytest.approx(PERIOD_S)
    assert fault.time_s == pytest.approx(fault.index / RATE_HZ, abs=1e-9)


@pytest.mark.exhaustive
def test_the_stated_range_holds_the_true_frame():
    held = []
    for seed in range(6):
        motion = recorded(100 + seed)
        at = frame_at(motion, 0.08 + 0.01 * np.random.default_rng(seed).random())
        (fault,) = fit_of(without(motion, at)).frame_faults
        held.append(fault.first <= at <= fault.last)
    assert sum(held) >= 5


@pytest.mark.exhaustive
def test_a_picture_that_was_written_twice_is_found_by_its_repeated_position():
    motion = recorded(2)
    at = frame_at(motion, 0.05)
    (fault,) = fit_of(with_twice(motion, at)).frame_faults
    assert (fault.missing, fault.index, fault.first, fault.last) == (-1, at + 1, at + 1, at + 1)


@pytest.mark.exhaustive
def test_a_picture_that_was_written_twice_and_tracked_anew_is_found_as_well():
    motion = recorded(2)
    at = frame_at(motion, 0.05)
    twice = with_twice(motion, at)
    twice.displacement_m[at + 1] += 3e-5
    (fault,) = fit_of(twice).frame_faults
    assert fault.missing == -1
    assert fault.first <= at + 1 <= fault.last + 1
    assert fault.last - fault.first < 4


@pytest.mark.exhaustive
def test_corrected_times_give_the_offset_of_the_whole_track():
    motion = recorded(3)
    whole = fit_of(motion)
    for faulty in (without(motion, frame_at(motion, 0.03)), with_twice(motion, frame_at(motion, 0.03))):
        fit = fit_of(faulty)
        assert fit.corrected is not None
        assert fit.corrected.frame_faults == ()
        assert abs(fit.corrected.offset_s - whole.offset_s) < 0.3 * whole.u_offset_s


@pytest.mark.exhaustive
def test_two_missing_frames_are_told_apart():
    motion = recorded(4)
    first, second = frame_at(motion, 0.015), frame_at(motion, 0.07)
    faults = fit_of(without(motion, first, second)).frame_faults
    assert [fault.missing for fault in faults] == [1, 1]
    assert faults[0].index == pytest.approx(first, abs=3)
    # in the file, the second one is one frame further on
    assert faults[1].index == pytest.approx(second - 1, abs=3)


@pytest.mark.exhaustive
def test_two_frames_that_are_missing_at_one_place_are_two():
    motion = recorded(5)
    at = frame_at(motion, 0.04)
    faults = fit_of(without(motion, at, at + 1)).frame_faults
    assert [fault.missing for fault in faults] == [1, 1]
    assert all(fault.index == pytest.approx(at, abs=3) for fault in faults)


@pytest.mark.parametrize("since_onset_s", [-0.02, 0.118, 0.65])
def test_a_frame_that_is_missing_at_rest_is_another_offset_and_no_fault(since_onset_s):
    motion = recorded(6, frames=4500)
    fit = fit_of(without(motion, frame_at(motion, since_onset_s)))
    assert fit.frame_faults == ()
    assert fit.corrected is None


@pytest.mark.exhaustive
@pytest.mark.parametrize("jump_m", [0.5e-3, -1.4e-3, 23.6e-3])
def test_a_jump_of_the_track_is_no_missing_frame(jump_m):
    motion = recorded(7)
    at = frame_at(motion, 0.05)
    motion.displacement_m[at:] += jump_m
    fit = fit_of(motion)
    (fault,) = fit.frame_faults
    assert fault.missing == 0
    assert fault.jump_m == pytest.approx(jump_m, abs=1e-4)
    assert fault.first <= at <= fault.last
    assert fit.corrected is not None
    whole = fit_of(recorded(7))
    assert abs(fit.corrected.offset_s - whole.offset_s) < 0.5 * fit.corrected.u_offset_s
    # without the jump it is as sure as if there had been none
    assert fit.corrected.u_offset_s == pytest.approx(whole.u_offset_s, rel=0.1)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "conditions",
    [
        {},
        {"lost_share": 0.3},
        {"frame_rate_hz": 2000.0, "frames": 1500},
        {"acceleration_sigma_m_s2": 20.0, "marker_sigma_m": 2e-4},
        {"rate_hz": 5000.0},
        {"duration_s": 0.3},
    ],
    ids=["usual", "a third lost", "2000 frames per second", "noisy", "slow recorder", "recorder ends"],
)
def test_a_clean_track_raises_no_alarm(conditions):
    for seed in range(4):
        assert fit_of(recorded(200 + seed, **conditions)).frame_faults == ()


def test_single_faulty_frames_and_known_gaps_are_no_missing_frames():
    motion = recorded(8)
    spiked = motion.displacement_m.copy()
    spiked[frame_at(motion, 0.02)] += 0.012
    repeat = frame_at(motion, 0.05)
    spiked[repeat] = spiked[repeat - 1]
    gap = np.arange(frame_at(motion, 0.03), frame_at(motion, 0.034))
    motion = replace(
        motion, displacement_m=np.delete(spiked, gap), camera_times_s=np.delete(motion.camera_times_s, gap)
    )
    assert fit_of(motion).frame_faults == ()


def test_two_motions_are_not_searched_for_frames(monkeypatch):
    motion = recorded(1)
    monkeypatch.setattr(motion_alignment, "find_frame_faults", lambda *_, **__: pytest.fail("it was searched"))
    assert fit_of(replace(motion, displacement_m=3.0 * motion.displacement_m)).gain > motion_alignment.MOST_GAIN
