"""Where the letters of a PDF stand: read from its operators and the widths of its own fonts, by pypdf."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pypdf import PdfReader
from pypdf.generic import ContentStream

Matrix = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Run:
    """Letters that are shown by one operator.

    Attributes
    ----------
    sheet
        Number of the sheet, from 0.
    left, right, y
        Its ends and its line on the sheet, from the lower left corner, pt.
    """

    sheet: int
    left: float
    right: float
    y: float


def runs(pdf: bytes) -> Iterator[Run]:
    """Yield all letters of a PDF that are set level."""
    reader = PdfReader(io.BytesIO(pdf))
    for sheet, page in enumerate(reader.pages):
        fonts = {name: _widths(font.get_object()) for name, font in page["/Resources"].get("/Font", {}).items()}
        now: Matrix = (1, 0, 0, 1, 0, 0)
        kept: list[Matrix] = []
        text, size, of = now, 0.0, {}
        for operands, operator in ContentStream(page.get_contents(), reader).operations:
            if operator == b"q":
                kept.append(now)
            elif operator == b"Q":
                now = kept.pop()
            elif operator == b"cm":
                now = _times(tuple(map(float, operands)), now)
            elif operator == b"Tf":
                of, size = fonts[operands[0]], float(operands[1])
            elif operator == b"Tm":
                text = tuple(map(float, operands))
            elif operator in (b"Tj", b"TJ"):
                shown = operands[0] if operator == b"TJ" else [operands[0]]
                width = size * sum(_advance(one, of) for one in shown) / 1000
                a, b, _, _, x, y = _times(text, now)
                if b == 0:
                    yield Run(sheet, x, x + a * width, y)


def beyond(pdf: bytes, margin_pt: float = 39.0) -> list[Run]:
    """Return the letters that stand in a sheet's margins at its sides, or beyond it; a blank at a line's end may."""
    sheets = [page.mediabox for page in PdfReader(io.BytesIO(pdf)).pages]
    return [
        one
        for one in runs(pdf)
        if one.left < margin_pt
        or one.right > float(sheets[one.sheet].width) - margin_pt
        or not 0 < one.y < float(sheets[one.sheet].height)
    ]


def _times(one: Any, other: Matrix) -> Matrix:
    a, b, c, d, e, f = one
    A, B, C, D, E, F = other
    return a * A + b * C, a * B + b * D, c * A + d * C, c * B + d * D, e * A + f * C + E, e * B + f * D + F


def _advance(shown: Any, widths: dict[int, float]) -> float:
    if isinstance(shown, int | float):
        return -float(shown)
    codes = shown.original_bytes if hasattr(shown, "original_bytes") else bytes(shown)
    return sum(widths.get(int.from_bytes(codes[k : k + 2]), 1000.0) for k in range(0, len(codes), 2))


def _widths(font: Any) -> dict[int, float]:
    """Return the width of each letter of a font, in thousandths of its size."""
    listed = iter(font["/DescendantFonts"][0].get_object()["/W"])
    found: dict[int, float] = {}
    for first in listed:
        other = next(listed)
        if isinstance(other, list):
            found |= {int(first) + k: float(width) for k, width in enumerate(other)}
        else:
            width = float(next(listed))
            found |= dict.fromkeys(range(int(first), int(other) + 1), width)
    return found
