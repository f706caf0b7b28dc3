"""Texts and numbers in an SVG: escaped, as wide as there is room for."""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from xml.sax.saxutils import escape

from recoil_acquisition.errors import visible

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 has no place for."""
_NARROW, _BROAD = frozenset("iljtfrI.,:;'|!()[]/ "), frozenset("mwMWOQG@%&")


def number(value: float) -> str:
    """Write a coordinate to a tenth of a pixel."""
    return f"{round(value, 1) + 0.0:g}"


def clean(text: str) -> str:
    """Return a text as it may stand in XML, in an element or an attribute."""
    return escape(_FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", visible(text)), {'"': "&quot;"})


def text_width(text: str, size_px: float) -> float:
    """Return about how wide a text is, in pixels; rather more, because nobody knows the font that it will have."""
    return size_px * sum(map(_em, text))


def fitted(text: str, size_px: float, width_px: float) -> str:
    """Cut a text to a width; an ellipsis says that it was cut."""
    room, end = width_px / size_px, 0
    for place, character in enumerate(text):
        room -= _em(character)
        if room < 0.0:
            return text[:end] + "…"
        if room >= _em("…"):
            end = place + 1
    return text


@cache
def _em(character: str) -> float:
    """Return how wide a character is, in units of its size."""
    if unicodedata.combining(character):
        return 0.0
    if unicodedata.east_asian_width(character) in "WF":
        return 1.02
    if character in _NARROW:
        return 0.33
    return 0.85 if character in _BROAD else 0.68 if character.isupper() else 0.55


def label(
    text: str,
    x: float,
    y: float,
    *,
    size_px: float,
    anchor: str = "start",
    colour: str | None = None,
    halo: bool = False,
    turned: bool = False,
) -> str:
    """Write a text element.

    Parameters
    ----------
    x, y
        Place of the end of its base line that `anchor` names (``start``, ``middle``, ``end``).
    halo
        A white rim keeps it readable on curves.
    turned
        Whether it is turned by a quarter, to be read from the right.
    """
    more = f' text-anchor="{anchor}"' if anchor != "start" else ""
    more += f' fill="{colour}"' if colour is not None else ""
    more += ' stroke="#ffffff" stroke-width="2.5" stroke-linejoin="round" paint-order="stroke"' if halo else ""
    more += f' transform="rotate(-90 {number(x)} {number(y)})"' if turned else ""
    return f'<text x="{number(x)}" y="{number(y)}" font-size="{size_px:g}"{more}>{clean(text)}</text>'
