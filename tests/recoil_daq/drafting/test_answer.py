"""What is typed in answer to a question of a draft is a value of its key, or is refused with what would be one."""

from __future__ import annotations

import re
from typing import Any

import pytest

from recoil_daq.drafting.answer import (
    NONE,
    Read,
    a_number,
    a_sensitivity,
    a_sign,
    a_symbol,
    a_tick,
    a_unit,
    as_text,
    one_of,
    two_numbers,
)
from recoil_rigs.checks.plausible import OF_SOURCE, U_REL
from recoil_rigs.mechanism.mechanism_parameters import UNITS, Mechanism, MechanismModel

GUN, LINE = MechanismModel.GUN, MechanismModel.LINE
CLOCK = {"field": "device_time", "tick_s": 1e-6, "modulo": 1 << 32}
FRAME_RATE = a_number("Hz", OF_SOURCE["frame_rate"])


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (a_symbol("phi20", GUN), "0,21", 0.21), (a_symbol("phi10", GUN), "0,86 deg", 0.0150098315671512),
        (a_symbol("d", GUN), ".93", 0.93), (a_symbol("friction", GUN), "2100 N", 2100.0),
        (a_symbol("u_friction", GUN), "0,15 kN", 150.0), (a_symbol("bore_area", GUN), "113,1 cm2", 0.01131),
        (a_symbol("bore_friction", GUN), "1 %", 0.01), (a_symbol("m3", LINE), "250 g", 0.25),
        (a_symbol("u_unread_share", GUN), "1 %", 0.01), (FRAME_RATE, "10 kHz", 1e4),
        (a_number("", U_REL), "0,5 %", 0.005),
        (two_numbers("MPa"), "[0, 250]", [0.0, 250.0]), (two_numbers("MPa"), "0 to 2500 bar", [0.0, 250.0]),
        (two_numbers("m"), "-0,5; 12 cm", [-0.005, 0.12]), (two_numbers("m"), "0,5 1,25", [0.5, 1.25]),
        (two_numbers(None), "-5 .. 5", [-5.0, 5.0]),
        (a_tick(CLOCK), "0,1 ms", {**CLOCK, "tick_s": 1e-4}), (a_tick(CLOCK), "1e-6", CLOCK),
        (a_tick(CLOCK), '{ field = "t", tick_s = 1e-3 }', {"field": "t", "tick_s": 1e-3}),
        (as_text, "4711", "4711"), (as_text, '"V301"', "V301"), (one_of(("trigger",)), "Trigger", "trigger"),
        (one_of(("trigger",), or_none=True), NONE, None), (a_unit(()), "bar", "bar"),
        (a_unit(("px",)), "px", "px"), (a_sign, "-1", -1), (a_sensitivity, "40,5 mV/MPa", "40,5 mV/MPa"),
    ],
)  # fmt: skip
def test_an_answer_is_the_value_of_its_key(read: Read, text: str, value: Any) -> None:
    found = read(text).value
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (a_symbol("m3", GUN), "10430000", "must lie between 0.01 and 1e+06 kg, found 1.043e+07"),
        (a_symbol("m3", GUN), "10,430", "may be thousands or decimals, 10430 or 10.43"),
        (a_symbol("phi20", GUN), "99", "must lie between -1.57 and 1.57 rad, found 99"),
        (a_symbol("m3", LINE), "2e7 kg", "must lie between 1e-06 and 1e+07 kg"),
        (a_symbol("u_friction", GUN), "-3", "a standard uncertainty is not negative"),
        (a_symbol("u_bore_friction", GUN), "6 %%", "has the unit '%%'"),
        (a_symbol("friction", GUN), "much", "does not begin with a number"),
        (FRAME_RATE, "5", "must lie between 10 and 1e+07 Hz, found 5"),
        (a_number("Hz", positive=True), "0", "must be more than 0"),
        (a_number("", U_REL), "120 %", "must lie between 0 and 1 of the reading"),
        (two_numbers("MPa", rising=True), "[250, 0]", "must be [lowest, highest], found [250.0, 0.0]"),
        (two_numbers("MPa"), "250", "has 1 numbers; write two"), (two_numbers(None), "0 5 bar", "is a plain number"),
        (one_of(("trigger", "breech_pressure")), "breech", "is none of breech_pressure, trigger"),
        (a_unit(()), "mmm", "is no unit: "), (a_sign, "2", "must be 1 or -1"),
        (a_sensitivity, "40", "has no unit per unit"), (a_tick(CLOCK), "0 us", "must be more than 0"),
        (a_tick(CLOCK), "1 kg", "has the unit 'kg'"), (a_tick(CLOCK), "{ tick_s", "TOML's braces"),
    ],
)  # fmt: skip
def test_what_is_none_is_refused_with_what_would_be_one(read: Read, text: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        read(text)


def test_what_is_possible_and_unusual_is_taken_with_a_word() -> None:
    answer = a_symbol("m3", GUN)("0,5 t")
    assert (answer.value, answer.typed, answer.doubt) == (500.0, "0,5 t", "")
    assert a_symbol("phi10", GUN)("0.5").doubt == "0.5 rad is unusual; most lie between -0.3 and 0.3"


def test_every_symbol_of_the_mechanism_has_its_unit() -> None:
    assert set(UNITS) == set(Mechanism.symbols())
