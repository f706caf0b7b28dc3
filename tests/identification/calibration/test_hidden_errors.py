"""What a shot could not have told, against estimates of shots whose certificates are wrong by just that."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.hidden_errors import ALL_FORCES, ALL_LENGTHS, hidden_errors
from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES
from recoil_identification.inference.estimate import Estimate
from recoil_identification.inference.reliability import NONCENTRALITY
from recoil_identification.inference.solve import solve
from recoil_identification.rows.equation_of_motion import MASS
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot

RIGS = ("field-2013", "mixed")


def read_high(found: Calibration, error: dict[str, float]) -> Estimate:
    """Estimate anew where certificates are wrong: what reads high by a share has a value that is stated too low."""
    common = [
        replace(one, values=one.values - np.array([error.get(source, 0.0) for source in one.sources]))
        for one in found.common
    ]
    unknowns = found.inferred.unknowns
    return solve(unknowns, [found.rows, *found.further], [*common, *found.own], found.values)


@pytest.mark.parametrize("rig", RIGS)
def test_an_error_of_that_size_moves_its_test_to_the_limit_and_the_mass_by_what_is_said(rig: str) -> None:
    found = identified(rig).route.calibration
    single = [one for one in hidden_errors(found) if one.source not in (ALL_FORCES, ALL_LENGTHS)]
    assert {one.source for one in single} >= {*GAUGES, ACCELERATION, CAMERA_SCALE, FRICTION}
    for one in single:
        assert one.largest_error is not None
        assert one.mass_kg is not None
        again = read_high(found, {one.source: one.largest_error})
        shift = again.normalised_residual(one.source) - found.inferred.normalised_residual(one.source)
        assert abs(shift) == pytest.approx(NONCENTRALITY, rel=0.03)
        moved_kg = found.estimate.mass_kg * math.expm1(again.value(MASS.name) - found.inferred.value(MASS.name))
        assert moved_kg == pytest.approx(one.mass_kg, rel=0.05, abs=0.02 * found.estimate.u_kg)


@pytest.mark.parametrize("rig", RIGS)
def test_what_all_gauges_share_passes_whatever_it_is_and_goes_into_the_mass_whole(rig: str) -> None:
    forces, lengths, *_ = hidden_errors(identified(rig).route.calibration)
    assert (forces.source, forces.largest_error, forces.mass_kg) == (ALL_FORCES, None, None)
    assert lengths.source == ALL_LENGTHS
    mass_kg = identified(rig).chosen.estimate.mass_kg
    assert forces.sensitivity_kg == pytest.approx(mass_kg, rel=0.03)
    assert lengths.sensitivity_kg == pytest.approx(-mass_kg, rel=0.03)
    again = read_high(identified(rig).route.calibration, dict.fromkeys(GAUGES, 0.03))
    assert max(abs(again.normalised_residual(source)) for source in GAUGES) < 3.29


def test_the_costliest_of_single_sensors_stands_first_and_how_the_stop_lets_go_is_no_sensor() -> None:
    single = [
        one for one in hidden_errors(identified().route.calibration) if one.source not in (ALL_FORCES, ALL_LENGTHS)
    ]
    costs = [abs(one.mass_kg) for one in single if one.mass_kg is not None]
    assert costs == sorted(costs, reverse=True)
    assert RELEASE not in {one.source for one in single}


@pytest.mark.whole_way
def test_a_shot_by_its_camera_alone_has_no_second_length() -> None:
    virtual = virtual_shot()
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="camera"))
    sources = [one.source for one in hidden_errors(found.route.calibration)]
    assert sources[0] == ALL_FORCES
    assert ALL_LENGTHS not in sources
    camera = next(one for one in hidden_errors(found.route.calibration) if one.source == CAMERA_SCALE)
    # nothing checks the scale of the only length: the report says so
    assert camera.largest_error is None or camera.largest_error > 0.05
