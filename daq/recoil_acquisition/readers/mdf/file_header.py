"""Start of a recording by the header block (HD) of an MDF 4 file."""

from __future__ import annotations

import struct
from typing import NamedTuple

from recoil_acquisition.readers.mdf.channel_groups import HD_AT, MdfDamageError

_BLOCK = struct.Struct("<16xQ")
"""Number of links, behind the block's marker and length (ASAM MDF 4.1, block header)."""
_TIMES = struct.Struct("<QhhB")
"""Start in ns, two zones in minutes, flags: behind the links of the header block (ASAM MDF 4.1, HDBLOCK)."""
_LOCAL_TIME = 0x01


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
