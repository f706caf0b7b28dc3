from __future__ import annotations

import math
from dataclasses import replace

import pytest

from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate
from recoil_identification.estimators.total_least_squares import total_least_squares_mass
from recoil_identification.shot.identified import Identification
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot

RIGS = ("field-2013", "mixed")


def estimate_of(name: str, found: Identification) -> MassEstimate:
    virtual, route = virtual_shot(name), found.route
    inputs = EstimatorInputs(route.fitted, route.recorded, route.signals, FiredShot(virtual.shot, virtual.rig))
    further = found.results["reverse"].estimate.budget[6:]
    return total_least_squares_mass(inputs, scale_uncertainty(virtual.rig), further)


@pytest.mark.parametrize("name", RIGS)
def test_it_finds_the_mass_of_a_virtual_shot_within_its_uncertainty_beside_the_regression(name):
    estimate, truth = estimate_of(name, identified(name)), virtual_shot(name).truth["m3"]
    reverse = identified(name).results["reverse"].estimate
    assert abs(estimate.mass_kg - truth) < 3 * estimate.u_kg
    assert 0.002 < estimate.u_kg / truth < 0.01
    assert abs(estimate.mass_kg - reverse.mass_kg) < 3 * (estimate.budget[0].u_kg + reverse.budget[0].u_kg)
    assert estimate.residual_m_s2 == pytest.approx(reverse.residual_m_s2, rel=0.2)


@pytest.mark.parametrize("name", RIGS)
def test_its_budget_has_the_names_of_the_regressions_once_each(name):
    reverse = {row.source for row in identified(name).results["reverse"].estimate.budget}
    budget = estimate_of(name, identified(name)).budget
    sources = [row.source for row in budget]
    assert sources[0] == RANDOM
    assert len(set(sources)) == len(sources)
    assert {ACCELERATION, FRICTION, *GAUGES} <= set(sources) <= reverse
    assert all(math.isfinite(row.u_kg) and row.u_kg >= 0 for row in budget)
    assert ("alignment of clock can" in sources) == (name == "mixed")


def test_the_breech_gauges_row_is_the_change_of_the_mass():
    found, h = identified(), 1e-3
    forces = found.route.fitted.forces_n.copy()
    forces[:, 0] *= 1 + h
    moved = replace(found, route=replace(found.route, fitted=replace(found.route.fitted, forces_n=forces)))
    estimate = estimate_of("field-2013", found)
    change = estimate_of("field-2013", moved).mass_kg - estimate.mass_kg
    row = next(row for row in estimate.budget if row.source == GAUGES[0])
    assert row.sensitivity == pytest.approx(change / h, rel=0.03)
