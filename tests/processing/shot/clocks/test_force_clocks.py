from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_processing.shot.clocks.force_clocks import recoil_only
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.tracked_rigs import tracked_shot
from tests.builders.virtual_shots import with_channels, without_channels


def test_the_recoil_ends_where_the_track_turns_back_and_not_at_a_single_frame():
    t = np.linspace(0.0, 2.0, 201)
    track = np.sin(0.5 * np.pi * t)
    track[30] = 5.0
    track[60] = np.nan
    kept = recoil_only(track)
    last = int(np.flatnonzero(np.isfinite(kept))[-1])
    assert abs(t[last] - 1.0) < 0.05
    assert np.array_equal(kept[: last + 1], track[: last + 1], equal_nan=True)


def test_a_short_track_is_left_as_it_is():
    track = np.array([0.0, np.nan, 0.1])
    assert np.array_equal(recoil_only(track), track, equal_nan=True)


def test_a_track_that_stands_still_is_not_aligned():
    virtual = tracked_shot()
    still = 1e-5 * np.random.default_rng(0).normal(size=virtual.shot.channels["x_camera"].samples.size)
    shot = with_channels(virtual.shot, x_camera=still)
    (clock,) = align_clocks(FiredShot(shot, virtual.rig))
    assert clock.status == "failed"
    assert "does not move" in clock.reasons[0]


def test_without_a_force_the_camera_is_not_aligned():
    virtual = tracked_shot()
    (clock,) = align_clocks(FiredShot(without_channels(virtual.shot, "p_brake"), virtual.rig))
    assert clock.status == "failed"
    assert "brake_pressure" in clock.reasons[0]


@pytest.mark.exhaustive
def test_a_shift_of_the_track_is_found_to_its_uncertainty():
    virtual = tracked_shot()
    camera = virtual.shot.channels["x_camera"]
    base = TimeBase.stamped("camera", camera.time_base.times_s + 0.0123)
    moved = replace(virtual.shot, channels={**virtual.shot.channels, "x_camera": replace(camera, time_base=base)})
    (before,), (after,) = (align_clocks(FiredShot(shot, virtual.rig)) for shot in (virtual.shot, moved))
    assert abs(before.offset_s - after.offset_s - 0.0123) < before.u_offset_s


@pytest.mark.exhaustive
def test_a_scale_that_no_mass_can_have_is_doubted():
    virtual = tracked_shot()
    shot = with_channels(virtual.shot, x_camera=2.0 * np.asarray(virtual.shot.channels["x_camera"].samples))
    (clock,) = align_clocks(FiredShot(shot, virtual.rig))
    assert clock.status == "ambiguous"
    assert any("off the specification" in reason for reason in clock.reasons)
