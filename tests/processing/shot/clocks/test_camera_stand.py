"""A camera that stands elsewhere than its rig file says is named as such, and its clock is not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.remark import ReasonCode
from recoil_processing.shot.clocks.motion_clocks import allowed_drift
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.mass_reasons import doubted_clocks
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.ground_shots import ground_shot
from tests.builders.virtual_shots import virtual_shot


def camera_clock(virtual):
    return next(one for one in virtual.shot.alignments if one.clock == "camera")


@pytest.mark.exhaustive
@pytest.mark.parametrize(("soft", "accelerometer"), [(True, False), (False, True)])
def test_a_camera_on_the_ground_that_the_rig_does_not_state_is_named(soft, accelerometer):
    virtual = ground_shot(soft=soft, sees=None, accelerometer=accelerometer)
    clock = camera_clock(virtual)
    assert (clock.status, clock.details["sees"]) == ("ambiguous", "ground")
    (reason,) = doubted_clocks(FiredShot(virtual.shot, virtual.rig))
    assert (reason.code, reason.about) == (ReasonCode.RIG, "rig file")
    assert 'write `sees = "ground"` in its [[source]]' in str(reason)


@pytest.mark.exhaustive
def test_a_camera_with_the_tipping_part_of_which_the_rig_says_the_ground_is_named_too():
    clock = camera_clock(ground_shot(sees="ground", stands="tipping_part"))
    assert (clock.status, clock.details["sees"]) == ("ambiguous", "tipping_part")


@pytest.mark.parametrize("soft", [True, False])
def test_one_that_is_stated_has_a_clock_beyond_doubt_that_lies_where_it_does(soft):
    virtual = ground_shot(soft=soft)
    clock, true = camera_clock(virtual), virtual.truth["clocks"]["camera"]
    assert clock.status == "ok"
    at_s = 0.15
    off_s = clock.to_reference(at_s) - ((1.0 + true["drift"]) * at_s + true["offset_s"])
    assert abs(off_s) < 4.0 * clock.u_offset_s < 4e-5


@pytest.mark.exhaustive
def test_another_shots_pictures_are_no_camera_elsewhere():
    own = ground_shot(sees=None, stands="tipping_part")
    pictures = own.shot.channels["x_camera"]
    stronger = replace(pictures, samples=1.15 * pictures.samples)
    shot = replace(own.shot, channels={**own.shot.channels, "x_camera": stronger})
    (clock,) = (one for one in align_clocks(FiredShot(shot, own.rig)) if one.clock == "camera")
    assert clock.status != "ok"
    assert "sees" not in (clock.details or {})


# ------------------------------------------------------------------------------------------ rates of frames


def allowed(frame_s: float, **of_source: float) -> float:
    virtual = virtual_shot()
    channel = virtual.shot.channels["x_camera"]
    timed = replace(channel, time_base=TimeBase.uniform("camera", 0.0, frame_s, channel.samples.size))
    shot = replace(virtual.shot, channels={**virtual.shot.channels, "x_camera": timed})
    source = virtual.rig.source("camera").model_copy(update=of_source)
    return allowed_drift(FiredShot(shot, virtual.rig), source, 5e-5)


@pytest.mark.parametrize("frame_s", [1 / 6000, 1 / 5000, 200e-6, 1 / 2997.3])
def test_frames_per_second_that_were_set_or_are_no_whole_microseconds_are_as_sure_as_the_clock(frame_s):
    assert allowed(frame_s) == pytest.approx(5e-5)


def test_a_frame_of_rounded_microseconds_is_as_uncertain_as_its_rounding():
    # 6000 frames per second, written as 167 us: uniform within half a microsecond of it
    assert allowed(167e-6) == pytest.approx(math.hypot(5e-5, 1e-6 / math.sqrt(12) / 167e-6), rel=1e-6)


def test_what_the_rig_states_of_the_frames_per_second_counts_instead():
    assert allowed(167e-6, u_frame_rate=12.0) == pytest.approx(math.hypot(5e-5, 12.0 * 167e-6), rel=1e-6)
    assert allowed(167e-6, u_frame_rate=0.0) == pytest.approx(5e-5)
