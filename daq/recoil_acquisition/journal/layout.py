"""The bytes of a journal: what a segment begins with, and what a record is made of.

A journal is a folder of segments, ``000001.journal``, ``000002.journal``, ... All numbers are little
endian. Every segment begins with the same header, so that each can be read without the others:

======================  ======  =========================================================
offset                  bytes   content
======================  ======  =========================================================
0                       21      `MAGIC`, a line of text that ends with the format's version
21                      8       random bytes that tell this session from others
29                      4       length n of the session's text, unsigned
33                      n       the session as JSON in UTF-8
33 + n                  4       CRC-32 of all bytes before it
======================  ======  =========================================================

Then follow the records, each in one piece and in one segment:

======================  ======  =========================================================
offset                  bytes   content
======================  ======  =========================================================
0                       8       the session's random bytes: what a reader looks for behind damage
8                       4       length n of the payload, unsigned, at most `LONGEST_PAYLOAD`
12                      2       number of the source, unsigned
14                      2       kind of the payload, unsigned; its meaning is the writer's
16                      4       span, unsigned, microseconds: so long before the host time the source was found empty
20                      8       host time, monotonic, nanoseconds, signed
28                      8       sequence number, unsigned, from 0 over the whole journal
36                      4       CRC-32 of the payload and then of bytes 0 to 35
40                      n       payload
======================  ======  =========================================================

The CRC is zlib's (ISO 3309, reflected polynomial 0xEDB88320). That of a record starts from the CRC of the
session's random bytes, not from zero: what another session left on the disk does not pass for a record of this one.

What a record holds arrived within its span: after the source was found empty, before the read returned. `UNKNOWN_SPAN`
says that the time is unknown or longer.

A segment's space is reserved with zeros. A head of zeros has a wrong CRC, so zeros behind the last
record are the end. Sequence numbers are consecutive but for what was lost or released on purpose. A record of the
source `RELEASED` lists all that was released so far: pairs of first and last sequence number, eight bytes each.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

SUFFIX = ".journal"

MAGIC = b"recoil-daq journal 1\n"

RECORD_HEAD = struct.Struct("<8sIHHIqQ")
"""Session's bytes, payload length, source, kind, span, host time, sequence number; the CRC follows."""

CRC = struct.Struct("<I")

RECORD_OVERHEAD = RECORD_HEAD.size + CRC.size
"""Bytes of a record beside its payload."""

LONGEST_PAYLOAD = 1 << 20
"""Bytes; a head that says more is damaged."""

UNKNOWN_SPAN = 0xFFFFFFFF
"""Span of a record whose source was not seen empty before, or longer ago than fits."""

RELEASED = 0xFFFE
"""Source of the records that list what was released."""

_HEADER_HEAD = struct.Struct("<8sI")


@dataclass(frozen=True)
class SegmentHeader:
    """What a segment begins with.

    Attributes
    ----------
    session_id : bytes
        Eight random bytes, the same in every segment of a journal.
    session : mapping
        What the writer says of its sources, clocks and rig; JSON types.
    size : int
        Bytes of the header.
    """

    session_id: bytes
    session: Mapping[str, Any]
    size: int

    @property
    def seed(self) -> int:
        """Where the CRC of every record starts from."""
        return crc_seed(self.session_id)


def crc_seed(session_id: bytes) -> int:
    """Return where the CRC of every record of a session starts from."""
    return zlib.crc32(session_id)


def pack_header(session_id: bytes, session_text: bytes) -> bytes:
    """Return the header of every segment; `session_text` is JSON in UTF-8."""
    content = MAGIC + _HEADER_HEAD.pack(session_id, len(session_text)) + session_text
    return content + CRC.pack(zlib.crc32(content))


def parse_header(content: bytes) -> SegmentHeader | None:
    """Take a segment's header apart.

    Parameters
    ----------
    content : bytes
        The beginning of a segment, the whole header at least.

    Returns
    -------
    SegmentHeader or None
        None if it is damaged, cut, or not that of a journal.
    """
    start = len(MAGIC) + _HEADER_HEAD.size
    if not content.startswith(MAGIC) or len(content) < start:
        return None
    session_id, length = _HEADER_HEAD.unpack_from(content, len(MAGIC))
    end = start + length
    if len(content) < end + CRC.size or CRC.unpack_from(content, end)[0] != zlib.crc32(content[:end]):
        return None
    try:
        session = json.loads(content[start:end])
    except ValueError:
        return None
    if not isinstance(session, dict):
        return None
    return SegmentHeader(session_id, session, end + CRC.size)


def header_size_stated(content: bytes) -> int | None:
    """Return how long a segment's header says it is; None if this is no segment's beginning."""
    start = len(MAGIC) + _HEADER_HEAD.size
    if not content.startswith(MAGIC) or len(content) < start:
        return None
    return start + int(_HEADER_HEAD.unpack_from(content, len(MAGIC))[1]) + CRC.size
