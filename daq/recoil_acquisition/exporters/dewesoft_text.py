"""Text with separators, one file per time base: as Dewesoft exports it, and CSV of our own in which numbers are exact.

Dewesoft's layout has 15 digits: one heading row, ``Time (s)`` and then ``group/name (unit)`` with the clock as the
group, no unit row; an empty cell is a lost sample. The layout is that of exports which users have published
(see `recoil_acquisition.readers.text.dewesoft`).

CSV of our own::

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

from recoil_acquisition.errors import visible
from recoil_acquisition.exporters.content import Content
from recoil_acquisition.exporters.exporter import ExportedTable, Representation, exact_table
from recoil_acquisition.readers.exported.recoil_csv import FIRST_LINE, RecoilCsvReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import find_block
from recoil_acquisition.readers.text_file import read_text
from recoil_acquisition.store.table import json_text

_FORMULA = re.compile("(?:^|(?<=[,;]))(?=\\s*[=+@\uff1d\uff0b\uff20\uff0d-])")
"""Places where a cell would begin as a formula does, whatever separates the cells to a spreadsheet."""

_WITHIN_JSON = re.compile(
    "[=@\uff1d\uff20\x7f-\x9f\u200e\u200f\u061c\u2028-\u202e\u2066-\u2069]|(?<=[,;])[+\uff0b\uff0d-]"
)
"""Characters that stand in texts of JSON alone, never between them, and would begin a formula or turn a terminal's
text."""

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


_LOST = re.compile("-?(NAN|INF)")


class DewesoftTextExporter:
    """Exporter of text in Dewesoft's layout."""

    name = "dewesoft-text"
    suffix = ".txt"
    extra = ""
    single_file = False

    def carried(self, content: Content) -> Representation:
        """Return the numbers as 15 digits give them back, and by how much they are off."""
        tables, losses = [], []
        for group in content.groups:
            times_s = _printed(group.time_base.times_s)
            samples = {c.name: _printed(c.samples) for c in group.channels}
            tables.append(ExportedTable(group.name, times_s, samples))
            losses += _rounding("time", group.time_base.times_s, times_s)
            for c in group.channels:
                losses += _rounding(c.name, c.samples.astype(np.float64), samples[c.name])
            losses.append(
                "what is known beside name and unit: clock, even spacing, absolute start, sensors, provenance"
            )
        return Representation(tuple(tables), tuple(losses))

    def write(self, content: Content, path: Path) -> None:
        """Write the file of the one group."""
        (group,) = content.groups
        columns = [group.time_base.times_s, *(c.samples for c in group.channels)]
        headings = ["Time (s)", *(f"{group.name}/{c.name} ({_unit(c.unit)})" for c in group.channels)]
        with path.open("x", encoding="utf-8", newline="\r\n") as file:
            file.write(heading_row(headings) + "\n")
            form = ",".join(["%.15G"] * len(columns)) + "\n"
            for start in range(0, group.time_base.count, ROWS):
                rows = zip(*(column[start : start + ROWS].tolist() for column in columns), strict=True)
                file.write(_LOST.sub("", "".join([form % row for row in rows])))

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the numbers; headings may read alike, so the order decides."""
        (group,) = content.groups
        names = [c.name for c in group.channels]
        file = read_text(path)
        values = np.empty((0, 1 + len(names)))
        if group.time_base.count:
            body = file.data.find(b"\n") + 1
            values = read_rows(find_block(file, body, ",", ["time", *names], decimal_comma=False))
        columns = [np.ascontiguousarray(column) for column in values.T]
        return (ExportedTable(group.name, columns[0], dict(zip(names, columns[1:], strict=True))),)


def _unit(unit: str) -> str:
    return "-" if unit == "1" else unit


def _printed(samples: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return what 15 digits give back; NaN where there is no number."""
    printed = np.array([float(f"{value:.15G}") for value in samples.tolist()], dtype=np.float64)
    printed[np.isinf(printed)] = np.nan
    return printed


def _rounding(name: str, exact: NDArray[np.float64], printed: NDArray[np.float64]) -> list[str]:
    """Say how many numbers 15 digits change, and by how much at most."""
    losses = []
    infinite = int(np.isinf(exact).sum())
    if infinite:
        losses.append(f"{name}: {infinite} infinite samples are empty cells, as lost ones are")
    changed = (exact != printed) & np.isfinite(exact)
    if changed.any():
        relative = float((np.abs(exact[changed] - printed[changed]) / np.abs(exact[changed])).max())
        losses.append(
            f"{name}: 15 digits change {int(changed.sum())} of {exact.size} numbers, by {relative:.1e} of them at most"
        )
    return losses
