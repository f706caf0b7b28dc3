"""The segments of a TDMS file, walked before a library reads them.

Each begins with a lead-in of 28 bytes: a tag, flags, a version, and the length of what follows.
"""

from __future__ import annotations

import struct
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, ReadError

TAG, INDEX_TAG = b"TDSm", b"TDSh"
LEAD_IN_BYTES = 28
BIG_ENDIAN = 1 << 6
OPEN_SEGMENT = 0xFFFFFFFFFFFFFFFF
"""Length of a segment that its writer never closed."""


def how_it_ends(path: Path) -> str:
    """Walk the segments and tell how the file was cut off; empty if nothing shows that.

    Raises
    ------
    ReadError
        If the file is an index, without samples.
    CorruptFileError
        If a segment does not begin where the one before ends.
    """
    size = path.stat().st_size
    at = 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            lead_in = file.read(LEAD_IN_BYTES)
            if lead_in[:4] == INDEX_TAG:
                raise ReadError(
                    "this is the index of a TDMS file, without samples", path=path, remedy="take the .tdms file"
                )
            if at and len(lead_in) < LEAD_IN_BYTES:
                return f"{len(lead_in)} bytes of a further segment at byte {at}: left out"
            if len(lead_in) < LEAD_IN_BYTES or lead_in[:4] != TAG:
                raise CorruptFileError(
                    "no segment", path=path, place=f"byte {at}", expected="TDSm", found=repr(lead_in[:4])
                )
            flags = struct.unpack_from("<I", lead_in, 4)[0]
            length = struct.unpack_from(">Q" if flags & BIG_ENDIAN else "<Q", lead_in, 12)[0]
            if length == OPEN_SEGMENT:
                return f"the segment at byte {at} was never closed by its writer: read as far as it goes"
            end = at + LEAD_IN_BYTES + length
            if end > size:
                return f"the segment at byte {at} ends at byte {size} of {end}: read as far as it goes"
            at = end
    return ""
