"""Channels inside a shot file: one group per time base, and the raw counts beside them.

The tree is described in `recoil_acquisition.store.layout`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel, RawCounts, Step
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store.seal import DIGEST, digest_of
from recoil_acquisition.store.table import new_group, read_table, tree_names

CHUNK_SAMPLES = 32768
"""Samples per chunk: 256 KiB of float64, well inside HDF5's chunk cache of 1 MiB."""


def time_groups(entry: Any, reserved: Collection[str]) -> list[tuple[str, Any]]:
    """Names and groups of the time bases in ``/entry``, in the order they were written.

    A file of before a name was reserved may have a clock of that name: NXdata are the clocks' alone.
    """
    groups = [(name, entry[name]) for name in entry if name not in reserved or _is_data(entry[name])]
    return sorted(groups, key=lambda named: int(named[1].attrs["order"]))


def _is_data(item: Any) -> bool:
    return bool(item.attrs.get("NX_class") == "NXdata")


def signals_of(group: Any) -> list[tuple[str, Any]]:
    """Names and datasets of the signals in one time base's group, without its ``time``."""
    return [(name, group[name]) for name in group if name != "time"]


def by_time_base(channels: Iterable[Channel]) -> list[tuple[TimeBase, list[tuple[int, Channel]]]]:
    """Group channels, with their places in the shot, by the time bases that they share."""
    groups: list[tuple[TimeBase, list[tuple[int, Channel]]]] = []
    for order, channel in enumerate(channels):
        for time_base, members in groups:
            if time_base is channel.time_base or time_base.is_identical(channel.time_base):
                members.append((order, channel))
                break
        else:
            groups.append((channel.time_base, [(order, channel)]))
    return groups


def write_channels(entry: Any, shot: Shot, reserved: Collection[str], *, compressed: bool) -> None:
    """Write all channels of a shot and make the main plot's group the entry's default.

    Parameters
    ----------
    reserved
        Names in the entry that no clock's group may have.
    """
    filters = {"shuffle": True, "compression": "gzip", "compression_opts": 2} if compressed else {}
    groups = by_time_base(shot.channels.values())
    names = tree_names((time_base.clock for time_base, _ in groups), reserved)
    raw = new_group(entry, "raw", "NXcollection")
    main = shot.by_role("recoil_acceleration")
    for order, (name, (time_base, members)) in enumerate(zip(names, groups, strict=True)):
        group = new_group(entry, name, "NXdata")
        group.attrs["order"] = order
        time = _write_time(group, time_base, filters)
        signals = tree_names((channel.name for _, channel in members), {"time"})
        counted = {s: c.raw for s, (_, c) in zip(signals, members, strict=True) if c.raw is not None}
        for signal, (place, channel) in zip(signals, members, strict=True):
            _write_signal(group, signal, time, place, channel, filters)
        plotted = next((s for s, (_, c) in zip(signals, members, strict=True) if c is main), signals[0])
        group.attrs["signal"] = plotted
        group.attrs["axes"] = ["time"]
        group.attrs["time_indices"] = 0
        if len(signals) > 1:
            group.attrs["auxiliary_signals"] = [s for s in signals if s != plotted]
        if any(channel is main for _, channel in members) or (
            "default" not in entry.attrs and main is None and time_base.clock == shot.reference_clock
        ):
            entry.attrs["default"] = name
        if counted:
            _write_raw(new_group(raw, name, "NXcollection"), time, counted, filters)
    if names and "default" not in entry.attrs:
        entry.attrs["default"] = names[0]


def _dataset(group: Any, name: str, values: NDArray[Any], time: Any | None, filters: Mapping[str, Any]) -> Any:
    """Create a dataset with checksums, compressed by the filters, and attach it to its time."""
    # A dataset without elements cannot be chunked, and filters need chunks
    own = {"chunks": (min(values.size, CHUNK_SAMPLES),), "fletcher32": True, **filters} if values.size else {}
    dataset = group.create_dataset(name, data=values, track_times=False, **own)
    dataset.attrs[DIGEST] = digest_of(values)
    if time is not None:
        dataset.dims[0].attach_scale(time)
    return dataset


def _write_time(group: Any, time_base: TimeBase, filters: Mapping[str, Any]) -> Any:
    time = _dataset(group, "time", time_base.times_s, None, filters)
    time.make_scale("time")
    time.attrs["units"] = "s"
    time.attrs["long_name"] = f"time on the clock of {time_base.clock}"
    time.attrs["clock"] = time_base.clock
    time.attrs["start_s"] = time_base.start_s
    time.attrs["end_s"] = time_base.end_s
    time.attrs["rate_hz"] = time_base.rate_hz
    if time_base.step_s is not None:
        time.attrs["step_s"] = time_base.step_s
    if time_base.absolute_start is not None:
        time.attrs["absolute_start"] = time_base.absolute_start.text
        time.attrs["absolute_start_zone"] = time_base.absolute_start.zone
        time.attrs["absolute_start_origin"] = time_base.absolute_start.origin
        if time_base.absolute_start.locked_to:
            time.attrs["absolute_start_locked_to"] = time_base.absolute_start.locked_to
    return time


def _write_signal(group: Any, name: str, time: Any, place: int, channel: Channel, filters: Mapping[str, Any]) -> None:
    dataset = _dataset(group, name, channel.samples, time, filters)
    dataset.attrs["units"] = channel.unit
    dataset.attrs["long_name"] = f"{channel.name}: {(channel.role or channel.quantity).replace('_', ' ')}"
    dataset.attrs["channel"] = channel.name
    dataset.attrs["quantity"] = channel.quantity
    dataset.attrs["role"] = channel.role
    dataset.attrs["clock"] = channel.time_base.clock
    # Not `signal`: older NeXus readers take a dataset with signal = 1 for the one to plot
    dataset.attrs["source_signal"] = channel.signal
    dataset.attrs["u_rel"] = channel.u_rel
    dataset.attrs["resolution"] = channel.resolution
    dataset.attrs["lost"] = int(np.count_nonzero(channel.lost))
    dataset.attrs["order"] = place


def _write_raw(group: Any, time: Any, counted: dict[str, RawCounts], filters: Mapping[str, Any]) -> None:
    # A second name of the same time: a netCDF reader looks for a dimension in the group and above it
    group["time"] = time
    for name, raw in counted.items():
        dataset = _dataset(group, name, raw.counts, time, filters)
        dataset.attrs["units"] = "1"
        dataset.attrs["long_name"] = "counts as stored by the source"
        dataset.attrs["gain"] = raw.gain
        dataset.attrs["offset"] = raw.offset
        dataset.attrs["source_unit"] = raw.unit


def read_channels(entry: Any, reserved: Collection[str]) -> list[Channel]:
    """Read all channels, in the shot's order; ``reserved`` as in `write_channels`."""
    steps: dict[str, list[Step]] = {}
    for row in read_table(entry["history"]["channels"], ("channel", "what", "version", "parameters")):
        parameters = read_json(row["parameters"], finite=False)
        steps.setdefault(row["channel"], []).append(Step(row["what"], row["version"], parameters))
    placed = []
    for group_name, group in time_groups(entry, reserved):
        time_base = _read_time(group["time"])
        counted = entry["raw"].get(group_name, {})
        for signal_name, dataset in signals_of(group):
            name = str(dataset.attrs["channel"])
            raw = counted.get(signal_name)
            channel = Channel(
                name=name,
                quantity=str(dataset.attrs["quantity"]),
                samples=dataset[()],
                time_base=time_base,
                signal=str(dataset.attrs["source_signal"]),
                role=str(dataset.attrs["role"]),
                u_rel=float(dataset.attrs["u_rel"]),
                resolution=float(dataset.attrs["resolution"]),
                raw=None if raw is None else _read_raw(raw),
                history=tuple(steps.get(name, ())),
            )
            placed.append((int(dataset.attrs["order"]), channel))
    return [channel for _, channel in sorted(placed, key=lambda item: item[0])]


def _read_time(time: Any) -> TimeBase:
    attributes = time.attrs
    start = None
    if "absolute_start" in attributes:
        start = AbsoluteStart(
            text=str(attributes["absolute_start"]),
            zone=str(attributes["absolute_start_zone"]),
            origin=str(attributes["absolute_start_origin"]),
            locked_to=str(attributes.get("absolute_start_locked_to", "")),
        )
    stamps = time[()]
    clock, start_s = str(attributes["clock"]), float(attributes["start_s"])
    if "step_s" not in attributes:
        return TimeBase(clock, start_s, None, stamps.size, stamps, start)
    uniform = TimeBase.uniform(clock, start_s, float(attributes["step_s"]), stamps.size, start)
    if not np.array_equal(uniform.times_s, stamps):
        raise ValueError(f"{time.name} is not start_s + step_s * k")
    return uniform


def _read_raw(dataset: Any) -> RawCounts:
    attributes = dataset.attrs
    return RawCounts(
        counts=dataset[()],
        gain=float(attributes["gain"]),
        offset=float(attributes["offset"]),
        unit=str(attributes["source_unit"]),
    )
