"""ProAnalyst's tracks in a workbook (``.xlsx``), as the software exports them to a spreadsheet.

The rows of the sheet are read like the lines of the text export: whatever header, then frame, time and two columns
per feature, -1 where it was lost.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.text.cells import is_number
from recoil_acquisition.readers.text.sheet_text import Sheet, is_workbook, read_sheets
from recoil_acquisition.readers.text_file import HEADER_LINES, TextFile
from recoil_acquisition.readers.tracks.block import BLOCK_ROWS, find_numbers, read_track_table
from recoil_acquisition.readers.tracks.recording import refuse_layout, track_recording


class ProAnalystWorkbookReader:
    """Reader of ProAnalyst's workbook."""

    name = "ProAnalyst workbook"

    def claims(self, head: Head) -> Claim:
        """Take a workbook for some program's tracks: what is in it shows only once it is unpacked."""
        return Claim.GENERIC if is_workbook(head.content) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a workbook; its first sheet that holds a block of numbers is read, the others are named.

        Raises
        ------
        ReadError
            If openpyxl is missing, a unit is unknown, or there is neither a time column nor a declared frame rate.
        CorruptFileError
            If it is damaged, or no sheet holds a block of numbers.
        """
        refuse_layout(declared, path)
        sheets = tuple(Sheet(s.name, _padded(s.text)) for s in read_sheets(path))
        sheet = next((s for s in sheets if _has_numbers(s.text)), None)
        if sheet is None:
            raise CorruptFileError(
                "no sheet holds a block of numbers",
                path=path,
                expected=f"{BLOCK_ROWS} rows of numbers of equal width within {HEADER_LINES} rows",
                found=", ".join(repr(s.name) for s in sheets[:8]),
                remedy="export the tracks again",
            )
        file = TextFile(path, sheet.text.encode(), "utf-8")
        table = read_track_table(file, self.name, declared.frame_rate_hz)
        others = [s.name for s in sheets if s is not sheet]
        notes = (f"sheet {sheet.name!r} was read, the others were not: {', '.join(others)}",) if others else ()
        metadata = {**table.metadata, "sheet": sheet.name}
        return track_recording(replace(table, metadata=metadata, notes=(*notes, *table.notes)), declared)


def _has_numbers(text: str) -> bool:
    found = find_numbers(text.split("\n", HEADER_LINES + BLOCK_ROWS)[: HEADER_LINES + BLOCK_ROWS])
    return found is not None and found[1] == "\t"


def _padded(text: str) -> str:
    """Give the rows that begin with a number the same number of cells: empty ones at a row's end are not stored."""
    lines = text.split("\n")[:-1]
    marks = [line.count("\t") if is_number(line.lstrip("\t").partition("\t")[0]) else -1 for line in lines]
    most = max(marks, default=0)
    return "".join(
        f"{line}{chr(9) * (most - n)}\n" if n >= 0 else f"{line}\n" for line, n in zip(lines, marks, strict=True)
    )
