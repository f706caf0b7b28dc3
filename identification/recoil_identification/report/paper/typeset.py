"""Pages and pictures by typst, which an extra brings: nothing is read from a network, a font or another file.

What is typeset is handed over as data; none of it is ever read as typst's language.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.packages.extras import PDF

PNG_PPI = 200
STANDARD = "a-3b"
LONGEST_WORD = 36
"""Letters after which a word may be parted."""

_UNPRINTABLE = re.compile(
    "[^\n -~\u00a0-\u00ac\u00ae-\u0377\u0384-\u038a\u038c\u038e-\u03a1\u03a3-\u04ff\u05d0-\u05ea\u1e00-\u1eff"
    "\u2010-\u2027\u2030-\u203f\u2070\u2071\u2074-\u208e\u2090-\u209c\u20a0-\u20bf\u2100-\u211e\u2122\u2126\u2190-\u22ff\u2460-\u25ff]"
)
"""Characters that typst's own fonts have no letter for; a PDF/A must not have letters that are missing."""
_SIGN = re.compile(r"(?<=[_/\\:;=])|(?=_)|(?<=[.-])(?=[^\W\d])|(?<=\d-)(?=\d)")
"""Place in a name where it may be parted: words beside a sign are words, which hyphens may part."""
_ENDLESS = 20
"""Letters of a part of a name up to which it is left to hyphens, and a number is whole."""


def refuse_without_typst(*, pdf: bool, figures: bool) -> None:
    """Refuse what needs the extra before the work that it is for, if the extra is not installed.

    Raises
    ------
    StoreError
        Naming the option and how the extra is installed.
    """
    if (pdf or figures) and not PDF.is_installed:
        option = "--pdf" if pdf else "--figures"
        raise StoreError(f"{PDF.module}, which {option} needs, is not installed", remedy=PDF.remedy)


def printable(text: str, longest: int = LONGEST_WORD) -> str:
    """Put what cannot be printed as its number, and let words end that are longer than a line of so many letters."""
    pieces = re.compile(rf".{{1,{longest}}}")

    def parted(word: re.Match[str]) -> str:
        names = [word[0]] if len(word[0]) <= longest else _SIGN.split(word[0])
        return "\u200b".join(
            piece for one in names for piece in (pieces.findall(one) if len(one) > max(longest, _ENDLESS) else [one])
        )

    return re.sub(r"\S+", parted, _numbered(text))


def _numbered(text: str) -> str:
    return _UNPRINTABLE.sub(lambda found: " " if found[0].isspace() else f"[U+{ord(found[0]):04X}]", text)


def pdf_bytes(
    page: Mapping[str, Any], figures: Sequence[str], attached: tuple[str, bytes], started: str | None
) -> bytes:
    """Typeset a document as PDF/A-3b: the same bytes for the same content.

    Parameters
    ----------
    page
        Data that ``paper.typ`` reads: texts in mappings and lists.
    figures
        Figures as SVG; ``page`` refers to them by their number.
    attached
        Name and content of the file that is embedded.
    started
        ISO 8601, the date of the document; one that is no date after 1970 gives 1970-01-01.

    Raises
    ------
    StoreError
        If typst refuses it.
    """
    name, content = attached
    return _typeset(
        "paper.typ",
        {
            "page": json.dumps(_each_text(page)),
            "figures": _drawn(figures),
            "attached-name": name,
            "attached": content.decode("ascii"),
        },
        format="pdf",
        pdf_standards=STANDARD,
        timestamp=_timestamp(started),
    )[0]


def png_bytes(figures: Sequence[str]) -> list[bytes]:
    """Draw SVG figures as PNG at `PNG_PPI`, as wide as a page between its margins.

    Raises
    ------
    StoreError
        If typst refuses one.
    """
    if not figures:
        return []
    return _typeset("pictures.typ", {"figures": _drawn(figures)}, format="png", ppi=PNG_PPI, timestamp=0)


def _typeset(template: str, inputs: dict[str, str], **how: Any) -> list[bytes]:
    import typst

    path = Path(__file__).parent / template
    try:
        made = typst.compile(path, root=path.parent, sys_inputs=inputs, ignore_system_fonts=True, **how)
    except (typst.TypstError, TypeError, ValueError) as error:  # the latter two: a version of other arguments
        raise StoreError(
            "the figures and pages cannot be typeset",
            found=" ".join(str(error).split()),
            remedy=f"leave out --pdf and --figures, or install another version: {PDF.remedy}",
        ) from error
    return list(made) if isinstance(made, list) else [made]


def _drawn(figures: Sequence[str]) -> str:
    # only texts and names in an SVG are not ASCII
    return json.dumps([_numbered(one) for one in figures])


def _each_text(value: Any, longest: int = LONGEST_WORD) -> Any:
    """Make all texts printable; a mapping states by ``longest`` after how many letters words in it may be parted."""
    if isinstance(value, str):
        return printable(value, longest)
    if isinstance(value, Mapping):
        longest = value.get("longest", longest)
        return {key: _each_text(one, longest) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_each_text(one, longest) for one in value]
    return value


def _timestamp(started: str | None) -> int:
    try:
        when = datetime.fromisoformat(started or "")
        # a time of an unknown zone is taken as UTC, so that every computer writes the same
        return max(int((when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()), 0)
    except (ValueError, OverflowError):
        return 0
