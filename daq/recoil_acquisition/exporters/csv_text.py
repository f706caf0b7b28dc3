"""CSV of our own: one file per time base, every number exact.

::

    # recoil-daq: "csv/1"
    # shot: "0007"
    # time: {"start_s": -0.01, "step_s": 5e-05, "count": 400}
    # channel: {"name": "p_breech", "unit": "Pa", ...}
    time_s [s],p_breech [Pa]
    -0.01,101325.0

Behind ``# key:`` stands JSON; ``channel`` once per column, in their order. Numbers are the shortest decimals that
give back the same float64 (Python's ``repr``); a lost sample is ``nan``. The time column is on the clock that
``clock`` names, or on the reference clock where ``aligned`` is true.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table
from recoil_acquisition.readers.exported.recoil_csv import FIRST_LINE, RecoilCsvReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.store.table import json_text
from recoil_acquisition.visible_text import visible

_FORMULA = re.compile("(?:^|(?<=[,;]))(?=[=+@-])")
"""Where a cell would begin as a formula does, whatever separates the cells to a spreadsheet."""

_WITHIN_JSON = re.compile("[=@\x7f-\x9f\u200e\u200f\u061c\u2028-\u202e\u2066-\u2069]|(?<=[,;])[+-]")
"""What stands in texts of JSON alone, never between them, and would begin a formula or turn a terminal's text."""

ROWS = 65536
"""Rows that are put into text at a time."""


class CsvExporter:
    """Exporter of our own CSV."""

    name = "csv"
    suffix = ".csv"
    extra = ""
    single_file = False

    def carried(self, content: Content) -> Representation:
        """Return everything: samples of float32 become the float64 of the same value."""
        return Representation(tuple(exact_table(group, _as_float64) for group in content.groups))

    def write(self, content: Content, path: Path) -> None:
        """Write the file of the one group."""
        (group,) = content.groups
        document = content.group_document(group)
        columns = [group.time_base.times_s, *(c.samples for c in group.channels)]
        headings = ["time_s [s]", *(f"{c.name} [{c.unit}]" for c in group.channels)]
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(FIRST_LINE + "\n")
            for key, value in document.items():
                for item in value if key == "channels" else [value]:
                    file.write(f"# {'channel' if key == 'channels' else key}: {_comment(item)}\n")
            file.write(heading_row(headings) + "\n")
            for start in range(0, group.time_base.count, ROWS):
                cells = [map(repr, column[start : start + ROWS].astype(np.float64).tolist()) for column in columns]
                file.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the file by the reader of this format."""
        (group,) = content.groups
        recording = RecoilCsvReader().open(path, Declarations(group.time_base.clock))
        samples = {header.name: recording.read(header.name) for header in recording.signals}
        times_s = recording.time_base(recording.signals[0].name).times_s
        return (ExportedTable(group.name, times_s, samples),)


def heading_row(headings: list[str]) -> str:
    """Write headings as one line of CSV that no spreadsheet takes for formulas and no terminal obeys.

    They are for people: the readers take the names from elsewhere, or from their order.
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([_FORMULA.sub("'", visible(heading)) for heading in headings])
    return text.getvalue()


def _comment(value: Any) -> str:
    """Write JSON that a spreadsheet may split at any comma: no cell begins a formula, and it reads back the same."""
    return _WITHIN_JSON.sub(lambda match: f"\\u{ord(match.group()):04x}", json_text(value))


def _as_float64(samples: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    return samples.astype(np.float64)
