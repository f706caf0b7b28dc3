from __future__ import annotations

import math
from typing import Any

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.quantity import SI_UNITS, STANDARD_GRAVITY_M_S2, UNITS, find_unit, normalise_unit

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
    "1": "dimensionless",
    "t": "metric_ton",
    "h": "hour",
    "%": "0.01 * dimensionless",
}


@pytest.mark.parametrize("spelling", [s for s in UNITS if s != "degC"])
def test_every_factor_is_pints(spelling: str) -> None:
    unit = UNITS[spelling]
    assert unit.offset == 0
    for quantity in unit.quantities:
        value = REGISTRY(PINT_NAMES.get(spelling, spelling))
        factor: float = REGISTRY.Quantity(value).to(SI_UNITS[quantity]).magnitude
        assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_degrees_celsius_are_pints_too() -> None:
    for value in (-40.0, 0.0, 21.5):
        kelvin = REGISTRY.Quantity(value, "degC").to("K").magnitude
        assert UNITS["degC"].to_si(value) == pytest.approx(kelvin, rel=1e-12)


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
    ],
)
def test_spellings_of_one_unit_are_one(written: str, spelling: str) -> None:
    assert normalise_unit(written) == spelling
    assert find_unit(written) is UNITS[spelling]


@pytest.mark.parametrize(
    "written", ["mpa", "KPA", "nm", "NM", "M/S2", "furlong", "m/s3", "m/s22", "bar(a)", "psia", "°F", "gauss"]
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
