"""The table ``[trigger]`` of a rig file; every fault is reported at once.

::

    [trigger]
    pre_s = 0.5                 # required
    post_s = 2.0                # required
    holdoff_s = 5.0             # 0 if omitted
    extend = true               # false if omitted
    manual = true               # true if omitted

    [[trigger.any]]             # or [[trigger.all]], not both; neither if there are manual triggers only
    channel = "acc_recoil"
    kind = "edge"               # edge | window | slope | width
    level = 300.0               # SI, as the channel itself
    rearm = 150.0               # the level itself if omitted
    slope = "rising"            # rising (if omitted) | falling

A ``window`` has ``low``, ``high``, ``on = "enter" | "leave"`` and ``hysteresis``; a ``slope`` has the keys of an
edge, in units per second, and ``over_s``; a ``width`` has those of an edge and ``longer_than_s``, ``shorter_than_s``
or both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import Fault, RigError, nearest_first
from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window
from recoil_acquisition.trigger.detector import Trigger

_KINDS: Mapping[str, type[Condition]] = {"edge": Edge, "window": Window, "slope": RateOfChange, "width": PulseWidth}

_LEVELS = {"level": True, "rearm": False, "slope": False}
_KEYS: Mapping[str, Mapping[str, bool]] = {
    "edge": _LEVELS,
    "window": {"low": True, "high": True, "on": False, "hysteresis": False},
    "slope": {**_LEVELS, "over_s": False},
    "width": {**_LEVELS, "longer_than_s": False, "shorter_than_s": False},
}
"""Keys of each kind beside channel and kind, and whether they are required."""

_CHOICES = {"slope": ("rising", "falling"), "on": ("enter", "leave")}
_TIMES = {"pre_s": True, "post_s": True, "holdoff_s": False}
_FLAGS = ("extend", "manual")
_COMBINATIONS = ("any", "all")


def trigger_from_table(table: Mapping[str, Any], channel_names: Sequence[str], path: Path | str) -> Trigger:
    """Make the trigger that a rig file declares.

    Parameters
    ----------
    table : mapping
        ``[trigger]`` as read.
    channel_names : sequence of str
        The rig's channels.
    path : Path or str
        The rig file.

    Returns
    -------
    Trigger

    Raises
    ------
    RigError
        With every fault of the table.
    """
    trigger, faults = _parse(table, channel_names)
    if trigger is None:
        raise RigError(path, faults)
    return trigger


def trigger_faults(table: Mapping[str, Any], channel_names: Sequence[str]) -> tuple[Fault, ...]:
    """Return every fault of a table ``[trigger]``; the rig's channels are `channel_names`."""
    return tuple(_parse(table, channel_names)[1])


def _parse(table: Mapping[str, Any], channel_names: Sequence[str]) -> tuple[Trigger | None, list[Fault]]:
    faults: list[Fault] = []
    _check_keys(table, (*_TIMES, *_FLAGS, *_COMBINATIONS), "trigger", faults)
    options: dict[str, Any] = _numbers(table, _TIMES, "trigger", faults)
    for key in _FLAGS:
        if key in table:
            options[key] = table[key]
            if not isinstance(table[key], bool):
                faults.append(Fault(f"trigger.{key}", f"must be true or false, found {table[key]!r}"))
    given = [key for key in _COMBINATIONS if key in table]
    if len(given) > 1:
        faults.append(Fault("trigger", "has both `any` and `all`; keep one"))
    conditions = [
        condition for key in given for condition in _conditions(table[key], f"trigger.{key}", channel_names, faults)
    ]
    if faults:
        return None, faults
    try:
        return Trigger(tuple(conditions), "all" if "all" in given else "any", **options), faults
    except ValueError as error:
        return None, [Fault("trigger", str(error))]


def _conditions(rows: Any, where: str, channel_names: Sequence[str], faults: list[Fault]) -> list[Condition]:
    if not isinstance(rows, list | tuple) or not rows or not all(isinstance(row, Mapping) for row in rows):
        faults.append(Fault(where, f"must be a list of at least one table, found {rows!r}"))
        return []
    made = [_condition(row, f"{where}[{i}]", channel_names, faults) for i, row in enumerate(rows)]
    return [condition for condition in made if condition is not None]


def _condition(
    row: Mapping[str, Any], where: str, channel_names: Sequence[str], faults: list[Fault]
) -> Condition | None:
    before = len(faults)
    channel, kind = row.get("channel"), row.get("kind", "edge")
    if not isinstance(channel, str):
        faults.append(Fault(f"{where}.channel", _missing_or(channel, "must be a channel's name")))
    elif channel not in channel_names:
        near = ", ".join(repr(name) for name in nearest_first(channel, channel_names)[:4]) or "none"
        faults.append(Fault(f"{where}.channel", f"no channel {channel!r} in this rig; there are {near}"))
    if not isinstance(kind, str) or kind not in _KINDS:
        faults.append(Fault(f"{where}.kind", f"must be one of {', '.join(_KINDS)}, found {kind!r}"))
        return None
    _check_keys(row, ("channel", "kind", *_KEYS[kind]), where, faults)
    options: dict[str, Any] = {}
    for key in (key for key in _KEYS[kind] if key in _CHOICES and key in row):
        options[key] = row[key]
        if row[key] not in _CHOICES[key]:
            faults.append(Fault(f"{where}.{key}", f"must be {' or '.join(_CHOICES[key])}, found {row[key]!r}"))
    numbers = {key: required for key, required in _KEYS[kind].items() if key not in _CHOICES}
    options |= _numbers(row, numbers, where, faults)
    if len(faults) > before:
        return None
    try:
        return _KINDS[kind](channel=str(channel), **options)
    except ValueError as error:
        faults.append(Fault(where, str(error)))
        return None


def _numbers(table: Mapping[str, Any], keys: Mapping[str, bool], where: str, faults: list[Fault]) -> dict[str, float]:
    numbers = {}
    for key, required in keys.items():
        value = table.get(key)
        if (number := _finite(value)) is not None:
            numbers[key] = number
        elif required or key in table:
            faults.append(Fault(f"{where}.{key}", _missing_or(value, "must be a finite number")))
    return numbers


def _finite(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


def _missing_or(value: Any, problem: str) -> str:
    return "is missing" if value is None else f"{problem}, found {value!r}"


def _check_keys(table: Mapping[str, Any], known: Sequence[str], where: str, faults: list[Fault]) -> None:
    faults += [
        Fault(f"{where}.{key}", f"unknown key; did you mean `{nearest_first(str(key), known)[0]}`?")
        for key in table
        if key not in known
    ]
