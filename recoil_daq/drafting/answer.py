"""An answer to a question of a draft, as somebody types it: a value of the rig file, or what is wrong with it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.errors import Fault, nearest_first
from recoil_acquisition.files.bounded_toml import toml_value, typed_value
from recoil_acquisition.quantities.declaration import DeclaredTable, declared
from recoil_acquisition.quantities.quantity import UNITS, find_unit, normalise_unit
from recoil_acquisition.quantities.typed_quantity import number_and_unit, typed_quantity
from recoil_rigs.checks.plausible import U_SHARE
from recoil_rigs.mechanism.bounds import Bounds
from recoil_rigs.mechanism.mechanism_parameters import UNITS as UNITS_OF_SYMBOLS
from recoil_rigs.mechanism.mechanism_parameters import MechanismModel
from recoil_rigs.mechanism.mechanism_table import problem_of_value
from recoil_rigs.mechanism.mechanisms import MECHANISMS
from recoil_rigs.tables.sensitivity import sensitivity_from_text

NONE = "-"
"""Answer by which a key that may be left out is."""
_BETWEEN = re.compile(r"\s*;\s*|\s*\.\.+\s*|,\s+|\s+to\s+|(?<=\S)\s+(?=[+-]?[.,]?\d)", re.ASCII)
"""What may stand between two numbers that somebody types."""


@dataclass(frozen=True)
class Answer:
    """Value that an answer says.

    Attributes
    ----------
    value
        Value in TOML's types; None where the key is to be left out.
    typed
        Text that was typed, where the value is another number than its digits.
    unit
        Unit of the value; empty if it has none.
    doubt
        Sentence on what is unusual of it; empty if nothing is.
    """

    value: Any
    typed: str = ""
    unit: str = ""
    doubt: str = ""


Read = Callable[[str], Answer]
"""Reads what somebody types; ValueError says what is wrong with it."""


def as_toml(text: str) -> Answer:
    """Take a value as a rig file would have it; a word without quotes is a text."""
    return Answer(typed_value(text))


def as_text(text: str) -> Answer:
    """Take a text as it stands, be it all digits; quotes around it are none of it."""
    stripped = text.strip()
    return Answer(stripped[1:-1] if re.fullmatch(r"""(["']).+\1""", stripped) else stripped)


def a_number(unit: str, bounds: Bounds | None = None, *, positive: bool = False, difference: bool = False) -> Read:
    """Take a number in a unit, within bounds."""

    def read(text: str) -> Answer:
        value = typed_quantity(text, unit, difference=difference)
        if positive and value <= 0.0:
            raise ValueError("must be more than 0")
        return _within(value, text, unit, bounds)

    return read


def a_symbol(symbol: str, model: MechanismModel) -> Read:
    """Take a value of the mechanism, or its standard uncertainty, within what such a mechanism can have."""
    of = symbol.removeprefix("u_")
    is_uncertainty = symbol != of
    bounds = U_SHARE.get(of) if is_uncertainty else MECHANISMS[model].bounds.get(of)
    number = a_number(UNITS_OF_SYMBOLS[of], bounds, difference=is_uncertainty)

    def read(text: str) -> Answer:
        answer = number(text)
        problem = problem_of_value(symbol, answer.value, is_uncertainty)
        if problem is not None:
            raise ValueError(problem[0])
        return answer

    return read


def two_numbers(unit: str | None, *, rising: bool = False) -> Read:
    """Take two numbers in a unit, the second larger where that matters; the unit may stand behind the second alone."""

    def read(text: str) -> Answer:
        inner = text.strip().removeprefix("[").removesuffix("]").strip()
        stated = typed_value(f"[{inner}]")
        parts = list(map(str, stated)) if isinstance(stated, list) else _BETWEEN.split(inner)
        if len(parts) != 2:
            raise ValueError(f"has {len(parts)} numbers; write two, such as [0, 2.5] or 0; 2,5")
        behind = number_and_unit(parts[1])[1]
        if behind and not number_and_unit(parts[0])[1]:
            parts[0] = f"{parts[0]} {behind}"
        values = [typed_quantity(part, unit) for part in parts]
        if rising and not values[0] < values[1]:
            raise ValueError(f"must be [lowest, highest], found {toml_value(values)}")
        return Answer(values, "" if toml_value(values) == toml_value(stated) else text.strip(), unit or "")

    return read


def one_of(names: Sequence[str], *, or_none: bool = False) -> Read:
    """Take one of several names, whatever its case; or none of them, where the key may be left out."""
    known = {name.casefold(): name for name in names}

    def read(text: str) -> Answer:
        word = text.strip().strip("\"'")
        if or_none and word == NONE:
            return Answer(None)
        if word.casefold() not in known:
            raise ValueError(f"is none of {', '.join(nearest_first(word, list(names)))}")
        return Answer(known[word.casefold()])

    return read


def or_none(read: Read) -> Read:
    """Take what `read` takes, or nothing: the key is left out."""
    return lambda text: Answer(None) if text.strip() == NONE else read(text)


def a_unit(others: Sequence[str]) -> Read:
    """Take a unit, or one of other spellings."""

    def read(text: str) -> Answer:
        word = text.strip().strip("\"'")
        if word.casefold() in others or find_unit(word) is not None:
            return Answer(word)
        raise ValueError(f"is no unit: {', '.join(nearest_first(normalise_unit(word), list(UNITS))[:5])}")

    return read


def a_sign(text: str) -> Answer:
    """Take 1 or -1."""
    value = typed_quantity(text, None)
    if value not in (1.0, -1.0):
        raise ValueError("must be 1 or -1")
    return Answer(int(value))


def a_sensitivity(text: str) -> Answer:
    """Take a sensitivity as on a certificate."""
    written = text.strip().strip("\"'")
    sensitivity_from_text(written)
    return Answer(written)


def a_table(key: str, model: type[DeclaredTable] | None = None, kinds: tuple[type, ...] = (dict,)) -> Read:
    """Take a value that TOML writes in braces or brackets, as the model with its key takes it.

    Parameters
    ----------
    model
        Model of a table that has the key; None where a reader checks what the value says.
    kinds
        Types that it may have.
    """

    def read(text: str) -> Answer:
        value = typed_value(text)
        if not isinstance(value, kinds):
            raise ValueError("is not what the question shows, in TOML's braces or brackets")
        faults: list[Fault] = []
        if model is not None and declared(model, {key: value}, (), faults) is None:
            raise ValueError("; ".join(map(str, faults)))
        return Answer(value)

    return read


def a_tick(clock: Mapping[str, Any]) -> Read:
    """Take the table of a device's clock as TOML writes it, or how long a tick is, for the clock that was found."""
    table = a_table("device_time")

    def read(text: str) -> Answer:
        if text.lstrip().startswith("{"):
            return table(text)
        answer = a_number("s", positive=True)(text)
        return Answer({**clock, "tick_s": answer.value}, text.strip())

    return read


def _within(value: float, text: str, unit: str, bounds: Bounds | None) -> Answer:
    if bounds is not None and (fault := bounds.fault(value)):
        raise ValueError(fault)
    plain = str(typed_value(text)) in (str(value), f"{value:g}")
    doubt = "" if bounds is None else bounds.warning(value)
    return Answer(value, "" if plain else text.strip(), unit, doubt)
