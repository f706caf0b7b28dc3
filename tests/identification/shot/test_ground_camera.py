"""Masses by a camera on the ground, beside the accelerometer and alone, on hard and soft ground."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.clocks.forced_recoil import carriage_lacks
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.ground_shots import ground_shot
from tests.builders.virtual_shots import VirtualShot, without_channels


@cache
def found(name: str, soft: bool, accelerometer: bool, stands: str = "ground") -> tuple[VirtualShot, Identification]:
    virtual = ground_shot(name, 5, soft=soft, sees=stands, stands=stands, accelerometer=accelerometer)
    return virtual, identify_shot(FiredShot(virtual.shot, virtual.rig), Options())


# each pair of the three together once
@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "soft", "accelerometer"),
    [("field-2013", True, True), ("field-2013", False, False), ("mixed", False, True), ("mixed", True, False)],
)
def test_the_mass_is_valid_and_the_one_that_a_camera_on_the_tipping_part_tells(name, soft, accelerometer):
    (_, identified), (_, relative) = (found(name, soft, accelerometer, one) for one in ("ground", "tipping_part"))
    method = identified.route.method
    assert method == ("calibrated" if accelerometer else "camera")
    assert isinstance(identified.route.calibration.camera, CameraRows) == accelerometer
    assert not identified.reasons
    own, other = (one.results[method].estimate for one in (identified, relative))
    assert abs(own.mass_kg - other.mass_kg) < 0.2 * own.u_kg
    assert own.u_kg == pytest.approx(other.u_kg, rel=0.05)
    truth_kg = ground_shot(name, 5, soft=soft, accelerometer=accelerometer).truth["m3"]
    assert abs(own.mass_kg - truth_kg) < 2.58 * own.u_kg


@pytest.mark.whole_way
@pytest.mark.parametrize("accelerometer", [True, False])
def test_the_travel_of_the_report_is_that_along_the_bore(accelerometer):
    """The carriage moves the camera's travel by centimetres; the stroke is known to the camera's scale."""
    virtual, identified = found("field-2013", True, accelerometer)
    route = identified.route
    end = int(np.argmin(np.abs(route.filtered.times_s - route.filtered.interval_s[1])))
    assert route.travel_m[end] == pytest.approx(virtual.truth["stroke_m"], rel=4e-3)
    assert abs(np.nanmax(route.camera.samples) - virtual.truth["stroke_m"]) > 8e-3


@pytest.mark.whole_way
def test_the_kinematic_route_takes_the_ground_for_what_it_is():
    _, identified = found("field-2013", True, True)
    kinematic = identified.results["kinematic"].estimate
    assert abs(kinematic.mass_kg / identified.results["calibrated"].estimate.mass_kg - 1.0) < 0.01


@pytest.mark.whole_way
def test_it_needs_a_gyro_and_no_accelerometers_on_the_carriage():
    virtual, identified = found("field-2013", True, True)
    signals = identified.route.signals
    roles = ("carriage_acceleration_x", "carriage_acceleration_y")
    without = dataclasses.replace(signals, series={k: v for k, v in signals.series.items() if k not in roles})
    assert carriage_lacks(without, virtual.rig) == []
    relative = virtual.rig.with_camera_on_ground(False)
    assert carriage_lacks(without, relative) == list(roles)
    still = dataclasses.replace(signals, series={k: v for k, v in signals.series.items() if "rate" not in k})
    assert carriage_lacks(still, virtual.rig) == ["carriage_rate or tipping_rate"]


@pytest.mark.whole_way
def test_without_the_carriages_accelerometers_the_frames_still_count():
    virtual, whole = found("field-2013", False, True)
    shot = without_channels(virtual.shot, "acc_carriage_x", "acc_carriage_y")
    identified = identify_shot(FiredShot(shot, virtual.rig), Options())
    assert isinstance(identified.route.calibration.camera, CameraRows)
    own, other = (one.results["calibrated"].estimate for one in (identified, whole))
    assert abs(own.mass_kg - other.mass_kg) < 0.2 * own.u_kg
