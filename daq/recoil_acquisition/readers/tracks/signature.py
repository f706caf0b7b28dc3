r"""Signatures of the formats of a text of tracks: its first lines, never its name.

DeepLabCut writes ``scorer`` into the first cell; DLTdv and Argus name every column after point and camera
(``pt1_cam1_X``, ``Track 1_cam_1_x``); SLEAP has a column ``frame_idx`` beside ``<node>.x``; Tracker writes one row
of names, or ``#multi:`` and one, over a row that begins with ``t``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from recoil_acquisition.readers.text.cells import SEPARATORS, is_number, split_cells
from recoil_acquisition.readers.text_file import LongText, TextFile, one_line_end

POINT_COLUMN = re.compile(r"(?P<feature>.+_cam_?\d+)_(?P<axis>[xy])", re.IGNORECASE)
"""A column of DLTdv or Argus."""

MULTI = "#multi:"
"""First line of Tracker's export of several tracks."""

PART_BYTES = 1 << 20
"""Bytes of a text whose cells are parted by spaces that are held as lines at a time."""

_WIDE = re.compile(r" {2,}")
_WIDE_BYTES = re.compile(rb" {2,}")


def spread(line: str) -> str:
    """Return a line of Tracker's with a tab where several spaces part its cells; one with separators as it is."""
    return line if "\t" in line or ";" in line else _WIDE.sub("\t", line.strip(" "))


def spread_text(file: LongText) -> TextFile:
    """Return a text with each of its lines `spread`; it is taken part by part, since many lines are large as such.

    Raises
    ------
    ReadError
        If it cannot be read any more.
    """
    parts, at = [], 0
    while at < file.size:
        part = file.read(at, min(at + PART_BYTES, file.size))
        if at + len(part) < file.size:
            part = part[: part.rfind(file.line_end) + 1] or part
        at += len(part)
        part = one_line_end(part)
        if b"\t" in part or b";" in part:
            lines = part.decode(file.encoding, errors="replace").split("\n")
            parts.append("\n".join(map(spread, lines)).encode())
            continue
        part = _WIDE_BYTES.sub(b"\t", part.strip(b" "))
        for end in (b"\t\n", b" \n", b"\n\t", b"\n "):
            part = part.replace(end, b"\n")
        parts.append(part.decode(file.encoding, errors="replace").encode())
    return TextFile(file.path, b"".join(parts), "utf-8", file.cut)


def tracker_header(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the row of Tracker's variables, which begins with ``t``, and its separator; None if there is none."""
    row = 2 if lines and lines[0].strip().casefold() == MULTI else 1
    if len(lines) < row + 2:
        return None
    for separator in SEPARATORS:
        over, names, first = (split_cells(spread(line), separator) for line in lines[row - 1 : row + 2])
        while names and not names[-1]:
            names.pop()
        named = any(over) and (not over[0] if row == 2 else len([c for c in over if c]) == 1)
        if len(names) > 1 and all(names) and names[0] == "t" and named and is_number(first[0]):
            return row, separator
    return None


def signature(lines: Sequence[str]) -> str:
    """Return the format of a text of tracks.

    Parameters
    ----------
    lines
        The file's first lines.

    Returns
    -------
    str
        ``deeplabcut``, ``dltdv``, ``sleap`` or ``tracker``; empty if it is none of these.
    """
    for separator in SEPARATORS:
        cells = split_cells(lines[0], separator) if lines else []
        if len(cells) < 2:
            continue
        if cells[0].casefold() == "scorer":
            return "deeplabcut"
        if all(POINT_COLUMN.fullmatch(cell) for cell in cells):
            return "dltdv"
        if "frame_idx" in cells and any(cell.endswith(".x") for cell in cells):
            return "sleap"
    return "tracker" if tracker_header(lines) else ""
