"""Friction of the projectile in the bore: what no gauge sees is taken off as declared, and is uncertain as stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot

SHARE, U_SHARE = 0.02, 0.004


def declared(virtual: VirtualShot, share: float, u_share: float) -> VirtualShot:
    """State another friction of the bore in the rig of a shot that has none."""
    m = virtual.rig.mechanism
    other = replace(m, bore_friction=share, u={**m.u, "bore_friction": u_share})
    return replace(virtual, rig=replace(virtual.rig, mechanism=other))


@cache
def identified(share: float, u_share: float) -> Identification:
    virtual = declared(virtual_shot("field-2013"), share, u_share)
    return identify_shot(FiredShot(virtual.shot, virtual.rig), Options())


def test_the_force_of_the_breech_is_less_by_it() -> None:
    m: Mechanism = declared(virtual_shot(), SHARE, U_SHARE).rig.mechanism
    assert m.force_areas == (pytest.approx(0.98 * m.bore_area), m.brake_area, m.recuperator_area)
    assert m.u_force_areas_rel[0] == pytest.approx(0.004 / 0.98)


@pytest.mark.whole_way
def test_what_it_takes_off_is_taken_off_the_mass() -> None:
    without, taken_off = (identified(share, 0.0).chosen.estimate.mass_kg for share in (0.0, 0.003))
    # the breech's phase is a part of what tells the mass
    assert -0.003 < (taken_off - without) / without < -0.0005


@pytest.mark.whole_way
def test_it_has_a_row_of_its_own_that_is_as_large_as_a_gauge_as_uncertain() -> None:
    rows = {row.source: row for row in identified(0.0, U_SHARE).chosen.estimate.budget}
    gauge = rows["breech_pressure sensitivity and area"]
    u_gauge = virtual_shot().rig.by_role("breech_pressure").sensor.u_rel
    assert rows["bore_friction"].u_kg == pytest.approx(gauge.u_kg * U_SHARE / u_gauge, rel=1e-6)
    assert identified(0.0, U_SHARE).chosen.estimate.u_kg > identified(0.0, 0.0).chosen.estimate.u_kg


@pytest.mark.whole_way
def test_shots_of_a_rig_share_it() -> None:
    summary = identified(0.0, U_SHARE).summary
    assert summary is not None
    influences = dict(next(one for one in summary.parameters if one.name == "ln breech_pressure").influences)
    assert influences["rig:field-2013:bore_friction"] == pytest.approx(U_SHARE)


@pytest.mark.whole_way
def test_the_virtual_rig_draws_it_and_the_mass_is_found_all_the_same() -> None:
    settings = {"bore_friction": SHARE, "u_bore_friction": U_SHARE}
    virtual = virtual_shot("field-2013", 3, mechanism=tuple(settings.items()))
    assert virtual.truth["bore_friction"] == pytest.approx(SHARE, abs=4 * U_SHARE)
    assert virtual.truth["bore_friction"] != SHARE
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
    assert found.valid, found.reasons
    assert abs(found.chosen.estimate.mass_kg - virtual.truth["m3"]) < 3 * found.chosen.estimate.u_kg
