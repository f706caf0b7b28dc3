"""The layout of a table of tracks, as a rig declares it where a camera's files do not tell it themselves.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from recoil_acquisition.quantity import find_unit
from recoil_acquisition.readers.text.cells import is_number
from recoil_acquisition.readers.tracks.frame_time import TIME_UNITS_S

SEPARATOR_NAMES = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";"}
PIXELS = ("px", "pixel", "pixels")
KEYS = (
    "separator",
    "decimal",
    "header_row",
    "first_row",
    "frame_column",
    "time_column",
    "time_unit",
    "features",
    "unit",
    "angle_unit",
    "lost",
)
FEATURE_KEYS = ("name", "x", "y", "angle")
MOST_FEATURES = 1000

ColumnChoice = str | int
"""A heading, or the number of a column from 1."""


class LayoutError(ValueError):
    """A declared layout is at fault.

    Attributes
    ----------
    faults : tuple of str
        Every fault, each with its key.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(faults))


@dataclass(frozen=True)
class DeclaredFeature:
    """One feature: its name, and the columns that it has.

    Attributes
    ----------
    name : str
    x, y, angle : str, int or None
    """

    name: str
    x: ColumnChoice | None = None
    y: ColumnChoice | None = None
    angle: ColumnChoice | None = None


@dataclass(frozen=True)
class TrackLayout:
    """Layout of a table of tracks.

    Attributes
    ----------
    features : tuple of DeclaredFeature
    separator : str
        One character; a space stands for any number of them.
    decimal : str
    header_row : int or None
        Line of the headings, from 1.
    first_row : int
        Line of the first numbers, from 1.
    frame_column, time_column : str, int or None
    time_unit, unit, angle_unit : str
        An empty `unit` or `angle_unit` leaves it to the rig's channel.
    lost : tuple of str
        Texts of lost cells, case folded.
    lost_values : tuple of float
        Numbers of lost cells.
    """

    features: tuple[DeclaredFeature, ...]
    separator: str = ","
    decimal: str = "."
    header_row: int | None = None
    first_row: int = 1
    frame_column: ColumnChoice | None = None
    time_column: ColumnChoice | None = None
    time_unit: str = "s"
    unit: str = ""
    angle_unit: str = ""
    lost: tuple[str, ...] = ()
    lost_values: tuple[float, ...] = ()

    @classmethod
    def from_mapping(cls, declared: Mapping[str, Any]) -> TrackLayout:
        """Read a layout from the table of a rig file.

        Raises
        ------
        LayoutError
            With every fault: its key, what is wrong, and the nearest known key.
        """
        faults = [_unknown(key, KEYS, "") for key in declared if key not in KEYS]
        separator = _separator(declared.get("separator", ","), faults)
        decimal = declared.get("decimal", ".")
        if decimal not in (".", ","):
            faults.append(f"decimal: {decimal!r} is neither '.' nor ','")
        elif decimal == separator:
            faults.append("decimal: is the separator too")
        header_row, first_row = (_row(declared, key, faults) for key in ("header_row", "first_row"))
        if header_row is not None and first_row is not None and first_row <= header_row:
            faults.append(f"first_row: {first_row} is not below header_row {header_row}")
        features = _features(declared.get("features"), faults)
        choices = {f"features[{i}].{k}": getattr(f, k) for i, f in enumerate(features) for k in FEATURE_KEYS[1:]}
        for key in ("frame_column", "time_column"):
            choices[key] = _choice(declared.get(key), key, faults)
        if header_row is None:
            faults += [
                f"{k}: names a heading, so `header_row` is needed" for k, c in choices.items() if isinstance(c, str)
            ]
        units = {
            "time_unit": _text(declared, "time_unit", "s", faults),
            "unit": _text(declared, "unit", "", faults),
            "angle_unit": _text(declared, "angle_unit", "", faults),
        }
        _check_units(units, faults)
        lost, lost_values = _lost(declared.get("lost", []), faults)
        if faults:
            raise LayoutError(faults)
        return cls(
            features=features,
            separator=separator,
            decimal=str(decimal),
            header_row=header_row,
            first_row=first_row or (header_row or 0) + 1,
            frame_column=choices["frame_column"],
            time_column=choices["time_column"],
            lost=lost,
            lost_values=lost_values,
            **units,
        )


def _unknown(key: object, known: Sequence[str], prefix: str) -> str:
    near = get_close_matches(str(key), known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
    return f"{prefix}{key}: unknown key, {hint}"


def _separator(value: object, faults: list[str]) -> str:
    named = SEPARATOR_NAMES.get(value.casefold(), value) if isinstance(value, str) else value
    if not isinstance(named, str) or len(named) != 1 or named.isalnum() or named in '.+-"\r\n':
        faults.append(
            f"separator: {value!r} is no separator: {', '.join(SEPARATOR_NAMES)} or one character such as ';'"
        )
        return ","
    return named


def _row(declared: Mapping[str, Any], key: str, faults: list[str]) -> int | None:
    value = declared.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 10_000:
        faults.append(f"{key}: {value!r} is no number of a line from 1 to 10000")
        return None
    return value


def _choice(value: object, key: str, faults: list[str]) -> ColumnChoice | None:
    if value is None or (isinstance(value, str) and value.strip()):
        return value if value is None else str(value).strip()
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 16_384:
        faults.append(f"{key}: {value!r} is neither a heading nor the number of a column, from 1")
        return None
    return value


def _text(declared: Mapping[str, Any], key: str, default: str, faults: list[str]) -> str:
    value = declared.get(key, default)
    if not isinstance(value, str):
        faults.append(f"{key}: {value!r} is no text")
        return default
    return value.strip()


def _features(value: object, faults: list[str]) -> tuple[DeclaredFeature, ...]:
    if not isinstance(value, list | tuple) or not value or len(value) > MOST_FEATURES:
        faults.append(
            f'features: a list such as [{{ name = "Muzzle", x = "X", y = "Y" }}] is needed, not {value!r:.60}'
        )
        return ()
    features = []
    for i, table in enumerate(value):
        key = f"features[{i}]"
        if not isinstance(table, Mapping):
            faults.append(f"{key}: is no table")
            continue
        faults += [_unknown(k, FEATURE_KEYS, f"{key}.") for k in table if k not in FEATURE_KEYS]
        name = table.get("name")
        if not isinstance(name, str) or not name.strip():
            faults.append(f"{key}.name: a text is needed")
            continue
        x, y, angle = (_choice(table.get(k), f"{key}.{k}", faults) for k in FEATURE_KEYS[1:])
        if x is None and y is None and angle is None:
            faults.append(f"{key}: names no column: x, y or angle is needed")
        features.append(DeclaredFeature(name.strip(), x, y, angle))
    names = [f.name for f in features]
    faults += [f"features: the name {n!r} is there twice" for n in dict.fromkeys(names) if names.count(n) > 1]
    return tuple(features)


def _check_units(units: Mapping[str, str], faults: list[str]) -> None:
    if units["time_unit"].casefold() not in TIME_UNITS_S:
        faults.append(f"time_unit: {units['time_unit']!r} is none of {', '.join(TIME_UNITS_S)}")
    for key, quantity, known in (
        ("unit", "displacement", "px, mm, cm, m, in, ft"),
        ("angle_unit", "angle", "deg, rad"),
    ):
        unit = find_unit(units[key]) if units[key] else None
        is_pixels = quantity == "displacement" and units[key].casefold() in PIXELS
        if units[key] and not is_pixels and (unit is None or quantity not in unit.quantities):
            faults.append(f"{key}: {units[key]!r} is no unit of {quantity}: {known}")


def _lost(value: object, faults: list[str]) -> tuple[tuple[str, ...], tuple[float, ...]]:
    texts, numbers = [], []
    for one in value if isinstance(value, list | tuple) else [value]:
        if isinstance(one, str):
            texts.append(one.strip().casefold())
            if is_number(one.strip()):
                numbers.append(float(one.strip().replace(",", ".")))
        elif isinstance(one, int | float) and not isinstance(one, bool):
            numbers.append(float(one))
        else:
            faults.append(f"lost: {one!r} is neither a text nor a number")
    return tuple(texts), tuple(numbers)
