"""The layout of a text table that does not state it, as the rig declares it in ``[source.layout]``."""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from recoil_acquisition.errors import Fault, FaultCode, nearest_first
from recoil_acquisition.quantities.declaration import DeclaredTable, Positive, Text, Texts

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1250", "cp1251", "cp1252", "latin-1", "ascii")
MOST_ROWS = 1000
"""Line that a header or first row may be at most: the file's beginning is looked at alone."""


def _encoding(name: str) -> str:
    try:
        return codecs.lookup(name).name
    except (LookupError, ValueError):
        return ""


def _known_encoding(name: str) -> str:
    if _encoding(name) not in {_encoding(one) for one in ENCODINGS}:
        raise ValueError(f"must be one of {', '.join(ENCODINGS)}")
    return name


def _all_different(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(names) < 2 or len(set(names)) < len(names) or not all(names):
        raise ValueError("must be a list of different texts")
    return names


Row = Annotated[int, Field(ge=1, le=MOST_ROWS)]


class TextLayout(DeclaredTable):
    """Layout of a text table."""

    separator: Literal["\t", ";", ",", "|", " "] = Field(description='one of "\\t", ";", ",", "|" and " "')
    """Sign between two cells; a blank stands for any number of them."""
    first_row: Row = Field(description=f"the line of the first row of numbers, from 1 to {MOST_ROWS}")
    """Rows before it are no data."""
    decimal: Literal[".", ","] = Field(default=".", description='"." or ","')
    """The decimal mark."""
    thousands: Literal["", ".", ",", "'", " "] | None = Field(
        default=None, description='what sets thousands apart: ".", ",", "\'", " " or "" for nothing'
    )
    """Tables without it are refused in which a mark may either set thousands apart or be the decimal mark."""
    encoding: Annotated[str, AfterValidator(_known_encoding)] | None = None
    """Encoding of the text; if left out, that of the byte order mark, else UTF-8 or Windows-1252."""
    header_row: Row | None = Field(default=None, description="the line of the names, from 1")
    """Names may be declared by ``names`` instead."""
    unit_row: Row | None = Field(default=None, description="the line of the units, from 1")
    """Units may be declared by ``units`` instead."""
    time_column: Text | Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="the name of the column of time, or its number from 1"
    )
    """Rows may be dated by ``rate_hz`` instead."""
    time_unit: Literal["s", "ms", "us", "ns", "min", "h"] | None = Field(
        default=None, description="one of s, ms, us, ns, min, h"
    )
    """Unit of relative time; None if the column holds stamps."""
    rate_hz: Positive | None = Field(default=None, description="a positive number, the sample rate in Hz")
    """The sampling rate of a table that has no column of time."""
    names: Annotated[Texts, AfterValidator(_all_different)] = ()
    """Names of all columns, where no row of the file holds them."""
    units: Texts = Field(default=(), description="a list of texts")
    """Unit of every column, where no row of the file holds them."""
    missing: Texts = Field(default=(), description="a list of texts that mean a lost sample")
    """Empty cells and NaN are lost in any case."""
    comment: Annotated[str, Field(pattern=r"^[!-*/:<-{}~][ -~]{0,3}$")] = Field(
        default="", description="a text of one to four ASCII characters that begins no number"
    )
    """The characters that begin a comment, a line that is no row."""

    def contradictions(self) -> list[Fault]:
        """Return the faults between keys that are sound alone."""
        faults: list[tuple[str, str]] = []
        given = self.model_fields_set
        if self.separator == "," and self.decimal == ",":
            faults.append(("decimal", "a comma cannot both separate cells and mark decimals"))
        if self.separator == self.thousands == " ":
            faults.append(("thousands", "a blank cannot both separate cells and set thousands apart"))
        if self.thousands == self.decimal:
            other = "," if self.decimal == "." else "."
            both = f"{self.decimal!r} cannot both mark decimals and set thousands apart"
            faults.append(("thousands", f'{both}: declare `decimal = "{other}"`'))
        if not self.names and self.header_row is None:
            faults.append(("header_row", "is missing; or declare `names`"))
        if self.names and self.header_row is not None:
            faults.append(("names", "is declared twice: by `header_row` as well"))
        if self.units and self.unit_row is not None:
            faults.append(("units", "is declared twice: by `unit_row` as well"))
        if "units" in given and self.names and len(self.units) != len(self.names):
            faults.append(("units", f"has {len(self.units)} texts, `names` has {len(self.names)}"))
        faults += [
            (key, f"must lie above `first_row`, {self.first_row}, found {row}")
            for key, row in (("header_row", self.header_row), ("unit_row", self.unit_row))
            if row is not None and row >= self.first_row
        ]
        if self.unit_row is not None and self.header_row == self.unit_row:
            faults.append(("unit_row", "is the row of names as well; leave it out where names hold their units"))
        if self.time_column is None and self.rate_hz is None:
            faults.append(("time_column", "is missing; or declare `rate_hz`"))
        if self.time_unit is not None and self.time_column is None:
            faults.append(("time_unit", "needs `time_column`"))
        faults += _faults_of_time_column(self)
        return [Fault((key,), problem, FaultCode.CONTRADICTION) for key, problem in faults]


def _faults_of_time_column(layout: TextLayout) -> list[tuple[str, str]]:
    column, names = layout.time_column, layout.names
    if not names or column is None:
        return []
    if isinstance(column, str) and column not in names:
        near = ", ".join(repr(name) for name in nearest_first(column, names)[:3])
        return [("time_column", f"{column!r} is not among `names`; the nearest are {near}")]
    if isinstance(column, int) and column > len(names):
        return [("time_column", f"is {column}, but there are {len(names)} names")]
    return []


def column_named(names: Sequence[str], wanted: str | int) -> int | None:
    """Return the index of a column by its name or its number from 1; None if there is none or more than one."""
    if isinstance(wanted, int):
        return wanted - 1 if wanted <= len(names) else None
    return names.index(wanted) if names.count(wanted) == 1 else None
