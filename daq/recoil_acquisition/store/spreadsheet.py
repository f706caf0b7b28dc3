"""A table of text that spreadsheets write, changed cell by cell.

A spreadsheet writes a table in its own way: with commas, semicolons or tabs, in UTF-8, UTF-16 or the code page of its
system, with or without a byte order mark, quoting what it must or all. None of it is written down in the file. What is
found is kept: a change replaces the characters of one cell, and every other byte stays as it stands.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from recoil_acquisition.errors import ReadError, StoreError

LARGEST_BYTES = 2_000_000
"""Largest size of a file: some 10,000 rows of 200 characters."""
MOST_COLUMNS = 1000
SEPARATORS = (",", ";", "\t")

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_LINE_END = re.compile(r"\r\n|\r|\n")
_DECLARED = re.compile(r"sep=([,;\t])(?:\r\n|\r|\n)", re.IGNORECASE)


class Cell(NamedTuple):
    """One cell: its characters in the file from `start` to `stop`, and its text without quotes and outer blanks."""

    start: int
    stop: int
    text: str


class Line(NamedTuple):
    """One row: the number of the line it begins in, from 1; its cells; where it ends, before the line end."""

    number: int
    cells: tuple[Cell, ...]
    stop: int


@dataclass(frozen=True)
class Spreadsheet:
    """A table as a spreadsheet wrote it.

    Attributes
    ----------
    text
        Text of the whole file, without byte order mark.
    encoding, mark
        Encoding of the file's bytes, and the byte order mark before them.
    separator
        Character between cells.
    header
        The first line that is not blank.
    lines
        The lines below that are not blank: none has more cells than the header.
    """

    path: Path
    text: str
    encoding: str
    mark: bytes
    separator: str
    header: Line
    lines: tuple[Line, ...]

    @classmethod
    def of(cls, content: bytes, path: Path, key: str) -> Spreadsheet:
        """Take the content of a file that is a table with a column.

        Parameters
        ----------
        path
            Path of the file, for messages.
        key
            Name of that column, by which the separator is known.

        Raises
        ------
        ReadError
            If it is no text, or no such table; with line and column.
        """
        mark, encoding = next(((m, e) for m, e in _MARKS if content.startswith(m)), (b"", ""))
        text, encoding = _decoded(content[len(mark) :], encoding, path)
        return _parsed(text, encoding, mark, path, key)

    def content(self) -> bytes:
        """Return the bytes of the file.

        Raises
        ------
        StoreError
            If its encoding lacks a character that was put into it.
        """
        try:
            return self.mark + self.text.encode(self.encoding)
        except UnicodeEncodeError as error:
            raise StoreError(
                f"its encoding has no {error.object[error.start]!r}", path=self.path, expected=self.encoding,
                remedy="write it in other characters, or save the file as UTF-8 first",
            ) from error  # fmt: skip

    def names(self) -> tuple[str, ...]:
        """Return the names of the columns, empty where the header has none."""
        return tuple(cell.text for cell in self.header.cells)

    def with_cells(self, line: int, texts: Mapping[int, str]) -> Spreadsheet:
        """Replace cells of one line.

        Parameters
        ----------
        line
            Index into `lines`.
        texts
            Texts of the cells by the index of the column.
        """
        text, cells = self.text, self.lines[line].cells
        beyond = {column: one for column, one in texts.items() if column >= len(cells)}
        if beyond:
            added = "".join(
                self.separator + self._written(beyond.get(column, "")) for column in range(len(cells), max(beyond) + 1)
            )
            text = _replaced(text, self.lines[line].stop, self.lines[line].stop, added)
        for column in sorted(texts.keys() - beyond.keys(), reverse=True):
            if cells[column].text != texts[column].strip():
                text = _replaced(text, cells[column].start, cells[column].stop, self._written(texts[column]))
        return self._again(text)

    def with_lines(self, lines: Iterable[Sequence[str]]) -> Spreadsheet:
        """Add lines below all others, each with a text for each column."""
        found = _LINE_END.search(self.text)
        line_end = "\n" if found is None else found.group()
        added = [self.separator.join(map(self._written, texts)) + line_end for texts in lines]
        begun = "" if self.text.endswith(("\n", "\r")) or not added else line_end
        return self._again(self.text + begun + "".join(added))

    def with_column(self, name: str) -> Spreadsheet:
        """Add a column behind all others; other lines stay as they stand, and their cells of it are empty."""
        stop = self.header.stop
        return self._again(_replaced(self.text, stop, stop, self.separator + self._written(name)))

    def fault(self, problem: str, line: Line, column: int | None = None, **more: Any) -> ReadError:
        """Return an error that names line and column."""
        named = "" if column is None else f", column {self.names()[column] or column + 1}"
        return ReadError(problem, path=self.path, place=f"line {line.number}{named}", **more)

    def _written(self, text: str) -> str:
        if text != text.strip() or any(sign in text for sign in (self.separator, '"', "\r", "\n")):
            doubled = text.replace('"', '""')
            return f'"{doubled}"'
        return text

    def _again(self, text: str) -> Spreadsheet:
        return _table(text, self.encoding, self.mark, self.path, self.separator)


def _replaced(text: str, start: int, stop: int, by: str) -> str:
    return text[:start] + by + text[stop:]


def _decoded(content: bytes, encoding: str, path: Path) -> tuple[str, str]:
    """Decode as the mark says, else as UTF-8, else in the code page of western Windows."""
    for name in (encoding,) if encoding else ("utf-8", "cp1252"):
        try:
            text = content.decode(name)
            break
        except UnicodeDecodeError as error:
            failed = error
    else:
        line = content[: failed.start].count(b"\n") + 1
        raise ReadError(
            f"byte {content[failed.start]:#04x} is no character", path=path, place=f"line {line}",
            expected=f"text in {encoding or 'UTF-8'}", remedy="save it as CSV UTF-8",
        ) from failed  # fmt: skip
    if "\0" in text:
        line = len(_LINE_END.findall(text, 0, text.index("\0"))) + 1
        raise ReadError(
            "holds a zero byte", path=path, place=f"line {line}", expected="a table of text",
            found="a workbook" if text.startswith("PK") else None, remedy="save it as CSV UTF-8",
        )  # fmt: skip
    return text, name


def _parsed(text: str, encoding: str, mark: bytes, path: Path, key: str) -> Spreadsheet:
    declared = _DECLARED.match(text)
    if declared is not None:
        table = _table(text, encoding, mark, path, declared.group(1))
    else:
        tables = (_header(text, path, separator) for separator in SEPARATORS)
        found = [(line, separator) for line, separator in zip(tables, SEPARATORS, strict=True) if _has(line, key)]
        if not found:
            shown = next((line for line in text.splitlines() if line.strip()), "")
            raise ReadError(
                f"has no column `{key}`", path=path, place="line 1", found=repr(shown[:80]) if shown else "no text",
                expected="the names of the columns in its first line",
            )  # fmt: skip
        _, separator = max(found, key=lambda one: len(one[0].cells))
        table = _table(text, encoding, mark, path, separator)
    if not _has(table.header, key):
        raise table.fault(f"has no column `{key}`", table.header)
    return table


def _has(line: Line, key: str) -> bool:
    return any(cell.text.casefold() == key for cell in line.cells)


def _header(text: str, path: Path, separator: str) -> Line:
    return next(_lines(text, path, separator), Line(1, (), 0))


def _table(text: str, encoding: str, mark: bytes, path: Path, separator: str) -> Spreadsheet:
    lines = _lines(text, path, separator)
    header = next(lines, Line(1, (), 0))
    if len(header.cells) > MOST_COLUMNS:
        raise ReadError(
            "has too many columns", path=path, place=f"line {header.number}", expected=f"at most {MOST_COLUMNS}",
            found=str(len(header.cells)),
        )  # fmt: skip
    kept = []
    for line in lines:
        if len(line.cells) > len(header.cells):
            raise ReadError(
                "has more cells than there are columns", path=path, place=f"line {line.number}",
                expected=f"at most {len(header.cells)}", found=str(len(line.cells)),
                remedy="quote a text, or write a number, that holds the separator",
            )  # fmt: skip
        kept.append(line)
    return Spreadsheet(path, text, encoding, mark, separator, header, tuple(kept))


def _lines(text: str, path: Path, separator: str) -> Iterator[Line]:
    """Yield the lines that are not blank, without one that declares the separator."""
    plain = f"[^{separator}\r\n]"
    # a cell is quoted or does not begin with a quote: where neither fits, a quote was never closed
    cell = re.compile(
        rf'(?:"([^"]*+(?:""[^"]*+)*+)"({plain}*+)|((?!"){plain}*+))({separator}|\r\n|\r|\n|\Z)',
    )
    declared = _DECLARED.match(text)
    at, number = (0, 1) if declared is None else (declared.end(), 2)
    begun, cells = number, list[Cell]()
    while at < len(text) or cells:
        found = cell.match(text, at)
        if found is None:
            raise ReadError(
                "a quote is never closed", path=path, place=f"line {number}, cell {len(cells) + 1}",
                found=repr(text[at : at + 40]), remedy="close it, or double a quote within quotes",
            )  # fmt: skip
        quoted, rest, bare, end = found.groups()
        inner = bare if quoted is None else quoted.replace('""', '"') + rest
        if quoted is not None:
            number += len(_LINE_END.findall(quoted))
        cells.append(Cell(at, found.start(4), inner.strip()))
        at = found.end()
        if end == separator:
            continue
        if any(one.text for one in cells):
            yield Line(begun, tuple(cells), found.start(4))
        number += 1
        begun, cells = number, []
