"""The mass of a body on a line, against rows that are written down here, and the laws that it keeps."""

from __future__ import annotations

import datetime as dt
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.rows.unread_resistance import SHARE, SLIDE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.line_regression import LEAST_SPACED
from recoil_processing.shot.verdict.mass_reasons import against_the_record
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.twin import simulate_shot
from tests.builders.line_motions import TURNING_M_S, LineBody
from tests.builders.line_shots import DAY, drop_tower, hammer, sled_outcome, sled_without_camera
from tests.builders.virtual_shots import with_channels

ALL = ("driving_force", "resisting_force", "recoil_acceleration", "recoil_velocity")
BODY = LineBody()


def found(fired: FiredShot, cutoff_hz: float | None = None) -> Identification:
    return identify_shot(fired, Options(cutoff_hz=cutoff_hz))


def mass_kg(fired: FiredShot, cutoff_hz: float | None = 20.0) -> float:
    return found(fired, cutoff_hz).chosen.estimate.mass_kg


@pytest.mark.whole_way
def test_the_mass_is_that_of_rows_written_down_here() -> None:
    read = BODY.readings()
    mass = found(BODY.fired(*ALL, readings=read), 12.0).chosen.estimate
    # mass, both frictions and the zero, both sides behind a low-pass of scipy's
    sos = butter(4, 12.0, fs=BODY.rate_hz, output="sos")
    v = read["recoil_velocity"]
    columns = [read["recoil_acceleration"], np.tanh(v / TURNING_M_S), v, np.ones(v.size)]
    table = np.column_stack([sosfiltfilt(sos, column) for column in columns])
    net = sosfiltfilt(sos, read["driving_force"] - read["resisting_force"])
    oracle = np.linalg.lstsq(table[50:-50], net[50:-50], rcond=None)[0]
    assert oracle[0] == pytest.approx(BODY.mass_kg, rel=1e-3)
    assert mass.mass_kg == pytest.approx(oracle[0], abs=0.5 * mass.u_kg)
    assert abs(mass.mass_kg - BODY.mass_kg) < 2.0 * mass.u_kg
    # the driving cell is known to 1 %, and the mass no better than it
    assert 0.0099 < mass.u_kg / mass.mass_kg < 0.015


@pytest.mark.whole_way
def test_a_record_that_begins_in_motion_is_valid_and_says_what_was_taken_for_its_noise() -> None:
    result = found(BODY.fired(*ALL))
    assert result.valid, result.reasons
    assert any("begins in motion" in str(note) for note in result.notes)
    assert {SLIDE, SHARE} <= {row.source for row in result.chosen.estimate.budget}


@pytest.mark.whole_way
def test_frictions_that_are_off_are_found() -> None:
    declared = BODY.fired(*ALL, friction=14.0, slide_friction=150.0)
    calibration = found(declared, 20.0).route.calibration
    assert declared.rig.mechanism.friction - calibration.friction_error_n == pytest.approx(20.0, abs=1.0)
    assert 150.0 + calibration.inferred.value(SLIDE) == pytest.approx(200.0, abs=8.0)


@pytest.mark.parametrize("role", ["recoil_velocity", "recoil_displacement"])
def test_what_is_no_acceleration_is_differentiated(role: str) -> None:
    result = found(BODY.fired("driving_force", "resisting_force", role), 10.0)
    mass = result.chosen.estimate
    assert abs(mass.mass_kg - BODY.mass_kg) < 2.0 * mass.u_kg
    assert mass.u_kg < 0.03 * mass.mass_kg
    assert ErrorSource(SourceKind.SENSITIVITY, role) in {row.source for row in mass.budget}


@pytest.mark.whole_way
def test_a_rest_before_the_motion_tells_the_zero_of_the_accelerometer() -> None:
    body = replace(BODY, rest_s=0.5)
    read = body.readings()
    read["recoil_acceleration"] = read["recoil_acceleration"] + 0.03
    result = found(body.fired("driving_force", "resisting_force", "recoil_acceleration", readings=read), 20.0)
    assert result.route.signals.offsets["recoil_acceleration"].value == pytest.approx(0.03, abs=2e-3)
    assert result.route.recorded.interval_s[0] == pytest.approx(0.5, abs=0.02)
    assert abs(result.chosen.estimate.mass_kg - body.mass_kg) < 2.0 * result.chosen.estimate.u_kg


def test_without_a_rest_and_a_speed_no_friction_has_a_direction() -> None:
    fired = BODY.fired("driving_force", "resisting_force", "recoil_acceleration")
    with pytest.raises(IdentificationError, match="nothing tells how fast"):
        found(fired)
    assert "the body moves when the record begins, and nothing tells how fast" in judged(fired).reasons[0]


@pytest.mark.parametrize("role", ["recoil_acceleration", "recoil_velocity", "recoil_displacement"])
def test_a_body_that_is_driven_the_other_way_is_refused_at_the_range_as_at_the_desk(role: str) -> None:
    read = BODY.readings()
    turned = BODY.fired("driving_force", role, readings=read | {"driving_force": -read["driving_force"]})
    with pytest.raises(IdentificationError):
        found(turned)
    assert not judged(turned).usable


def test_a_record_of_a_body_at_rest_is_refused_at_the_range_as_at_the_desk() -> None:
    body = replace(BODY, rest_s=0.5)
    read = {
        role: np.where(np.arange(one.size) < 0.4 * body.rate_hz, one, one[0]) for role, one in body.readings().items()
    }
    still = body.fired(*ALL, readings=read)
    with pytest.raises(IdentificationError):
        found(still)
    assert not judged(still).usable


def judged(fired: FiredShot) -> Shot:
    """Judge a shot as ingest does."""
    quality = check_shot(fired, fired.shot.alignments, {}, CalibrationDay(dt.date(2026, 6, 1), DayOf.START))
    shot = replace(fired.shot, quality=quality)
    return replace(shot, against_mass=against_the_record(FiredShot(shot, fired.rig)))


@pytest.mark.whole_way
@pytest.mark.parametrize("inclination_rad", [math.pi / 2, -0.3])
def test_gravity_stands_on_neither_side_whatever_tells_the_motion(inclination_rad: float) -> None:
    body = replace(BODY, inclination_rad=inclination_rad)
    for roles in (ALL, ("driving_force", "resisting_force", "recoil_displacement")):
        mass = found(body.fired(*roles), 10.0).chosen.estimate
        assert abs(mass.mass_kg - body.mass_kg) < 2.0 * mass.u_kg, roles


@pytest.mark.whole_way
def test_the_mass_does_not_change_under_a_time_shift() -> None:
    assert mass_kg(replace(BODY, start_s=1234.5).fired(*ALL)) == pytest.approx(mass_kg(BODY.fired(*ALL)), rel=1e-6)


@pytest.mark.whole_way
def test_the_mass_does_not_change_when_the_line_is_looked_at_from_its_other_end() -> None:
    other = {role: -one for role, one in BODY.readings().items()}
    assert mass_kg(BODY.fired(*ALL, readings=other)) == pytest.approx(mass_kg(BODY.fired(*ALL)), rel=1e-6)


@pytest.mark.whole_way
def test_forces_of_the_same_sign_add() -> None:
    read = BODY.readings()
    halves = read | {"driving_force": 0.5 * read["driving_force"], "driving_force_2": 0.5 * read["driving_force"]}
    result = found(BODY.fired("driving_force", *ALL, readings=halves), 20.0)
    assert result.route.recorded.gauges == ("driving_force", "driving_force_2", "resisting_force")
    assert result.chosen.estimate.mass_kg == pytest.approx(mass_kg(BODY.fired(*ALL)), rel=2e-3)
    # two cells of 1 % that share a force are worth more than one
    assert result.chosen.estimate.u_kg < 0.9 * found(BODY.fired(*ALL), 20.0).chosen.estimate.u_kg


@pytest.mark.whole_way
def test_grams_are_as_good_as_kilogrammes() -> None:
    share = 1e-4
    small = replace(BODY, mass_kg=share * BODY.mass_kg, friction_n=share * 20.0, slide_n_s_m=share * 200.0)
    read = BODY.readings()
    scaled = read | {role: share * read[role] for role in ("driving_force", "resisting_force")}
    assert mass_kg(small.fired(*ALL, readings=scaled)) == pytest.approx(share * mass_kg(BODY.fired(*ALL)), rel=1e-4)


@pytest.mark.whole_way
def test_a_blow_of_a_millisecond_has_the_band_of_its_force_and_rows_enough() -> None:
    blow = sled_outcome(9001, {}, hammer())
    filtered = blow.found.route.filtered
    assert filtered.interval_s[1] - filtered.interval_s[0] < 1.5e-3
    assert filtered.low_pass is not None
    assert filtered.low_pass.cutoff_hz > 1000.0
    assert blow.found.chosen.estimate.rows > LEAST_SPACED - 3
    assert blow.found.valid
    assert blow.covers


@pytest.mark.whole_way
@pytest.mark.parametrize("noise", [5e-4, 0.01])
def test_a_blow_of_a_millisecond_in_a_second_is_judged_by_its_own_span(noise: float) -> None:
    outcome = sled_outcome(2, {}, drop_tower(noise))
    assert outcome.found.valid, outcome.found.reasons
    assert outcome.covers
    recorded = outcome.found.route.recorded
    assert 0 < recorded.inside.sum() * recorded.step_s < 0.02


@pytest.mark.whole_way
@pytest.mark.parametrize("seed", [2, 3])
def test_a_step_of_the_mass_of_the_size_that_is_said_to_be_found_is_found(seed: int, tmp_path: Path) -> None:
    rig = sled_without_camera()
    files = simulate_shot(rig, tmp_path / "files", seed=seed, shot="1").files
    shot = ingest_files(rig, files, shot="1", out=tmp_path / "shots", on=DAY).shot
    sound = identify_shot(FiredShot(shot, rig), Options())
    assert sound.constancy is not None
    assert sound.constancy.constant
    (motion,) = [one.name for one in rig.channels if one.role == "recoil_acceleration"]
    acceleration = np.array(shot.channels[motion].samples)
    at_s = 0.5 * sum(sound.route.recorded.interval_s)
    acceleration[shot.reference_times_s(motion) >= at_s] /= 1.0 - sound.constancy.found_step_rel
    stepped = identify_shot(FiredShot(with_channels(shot, **{motion: acceleration}), rig), Options())
    assert stepped.constancy is not None
    assert not stepped.constancy.constant
