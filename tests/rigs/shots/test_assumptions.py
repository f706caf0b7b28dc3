"""What a rig file leaves unsaid is said for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.quantities.quantity import UNITS
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.shots.assemble import si_line
from recoil_rigs.shots.assumptions import assumption_lines, assumptions_of
from tests.builders.bench_shots import bench_rig

NOT_READ = [
    "1 +- 0.6 % of the breech force: bore_friction",
    "0 +- 1 % of the resistance: unread_share",
    "none is taken, 0 kg: carried_mass",
    "0 +- 0.2 % of the peak resistance: unread_force",
]
"""Forces that no gauge reads, of a rig that says nothing of them."""


def test_what_has_no_uncertainty_no_sensor_and_no_date_is_named() -> None:
    lines = assumption_lines(assumptions_of(bench_rig()))
    assert lines == [
        "taken as exact: bore_area, brake_area, recuperator_area",
        "none is taken, 0 kg: carried_mass",
        "not measured: carriage_acceleration_x, carriage_acceleration_y, carriage_rate, tipping_rate",
        "nothing that the breech chain does is taken until stated: muzzle_brake, tube_axial_hz, p_breech",
        "scale in a pulse known to 0.5 % only: p_breech",
        "zero that may move by 0.1 % of the range: p_breech, p_brake, p_recuperator",
        "delay taken as exact: p_recuperator",
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_breech, p_brake, p_recuperator",
        "no calibration date: acc, p_breech, p_brake, p_recuperator",
    ]


def test_a_friction_without_an_uncertainty_is_taken_as_exact() -> None:
    text = bench_rig().text.replace("u_friction = 150.0\n", "")
    rows = assumptions_of(parse_rig(text, bench_rig().path))
    assert [row["detail"] for row in rows if row["quantity"] == "friction"] == [
        "[mechanism] has no u_friction: 1500 N is taken"
    ]


def said_of(symbol: str, *keys: str) -> list[tuple[str, str]]:
    """Return what is said of a value of the mechanism where some keys are stated."""
    rig = load_rig("field-2013")
    text = rig.text.replace("[mechanism]\n", "\n".join(["[mechanism]", *keys, ""]))
    rows = assumptions_of(parse_rig(text, rig.path))
    return [(row["taken"], row["detail"]) for row in rows if row["quantity"] == symbol]


@pytest.mark.parametrize(
    ("symbol", "usual", "what"),
    [
        ("bore_friction", "1 +- 0.6 % of the breech force", "what the projectile's friction takes off"),
        ("unread_share", "0 +- 1 % of the resistance", "what else resists or pushes, read by no gauge"),
        ("carried_mass", "none is taken, 0 kg", "oil and rods that move along, which the specification lacks"),
    ],
)
def test_of_a_force_that_nobody_reads_the_usual_value_is_said_until_the_rig_states_it(symbol, usual, what) -> None:
    assert said_of(symbol) == [(usual, f"[mechanism] does not state {what}: write {symbol} and u_{symbol}")]
    assert said_of(symbol, f"{symbol} = 0.01", f"u_{symbol} = 0.002") == []
    assert said_of(symbol, f"{symbol} = 0", f"u_{symbol} = 0") == []
    ((taken, detail),) = said_of(symbol, f"{symbol} = 0.01")
    assert taken == "taken as exact"
    assert detail.startswith(f"[mechanism] has no u_{symbol}: ")


def test_of_the_breech_chain_it_is_said_what_nobody_states() -> None:
    ((_, detail),) = said_of("tube_axial_hz")
    assert "write tube_axial_hz" in detail
    assert said_of("tube_axial_hz", "tube_axial_hz = 900.0") == []
    ((_, detail),) = said_of("muzzle_brake")
    assert "write muzzle_brake and u_muzzle_brake" in detail
    assert said_of("muzzle_brake", "muzzle_brake = 0", "u_muzzle_brake = 0") == []
    ((taken, detail),) = said_of("muzzle_brake", "muzzle_brake = 0.1", "projectile_mass = 15", "bore_length = 2")
    assert (taken, detail) == ("taken as exact", "[mechanism] has no u_muzzle_brake: 10 % of the breech force is taken")


@pytest.mark.parametrize(
    ("stated", "lacks"),
    [
        ("", "`u_linearity_rel` and no `gauge_ahead`"),
        ("u_linearity_rel = 0.005", "`gauge_ahead`"),
        ("gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15, u_share = 0 }", "`u_linearity_rel`"),
    ],
)
def test_of_a_breech_gauge_it_is_said_what_its_sensor_leaves_out(stated: str, lacks: str) -> None:
    rig = bench_rig(p_breech=stated) if stated else bench_rig()
    (row,) = [one for one in assumptions_of(rig) if one["quantity"] == "p_breech" and "chain" in one["taken"]]
    assert row["detail"].startswith(f"its sensor has no {lacks}: ")


def test_a_breech_gauge_is_taken_as_static_until_its_certificate_says_how_it_was_found() -> None:
    (row,) = [one for one in assumptions_of(bench_rig()) if "pulse" in one["taken"]]
    assert (row["quantity"], row["taken"]) == ("p_breech", "scale in a pulse known to 0.5 % only")
    for named in ("`calibration`", '"static"', '"dynamic"', "weigh a mass and add it to every second shot"):
        assert named in row["detail"]
    for said in ("static", "dynamic"):
        rig = bench_rig(p_breech=f'calibration = "{said}"')
        assert not [one for one in assumptions_of(rig) if "pulse" in one["taken"]]


def test_a_usual_value_whose_uncertainty_alone_is_stated_is_said() -> None:
    detail = "[mechanism] has u_bore_friction and no bore_friction"
    assert said_of("bore_friction", "u_bore_friction = 0.002") == [("1 % of the breech force is taken", detail)]
    assert said_of("unread_share", "u_unread_share = 0.002") == []


def test_slides_are_said_where_the_rig_has_them_and_not_how_well_they_are_known() -> None:
    assert said_of("slide_friction") == []
    assert said_of("slide_friction", "slide_friction = 80.0") == [
        ("taken as exact", "[mechanism] has no u_slide_friction: 80 N s/m is taken")
    ]


def test_a_force_of_any_shape_is_said_until_the_rig_states_it() -> None:
    ((taken, _),) = said_of("unread_force")
    assert taken == "0 +- 0.2 % of the peak resistance"
    assert said_of("unread_force", "unread_force = 0") == []


@pytest.mark.parametrize("key", ["delay_s = 0.0", "u_delay_s = 0.001"])
def test_a_recuperator_gauge_whose_delay_is_stated_has_no_usual_one(key: str) -> None:
    rig = load_rig("field-2013")
    stated = parse_rig(rig.text.replace('serial = "V303"', f'serial = "V303", {key}'), rig.path)
    assert (rig.channel("p_recuperator").u_line_s, stated.channel("p_recuperator").u_line_s) == (2e-3, 0.0)
    assert rig.channel("p_brake").u_line_s == 0.0
    lines = [assumption_lines(assumptions_of(one)) for one in (rig, stated)]
    assert ["delay of 0 +- 2 ms: p_recuperator" in one for one in lines] == [True, False]
    assert ("delay taken as exact: p_recuperator" in lines[1]) == (key == "delay_s = 0.0")


def test_what_is_stated_is_no_assumption() -> None:
    rig = load_rig("field-2013")
    assert assumption_lines(assumptions_of(rig)) == [
        "taken as exact: bore_area, brake_area, recuperator_area",
        *NOT_READ,
        "nothing that the breech chain does is taken until stated: muzzle_brake, tube_axial_hz, p_breech",
        "scale in a pulse known to 0.5 % only: p_breech",
        "delay of 0 +- 2 ms: p_recuperator",
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_breech, p_brake, p_recuperator",
    ]


def test_a_gauge_that_names_its_standard_is_not_taken_to_have_one_of_its_own() -> None:
    rig = load_rig("field-2013")
    named = rig.text.replace("u_zero_rel = 0.001,", 'reference = "dead weights", u_zero_rel = 0.001,', 1)
    assert assumption_lines(assumptions_of(parse_rig(named, rig.path)))[-1] == (
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_brake, p_recuperator"
    )


def test_the_only_gauge_that_may_be_off_has_no_standard_in_common_with_another() -> None:
    rig = load_rig("field-2013")
    exact = rig.text.replace("u_rel = 0.004,", "u_rel = 0,")
    assert exact.count("u_rel = 0,") == 2
    assert not any("standard" in line for line in assumption_lines(assumptions_of(parse_rig(exact, rig.path))))


def test_an_added_mass_without_its_uncertainty_is_taken_as_exact() -> None:
    rig = load_rig("field-2013")
    row = assumptions_of(rig.with_added_mass(120.0, None))[0]
    assert (row["quantity"], row["taken"]) == ("added mass", "taken as exact")
    assert "120 kg" in row["detail"]
    assert assumptions_of(rig.with_added_mass(120.0, 0.0)) == assumptions_of(rig)


def test_an_absolute_gauge_is_said_to_lose_the_standard_atmosphere() -> None:
    rig = load_rig("field-2013")
    gauge = next(one for one in rig.channels if one.role == "recuperator_pressure")
    absolute = gauge.model_copy(update={"unit": "bar(a)"})
    turned = replace(rig, channels=(absolute,))
    line = "absolute pressure less the standard atmosphere, 1.01325 bar: p_recuperator"
    assert line in assumption_lines(assumptions_of(turned))
    assert line not in assumption_lines(assumptions_of(rig))
    assert si_line(turned.channel(gauge.name), UNITS["bara"]) == (1e5, -101325.0)
