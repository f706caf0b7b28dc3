"""A table as spreadsheets take it, as CSV text or as a workbook; no cell is a formula, whatever a file says."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import StoreError, visible
from recoil_acquisition.packages.extras import XLSX

if TYPE_CHECKING:
    import pandas as pd

FORMULA = ("=", "+", "-", "@", "\N{FULLWIDTH EQUALS SIGN}", "\N{FULLWIDTH PLUS SIGN}", "\N{FULLWIDTH HYPHEN-MINUS}",
           "\N{FULLWIDTH COMMERCIAL AT}")  # fmt: skip
"""Beginnings of a text that a spreadsheet takes for a formula, some of them behind blanks."""


def plain_cell(value: Any) -> Any:
    """Return a cell that no program takes for a formula, and in which no character is hidden; numbers stay numbers."""
    if not isinstance(value, str | dict | list):
        return value
    text = visible(str(value))
    return f"'{text}" if text.lstrip().startswith(FORMULA) else text


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV text; None is an empty cell, and bool ``true`` or ``false``."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(plain_cell, columns))
    for row in rows:
        writer.writerow([str(cell).lower() if isinstance(cell, bool) else plain_cell(cell) for cell in row])
    return text.getvalue()


def refuse_without_workbooks() -> None:
    """Raise a StoreError where no workbook can be written, because the extra ``xlsx`` is not installed."""
    if not XLSX.is_installed:
        raise StoreError("a workbook needs openpyxl", remedy=XLSX.remedy)


def write_workbook(path: Path, sheets: Mapping[str, pd.DataFrame], *, overwrite: bool = False) -> None:
    """Write tables into a workbook, a sheet each.

    Parameters
    ----------
    sheets
        Tables by the names of their sheets, in their order.

    Raises
    ------
    StoreError
        If the file exists, cannot be written, or openpyxl is not installed.
    """
    import pandas as pd

    if path.exists() and not overwrite:
        raise StoreError.exists(path, "overwrite=True", "the file")
    refuse_without_workbooks()
    import_module(XLSX.module)
    try:
        with pd.ExcelWriter(path, engine="openpyxl") as writer:
            for name, table in sheets.items():
                table.map(plain_cell).rename(columns=plain_cell).to_excel(writer, sheet_name=name, index=False)
    except OSError as error:
        raise StoreError(f"cannot be written: {error.strerror}", path=path) from error
