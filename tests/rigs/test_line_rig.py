"""A rig file of one body on a line asks for what a line has, and for nothing of a gun."""

from __future__ import annotations

import math

import pytest

from recoil_acquisition.errors import FaultCode, RigError
from recoil_rigs.checks.plausible import unusual_peak
from recoil_rigs.mechanism.mechanism_parameters import Mechanism, MechanismModel
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.shots.assumptions import assumption_lines, assumptions_of
from recoil_rigs.shots.stated_uncertainty import stated_uncertainties
from tests.builders.line_rigs import PATH, line_rig, line_text

USUAL_ROLES = ("driving_force", "resisting_force", "recoil_acceleration")


def faults_of(text: str) -> dict[str, tuple[str, FaultCode]]:
    with pytest.raises(RigError) as caught:
        parse_rig(text, PATH)
    return {fault.key: (fault.problem, fault.code) for fault in caught.value.faults}


def test_mass_inclination_and_friction_are_enough() -> None:
    mechanism = line_rig(*USUAL_ROLES).mechanism
    assert (mechanism.model, mechanism.m3, mechanism.phi20) == (MechanismModel.LINE, 95.1, 0.0)
    assert (mechanism.friction, mechanism.slide_friction, mechanism.u["friction"]) == (20.4, 0.0, 5.0)
    assert math.isnan(mechanism.XA)
    assert math.isnan(mechanism.bore_area)


@pytest.mark.parametrize("symbol", ["m3", "phi20", "friction"])
def test_each_of_them_must_be_there(symbol: str) -> None:
    text = "\n".join(row for row in line_text(*USUAL_ROLES).split("\n") if not row.startswith(f"{symbol} ="))
    found = faults_of(text)
    assert found.keys() == {f"mechanism.{symbol}"}
    assert found[f"mechanism.{symbol}"][1] is FaultCode.MISSING


@pytest.mark.parametrize("symbol", sorted(Mechanism.OF_GUN))
@pytest.mark.parametrize("prefix", ["", "u_"])
def test_what_only_a_gun_has_is_a_fault(symbol: str, prefix: str) -> None:
    found = faults_of(line_text(*USUAL_ROLES, **{prefix + symbol: 0.1}))
    assert found.keys() == {f"mechanism.{prefix}{symbol}"}
    ((problem, code),) = found.values()
    assert problem.startswith(f"a body on a line has no {symbol}, ")
    assert code is FaultCode.CONTRADICTION


@pytest.mark.parametrize("symbol", ["bore_area", "u_bore_area", "bore_friction", "brake_area", "recuperator_area"])
def test_an_area_has_a_meaning_with_its_pressure_alone(symbol: str) -> None:
    ((problem, code),) = faults_of(line_text(*USUAL_ROLES, **{symbol: 0.001})).values()
    assert problem.startswith("has no meaning without a channel of role")
    assert code is FaultCode.CONTRADICTION


def test_a_pressure_on_a_line_needs_its_area_and_a_breech_has_bore_friction() -> None:
    assert faults_of(line_text("breech_pressure", "recoil_velocity")).keys() == {"mechanism.bore_area"}
    mechanism = line_rig("breech_pressure", "brake_pressure", bore_area=0.001, brake_area=0.002).mechanism
    assert (mechanism.bore_friction, mechanism.u["bore_friction"]) == (0.01, 0.006)
    assert math.isnan(mechanism.recuperator_area)


def test_without_a_breech_no_friction_of_a_bore_is_taken() -> None:
    mechanism = line_rig(*USUAL_ROLES).mechanism
    assert mechanism.bore_friction == 0.0
    assert "bore_friction" not in mechanism.u
    assert (mechanism.unread_share, mechanism.u["unread_share"], mechanism.unread_force) == (0.0, 0.01, 0.002)


def test_what_is_not_stated_is_said_and_nothing_of_a_gun() -> None:
    said = assumption_lines(assumptions_of(line_rig("driving_force", "driving_force", "resisting_force")))
    forces = "driving_force, driving_force_2, resisting_force"
    assert said == [
        "0 +- 1 % of the resistance: unread_share",
        "none is taken, 0 kg: carried_mass",
        "0 +- 0.2 % of the peak resistance: unread_force",
        f"zero that may move by 0.1 % of the range: {forces}",
        f"no calibration standard in common (1 % of one would be 1 % of the mass): {forces}",
        f"no calibration date: {forces}",
    ]


def test_an_area_that_a_line_has_is_taken_as_exact_where_no_uncertainty_is_stated() -> None:
    said = assumption_lines(assumptions_of(line_rig("breech_pressure", bore_area=0.001)))
    assert "taken as exact: bore_area" in said


def test_any_number_of_forces_add() -> None:
    rig = line_rig("driving_force", "driving_force", "driving_force", "resisting_force", "resisting_force")
    assert len(rig.with_role("driving_force")) == 3
    assert len(rig.with_role("resisting_force")) == 2


def test_two_velocities_are_no_two_forces() -> None:
    found = faults_of(line_text("recoil_velocity", "recoil_velocity"))
    assert "only forces may have several channels" in found["channel[1] 'recoil_velocity_2'.role"][0]


def test_a_line_has_no_carriage() -> None:
    ((problem, code),) = faults_of(line_text("driving_force", "carriage_rate")).values()
    assert problem.startswith("a body on a line has no role 'carriage_rate'")
    assert code is FaultCode.CONTRADICTION


@pytest.mark.parametrize("role", ["driving_force", "resisting_force", "recoil_velocity"])
def test_a_role_of_a_line_is_none_of_a_gun(role: str) -> None:
    gun = load_rig("field-2013")
    channel = line_text(role).split("[[channel]]")[1].replace('source = "recorder"', 'source = "dewetron"')
    with pytest.raises(RigError) as caught:
        parse_rig(f"{gun.text}\n".replace("[twin]", f"[[channel]]{channel}\n[twin]"), gun.path)
    (fault,) = caught.value.faults
    assert fault.problem == f'role {role!r} is one of a body on a line: write `model = "line"` in [mechanism]'


@pytest.mark.parametrize("value", ['"sled"', "1", "true"])
def test_a_model_that_is_none_is_the_one_fault(value: str) -> None:
    found = faults_of(line_text(*USUAL_ROLES).replace('model = "line"', f"model = {value}"))
    assert found.keys() == {"mechanism.model"}
    assert found["mechanism.model"][0].startswith('must be "gun" or "line", found ')


def test_a_gun_may_say_that_it_is_one() -> None:
    gun = load_rig("field-2013")
    said = parse_rig(gun.text.replace("[mechanism]\n", '[mechanism]\nmodel = "gun"\n'), gun.path)
    assert said.mechanism == gun.mechanism
    assert said.mechanism.model is MechanismModel.GUN


@pytest.mark.parametrize("m3", ["0.0021", "5e6"])
def test_a_body_of_grams_and_one_that_falls_are_possible(m3: str) -> None:
    text = line_text(*USUAL_ROLES).replace("m3 = 95.1", f"m3 = {m3}").replace("phi20 = 0.0", "phi20 = -1.5708")
    assert parse_rig(text, PATH).mechanism.m3 == float(m3)


def test_a_peak_that_is_small_for_a_gun_is_usual_on_a_line() -> None:
    rig = line_rig(*USUAL_ROLES, "recoil_displacement")
    for role, peak in (("recoil_acceleration", 2.0), ("recoil_displacement", 1e-4), ("driving_force", 50.0)):
        assert unusual_peak(rig.with_role(role)[0], peak, rig.mechanism) == ""
    assert "unusual" in unusual_peak(rig.with_role("driving_force")[0], 1e9, rig.mechanism)


def test_the_uncertainties_that_shots_share_are_those_of_a_line() -> None:
    stated = stated_uncertainties(line_rig(*USUAL_ROLES, "recoil_velocity"))
    assert stated.keys() == {
        "driving_force.u_rel", "resisting_force.u_rel", "recoil_acceleration.u_rel", "recoil_velocity.u_rel",
        "u_friction", "u_unread_share", "u_slide_friction", "u_carried_mass", "unread_force",
    }  # fmt: skip
