"""Shots without an accelerometer on the recoiling part: camera track and forces give clock and mass, or say why not."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.regression import spaced_rows
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.tracked_rigs import tracked_shot
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

RIGS = ("field-2013", "mixed")
EXACT = {
    "gain_errors": False,
    "friction_error": False,
    "noise": 0.0,
    "bits": 0,
    "bias": 0.0,
    "ringing": 0.0,
    "ringing_pressure": 0.0,
    "camera_noise_m": 1e-9,
    "camera_lost": 0,
    "camera_missing": 0,
    "camera_repeated": 0,
}


@cache
def identified(name: str = "field-2013", seed: int = 3, **settings: float | bool) -> Identification:
    virtual = tracked_shot(name, seed, **settings)
    return identify_shot(FiredShot(virtual.shot, virtual.rig), Options())


def scaled(shot: Shot, rig: Rig, name: str, factor: float) -> Identification:
    other = with_channels(shot, **{name: factor * np.asarray(shot.channels[name].samples)})
    return identify_shot(FiredShot(replace(other, alignments=align_clocks(FiredShot(other, rig))), rig), Options())


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_mass_is_found_within_its_uncertainty(name):
    found, truth = identified(name), tracked_shot(name).truth
    assert found.route.method == "camera"
    assert set(found.results) == {"camera", "kinematic"}
    for result in found.results.values():
        assert abs(result.estimate.mass_kg - truth["m3"]) < 3 * result.estimate.u_kg
    assert found.chosen.estimate.u_kg < 0.005 * truth["m3"]
    assert found.chosen.rpe_percent < 2
    assert found.valid, found.reasons


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_residual_that_is_stated_is_what_mass_and_forces_leave_of_the_filtered_acceleration(name):
    found = identified(name)
    acceleration_m_s2, force_n = found.route.calibration.correct(found.route.filtered)
    left_m_s2 = (acceleration_m_s2 - force_n / found.chosen.estimate.mass_kg)[spaced_rows(found.route.filtered)]
    assert found.chosen.estimate.residual_m_s2 == pytest.approx(np.sqrt(np.mean(left_m_s2**2)), rel=0.05)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_clock_is_found_by_track_and_forces(name):
    found, true = identified(name), tracked_shot(name).truth["clocks"]["camera"]
    clock = found.alignments["camera"]
    assert (clock.method, clock.status) == ("force", "ok")
    middle = float(np.mean(found.route.filtered.interval_s))
    at = (middle - true["offset_s"]) / (1 + true["drift"])
    assert abs(clock.to_reference(at) - middle) < 3 * clock.u_offset_s
    assert 2e-6 < clock.u_offset_s < 1e-4


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_budget_is_complete_and_named_once(name):
    budget = identified(name).chosen.estimate.budget
    sources = [row.source for row in budget]
    assert len(set(sources)) == len(sources)
    assert all(math.isfinite(row.u_kg) and row.u_kg >= 0 for row in budget)
    wanted = {
        "random errors of this shot",
        "breech_pressure sensitivity and area",
        "brake_pressure sensitivity and area",
        "recuperator_pressure sensitivity and area",
        "packing friction",
        "release from the battery stop",
        "camera scale",
        "rate of clock camera",
        "breech_pressure zero",
        "carriage_acceleration_x sensitivity",
    }
    assert wanted <= set(sources)
    assert ("alignment of clock can" in sources) == (name == "mixed")


@pytest.mark.whole_way
def test_the_mass_over_time_holds_the_truth():
    trace, truth = identified().chosen.trace, tracked_shot().truth["m3"]
    assert trace.share > 0.6
    assert np.mean(np.abs(trace.mass_kg - truth)[trace.identified] < 1.96 * trace.u_kg[trace.identified]) > 0.85


@pytest.mark.whole_way
def test_what_an_accelerometer_would_check_is_said_not_to_be_checked():
    found = identified()
    assert found.route.zero_shift is found.route.skew is found.peaks is None
    assert "is not checked" in found.notes[0]
    assert any(c.channel == "x_camera" and "cannot be checked" in c.detail for c in tracked_shot().shot.quality)
    with pytest.raises(IdentificationError, match="route by the accelerometer"):
        _ = found.inertial


@pytest.mark.whole_way
def test_without_noise_and_errors_the_estimator_is_exact():
    virtual = tracked_shot(sample_rate_hz=50e3, **EXACT)
    true = virtual.truth["clocks"]["camera"]
    clock = ClockAlignment("camera", true["offset_s"], 1e-6, true["drift"], 1e-6, "ok", "force")
    shot = replace(virtual.shot, alignments=(clock,))
    signals = collect_signals(FiredShot(shot, virtual.rig), {"camera": clock})
    found = TrackedRecoil.of(FiredShot(shot, virtual.rig), signals).found
    assert found.mass_kg == pytest.approx(virtual.truth["m3"], rel=5e-4)


@pytest.mark.whole_way
def test_a_gauge_that_is_wrong_beyond_its_uncertainty_is_named():
    virtual = tracked_shot()
    found = scaled(virtual.shot, virtual.rig, "p_brake", 0.95)
    assert not found.valid
    assert any(
        r.startswith("brake_pressure sensitivity and area contradicts") and "reads low" in r for r in found.reasons
    )


@pytest.mark.whole_way
def test_a_track_with_many_lost_frames_still_gives_a_mass():
    found = identified(camera_lost=300)
    assert abs(found.chosen.estimate.mass_kg - 782) < 3 * found.chosen.estimate.u_kg
    assert found.chosen.trace.identified.any()


# ---- which default, and what is refused


@pytest.mark.whole_way
def test_with_an_accelerometer_the_default_stays():
    virtual = virtual_shot()
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
    assert found.route.method == "calibrated"
    asked = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="camera"))
    assert asked.route.method == "camera"
    assert abs(asked.chosen.estimate.mass_kg - virtual.truth["m3"]) < 3 * asked.chosen.estimate.u_kg
    assert not any(row.source.startswith("recoil_acceleration") for row in asked.chosen.estimate.budget)


@pytest.mark.whole_way
def test_an_accelerometer_that_recorded_nothing_does_not_count():
    virtual = virtual_shot()
    silent = np.full(virtual.shot.channels["acc_recoil"].samples.shape, np.nan)
    shot = with_channels(virtual.shot, acc_recoil=silent)
    alignments = align_clocks(FiredShot(shot, virtual.rig))
    assert {a.clock: a.method for a in alignments}["camera"] == "force"
    found = identify_shot(FiredShot(replace(shot, alignments=alignments), virtual.rig), Options())
    assert found.route.method == "camera"
    assert found.valid, found.reasons
    assert abs(found.chosen.estimate.mass_kg - virtual.truth["m3"]) < 3 * found.chosen.estimate.u_kg


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("x_camera",), "no channel of role recoil_acceleration, and no channel of role recoil_displacement"),
        (("p_breech", "p_brake", "p_recuperator"), "no usable channel of role breech_pressure, brake_pressure, recup"),
        (("p_recuperator",), "no usable channel of role recuperator_pressure: without all forces"),
        (("acc_carriage_x",), "no usable channel of role carriage_acceleration_x: a camera sees the recoil relative"),
        (("gyro_carriage", "gyro_tipping"), "no usable channel of role carriage_rate or tipping_rate"),
    ],
)
def test_what_tells_no_mass_is_refused_in_one_line_that_names_what_is_missing(names, message):
    virtual = tracked_shot()
    with pytest.raises(IdentificationError, match=message) as caught:
        identify_shot(FiredShot(without_channels(virtual.shot, *names), virtual.rig), Options())
    assert "\n" not in str(caught.value)


def test_a_camera_that_could_not_be_aligned_is_refused():
    virtual = tracked_shot()
    failed = [replace(a, status="failed", reasons=("no pulse",)) for a in virtual.shot.alignments]
    with pytest.raises(IdentificationError, match="track of the recoiling part is on a clock that could not be"):
        identify_shot(FiredShot(replace(virtual.shot, alignments=tuple(failed)), virtual.rig), Options())


@pytest.mark.whole_way
def test_a_clock_that_track_and_forces_contradict_is_a_reason():
    virtual = tracked_shot()
    (clock,) = virtual.shot.alignments
    late = replace(clock, offset_s=clock.offset_s + 5e-4, u_offset_s=2e-5, method="fixed")
    found = identify_shot(FiredShot(replace(virtual.shot, alignments=(late,)), virtual.rig), Options())
    assert not found.valid
    assert any("call for an offset of clock camera -" in reason for reason in found.reasons)
    sound = replace(clock, u_offset_s=2e-5, method="fixed")
    assert identify_shot(FiredShot(replace(virtual.shot, alignments=(sound,)), virtual.rig), Options()).valid
