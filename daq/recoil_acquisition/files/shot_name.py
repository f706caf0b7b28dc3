"""Names that a shot may bear on every system that its files are copied to, and numbers that a file's name bears."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

LONGEST_BYTES = 128
"""File systems take names of 255 bytes; sources' names, endings and those of temporary files are put round a shot's."""

OWN_ENDINGS = (".h5", ".partial", ".rdlog")
"""Endings of files that are named after a shot: with one of them it would be taken for such a file."""

_RESERVED = re.compile(r"(CON|PRN|AUX|NUL|(COM|LPT)[0-9¹²³])(\..*)?", re.IGNORECASE)


_DATE = r"(?:19|20)\d\d[-_.]?[01]\d[-_.]?[0-3]\d|[0-3]?\d[-_.][01]?\d[-_.](?:19|20)\d\d"
_CLOCK = r"\d\d[-_:.h]\d\d[-_:.m]\d\d|\d\d?[-:.h]\d\d"
_NO_NUMBERS = tuple(
    re.compile(rf"(?<!\d)(?:{text})(?!\d)", re.IGNORECASE)
    for text in (
        rf"(?:{_DATE})(?:[T_ -](?:{_CLOCK})|[T-]\d{{4}})?",  # a date, perhaps with a time
        rf"{_CLOCK}|\d\d?[-.]\d\d?[-.]\d\d",  # a time, or a short date
        r"\d+(?:\.\d+)+|(?<![^\W_])(?:v|ver|version|rev)[_\s-]?\d+",  # a version
    )
)


def composed(name: str) -> str:
    """Return a name with each sign over its letter: macOS and some archives spell file names with both apart."""
    return unicodedata.normalize("NFC", name)


def shot_name_fault(name: str) -> str | None:
    """Say why a shot cannot bear a name.

    Parameters
    ----------
    name
        Name from a command line, a record of an acquisition or a shot file: from anywhere.

    Returns
    -------
    str or None
        The problem in words that follow the name; None if there is none.
    """
    if not name:
        return "is empty"
    if len(name.encode(errors="surrogatepass")) > LONGEST_BYTES:
        return f"is longer than {LONGEST_BYTES} bytes: the files that are named after it would not all have room"
    if composed(name) != name:
        right = composed(name)
        return f"is spelled with signs on their own over letters, as macOS spells file names: write it as {right!r}"
    if unsafe := re.search(r"[^\w.+-]", name):
        return f"holds {unsafe.group()!r}: letters, digits, `_`, `-`, `+` and `.` are safe in file names everywhere"
    if name[0] in "-.":
        return f"begins with `{name[0]}`: it would be taken for {'an option' if name[0] == '-' else 'a hidden file'}"
    if name[-1] == ".":
        return "ends with `.`: Windows takes such an ending away"
    if name.lower().endswith(OWN_ENDINGS):
        return f"ends with {name[name.rindex('.') :]!r}, as the files do that are named after it"
    if _RESERVED.fullmatch(name):
        return "is a word that Windows reserves for a device"
    return None


def check_shot_name(name: str) -> None:
    """Raise ValueError where a shot cannot bear a name."""
    if fault := shot_name_fault(name):
        raise ValueError(f"the shot's name {name!r} {fault}")


def numbers_of(path: Path, pattern: re.Pattern[str] | None = None) -> frozenset[int]:
    """Return the numbers in a file's name that may be a shot's.

    Parameters
    ----------
    pattern
        Pattern of the whole name, which says where the number stands. Without it a number counts that stands alone
        between ``_``, ``-`` and spaces; none of a date, a time or a version does.
    """
    if pattern is not None:
        place = pattern.fullmatch(composed(path.name))
        return frozenset() if place is None else frozenset({int(place.group("shot"))})
    stem = path.stem
    for text in _NO_NUMBERS:
        stem = text.sub("~", stem)
    tokens = re.split(r"[_\s-]+", stem)
    return frozenset(int(token) for token in tokens if token.isdecimal() and token.isascii() and len(token) <= 5)
