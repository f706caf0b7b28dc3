"""What a person types is one number in the unit that is wanted, or is refused with what to write."""

from __future__ import annotations

import math
import re

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.quantities.typed_quantity import TypedError, number_and_unit, typed_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0,21", "rad", 0.21), (".93", "m", 0.93), (" -,5 ", "m", -0.5), ("−0,3", "m", -0.3), ("+2.5e3", "N", 2500.0),
        ("2100 N", "N", 2100.0), ("2,1kN", "N", 2100.0), ("0,86 deg", "rad", 0.0150098315671512),
        ("113,1 cm2", "m2", 0.01131), ("113.1 cm²", "m2", 0.01131), ("12.5 bar", "Pa", 1.25e6),
        ("50 g", "kg", 0.05), ("1.5 g", "m/s2", 14.709975), ("0,5 %", "", 0.005), ("500 ppm", "", 0.0005),
        ("12 kg*m^2", "kg m2", 12.0), ("5 N·s/mm", "N s/m", 5000.0), ("500 µm/px", "mm/px", 0.5),
        ("21 °C", "degC", 21.0), ("70 °F", "degC", 21.1111111111111), ("5 kHz", "Hz", 5000.0), ("1000 fps", "Hz", 1e3),
        ("10.430", "kg", 10.43), ("0,500", "kg", 0.5), ("12,5000", "kg", 12.5),
    ],
)  # fmt: skip
def test_a_number_with_point_or_comma_and_perhaps_a_unit(text: str, unit: str, value: float) -> None:
    assert typed_quantity(text, unit) == value


@pytest.mark.exhaustive
@pytest.mark.parametrize("unit", ["dm2", "cm^2", "mm2", "in^2", "ft^2"])
@pytest.mark.parametrize("number", ["1", "113.1"])
def test_areas_are_those_of_an_independent_table_of_units(unit: str, number: str) -> None:
    by_pint: float = pint.Quantity(float(number), unit.replace("2", "**2").replace("^", "")).to("m**2").magnitude
    assert typed_quantity(f"{number} {unit}", "m2") == pytest.approx(by_pint, rel=1e-13)


@pytest.mark.parametrize("unit", ["kg cm2", "kg mm2", "g cm2", "t m2", "lb ft2", "lb in2"])
def test_moments_of_inertia_are_so_too(unit: str) -> None:
    of, length = unit.removesuffix("2").split()
    by_pint: float = pint.Quantity(1.0, f"{of.replace('t', 'metric_ton')} * {length}**2").to("kg * m**2").magnitude
    assert typed_quantity(f"1 {unit}", "kg m2") == pytest.approx(by_pint, rel=1e-13)


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("10,430 kg", "kg", "may be thousands or decimals, 10430 or 10.43: write 10430 or 10,4300"),
        ("1.234,5", "kg", "is not one number"), ("10 430 kg", "kg", "is not one number"), ("1'000", "kg", "is not one"),
        ("12..5", "m", "is not one number"), ("heavy", "kg", "does not begin with a number"), ("", "kg", "does not"),
        ("nan", "kg", "does not begin with a number"), ("1e999", "kg", "has a number that is too large"),
        ("12 m", "kg", "has the unit 'm', which is none of a value in kg: nearest: mg, g, kg"),
        ("12 abc", "", "has the unit 'abc', which is none of a share"), ("782 ± 2 kg", "kg", "has the unit '± 2 kg'"),
        ("٣", "kg", "does not begin with a number"), ("2 MPa", "kg m2", "has the unit 'MPa'"),
        ("2 %", None, "has the unit '%', and is a plain number"),
    ],
)  # fmt: skip
def test_what_is_none_is_refused_with_what_to_write(text: str, unit: str | None, said: str) -> None:
    with pytest.raises(TypedError, match=re.escape(said)):
        typed_quantity(text, unit)


def test_where_the_decimal_mark_is_known_the_other_one_is_doubtful_and_where_none_is_both_are() -> None:
    assert typed_quantity("10,430", "kg", ",") == 10.43
    for text, mark in (("10.430", ","), ("10.430", ""), ("10,430", "")):
        with pytest.raises(TypedError, match=r"10430 or 10\.43"):
            typed_quantity(text, "kg", mark)


def test_a_difference_has_no_zero_of_its_own() -> None:
    assert typed_quantity("9 °F", "degC", difference=True) == pytest.approx(5.0)
    assert typed_quantity("1 bara", "Pa", difference=True) == pytest.approx(1e5)


@given(st.floats(-1e300, 1e300), st.sampled_from(["", " m", "m"]))
def test_every_number_that_python_prints_is_itself_with_a_point_or_a_comma(number: float, unit: str) -> None:
    for text in {repr(number), f"{number:.4e}", f"{number:.4e}".replace(".", ",")}:
        value, behind = number_and_unit(f"{text}{unit}")
        assert (value, behind) == (float(text.replace(",", ".")), unit.strip())


@given(st.text(max_size=30))
def test_no_text_is_anything_but_a_number_or_refused(text: str) -> None:
    try:
        value = typed_quantity(text, "m")
    except TypedError as error:
        refused = error
    else:
        assert math.isfinite(value)
        return
    assert refused.problem
