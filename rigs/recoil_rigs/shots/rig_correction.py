"""A corrected rig file against the one that a shot was recorded with: what it may say anew, and what that changes.

A certificate that comes after the day says what a sensor reads, how sure that is, and against what it was compared; a
scale or a tape measure says what the mechanism is. Nothing of that needs the recorded files again: the samples are a
line of the file's numbers, which is undone and drawn anew. What was recorded, by which sensor, where it sat and when
its samples were taken is no correction.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.errors import Fault, FaultCode, KeyPath, RigError, Row, spelled
from recoil_acquisition.readers.recording import SignalHeader
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.shots.assemble import si_line, unit_of
from recoil_rigs.tables.channel_table import Sensor

Table = TypeVar("Table", Source, ChannelSpec)

OF_A_CERTIFICATE = (
    "model", "certificate", "calibrated", "due", "u_rel", "U_rel", "k", "nu", "calibration", "reference",
    "u_reference_rel", "u_zero_rel", "u_distortion_m", "gain", "u_gain", "offset", "sensitivity", "sensitivity_unit",
    "zero", "amplifier", "time_constant_s", "u_time_constant_s",
)  # fmt: skip
"""Keys of a sensor that may be corrected: none tells one sensor from another or moves a sample in time."""
OF_A_CAMERA = ("scale_mm_per_px",)
"""Keys of a source that may be corrected."""
IF_STATED = ("u_rel", "delay_s")
"""Keys of a sensor of which leaving them out says something else than their default."""

INGEST_AGAIN = "ingest the recorded files again if it was wrong"
OTHER_SENSOR = "another number is another sensor, which did not record this shot; correct the number"


@dataclass(frozen=True)
class Correction:
    """One value that a corrected rig file says anew.

    Attributes
    ----------
    key
        Key path of the value, with the channel's or source's name.
    was, now
        Values as recorded and as corrected, JSON types; None where it was not stated.
    """

    key: str
    was: Any
    now: Any

    def __str__(self) -> str:
        return f"{self.key} {_shown(self.was)} -> {_shown(self.now)}"

    def to_json(self) -> dict[str, Any]:
        """Return it as the report has it."""
        return {"key": self.key, "was": self.was, "is": self.now}


def corrections(recorded: Rig, corrected: Rig) -> tuple[Correction, ...]:
    """List what a corrected rig file says anew.

    Parameters
    ----------
    recorded
        Rig as the shot file has it.

    Raises
    ------
    RigError
        With every difference that is no correction.
    """
    found: list[Correction] = []
    faults: list[Fault] = []
    for key in ("name", "reference_clock"):
        _compare((key,), getattr(recorded, key), getattr(corrected, key), faults)
    found += _of_mechanism(recorded, corrected)
    for old, new in _pairs("source", recorded.sources, corrected.sources, faults):
        found += _of_tables((Row("source", old.name),), old, new, OF_A_CAMERA, faults)
    for one, other in _pairs("channel", recorded.channels, corrected.channels, faults):
        where = (Row("channel", one.name),)
        found += _of_tables(where, one, other, (), faults, besides=("sensor",))
        sensor = (*where, "sensor")
        found += _of_tables(sensor, one.sensor, other.sensor, OF_A_CERTIFICATE, faults, besides=("range",))
        _compare_ranges((*sensor, "range"), one, other, faults)
    for name, text in recorded.databases.items():
        if corrected.databases.get(name, text) != text:
            problem = "is another text than the one that the frames of this shot were decoded by"
            problem += f"; put that one beside the rig file, or {INGEST_AGAIN}"
            faults.append(Fault((Row("database", name),), problem, FaultCode.CHANGED))
    if recorded.knowledge != corrected.knowledge:
        was, now = (one.knowledge.model_dump(mode="json") for one in (recorded, corrected))
        found.append(Correction("knowledge", was, now))
    if recorded.report != corrected.report:
        found.append(Correction("report", recorded.report.to_json(), corrected.report.to_json()))
    faults += [
        Fault((key,), "is not the table that the shot file has; put that one back", FaultCode.CHANGED)
        for key in ("trigger", "twin")
        if getattr(recorded, key) != getattr(corrected, key)
    ]
    if faults:
        raise RigError(corrected.path, faults)
    return tuple(found)


def corrected_channels(
    channels: Mapping[str, Channel], recorded: Rig, corrected: Rig, version: str
) -> dict[str, Channel]:
    """Return channels as they would have been assembled by a corrected rig.

    Parameters
    ----------
    channels
        Channels by name, as `recorded` has them.
    corrected
        Rig with corrections only.
    version
        Version of the package, for the channels' history.

    Raises
    ------
    RigError
        If the unit of a file's numbers is not known, so that its samples cannot be converted; with every such channel.
    """
    faults: list[Fault] = []
    found = {name: _corrected(channel, recorded, corrected, version, faults) for name, channel in channels.items()}
    if faults:
        raise RigError(corrected.path, faults)
    return found


def _corrected(channel: Channel, recorded: Rig, corrected: Rig, version: str, faults: list[Fault]) -> Channel:
    """Undo the line that the samples were made by and draw the new one; a fault is appended."""
    old, new = recorded.channel(channel.name), corrected.channel(channel.name)
    made = replace(channel, u_rel=new.u_scale_rel)
    if _entering(old, recorded) == _entering(new, corrected):
        return made
    before, after = (_line(channel, spec, rig, faults) for spec, rig in ((old, recorded), (new, corrected)))
    if before is None or after is None or before == after:
        return made
    factor = after[0] / before[0]
    offset = after[1] - factor * before[1]
    step = Step("correct calibration", version, {"factor": factor, "offset": offset, "rig": corrected.path.name})
    return replace(
        made,
        samples=factor * channel.samples + offset,
        resolution=abs(factor) * channel.resolution,
        history=(*channel.history, step),
    )


def _entering(spec: ChannelSpec, rig: Rig) -> tuple[object, ...]:
    """Return what enters the samples of a channel and may be corrected."""
    s = spec.sensor
    scale = rig.source(spec.source).scale_mm_per_px
    return s.gain, s.offset, s.sensitivity, s.sensitivity_unit, s.amplifier, scale


def _line(channel: Channel, spec: ChannelSpec, rig: Rig, faults: list[Fault]) -> tuple[float, float] | None:
    """Return the line from the file's numbers to SI; the channel's history has the unit that the file stated."""
    read = next((step for step in channel.history if step.what == "read"), None)
    if read is None or not isinstance(read.parameters.get("unit"), str):
        problem = "the shot file does not say in which unit it was read, so that its samples cannot be corrected"
        faults.append(Fault((Row("channel", channel.name),), f"{problem}; {INGEST_AGAIN}", FaultCode.UNIT))
        return None
    header = SignalHeader(spec.signal, read.parameters["unit"], channel.time_base.count)
    unit = unit_of(spec, header, rig.source(spec.source), rig.path, faults)
    return None if unit is None else si_line(spec, unit)


def _of_mechanism(recorded: Rig, corrected: Rig) -> Iterator[Correction]:
    """Compare all values of the mechanism and their standard uncertainties."""
    old, new = recorded.mechanism, corrected.mechanism
    for symbol in old.symbols():
        yield from _changed(("mechanism", symbol), getattr(old, symbol), getattr(new, symbol))
        yield from _changed(("mechanism", f"u_{symbol}"), old.u.get(symbol), new.u.get(symbol))


def _pairs(kind: str, old: Sequence[Table], new: Sequence[Table], faults: list[Fault]) -> Iterator[tuple[Table, Table]]:
    """Pair the tables of two rigs by their names, and name those that only one of them has."""
    names, others = [row.name for row in old], {row.name: row for row in new}
    lacking, more = [name for name in names if name not in others], [name for name in others if name not in names]
    gone = "is missing: this shot was recorded with it; put it back"
    faults += [Fault((Row(kind, name),), gone, FaultCode.MISSING) for name in lacking]
    foreign = f"did not record this shot; leave it out, or {INGEST_AGAIN}"
    faults += [Fault((Row(kind, name),), foreign, FaultCode.CHANGED) for name in more]
    same = [name for name in others if name in names]
    if same != [name for name in names if name in others]:
        # of several gauges the first speaks for the others
        problem = f"in another order: {', '.join(same)}; put them in that of the shot file"
        faults.append(Fault((kind,), problem, FaultCode.CHANGED))
    yield from ((row, others[row.name]) for row in old if row.name in others)


def _of_tables(
    where: KeyPath,
    old: Source | ChannelSpec | Sensor,
    new: Source | ChannelSpec | Sensor,
    correctable: Sequence[str],
    faults: list[Fault],
    besides: Sequence[str] = (),
) -> Iterator[Correction]:
    """Compare two tables key by key: yield what is a correction, append what is none to the faults."""
    for key in type(old).model_fields:
        if key in besides:
            continue
        was, now = _stated(old, key), _stated(new, key)
        if key in correctable:
            yield from _changed((*where, key), was, now)
        else:
            _compare((*where, key), was, now, faults)


def _compare_ranges(key: KeyPath, old: ChannelSpec, new: ChannelSpec, faults: list[Fault]) -> None:
    """Compare ranges as they were and are before any calibration: a sensitivity may bring another unit of theirs."""
    was, now = (
        None if one.sensor.range is None else [one.own_unit.to_si(x) if one.own_unit else x for x in one.sensor.range]
        for one in (old, new)
    )
    if was == now:
        return
    if old.sensor.range == new.sensor.range:
        _compare(key, was, now, faults)  # the same numbers in another unit: both are stated in SI
    else:
        _compare(key, old.sensor.range, new.sensor.range, faults)


def _stated(table: Source | ChannelSpec | Sensor, key: str) -> Any:
    return None if key in IF_STATED and key not in table.model_fields_set else getattr(table, key)


def _changed(key: KeyPath, was: Any, now: Any) -> Iterator[Correction]:
    was, now = _plain(was), _plain(now)
    if was != now:
        yield Correction(spelled(key), was, now)


def _compare(key: KeyPath, was: Any, now: Any, faults: list[Fault]) -> None:
    """Append a fault if a value that was recorded with is another one."""
    was, now = _plain(was), _plain(now)
    if was != now:
        remedy = OTHER_SENSOR if key[-1] == "serial" else f"put it back, or {INGEST_AGAIN}"
        problem = f"was {_shown(was)} when this shot was recorded, is {_shown(now)}; {remedy}"
        faults.append(Fault(key, problem, FaultCode.CHANGED))


def _plain(value: Any) -> Any:
    """Reduce a value of a rig to JSON types; a number that was not declared is None."""
    if hasattr(value, "model_dump"):
        value = value.model_dump()
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, dt.date):
        return value.isoformat()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def _shown(value: Any) -> str:
    if value is None or value == "":
        return "not stated"
    return f"{value:.12g}" if isinstance(value, float) else str(value)
