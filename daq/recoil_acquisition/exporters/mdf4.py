"""MDF4: one channel group per time base, its master the time in seconds on the group's clock.

The group's comment is the JSON of `exporters.content`; each channel has its name, unit and a comment that says
quantity, role and signal. The header's start time is that of the reference clock's zero.

Format: ASAM MDF 4.1; written by asammdf.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.exporters.content import Content, TimeBaseGroup
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table
from recoil_acquisition.store.table import json_text

VERSION = "4.10"
UNKNOWN_START = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)
"""Date in the header where no source states a start: there must be one, and never the day of the export."""


class Mdf4Exporter:
    """Exporter of MDF4."""

    name = "mdf4"
    suffix = ".mf4"
    extra = "mdf"
    single_file = True

    def carried(self, content: Content) -> Representation:
        """Return everything; what the header cannot say of the start is named."""
        losses = []
        moment = None if content.start is None else content.start.moment
        if moment is None:
            losses.append("the absolute start is unknown, and the header must have one: it says 1970-01-01T00:00:00Z")
        elif moment.tzinfo is None:
            losses.append(f"the zone of the start {moment.isoformat()} is unknown: the header has it as local time")
        others = [g.name for g in content.groups if g.time_base.clock != content.document["reference_clock"]]
        if others:
            losses.append(
                f"the header has one start: {', '.join(others)} count from the zero of their own clocks, which the "
                "comments of their groups name"
            )
        return Representation(tuple(exact_table(group) for group in content.groups), tuple(losses))

    def write(self, content: Content, path: Path) -> None:
        """Write the file."""
        from asammdf import MDF, Signal

        with MDF(version=VERSION) as mdf:
            mdf.header.start_time = (content.start and content.start.moment) or UNKNOWN_START
            mdf.header.comment = f"shot {content.document['shot']} on rig {content.document['rig']}"
            for group in content.groups:
                times_s = group.time_base.times_s
                signals = [
                    Signal(np.array(c.samples), times_s, name=c.name, unit=c.unit, comment=_comment(content, c))
                    for c in group.channels
                ]
                document = json_text(content.group_document(group))
                mdf.append(signals, acq_name=group.name, comment=document, common_timebase=True)
            saved = mdf.save(path, overwrite=False)
        if Path(saved) != path:
            raise OSError(f"was written as {saved}")

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the file."""
        from asammdf import MDF

        with MDF(path) as mdf:
            if len(mdf.groups) != len(content.groups):
                raise ValueError(f"{len(mdf.groups)} channel groups")
            return tuple(_table(mdf, i, group) for i, group in enumerate(content.groups))


def _comment(content: Content, channel: Any) -> str:
    document = content.channel_document(channel)
    return json_text({key: document[key] for key in ("quantity", "role", "signal", "u_rel")})


def _table(mdf: Any, index: int, group: TimeBaseGroup) -> ExportedTable:
    names = [channel.name for channel in mdf.groups[index].channels[1:]]
    times_s = np.asarray(mdf.get_master(index), dtype=np.float64)
    samples = {
        name: np.asarray(mdf.get(group=index, index=i, raw=True, samples_only=True)[0])
        for i, name in enumerate(names, start=1)
    }
    return ExportedTable(group.name, times_s, samples)
