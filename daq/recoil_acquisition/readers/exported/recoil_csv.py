"""CSV that this project exports: JSON behind ``# key:``, one heading row, and numbers that are exact.

The layout is described in `recoil_acquisition.exporters.dewesoft_text`, which writes it.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.exported.header import ExportedHeader, exported_header, parse_json
from recoil_acquisition.readers.exported.recording import Columns, exported_recording
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import split_cells
from recoil_acquisition.readers.text.rows import read_rows
from recoil_acquisition.readers.text.text_table import TextBlock, find_block
from recoil_acquisition.readers.text_file import TextFile, read_text

FIRST_LINE = '# recoil-daq: "csv/1"'
_COMMENT, _BEHIND_KEY = "# ", ": "
"""Signs at the begin of a comment line, and between its key and its JSON."""
_LEAST_ROW_BYTES = 4
"""Bytes of a row at least: a time, a separator, a number and a line end."""


class RecoilCsvReader:
    """Reader of this project's CSV."""

    name = "recoil-daq CSV"

    def claims(self, head: Head) -> Claim:
        """Be certain of the first line."""
        return Claim.CERTAIN if head.lines[0] == FIRST_LINE else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an export.

        Raises
        ------
        ReadError
            If it cannot be read or is none.
        CorruptFileError
            If its comment lines or its heading row are damaged.
        """
        file = read_text(path)
        lines, start = _comment_lines(file)
        if not lines or lines[0] != FIRST_LINE:
            raise ReadError("this is no CSV of recoil-daq", path=path, place="line 1", expected=FIRST_LINE)
        document: dict[str, Any] = {"channels": []}
        for number, line in enumerate(lines[1:], start=2):
            key, colon, text = line.removeprefix(_COMMENT).partition(_BEHIND_KEY)
            if not colon:
                raise CorruptFileError("no key and value", path=path, place=f"line {number}", found=repr(line[:40]))
            value = parse_json(text, path, f"line {number}")
            if key == "channel":
                document["channels"].append(value)
            else:
                document[key] = value
        header = exported_header(document, path, most=len(file.data) // _LEAST_ROW_BYTES)
        block = _rows(file, header, start, len(lines) + 1)
        row_count = 0 if block is None else block.row_count
        read_columns = partial(_columns, header, block)
        return exported_recording(self.name, header, declared.clock, row_count, read_columns, file.cut)


def _columns(header: ExportedHeader, block: TextBlock | None) -> Columns:
    """Read the time and the channels; there is no block where the file promises no row."""
    if block is None:
        return tuple(np.empty(0) for _ in range(len(header.signals) + 1))
    # An infinite sample is distinguished from a lost one here, because the shot does
    values = read_rows(block, marked=False)
    return tuple(np.ascontiguousarray(column) for column in values.T)


def _comment_lines(file: TextFile) -> tuple[list[str], int]:
    """Return the complete lines that begin with ``#``, and the byte behind them."""
    lines, start = [], 0
    while file.data.startswith(b"#", start) and (end := file.data.find(b"\n", start)) >= 0:
        lines.append(file.data[start:end].decode(file.encoding, errors="replace"))
        start = end + 1
    return lines, start


def _rows(file: TextFile, header: ExportedHeader, start: int, line: int) -> TextBlock | None:
    """Delimit the rows below the heading row, and check how many there are."""
    end = file.data.find(b"\n", start)
    headings = split_cells(file.data[start : max(end, start)].decode(file.encoding, errors="replace"), ",")
    if end < 0 or len(headings) != len(header.signals) + 1:
        raise CorruptFileError(
            "the heading row is damaged", path=file.path, place=f"line {line}",
            expected=f"{len(header.signals) + 1} headings", found="no line end" if end < 0 else f"{len(headings)}",
            remedy="export the shot again",
        )  # fmt: skip
    if header.count == 0 and not file.data[end + 1 :].strip():
        return None
    block = find_block(file, end + 1, ",", ["time_s", *(signal.name for signal in header.signals)], decimal_comma=False)
    if block.row_count > header.count:
        raise CorruptFileError(
            "more rows than the file promises", path=file.path, place=f"line {line + 1 + header.count}",
            expected=f"{header.count}", found=f"{block.row_count}", remedy="export the shot again",
        )  # fmt: skip
    return block
