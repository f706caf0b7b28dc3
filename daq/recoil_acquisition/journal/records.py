"""The records of one segment of a journal, read back after a clean end or after a crash, and their counts.

What is damaged is skipped up to the next sound record, and counted. The layout is described in `journal.layout`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal.layout import (
    CRC,
    LONGEST_PAYLOAD,
    RECORD_HEAD,
    RECORD_OVERHEAD,
    RELEASED,
    UNKNOWN_SPAN,
    SegmentHeader,
)

_LARGEST_SEGMENT = 1 << 30
_MOST_FALSE_MARKS = 10_000
"""A damaged payload that is full of the session's bytes must not be tried at each of them for hours."""
_PAIR = struct.Struct("<QQ")


@dataclass(frozen=True, slots=True)
class JournalRecord:
    """One record.

    Attributes
    ----------
    sequence : int
        Its place in the journal, from 0, over all sources.
    source : int
        Number of the source.
    kind : int
        Kind of the payload, as the writer declared it.
    host_ns : int
        Monotonic host time, nanoseconds.
    payload : bytes
    span_us : int or None
        So long before `host_ns` the source was found empty; None if that is unknown.
    """

    sequence: int
    source: int
    kind: int
    host_ns: int
    payload: bytes
    span_us: int | None = None

    @property
    def from_ns(self) -> int:
        """Host time since which its content arrived; that of the read's return where it is unknown."""
        return self.host_ns - 1000 * (self.span_us or 0)


@dataclass(frozen=True)
class Segment:
    """What one segment file holds.

    Attributes
    ----------
    path : Path
    header : SegmentHeader
        That of the journal.
    count : int
        Whole records, those that list what was released among them.
    first_sequence, last_sequence : int
        Of its records; both 0 if there are none.
    oldest_ns, newest_ns : int
        Earliest and latest host time at which its content arrived; both 0 if there are none.
    cut_bytes : int
        Bytes between its whole records, and behind the last up to the last that is not zero.
    released : tuple of (int, int)
        First and last sequence number of all that had been released when it was written, by its last list.
    """

    path: Path
    header: SegmentHeader
    count: int
    first_sequence: int
    last_sequence: int
    oldest_ns: int
    newest_ns: int
    cut_bytes: int
    released: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class JournalCounters:
    """What a journal has taken so far.

    Attributes
    ----------
    records : int
    bytes : int
        Of these records, heads included.
    reserved_bytes : int
        Space that is reserved and not yet used.
    unsynced_s : float
        Age of the oldest record that is not yet forced to the disk; 0 if all are.
    largest_sync_s : float
        Longest time that forcing to the disk took.
    released : int
        Records that were released.
    """

    records: int
    bytes: int
    reserved_bytes: int
    unsynced_s: float
    largest_sync_s: float
    released: int = 0


def survey_segment(path: Path, header: SegmentHeader, following: int) -> Segment:
    """Count what is whole in a segment.

    Parameters
    ----------
    path : Path
    header : SegmentHeader
        That of the journal.
    following : int
        Lowest sequence number that is not yet taken.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    content = _content(path)
    count, first, last, cut, end = 0, 0, 0, 0, header.size
    oldest = newest = 0
    released: tuple[tuple[int, int], ...] = ()
    for at, record in _scan(content, header, following):
        if not count:
            first, oldest, newest = record.sequence, record.from_ns, record.host_ns
        count += 1
        last = record.sequence
        oldest, newest = min(oldest, record.from_ns), max(newest, record.host_ns)
        cut += at - end
        end = at + RECORD_OVERHEAD + len(record.payload)
        if record.source == RELEASED:
            released = tuple(_PAIR.iter_unpack(record.payload))
    cut += len(content[end:].rstrip(b"\0"))
    return Segment(path, header, count, first, last, oldest, newest, cut, released)


def scan_segment(path: Path, header: SegmentHeader, lowest: int) -> Iterator[JournalRecord]:
    """Yield a segment's sound records in the order of their sequence numbers; damaged places are skipped.

    Parameters
    ----------
    path : Path
    header : SegmentHeader
        That of the journal.
    lowest : int
        Lowest sequence number that the first may have.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    for _, record in _scan(_content(path), header, lowest):
        yield record


def _content(path: Path) -> bytes:
    try:
        if (size := path.stat().st_size) > _LARGEST_SEGMENT:
            raise StoreError("is no segment of a journal", path=path, expected="at most 1 GiB", found=f"{size} bytes")
        return path.read_bytes()
    except OSError as error:
        raise StoreError(f"cannot be read: {error.strerror or error}", path=path) from error


def _scan(content: bytes, header: SegmentHeader, lowest: int) -> Iterator[tuple[int, JournalRecord]]:
    """Yield the sound records and where each begins.

    Behind a damaged record the next place with the session's bytes is tried. A number that was there before is a copy.
    """
    at, false_marks = header.size, 0
    while at >= 0:
        record = _record_at(content, at, header)
        if record is None:
            false_marks += 1
            if false_marks > _MOST_FALSE_MARKS:
                return
            at = content.find(header.session_id, at + 1)
            continue
        if record.sequence >= lowest:
            lowest = record.sequence + 1
            yield at, record
        at += RECORD_OVERHEAD + len(record.payload)


def _record_at(content: bytes, at: int, header: SegmentHeader) -> JournalRecord | None:
    start = at + RECORD_OVERHEAD
    if start > len(content):
        return None
    session_id, length, source, kind, span_us, host_ns, sequence = RECORD_HEAD.unpack_from(content, at)
    if session_id != header.session_id or length > min(LONGEST_PAYLOAD, len(content) - start):
        return None
    payload = content[start : start + length]
    crc = zlib.crc32(content[at : at + RECORD_HEAD.size], zlib.crc32(payload, header.seed))
    if CRC.unpack_from(content, at + RECORD_HEAD.size)[0] != crc:
        return None
    return JournalRecord(sequence, source, kind, host_ns, payload, None if span_us == UNKNOWN_SPAN else span_us)
