"""From the bytes of one file of a log to its records, past whatever is damaged in it."""

from __future__ import annotations

import errno
import os
import stat
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.files.regular_file import REGULAR_FLAGS
from recoil_acquisition.log.record import (
    CRC,
    HEAD,
    HEAD_SIZE,
    LONGEST_PAYLOAD,
    MARK,
    UNKNOWN,
    Record,
    crc_seed,
)

PIECE = 1 << 20
"""Bytes that are read at once."""

_BEGIN_BYTES = 1 << 22
"""Bytes at the beginning of a file in which a sound record shows of which log it is: behind several of the longest that
are damaged."""

MOST_FALSE_MARKS = 1_000_000
"""Number of marks of a damaged payload that are tried at most: one that is full of them must not take hours."""


class Head(NamedTuple):
    """The head of a record: where it is, the record without its payload, and what is said of that."""

    at: int
    record: Record
    length: int
    payload_crc: int

    @property
    def end(self) -> int:
        """Byte behind the record."""
        return self.at + HEAD_SIZE + self.length


@dataclass(frozen=True)
class Damage:
    """A damaged place of a file.

    Attributes
    ----------
    at, size
        Place of the first damaged byte, and number of bytes up to the next sound record.
    """

    path: Path
    at: int
    size: int


class FileScan:
    """One file of a log, read record by record.

    It may be written meanwhile: what was read in part is read again. A place counts as damaged only when a sound record
    stands behind it.

    Parameters
    ----------
    log_id
        Identifier of the log: records of another one are none.

    Attributes
    ----------
    at
        First byte that is not accounted for.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """

    def __init__(self, path: Path, log_id: bytes) -> None:
        self.path = path
        self.at = 0
        self.damages: list[Damage] = []
        self.log_id = log_id
        self._seed = crc_seed(log_id)
        self._needle = MARK + log_id
        self._false_marks = 0
        self._buffer, self._begin = b"", 0
        with system_errors_as(StoreError, path, "read"):
            self._descriptor = _opened(path)

    def __enter__(self) -> FileScan:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._descriptor)

    def __iter__(self) -> Iterator[Record]:
        while True:
            head, record = self._next()
            if record is None:
                self._buffer = b""  # what is written at this moment may have been read in part
                head, record = self._next()
            if record is not None:
                self.at += HEAD_SIZE + len(record.payload)
                yield record
            elif self._behind_damage(head) is None:
                return

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return os.fstat(self._descriptor).st_size

    @property
    def unfinished(self) -> int:
        """Bytes from `at` to the last that is not zero: of a record that is not finished, or damaged."""
        last, at = self.at, self.at
        while piece := self._read(at, PIECE):
            if kept := len(piece.rstrip(b"\0")):
                last = at + kept
            at += len(piece)
        return last - self.at

    def head_from(self, at: int, until: int) -> Head | None:
        """Return the first sound head that begins at or behind a byte, and before another; None if there is none."""
        while (found := self._find(at, until)) is not None:
            head = self._head(found)
            if head is not None:
                return head
            at = found + 1
        return None

    def _next(self) -> tuple[Head | None, Record | None]:
        """Return the head at `at` and its record; None for what is not sound."""
        head = self._head(self.at)
        return head, None if head is None else self._whole(head)

    def _behind_damage(self, damaged: Head | None) -> Head | None:
        """Return the next sound head, having noted what is damaged before it; None if there is none up to the end.

        Where the head is sound and its payload is not, the record behind it is tried first: a payload may hold what
        looks like heads. But a page that was moved into the payload has whole records, which stand nowhere else.
        """
        head = None if damaged is None else self._head(damaged.end)
        if damaged is not None and head is not None:
            head = self._moved_into(damaged) or head
        at = self.at + (1 if damaged is None else HEAD_SIZE)
        while head is None and self._false_marks < MOST_FALSE_MARKS:
            found = self._find(at, None)
            if found is None:
                return None
            head = self._head(found)
            self._false_marks += head is None
            at = found + 1
        if head is not None:
            self.damages.append(Damage(self.path, self.at, head.at - self.at))
            self.at = head.at
        return head

    def _moved_into(self, damaged: Head) -> Head | None:
        """Return the first head of a whole record within a payload that is damaged; None if there is none."""
        at, until = damaged.at + HEAD_SIZE, damaged.end
        while self._false_marks < MOST_FALSE_MARKS and (head := self.head_from(at, until)) is not None:
            if head.end <= until and self._whole(head) is not None:
                return head
            self._false_marks += 1
            at = head.at + 1
        return None

    def _find(self, at: int, until: int | None) -> int | None:
        """Return where the mark and the log's bytes stand next; None if nowhere before a byte."""
        while until is None or at < until:
            piece = self._bytes(at, len(self._needle))
            if len(piece) < len(self._needle):
                return None
            found = self._buffer.find(self._needle, at - self._begin)
            if found >= 0:
                found += self._begin
                return found if until is None or found < until else None
            at = self._begin + len(self._buffer) - len(self._needle) + 1
        return None

    def _head(self, at: int) -> Head | None:
        content = self._bytes(at, HEAD_SIZE)
        return sound_head(content, at, self._seed)

    def _whole(self, head: Head) -> Record | None:
        """Return a record with its payload; None if that is damaged or not there yet."""
        payload = self._bytes(head.at + HEAD_SIZE, head.length)
        if len(payload) < head.length or zlib.crc32(payload, self._seed) != head.payload_crc:
            return None
        return head.record._replace(payload=payload)

    def _bytes(self, at: int, size: int) -> bytes:
        begin = at - self._begin
        if begin < 0 or begin + size > len(self._buffer):
            self._buffer, self._begin = self._read(at, max(size, PIECE)), at
            begin = 0
        return self._buffer[begin : begin + size]

    def _read(self, at: int, size: int) -> bytes:
        with system_errors_as(StoreError, self.path, "read"):
            if hasattr(os, "pread"):
                return os.pread(self._descriptor, size, at)
            os.lseek(self._descriptor, at, os.SEEK_SET)
            return os.read(self._descriptor, size)


def sound_head(content: bytes, at: int, seed: int | None) -> Head | None:
    """Return the head that some bytes begin with, or None.

    Parameters
    ----------
    at
        Place of the bytes in their file.
    seed
        Start of the CRCs of the log that the record must be of; None for any.
    """
    if len(content) < HEAD_SIZE:
        return None
    (mark, found_id, length, source, kind, span_us, wait_us, source_number, number, position, host_ns, payload_crc) = (
        HEAD.unpack_from(content)
    )
    if mark != MARK or length > LONGEST_PAYLOAD:
        return None
    crc = zlib.crc32(content[: HEAD.size], crc_seed(found_id) if seed is None else seed)
    if crc != CRC.unpack_from(content, HEAD.size)[0]:
        return None
    record = Record(
        number, source, kind, host_ns, b"",
        None if span_us == UNKNOWN else span_us,
        None if wait_us == UNKNOWN else wait_us,
        source_number, position,
    )  # fmt: skip
    return Head(at, record, length, payload_crc)


def first_log_id(path: Path, within: int = _BEGIN_BYTES) -> bytes | None:
    """Return the random bytes of the log to which the first sound head of a file belongs.

    Parameters
    ----------
    within
        Bytes of its beginning that are looked at.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    with system_errors_as(StoreError, path, "read"), os.fdopen(_opened(path), "rb", buffering=0) as stream:
        begin = stream.read(HEAD_SIZE)
        if sound_head(begin, 0, None) is None:
            begin += stream.read(within)
    at = begin.find(MARK)
    while at >= 0:
        if sound_head(begin[at : at + HEAD_SIZE], at, None) is not None:
            return begin[at + len(MARK) : at + len(MARK) + 8]
        at = begin.find(MARK, at + 1)
    return None


def is_hole(path: Path) -> bool:
    """Return whether a file was reserved and never written, where the system knows; OSError if it cannot be opened."""
    if not hasattr(os, "SEEK_DATA"):
        return False
    descriptor = _opened(path)
    try:
        os.lseek(descriptor, 0, os.SEEK_DATA)
    except OSError as error:
        return error.errno == errno.ENXIO
    finally:
        os.close(descriptor)
    return False


def _opened(path: Path) -> int:
    """Open a file to read it; OSError if it cannot be, `StoreError` if it is none: a pipe may never end."""
    descriptor = os.open(path, REGULAR_FLAGS)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise StoreError(
        "is a pipe, a device or a folder", path=path, expected="a file of a log", remedy="move it out of the folder"
    )
