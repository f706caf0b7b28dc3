from __future__ import annotations

import math
from typing import Any

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.quantities.quantity import SI_UNITS, STANDARD_GRAVITY_M_S2, UNITS, find_unit, normalise_unit

REGISTRY: pint.UnitRegistry[Any] = pint.UnitRegistry()

# pint's names for the spellings that mean something else to it: g is its gram, rev/s its count of turns
PINT_NAMES = {
    "g": "standard_gravity",
    "gn": "standard_gravity",
    "g_n": "standard_gravity",
    "g0": "standard_gravity",
    "mg": "1e-3 * standard_gravity",
    "kg_n": "1e3 * standard_gravity",
    "rev": "turn",
    "rev/s": "turn/s",
    "rev/s^2": "turn/s**2",
    "dps": "degree/s",
    "rpm": "turn/minute",
    "kgf": "kilogram_force",
    "kgf/cm^2": "kilogram_force/cm**2",
    "lbf": "pound_force",
    "ksi": "1e3 * psi",
    "klbf": "1e3 * pound_force",
    "kgf/mm^2": "kilogram_force/mm**2",
    "Torr": "torr",
    "mmH2O": "kilogram_force/m**2",
    "cmH2O": "10 * kilogram_force/m**2",
    "inH2O": "25.4 * kilogram_force/m**2",
    "ozf": "pound_force/16",
    "lbf*ft": "pound_force*foot",
    "lbf*in": "pound_force*inch",
    "degR": "degR",
    "1": "dimensionless",
    "t": "metric_ton",
    "h": "hour",
    "%": "0.01 * dimensionless",
}


@pytest.mark.parametrize("spelling", [name for name, unit in UNITS.items() if not unit.offset])
def test_every_factor_is_pints(spelling: str) -> None:
    unit = UNITS[spelling]
    for quantity in unit.quantities:
        value = REGISTRY(PINT_NAMES.get(spelling, spelling))
        factor: float = REGISTRY.Quantity(value).to(SI_UNITS[quantity]).magnitude
        assert unit.factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("spelling", ["degC", "degF"])
def test_degrees_are_pints_too(spelling: str) -> None:
    for value in (-40.0, 0.0, 21.5):
        kelvin = REGISTRY.Quantity(value, spelling).to("K").magnitude
        assert UNITS[spelling].to_si(value) == pytest.approx(kelvin, rel=1e-12)


def test_units_with_another_zero_are_degrees_and_absolute_pressures() -> None:
    shifted = {name for name, unit in UNITS.items() if unit.offset}
    absolute = {name for name, unit in UNITS.items() if unit.is_absolute_pressure}
    assert shifted - absolute == {"degC", "degF"}
    assert {"bara", "psia", "kPaa"} <= absolute
    for name in absolute - {"ata"}:
        assert UNITS[name].factor == UNITS[name.removesuffix("a")].factor


@pytest.mark.parametrize("quantity", SI_UNITS)
def test_every_quantity_has_its_si_unit_in_the_table(quantity: str) -> None:
    unit = UNITS[SI_UNITS[quantity]]
    assert quantity in unit.quantities
    assert (unit.factor, unit.offset) == (1.0, 0.0)


def test_every_unit_belongs_to_known_quantities() -> None:
    for unit in UNITS.values():
        assert unit.quantities
        assert unit.quantities <= set(SI_UNITS)


@pytest.mark.parametrize(
    ("written", "spelling"),
    [
        ("m/s2", "m/s^2"),
        ("m/s²", "m/s^2"),
        ("m/s**2", "m/s^2"),
        ("m/(s^2)", "m/s^2"),
        ("m/s/s", "m/s^2"),
        (" m / s^2 ", "m/s^2"),
        ("rad/s2", "rad/s^2"),
        ("°", "deg"),
        ("°/s", "deg/s"),
        ("°/s²", "deg/s^2"),
        ("deg/s2", "deg/s^2"),
        ("deg/sec", "deg/s"),
        ("Degrees", "deg"),
        ("°C", "degC"),
        ("N/mm2", "N/mm^2"),
        ("N/m²", "Pa"),
        ("kgf/cm²", "kgf/cm^2"),
        ("Nm", "N*m"),
        ("N·m", "N*m"),
        ("kNm", "kN*m"),
        ("µm/m", "um/m"),
        ("μs", "us"),
        ("-", "1"),
        ("", "1"),
        ("counts", "1"),
        ("MPa", "MPa"),
        ("Volts", "V"),
        ("volt", "V"),
        ("A", "A"),
        ("Amps", "A"),
        ("kph", "km/h"),
        ("G", "g"),
        ("bar(g)", "bar"),
        ("barg", "bar"),
        ("psig", "psi"),
        ("%", "%"),
        ("1/min", "rpm"),
        ("U/min", "rpm"),
        ("RPM", "rpm"),
        ("mV/V", "mV/V"),
        ("daN", "daN"),
        ("lbs", "lb"),
        ("Inch", "in"),
        ("inches", "in"),
        ("Newton", "N"),
        ("hours", "h"),
        ("seconds", "s"),
        ("m/sec", "m/s"),
        ("m/sec2", "m/s^2"),
        ("m/sec^2", "m/s^2"),
        ("microstrain", "um/m"),
        ("µε", "um/m"),
        ("BAR", "bar"),
        ("bar(a)", "bara"),
        ("bar abs", "bara"),
        ("bar_a", "bara"),
        ("PSIA", "psia"),
        ("psi(a)", "psia"),
        ("kPa(a)", "kPaa"),
        ("MPa(abs)", "MPaa"),
        ("barü", "bar"),
        ("°F", "degF"),
        ("deg F", "degF"),
        ("kip", "klbf"),
        ("kips", "klbf"),
        ("lb/in²", "psi"),
        ("lbf/in^2", "psi"),
        ("in Hg", "inHg"),
        ("mm Hg", "mmHg"),
        ("kg/cm²", "kgf/cm^2"),
        ("ft-lb", "lbf*ft"),
        ("in-lbf", "lbf*in"),
    ],
)
def test_spellings_of_one_unit_are_one(written: str, spelling: str) -> None:
    assert normalise_unit(written) == spelling
    assert find_unit(written) is UNITS[spelling]


@pytest.mark.parametrize(
    "written", ["mpa", "KPA", "nm", "NM", "M/S2", "furlong", "m/s3", "m/s22", "barrel", "F", "psid", "gauss"]
)
def test_what_is_not_a_known_unit_is_not_guessed(written: str) -> None:
    assert find_unit(written) is None


def test_case_tells_milli_from_mega() -> None:
    milli, mega = UNITS["mV"], UNITS["MPa"]
    assert (milli.factor, mega.factor) == (1e-3, 1e6)


@given(st.text(max_size=12))
def test_normalising_twice_changes_nothing_and_never_fails(spelling: str) -> None:
    once = normalise_unit(spelling)
    assert normalise_unit(once) == once


@pytest.mark.parametrize("spelling", UNITS)
def test_every_table_key_is_its_own_normal_spelling(spelling: str) -> None:
    assert normalise_unit(spelling) == spelling


def test_arrays_are_converted_like_numbers() -> None:
    values = np.array([0.0, 1.0, math.nan])
    converted = UNITS["g"].to_si(values)
    np.testing.assert_array_equal(converted, [0.0, STANDARD_GRAVITY_M_S2, math.nan])
    assert UNITS["g"].to_si(1.0) == converted[1]


def test_the_tables_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        UNITS["m"] = UNITS["mm"]  # type: ignore[index]  # what the test is about
    with pytest.raises(TypeError):
        SI_UNITS["force"] = "kN"  # type: ignore[index]  # what the test is about


@pytest.mark.parametrize(
    ("written", "value", "si"),
    [
        ("bara", 1.01325, 0.0),
        ("psia", 14.695948775513, 0.0),
        ("kPa(a)", 0.0, -101325.0),
        ("bar(g)", 1.01325, 101325.0),
        ("°F", 32.0, 273.15),
        ("°F", 212.0, 373.15),
        ("ksi", 1.0, 6894757.293168),
        ("kip", 1.0, 4448.2216152605),
        ("inHg", 29.9213, 101325.1),
    ],
)
def test_what_labs_write_is_what_a_handbook_says(written: str, value: float, si: float) -> None:
    # NIST SP 811, appendix B.8; an absolute pressure is shown as what it is above the standard atmosphere
    unit = find_unit(written)
    assert unit is not None
    assert unit.to_si(value) == pytest.approx(si, rel=1e-6, abs=1e-3)
    assert unit.from_si(unit.to_si(value)) == pytest.approx(value, rel=1e-12, abs=1e-12)
    assert unit.is_absolute_pressure == (unit.offset < 0)
