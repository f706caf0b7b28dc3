"""Results in a row: masses that stand under one another along one key, in a table and over it in a figure.

::

    ResultTable    what the rows of a kind of documents are: which they have, their cells, their columns, their page
    +-- ResultColumn   a column, as a page shows it and a terminal prints it, and how a row is worded in it

The key is a file in an index of shots, a date in a history of campaigns, a value of an option in a sweep; reports
beside one another are such a table on its side. Page, terminal, CSV text and figure of each are made of its table. Its
row is plain: ``mass_kg``, ``u_kg``, ``U95_low_kg``, ``U95_high_kg``, ``E_n``, ``rpe_percent``, ``valid`` and
``reason``, as far as a column is of them, each None where there is none; and what is its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.estimate.rounding import NO_NUMBER, fixed, percentage, rounded, signed, significant
from recoil_identification.report.content.section import Column
from recoil_identification.report.document.spreadsheet import csv_text
from recoil_identification.report.figure.figure import HorizontalLine, Panel, Trace

if TYPE_CHECKING:
    import pandas as pd

Document = Mapping[str, Any]
Row = dict[str, Any]

MASS_KEYS = ("mass_kg", "u_kg", "U95_low_kg", "U95_high_kg")
"""Keys of a row's mass, its standard uncertainty and its 95 % interval."""
VERDICTS = {True: "valid", False: "not valid", None: "no report"}
"""Verdict on a mass -> its word."""


@dataclass(frozen=True)
class ResultColumn(Column):
    """A column of results.

    Attributes
    ----------
    text
        Function that words a row in it; as the row has it where None.
    printed
        Heading in a terminal; that of the page if left out, and None for a column that no terminal has.
    """

    text: Callable[[Mapping[str, Any]], str] | None = None
    printed: str | None = ""

    def worded(self, row: Mapping[str, Any]) -> str:
        """Return the cell of a row; empty where the row says nothing."""
        if self.text is not None:
            return self.text(row)
        return "" if row[self.key] is None else str(row[self.key])

    @property
    def printed_heading(self) -> str:
        """Heading in a terminal: names begin small there, and symbols as they are."""
        head = self.head[:1].lower() + self.head[1:] if self.head[1:2].islower() else self.head
        return self.printed or (f"{head}, {self.unit}" if self.unit else head)


def half_width(row: Mapping[str, Any]) -> float | None:
    """Return half the width of a row's 95 % interval; None where it has none."""
    low, high = row["U95_low_kg"], row["U95_high_kg"]
    return None if low is None or high is None else (high - low) / 2


def bare_kg(row: Mapping[str, Any]) -> float | None:
    """Return a row's mass without what was added for the shot; None where it has none."""
    return None if row["mass_kg"] is None else row["mass_kg"] - (row["added_mass_kg"] or 0.0)


def _interval(row: Mapping[str, Any]) -> str:
    half = half_width(row)
    limits = (row["U95_low_kg"], row["U95_high_kg"])
    return NO_NUMBER if half is None else " … ".join(rounded(limit, half)[0] for limit in limits)


MASS = ResultColumn("mass", "Mass", "number", "kg", text=lambda row: rounded(row["mass_kg"], row["u_kg"])[0])
U = ResultColumn("u", "u", "number", "kg", text=lambda row: rounded(row["mass_kg"], row["u_kg"])[1])
INTERVAL = ResultColumn("interval", "95 % interval", "number", "kg", text=_interval, printed=None)
E_N = ResultColumn("e_n", "E_n", "number", text=lambda row: signed(fixed(row["E_n"], 2)))
RPE = ResultColumn(
    "rpe", "RPE", "number", "%", text=lambda row: percentage(row["rpe_percent"], significant(row["rpe_percent"], 2))
)
VERDICT = ResultColumn("verdict", "Verdict", "chip", text=lambda row: VERDICTS[row["valid"]])
TONES = {True: "ok", False: "fail", None: "warn"}
"""Verdict on a mass -> colour of its word."""
REASON = ResultColumn("reason", "First reason", "long")
CONFIGURATION = ResultColumn("configuration", "Configuration")
ADDED = ResultColumn(
    "added", "Added", "number", "kg", text=lambda row: f"{row['added_mass_kg']:g}" if row["added_mass_kg"] else ""
)
BARE = ResultColumn(
    "bare", "Less added", "number", "kg", printed=None,
    text=lambda row: rounded(bare_kg(row), row["u_kg"])[0] if row["added_mass_kg"] else "",
)  # fmt: skip


def _peak(name: str, head: str, unit: str, scale: float, decimals: int) -> ResultColumn:
    def text(row: Mapping[str, Any]) -> str:
        value = row.get(name)
        return fixed(None if value is None else scale * value, decimals)

    return ResultColumn(name, head, "number", unit, text=text)


PEAKS = (
    _peak("breech_pressure_pa", "Breech", "MPa", 1e-6, 1),
    _peak("recoil_velocity_m_s", "Velocity", "m/s", 1.0, 2),
    _peak("recoil_travel_m", "Travel", "mm", 1e3, 1),
    _peak("impulse_n_s", "Impulse", "N s", 1.0, 0),
)


def flat(mass: Mapping[str, Any]) -> Row:
    """Return the mass of a document as a row has it, the interval where it has one."""
    return dict(zip(MASS_KEYS, (mass["value"], mass["u"], *mass.get("U95", (None, None))), strict=True))


@dataclass(frozen=True)
class ResultTable:
    """A kind of rows of results.

    Attributes
    ----------
    rows
        Function that returns the rows of a document, each with what its columns and its marks need.
    columns
        Columns of page and terminal.
    cells
        Keys of a row, and columns of the table for spreadsheets, in their order; none where no such table is written.
    marks
        Function that returns the marks of a row on a page, see
        `recoil_identification.report.content.section.Section.rows`.
    """

    rows: Callable[[Document], Iterable[Mapping[str, Any]]]
    columns: tuple[ResultColumn, ...]
    cells: tuple[str, ...] = ()
    marks: Callable[[Mapping[str, Any]], Row] = field(default=lambda _: {})

    def worded(self, document: Document) -> list[Row]:
        """Word the rows of a document, rounded to their uncertainties."""
        return [
            {**self.marks(row), **{column.key: column.worded(row) for column in self.columns}}
            for row in self.rows(document)
        ]

    def csv(self, document: Document) -> str:
        """Return the rows as CSV text."""
        return csv_text(self.cells, ([row[name] for name in self.cells] for row in self.rows(document)))

    def frame(self, document: Document) -> pd.DataFrame:
        """Return the rows as the CSV text has them."""
        import pandas as pd

        return pd.DataFrame(list(self.rows(document)), columns=list(self.cells))


@dataclass(frozen=True)
class ResultHead:
    """The head of a page of results.

    Attributes
    ----------
    title
        Heading of the page.
    of
        Rig or rigs that it is of; may be empty.
    words
        Sentences on the whole.
    doubtful
        Whether what is said is to be read with care.
    faults
        Files that have no row, each with its error.
    series_file, series_name
        Name of the table beside the page, and what is in it; None where there is none.
    identity
        Identity of the page: label and text of each fact.
    embedded
        Document that the script of the page is given, for the names of the pictures that it saves.
    """

    title: str
    of: str
    words: tuple[str, ...]
    doubtful: bool = False
    faults: tuple[str, ...] = ()
    series_file: str | None = None
    series_name: str | None = None
    identity: tuple[tuple[str, str], ...] = ()
    embedded: Row = field(default_factory=dict)


def mass_panel(
    x: ArrayLike,
    rows: Sequence[Mapping[str, Any]],
    groups: Iterable[tuple[str, Sequence[bool], int]],
    *,
    band: tuple[str, Sequence[float], Sequence[float]] | None,
    specification_kg: float | None,
) -> Panel:
    """Draw masses with their 95 % intervals along their key.

    Parameters
    ----------
    x : array-like, shape (n,)
        Place of each row.
    groups
        Label, which rows are of it, and hue of each group of them; one without rows is left out.
    band
        Label, ends along the key, and mass with both limits in kg of what lies behind them; None for nothing.
    """
    places: NDArray[np.float64] = np.asarray(x, dtype=np.float64)
    mass, low, high = np.array([[row[key] for key in MASS_KEYS if key != "u_kg"] for row in rows], dtype=np.float64).T
    traces = []
    if band is not None:
        label, ends, (value, *limits) = band
        below, above = ([limit] * 2 for limit in limits)
        traces.append(Trace(label, ends, [value] * 2, "band", "kg", below, above, hue=2))
    for label, of_it, hue in groups:
        at = np.asarray(of_it, dtype=bool)
        if at.any():
            traces.append(Trace(label, places[at], mass[at], "whiskers", "kg", low[at], high[at], hue=hue))
    lines = () if specification_kg is None else (HorizontalLine("specification", specification_kg),)
    return Panel("mass, kg", tuple(traces), lines)
