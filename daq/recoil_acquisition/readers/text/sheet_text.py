"""A workbook's sheet (Office Open XML, ``.xlsx``) as text, one line per row, cells parted by tabs.

A workbook is a ZIP archive of XML (ECMA-376, parts 1 and 2), which a small file can inflate without bound: its
parts' sizes are checked before anything is read, XML that declares entities is refused, and rows and cells are
counted while they are read.
"""

from __future__ import annotations

import datetime as dt
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.packages.extras import XLSX
from recoil_acquisition.readers.text.cells import groups_thousands

MOST_ROWS = 1_048_576
"""Rows of a sheet, by the format."""

MOST_COLUMNS = 16_384
"""Columns of a sheet, by the format."""

MOST_BYTES = 1 << 28
"""Bytes of all parts of a workbook, inflated."""

MOST_TIMES = 100
"""Ratio by which a part of more than `SMALL_BYTES` may be larger than it is packed: numbers pack 4 to 12 times."""

SMALL_BYTES = 1 << 20
_FORBIDDEN = (b"<!DOCTYPE", b"<!ENTITY")


@dataclass(frozen=True)
class Sheet:
    """One sheet of a workbook.

    Attributes
    ----------
    text
        Rows from the first one on, each with its line end; cells without a value are empty.
    """

    name: str
    text: str


def is_workbook(head: bytes) -> bool:
    """Return whether a file's first bytes are those of a workbook."""
    return head.startswith(b"PK\x03\x04") and (b"xl/" in head or b"[Content_Types].xml" in head[:512])


def read_sheets(path: Path) -> tuple[Sheet, ...]:
    """Read the sheets of a workbook that hold any value.

    Raises
    ------
    ReadError
        If the library for workbooks is missing, or the workbook is larger than its limits.
    CorruptFileError
        If it is damaged.
    """
    XLSX.check(path)
    import openpyxl

    try:
        most_cells = _check_archive(path)
        # by its content: the library refuses a path whose ending is not a workbook's
        with path.open("rb") as stream, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about styles and extensions, which carry no value
            book = openpyxl.load_workbook(stream, read_only=True, data_only=True, keep_links=False)
            try:
                sheets, cells = [], Cells(most_cells)
                for sheet in book.worksheets:
                    text = "".join(_lines(sheet, path, cells))
                    if text.strip():
                        sheets.append(Sheet(str(sheet.title), text))
            finally:
                book.close()
    except ReadError:
        raise
    except FileNotFoundError as error:
        raise ReadError("no such file", path=path, remedy="check the name and the folder") from error
    except Exception as error:  # whatever ZIP, XML and the library meet in a damaged file
        raise CorruptFileError(
            f"is not a readable workbook: {type(error).__name__} {str(error)[:80]}".rstrip(),
            path=path,
            remedy="save it again",
        ) from error
    if not sheets:
        raise CorruptFileError("the workbook holds no values", path=path, remedy="export it again")
    return tuple(sheets)


def _check_archive(path: Path) -> int:
    """Check the sizes of a workbook's parts and its XML; return the number of cells that it can hold."""
    with zipfile.ZipFile(path) as archive:
        parts = archive.infolist()
        total = sum(part.file_size for part in parts)
        swollen = [p for p in parts if p.file_size > max(SMALL_BYTES, MOST_TIMES * p.compress_size)]
        if total > MOST_BYTES or swollen:
            raise ReadError(
                "the workbook inflates beyond what is read",
                path=path,
                place=swollen[0].filename if swollen else None,
                expected=f"at most {MOST_BYTES} bytes, and {MOST_TIMES} times what is packed",
                found=f"{swollen[0].file_size if swollen else total} bytes",
                remedy="export as text",
            )
        for part in parts:
            if part.filename.casefold().endswith((".xml", ".rels")):
                _check_xml(archive, part, path)
    return total


def _check_xml(archive: zipfile.ZipFile, part: zipfile.ZipInfo, path: Path) -> None:
    """Refuse XML that declares a document type or entities, or hides them in another encoding."""
    with archive.open(part) as stream:
        kept = b""
        while chunk := stream.read(1 << 16):
            kept = kept[-16:] + chunk
            if any(word in kept.upper() for word in _FORBIDDEN) or b"\0" in chunk:
                raise ReadError(
                    "the workbook's XML declares entities or is not UTF-8",
                    path=path,
                    place=part.filename,
                    remedy="save it again with the spreadsheet program",
                )


@dataclass
class Cells:
    """Cells of a book that were read, of all its sheets: several may be one part of the file."""

    most: int
    read: int = 0


def _lines(sheet: Any, path: Path, cells: Cells) -> Iterator[str]:
    """Yield a sheet's rows as lines."""
    # the size that the sheet states of itself would make every row as wide
    sheet.reset_dimensions()
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        cells.read += len(row) + 1
        if number > MOST_ROWS or len(row) > MOST_COLUMNS or cells.read > cells.most:
            raise ReadError(
                "its sheets have more cells than the file can hold",
                path=path,
                place=f"sheet {sheet.title!r}, row {number}",
                expected=f"at most {min(cells.most, MOST_ROWS * MOST_COLUMNS)}",
                remedy="export as text",
            )
        texts = [_text(value) for value in row]
        while texts and not texts[-1]:
            texts.pop()
        yield "\t".join(texts) + "\n"


def _text(value: object) -> str:
    """Write one value; numbers so that they read back exactly."""
    if value is None:
        return ""
    if isinstance(value, float):
        text = repr(value)
        # a number is no text whose mark may set thousands apart
        return f"{text}e0" if groups_thousands(text) else text
    if isinstance(value, dt.datetime | dt.date | dt.time):
        return value.isoformat()
    return " ".join(str(value).split())
