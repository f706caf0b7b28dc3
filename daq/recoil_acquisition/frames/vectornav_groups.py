"""Fields of a VectorNav binary message, by its header.

Source: VectorNav, VN-100 User Manual (UM001), binary output groups; the sizes are those of VectorNav's
programming library. A bit of the group byte announces a 16-bit word, little endian; a bit of the word announces
a field. Fields follow each other in the order of the bits.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

SYNC = 0xFA


@cache
def _groups() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def fields_of_header(header: bytes) -> tuple[list[dict[str, Any]], int]:
    """Return the declared fields of a message, and its length without checksum.

    Parameters
    ----------
    header
        Sync byte, group byte, and a word for each group.

    Returns
    -------
    fields : list of dict
        Fields as a framing declares them; each name once, as in the first group that has it.
    length : int

    Raises
    ------
    ValueError
        If it is no such header, or announces a group or field of unknown size.
    """
    groups = [bit for bit in range(8) if len(header) > 1 and header[1] >> bit & 1]
    if len(header) < 2 or header[0] != SYNC or not groups or len(header) != 2 + 2 * len(groups):
        raise ValueError(
            'header must be FA, a byte of groups and two bytes for each, such as "FA 01 21 01"; '
            f'found "{header.hex(" ")}"'
        )
    fields: dict[str, dict[str, Any]] = {}
    at = len(header)
    for number, group in enumerate(groups):
        word = int.from_bytes(header[2 + 2 * number : 4 + 2 * number], "little")
        sizes = _groups()["sizes"].get(str(group + 1), ())
        for bit in (bit for bit in range(16) if word >> bit & 1):
            if bit >= len(sizes):
                raise ValueError(f"header: the size of field {bit} of group {group + 1} is not known")
            for row in _groups()["field"]:
                if (row["group"], row["bit"]) == (group + 1, bit):
                    field = {key: value for key, value in row.items() if key not in ("group", "bit")}
                    fields.setdefault(str(field["name"]), field | {"at": at + field["at"]})
            at += sizes[bit]
    if not fields:
        raise ValueError(f'header: "{header.hex(" ")}" announces nothing that is decoded')
    return list(fields.values()), at
