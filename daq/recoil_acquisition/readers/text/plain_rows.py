"""Rows in their plainest form: cells without quotes, without marks between thousands, an overload as ``inf``.

It is made of rows that the fast parser will not read, as a whole and before they are read cell by cell, which takes a
hundred times as long. What does not fit is left as it is, for the careful reading to judge.
"""

from __future__ import annotations

import re
from functools import cache

from recoil_acquisition.readers.text.cells import MARKS, OVERLOAD_WORDS
from recoil_acquisition.readers.text.row_format import RowFormat

_WORD = re.compile(rb"(?i)#|\b(?:o|nan\(|nov)")
"""Part of every word for an overload, or for no number."""


def plain_rows(text: bytes, rows: RowFormat, *, words: bool) -> bytes:
    r"""Return rows with the same numbers in their plainest form.

    Parameters
    ----------
    text
        Rows that are complete, each ended by ``\n``.
    words
        Whether words stand for an overload, or for no number; where cells are text they do not.
    """
    patterns = _patterns(rows.separator, rows.encoding, rows.thousands or "")
    # Cells share their separators, so that neighbours are found in turn
    if b'"' in text:
        text = patterns.quoted.sub(rb"\1", text)
    if patterns.grouped is not None:
        grouped, marks = patterns.grouped, patterns.marks
        text = grouped.sub(lambda found: marks.sub(b"", found.group()), text)
    if words and _WORD.search(text):
        text = patterns.overload.sub(rb"\1inf", text)
        text = patterns.no_number.sub(b"nan", text)
    return text


class _Patterns:
    """Patterns of cells in rows of a separator, an encoding and a mark between thousands."""

    def __init__(self, separator: str, encoding: str, thousands: str) -> None:
        parting = re.escape(separator.encode())
        begin = rb"(?:(?<=[" + parting + rb"\n])|\A) *"
        end = rb" *(?=[" + parting + rb"\r\n])"
        self.quoted = re.compile(begin + rb'"([^"\r\n' + parting + rb']*)"' + end)
        words = b"|".join(re.escape(word.encode()) for word in sorted(OVERLOAD_WORDS, key=len, reverse=True))
        self.overload = re.compile(begin + rb"(?i:\+|(-)|)(?i:" + words + rb"|1[.,]#inf0*)" + end)
        self.no_number = re.compile(
            begin + rb"(?i:[+-]?1[.,]#(?:qnan|snan|ind|nan)0*|[+-]?nan\((?:ind|snan)\)|novalue)" + end
        )
        spellings = MARKS.get(thousands, thousands)
        encoded = [mark.encode(encoding, errors="ignore") for mark in spellings]
        self.marks = re.compile(b"|".join(re.escape(mark) for mark in encoded if mark))
        mark = b"(?:" + self.marks.pattern + b")"
        # thousands alike, or lakhs and crores
        number = rb"[+-]?[1-9]\d{0,2}(?:" + mark + rb"\d{2,3})*" + mark + rb"\d{3}(?=[.,\r\n " + parting + rb"])"
        self.grouped = re.compile(begin + number) if thousands else None


@cache
def _patterns(separator: str, encoding: str, thousands: str) -> _Patterns:
    return _Patterns(separator, encoding, thousands)
