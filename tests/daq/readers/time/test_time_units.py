from __future__ import annotations

import pytest

from recoil_acquisition.readers.time.time_axis import axis_unit_s
from recoil_acquisition.readers.time.time_units import rate_unit_hz, time_unit_s


@pytest.mark.parametrize(
    ("spelling", "seconds"),
    [
        ("s", 1.0), ("ms", 1e-3), ("MS", 1e-3), ("[us]", 1e-6), ("(µs)", 1e-6), (" ns ", 1e-9), ("min", 60.0),
        ("h", 3600.0), ("Hours", 3600.0), ("d", 86400.0), ("m", None), ("Hz", None), ("", None), ("[]", None),
    ],
)  # fmt: skip
def test_units_of_time_are_known_and_no_others(spelling: str, seconds: float | None) -> None:
    assert time_unit_s(spelling) == seconds


@pytest.mark.parametrize(
    ("spelling", "hertz"),
    [
        ("Hz", 1.0), ("kHz", 1e3), ("khz", 1e3), ("MHz", 1e6), ("mHz", 1e-3), ("MHZ", 1e6), ("mhz", None),
        ("S/s", 1.0), ("kS/s", 1e3), ("MS/s", 1e6), ("1/s", 1.0), ("rpm", None), ("s", None), ("", None),
    ],
)  # fmt: skip
def test_units_of_rates_are_known_and_no_others(spelling: str, hertz: float | None) -> None:
    assert rate_unit_hz(spelling) == hertz


@pytest.mark.parametrize(
    ("name", "unit", "expected"),
    [
        ("", "", 1.0), ("Time", "", 1.0), ("Time", "ms", 1e-3), ("Zeit [ms]", "", 1e-3), ("whatever", "us", 1e-6),
        ("Time [ms]", "s", "contradicts"), ("Frequency", "", "'Frequency', not time"), ("Frequency", "s", "not time"),
        ("Angle", "deg", "'Angle' in 'deg', not time"), ("Channel 7", "", "without a unit of time"),
        ("Time", "Hz", "'Hz', which is no unit of time"), ("", "fortnights", "'fortnights'"),
    ],
)  # fmt: skip
def test_an_axis_is_time_or_it_is_said_why_not(name: str, unit: str, expected: float | str) -> None:
    found = axis_unit_s(name, unit)
    if isinstance(expected, str):
        assert expected in str(found)
    else:
        assert found == expected
