"""The records of one segment of a journal, read back after a clean end or after a crash, and their counts.

A segment is taken up to its first record that is not whole and right; what lies behind is counted, never
returned. The layout is described in `daq.journal.layout`.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from daq.errors import StoreError
from daq.journal.layout import CRC, RECORD_HEAD, RECORD_OVERHEAD, SegmentHeader

_BLOCK_BYTES = 1 << 20


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
    """

    sequence: int
    source: int
    kind: int
    host_ns: int
    payload: bytes


@dataclass(frozen=True)
class Segment:
    """What one segment file holds.

    Attributes
    ----------
    path : Path
    header_bytes : int
        Where its records start.
    count : int
        Whole records.
    first_sequence, last_sequence : int
        Of its records; both 0 if there are none.
    oldest_ns, newest_ns : int
        Earliest and latest host time of its records; both 0 if there are none.
    cut_bytes : int
        Bytes behind the last whole record, up to the last that is not zero.
    """

    path: Path
    header_bytes: int
    count: int
    first_sequence: int
    last_sequence: int
    oldest_ns: int
    newest_ns: int
    cut_bytes: int


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
    """

    records: int
    bytes: int
    reserved_bytes: int
    unsynced_s: float
    largest_sync_s: float


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
    StoreError, OSError
        If the file cannot be read.
    """
    count, first, last, end = 0, 0, 0, header.size
    oldest = newest = 0
    for record in scan_segment(path, header.size, header.seed, following):
        if not count:
            first, oldest, newest = record.sequence, record.host_ns, record.host_ns
        count += 1
        last = record.sequence
        oldest, newest = min(oldest, record.host_ns), max(newest, record.host_ns)
        end += RECORD_OVERHEAD + len(record.payload)
    return Segment(path, header.size, count, first, last, oldest, newest, _used_bytes(path, end))


def scan_segment(path: Path, start: int, seed: int, lowest: int) -> Iterator[JournalRecord]:
    """Yield a segment's records up to the first that is not whole and right.

    Parameters
    ----------
    path : Path
    start : int
        Where the records start.
    seed : int
        Where their CRC starts from.
    lowest : int
        Lowest sequence number that the first may have; the others must follow it without a gap.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    try:
        with path.open("rb", buffering=_BLOCK_BYTES) as stream:
            left = path.stat().st_size - start
            stream.seek(start)
            expected: int | None = None
            while (record := _next_record(stream, left, seed)) is not None:
                if record.sequence != expected if expected is not None else record.sequence < lowest:
                    return
                yield record
                expected = record.sequence + 1
                left -= RECORD_OVERHEAD + len(record.payload)
    except OSError as error:
        raise StoreError(f"cannot be read: {error.strerror or error}", path=path) from error


def _next_record(stream: IO[bytes], left: int, seed: int) -> JournalRecord | None:
    start = stream.read(RECORD_OVERHEAD)
    if len(start) < RECORD_OVERHEAD:
        return None
    head = start[: RECORD_HEAD.size]
    length, source, kind, host_ns, sequence = RECORD_HEAD.unpack(head)
    # A damaged length must not make the reader ask for gigabytes
    if length > left - RECORD_OVERHEAD:
        return None
    payload = stream.read(length)
    if len(payload) < length or CRC.unpack_from(start, RECORD_HEAD.size)[0] != zlib.crc32(
        head, zlib.crc32(payload, seed)
    ):
        return None
    return JournalRecord(sequence, source, kind, host_ns, payload)


def _used_bytes(path: Path, start: int) -> int:
    """Count the bytes from `start` up to the last that is not zero."""
    used = at = 0
    with path.open("rb") as stream:
        stream.seek(start)
        while block := stream.read(_BLOCK_BYTES):
            if stripped := block.rstrip(b"\0"):
                used = at + len(stripped)
            at += len(block)
    return used
