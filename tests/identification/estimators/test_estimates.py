from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest

from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate
from recoil_identification.estimators.estimates import WIDTH, further_estimates
from recoil_identification.shot.identified import Identification
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot

RIGS = ("field-2013", "mixed")
METHODS = ("tls", "ar-gls", "weak")


def estimates_of(name: str, found: Identification) -> dict[str, MassEstimate]:
    virtual = virtual_shot(name)
    further = found.results["reverse"].estimate.budget[6:]
    return further_estimates(
        found.route.fitted, found.route.recorded, found.route.signals, FiredShot(virtual.shot, virtual.rig),
        scale_uncertainty(virtual.rig), further,
    )  # fmt: skip


@cache
def estimates(name: str) -> dict[str, MassEstimate]:
    return estimates_of(name, identified(name))


@pytest.mark.parametrize("name", RIGS)
def test_every_estimator_finds_the_mass_of_a_virtual_shot_within_its_uncertainty(name):
    found, truth = estimates(name), virtual_shot(name).truth["m3"]
    assert tuple(found) == METHODS
    for method, estimate in found.items():
        assert estimate.method == method
        assert abs(estimate.mass_kg - truth) < 3 * estimate.u_kg, method
        assert 0.002 < estimate.u_kg / truth < 0.01, method


@pytest.mark.parametrize("name", RIGS)
def test_the_budgets_have_the_names_of_the_others_once_each(name):
    reverse = {row.source for row in identified(name).results["reverse"].estimate.budget}
    for method, estimate in estimates(name).items():
        sources = [row.source for row in estimate.budget]
        assert sources[0] == RANDOM
        assert len(set(sources)) == len(sources), method
        assert {ACCELERATION, FRICTION, *GAUGES} <= set(sources)
        assert all(math.isfinite(row.u_kg) and row.u_kg >= 0 for row in estimate.budget)
        new = set(sources) - reverse - {WIDTH}
        assert not new, method
        assert ("alignment of clock can" in sources) == (name == "mixed"), method


@pytest.mark.parametrize("name", RIGS)
def test_by_the_accelerometer_all_agree_within_their_random_errors(name):
    reverse = identified(name).results["reverse"].estimate
    for method in METHODS:
        estimate = estimates(name)[method]
        assert abs(estimate.mass_kg - reverse.mass_kg) < 3 * (estimate.budget[0].u_kg + reverse.budget[0].u_kg), method
        assert estimate.residual_m_s2 == pytest.approx(reverse.residual_m_s2, rel=0.2)


@pytest.mark.parametrize("method", METHODS)
def test_the_breech_gauges_row_is_the_change_of_the_mass(method):
    found = identified()
    h = 1e-3

    def scaled(regression):
        forces = regression.forces_n.copy()
        forces[:, 0] *= 1 + h
        return replace(regression, forces_n=forces)

    moved = replace(
        found, route=replace(found.route, fitted=scaled(found.route.fitted), recorded=scaled(found.route.recorded))
    )
    change = estimates_of("field-2013", moved)[method].mass_kg - estimates("field-2013")[method].mass_kg
    row = next(row for row in estimates("field-2013")[method].budget if row.source == GAUGES[0])
    assert row.sensitivity == pytest.approx(change / h, rel=0.03)
