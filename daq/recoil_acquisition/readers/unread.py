"""Formats that are known by their content and not read: their names, and what to export instead."""

from __future__ import annotations

import re
from pathlib import Path

from recoil_acquisition.readers.text.text_file import decode_head

_COMTRADE_COUNTS = re.compile(r"\s*\d+\s*,\s*\d+\s*A\s*,\s*\d+\s*D\s*", re.IGNORECASE)
"""Second line of a COMTRADE configuration: all channels, the analog and the digital ones."""
_COMTRADE_BYTES = 4096


def foreign_format(path: Path, head: bytes) -> tuple[str, str]:
    """Name the format of a file that is not read.

    Parameters
    ----------
    path : Path
    head : bytes
        Its first bytes.

    Returns
    -------
    found, remedy : str
        Both empty if it is not known.
    """
    if _is_comtrade(head) or any(map(_is_comtrade_file, (path.with_suffix(".cfg"), path.with_suffix(".CFG")))):
        return (
            "COMTRADE, a record of a protection relay",
            "export it as a table of text under `Time (s)` and `name (unit)`",
        )
    if head.startswith(b"RIFX"):
        return "RIFX, sound samples of a big-endian program", "export it as WAV, which begins with RIFF"
    return "", ""


def _is_comtrade(head: bytes) -> bool:
    lines = decode_head(head).split("\n", 2)
    return len(lines) > 2 and _COMTRADE_COUNTS.fullmatch(lines[1]) is not None


def _is_comtrade_file(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return _is_comtrade(file.read(_COMTRADE_BYTES))
    except OSError:
        return False
