"""Formats that are known by their content and not read: their names, and what to export instead."""

from __future__ import annotations

import re
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.head import Head

_COMTRADE_COUNTS = re.compile(r"\s*\d+\s*,\s*\d+\s*A\s*,\s*\d+\s*D\s*", re.IGNORECASE)
"""Second line of a COMTRADE configuration: all channels, the analog and the digital ones."""


def foreign_format(head: Head) -> tuple[str, str]:
    """Name the format of a file that is not read.

    Returns
    -------
    found, remedy : str
        Both empty if it is not known.
    """
    if _is_comtrade(head) or any(_is_comtrade_file(head.path.with_suffix(suffix)) for suffix in (".cfg", ".CFG")):
        return (
            "COMTRADE, a record of a protection relay",
            "export it as a table of text under `Time (s)` and `name (unit)`",
        )
    if head.content.startswith(b"RIFX"):
        return "RIFX, sound samples of a big-endian program", "export it as WAV, which begins with RIFF"
    return "", ""


def _is_comtrade(head: Head) -> bool:
    return len(head.lines) > 2 and _COMTRADE_COUNTS.fullmatch(head.lines[1]) is not None


def _is_comtrade_file(path: Path) -> bool:
    try:
        return _is_comtrade(Head.of(path))
    except ReadError:
        return False
