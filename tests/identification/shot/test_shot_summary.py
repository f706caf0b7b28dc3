"""A shot's summary and the certificates give the shot's mass back, and state whose errors are whose."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.calibration.methods import Method
from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.sensor_priors import part_of_scale
from recoil_identification.rows.unread_resistance import force_shapes
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.shared_identity import source_of
from recoil_identification.shot.shot_summary import STEPS_AT, sensors_of, shot_summary
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot, with_second_gauge


@cache
def by_the_camera(name: str, kind: bool = True) -> Identification:
    virtual = virtual_shot(name, kind=kind)
    return identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="camera"))


@pytest.mark.whole_way
@pytest.mark.parametrize("of", [identified, by_the_camera])
@pytest.mark.parametrize(("name", "kind"), [("field-2013", False), ("mixed", True)])
def test_the_summary_with_the_certificates_is_the_shot(
    name: str, kind: bool, of: Callable[..., Identification]
) -> None:
    found, rig = of(name, kind=kind), virtual_shot(name, kind=kind).rig
    summary, own = found.summary, found.route.calibration.inferred
    names = tuple(one.name for one in summary.parameters)
    assert names[0] == "ln mass"
    about = LinearBlock(names, summary.triangle, summary.seen + summary.triangle @ summary.reference, 1.0)
    priors = [
        Prior.of(one.name, one.name, math.hypot(*(u for _, u in one.influences)))
        for one in summary.parameters
        if one.influences
    ]
    # nothing is known of changes of the mass, which are none unless they are asked for
    priors += [Prior.of(one.name, one.name, 0.0) for one in summary.parameters[1:] if not one.influences]
    again = solve([Unknown(each) for each in names], [about], priors)
    # to what the shot's own search leaves when it stops, a millionth of the uncertainty
    assert math.exp(again.value("ln mass")) == pytest.approx(found.route.calibration.estimate.mass_kg, rel=1e-8)
    assert again.u("ln mass") == pytest.approx(own.u("ln mass"), rel=1e-9)
    assert again.value("friction share") == pytest.approx(
        found.route.calibration.friction_error_n / rig.mechanism.friction, rel=1e-6
    )


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["mixed", "field-2013"])
def test_a_certificate_that_was_found_in_pulses_lifts_what_one_at_rest_leaves_open(name: str) -> None:
    virtual, at_rest = virtual_shot(name), identified(name)
    text = virtual.rig.text.replace('serial = "V301",', 'serial = "V301", calibration = "dynamic",')
    dynamic = identify_shot(FiredShot(virtual.shot, parse_rig(text, virtual.rig.path)), Options())
    rows = [{row.source: row for row in one.chosen.estimate.budget} for one in (at_rest, dynamic)]
    assert "breech_pressure dynamic scale" not in rows[1]
    row, scale = rows[0]["breech_pressure dynamic scale"], rows[0]["breech_pressure sensitivity and area"]
    assert (row.scope, row.u_kg) == ("sensor", pytest.approx(scale.u_kg))  # 0.5 % each
    u_at_rest, u_dynamic = (one.chosen.estimate.u_kg / one.chosen.estimate.mass_kg for one in (at_rest, dynamic))
    assert u_dynamic < 0.95 * u_at_rest
    assert u_at_rest <= 0.0078
    assert u_dynamic <= 0.0068


@pytest.mark.whole_way
@pytest.mark.parametrize("of", [identified, by_the_camera])
def test_a_common_factor_of_mass_and_forces_changes_no_row(of: Callable[[str], Identification]) -> None:
    summary = of("mixed").summary
    names = [one.name for one in summary.parameters]
    # as the mass grows, gauges that show the same have read too low, and the friction's share that is too large falls
    direction = np.array([-1.0 if each.endswith("_pressure") else 0.0 for each in names])
    direction[0] = 1.0
    direction[names.index("friction share")] = summary.reference[names.index("friction share")] - 1.0
    changed = np.linalg.norm(summary.triangle @ direction)
    assert changed < 1e-9 * np.linalg.norm(summary.triangle[:, 0])


def test_influences_are_known_by_what_they_are() -> None:
    virtual = virtual_shot("mixed")
    summary = identified("mixed").summary
    by_name = {one.name: dict(one.influences) for one in summary.parameters}
    breech = virtual.rig.by_role("breech_pressure")
    assert breech is not None
    sensor = breech.sensor
    identity = sensor.serial or f"mixed/{breech.name}"
    assert by_name["ln breech_pressure"] == {
        f"sensor:breech_pressure:{identity}" + (f":{sensor.calibrated}" if sensor.calibrated else ""): sensor.u_rel,
        f"dynamic:breech_pressure:{identity}": 0.005,
        "rig:mixed:bore_area": 0.0,
    }
    assert by_name["friction share"] == {"rig:mixed:friction": pytest.approx(0.1)}
    # in its standard uncertainties
    assert by_name["release"] == {"rig:mixed:release from the battery stop": 1.0}
    assert by_name["ln mass"] == {}
    assert set(by_name) >= {"ln recoil_acceleration", "ln camera"}


def test_what_no_gauge_reads_is_one_rigs_and_changes_of_the_mass_are_nobodys() -> None:
    by_name = {one.name: dict(one.influences) for one in identified("field-2013", kind=False).summary.parameters}
    assert by_name["unread share"] == {"rig:field-2013:unread_share": 0.01}
    assert by_name["recuperator_pressure delay of its line"] == {
        "rig:field-2013:recuperator_pressure delay of its line": 0.002
    }
    shapes = [name for name in by_name if name.startswith("unread force ")]
    assert shapes == [f"unread force {number + 1}" for number in range(force_shapes().shape[1])]
    assert by_name["unread force 2"] == {"rig:field-2013:unread_force-2": 1.0}
    assert list(by_name)[-13:] == ["drift of ln mass", *(f"step of ln mass at {share:g}" for share in STEPS_AT)]
    assert not any(by_name[name] for name in list(by_name)[-13:])
    read = {one.name for one in identified("field-2013").summary.parameters}
    assert by_name.keys() - read == {"unread share", "recuperator_pressure delay of its line", *shapes}


@pytest.mark.whole_way
def test_what_a_rig_states_of_its_breech_chain_is_the_gauges_and_the_rigs() -> None:
    chain = (("u_muzzle_brake", 0.05), ("projectile_mass", 15.0), ("bore_length", 2.0), ("tube_axial_hz", 900.0))
    virtual = virtual_shot("field-2013", mechanism=chain)
    bent = virtual.rig.text.replace('serial = "V301",', 'serial = "V301", u_linearity_rel = 0.005,')
    found = identify_shot(FiredShot(virtual.shot, parse_rig(bent, virtual.rig.path)), Options())
    by_name = {one.name: dict(one.influences) for one in found.summary.parameters}
    rows = {row.source: row for row in found.route.calibration.estimate.budget}
    for source, identity, u, scope in (
        ("breech_pressure linearity", "rig:field-2013:V301:breech_pressure linearity", 0.005, "sensor"),
        ("breech_pressure hysteresis", "rig:field-2013:V301:breech_pressure hysteresis", 0.005, "sensor"),
        ("muzzle_brake", "rig:field-2013:muzzle_brake", 0.05, "rig"),
        ("tube along its axis", "rig:field-2013:tube along its axis", 1.0, "rig"),
    ):
        assert by_name[source] == {identity: u}
        assert source_of(identity) == source
        assert source_of(identity).kind is rows[source].source.kind
        assert rows[source].scope == scope
    assert found.route.mass_low_pass.cutoff_hz <= 0.33 * 900.0


def test_the_reports_campaign_is_the_summary() -> None:
    found = identified("mixed")
    document = found.summary.to_json(cutoff_hz=179.0, zero_shift=False)
    assert document["schema"] == 1
    assert document["cutoff_hz"] == 179.0
    assert document["zero_shift"] is False
    np.testing.assert_array_equal(document["R"], found.summary.triangle)
    assert document["reference"][0] == pytest.approx(math.log(found.route.calibration.estimate.mass_kg), rel=1e-12)
    assert document["own_u_rel"] == 0.0


def test_what_the_report_calls_a_guess_is_one_for_many_shots_too() -> None:
    virtual = virtual_shot("field-2013")
    text = virtual.rig.text.replace('serial = "V301",', 'serial = "V301", nu = 12,')
    found = identify_shot(FiredShot(virtual.shot, parse_rig(text, virtual.rig.path)), Options())
    rows = {str(row.source): row.degrees_of_freedom for row in found.chosen.estimate.budget if row.kind == "B"}
    told = {str(source_of(name)): freedom for name, freedom in found.summary.degrees_of_freedom.items()}
    assert told.pop("breech_pressure scale, sensor V301") == 12.0
    assert told.pop("breech_pressure dynamic scale, sensor V301") == 8.0 == rows["breech_pressure dynamic scale"]
    shapes = {told.pop(name) for name in list(told) if name.startswith("shape ")}
    assert shapes <= {8.0}
    assert told == {name: freedom for name, freedom in rows.items() if name in told}
    again = type(found.summary).of_json(json.loads(json.dumps(found.summary.to_json(cutoff_hz=1.0, zero_shift=False))))
    assert again.degrees_of_freedom == found.summary.degrees_of_freedom
    known = {name for one in found.summary.parameters for name, _ in one.influences}
    assert set(again.degrees_of_freedom) < known


def test_without_a_friction_and_a_release_their_errors_stay_what_is_known() -> None:
    found, rig = identified("mixed"), virtual_shot("mixed").rig
    frictionless = replace(rig, mechanism=replace(rig.mechanism, friction=0.0))
    held = found.route.calibration.block.regression
    regression = replace(held, release_n_s=0.0, u_release_n_s=0.0)
    calibration = replace(found.route.calibration, block=replace(found.route.calibration.block, regression=regression))
    summary = shot_summary(calibration, frictionless)
    names = [one.name for one in summary.parameters]
    assert "release" not in names
    at = names.index("friction")
    assert summary.parameters[at].influences == (("rig:mixed:friction", rig.mechanism.u["friction"]),)
    assert summary.reference[at] == found.route.calibration.friction_error_n
    whole = found.summary
    # what is known exactly takes nothing from what the shot says of the others
    kept = [i for i, one in enumerate(whole.parameters) if one.name != "release"]
    np.testing.assert_allclose(
        (summary.triangle.T @ summary.triangle)[:at, :at],
        (whole.triangle.T @ whole.triangle)[np.ix_(kept, kept)][:at, :at],
        rtol=1e-8,
    )


def test_each_source_of_the_budget_says_what_shares_it() -> None:
    found = identified("mixed")
    scopes = {row.source: row.scope for row in found.chosen.estimate.budget}
    sensors = dict.fromkeys(("breech_pressure sensitivity and area", "breech_pressure dynamic scale"), "V301")
    sensors |= {"recoil_acceleration sensitivity": "V101"}
    sensors |= {"camera scale": "V401"}
    for source, serial in sensors.items():
        assert (scopes[source], found.sensors[source]) == ("sensor", serial)
    assert {scopes[source] for source in ("packing friction", "release from the battery stop")} == {"rig"}
    assert scopes["bow of the camera's picture"] == scopes["the carriage's part of the travel too large"] == "rig"
    own = {"random errors of this shot", "breech_pressure zero", "alignment of clock can", "place before the shot"}
    assert {scopes[source] for source in own} == {"shot"}


def test_of_several_gauges_each_is_a_sensor_of_its_own_and_a_standard_is_the_rigs() -> None:
    sensors = sensors_of(with_second_gauge("field-2013"))
    assert sensors["p_breech sensitivity"] == "V301"
    assert sensors["p_breech_2 sensitivity"] == "V399"
    assert sensors["breech_pressure sensitivity and area"] == "V301 and V399"
    assert sensors["p_breech_2 dynamic scale"] == "V399"
    assert part_of_scale(ErrorSource(SourceKind.STANDARD, "dead weights")).scope == "rig"


@pytest.mark.whole_way
@pytest.mark.parametrize("method", ["calibrated", "reverse", "camera", "tls"])
def test_every_source_that_is_of_a_sensor_tells_which(method: Method) -> None:
    virtual = virtual_shot("mixed")
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method=method))
    of_sensors = {row.source for row in found.chosen.estimate.budget if row.scope == "sensor"}
    assert len(of_sensors) >= 4
    assert of_sensors <= found.sensors.keys()
