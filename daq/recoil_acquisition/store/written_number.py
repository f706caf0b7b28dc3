"""Numbers as people and spreadsheets write them: with a decimal point or a decimal comma, perhaps with thousands."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.store.spreadsheet import Line, Spreadsheet

_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}", re.ASCII)
"""Texts that may be a thousand and more, or a number with three decimals."""
_USUAL_MARK = {",": ".", ";": ",", "\t": ""}
"""Decimal mark of the locales whose spreadsheets write this separator; tabs are written everywhere."""


def decimal_mark(sheet: Spreadsheet, columns: Iterable[int]) -> str:
    """Return the decimal mark of a spreadsheet: what its numbers show, else its separator; empty if neither does.

    Parameters
    ----------
    columns
        Columns that hold numbers.
    """
    texts = [line.cells[at].text for line in sheet.lines for at in columns if at < len(line.cells)]
    clear = [text for text in texts if _NUMBER.fullmatch(text) and not _GROUPED.fullmatch(text)]
    shown = {mark for mark in ",." for text in clear if mark in text}
    if shown:
        return shown.pop() if len(shown) == 1 else ""
    return _USUAL_MARK[sheet.separator]


def number_in(sheet: Spreadsheet, line: Line, column: int, text: str, mark: str, *, negative: bool) -> float:
    """Read the number in a cell.

    Parameters
    ----------
    mark
        Decimal mark, as `decimal_mark` returns it.
    negative
        Whether it may be: a standard uncertainty may not.

    Raises
    ------
    ReadError
        If it is none, may be thousands or decimals, or is negative; with line and column.
    """
    value = written_number(text)
    if value is None:
        raise sheet.fault("no number", line, column, expected="a number, or nothing", found=repr(text[:40]))
    grouped = _GROUPED.fullmatch(text)
    if grouped is not None and grouped.group(1) != mark:
        remedy = "write it without its mark, or with another count of decimals"
        raise sheet.fault("may be thousands or decimals", line, column, found=repr(text), remedy=remedy)
    if not negative and value < 0.0:
        raise sheet.fault("a standard uncertainty is not negative", line, column, found=repr(text))
    return value


def number_to_write(path: Path, place: str, text: str, mark: str, *, negative: bool) -> str:
    """Return a number that a program or a command line gives, with a point or a comma, as a spreadsheet has it.

    Parameters
    ----------
    path, place
        File and place in it, for messages.
    mark, negative
        Decimal mark and sign, as for `number_in`.

    Raises
    ------
    StoreError
        If it is none, or as in `number_in`.
    """
    if not text:
        return text
    value = written_number(text)
    if value is None or (not negative and value < 0.0):
        raise StoreError(
            "no number" if value is None else "a standard uncertainty is not negative", path=path,
            place=place, expected="a number, or nothing", found=repr(text),
        )  # fmt: skip
    if mark != "," and "," in text and _GROUPED.fullmatch(text):
        raise StoreError(
            "may be thousands or decimals", path=path, place=place,
            found=repr(text), remedy="write it with a point, or without its comma",
        )  # fmt: skip
    written = text.replace(",", mark or ".").replace(".", mark or ".")
    # without a mark that is known, three decimals could be thousands
    return f"{written}0" if not mark and _GROUPED.fullmatch(written) else written


def written_number(text: str) -> float | None:
    """Read a number with a decimal point or a decimal comma; None if it is none, or is not finite."""
    text = text.strip()
    value = float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else math.inf
    return value if math.isfinite(value) else None
