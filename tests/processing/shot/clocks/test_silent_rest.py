"""A rest without noise is that of a better instrument: the clocks are aligned by the motion as before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.alignment.align import judge_motion
from recoil_processing.alignment.motion_alignment import INFLATIONS, align_motion
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.motions import record_motion
from tests.builders.virtual_shots import virtual_shot, with_channels


@pytest.mark.exhaustive
@pytest.mark.parametrize("left", [0.0, 0.05])
def test_a_camera_is_aligned_against_accelerometers_whose_rest_is_silent(left):
    virtual = virtual_shot()
    (before,) = align_clocks(FiredShot(replace(virtual.shot, alignments=()), virtual.rig))
    silent = {}
    for channel in virtual.shot.channels.values():
        if channel.quantity in ("acceleration", "angular_rate"):
            silent[channel.name] = samples = np.array(channel.samples, dtype=np.float64)
            rest = channel.time_base.times_s < 0.0495
            samples[rest] = samples[rest].mean() + left * (samples[rest] - samples[rest].mean())
    shot = replace(with_channels(virtual.shot, **silent), alignments=())
    (found,) = align_clocks(FiredShot(shot, virtual.rig))
    assert (before.status, found.status) == ("ok", "ok"), found.reasons
    assert found.offset_s == pytest.approx(before.offset_s, abs=3 * before.u_offset_s)


def test_of_more_noise_than_was_tried_no_number_is_claimed():
    motion = record_motion(1)
    fit = align_motion(
        motion.camera_times_s, motion.displacement_m, motion.start_s, motion.step_s, motion.acceleration_m_s2,
        acceleration_sigma_m_s2=5.0, drift_allowance=1e-4,
    )  # fmt: skip
    assert isinstance(fit, MotionFit)
    for times, words in ((INFLATIONS[-1], "1024 times or more (no more are tried)"), (500.0, "500 times")):
        density = fit.acceleration_density / times
        found = judge_motion("camera", fit, u_gain=0.02, noise_density=density, frame_period_s=5e-4)
        assert found.status == "failed"
        assert f"do not show the same motion: {words} the accelerometer's noise" in found.reasons[0]
