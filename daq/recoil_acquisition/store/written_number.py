"""Numbers in the cells of a spreadsheet: with the decimal mark that its numbers show, perhaps with a unit."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.quantities.typed_quantity import (
    COMMA,
    POINT,
    NoNumberError,
    TypedError,
    number_and_unit,
    typed_quantity,
)
from recoil_acquisition.store.spreadsheet import Line, Spreadsheet

_USUAL_MARK = {",": POINT, ";": COMMA, "\t": ""}
"""Decimal mark of the locales whose spreadsheets write this separator; tabs are written everywhere."""
_MARKED = re.compile(r"[^.,]*([.,])[^.,]*", re.DOTALL)


def decimal_mark(sheet: Spreadsheet, columns: Iterable[int]) -> str:
    """Return the decimal mark of a spreadsheet: what its numbers show, else its separator; empty if neither does.

    Parameters
    ----------
    columns
        Columns that hold numbers.
    """
    texts = [line.cells[at].text for line in sheet.lines for at in columns if at < len(line.cells)]
    shown = {found[1] for text in texts if (found := _MARKED.fullmatch(text)) is not None and _is_clear(text)}
    if shown:
        return shown.pop() if len(shown) == 1 else ""
    return _USUAL_MARK[sheet.separator]


def _is_clear(text: str) -> bool:
    """Whether a text is a number whose mark can only be that of its decimals."""
    try:
        number_and_unit(text, "")
    except TypedError:
        return False
    return True


def number_in(sheet: Spreadsheet, line: Line, column: int, text: str, mark: str, unit: str, *, negative: bool) -> float:
    """Read the number in a cell.

    Parameters
    ----------
    mark
        Decimal mark, as `decimal_mark` returns it.
    unit
        Unit of the column.
    negative
        Whether it may be: a standard uncertainty may not.

    Raises
    ------
    ReadError
        If it is none, in no unit of the column's quantity, may be thousands or decimals, or is negative; with line and
        column.
    """
    try:
        value = typed_quantity(text, unit, mark, difference=not negative)
    except TypedError as error:
        raise sheet.fault(_problem(error), line, column, **_told(error, text)) from error
    if not negative and value < 0.0:
        raise sheet.fault("a standard uncertainty is not negative", line, column, found=repr(text))
    return value


def number_to_write(path: Path, place: str, text: str, mark: str, unit: str, *, negative: bool) -> tuple[str, float]:
    """Return a number that a program or a command line gives, as a spreadsheet has it, and its value.

    Parameters
    ----------
    path, place
        File and place in it, for messages.
    text
        Number with a point, or with a comma, perhaps with a unit.
    mark, unit, negative
        Decimal mark, unit and sign, as for `number_in`. A comma is a decimal one where the sheet has such.

    Raises
    ------
    StoreError
        If it is none, or as in `number_in`.
    """
    typed_mark = COMMA if mark == COMMA and COMMA in text else POINT
    try:
        value = typed_quantity(text, unit, typed_mark, difference=not negative)
        has_unit = bool(number_and_unit(text, typed_mark)[1])
    except TypedError as error:
        raise StoreError(_problem(error), path=path, place=place, **_told(error, text)) from error
    if not negative and value < 0.0:
        raise StoreError("a standard uncertainty is not negative", path=path, place=place, found=repr(text))
    written = (f"{value:.15g}" if has_unit else text).replace(COMMA, POINT)
    try:
        # without a mark that is known, three decimals could be thousands
        number_and_unit(written.replace(POINT, mark or POINT), mark)
    except TypedError:
        written += "0"
    return written.replace(POINT, mark or POINT), value


def _problem(error: TypedError) -> str:
    return "no number" if isinstance(error, NoNumberError) else error.problem


def _told(error: TypedError, text: str) -> dict[str, Any]:
    """Return what was expected and found in a cell, and the remedy."""
    return {"expected": "a number, or nothing", "found": repr(text[:40]), "remedy": error.remedy or None}
