"""Meaning of the columns of a tracking export: frame, time, coordinates of features, or derived.

The wording of headings is not standardised, so they are classified by their words: ``Frame``,
``Frame No``, ``Time (s)``, ``Feature #1 - X (mm)``, ``HIP_X``, ``x``. Where no word says it, as in another
language, and without headings the numbers decide: whole numbers that increase are frames, what increases steadily
with them is time.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.row_counter import whole
from recoil_acquisition.readers.text.cells import split_unit
from recoil_acquisition.readers.time.time_units import time_unit_s

AXES = ("x", "y", "z")
LOST_MARKERS = frozenset({0.0, -1.0})
"""Coordinates by which trackers commonly mark a position that they lost."""
UNNAMED = "column {}"
"""Name of a column without a heading."""
_FEWEST_COUNTED, _MOSTLY, _NEARLY_ALL = 5, 0.5, 0.9
"""Rows from which on numbers are seen to count, and shares of their steps."""
_SAME_RATE = 0.01
"""Relative difference from the declared frame rate within which numbers without a unit are times."""
_DERIVED = re.compile(r"vel|speed|acc|ang|theta|rot|dist|likelihood|score")
_RATE = re.compile(r"vel|speed|acc|rate")
_ANGLE_WORDS = ("ang", "angle", "theta", "rotation", "orientation")
_TIME_WORDS = {"t", "time", "sec", "secs", "seconds"}
_UNIT_CELL = re.compile(
    r"[(\[]?(px|pix|pixels?|mm|cm|m|in|inch|ft|s|sec|ms|deg|rad|mm/s|m/s|mm/s2|m/s2|m/s\^2)[)\]]?", re.IGNORECASE
)


@dataclass(frozen=True)
class Column:
    """One column of a tracking export.

    Attributes
    ----------
    kind
        Kind of its content: ``frame``, ``time``, ``position``, ``angle``, ``score`` (how sure the tracking is),
        ``derived`` or ``text``.
    name
        Heading of the column without the unit.
    unit
        Unit as the file spells it; empty if it states none.
    feature
        Name of the feature whose coordinate, angle or score it is; may be empty.
    axis
        Axis of a position: ``X``, ``Y`` or ``Z``.
    """

    kind: str
    name: str
    unit: str
    feature: str = ""
    axis: str = ""


def classify(heading: str, unit: str = "") -> Column:
    """Classify one heading by its words; ``unit`` is from a row of units, where there is one."""
    name, stated = split_unit(heading)
    unit = stated or unit
    words = [w for w in re.split(r"[^0-9a-z]+", name.casefold()) if w]
    if words and (words[0].startswith("frame") or words[-1].startswith("frame")):
        return Column("frame", name, unit)
    if words and (words[0] in _TIME_WORDS or words[-1] == "time"):
        return Column("time", name, unit)
    if words and words[-1] in AXES and not any(_DERIVED.match(w) for w in words):
        feature = name[: name.casefold().rindex(words[-1])].rstrip(" -_.:,/")
        return Column("position", name, unit, feature, words[-1].upper())
    if words and words[-1] in _ANGLE_WORDS and not any(_RATE.match(w) for w in words):
        feature = name[: name.casefold().rindex(words[-1])].rstrip(" -_.:,/")
        return Column("angle", name, unit, feature)
    return Column("derived", name, unit)


def without_text(columns: Sequence[Column], text_columns: Collection[int]) -> tuple[Column, ...]:
    """Return columns of which those that hold text are of the kind ``text``; a frame or a time is never text."""
    return tuple(
        replace(column, kind="text") if i in text_columns and column.kind not in ("frame", "time") else column
        for i, column in enumerate(columns)
    )


def columns_from_headings(rows: Sequence[Sequence[str]], width: int) -> tuple[Column, ...] | None:
    """Classify the columns by the header rows above the numbers.

    Parameters
    ----------
    rows
        Cells of the header's last rows, from top to bottom.
    width
        Number of columns of numbers.

    Returns
    -------
    tuple of Column or None
        Columns by their headings; None if no row is as wide as the numbers, so that there are none.
    """
    fitting = []
    for row in reversed(rows):
        cells = [*row, *[""] * max(0, width - len(row))]
        if len(row) < 2 or any(cells[width:]) or not any(re.search(r"[^\W\d_]", cell) for cell in cells):
            break
        fitting.append(cells[:width])
    if not fitting:
        return None
    units = [""] * width
    if len(fitting) > 1 and all(not cell or _UNIT_CELL.fullmatch(cell) for cell in fitting[0]):
        units = [cell.strip("()[] ") for cell in fitting.pop(0)]
    names = fitting[0]
    if len(fitting) > 1 and _is_upper_row(fitting[1], names):
        names = _joined(fitting[1], names)
    columns = [classify(name, unit) for name, unit in zip(names, units, strict=True)]
    return tuple(
        column if column.name else replace(column, name=UNNAMED.format(i + 1)) for i, column in enumerate(columns)
    )


def _is_upper_row(upper: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether a row names features over a row of bare axes."""
    bare = [classify(name).kind == "position" and not classify(name).feature for name in names]
    return any(bare) and any(cell for cell, is_bare in zip(upper, bare, strict=True) if is_bare)


def _joined(upper: Sequence[str], names: Sequence[str]) -> list[str]:
    """Join feature names, merged over several cells, with the axes below them."""
    feature, joined = "", []
    for over, name in zip(upper, names, strict=True):
        feature = over or feature
        column = classify(name)
        joined.append(f"{feature} - {name}" if feature and column.kind in ("position", "angle", "derived") else name)
    return joined


def found_by_numbers(
    columns: Sequence[Column], values: NDArray[np.float64], declared_hz: float | None
) -> tuple[Column, ...]:
    """Find frames and times, where no heading names them, among the columns that no heading explains.

    Frames are whole numbers that increase, mostly by one step; among several those that skip some, for the others may
    number the rows, and one with a heading before one without. Those that begin anew are taken for frames, too: tracks
    that follow each other are none of one clip. Times increase, and are in a unit of time; without a unit they increase
    steadily with the frames, at the declared rate, and stand before the coordinates.

    Parameters
    ----------
    values : ndarray of float64, shape (n_rows, n_columns)
    declared_hz
        Frame rate that the rig declares, Hz; None if it declares none.
    """
    found = list(columns)
    kinds = [column.kind for column in columns]
    open_ones = [
        i for i, kind in enumerate(kinds) if kind == "derived" and not _DERIVED.match(columns[i].name.casefold())
    ]
    if "frame" not in kinds:
        counting = [i for i in open_ones if not columns[i].unit and _counts(values[:, i])]
        at = min(
            counting,
            key=lambda i: (columns[i].name == UNNAMED.format(i + 1), _is_row_number(values[:, i])),
            default=None,
        )
        if at is not None:
            found[at] = replace(columns[at], kind="frame")
    if "time" not in kinds:
        at = next((i for i, column in enumerate(found) if column.kind == "frame"), None)
        first = next((i for i, kind in enumerate(kinds) if kind in ("position", "angle")), len(kinds))
        for i in open_ones:
            if i == at or (i > first and not columns[i].unit):
                continue
            if _is_time(columns[i].unit, values[:, i], None if at is None else values[:, at], declared_hz):
                found[i] = replace(columns[i], kind="time")
    return tuple(found)


def _counts(numbers: NDArray[np.float64]) -> bool:
    """Return whether whole numbers count: most steps are the least of them; where they begin anew, nearly all are 1."""
    steps = np.diff(numbers)
    if numbers.size < _FEWEST_COUNTED or not whole(numbers).all() or not steps.all():
        return False
    least = steps.min()
    share = np.mean(steps == max(least, 1.0))
    return bool(share >= (_MOSTLY if least > 0 else _NEARLY_ALL))


def _is_row_number(numbers: NDArray[np.float64]) -> bool:
    """Return whether numbers go on by one from row to row."""
    return bool((np.diff(numbers) == 1).all())


def _is_time(
    unit: str, numbers: NDArray[np.float64], frames: NDArray[np.float64] | None, declared_hz: float | None
) -> bool:
    """Return whether numbers are times: by their unit, or as steady as the frames at the declared rate."""
    steps = np.diff(numbers)
    if unit:
        return time_unit_s(unit) is not None and bool(steps.size and (steps >= 0).all() and steps.any())
    if declared_hz is None or not _steady(numbers, frames):
        return False
    counted = float(numbers.size - 1 if frames is None else frames[-1] - frames[0])
    step = float(numbers[-1] - numbers[0]) / counted
    return any(abs(step * unit_s * declared_hz - 1.0) < _SAME_RATE for unit_s in (1.0, 1e-3, 1e-6))


def columns_from_numbers(values: NDArray[np.float64]) -> tuple[Column, ...]:
    """Classify the columns of a file without headings.

    Parameters
    ----------
    values : ndarray of float64, shape (n_rows, n_columns)

    Returns
    -------
    tuple of Column
        Columns: the first is the frame if it holds increasing whole numbers; the next is time if it increases steadily;
        the others are X and Y of ``feature1``, ``feature2`` ...
    """
    columns: list[Column] = []
    if values.shape[1] > 2 and increasing_whole(values[:, 0]):
        columns.append(Column("frame", "Frame", ""))
    at = len(columns)
    if values.shape[1] - at > 1 and _steady(values[:, at], values[:, 0] if columns else None):
        columns.append(Column("time", "Time", ""))
    for i in range(values.shape[1] - len(columns)):
        feature, axis = f"feature{i // 2 + 1}", "XY"[i % 2]
        columns.append(Column("position", f"{feature} {axis}", "", feature, axis))
    return tuple(columns)


def increasing_whole(numbers: NDArray[np.float64]) -> bool:
    """Return whether numbers are whole, below 2**53 and increase strictly."""
    return bool(whole(numbers).all() and (np.diff(numbers) > 0).all())


def _steady(numbers: NDArray[np.float64], frames: NDArray[np.float64] | None) -> bool:
    """Return whether numbers increase by a nearly constant step per frame."""
    steps = np.diff(numbers)
    if numbers.size < 3 or not np.isfinite(steps).all() or not (steps > 0).all():
        return False
    per_frame = steps if frames is None else steps / np.diff(frames)
    return bool(np.abs(per_frame / np.median(per_frame) - 1).max() < 0.1)
