"""TDMS: one group per time base, one channel per channel.

Even spacing is the waveform properties ``wf_start_offset`` and ``wf_increment``, float64 and exact; instants that are
not evenly spaced are a channel of their own, ``time_s``, first in their group. ``wf_start_time`` is there where the
start and its zone are known. The JSON of `exporters.content` stands in the properties ``recoil_daq`` of each group.

Format: National Instruments, "TDMS File Format Internal Structure"; written by npTDMS.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.exporters.content import Content, TimeBaseGroup
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table, free_name
from recoil_acquisition.store.table import json_text


class TdmsExporter:
    """Exporter of TDMS."""

    name = "tdms"
    suffix = ".tdms"
    extra = "tdms"
    single_file = True

    def carried(self, content: Content) -> Representation:
        """Return everything; an absolute start whose zone is unknown is named."""
        losses = []
        for group in content.groups:
            start = group.time_base.absolute_start
            moment = None if start is None else start.moment
            if start is not None and (moment is None or moment.tzinfo is None):
                losses.append(
                    f"{group.name}: no wf_start_time, which is UTC, because the zone of {start.text} is {start.zone}; "
                    "the group's property `recoil_daq` has it"
                )
        return Representation(tuple(exact_table(group) for group in content.groups), tuple(losses))

    def write(self, content: Content, path: Path) -> None:
        """Write the file."""
        from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

        root = {"name": str(content.document["shot"]), "rig": str(content.document["rig"])}
        objects: list[Any] = [RootObject(root)]
        for group in content.groups:
            objects.append(GroupObject(group.name, {"recoil_daq": json_text(content.group_document(group))}))
            if group.time_base.step_s is None:
                times = group.time_base.times_s
                objects.append(ChannelObject(group.name, _time_name(group), times, {"unit_string": "s"}))
            objects += [ChannelObject(group.name, c.name, c.samples, _properties(group, c)) for c in group.channels]
        with path.open("xb") as file, TdmsWriter(file) as writer:
            writer.write_segment(objects)

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the file."""
        from nptdms import TdmsFile

        with path.open("rb") as file:
            held = TdmsFile.read(file)
        tables = []
        for group in content.groups:
            channels = {channel.name: channel for channel in held[group.name].channels()}
            if group.time_base.step_s is None:
                times_s = np.asarray(channels.pop(_time_name(group))[:], dtype=np.float64)
            else:
                first = channels[group.channels[0].name]
                said = {(c.properties["wf_start_offset"], c.properties["wf_increment"]) for c in channels.values()}
                if len(said) > 1:
                    raise ValueError(f"the channels of {group.name} have different times")
                ((offset_s, step_s),) = said
                times_s = offset_s + step_s * np.arange(len(first), dtype=np.float64)
            tables.append(ExportedTable(group.name, times_s, {name: np.asarray(c[:]) for name, c in channels.items()}))
        return tuple(tables)


def _time_name(group: TimeBaseGroup) -> str:
    return free_name("time_s", [c.name for c in group.channels])


def _properties(group: TimeBaseGroup, channel: Channel) -> dict[str, Any]:
    base = group.time_base
    properties: dict[str, Any] = {
        "unit_string": channel.unit, "quantity": channel.quantity, "role": channel.role, "signal": channel.signal,
    }  # fmt: skip
    if base.step_s is None:
        return properties
    properties |= {"wf_start_offset": base.start_s, "wf_increment": base.step_s, "wf_samples": base.count}
    properties |= {"wf_xname": "Time", "wf_xunit_string": "s"}
    moment = None if base.absolute_start is None else base.absolute_start.moment
    if moment is not None and moment.tzinfo is not None:
        properties["wf_start_time"] = np.datetime64(moment.astimezone(dt.UTC).replace(tzinfo=None), "us")
    return properties
