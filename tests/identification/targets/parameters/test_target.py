"""Masses, first moments and inertias of a stand with load cells; and what is left of them without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets.parameters.load_cells import LOAD_CELLS
from recoil_identification.targets.parameters.target import find
from recoil_identification.targets.target import Case
from recoil_rigs.mechanism.mechanism_regressor import standard_parameters
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.load_cell_rigs import weighed_shot
from tests.builders.virtual_shots import with_channels, without_channels

WIDE = 3.3
"""Standard uncertainties: one of 1000 lies beyond."""
CELLS = tuple(LOAD_CELLS.values())


@pytest.fixture(scope="module")
def with_cells():
    weighed = weighed_shot()
    return find(Case(FiredShot(weighed.shot, weighed.rig)))


@pytest.mark.indispensable("parameters")
def test_every_base_parameter_is_identified_within_its_interval(with_cells):
    identified = [q for q in with_cells.quantities if q.identified]
    assert len(identified) == 10
    for q in identified:
        assert abs(q.value - q.expected) < WIDE * q.u, q.name
    assert np.mean([q.U95[0] <= q.expected <= q.U95[1] for q in identified]) >= 0.7
    assert with_cells.valid


@pytest.mark.whole_way
def test_its_mass_is_set_beside_the_shots(with_cells):
    (note,) = [note for note in with_cells.notes if "off the mass of the shot" in note]
    assert note.startswith(f"m3 {with_cells.quantity('base_m3').value:.1f} kg (u ")
    assert "it rests on a lower low-pass" in note


@pytest.mark.whole_way
def test_a_mass_that_is_far_off_the_shots_is_not_valid():
    weighed = weighed_shot()
    case = Case(FiredShot(weighed.shot, weighed.rig))
    found = case.identified
    heavier = replace(found.chosen.estimate, mass_kg=found.chosen.estimate.mass_kg + 20.0)
    result = replace(found.chosen, estimate=heavier)
    vars(case)["identified"] = replace(found, results={**found.results, found.route.method: result})

    finding = find(case)

    assert not finding.valid
    (reason,) = [reason for reason in finding.reasons if "off the mass of the shot" in reason]
    assert "standard uncertainties of both (limit 3)" in reason


@pytest.mark.whole_way
def test_intervals_are_narrow_enough_to_be_worth_having(with_cells):
    for symbol, share in (("m1", 0.03), ("m1_X1", 0.04), ("J3A", 0.03), ("m3", 0.005), ("m3_b", 0.03), ("m3_d", 0.02)):
        q = with_cells.quantity(f"base_{symbol}")
        assert q.u < share * q.expected, symbol


@pytest.mark.whole_way
def test_parameters_that_move_with_others_are_not_identified_alone(with_cells):
    m2, J2 = with_cells.quantity("base_m2"), with_cells.quantity("base_J2")
    assert not m2.identified
    assert "m1 + (m2)" in m2.basis
    assert not J2.identified
    assert "J3A + (J2)" in J2.basis


@pytest.mark.whole_way
def test_the_combinations_that_the_shot_tells_are_printed(with_cells):
    table = with_cells.tables[0]
    assert len(table.rows) == with_cells.parameters["numerical_rank"] == 10
    assert {row[0].split(" ")[0] for row in table.rows} >= {"m1", "m3", "J1", "J3A"}


@pytest.mark.whole_way
def test_without_load_cells_only_the_recoiling_mass_is_left_and_the_reason_is_said():
    weighed = weighed_shot()
    found = find(Case(FiredShot(without_channels(weighed.shot, *CELLS), weighed.rig)))
    m3 = found.quantity("base_m3")
    assert m3.identified
    assert abs(m3.value - weighed.scene.mechanism.m3) < WIDE * m3.u
    assert found.parameters["equations"] == ["along the bore"]
    for symbol in ("m1", "m1_X1", "J1", "m2", "m2_s2", "J3A"):
        q = found.quantity(f"base_{symbol}")
        assert not q.identified
        assert "ground_force_x" in q.basis
    assert any("no load cell of role" in note for note in found.notes)


@pytest.mark.whole_way
def test_the_elevating_moment_alone_tells_the_inertia_about_the_trunnion():
    weighed = weighed_shot()
    found = find(Case(FiredShot(without_channels(weighed.shot, *CELLS[1:]), weighed.rig)))
    inertia = found.quantity("base_J3A")
    assert inertia.identified
    assert abs(inertia.value - inertia.expected) < WIDE * inertia.u
    assert not found.quantity("base_m1").identified
    truth = standard_parameters(weighed.scene.mechanism)
    assert inertia.expected == pytest.approx(truth[7] + truth[11])


@pytest.mark.whole_way
def test_a_load_cell_far_off_its_calibration_is_a_reason():
    weighed = weighed_shot()
    off = weighed.shot.channels["elevating_moment"].samples * 1.2
    found = find(Case(FiredShot(with_channels(weighed.shot, elevating_moment=off), weighed.rig)))
    assert not found.valid
    assert any("standard uncertainties" in reason for reason in found.reasons)


def test_a_shot_without_angular_rates_is_refused():
    weighed = weighed_shot()
    with pytest.raises(IdentificationError, match="tipping_rate"):
        find(Case(FiredShot(without_channels(weighed.shot, "gyro_tipping"), weighed.rig)))


@pytest.mark.whole_way
def test_load_cells_need_the_lines_along_which_loads_act():
    weighed = weighed_shot()
    rig = replace(weighed.rig, mechanism=replace(weighed.rig.mechanism, L=float("nan")))
    with pytest.raises(IdentificationError, match="does not declare L"):
        find(Case(FiredShot(weighed.shot, rig)))
    found = find(Case(FiredShot(without_channels(weighed.shot, *CELLS), rig)))
    assert found.quantity("base_m3").identified


@pytest.mark.whole_way
def test_what_the_rig_declares_is_compared_with_its_uncertainty():
    weighed = weighed_shot()
    mechanism = replace(weighed.rig.mechanism, u={**weighed.rig.mechanism.u, "m1": 10.0, "m2": 5.0})
    found = find(Case(FiredShot(weighed.shot, replace(weighed.rig, mechanism=mechanism))))
    assert found.quantity("base_m1").u_expected == pytest.approx(np.hypot(10.0, 5.0))
