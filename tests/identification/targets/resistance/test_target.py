from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import read_settings
from tests.builders.virtual_shots import VirtualShot, virtual_shot, without_channels

RIGS = ("field-2013", "mixed")


@cache
def found(name: str) -> tuple[VirtualShot, TargetResult]:
    virtual = virtual_shot(name)
    return virtual, target_function("resistance")(Case(FiredShot(virtual.shot, virtual.rig)))


def holds(finding: TargetResult, symbol: str, truth: float, widen: float = 1.5) -> bool:
    """Whether the interval, half as wide again because one shot is one draw, holds the truth."""
    quantity = finding.quantity(symbol)
    return abs(quantity.value - truth) < widen * 1.96 * quantity.u


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_gas_law_and_throttle_are_those_of_the_mechanism(name):
    virtual, finding = found(name)
    settings, m = read_settings(virtual.rig), virtual.rig.mechanism
    assert holds(finding, "p0", settings.recuperator_pressure_pa)
    assert holds(finding, "V0", settings.recuperator_volume_m3)
    assert holds(finding, "n_gas", settings.polytropic)
    for share in (10, 30, 50, 70, 90):
        quantity = finding.quantity(f"c_{share}")
        x = float(quantity.basis.split(" at ")[-1].split()[0])
        orifice = settings.leak_m2 + settings.orifice_m2 * np.sqrt(1 - x / settings.stroke_m)
        loss = 0.5 * settings.oil_density_kg_m3 * (m.brake_area / settings.discharge) ** 2
        assert holds(finding, f"c_{share}", m.brake_area * loss / orifice**2)
        assert quantity.u < 0.02 * quantity.value


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_friction_interval_holds_the_true_friction(name):
    virtual, finding = found(name)
    assert holds(finding, "friction", float(virtual.truth["friction"]))
    assert holds(finding, "friction_by_shot", float(virtual.truth["friction"]))
    friction = finding.quantity("friction")
    assert friction.u_expected is not None
    assert 0.3 * friction.u_expected < friction.u < friction.u_expected
    assert any("bits" in note for note in finding.notes)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_energy_and_momentum_close(name):
    _, finding = found(name)
    for symbol in ("energy_left_peak", "energy_left_end", "momentum_left_peak", "momentum_left_end"):
        assert holds(finding, symbol, 0.0)
    assert finding.valid, finding.reasons
    table = finding.tables[0]
    assert {row[-1] for row in table.rows} <= {"closed", "beyond its tolerance, which happens by chance once in twenty"}


@pytest.mark.whole_way
def test_a_brake_gauge_that_reads_a_fifth_high_violates_the_balances():
    virtual, _ = found("field-2013")
    gauge = virtual.shot.channels["p_brake"]
    high = replace(gauge, samples=1.2 * gauge.samples)
    shot = replace(virtual.shot, channels={**virtual.shot.channels, "p_brake": high})
    finding = target_function("resistance")(Case(FiredShot(shot, virtual.rig)))
    assert any("the balance of" in reason and "violated" in reason for reason in finding.reasons)
    assert not finding.valid


def test_figures_show_resistance_and_energy():
    _, finding = found("field-2013")
    keys = [figure.key for figure in finding.figures]
    assert keys == ["resistance-travel", "resistance-velocity", "resistance-parts", "throttle", "energy"]
    assert finding.series is not None
    law, measured = (finding.series.columns[k] for k in ("law_n", "brake_n"))
    measured = measured + finding.series.columns["recuperator_n"] + finding.series.columns["friction_n"]
    there = np.isfinite(law) & np.isfinite(measured)
    assert np.mean(there) > 0.9
    assert abs(np.mean((law - measured)[there])) < 0.01 * np.nanmax(measured)


def test_a_shot_without_breech_gauge_is_refused():
    virtual, _ = found("field-2013")
    with pytest.raises(IdentificationError, match="breech_pressure"):
        target_function("resistance")(Case(FiredShot(without_channels(virtual.shot, "p_breech"), virtual.rig)))


@pytest.mark.whole_way
def test_slides_that_the_rig_states_are_part_of_the_resistance():
    virtual = virtual_shot("field-2013")
    rig = replace(virtual.rig, mechanism=replace(virtual.rig.mechanism, slide_friction=100.0))
    stated = target_function("resistance")(Case(FiredShot(virtual.shot, rig)))
    assert stated.series is not None
    friction = stated.series.columns["friction_n"] - stated.quantity("friction").value
    speed = stated.series.columns["velocity_m_s"]
    np.testing.assert_allclose(friction, 100.0 * speed, atol=1e-6)
    assert friction.max() > 500.0
