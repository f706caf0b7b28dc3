"""A failed check decides by what it can do to the mass, and a noisy channel is never worse than a missing one."""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import Shot
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.verdict.consequence import LEAST_CONSEQUENCE, least_u_rel, set_aside, weighed
from recoil_processing.shot.verdict.mass_reasons import against_the_record
from recoil_processing.shot.verdict.motion_quality import recoil_of
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from tests.builders.virtual_shots import VirtualShot, identified, virtual_shot

ON = CalibrationDay(dt.date(2026, 6, 1), DayOf.START)


def with_noise(virtual: VirtualShot, role: str, factor: float) -> Shot:
    """Add noise to a channel, so many times its own, and judge the shot anew."""
    channel = virtual.shot.by_role(role)
    assert channel is not None
    own = float(np.nanstd(channel.samples[:200]))
    noise = factor * own * np.random.default_rng(1).standard_normal(channel.samples.size)
    channels = {**virtual.shot.channels, channel.name: replace(channel, samples=channel.samples + noise)}
    shot = replace(virtual.shot, channels=channels)
    return replace(shot, quality=check_shot(FiredShot(shot, virtual.rig), shot.alignments, {}, ON))


def found_by(shot: Shot, virtual: VirtualShot) -> Identification:
    return identify_shot(FiredShot(shot, virtual.rig), Options())


def check_of(shot: Shot, role: str, check: Check) -> QualityCheck:
    channel = shot.by_role(role)
    assert channel is not None
    (one,) = [q for q in shot.quality if (q.channel, q.check) == (channel.name, check)]
    return one


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_a_carriage_gyro_that_hardly_leaves_its_noise_is_a_warning_with_its_kilograms(name: str) -> None:
    virtual = virtual_shot(name)
    shot = with_noise(virtual, "carriage_rate", {"field-2013": 30.0, "mixed": 1.2}[name])
    check = check_of(shot, "carriage_rate", Check.FILTERED_NOISE)
    ratio_db = float(re.match(r"pulse (-?\d+) dB", check.detail)[1])
    assert ratio_db <= 8
    assert check.verdict == "warn"
    stated_kg = float(re.search(r"moves the mass by up to ([\d.]+) kg", check.detail)[1])
    assert stated_kg <= LEAST_CONSEQUENCE * least_u_rel(virtual.rig) * virtual.rig.mechanism.m3
    found, plain = found_by(shot, virtual), identified(name)
    assert (shot.usable, found.valid) == (True, True), (shot.reasons, found.reasons)
    # and that is what it does, to the noise's own scatter
    assert abs(found.chosen.estimate.mass_kg - plain.chosen.estimate.mass_kg) < 2 * stated_kg + 0.02


@pytest.mark.exhaustive
def test_a_channel_whose_noise_moves_the_mass_is_set_aside_and_judged_as_if_it_were_missing() -> None:
    virtual = virtual_shot("mixed")
    shot = with_noise(virtual, "carriage_rate", 20.0)
    assert check_of(shot, "carriage_rate", Check.SET_ASIDE).verdict == "warn"
    found = found_by(shot, virtual)
    missing = identify_shot(FiredShot(shot.without_channel("gyro_carriage"), virtual.rig), Options())
    assert (shot.usable, found.valid, missing.valid) == (True, True, True)
    assert found.chosen.estimate.mass_kg == missing.chosen.estimate.mass_kg
    assert found.notes[0].startswith("gyro_carriage is set aside: ")


@pytest.mark.exhaustive
def test_a_channel_without_which_no_mass_is_valid_still_fails() -> None:
    virtual = virtual_shot("mixed")
    shot = with_noise(virtual, "tipping_rate", 20.0)
    check = check_of(shot, "tipping_rate", Check.FILTERED_NOISE)
    assert check.verdict == "fail"
    assert "moves the mass by up to" in check.detail
    assert (shot.state, found_by(shot, virtual).valid) == ("not usable", False)
    assert not found_by(shot.without_channel("gyro_tipping"), virtual).valid


def test_what_is_wrong_and_what_more_than_corrects_is_a_failure_as_before() -> None:
    virtual = virtual_shot("mixed")
    shot = virtual.shot
    recoil = recoil_of(FiredShot(shot, virtual.rig), {a.clock: a for a in shot.alignments})
    kept = [
        QualityCheck("acc_carriage_x", Check.CARRIAGE, "fail", "turned"),
        QualityCheck("gyro_carriage", Check.CONSTANT, "fail", "not connected"),
        QualityCheck("p_brake", Check.FILTERED_NOISE, "fail", "loud"),
        QualityCheck("can", Check.MISSING_FRAMES, "fail", "many"),
        QualityCheck("acc_recoil_can", Check.RANGE, "fail", "clipped, and the brake's clock hangs on it"),
        QualityCheck("shot", Check.ONSET, "fail", "none"),
    ]
    assert weighed(kept, FiredShot(shot, virtual.rig), recoil) == kept


def test_a_channel_that_no_mass_hangs_on_fails_nothing() -> None:
    virtual = virtual_shot()
    shot, rig = virtual.shot, virtual.rig
    channel = replace(shot.channels["gyro_carriage"], role="")
    (spec,) = [one for one in rig.channels if one.name == "gyro_carriage"]
    bare = replace(
        rig, channels=tuple(one.model_copy(update={"role": ""}) if one is spec else one for one in rig.channels)
    )
    shot = replace(shot, channels={**shot.channels, "gyro_carriage": channel})
    recoil = recoil_of(FiredShot(shot, bare), {a.clock: a for a in shot.alignments})
    (check,) = weighed([QualityCheck("gyro_carriage", Check.RANGE, "fail", "clipped")], FiredShot(shot, bare), recoil)
    assert (check.verdict, check.detail) == ("warn", "clipped; no mass hangs on it")


def judged(shot: Shot, rig: Rig) -> Shot:
    """Judge a shot as ingest does."""
    fired = FiredShot(shot, rig)
    shot = replace(shot, quality=check_shot(fired, shot.alignments, {}, ON))
    return replace(shot, against_mass=against_the_record(FiredShot(shot, rig)))


def without_source(shot: Shot, source: str) -> Shot:
    """Leave out what a source recorded, and how its clock was aligned."""
    channels = {name: one for name, one in shot.channels.items() if one.time_base.clock != source}
    return replace(shot, channels=channels, alignments=tuple(a for a in shot.alignments if a.clock != source))


@pytest.mark.whole_way
def test_a_camera_that_did_not_fire_costs_no_more_than_one_that_is_not_there() -> None:
    virtual = virtual_shot("mixed")
    shot = judged(without_source(virtual.shot, "camera"), virtual.rig)
    (aside,) = set_aside(shot)
    assert (aside.channel, aside.verdict, shot.usable) == ("camera", "warn", True)
    assert "no file of source camera was given: x_camera missing; add its file; the mass is found" in aside.detail
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    bare = replace(virtual.rig, sources=tuple(s for s in virtual.rig.sources if s.name != "camera"))
    bare = bare.without_channel("x_camera")
    never = identify_shot(FiredShot(replace(shot, quality=()), bare), Options())
    assert (found.valid, never.valid) == (True, True), found.reasons
    assert found.chosen.estimate.mass_kg == never.chosen.estimate.mass_kg
    assert found.chosen.estimate.u_kg == never.chosen.estimate.u_kg
    assert found.notes[0].startswith("camera is set aside: no file of source camera was given")


@pytest.mark.whole_way
@pytest.mark.parametrize("sigma_m", [np.nan, 5e-5], ids=["no mark", "no motion"])
def test_a_film_without_a_mark_or_a_motion_is_as_good_as_none(sigma_m: float) -> None:
    virtual = virtual_shot("mixed")
    camera = virtual.shot.channels["x_camera"]
    dark = replace(camera, samples=sigma_m * np.random.default_rng(1).standard_normal(camera.samples.size))
    failed = tuple(replace(a, status="failed") if a.clock == "camera" else a for a in virtual.shot.alignments)
    shot = replace(virtual.shot, channels={**virtual.shot.channels, "x_camera": dark}, alignments=failed)
    shot = judged(shot, virtual.rig)
    assert ([one.channel for one in set_aside(shot)], shot.reasons) == (["camera"], ())
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    absent = judged(without_source(virtual.shot, "camera"), virtual.rig)
    assert (found.reasons, found.chosen.estimate.mass_kg) == (
        (), identify_shot(FiredShot(absent, virtual.rig), Options()).chosen.estimate.mass_kg,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("source", "lacks"), [("can", "p_brake, p_recuperator, acc_recoil_can"), ("imu", "gyro_carriage, gyro_tipping")]
)
def test_a_source_that_the_mass_hangs_on_must_be_there(source: str, lacks: str) -> None:
    virtual = virtual_shot("mixed")
    shot = judged(without_source(virtual.shot, source), virtual.rig)
    assert (shot.state, set_aside(shot)) == ("not usable", ())
    # what is missing for it is no second reason
    (reason,) = shot.reasons
    assert f"no file of source {source} was given: {lacks}" in reason


def test_where_no_mass_can_be_asked_a_corrector_only_warns() -> None:
    virtual = virtual_shot("mixed")
    shot = without_source(virtual.shot, "can")
    noise = [QualityCheck("acc_carriage_y", Check.FILTERED_NOISE, "fail", "pulse 18 dB above the noise")]
    fired = FiredShot(shot, virtual.rig)
    recoil = recoil_of(fired, {a.clock: a for a in shot.alignments})
    assert [one.verdict for one in weighed(noise, fired, recoil)] == ["warn"]
    # by the camera alone the carriage is in the mass, and nothing says by how much
    camera = virtual.shot.without_channel("acc_recoil")
    assert [one.verdict for one in weighed(noise, FiredShot(camera, virtual.rig), None)] == ["fail"]


@pytest.mark.whole_way
@pytest.mark.parametrize("felt", [True, False], ids=["beside the accelerometer", "alone"])
def test_the_origin_of_a_cameras_picture_is_anywhere(felt: bool) -> None:
    virtual = virtual_shot("field-2013")
    camera = virtual.shot.channels["x_camera"]
    masses = []
    for origin_m in (0.0, 0.2205, -0.8):
        moved = replace(camera, samples=camera.samples + origin_m)
        shot = replace(virtual.shot, channels={**virtual.shot.channels, "x_camera": moved})
        shot = shot if felt else shot.without_channel("acc_recoil")
        found = found_by(shot, virtual)
        assert not [note for note in found.notes if "place before the shot" in note]
        masses.append(found.chosen.estimate.mass_kg)
    assert masses[1:] == pytest.approx([masses[0]] * 2, rel=1e-6)
