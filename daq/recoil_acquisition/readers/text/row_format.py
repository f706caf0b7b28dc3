"""Format of the rows of a text table: all that reading a row needs to know beside its bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError


@dataclass(frozen=True)
class RowFormat:
    """Format of rows.

    Attributes
    ----------
    path
        File, for messages.
    encoding
        Encoding of the rows' bytes.
    columns
        Names of the columns, for messages.
    width
        Number of cells per row: more than there are columns where rows end with a separator, or with the empty cells
        of a spreadsheet.
    missing
        Texts, or numbers, that stand for a lost sample beside the usual ones.
    comment
        Signs that begin a line that is no row; empty if there are none.
    thousands
        Mark that sets thousands apart; empty if nothing does, and None if nobody has stated it.
    heading
        Line above the first row; empty if there is none.
    """

    path: Path
    encoding: str
    separator: str
    columns: tuple[str, ...]
    width: int
    decimal_comma: bool
    missing: tuple[str, ...] = ()
    comment: str = ""
    thousands: str | None = None
    heading: bytes = b""

    def wrong_width(self, line: int, width: int) -> CorruptFileError:
        """Return what is wrong with a row of another width."""
        comma = self.separator == "," and width > len(self.columns)
        return CorruptFileError(
            "a row does not fit the header",
            path=self.path,
            place=f"line {line}",
            expected=f"{len(self.columns)} cells",
            found=f"{width}",
            remedy="export with a decimal point or with ; between cells" if comma else "export it again",
        )


_BLANKS, _OUTER = re.compile(rb"[ \t]+"), re.compile(rb"(?m)^ | (?=\r?$)")


def parted_once(text: bytes) -> bytes:
    """Return rows whose cells blanks part, with one blank between cells and none about them."""
    return _OUTER.sub(b"", _BLANKS.sub(b" ", text))


def is_comment(row: bytes, comment: str) -> bool:
    """Return whether a line is a comment, which may be indented."""
    return row.lstrip(b" ").startswith(comment.encode("utf-8"))


def count_rows(text: bytes, comment: str) -> int:
    r"""Count complete rows, each ended by ``\n``, without comments."""
    return sum(not is_comment(row, comment) for row in text.split(b"\n")[:-1])
