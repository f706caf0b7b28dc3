"""A virtual rig has the breech chain that its file states, drawn from what that is uncertain by."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin.breech_chain import with_breech_chain
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import UnreadForces

AHEAD = "gauge_ahead = { chamber_length_m = 0.7, projectile_mass_kg = 9.0, u_share = 0.02 }"


def stated(sensor: str = "", muzzle: float = 0.0, u_muzzle: float = 0.0, tube_hz: float = 0.0) -> Rig:
    rig = load_rig("field-2013")
    if sensor:
        rig = parse_rig(rig.text.replace('serial = "V301",', f'serial = "V301", {sensor},'), rig.path)
    m = replace(rig.mechanism, muzzle_brake=muzzle, projectile_mass=9.0, bore_length=1.5, tube_axial_hz=tube_hz)
    return replace(rig, mechanism=replace(m, u=MappingProxyType({**m.u, "muzzle_brake": u_muzzle})))


def test_a_rig_that_states_nothing_has_none() -> None:
    settings = TwinSettings()
    assert with_breech_chain(load_rig("field-2013"), settings, 3) == settings


def test_what_is_stated_is_drawn_from_its_uncertainty() -> None:
    rig = stated(f"u_linearity_rel = 0.005, {AHEAD}", 0.3, 0.05)
    drawn = [with_breech_chain(rig, TwinSettings(), seed) for seed in range(400)]
    for key in ("breech_linearity", "breech_hysteresis"):
        sizes = np.array([getattr(one.readings, key) for one in drawn])
        assert sizes.mean() == pytest.approx(0.0, abs=0.001)
        assert sizes.std() == pytest.approx(0.005, rel=0.15)
    ahead, muzzle = np.array([(one.readings.gauge_ahead, one.unread.muzzle_brake) for one in drawn]).T
    assert ahead.min() >= 0.0
    assert np.sqrt((ahead**2).mean()) == pytest.approx(0.02, rel=0.15)
    assert muzzle.mean() == pytest.approx(0.3, abs=0.01)
    assert muzzle.std() == pytest.approx(0.05, rel=0.15)
    assert {one.readings.chamber_length_m for one in drawn} == {0.7}
    assert {(one.unread.projectile_mass_kg, one.unread.bore_length_m) for one in drawn} == {(9.0, 1.5)}


def test_without_draws_and_where_settings_say_otherwise_they_count() -> None:
    rig = stated("u_linearity_rel = 0.005", 0.3, 0.05, 900.0)
    plain = with_breech_chain(rig, TwinSettings(unread_errors=False), 3)
    assert (plain.readings.tube_axial_hz, plain.readings.breech_linearity, plain.unread.muzzle_brake) == (900, 0, 0.3)
    asked = TwinSettings(readings=Readings(tube_axial_hz=600.0), unread=UnreadForces(muzzle_brake=0.1))
    found = with_breech_chain(rig, asked, 3)
    assert (found.readings.tube_axial_hz, found.unread.muzzle_brake) == (600.0, 0.1)
    assert found.readings.breech_linearity != 0.0
