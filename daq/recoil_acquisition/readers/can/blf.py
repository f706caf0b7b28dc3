"""Vector BLF: objects in compressed containers.

Layout (little endian), as documented by the open implementations of the format, Vector_BLF by
Tobias Lorenz and python-can: a file header ``LOGG`` with its own size, the file's size, the number
of objects and two SYSTEMTIMEs, then objects ``LOBJ``. An object of type 10 holds a zlib stream of
further objects, which may run on from one container into the next. The objects themselves:
`recoil_acquisition.readers.can.blf_objects`.
"""

from __future__ import annotations

import datetime as dt
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.can.blf_objects import OBJECT, PIECE_BYTES, ObjectStream
from recoil_acquisition.readers.can.frames import DATE_FAULT, CanLog, FrameList
from recoil_acquisition.readers.can.second_recording import SecondRecordingError
from recoil_acquisition.readers.recording import Caution
from recoil_acquisition.timebase import AbsoluteStart

MAGIC = b"LOGG"

_FILE_HEADER = struct.Struct("<4sL8BQQLL8H8H")
_CONTAINER = struct.Struct("<H6xL4x")
_CONTAINER_TYPE = 10
_DEFLATED = 2


def read_blf(path: Path, content: bytes) -> CanLog:
    """Read a BLF log.

    Parameters
    ----------
    path
        For messages.
    content
        The whole file.

    Returns
    -------
    CanLog
        Time from the start of measurement.

    Raises
    ------
    CorruptFileError
        If its header is cut, a container does not inflate, or objects do not follow each other.
    ReadError
        If it would unpack to more than a log does, or is compressed in a way that is not known.
    """
    if len(content) < _FILE_HEADER.size or not content.startswith(MAGIC):
        raise CorruptFileError(
            "the file header is cut",
            path=path,
            file_end=FileEnd.MISSING,
            expected=f"{_FILE_HEADER.size} bytes beginning with LOGG",
            found=f"{len(content)} bytes",
        )
    header = _FILE_HEADER.unpack_from(content)
    header_size, file_size, object_count = header[1], header[10], header[12]
    cuts = []
    if file_size and file_size > len(content):
        cuts.append(f"the file is cut: its header states {file_size} bytes, it has {len(content)}")
    found = FrameList()
    objects = ObjectStream(path, found)
    cut = False
    for piece in _pieces(path, content, header_size):
        if piece is None:
            cut = True
        else:
            objects.add(piece)
    if objects.end() or cut:
        cuts.append("the log ends inside an object: what follows is lost")
    not_known = "; ".join(
        f"object header version {version} is not known: {n} frames were not read"
        for version, n in sorted(objects.unknown_versions.items())
    )
    metadata = {
        **found.counts(),
        "objects_stated": object_count,
        "measurement_start": _system_time(header[14:22]),
        **(
            {"other_kinds": {str(kind): n for kind, n in sorted(objects.other_kinds.items())}}
            if objects.other_kinds
            else {}
        ),
    }
    start = _start(header[14:22])
    notes = [*found.notes(), *([Caution(not_known)] if not_known else []), *cuts]
    if start is None and any(header[14:22]):
        metadata[DATE_FAULT] = f"when the measurement began is not understood: {_system_time(header[14:22])}"
        notes.append(metadata[DATE_FAULT])
    return CanLog(found.frames()[0], start, tuple(notes), "; ".join(cuts), metadata, not_known=not_known)


def _pieces(path: Path, content: bytes, at: int) -> Iterator[bytes | memoryview | None]:
    """Yield the objects of all containers, one after the other in pieces; None at the end if the last one is cut."""
    left = most_unpacked(len(content))
    whole_file = memoryview(content)
    while at < len(content):
        found = content.find(b"LOBJ", at, at + 8)
        if found < 0 or found + OBJECT.size > len(content):
            if content[at:].strip(b"\0") == b"":
                return
            if content.find(MAGIC, at, at + 8) >= 0:
                raise SecondRecordingError("put behind the first, with a header of its own", f"byte {at}").of(path)
            if len(content) - at < OBJECT.size + 4:
                yield None
                return
            raise CorruptFileError("no object follows the one before", path=path, place=f"byte {at}", expected="LOBJ")
        _, _, _, size, kind = OBJECT.unpack_from(content, found)
        if size < OBJECT.size:
            raise CorruptFileError(
                "an object is smaller than its header", path=path, place=f"byte {found}", found=f"{size} bytes"
            )
        whole = found + size <= len(content)
        if kind == _CONTAINER_TYPE and found + OBJECT.size + _CONTAINER.size <= len(content):
            method, stated = _CONTAINER.unpack_from(content, found + OBJECT.size)
            packed = whole_file[found + OBJECT.size + _CONTAINER.size : found + size]
            left -= stated if method == _DEFLATED else 0
            if left < 0:
                raise ReadError(
                    f"the log unpacks to more than {most_unpacked(len(content)) / 1e6:.0f} MB", path=path,
                    place=f"byte {found}", remedy="save it in parts, or without compression, if this is right",
                )  # fmt: skip
            yield from _unpacked(path, found, method, stated, packed, whole=whole)
        elif kind != _CONTAINER_TYPE and whole:
            yield content[found : found + size]
        if not whole:
            yield None
            return
        at = found + size


def _unpacked(
    path: Path, at: int, method: int, stated: int, packed: memoryview, *, whole: bool
) -> Iterator[bytes | memoryview]:
    """Yield what a container holds."""
    if method == 0:
        yield packed
        return
    if method != _DEFLATED:
        raise ReadError(
            f"the compression {method} of a container is not known", path=path, place=f"byte {at}", expected="0 or 2",
            remedy="save it without compression, or as ASC",
        )  # fmt: skip
    inflate, size, most = zlib.decompressobj(), 0, max(stated, 1)
    try:
        for begin in range(0, len(packed), PIECE_BYTES):
            left: bytes | memoryview = packed[begin : begin + PIECE_BYTES]
            while size < most and not inflate.eof:
                piece = inflate.decompress(left, min(most - size, PIECE_BYTES))
                if not piece:
                    break
                size, left = size + len(piece), inflate.unconsumed_tail
                yield piece
    except zlib.error as error:
        raise CorruptFileError(
            "a container does not inflate", path=path, place=f"byte {at}", remedy="copy the file again"
        ) from error
    if whole and size != stated:
        raise CorruptFileError(
            "a container is incomplete", path=path, place=f"byte {at}",
            expected=f"{stated} bytes", found=f"{size}",
        )  # fmt: skip


def _system_time(fields: tuple[int, ...]) -> str:
    year, month, _, day, hour, minute, second, milliseconds = fields
    return f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:02d}.{milliseconds:03d}"


def _start(fields: tuple[int, ...]) -> AbsoluteStart | None:
    """Return the start of measurement, if it is a time at all."""
    text = _system_time(fields)
    try:
        dt.datetime.fromisoformat(text)
    except ValueError:
        return None
    return AbsoluteStart(
        text, "unknown", "BLF file header; by convention local time of the recorder, some writers use UTC"
    )
