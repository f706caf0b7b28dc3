"""Targets know of a shot what its mass knows: what no gauge reads, and zeros that move, are in what they state."""

from __future__ import annotations

from functools import cache

import pytest

from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot

UNKIND = (12, 15)
"""Seeds whose brake has a pressure behind its piston, and whose breech zero moves by 1.3 and -2.5 times its u."""


@cache
def case(seed: int) -> tuple[VirtualShot, Case]:
    virtual = virtual_shot("mixed", seed=seed, kind=False, u_zero_rel=0.001)
    return virtual, Case(FiredShot(virtual.shot, virtual.rig))


@cache
def found(target: str, seed: int) -> TargetResult:
    return target_function(target)(case(seed)[1])


@pytest.mark.whole_way
@pytest.mark.parametrize("seed", UNKIND)
@pytest.mark.parametrize("target", ["resistance", "inertia-force", "parameters", "breech-force"])
def test_a_shot_with_a_sound_mass_has_sound_targets(target: str, seed: int) -> None:
    assert case(seed)[1].identified.valid
    assert found(target, seed).valid, found(target, seed).reasons


@pytest.mark.whole_way
@pytest.mark.parametrize("seed", UNKIND)
@pytest.mark.parametrize(("target", "symbol"), [("inertia-force", "m3"), ("parameters", "base_m3")])
def test_their_mass_is_as_uncertain_as_the_shots(target: str, symbol: str, seed: int) -> None:
    virtual, own = case(seed)
    mass, estimate = found(target, seed).quantity(symbol), own.identified.chosen.estimate
    assert abs(mass.value - virtual.truth["m3"]) < 2.0 * mass.u
    assert mass.u == pytest.approx(estimate.u_kg, rel=0.1)


@pytest.mark.whole_way
@pytest.mark.parametrize("seed", UNKIND)
def test_what_the_gauges_lack_is_in_the_balances(seed: int) -> None:
    finding = found("resistance", seed)
    rows = {row[0]: row for row in next(t for t in finding.tables if "left of the balances" in t.title).rows}
    for cause in (
        "share of the resistance that no gauge reads",
        "force of unknown shape that no gauge reads",
        "breech_pressure zero that moves",
        "brake_pressure zero that moves",
    ):
        assert float(rows[cause][2]) > 5.0, cause
    # 1 % of the resistance's impulse
    given = finding.quantity("momentum_left_end")
    assert abs(given.value) < 2.0 * given.u
    assert given.u < 0.02 * 7800.0
