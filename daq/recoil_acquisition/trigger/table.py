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
    level = "30 g"              # with its unit; a bare number is SI, as the channel itself
    rearm = 150.0               # the level itself if omitted
    slope = "rising"            # rising (if omitted) | falling

A ``window`` has ``low``, ``high``, ``on = "enter" | "leave"`` and ``hysteresis``; a ``slope`` has the keys of an
edge, in units per second or such as ``"2 MPa/ms"``, and ``over_s``; a ``width`` has those of an edge and
``longer_than_s``, ``shorter_than_s`` or both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import Field

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, did_you_mean, nearest_first
from recoil_acquisition.quantities.declaration import DeclaredTable, Finite, NotNegative, Positive, Text, declared
from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, find_rate_unit, find_unit
from recoil_acquisition.quantities.typed_quantity import number_and_unit
from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window
from recoil_acquisition.trigger.detector import Trigger


class _EdgeTable(DeclaredTable):
    channel: Text = Field(description="the name of a channel")
    kind: str = "edge"
    """Kind of the condition: ``edge``, ``window``, ``slope`` (a rate of change) or ``width`` (of a pulse)."""
    level: Finite = Field(description="a finite number, the level in the channel's SI unit")
    rearm: Finite | None = None
    """Level beyond which, on the other side, the signal must have been before; the level itself if left out."""
    slope: Literal["rising", "falling"] = "rising"
    """Side from which the level is reached: ``rising`` from below, ``falling`` from above."""


class _WindowTable(DeclaredTable):
    channel: Text = Field(description="the name of a channel")
    kind: str
    """Kind of the condition: ``window``."""
    low: Finite = Field(description="a finite number, the lower border in the channel's SI unit")
    high: Finite = Field(description="a finite number, the upper border in the channel's SI unit")
    on: Literal["enter", "leave"] = "enter"
    """Whether the signal triggers where it comes in or where it goes out."""
    hysteresis: Finite = 0.0
    """Distance beyond a border, on the other side, at which the signal must have been before."""


class _RateTable(_EdgeTable):
    over_s: Finite = 0.0
    """Time over which the rate is taken, s; from sample to sample if left out."""


class _WidthTable(_EdgeTable):
    longer_than_s: Finite | None = None
    """Time that the pulse must last, s."""
    shorter_than_s: Finite | None = None
    """Time that the pulse must not last, s."""


class _TriggerTable(DeclaredTable):
    pre_s: NotNegative = Field(description="a time that is kept before the trigger, seconds")
    post_s: Positive = Field(description="a time that is kept behind the trigger, seconds")
    holdoff_s: NotNegative = 0.0
    """Time after a trigger in which no other counts, s."""
    extend: bool = False
    """Whether a further trigger within the post time lets it start anew."""
    manual: bool = True
    """Whether a trigger by hand counts."""
    any: Annotated[list[dict[str, Any]], Field(min_length=1)] | None = None
    """Conditions of which each that becomes met triggers, ``[[trigger.any]]``."""
    all: Annotated[list[dict[str, Any]], Field(min_length=1)] | None = None
    """Conditions that must all be met, ``[[trigger.all]]``, in place of ``any``."""


_KINDS: Mapping[str, tuple[type[DeclaredTable], type[Condition]]] = {
    "edge": (_EdgeTable, Edge),
    "window": (_WindowTable, Window),
    "slope": (_RateTable, RateOfChange),
    "width": (_WidthTable, PulseWidth),
}


LEVELS = ("level", "rearm", "low", "high", "hysteresis")
"""Keys of a condition that may be a text with a unit."""


def declared_trigger(table: Any, channels: Mapping[str, str], faults: list[Fault]) -> Trigger | None:
    """Make the trigger that a rig file declares.

    Parameters
    ----------
    table
        Table ``[trigger]`` as read.
    channels
        Names of the rig's channels with their quantities, empty where one is not known: levels are in units of them.
    faults
        List that every fault found is appended to.

    Returns
    -------
    Trigger or None
        None if the table has a fault.
    """
    own: list[Fault] = []
    sound = declared(_TriggerTable, table, ("trigger",), own)
    stated = table if isinstance(table, Mapping) else {}
    rows = {key: stated[key] for key in ("any", "all") if isinstance(stated.get(key), list | tuple)}
    if len(rows) > 1:
        own.append(Fault(("trigger",), "has both `any` and `all`; keep one", FaultCode.CONTRADICTION))
    made = [
        _condition(row, ("trigger", key, i), channels, own)
        for key, given in rows.items()
        for i, row in enumerate(given)
        if isinstance(row, Mapping)
    ]
    faults += own
    if own or sound is None:
        return None
    try:
        options = sound.model_dump(exclude={"any", "all"})
        conditions = tuple(condition for condition in made if condition is not None)
        return Trigger(conditions, "all" if "all" in rows else "any", **options)
    except ValueError as error:
        faults.append(Fault(("trigger",), str(error), FaultCode.CONTRADICTION))
        return None


def _condition(
    row: Mapping[str, Any], where: KeyPath, channels: Mapping[str, str], faults: list[Fault]
) -> Condition | None:
    kind = row.get("kind", "edge")
    if not isinstance(kind, str) or kind not in _KINDS:
        problem = f"must be one of {', '.join(_KINDS)}, found {kind!r}"
        faults.append(Fault((*where, "kind"), problem, FaultCode.VALUE))
        return None
    model, made = _KINDS[kind]
    channel = row.get("channel")
    quantity = channels.get(str(channel), "")
    own: list[Fault] = []
    wrong_levels: list[Fault] = []
    sound = declared(model, _in_si(row, kind, quantity, where, wrong_levels), where, own)
    about = channel if isinstance(channel, str) and channel in channels else None
    faults += [replace(fault, about=about) for fault in (*own, *wrong_levels)]
    if isinstance(channel, str) and channel not in channels:
        problem = f"no channel {channel!r}; {did_you_mean(channel, tuple(channels))}"
        faults.append(Fault((*where, "channel"), problem, FaultCode.UNKNOWN, undeclared=channel))
    if sound is not None and not wrong_levels:
        try:
            return made(**sound.model_dump(exclude={"kind"}))
        except ValueError as error:
            faults.append(Fault(where, str(error), FaultCode.CONTRADICTION, about))
    return None


def _in_si(row: Mapping[str, Any], kind: str, quantity: str, where: KeyPath, faults: list[Fault]) -> dict[str, Any]:
    """Return a condition's table with its levels in SI; one whose unit is at fault is told, and stands at 0."""
    table = dict(row)
    for key in (key for key in LEVELS if isinstance(row.get(key), str)):
        try:
            table[key] = _level(row[key], kind, quantity, is_difference=key == "hysteresis")
        except ValueError as error:
            faults.append(Fault((*where, key), f"{error}, found {row[key]!r}", FaultCode.UNIT))
            table[key] = 0.0
    return table


def _level(text: str, kind: str, quantity: str, *, is_difference: bool) -> float:
    """Return a level in SI; ValueError says what is wrong with it."""
    number, spelling = number_and_unit(text)
    if not spelling:
        raise ValueError("has no unit: write one behind the number, or the number in SI without quotes")
    if kind == "slope":
        rates = (find_rate_unit(spelling, one) for one in ([quantity] if quantity else SI_UNITS))
        unit = next((rate for rate in rates if rate is not None), None)
    else:
        unit = find_unit(spelling)
    if unit is not None and (kind == "slope" or not quantity or quantity in unit.quantities):
        return unit.factor * number if is_difference else unit.to_si(number)
    per = " per time" if kind == "slope" else ""
    known = [name for name, one in UNITS.items() if not quantity or quantity in one.quantities]
    nearest = ", ".join(name + ("/s" if per else "") for name in nearest_first(spelling, known)[:3])
    what = f"{spelling!r} is no unit of {quantity}{per}" if quantity else f"{spelling!r} is no known unit"
    raise ValueError(f"{what}; nearest: {nearest}")
