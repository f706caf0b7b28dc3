"""What the rig file states of the scales, with what is an area's or a standard's."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.rig import parse_rig
from tests.builders.bench_shots import bench_rig

STANDARD = 'reference = "s", u_reference_rel = 0.003'
DYNAMIC = 'calibration = "dynamic"'


def test_a_rig_without_uncertain_areas_and_standards_has_the_sensors_own_alone() -> None:
    scales = scale_uncertainty(bench_rig(p_breech=DYNAMIC))
    assert (scales.gauges, scales.acceleration, scales.friction_n) == ((0.005, 0.005, 0.005), 0.005, 150.0)
    assert scales.parts == {}


def test_areas_and_standards_are_parts() -> None:
    rig = bench_rig(p_breech=f"{STANDARD}, {DYNAMIC}", p_brake=STANDARD)
    m = rig.mechanism
    rig = replace(rig, mechanism=replace(m, u={**m.u, "bore_area": 0.002 * m.bore_area}))
    scales = scale_uncertainty(rig)
    assert scales.gauges == pytest.approx((math.hypot(0.005, 0.002), 0.005, 0.005))
    assert dict(scales.parts["breech_pressure"]) == {"bore_area": pytest.approx(0.002), "standard s": 0.003}
    assert scales.parts["brake_pressure"] == (("standard s", 0.003),)
    assert scales.parts.keys() == {"breech_pressure", "brake_pressure"}


@pytest.mark.parametrize("stated", ["", 'calibration = "static"'])
def test_of_a_breech_gauge_that_was_calibrated_at_rest_the_scale_in_a_pulse_is_a_part(stated: str) -> None:
    scales = scale_uncertainty(bench_rig(**({"p_breech": stated} if stated else {})))
    assert scales.gauges == pytest.approx((math.hypot(0.005, 0.005), 0.005, 0.005))
    assert scales.parts == {"breech_pressure": (("breech_pressure dynamic scale", 0.005),)}


def test_each_of_several_breech_gauges_has_a_scale_in_a_pulse_of_its_own() -> None:
    text = bench_rig().text
    second = text[text.index('[[channel]]\nname = "p_breech"') :].split("[[channel]]")[1].replace("p_breech", "p_other")
    rig = parse_rig(f"{text}\n[[channel]]{second}", bench_rig().path)
    parts = dict(scale_uncertainty(rig).parts["breech_pressure"])
    assert parts == {
        "p_breech dynamic scale": 0.0025, "p_other dynamic scale": 0.0025,
        "p_breech sensitivity": 0.0025, "p_other sensitivity": 0.0025,
    }  # fmt: skip
    assert scale_uncertainty(rig).gauges[0] == pytest.approx(0.005)
