"""Formats that are known by their bytes and that nothing here reads, with what to do instead.

``foreign_formats.toml`` is the one table, and `foreign_format` looks a file up in it once no reader is sure of it, so
that every command says the same. A sign is what the format's own description demands of every file, so that no file
bears the name of a maker whose marks are not in it. What a program exports is from its maker's pages.

Magic numbers are of the descriptions that stand beside each row; of text, signs are the words that open it.
"""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.head import Head

COMTRADE = "a COMTRADE record of a protection relay"


@dataclass(frozen=True)
class ForeignFormat:
    """A format that is not read.

    Attributes
    ----------
    name
        Name of the format as people know it, with its article: it ends the sentence that begins "this is".
    signs
        Regular expressions, as `Head.shows` takes them, one of which every file shows.
    remedy
        Action of the user: another export, or the ``layout`` that reads it.
    source
        Description of the format that the signs are from.
    holds
        Function that looks at what no pattern can.
    """

    name: str
    signs: tuple[bytes | str, ...]
    remedy: str
    source: str
    holds: Callable[[Head], bool]

    def is_of(self, head: Head) -> bool:
        """Whether a file is of this format."""
        return any(map(head.shows, self.signs)) and self.holds(head)


def _sum_is_right(head: Head) -> bool:
    """Whether the checksum of the first packet of a telemetry recorder holds: the sum of its first eleven words."""
    if len(head.content) < 24:
        return False
    *words, stated = struct.unpack("<12H", head.content[:24])
    return bool(sum(words) & 0xFFFF == stated)


def _wave_header_is_right(head: Head) -> bool:
    """Whether the words of an Igor wave's header add up to zero, as they must."""
    for order in "<>":
        version = struct.unpack(f"{order}h", head.content[:2])[0]
        size = {2: 126, 5: 384}.get(version, 0)
        if size and len(head.content) >= size:
            return not sum(struct.unpack(f"{order}{size // 2}h", head.content[:size])) & 0xFFFF
    return False


def _has_parameters(head: Head) -> bool:
    """Whether the parameter section of a motion capture begins where its first byte says, and names its processor."""
    at = (head.content[0] - 1) * 512 if head.content else -1
    return 0 < at + 4 <= len(head.content) and head.content[at + 3] in (84, 85, 86)


def _is_catman(head: Head) -> bool:
    """Whether the offset of a catman file's data lies behind its header, whose comment is text."""
    if len(head.content) < 8:
        return False
    _, offset, length = struct.unpack("<hih", head.content[:8])
    comment = head.content[8 : 8 + max(length, 0)]
    return 200 < offset < 1 << 28 and 0 <= length < 4096 and b"\0" not in comment


def _is_edf(head: Head) -> bool:
    """Whether the header's own size is what its number of signals makes it: 256 bytes, and 256 for each."""
    size, signals = head.content[184:192].strip(), head.content[252:256].strip()
    return size.isdigit() and signals.isdigit() and int(size) == 256 * (int(signals) + 1)


_HOLDS: dict[str, Callable[[Head], bool]] = {
    "anything": lambda _head: True,
    "sum_is_right": _sum_is_right,
    "wave_header_is_right": _wave_header_is_right,
    "has_parameters": _has_parameters,
    "is_catman": _is_catman,
    "is_edf": _is_edf,
}


@cache
def foreign_formats() -> tuple[ForeignFormat, ...]:
    """Return the formats that are not read, in the order of the data file: a file is named by the first it shows."""
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    return tuple(
        ForeignFormat(
            row["name"],
            (*(sign.encode("latin-1") for sign in row.get("bytes", ())), *row.get("text", ())),
            row["remedy"].format(**table["phrases"]),
            row["source"],
            _HOLDS[row.get("holds", "anything")],
        )
        for row in table["format"]
    )


def foreign_format(head: Head) -> ForeignFormat | None:
    """Return the format of a file that is not read; None if it is not known either."""
    found = next((one for one in foreign_formats() if one.is_of(head)), None)
    return found or _beside(head)


def _beside(head: Head) -> ForeignFormat | None:
    """Return the format of a file whose description lies beside it: the samples of a COMTRADE record."""
    described = next(one for one in foreign_formats() if one.name == COMTRADE)
    for suffix in (".cfg", ".CFG"):
        try:
            if head.path.suffix and described.is_of(Head.of(head.path.with_suffix(suffix))):
                return described
        except ReadError:
            continue
    return None
