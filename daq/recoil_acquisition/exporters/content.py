"""Content of an export: a shot's channels by time base, and what is said about them.

Every source keeps its own clock unless the export is asked to be aligned; then instants are mapped to the
reference clock by the shot's alignment, and nothing else. Samples are resampled only where one grid is asked for.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.clocks.one_grid import OnGrid, grid, read_on_grid
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import StoreError, nearest_first
from recoil_acquisition.files.bounded_toml import parse_toml
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store.channel_layout import by_time_base
from recoil_acquisition.store.table import finite, json_text, tree_names

SCHEMA = "recoil-daq/export/1"


@dataclass(frozen=True, eq=False)
class TimeBaseGroup:
    """The channels of one time base.

    Attributes
    ----------
    name
        Name of letters, digits and underscores: the source, and a number where it has several time bases.
    clock
        The source's own clock, also where `time_base` is on the reference clock.
    time_base
        Time base as exported.
    """

    name: str
    clock: str
    time_base: TimeBase
    channels: tuple[Channel, ...]


@dataclass(frozen=True, eq=False)
class Content:
    """Content of one or several files of an export.

    Attributes
    ----------
    document
        Statements about the shot, JSON types with finite numbers only.
    sensors
        Declarations of the rig about the sensors, by channel.
    start
        Instant of the zero of the reference clock.
    notes
        Sentences that a user must know about the export as a whole.
    """

    document: Mapping[str, Any]
    groups: tuple[TimeBaseGroup, ...]
    sensors: Mapping[str, Any]
    start: AbsoluteStart | None
    notes: tuple[str, ...]

    def only(self, groups: Sequence[TimeBaseGroup]) -> Content:
        """Return the same with some of the groups alone."""
        return replace(self, groups=tuple(groups))

    def on_one_grid(self, rate_hz: float, version: str) -> tuple[Content, tuple[str, ...]]:
        """Return the same with every channel on one even grid of the reference clock, and say what that took off each.

        Parameters
        ----------
        rate_hz
            Rate of the grid, one of whose instants is the zero of the reference clock or would be.
        version
            Version of the program, for the history.

        Raises
        ------
        ValueError
            If the content is not aligned, the rate is no positive number, or the grid would have too many instants.
        """
        if not self.document["aligned"]:
            raise ValueError("channels on different clocks have no grid in common")
        bases = [group.time_base for group in self.groups if group.time_base.count]
        spans = [(float(base.times_s[0]), float(base.times_s[-1])) for base in bases]
        start_s, count = grid(spans, rate_hz) if spans else (0.0, 0)
        clock = str(self.document["reference_clock"])
        base = TimeBase.uniform(clock, start_s, 1.0 / rate_hz, count, self.start)
        channels, losses = [], []
        for own in self.groups:
            for channel in own.channels:
                found = read_on_grid(own.time_base.times_s, channel.measured, base.times_s, rate_hz)
                step = Step("one grid", version, {"rate_hz": rate_hz, "passed_hz": found.passed_hz})
                history = (*channel.history, step)
                channels.append(replace(channel, samples=found.samples, time_base=base, raw=None, history=history))
                losses.append(_taken_off(channel, own.time_base, found))
        told = {**self.document, "one_grid_hz": rate_hz}
        group = TimeBaseGroup("one_grid", clock, base, tuple(channels))
        return replace(self, document=told, groups=(group,)), tuple(losses)

    def group_document(self, group: TimeBaseGroup) -> dict[str, Any]:
        """Say what a file of one time base says: shot, clock, time, channels; JSON types, finite numbers."""
        base = group.time_base
        return {
            **self.document,
            "clock": group.clock,
            "time": {"start_s": base.start_s, "step_s": base.step_s, "count": base.count},
            "absolute_start": start_document(base.absolute_start),
            "channels": [self.channel_document(channel) for channel in group.channels],
        }

    def channel_document(self, channel: Channel) -> dict[str, Any]:
        """Say what is known about a channel beside its samples."""
        document: dict[str, Any] = _plain(
            {
                "name": channel.name,
                "unit": channel.unit,
                "quantity": channel.quantity,
                "role": channel.role,
                "signal": channel.signal,
                "u_rel": channel.u_rel,
                "resolution": channel.resolution,
                "dtype": str(channel.samples.dtype),
                "lost": int(channel.lost.sum()),
                "sensor": self.sensors.get(channel.name),
                "history": [
                    {"what": step.what, "version": step.version, "parameters": step.parameters}
                    for step in channel.history
                ],
            }
        )
        return document


def _taken_off(channel: Channel, base: TimeBase, found: OnGrid) -> str:
    """Say what a grid took off a channel, or that it adds nothing."""
    name, unit = channel.name, channel.unit
    if found.passed_hz is None:
        return f"{name}: read between its own samples, {base.rate_hz:.4g} a second: the grid adds nothing to it"
    return (
        f"{name}: what is above {found.passed_hz:.4g} Hz was taken out, {found.taken_out:.3g} {unit} root mean square; "
        f"its largest is {found.largest:.4g} {unit}, {found.largest_before:.4g} {unit} as recorded"
    )


def start_document(start: AbsoluteStart | None) -> dict[str, str] | None:
    """Say when a clock's zero was; None if no source states it."""
    return None if start is None else {"text": start.text, "zone": start.zone, "origin": start.origin}


def _plain(value: Any) -> Any:
    """Return JSON types in which a number that is not finite is None."""
    return finite(json.loads(json_text(value)))


def gather(shot: Shot, provenance: Mapping[str, Any], names: Sequence[str] = (), *, aligned: bool = False) -> Content:
    """Choose channels of a shot and group them by time base.

    Parameters
    ----------
    provenance
        Origin of the shot: where it was read from, JSON types.
    names
        Channels to export; all if empty.
    aligned
        Map all instants to the reference clock.

    Raises
    ------
    StoreError
        If the shot has no such channel, or no usable alignment of a clock that is to be mapped.
    """
    for name in names:
        if name not in shot.channels:
            near = ", ".join(nearest_first(name, list(shot.channels))[:8])
            raise StoreError(f"no channel {name!r} in this shot", found=near or "none", remedy="correct --channel")
    chosen = [c for c in shot.channels.values() if not names or c.name in names]
    if not chosen:
        raise StoreError("this shot has no channels", remedy="ingest it again")
    notes = []
    if counted := [c.name for c in chosen if c.raw is not None]:
        notes.append(f"raw counts stay in the shot file; scaled SI values are exported of {', '.join(counted)}")
    notes.append("the rig file, CAN databases and the record of the acquisition stay in the shot file")
    if previews := _previews(shot):
        notes.append(f"what was read live of {', '.join(previews)} is a preview: the instrument's own file replaces it")
    groups = _grouped(chosen)
    clocks = list(dict.fromkeys(group.clock for group in groups))
    if aligned:
        groups = tuple(replace(group, time_base=_mapped(shot, group.time_base)) for group in groups)
        notes += [_mapping_note(shot, clock) for clock in clocks if clock != shot.reference_clock]
    elif len(clocks) > 1:
        notes.append(f"{len(clocks)} clocks, each with its own zero: {', '.join(clocks)}; --aligned maps them to one")
    return Content(_document(shot, provenance, aligned), groups, _sensors(shot.rig_text), _start(shot), tuple(notes))


def _grouped(channels: Iterable[Channel]) -> tuple[TimeBaseGroup, ...]:
    bases = by_time_base(channels)
    names = tree_names((base.clock for base, _ in bases), ())
    return tuple(
        TimeBaseGroup(name, base.clock, base, tuple(channel for _, channel in members))
        for name, (base, members) in zip(names, bases, strict=True)
    )


def _mapped(shot: Shot, base: TimeBase) -> TimeBase:
    """Map a time base to the reference clock; even spacing stays even spacing."""
    if base.clock == shot.reference_clock:
        return base
    try:
        alignment = shot.alignment(base.clock)
    except KeyError as error:
        raise StoreError(
            f"the shot does not say how the clock {base.clock!r} maps to {shot.reference_clock!r}",
            remedy="export without --aligned, or leave its channels out with --channel",
        ) from error
    if alignment.status == "failed":
        raise StoreError(
            f"the clock {base.clock!r} was not aligned: {'; '.join(alignment.reasons)}",
            remedy="export without --aligned, or leave its channels out with --channel",
        )
    start = _start(shot)
    try:
        if base.stamps_s is not None:
            return TimeBase.stamped(shot.reference_clock, alignment.to_reference(base.stamps_s), start)
        return TimeBase.uniform(
            shot.reference_clock,
            alignment.to_reference(base.start_s),
            (1.0 + alignment.drift) * float(base.step_s or 0.0),
            base.count,
            start,
        )
    except ValueError as error:
        raise StoreError(
            f"the clock {base.clock!r} cannot be mapped: {error}", remedy="export without --aligned"
        ) from (error)


def _mapping_note(shot: Shot, clock: str) -> str:
    a = shot.alignment(clock)
    doubt = "" if a.status == "ok" else f", {a.status}: {'; '.join(a.reasons)}"
    drift, offset = (f"{'-' if value < 0 else '+'} {abs(value):.9g}" for value in (a.drift, a.offset_s))
    return (
        f"clock {clock} was mapped to {shot.reference_clock}: t_ref = (1 {drift}) t {offset} s, "
        f"u {a.u_offset_s:.2g} s{doubt}"
    )


def _start(shot: Shot) -> AbsoluteStart | None:
    """Return when the reference clock's zero was, as far as a channel on it says."""
    bases = (channel.time_base for channel in shot.channels.values())
    starts = (base.absolute_start for base in bases if base.clock == shot.reference_clock)
    return next((start for start in starts if start is not None), None)


def _previews(shot: Shot) -> list[str]:
    """Return the sources of which the shot has what was read live alone."""
    return [one.channel for one in shot.quality if one.check == Check.PREVIEW]


def _document(shot: Shot, provenance: Mapping[str, Any], aligned: bool) -> dict[str, Any]:
    document: dict[str, Any] = _plain(
        {
            "schema": SCHEMA,
            "shot": shot.name,
            "rig": shot.rig_name,
            "started": shot.started or None,
            "reference_clock": shot.reference_clock,
            "aligned": aligned,
            "usable": shot.usable,
            "state": shot.state.value,
            "reasons": list(shot.reasons),
            "previews": _previews(shot),
            "alignment": [
                a.to_json() for a in shot.alignments
            ],
            "inputs": [{"file": i.name, "sha256": i.sha256, "source": i.source} for i in shot.inputs],
            "provenance": dict(provenance),
        }
    )  # fmt: skip
    return document


def _sensors(rig_text: str) -> dict[str, Any]:
    """Read what the rig file says about each channel's sensor; nothing where it cannot be read."""
    try:
        channels = parse_toml(rig_text).get("channel", [])
    except ValueError:
        return {}
    if not isinstance(channels, list):
        return {}
    return {
        str(c.get("name")): json.loads(json.dumps(c["sensor"], default=str))
        for c in channels
        if isinstance(c, dict) and isinstance(c.get("sensor"), dict)
    }
