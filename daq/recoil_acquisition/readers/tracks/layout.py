"""The layout of a table of tracks, as a rig declares it where a camera's files do not state it themselves.

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
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from recoil_acquisition.declaration import DeclaredTable
from recoil_acquisition.quantity import find_unit
from recoil_acquisition.readers.text.cells import is_number
from recoil_acquisition.readers.time.time_units import TIME_UNITS_S

SEPARATOR_NAMES = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";"}
PIXELS = ("px", "pixel", "pixels")
"""Spellings of pixels, in any case."""
MOST_FEATURES = 1000


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


Heading = Annotated[str, AfterValidator(str.strip), Field(min_length=1)]
ColumnChoice = Heading | Annotated[int, Field(ge=1, le=16_384)]
"""A heading, or the number of a column from 1."""
Row = Annotated[int, Field(ge=1, le=10_000)]
_COLUMN = "a heading, or the number of a column from 1"
_ROW = "the number of a line, from 1 to 10000"


class DeclaredFeature(DeclaredTable):
    """One feature: its name, and the columns that it has."""

    name: Annotated[str, AfterValidator(str.strip), Field(min_length=1)] = Field(description="the feature's name")
    """As it is in signals, ``name - X``."""
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
    """What was tracked."""
    separator: Annotated[str, AfterValidator(_separator)] = ","
    """One character; a space stands for any number of them."""
    decimal: Annotated[str, Field(pattern=r"^[.,]$")] = Field(default=".", description="'.' or ','")
    """The decimal mark."""
    thousands: Annotated[str, Field(pattern=r"^[.,' ]?$")] | None = Field(
        default=None, description="'' or what sets thousands apart: one of . , ' and a space"
    )
    """If it is left out, a table in which a mark may be either is refused; an empty one says that it marks decimals."""
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
    """Beside empty cells and NaN."""

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

    def contradictions(self) -> list[tuple[str, str]]:
        """Return the faults between keys that are sound alone."""
        wrong = []
        if self.decimal == self.separator:
            wrong.append(("decimal", "is the separator too"))
        others = {self.separator: "separator", self.decimal: "decimal mark"}
        if self.thousands in others:
            wrong.append(("thousands", f"is the {others[self.thousands]} too"))
        if self.header_row is not None and self.first_line <= self.header_row:
            wrong.append(("first_row", f"{self.first_row} is not below header_row {self.header_row}"))
        columns = {"frame_column": self.frame_column, "time_column": self.time_column}
        for i, feature in enumerate(self.features):
            own = {f"features[{i}].{key}": getattr(feature, key) for key in ("x", "y", "angle")}
            if all(choice is None for choice in own.values()):
                wrong.append((f"features[{i}]", "names no column: x, y or angle is needed"))
            columns |= own
        if self.header_row is None:
            named = [key for key, choice in columns.items() if isinstance(choice, str)]
            wrong += [(key, "names a heading, so `header_row` is needed") for key in named]
        names = [feature.name for feature in self.features]
        doubled = [name for name in dict.fromkeys(names) if names.count(name) > 1]
        return wrong + [("features", f"the name {name!r} is there twice") for name in doubled]
