"""Numbers with their units as engineers write them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_daq.terminal.engineering import engineering

FACTORS = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.523e6, "Pa", "1.52 MPa"),
        (-0.0034, "rad/s", "-3.40 mrad/s"),
        (999.96, "Pa", "1.00 kPa"),
        (0.0, "V", "0 V"),
        (None, "V", "-"),
        (math.nan, "V", "-"),
        (1234.0, "", "1230"),
        (-2261.0, "m/s2", "-2.26 km/s2"),
        (-0.8, "m/s^2", "-800 mm/s^2"),
        (123.4, "m/s2", "123 m/s2"),
        (1500.0, "m^2", "1500 m^2"),
        (2.5e7, "m^2", "2.50e+07 m^2"),
        (-0.0123, "kg", "-0.0123 kg"),
        (2300.0, "kg/s", "2300 kg/s"),
        (5e12, "Pa", "5000 GPa"),
        (1314.0, "bar", "1310 bar"),  # chosen instead of SI: as it is
        (0.0204, "g", "0.0204 g"),
        (2.17e-19, "rad/s", "2.17e-19 rad/s"),
    ],
)
def test_a_number_gets_the_prefix_that_fits(value, unit, text) -> None:
    assert engineering(value, unit) == text


@given(st.floats(1e-8, 1e11), st.sampled_from([-1, 1]))
def test_what_is_written_is_the_number_to_three_digits(size: float, sign: int) -> None:
    number, unit = engineering(sign * size, "Pa").split(" ")
    assert float(number) * FACTORS[unit.removesuffix("Pa")] == pytest.approx(sign * size, rel=5.1e-3)
    assert abs(float(number)) < 1000
