"""The table ``[mechanism]`` of a rig file: from what it states to a `Mechanism`; every fault is reported at once."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode
from recoil_acquisition.quantities.declaration import stated_number, unknown_key
from recoil_acquisition.quantities.typed_quantity import TypedError
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS, MECHANISM, UNITS, Mechanism, MechanismModel
from recoil_rigs.mechanism.mechanisms import MECHANISMS

_OF_EXIT = ("projectile_mass", "bore_length")

MISSPELT = 0.8
"""Likeness of a key to a symbol from which on the symbol was meant, whatever other symbols mean."""


def declared_mechanism(
    table: Any, roles: Collection[str], faults: list[Fault]
) -> tuple[type[Mechanism] | None, Mechanism | None]:
    """Validate ``[mechanism]``: every value a finite number, every required one there, none that its model lacks.

    Parameters
    ----------
    roles
        Roles of the rig's channels, by which a line has areas.
    faults
        List that every fault found is appended to.

    Returns
    -------
    model, mechanism
        Model that the table names, a gun if it names none, and its values; None where there is a fault.
    """
    if not isinstance(table, dict):
        faults.append(Fault((MECHANISM,), "a table [mechanism] is needed", FaultCode.MISSING))
        return None, None
    model = model_of(table)
    forgotten = _forgotten_model(table, model, roles)
    model = None if forgotten else model
    symbols = Mechanism.symbols()
    known = {MODEL, *symbols, *(f"u_{s}" for s in Mechanism.uncertain())}
    own = [_unknown_symbol(key, symbols) for key in table if key not in known]
    written, table = table, stated_values(table, own)
    for key in (key for key in table if key in known - {MODEL}):
        problem = problem_of_value(key, table[key], key not in symbols)
        if problem is not None:
            own.append(Fault((MECHANISM, key), *problem))
    own += forgotten or _faults_of_model(written, model, roles)
    own += _muzzle_brake_without_exit(table)
    if own or model is None:
        faults += own
        return model, None
    having = model.symbols_of(roles)
    usual_u = {symbol: u for symbol, u in Mechanism.USUAL_U.items() if symbol in having}
    none = {symbol: 0.0 for symbol in Mechanism.USUAL_U if symbol not in having}
    values = {key: float(value) for key, value in table.items() if key in having}
    u = {key.removeprefix("u_"): float(value) for key, value in table.items() if key not in (MODEL, *having)}
    usual = {symbol: usual for symbol, usual in usual_u.items() if symbol not in values and symbol not in u}
    unstated = {symbol for symbol in (*usual_u, "unread_force") if symbol not in values}
    unstated |= {f"u_{symbol}" for symbol in usual_u if symbol not in u}
    stated = MappingProxyType(usual | u)
    return model, model(**none, **values, u=stated, unstated=frozenset(unstated))


MODEL = "model"
"""Key of ``[mechanism]`` that says which model its values are of."""


def model_of(table: Mapping[str, Any]) -> type[Mechanism] | None:
    """Return the model that a table ``[mechanism]`` names, a gun if it names none; None if there is none such."""
    if MODEL not in table and any(map(_is_model, table)):
        return None
    return next((one for name, one in MECHANISMS.items() if name == table.get(MODEL, MechanismModel.GUN)), None)


def _forgotten_model(table: Mapping[str, Any], model: type[Mechanism] | None, roles: Collection[str]) -> list[Fault]:
    """Ask for `MODEL` where it is not named, the roles are those of a line, and no value is a gun's alone."""
    gun, line = MECHANISMS[MechanismModel.GUN], MECHANISMS[MechanismModel.LINE]
    of_line = sorted(set(roles) & set(gun.foreign_roles))
    of_gun = set(gun.symbols_of(roles)) - set(line.symbols_of(roles))
    if MODEL in table or model is not gun or not of_line or of_gun & set(table):
        return []
    problem = (
        f'is missing: write {MODEL} = "{MechanismModel.LINE}", as {", ".join(of_line)} are roles of a body on a line'
    )
    return [Fault((MECHANISM, MODEL), problem, FaultCode.MISSING)]


def _is_model(key: str) -> bool:
    """Return whether a key is `MODEL`, misspelt."""
    return key != MODEL and bool(get_close_matches(key.casefold(), [MODEL], 1, MISSPELT))


def _faults_of_model(
    table: Mapping[str, Any], model: type[Mechanism] | None, roles: Collection[str]
) -> Iterator[Fault]:
    """Name a model that is none, the values that the model lacks, and those that it must have."""
    if model is None and MODEL not in table:
        return  # it is misspelt
    if model is None:
        models = " or ".join(f'"{one}"' for one in MECHANISMS)
        yield Fault((MECHANISM, MODEL), f"must be {models}, found {table[MODEL]!r}", FaultCode.VALUE)
        return
    having = model.symbols_of(roles)
    for key in table:
        symbol = key.removeprefix("u_")
        if symbol in having or symbol not in Mechanism.symbols():
            continue
        problem = f"{model.words} has no {symbol}, {MEANINGS[symbol]}: leave it out"
        if symbol in Mechanism.OF_PRESSURE:
            problem = f"has no meaning without a channel of role {Mechanism.OF_PRESSURE[symbol]!r}: leave it out"
        yield Fault((MECHANISM, key), problem, FaultCode.CONTRADICTION)
    for symbol in model.required(roles):
        if symbol not in table:
            yield Fault((MECHANISM, symbol), f"is missing: {MEANINGS[symbol]}", FaultCode.MISSING)


def _muzzle_brake_without_exit(table: Mapping[str, Any]) -> list[Fault]:
    """Ask for what says when the projectile leaves, where a muzzle brake is declared."""
    declared_keys = [key for key in ("muzzle_brake", "u_muzzle_brake") if table.get(key)]
    return [
        Fault((MECHANISM, key), f"is missing: {MEANINGS[key]}", FaultCode.MISSING)
        for key in _OF_EXIT
        if declared_keys and not table.get(key)
    ]


def _unknown_symbol(key: str, symbols: Sequence[str]) -> Fault:
    """Name a key that is no symbol, with the one that it misspells, or those whose meaning has most of its words.

    Of several that have as many, those count in whose meanings a word stands at the front.
    """
    place, symbol = (MECHANISM, key), key.removeprefix("u_")
    if _is_model(key):
        return unknown_key(place, key, [MODEL])
    if symbol in symbols:
        problem = f"unknown key; {symbol} is itself a standard uncertainty: {MEANINGS[symbol]}"
        return Fault(place, problem, FaultCode.UNKNOWN, known=tuple(symbols))
    prefix = key[: len(key) - len(symbol)]
    words = set(symbol.casefold().split("_"))
    places = {}
    for one in symbols:
        meaning = re.findall(r"\w+", MEANINGS[one].casefold())
        if shared := words.intersection(meaning):
            places[one] = (-len(shared), min(map(meaning.index, shared)))
    misspelt = len(symbol) > 2 and get_close_matches(symbol.casefold(), map(str.casefold, symbols), 1, MISSPELT)
    if places and len(symbol) > 1 and not misspelt:
        most, front = min(places.values())
        meant = [one for one, (shared, at) in places.items() if shared == most and at <= front + 1]
        named = ", ".join(f"{prefix}{one} ({MEANINGS[one]})" for one in meant)
        keys = tuple(f"{prefix}{one}" for one in meant)
        return Fault(place, f"unknown key; did you mean {named}", FaultCode.UNKNOWN, known=tuple(symbols), meant=keys)
    return unknown_key(place, key, [prefix + one for one in symbols])


def problem_of_value(key: str, value: Any, is_uncertainty: bool) -> tuple[str, FaultCode] | None:
    """Return what is wrong with a value of ``[mechanism]`` and the code of that; None if nothing is."""
    try:
        number = math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        return f"must be a finite number, found {value!r}", _code_of_number(value)
    if is_uncertainty:
        negative = f"a standard uncertainty is not negative, found {value}"
        return (negative, FaultCode.RANGE) if number < 0 else None
    if key in ("bore_friction", "muzzle_brake", "unread_force") and not 0 <= number < 1:
        return f"must be a share of at least 0 and below 1, found {value}", FaultCode.RANGE
    if key == "unread_share" and not -1 < number < 1:
        return f"must be a share between -1 and 1, found {value}", FaultCode.RANGE
    if key in ("slide_friction", "carried_mass", *_OF_EXIT, "tube_axial_hz") and number < 0:
        return f"must not be negative, found {value}", FaultCode.RANGE
    if key in Mechanism.POSITIVE and number <= 0:
        return f"must be positive, found {value}", FaultCode.RANGE
    return None


def _code_of_number(value: Any) -> FaultCode:
    return FaultCode.RANGE if isinstance(value, int | float) and not isinstance(value, bool) else FaultCode.TYPE


def stated_values(table: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """Return the values of a table ``[mechanism]``, texts with a unit as numbers in SI; faults are appended."""
    values: dict[str, Any] = {}
    for key, value in table.items():
        try:
            unit = UNITS.get(key.removeprefix("u_"))
            values[key] = stated_number(value, unit, difference=key.startswith("u_"))
        except TypedError as error:
            faults.append(Fault((MECHANISM, key), f"{error}, found {value!r}", FaultCode.UNIT))
    return values
