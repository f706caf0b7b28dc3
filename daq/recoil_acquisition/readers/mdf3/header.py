"""The header block of an MDF 2 or 3 file: when the recording began, and what it is.

Layout (MDF 3.3.1, HD block): date and time as text, of the recorder's wall clock, without a zone. From version 3.20 on,
the start in ns since 1970, in local time without its summer time, and the zone in whole hours; some programs write the
former in UTC, and a zone of 0 is what they write who know none.
"""

from __future__ import annotations

from datetime import datetime
from typing import Any

import numpy as np

from recoil_acquisition.readers.mdf.channel_groups import HD_AT
from recoil_acquisition.readers.mdf3.blocks import OldBlocks
from recoil_acquisition.timebase import AbsoluteStart

_STAMP_AT = 164
_PEOPLE = ("author", "organisation", "project", "subject")
_HOUR_S = 3600
_FARTHEST_H = 14
"""The largest offset that any zone has."""


class OldHeader:
    """The header of a file.

    Attributes
    ----------
    first_at
        Address of the first data group, or 0.
    start
        None if the file states none.
    metadata
        What else it says, JSON types only.
    notes
        Contradictions.
    """

    def __init__(self, blocks: OldBlocks) -> None:
        length, fields = blocks.block(HD_AT, "HD")
        self.first_at, comment_at, _, _, date, time, *people = fields
        self.linked = {self.first_at, comment_at, fields[2]}
        has_stamp = length >= _STAMP_AT + 10
        stamp_ns, offset_h = blocks.unpacked("Qh", HD_AT + _STAMP_AT) if has_stamp else (0, 0)
        self.start, self.notes = _start(f"{blocks.decoded(date)} {blocks.decoded(time)}", stamp_ns, offset_h)
        stated = zip(_PEOPLE, map(blocks.decoded, people), strict=True)
        self.metadata: dict[str, Any] = {
            "version": blocks.decoded(blocks.content[8:16]),
            "program": blocks.decoded(blocks.content[16:24]),
            "comment": blocks.text(comment_at),
            "utc_offset_h": offset_h if has_stamp else None,
            **{name: text for name, text in stated if text},
        }


def _start(printed: str, stamp_ns: int, offset_h: int) -> tuple[AbsoluteStart | None, list[str]]:
    try:
        local = datetime.strptime(printed, "%d:%m:%Y %H:%M:%S")
    except ValueError:
        return None, []
    local_s = round((local - datetime(1970, 1, 1)).total_seconds())
    if not 0 < local_s < 2**63 // 10**9:
        return None, []
    whole_s, part_ns = divmod(stamp_ns, 10**9)
    zone, notes = "unknown", []
    if stamp_ns and local_s - whole_s not in (0, _HOUR_S, _HOUR_S * offset_h):
        notes, part_ns = ["the header states two starts that are at odds: that of date and time is taken"], 0
    elif stamp_ns and (hours := _zone_h(local_s - whole_s, offset_h)) is not None:
        zone = f"{hours:+03d}:00"
    return AbsoluteStart(str(np.datetime64(10**9 * local_s + part_ns, "ns")), zone, "header of the file"), notes


def _zone_h(ahead_s: int, offset_h: int) -> int | None:
    """Return by how many hours date and time are ahead of UTC; None if that is open.

    Parameters
    ----------
    ahead_s
        By which date and time are ahead of the other start: 0 or an hour of summer time if that is local, the offset
        if it is UTC. Where the offset is one hour, an hour may be either.
    offset_h
        As stated.
    """
    if not 0 < abs(offset_h) <= _FARTHEST_H or (offset_h == 1 and ahead_s):
        return None
    return offset_h + 1 if ahead_s == _HOUR_S else offset_h
