"""Texts of an MDF 4 file: names, units and comments.

Layout (ASAM MDF 4.1): a TX block is a text, an MD block is XML; both end with a zero byte. Most comments in XML are
one element ``TX`` and nothing else.
"""

from __future__ import annotations

import html
import re
import struct

MOST_BYTES = 1 << 16

_ONE_TEXT = re.compile(r"\s*<(\w+)[^>]*>\s*<TX[^>]*>([^<]*)</TX>\s*</\1>\s*")


def text_of(content: bytes, at: int) -> str:
    """Return the text at an address, without the XML around it where it is one text; empty if there is none."""
    if not at or content[at : at + 4] not in (b"##TX", b"##MD") or at + 24 > len(content):
        return ""
    (length,) = struct.unpack_from("<Q", content, at + 8)
    text = content[at + 24 : at + min(length, MOST_BYTES)].split(b"\0")[0].decode("utf-8", "replace")
    only = _ONE_TEXT.fullmatch(text)
    return html.unescape(only[2]) if only else text
