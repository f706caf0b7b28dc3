"""What a rig file leaves unsaid is said for it."""

from __future__ import annotations

from recoil_rigs.assumptions import assumption_lines, assumptions_of
from recoil_rigs.rig import load_rig, parse_rig
from tests.builders.bench_shots import bench_rig


def test_what_has_no_uncertainty_no_sensor_and_no_date_is_named() -> None:
    lines = assumption_lines(assumptions_of(bench_rig()))
    assert lines == [
        "taken as exact: bore_area, brake_area, recuperator_area, bore_friction",
        "not measured: carriage_acceleration_x, carriage_acceleration_y, carriage_rate, tipping_rate",
        "zero that may move by 0.1 % of the range: p_breech, p_brake, p_recuperator",
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_breech, p_brake, p_recuperator",
        "no calibration date: acc, p_breech, p_brake, p_recuperator",
    ]


def test_a_friction_without_an_uncertainty_is_taken_as_exact() -> None:
    text = bench_rig().text.replace("u_friction = 150.0\n", "")
    rows = assumptions_of(parse_rig(text, bench_rig().path))
    assert [row["detail"] for row in rows if row["quantity"] == "friction"] == [
        "[mechanism] has no u_friction: 1500 N is taken"
    ]


def test_a_friction_in_the_bore_that_nobody_stated_is_said_to_be_none() -> None:
    (row,) = [row for row in assumptions_of(bench_rig()) if row["quantity"] == "bore_friction"]
    assert row["detail"] == "[mechanism] has no u_bore_friction: 0 of the breech force is taken"
    stated = bench_rig().text.replace("u_friction = 150.0\n", "u_friction = 150.0\nu_bore_friction = 0.002\n")
    assert "bore_friction" not in {row["quantity"] for row in assumptions_of(parse_rig(stated, bench_rig().path))}


def test_what_is_stated_is_no_assumption() -> None:
    rig = load_rig("field-2013")
    assert assumption_lines(assumptions_of(rig)) == [
        "taken as exact: bore_area, brake_area, recuperator_area, bore_friction",
        "no calibration standard in common (1 % of one would be 1 % of the mass): p_breech, p_brake, p_recuperator",
    ]


def test_a_gauge_that_names_its_standard_is_not_taken_to_have_one_of_its_own() -> None:
    rig = load_rig("field-2013")
    named = rig.text.replace("u_zero_rel = 0,", 'reference = "dead weights", u_zero_rel = 0,', 1)
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
