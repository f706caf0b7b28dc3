"""What a file says of the axis of a waveform: whether it is time at all, and in which unit."""

from __future__ import annotations

from recoil_acquisition.readers.text.cells import split_unit
from recoil_acquisition.readers.time.time_units import time_unit_s

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
        Of the axis, with a unit or without; empty where the file names it not.
    unit
        Empty where the file states none: seconds then, if nothing else speaks against time.
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
