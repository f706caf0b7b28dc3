"""MAT, level 5, with the names that Dewesoft's export gives.

Each channel is a column ``Data1_<name>`` with its own times ``Data1_time_<name>``, seconds; every character that is
no letter, digit or underscore becomes an underscore, so names may fold to one: a number is put behind the later ones.
``recoil_daq_names`` (cells: variable, time variable, channel, unit) maps them back, ``recoil_daq`` is the JSON that
says the rest, with one entry per time base.

Format: MATLAB, "MAT-File Format", level 5; names have 63 characters at most. Names of variables: see
users' scripts that load such exports (``Data1_AI_1``, ``Data1_time_AI_1``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table
from recoil_acquisition.store.table import json_text

PREFIX, TIME = "Data1_", "Data1_time_"
LONGEST = 63


class MatExporter:
    """Exporter of MAT, level 5."""

    name = "mat"
    suffix = ".mat"
    extra = ""
    single_file = True

    def carried(self, content: Content) -> Representation:
        """Return everything; names that had to change are listed."""
        losses = [
            f"{name}: its name is {variable!r} here; `recoil_daq_names` maps it back"
            for (_, name), (variable, _) in variables(content).items()
            if variable != PREFIX + name
        ]
        return Representation(tuple(exact_table(group) for group in content.groups), tuple(losses))

    def write(self, content: Content, path: Path) -> None:
        """Write the file."""
        from scipy.io import savemat

        names = variables(content)
        units = {c.name: c.unit for group in content.groups for c in group.channels}
        cells = np.empty((len(names), 4), dtype=object)
        cells[:] = [[variable, time, name, units[name]] for (_, name), (variable, time) in names.items()]
        held: dict[str, Any] = {
            "recoil_daq": json_text([content.group_document(group) for group in content.groups]),
            "recoil_daq_names": cells,
        }
        for group in content.groups:
            for channel in group.channels:
                variable, time = names[group.name, channel.name]
                held[variable] = channel.samples
                held[time] = group.time_base.times_s
        savemat(str(path), held, appendmat=False, long_field_names=True, do_compression=True, oned_as="column")

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the file and map its names back by the table in it."""
        from scipy.io import loadmat

        held = loadmat(str(path), appendmat=False)
        mapped = {_text(row[2]): (_text(row[0]), _text(row[1])) for row in held["recoil_daq_names"]}
        tables = []
        for group in content.groups:
            times = [_column(held, mapped[c.name][1]) for c in group.channels]
            if any(not np.array_equal(time, times[0]) for time in times):
                raise ValueError(f"the channels of {group.name} have different times")
            samples = {c.name: _column(held, mapped[c.name][0]) for c in group.channels}
            tables.append(ExportedTable(group.name, times[0], samples))
        return tuple(tables)


def variables(content: Content) -> dict[tuple[str, str], tuple[str, str]]:
    """Name the variables of each channel and of its time, all distinct.

    Returns
    -------
    dict of tuple of str to tuple of str
        Names of the variables of samples and times, by group and channel.
    """
    taken: set[str] = set()
    names = {}
    for group in content.groups:
        for channel in group.channels:
            # Four characters are left for a number
            stem = re.sub(r"[^A-Za-z0-9_]", "_", channel.name)[: LONGEST - len(TIME) - 4]
            folded, k = stem, 1
            while {PREFIX + folded, TIME + folded} & taken:
                k += 1
                folded = f"{stem}_{k}"
            taken |= {PREFIX + folded, TIME + folded}
            names[group.name, channel.name] = (PREFIX + folded, TIME + folded)
    return names


def _column(held: Mapping[str, Any], name: str) -> NDArray[Any]:
    values: NDArray[Any] = held[name]
    if values.shape[1:] not in ((1,), (0,)):
        raise ValueError(f"{name} is no column")
    return np.ascontiguousarray(values.reshape(-1))


def _text(cell: NDArray[Any]) -> str:
    return str(cell[0]) if cell.size else ""
