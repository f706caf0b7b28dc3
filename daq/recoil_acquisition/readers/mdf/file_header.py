"""Head of an MDF 4 file: whether it was closed, what kind of recording it is, and when that began.

From the head of a file alone its groups are walked as far as the head reaches.

Layout (ASAM MDF 4.1): the identification, 64 bytes, with flags at its end of what was not written; the header block
(HD) with the start behind its links.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from recoil_acquisition.readers.mdf.channel_groups import HD_AT, MdfDamageError, iter_groups

FINALISED, UNFINALISED = b"MDF     4.", b"UnFinMF 4."
"""Beginnings of a file, and of one whose recorder has not yet, or never, put its counts in order."""

FLAGS_AT = 60
"""Byte of the identification at which the flags of what was not written stand."""
_BLOCK = struct.Struct("<16xQ")
"""Number of links, behind the block's marker and length (ASAM MDF 4.1, block header)."""
_TIMES = struct.Struct("<QhhB")
"""Start in ns, two zones in minutes, flags: behind the links of the header block (ASAM MDF 4.1, HDBLOCK)."""
_LOCAL_TIME = 0x01


@dataclass(frozen=True)
class Unfinished:
    """Parts that a recorder did not write before it was stopped, by the flags in the identification of its file."""

    flags: int

    @property
    def counts(self) -> bool:
        """Return whether the numbers of records are not written."""
        return bool(self.flags & 0x0001)

    @property
    def last_length(self) -> bool:
        """Return whether the length of the last block of records is not written."""
        return bool(self.flags & 0x0004)

    @property
    def offsets(self) -> bool:
        """Return whether the offsets of samples of variable length are not written."""
        return bool(self.flags & 0x0040)


def unfinished(head: bytes) -> Unfinished | None:
    """Return what the recorder left unwritten; None if it closed the file."""
    if not head.startswith(UNFINALISED):
        return None
    return Unfinished(int.from_bytes(head[FLAGS_AT : FLAGS_AT + 2], "little"))


def is_mdf4(head: bytes) -> bool:
    """Return whether a file begins as MDF of version 4, finalised or not."""
    return head.startswith((FINALISED, UNFINALISED)) and len(head) > HD_AT


def is_bus_logging(head: bytes) -> bool:
    """Return whether a file's head shows bus frames and no measured channel beside them.

    A file whose channels are described behind its first samples shows neither in its head; it is taken
    for measured channels.

    Parameters
    ----------
    head
        First `recoil_acquisition.readers.head.HEAD_BYTES` bytes, or all of the file.
    """
    return is_mdf4(head) and _is_bus_alone(head)


def is_undecided(head: bytes) -> bool:
    """Return whether a file begins as MDF 4 and describes its first channels behind the bytes given."""
    if not is_mdf4(head):
        return False
    groups = iter_groups(head, strict=False)
    return next(groups, None) is None


def is_bus_file(path: Path) -> bool:
    """Return whether all of a file shows what `is_bus_logging` looks for in its head."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _is_bus_alone(data)
    except (OSError, ValueError):
        return False


def _is_bus_alone(data: Any) -> bool:
    groups = list(iter_groups(data, strict=False))
    return any(g.is_bus for g in groups) and not any(g.channel_count and not g.is_bus for g in groups)


class HeaderTimes(NamedTuple):
    """Start in ns since 1970, its zone and the summer time's shift in minutes, and the flags."""

    start_ns: int
    zone: int
    summer: int
    flags: int

    @property
    def is_local(self) -> bool:
        """Return whether the start counts in local time without a zone; else it counts in UTC."""
        return bool(self.flags & _LOCAL_TIME)


def header_times(content: bytes) -> HeaderTimes:
    """Read when a recording began; raises `MdfDamageError` if the block ends before it says so."""
    (links,) = _BLOCK.unpack_from(content, HD_AT)
    at = HD_AT + 24 + 8 * links
    if at + _TIMES.size > len(content):
        raise MdfDamageError("the header block ends early")
    return HeaderTimes(*_TIMES.unpack_from(content, at))
