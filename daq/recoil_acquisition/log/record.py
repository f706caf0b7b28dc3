"""The bytes of a record, the one thing that a log is made of.

A log is what live acquisition received, in the order in which it was appended: a folder of segments ``000001.rdlog``,
``000002.rdlog``, ... A capture is one such file, a copy of a range of a log. No file has a header of its own: a file is
records one behind the other, and zeros where space is reserved. All numbers are little endian and unsigned, but for
the host time. Each record stands in one piece in one segment:

======================  ======  =========================================================
offset                  bytes   content
======================  ======  =========================================================
0                       4       `MARK`
4                       8       random bytes of this log: with the mark, what is searched for behind damage
12                      4       length n of the payload, at most `LONGEST_PAYLOAD`
16                      2       number of the source; `OWN` of what the log says itself
18                      2       `Kind` of the payload
20                      4       span, microseconds: so long before the host time the source was found empty
24                      4       wait, microseconds, rounded up: so long after the host time the record was appended
28                      4       number of the record within its source, from 0
32                      8       number of the record within the log, from 0
40                      8       bytes of this source's payloads before this one
48                      8       host time at which the read returned, monotonic, nanoseconds, signed
56                      4       CRC-32 of the payload
60                      4       CRC-32 of bytes 0 to 59
64                      n       payload
======================  ======  =========================================================

The CRC is zlib's (ISO 3309, reflected polynomial 0xEDB88320). Both start from the CRC of the log's random bytes, not
from zero: what another log left on the disk does not pass for a record of this one. `UNKNOWN` as a span or a wait
stands for unknown or longer. Host time and wait together never run backwards over a log, by more than a microsecond.

A record of a device holds what one read returned, as it came. Every other payload is a JSON object:

========  ================================================================================
kind      content
========  ================================================================================
EVENT     ``event``, ``detail``: what happened to the device; numbered among its data
IDLE      nothing: the source was looked at and was silent; once a second while it is
SESSION   ``schema``, ``longest_us``, ``part``, ``of``, ``text``: what the writer says of its session, JSON cut into
          parts; first in every segment, twice in the first, in pages of 4 KiB of their own unless the segment is
          small; without a number in a capture of a log in which all are damaged. ``longest_us`` is the longest wait
          and span together of all records before it, null if it is not known
CLOCK     ``wall_ns``, ``monotonic_ns``, ``within_ns``: an instant on both clocks of the host
DECISION  what the trigger decided
KEPT      a stretch that is kept for another reason
SHOT      a shot that is complete; in a capture, what it holds
RELEASED  ``records`` and ``sources``: what was given back on purpose so far, spans ``[first, last, bytes]`` of numbers
          within the log and within each source
CLOSED    ``sources``: records and bytes of each, ``longest_us`` as above; twice at the orderly
          end: of several segments, the second time in one of its own
========  ================================================================================
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple

from recoil_acquisition.files.strict_json import read_json

SCHEMA = "recoil-daq/log/1"

MARK = b"\x8dRDL"

HEAD = struct.Struct("<4s8sIHHIIIQQqI")
"""Mark, log, length, source, kind, span, wait, number in source, number, position, host time, CRC of the payload."""

CRC = struct.Struct("<I")

HEAD_SIZE = HEAD.size + CRC.size

LONGEST_PAYLOAD = 1 << 20
"""Bytes; a head that says more is damaged."""

UNKNOWN = 0xFFFFFFFF

OWN = 0xFFFF
"""Number of the source of what the log says itself."""

UNNUMBERED = (1 << 64) - 1
"""Number of a record that was made for a capture and is in no log."""


class Kind(IntEnum):
    """Kind of a payload."""

    CAN = 1
    SERIAL = 2
    STREAM = 3
    EVENT = 16
    IDLE = 17
    SESSION = 32
    CLOCK = 33
    DECISION = 34
    KEPT = 35
    SHOT = 36
    RELEASED = 37
    CLOSED = 38


DATA = (Kind.CAN, Kind.SERIAL, Kind.STREAM)
"""Kinds of what devices delivered."""


class Record(NamedTuple):
    """One record.

    Attributes
    ----------
    number
        Number within the log.
    host_ns
        Monotonic host time at which the read returned, nanoseconds.
    span_us
        Time before `host_ns` at which the source was found empty; None if that is unknown.
    wait_us
        Time after `host_ns` at which the record was appended; None if that is unknown.
    source_number
        Number within the source.
    position
        Bytes of the source's payloads before this one.
    """

    number: int
    source: int
    kind: int
    host_ns: int
    payload: bytes
    span_us: int | None
    wait_us: int | None
    source_number: int
    position: int

    @property
    def from_ns(self) -> int:
        """Host time since which its content arrived; that of the read's return where it is unknown."""
        return self.host_ns - 1000 * (self.span_us or 0)

    @property
    def logged_ns(self) -> int | None:
        """Host time at which it was appended, to a microsecond above; None if that is unknown."""
        return None if self.wait_us is None else self.host_ns + 1000 * self.wait_us

    def within(self, start_ns: int | None, stop_ns: int | None) -> bool:
        """Return whether something of it may have arrived in ``start_ns <= t < stop_ns``; None for no limit."""
        return (start_ns is None or self.host_ns >= start_ns) and (stop_ns is None or self.from_ns < stop_ns)

    @property
    def said(self) -> dict[str, Any]:
        """Content of a payload that is JSON; ValueError if it is no object."""
        try:
            content = read_json(self.payload)
        except RecursionError as error:
            raise ValueError("the payload is nested too deeply") from error
        if not isinstance(content, dict):
            raise ValueError("the payload is no JSON object")
        return content


def crc_seed(log_id: bytes) -> int:
    """Return where every CRC of a log starts from."""
    return zlib.crc32(log_id)


def pack_head(
    log_id: bytes,
    seed: int,
    length: int,
    source: int,
    kind: int,
    span_us: int,
    wait_us: int,
    source_number: int,
    number: int,
    position: int,
    host_ns: int,
    payload_crc: int,
) -> bytes:
    """Return the head of a record; struct.error if a number does not fit."""
    head = HEAD.pack(
        MARK, log_id, length, source, kind, span_us, wait_us, source_number, number, position, host_ns, payload_crc
    )
    return head + CRC.pack(zlib.crc32(head, seed))


def pack_record(log_id: bytes, record: Record) -> bytes:
    """Return the bytes of a record, the same that it was read from."""
    seed = crc_seed(log_id)
    span_us = UNKNOWN if record.span_us is None else record.span_us
    wait_us = UNKNOWN if record.wait_us is None else record.wait_us
    return pack_head(
        log_id, seed, len(record.payload), record.source, record.kind, span_us, wait_us, record.source_number,
        record.number, record.position, record.host_ns, zlib.crc32(record.payload, seed),
    ) + record.payload  # fmt: skip


def pack_json(content: Mapping[str, Any]) -> bytes:
    """Return the payload of a record that is JSON; ValueError or TypeError if the content is not JSON."""
    return json.dumps(dict(content), allow_nan=False).encode()
