"""The axis of a waveform as a file states it: whether it is time at all, in which unit, and at which step or rate.

Names are compared without case and without signs, so that ``Sample rate``, ``sample_rate`` and ``SampleRate`` are one.
A unit may stand behind a name (``fs_kHz``, ``Time [ms]``), behind a number (``20 kHz``) or in a text of its own beside
it (``sample_rate_unit``); what stands in several places must be the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from recoil_acquisition.readers.statements import folded
from recoil_acquisition.readers.text.cells import split_unit
from recoil_acquisition.readers.time.time_units import rate_unit_hz, time_unit_s

RATES = frozenset({"samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "fs", "rate"})
STEPS = frozenset(
    {"dt", "deltat", "sampleinterval", "samplinginterval", "timestep", "samplingperiod", "sampleperiod", "wfincrement"}
    | {"xincrement"}
)
OFFSETS = frozenset({"startoffset", "wfstartoffset", "timeoffset", "t0", "x0"})
TIME_NAMES = frozenset({"time", "times", "t", "timestamp", "timestamps", "zeit", "tid", "temps", "timevector"})
"""Names of vectors of times."""
_UNIT_NAMES = ("unit", "units", "unitstring")
_X_UNITS = frozenset({"wfxunitstring", "wfxunit", "xunit", "xunits", "xunitstring", "timeunit", "timeunits"})
"""Names of texts that are the unit of every step and offset."""
_APART = ("h", "hr", "d", "min", "day", "days")
_NUMBER_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)

_TIME = frozenset(
    {"", "t", "time", "times", "timestamp", "timestamps", "time axis", "time channel", "zeit", "zeitachse", "zeitkanal"}
    | {"temps", "tiempo", "tempo", "tijd", "tid", "x", "x-axis", "x axis"}
)
_OTHERS = frozenset(
    {"frequency", "freq", "frequenz", "fréquence", "frequence", "f", "order", "orders", "ordnung", "angle", "winkel"}
    | {"crank angle", "kurbelwinkel", "rotation", "revolution", "revolutions", "umdrehung", "rpm", "speed", "drehzahl"}
    | {"distance", "position", "displacement", "weg", "strecke", "length", "depth", "index", "sample", "sample index"}
    | {"cycle", "cycles", "amplitude", "temperature", "temperatur", "force", "kraft"}
)


def axis_unit_s(name: str, unit: str) -> float | str:
    """Return the seconds of a unit of an axis, or why the axis is no time.

    Parameters
    ----------
    name
        Name of the axis, with a unit or without; empty where the file names it not.
    unit
        Unit of the axis; empty where the file states none: seconds then, if nothing else speaks against time.
    """
    plain, bracketed = split_unit(name)
    spelled = unit.strip() or bracketed
    if plain.casefold() in _OTHERS:
        return f"its axis is {name.strip()!r}{f' in {spelled!r}' if spelled else ''}, not time"
    if not spelled:
        is_time = plain.casefold() in _TIME
        return 1.0 if is_time else f"its axis is {name.strip()!r}, without a unit of time"
    unit_s = time_unit_s(spelled)
    if unit_s is None:
        return f"its axis is in {spelled!r}, which is no unit of time that is known"
    if bracketed and time_unit_s(bracketed) not in (None, unit_s):
        return f"its axis {name.strip()!r} contradicts its unit {spelled!r}"
    return unit_s


@dataclass(frozen=True)
class Stated:
    """A number that a file states: the name it has there, and its value in s or Hz."""

    name: str
    value: float


def unit_in_time_name(name: str) -> str | None:
    """Return the unit that stands behind the name of a vector of times, empty if none does; None if it is no time."""
    plain, unit = split_unit(name)
    if folded(plain) in TIME_NAMES:
        return unit
    stem, _, ending = plain.rpartition("_")
    if not unit and folded(stem) in TIME_NAMES and time_unit_s(ending) is not None:
        return ending
    for ending in ("ms", "us", "ns", "s"):
        if not unit and folded(plain).removesuffix(ending) in TIME_NAMES:
            return ending
    return None


def stated_rate(properties: Mapping[str, Any]) -> Stated | str | None:
    """Return the sample rate that properties state, Hz; why it cannot be taken; None if none is."""
    return _stated(properties, RATES, rate_unit_hz, "a rate", frozenset())


def stated_step(properties: Mapping[str, Any], names: frozenset[str] = STEPS) -> Stated | str | None:
    """Return the step in time, or with `OFFSETS` the offset, s; why it cannot be taken; None if none is stated."""
    return _stated(properties, names, time_unit_s, "time", _X_UNITS)


def _stated(
    properties: Mapping[str, Any],
    names: frozenset[str],
    unit_of: Callable[[str], float | None],
    quantity: str,
    common: frozenset[str],
) -> Stated | str | None:
    for name, value in properties.items():
        unit_behind = _unit_behind(name, names, unit_of)
        number = None if unit_behind is None else _number_of(value)
        if unit_behind is None or number is None:
            continue
        wanted = {folded(name) + ending for ending in _UNIT_NAMES} | common
        beside = [text for other, text in properties.items() if folded(other) in wanted and isinstance(text, str)]
        factor = one_unit(f"its {name}", (unit_behind, number[1], *beside), unit_of, quantity)
        return factor if isinstance(factor, str) else Stated(name, number[0] * (factor or 1.0))
    return None


def one_unit(
    what: str, stated: Iterable[str], unit_of: Callable[[str], float | None] = time_unit_s, quantity: str = "time"
) -> float | str | None:
    """Return the one unit that is stated of something, perhaps in several places, or why it cannot be taken.

    Returns
    -------
    float, str or None
        Seconds, or Hz, of the unit; or why not: one is none of the quantity, or they differ; None if there is none.
    """
    units = {unit.strip(): unit_of(unit.strip()) for unit in stated if unit.strip()}
    unknown = next((unit for unit, factor in units.items() if factor is None), None)
    if unknown is not None:
        return f"{what} is in {unknown!r}, which is no unit of {quantity} that is known"
    if len(set(units.values())) > 1:
        return f"{what} states its unit as {' and as '.join(map(repr, units))}"
    return next(iter(units.values()), None)


def _unit_behind(name: str, names: frozenset[str], unit_of: Callable[[str], float | None]) -> str | None:
    """Return the unit behind one of some names, empty if none is; None if the name is none of them."""
    plain, unit = split_unit(name)
    short = folded(plain)
    if short in names:
        return unit
    for size in range(1, min(len(short), 6)):
        stem, ending = plain[:-size], plain[-size:]
        if folded(stem) in names and ending.isalnum() and unit_of(ending) is not None:
            # of letters that touch the name, `dth` say, only the usual ones are a unit
            return ending if not stem[-1:].isalnum() or ending.casefold() not in _APART else None
    return None


def _number_of(value: Any) -> tuple[float, str] | None:
    """Return a finite number and the unit behind it; None where the value is none."""
    if isinstance(value, str):
        match = _NUMBER_UNIT.fullmatch(value)
        return None if match is None else (float(match[1]), match[2])
    if isinstance(value, (bool, list)):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return (number, "") if isfinite(number) else None
