"""Quantities, figures and tables of a target beside the mass, ready to be shown and written.

::

    TargetResult  quantities with intervals, series over time, figures, and why (not) to trust it
    +-- Quantity      one number
    +-- Series        columns over time, each with its standard uncertainty where it has one
    +-- Table         further rows for the page
    +-- Figure        of `recoil_identification.report.figure.figure`
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.remark import Note, Reason
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import Figure


@dataclass(frozen=True)
class Quantity:
    """One identified number.

    Attributes
    ----------
    name
        Name in words, for example ``stiffness of the elevating gear``.
    symbol
        Letters of formulas and tables, for example ``k_elevating``; in documents the name is the key.
    value, u
        NaN for the value where it was not identified.
    basis
        Way in which it was found, or why it was not, in a few words.
    expected, u_expected
        Value that the rig file declares, to compare with, and its standard uncertainty.
    interval
        Interval of 95 % coverage where it is not the value and 1.96 u on both sides.
    of_recoiling_part
        Whether it is the mass of the recoiling part, of which a rig may state a tolerance.
    """

    name: str
    symbol: str
    value: float
    u: float
    unit: str
    basis: str = ""
    expected: float | None = None
    u_expected: float | None = None
    interval: tuple[float, float] | None = None
    of_recoiling_part: bool = False

    @property
    def identified(self) -> bool:
        """True if there is a number."""
        return math.isfinite(self.value)

    @property
    def U95(self) -> tuple[float, float]:
        """95 % coverage interval."""
        half = COVERAGE_FACTOR * self.u
        return self.interval if self.interval is not None else (self.value - half, self.value + half)


@dataclass(frozen=True)
class Table:
    """Further rows for the page.

    Attributes
    ----------
    columns
        Names of the columns with their units.
    rows
        Rows as printed; numbers rounded by `recoil_identification.estimate.rounding`.
    """

    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class Series:
    """Columns over time, written as ``<target>.csv``.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (n,)
        Columns by name with unit, ``time_s`` first; ``u_<name>`` after what it belongs to. NaN is written as blank.
    """

    columns: Mapping[str, Array]

    def __post_init__(self) -> None:
        names = list(self.columns)
        if not names or names[0] != "time_s":
            raise ValueError(f"the first column of a series must be time_s, found {names[:1]}")
        if len({column.shape for column in self.columns.values()}) != 1:
            raise ValueError("the columns of a series must be of one length")


@dataclass(frozen=True, eq=False)
class TargetResult:
    """The result of one target.

    Attributes
    ----------
    target
        Name on the command line.
    title
        Title of the page.
    summary
        One or two sentences: what was identified from which channels by which method.
    figures
        Figures in reading order, keys unique.
    reasons
        Reasons why the result is not valid, one sentence each; empty if it is.
    notes
        Facts that a reader should know although it does not make the result invalid.
    parameters
        JSON values: what was chosen, for the provenance.
    """

    target: str
    title: str
    summary: str
    quantities: tuple[Quantity, ...]
    figures: tuple[Figure, ...] = ()
    series: Series | None = None
    tables: tuple[Table, ...] = ()
    reasons: tuple[Reason, ...] = ()
    notes: tuple[Note, ...] = ()
    parameters: Mapping[str, object] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        """True if nothing speaks against the result."""
        return not self.reasons

    def quantity(self, symbol: str) -> Quantity:
        """Return the quantity of a symbol.

        Raises
        ------
        KeyError
            If there is none.
        """
        for one in self.quantities:
            if one.symbol == symbol:
                return one
        raise KeyError(symbol)
