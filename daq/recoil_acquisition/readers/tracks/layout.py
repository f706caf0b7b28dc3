"""The layout of a table of tracks: as a rig declares it, and the formats that a text shows by itself.

A rig declares it where a camera's files do not state it themselves:

::

    [source.layout]
    separator = ";"            # one of  , ; tab space  or any one character; , if left out
    decimal = ","              # . if left out
    header_row = 3             # the line of the headings, from 1; needed where columns are named
    first_row = 5              # the line of the first numbers; the one below the headings if left out
    frame_column = "Bild"      # a heading, or the column's number from 1
    time_column = 2
    time_unit = "ms"           # s if left out
    features = [{ name = "Muzzle", x = "MX", y = "MY", angle = "MA" }]
    unit = "mm"                # of x and y
    angle_unit = "deg"
    lost = ["n/a", -1, 9999]   # what stands for a lost position, beside empty cells and NaN

A format is known by the first lines of a text, never by its name. DeepLabCut writes ``scorer`` into the first cell;
DLTdv and Argus name every column after point and camera (``pt1_cam1_X``, ``Track 1_cam_1_x``); SLEAP has a column
``frame_idx`` beside ``<node>.x``; Tracker writes one row of names, or ``#multi:`` and one, over a row that begins with
``t``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from recoil_acquisition.errors import Fault, FaultCode, KeyPath
from recoil_acquisition.quantities.declaration import DeclaredTable
from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.text.cells import SEPARATORS, is_number, split_cells
from recoil_acquisition.readers.text_file import LongText, TextFile, one_line_end
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S

POINT_COLUMN = re.compile(r"(?P<feature>.+_cam_?\d+)_(?P<axis>[xy])", re.IGNORECASE)
"""Pattern of the name of a column of DLTdv or Argus."""

MULTI = "#multi:"
"""First line of Tracker's export of several tracks."""

PART_BYTES = 1 << 20
"""Bytes of a text whose cells are parted by spaces that are held as lines at a time."""

_WIDE = re.compile(r" {2,}")
_WIDE_BYTES = re.compile(rb" {2,}")

SEPARATOR_NAMES = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";"}
PIXELS = ("px", "pixel", "pixels")
"""Spellings of pixels, in any case."""
MOST_FEATURES = 1000
Heading = Annotated[str, AfterValidator(str.strip), Field(min_length=1)]
ColumnChoice = Heading | Annotated[int, Field(ge=1, le=16_384)]
"""A heading, or the number of a column from 1."""
Row = Annotated[int, Field(ge=1, le=10_000)]
_COLUMN = "a heading, or the number of a column from 1"
_ROW = "the number of a line, from 1 to 10000"


def spread(line: str) -> str:
    """Return a line of Tracker's with a tab where several spaces part its cells; one with separators as it is."""
    return line if "\t" in line or ";" in line else _WIDE.sub("\t", line.strip(" "))


def spread_text(file: LongText) -> TextFile:
    """Return a text with each of its lines `spread`; it is taken part by part, since many lines are large as such.

    Raises
    ------
    ReadError
        If it cannot be read any more.
    """
    parts, at = [], 0
    while at < file.size:
        part = file.read(at, min(at + PART_BYTES, file.size))
        if at + len(part) < file.size:
            part = part[: part.rfind(file.line_end) + 1] or part
        at += len(part)
        part = one_line_end(part)
        if b"\t" in part or b";" in part:
            lines = part.decode(file.encoding, errors="replace").split("\n")
            parts.append("\n".join(map(spread, lines)).encode())
            continue
        part = _WIDE_BYTES.sub(b"\t", part.strip(b" "))
        for end in (b"\t\n", b" \n", b"\n\t", b"\n "):
            part = part.replace(end, b"\n")
        parts.append(part.decode(file.encoding, errors="replace").encode())
    return TextFile(file.path, b"".join(parts), "utf-8", file.cut)


def tracker_header(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the row of Tracker's variables, which begins with ``t``, and its separator; None if there is none."""
    row = 2 if lines and lines[0].strip().casefold() == MULTI else 1
    if len(lines) < row + 2:
        return None
    for separator in SEPARATORS:
        over, names, first = (split_cells(spread(line), separator) for line in lines[row - 1 : row + 2])
        while names and not names[-1]:
            names.pop()
        named = any(over) and (not over[0] if row == 2 else len([c for c in over if c]) == 1)
        if len(names) > 1 and all(names) and names[0] == "t" and named and is_number(first[0]):
            return row, separator
    return None


def first_cells(head: Head) -> Iterator[list[str]]:
    """Yield the cells of a file's first line, by each separator that parts it."""
    return (cells for separator in SEPARATORS if len(cells := split_cells(head.lines[0], separator)) > 1)


def _separator(value: str) -> str:
    named = SEPARATOR_NAMES.get(value.casefold(), value)
    if len(named) != 1 or named.isalnum() or named in '.+-"\r\n':
        raise ValueError(f"must be one of {', '.join(SEPARATOR_NAMES)}, or one character such as ';'")
    return named


def _unit_of(quantity: str, known: str) -> AfterValidator:
    def check(text: str) -> str:
        text = text.strip()
        unit = find_unit(text) if text else None
        is_pixels = quantity == "displacement" and text.casefold() in PIXELS
        if text and not is_pixels and (unit is None or quantity not in unit.quantities):
            raise ValueError(f"must be a unit of {quantity}: {known}")
        return text

    return AfterValidator(check)


def _time_unit(text: str) -> str:
    if text.strip().casefold() not in TIME_UNITS_S:
        raise ValueError(f"must be one of {', '.join(TIME_UNITS_S)}")
    return text.strip()


def _alone_or_listed(value: Any) -> Any:
    return value if isinstance(value, list | tuple) else [value]


class DeclaredFeature(DeclaredTable):
    """One feature: its name, and the columns that it has."""

    name: Annotated[str, AfterValidator(str.strip), Field(min_length=1)] = Field(description="the feature's name")
    """Signals are named after it, ``name x``, ``name y`` and ``name angle``."""
    x: ColumnChoice | None = Field(default=None, description=_COLUMN)
    """Column of x."""
    y: ColumnChoice | None = Field(default=None, description=_COLUMN)
    """Column of y."""
    angle: ColumnChoice | None = Field(default=None, description=_COLUMN)
    """Column of the angle."""


class TrackLayout(DeclaredTable):
    """Layout of a table of tracks."""

    features: Annotated[tuple[DeclaredFeature, ...], Field(strict=False, min_length=1, max_length=MOST_FEATURES)] = (
        Field(description='a list such as [{ name = "Muzzle", x = "X", y = "Y" }]')
    )
    """Features that were tracked."""
    separator: Annotated[str, AfterValidator(_separator)] = ","
    """Sign between two cells; a space stands for any number of them."""
    decimal: Annotated[str, Field(pattern=r"^[.,]$")] = Field(default=".", description="'.' or ','")
    """The decimal mark."""
    thousands: Annotated[str, Field(pattern=r"^[.,' ]?$")] | None = Field(
        default=None, description="what sets thousands apart: '.', ',', an apostrophe, a space, or '' for nothing"
    )
    """Tables without it are refused in which a mark may either set thousands apart or be the decimal mark."""
    header_row: Row | None = Field(default=None, description=_ROW)
    """Line of the headings."""
    first_row: Row | None = Field(default=None, description=_ROW)
    """Line of the first numbers; the one below the headings if left out."""
    frame_column: ColumnChoice | None = Field(default=None, description=_COLUMN)
    """Column of the frames' numbers."""
    time_column: ColumnChoice | None = Field(default=None, description=_COLUMN)
    """Column of time; without it frames are dated by ``frame_rate``."""
    time_unit: Annotated[str, AfterValidator(_time_unit)] = "s"
    """Unit of the column of time."""
    unit: Annotated[str, _unit_of("displacement", "px, mm, cm, m, in, ft")] = ""
    """Unit of x and y; an empty one leaves it to the rig's channel."""
    angle_unit: Annotated[str, _unit_of("angle", "deg, rad")] = ""
    """Unit of the angles."""
    lost: Annotated[tuple[str | float, ...], BeforeValidator(_alone_or_listed), Field(strict=False)] = Field(
        default=(), description="texts and numbers that stand for a lost position"
    )
    """Empty cells and NaN are lost in any case."""

    @property
    def first_line(self) -> int:
        """Line of the first numbers, from 1."""
        return self.first_row or (self.header_row or 0) + 1

    @property
    def lost_texts(self) -> tuple[str, ...]:
        """Texts of lost cells, case folded."""
        return tuple(one.strip().casefold() for one in self.lost if isinstance(one, str))

    @property
    def lost_values(self) -> tuple[float, ...]:
        """Numbers of lost cells."""
        numbers = (one for one in self.lost if not isinstance(one, str) or is_number(one.strip()))
        return tuple(float(one.strip().replace(",", ".")) if isinstance(one, str) else one for one in numbers)

    def contradictions(self) -> list[Fault]:
        """Return the faults between keys that are sound alone."""
        wrong: list[tuple[KeyPath, str]] = []
        if self.decimal == self.separator:
            wrong.append((("decimal",), "is the separator too"))
        others = {self.separator: "separator", self.decimal: "decimal mark"}
        if self.thousands in others:
            wrong.append((("thousands",), f"is the {others[self.thousands]} too"))
        if self.header_row is not None and self.first_line <= self.header_row:
            wrong.append((("first_row",), f"{self.first_row} is not below header_row {self.header_row}"))
        columns: dict[KeyPath, Any] = {("frame_column",): self.frame_column, ("time_column",): self.time_column}
        for i, feature in enumerate(self.features):
            own: dict[KeyPath, Any] = {("features", i, key): getattr(feature, key) for key in ("x", "y", "angle")}
            if all(choice is None for choice in own.values()):
                wrong.append((("features", i), "names no column: x, y or angle is needed"))
            columns |= own
        if self.header_row is None:
            named = [key for key, choice in columns.items() if isinstance(choice, str)]
            wrong += [(key, "names a heading, so `header_row` is needed") for key in named]
        names = [feature.name for feature in self.features]
        doubled = [name for name in dict.fromkeys(names) if names.count(name) > 1]
        wrong += [(("features",), f"the name {name!r} is there twice") for name in doubled]
        return [Fault(key, problem, FaultCode.CONTRADICTION) for key, problem in wrong]
