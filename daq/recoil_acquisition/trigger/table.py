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

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from recoil_acquisition.declaration import DeclaredTable, Finite, NotNegative, Positive, Text, declared
from recoil_acquisition.errors import Fault, RigError, did_you_mean
from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window
from recoil_acquisition.trigger.detector import Trigger


class _EdgeTable(DeclaredTable):
    channel: Text = Field(description="the name of a channel")
    kind: str = "edge"
    level: Finite = Field(description="a finite number, the level in the channel's SI unit")
    rearm: Finite | None = None
    slope: Literal["rising", "falling"] = "rising"


class _WindowTable(DeclaredTable):
    channel: Text = Field(description="the name of a channel")
    kind: str
    low: Finite = Field(description="a finite number, the lower border in the channel's SI unit")
    high: Finite = Field(description="a finite number, the upper border in the channel's SI unit")
    on: Literal["enter", "leave"] = "enter"
    hysteresis: Finite = 0.0


class _RateTable(_EdgeTable):
    over_s: Finite = 0.0


class _WidthTable(_EdgeTable):
    longer_than_s: Finite | None = None
    shorter_than_s: Finite | None = None


class _TriggerTable(DeclaredTable):
    pre_s: NotNegative = Field(description="a time that is kept before the trigger, seconds")
    post_s: Positive = Field(description="a time that is kept behind the trigger, seconds")
    holdoff_s: NotNegative = 0.0
    extend: bool = False
    manual: bool = True
    any: Annotated[list[dict[str, Any]], Field(min_length=1)] | None = None
    all: Annotated[list[dict[str, Any]], Field(min_length=1)] | None = None


_KINDS: Mapping[str, tuple[type[DeclaredTable], type[Condition]]] = {
    "edge": (_EdgeTable, Edge),
    "window": (_WindowTable, Window),
    "slope": (_RateTable, RateOfChange),
    "width": (_WidthTable, PulseWidth),
}


def trigger_from_table(table: Mapping[str, Any], channel_names: Sequence[str], path: Path | str) -> Trigger:
    """Make the trigger that a rig file declares.

    Parameters
    ----------
    table
        ``[trigger]`` as read.
    channel_names
        The rig's channels.
    path
        The rig file.

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
    sound = declared(_TriggerTable, dict(table), "trigger", faults)
    rows = {key: table[key] for key in ("any", "all") if isinstance(table.get(key), list | tuple)}
    if len(rows) > 1:
        faults.append(Fault("trigger", "has both `any` and `all`; keep one"))
    made = [
        _condition(row, f"trigger.{key}[{i}]", channel_names, faults)
        for key, given in rows.items()
        for i, row in enumerate(given)
        if isinstance(row, Mapping)
    ]
    conditions = tuple(condition for condition in made if condition is not None)
    if faults or sound is None:
        return None, faults
    try:
        options = sound.model_dump(exclude={"any", "all"})
        return Trigger(conditions, "all" if "all" in rows else "any", **options), faults
    except ValueError as error:
        return None, [Fault("trigger", str(error))]


def _condition(
    row: Mapping[str, Any], where: str, channel_names: Sequence[str], faults: list[Fault]
) -> Condition | None:
    kind = row.get("kind", "edge")
    if not isinstance(kind, str) or kind not in _KINDS:
        faults.append(Fault(f"{where}.kind", f"must be one of {', '.join(_KINDS)}, found {kind!r}"))
        return None
    model, made = _KINDS[kind]
    sound = declared(model, dict(row), where, faults)
    channel = row.get("channel")
    if isinstance(channel, str) and channel not in channel_names:
        faults.append(Fault(f"{where}.channel", f"no channel {channel!r}; {did_you_mean(channel, channel_names)}"))
    if sound is not None:
        try:
            return made(**sound.model_dump(exclude={"kind"}))
        except ValueError as error:
            faults.append(Fault(where, str(error)))
    return None
