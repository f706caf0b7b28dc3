"""Text of files as it goes out: what a terminal, a log or a spreadsheet would obey is written as it is spelled."""

from __future__ import annotations

import re

_OBEYED = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u061c\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Controls (C0, DEL, C1), separators of lines, marks of direction (Unicode Annex 9), and bytes that are no text."""


def visible(text: str) -> str:
    r"""Return one line of text in which nothing is hidden: ``\x1b`` for an escape, ``\u202e`` for right to left."""
    return _OBEYED.sub(_spelled, text)


def _spelled(match: re.Match[str]) -> str:
    code = ord(match.group())
    return {9: r"\t", 10: r"\n", 13: r"\r"}.get(code) or (f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}")
