"""What the rig file states of the scales, with what is an area's or a standard's."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from recoil_processing.shot.sensor_scales import scale_uncertainty
from tests.builders.bench_shots import bench_rig

STANDARD = 'reference = "s", u_reference_rel = 0.003'


def test_a_rig_without_uncertain_areas_and_standards_has_the_sensors_own_alone() -> None:
    scales = scale_uncertainty(bench_rig())
    assert (scales.gauges, scales.acceleration, scales.friction_n) == ((0.005, 0.005, 0.005), 0.005, 150.0)
    assert scales.parts == {}


def test_areas_and_standards_are_parts() -> None:
    rig = bench_rig(p_breech=STANDARD, p_brake=STANDARD)
    m = rig.mechanism
    rig = replace(rig, mechanism=replace(m, u={**m.u, "bore_area": 0.002 * m.bore_area}))
    scales = scale_uncertainty(rig)
    assert scales.gauges == pytest.approx((math.hypot(0.005, 0.002), 0.005, 0.005))
    assert dict(scales.parts["breech_pressure"]) == {"bore_area": pytest.approx(0.002), "standard s": 0.003}
    assert scales.parts["brake_pressure"] == (("standard s", 0.003),)
    assert scales.parts.keys() == {"breech_pressure", "brake_pressure"}
