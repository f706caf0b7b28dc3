"""Inertia forces of a virtual shot against those of its true motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets.forces.inertia_force import find
from recoil_identification.targets.parameters.inertia_forces import FORCES, UNITS, inertia_forces
from recoil_identification.targets.target import Case
from recoil_rigs.mechanism.mechanism_regressor import Geometry, standard_parameters
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.load_cell_rigs import weighed_shot
from tests.builders.virtual_shots import with_channels, without_channels

WIDE = 3.3


@pytest.fixture(scope="module")
def found():
    weighed = weighed_shot()
    return find(Case(FiredShot(weighed.shot, weighed.rig)))


@pytest.fixture(scope="module")
def truth():
    scene = weighed_shot().scene
    m, motion = scene.mechanism, scene.motion
    forces = inertia_forces(Geometry.of(m), standard_parameters(m), motion.q, motion.qd, motion.qdd)
    recoil = (motion.times_s >= motion.t_fire_s) & (motion.times_s <= motion.t_end_s)
    return motion.times_s, forces, recoil


@pytest.mark.indispensable("inertia force")
@pytest.mark.parametrize("name", FORCES)
def test_a_peak_lies_within_its_interval(found, truth, name):
    _, forces, recoil = truth
    own = forces[recoil, FORCES.index(name)]
    true = own[np.argmax(np.abs(own))]
    q = found.quantity(f"peak_{name}")
    assert abs(q.value - true) < WIDE * q.u
    assert q.u < 0.07 * abs(true)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", FORCES)
def test_the_band_over_time_holds_the_true_force(found, truth, name):
    times, forces, recoil = truth
    columns = found.series.columns
    unit = "n_m" if UNITS[FORCES.index(name)] == "N m" else "n"
    t = columns["time_s"]
    inside = (t >= times[recoil][0]) & (t <= times[recoil][-1])
    true = np.interp(t, times, forces[:, FORCES.index(name)])
    miss = np.abs(columns[f"{name}_{unit}"] - true)[inside]
    u = columns[f"u_{name}_{unit}"][inside]
    assert np.mean(miss <= 1.96 * u) > 0.85


@pytest.mark.whole_way
def test_inertia_and_gauges_agree(found):
    assert found.valid
    assert found.parameters["agreement_with_gauges"] > 0.75
    difference = found.series.columns["inertia_less_gauges_n"]
    assert np.nanmax(np.abs(difference)) < 0.03 * abs(found.quantity("peak_bore").value)


@pytest.mark.whole_way
def test_its_mass_is_set_beside_the_shots(found):
    (note,) = [note for note in found.notes if "off the mass of the shot" in note]
    assert note.startswith(f"m3 {found.quantity('m3').value:.1f} kg (u ")


@pytest.mark.whole_way
def test_a_gauge_that_is_far_off_is_a_reason():
    weighed = weighed_shot()
    off = weighed.shot.channels["p_brake"].samples * 1.1
    found = find(Case(FiredShot(with_channels(weighed.shot, p_brake=off), weighed.rig)))
    assert not found.valid


@pytest.mark.whole_way
def test_an_undeclared_tipping_part_is_not_made_up():
    weighed = weighed_shot()
    rig = replace(weighed.rig, mechanism=replace(weighed.rig.mechanism, m2=float("nan"), L=float("nan")))
    found = find(Case(FiredShot(weighed.shot, rig)))
    assert found.quantity("peak_recoiling_x").identified
    assert not found.quantity("peak_mechanism_x").identified
    assert any("does not declare m2" in note for note in found.notes)


@pytest.mark.whole_way
def test_a_declared_uncertainty_of_the_inertia_widens_the_moment_alone(found):
    weighed = weighed_shot()
    mechanism = replace(weighed.rig.mechanism, u={**weighed.rig.mechanism.u, "J2": 76.0})
    wider = find(Case(FiredShot(weighed.shot, replace(weighed.rig, mechanism=mechanism))))
    assert wider.quantity("peak_mechanism_moment").u > found.quantity("peak_mechanism_moment").u
    assert wider.quantity("peak_recoiling_moment").u == pytest.approx(found.quantity("peak_recoiling_moment").u)


def test_a_shot_without_the_carriages_accelerometers_is_refused():
    weighed = weighed_shot()
    with pytest.raises(IdentificationError, match="carriage_acceleration_x"):
        find(Case(FiredShot(without_channels(weighed.shot, "acc_carriage_x"), weighed.rig)))
