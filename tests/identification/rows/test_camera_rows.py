"""A camera's frames as rows: what they are means of, their derivatives, and how large their errors are."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.estimate.mass import ACCELERATION as ACCELERATION_SCALE
from recoil_identification.inference.block import JointBlock
from recoil_identification.inference.solve import solve
from recoil_identification.rows.camera_rows import BEFORE_S, LATE, MEAN_S, START, CameraRows, camera_rows
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.equation_of_motion import ACCELERATION, CAMERA, ZERO
from recoil_identification.rows.row_noise import correlation_of
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.shot.preparation import prepare
from recoil_processing.shot.camera_motion import RecordedMotion, recorded_motion
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.signals import Signals
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot, with_channels

RIGS = ["field-2013", "mixed"]


def rows_of(name: str, seed: int = 3) -> CameraRows:
    camera = identified(name, seed).route.calibration.camera
    assert isinstance(camera, CameraRows)
    return camera


@cache
def tracked(name: str) -> RecordedMotion:
    virtual = virtual_shot(name)
    before = prepare(FiredShot(virtual.shot, virtual.rig))
    track = recorded_motion(before.signals, before.acceleration_m_s2, before.camera, before.camera_clock)
    assert track is not None
    return track


def rows_with(name: str, track: RecordedMotion, signals: Signals | None = None) -> CameraRows | None:
    found, virtual = identified(name), virtual_shot(name)
    before = prepare(FiredShot(virtual.shot, virtual.rig))
    causes = found.route.calibration.block.causes
    return camera_rows(
        track,
        found.route.fitted,
        found.route.recorded,
        before.inertial_m_s2,
        causes,
        signals or before.signals,
        virtual.rig,
    )


@pytest.mark.parametrize("name", RIGS)
def test_each_row_is_the_mean_of_the_frames_of_a_millisecond_up_to_the_end_of_travel(name):
    rows, motion = rows_of(name), tracked(name).motion
    onset_s, end_s = identified(name).route.fitted.interval_s
    assert np.all(np.diff(rows.times_s) > 0)
    assert rows.times_s[0] >= onset_s - BEFORE_S - MEAN_S
    assert rows.times_s[-1] <= end_s
    for at in (0, rows.times_s.size // 2):
        first_s = onset_s + MEAN_S * np.floor((rows.times_s[at] - onset_s) / MEAN_S)
        own = (motion.times_s >= first_s) & (motion.times_s < first_s + MEAN_S)
        assert rows.recorded_m[at] == pytest.approx(motion.positions_m[own].mean(), abs=1e-12)
        assert rows.sigma_m[at] == pytest.approx(np.sqrt(motion.marker_variance / own.sum()))


@pytest.mark.parametrize("name", RIGS)
def test_derivatives_are_what_a_step_of_each_unknown_does(name):
    rows, calibration = rows_of(name), identified(name).route.calibration
    values = {unknown: 1.3 * calibration.inferred.value(unknown) for unknown in rows.unknowns}
    _, derivatives = rows.linearised(values)
    for unknown, derivative in zip(rows.unknowns, derivatives.T, strict=True):
        step = 1e-3 * max(calibration.inferred.u(unknown), 1e-9)
        up, down = (rows.linearised(values | {unknown: values[unknown] + sign * step})[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose((down - up) / (2 * step), derivative, rtol=1e-5, atol=1e-5 / step * 1e-3)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", RIGS)
def test_what_the_motion_leaves_of_rows_and_frames_is_as_large_as_their_stated_errors(name):
    left, count = 0.0, 0
    for seed in (3, 4):
        calibration = identified(name, seed).route.calibration
        whitened, _ = calibration.rows.linearised(calibration.values)
        left += float(whitened @ whitened)
        count += whitened.size
    # the estimate fits some of the errors, and the rows' part that is proportional to the motion is on the safe side
    assert 0.8 < left / count < 1.05


def test_frames_are_in_the_scale_of_the_camera_and_on_its_clock():
    rows = rows_of("mixed")
    calm = dict.fromkeys(rows.unknowns, 0.0)
    rests = rows.times_s < rows.onset_s - MEAN_S
    for unknown, size, other in ((CAMERA.name, 0.01, 0.0), (ACCELERATION.name, -0.01, rows.other_m[-1])):
        moved = rows.sigma_m * (rows.linearised(calm)[0] - rows.linearised(calm | {unknown: size})[0])
        assert np.all(moved[rests] == 0)
        # the travel's own scale, and for the accelerometer without what the carriage adds
        assert moved[-1] == pytest.approx(0.01 * (rows.recorded_m[-1] - other), rel=0.02)
    late = rows.sigma_m * (rows.linearised(calm)[0] - rows.linearised(calm | {LATE.name: 1e-4})[0])
    speed_m_s = np.gradient(rows.recorded_m, rows.times_s)
    fast = speed_m_s > 0.5 * speed_m_s.max()
    np.testing.assert_allclose(late[fast], 1e-4 * speed_m_s[fast], rtol=0.1)
    assert {START.name, ZERO.name} <= set(rows.unknowns)


@pytest.mark.exhaustive
def test_of_a_camera_and_an_accelerometer_that_contradict_one_another_the_less_certain_is_named():
    virtual = virtual_shot("field-2013")
    camera = virtual.shot.by_role("recoil_displacement")
    shot = with_channels(virtual.shot, **{camera.name: 0.98 * np.asarray(camera.samples)})
    found = identify_shot(
        FiredShot(replace(shot, alignments=align_clocks(FiredShot(shot, virtual.rig))), virtual.rig), Options()
    )
    assert found.reasons[0].startswith(f"{ACCELERATION_SCALE} contradicts the other sensors: it reads high by 3.")
    size, u = (float(one) for one in re.findall(r"right, (\S+) % with u (\S+) %", found.reasons[0])[0])
    # of what reads high beside a camera that reads 2 % low
    assert size == pytest.approx(100 * (1 / 0.98 - 1), abs=2 * u)
    assert 0.3 < u < 1.0
    residuals = found.route.calibration.normalised_residuals
    assert residuals[CAMERA_SCALE] == pytest.approx(-residuals[ACCELERATION_SCALE], abs=0.3)


def test_a_bent_picture_costs_the_mass_little():
    track = tracked("mixed")
    share = track.motion.positions_m / track.motion.positions_m.max()
    bent = replace(track.motion, positions_m=track.motion.positions_m + 3e-4 * 4 * share * (1 - share))
    found, straight = identified("mixed"), rows_of("mixed")
    rows = rows_with("mixed", replace(track, motion=bent))
    assert rows is not None
    calibration = found.route.calibration
    correlation = correlation_of(found.route.fitted, calibration.block.rows, calibration.noise, rows)
    blocks = [JointBlock((calibration.block, rows), correlation), *calibration.further]
    moved = solve(calibration.inferred.unknowns, blocks, [*calibration.common, *calibration.own])
    was = calibration.inferred
    assert moved.value(DISTORTIONS[0]) - was.value(DISTORTIONS[0]) > 5e-5
    assert abs(moved.value("ln mass") - was.value("ln mass")) < 0.5 * was.u("ln mass")
    assert rows.times_s.size == straight.times_s.size


def test_where_nothing_tells_how_the_carriage_moves_the_frames_say_nothing():
    virtual = virtual_shot("field-2013")
    sound = prepare(FiredShot(virtual.shot, virtual.rig)).signals
    for role in ("carriage_acceleration_x", "carriage_acceleration_y"):
        series = {one: samples for one, samples in sound.series.items() if one != role}
        assert rows_with("field-2013", tracked("field-2013"), replace(sound, series=series)) is None
    one_rate = {role: samples for role, samples in sound.series.items() if role != "carriage_rate"}
    assert rows_with("field-2013", tracked("field-2013"), replace(sound, series=one_rate)) is not None


@pytest.mark.exhaustive
def test_without_the_carriages_accelerometers_a_shot_is_identified_without_its_camera_and_says_so():
    virtual = virtual_shot("field-2013")
    shot, rig = (one.without_channel("acc_carriage_x") for one in (virtual.shot, virtual.rig))
    found = identify_shot(FiredShot(replace(shot, alignments=align_clocks(FiredShot(shot, rig))), rig), Options())
    assert found.inertial.calibration.camera is None
    (note,) = [
        note for note in found.notes if note.startswith("no usable channel of role carriage_acceleration_x tells")
    ]
    assert note.endswith("its frames are not used")
    sound = identified("field-2013").chosen.estimate
    assert found.chosen.estimate.u_kg > 1.3 * sound.u_kg
    assert abs(found.chosen.estimate.mass_kg - virtual.truth["m3"]) < 2 * found.chosen.estimate.u_kg


def test_what_is_uncertain_of_the_carriage_is_what_its_sensors_state():
    rows, offsets = rows_of("field-2013"), identified("field-2013").route.signals.offsets
    zeros = [offsets[f"carriage_acceleration_{axis}"].u for axis in "xy"]
    assert rows.u_other_rel == 0.01
    assert rows.u_other_zero_m_s2 == pytest.approx(np.hypot(*zeros))
    assert rows.u_distortion_m == 1e-4


def test_too_few_frames_are_no_rows():
    track = tracked("mixed")
    onset_s, _ = identified("mixed").route.fitted.interval_s
    early = track.motion.times_s < onset_s + 8e-3
    motion = replace(track.motion, times_s=track.motion.times_s[early], positions_m=track.motion.positions_m[early])
    assert rows_with("mixed", replace(track, motion=motion)) is None
