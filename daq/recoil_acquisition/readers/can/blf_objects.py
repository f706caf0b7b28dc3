"""Vector BLF: frames and other events as objects, in compressed containers.

Layout (little endian), as documented by the open implementations of the format, Vector_BLF by Tobias Lorenz and
python-can: a file header ``LOGG`` with its own size, the file's size, the number of objects and two SYSTEMTIMEs, then
objects ``LOBJ``. An object states the size of its header, the header's version, its own size and its kind. One of kind
10 holds a zlib stream of further objects, which may run on from one container into the next. The stamp of an object is
in units of 10 µs or 1 ns from the start of measurement, and negative before a trigger.
"""

from __future__ import annotations

import datetime as dt
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.can.frames import (
    DATE_FAULT,
    EXTENDED,
    FD_LENGTHS,
    ID_MASK,
    LATEST_NS,
    CanLog,
    FrameBlock,
    FrameList,
    is_length_of,
)
from recoil_acquisition.readers.can.second_recording import SecondRecordingError
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode

OBJECT = struct.Struct("<4sHHLL")
PIECE_BYTES = 1 << 20
"""Bytes of objects that are held at a time, about; an object of more is no frame."""

_STAMP = struct.Struct("<L4xq")
_CLASSIC = struct.Struct("<HBBL8s")
_FD = struct.Struct("<HBBLLBBB5x64s")
_FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")
_OBJECT_FIELDS = np.dtype([("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4")])
_STAMP_FIELDS = np.dtype([("flags", "<u4"), ("client", "<u2"), ("version", "<u2"), ("ticks", "<i8")])
_CLASSIC_FIELDS = np.dtype(
    [("channel", "<u2"), ("flags", "u1"), ("length", "u1"), ("identifier", "<u4"), ("data", "u1", 8)]
)
_CLASSIC_TYPES = (1, 86)
_FD_TYPES = (100, 101)
_ERROR_TYPES = (2, 73, 104)
_HEADER_SIZES = {1: 32, 2: 40}
_TICKS_NS = {1: 10_000, 2: 1}
_NEAR = 8
"""Bytes behind an object within which the next one's sign ends; an object may be filled up to four."""
_REMOTE = 0x80
_REMOTE_FD_64 = 0x10

MAGIC = b"LOGG"
_FILE_HEADER = struct.Struct("<4sL8BQQLL8H8H")
_CONTAINER = struct.Struct("<H6xL4x")
_CONTAINER_TYPE = 10
_DEFLATED = 2


class ObjectStream:
    """The objects of a log, which come in pieces: those that are whole are read together.

    Parameters
    ----------
    path
        File, for messages.
    found
        List that the frames are added to, and in which what is no data frame is counted.

    Attributes
    ----------
    unknown_versions
        Frames by the version of their headers, where it is not known: they are not read.
    other_kinds
        Objects that are no frames, by their kind.
    """

    def __init__(self, path: Path, found: FrameList) -> None:
        self._path, self._found = path, found
        self.unknown_versions: Counter[int] = Counter()
        self.other_kinds: Counter[int] = Counter()
        self._pieces: list[bytes | memoryview] = []
        self._held_bytes = 0
        self._begin = 0
        self._to_skip = 0

    def add(self, piece: bytes | memoryview) -> None:
        """Take the next bytes; raises `CorruptFileError` if objects do not follow each other."""
        skipped = min(self._to_skip, len(piece))
        self._to_skip -= skipped
        self._begin += skipped
        self._pieces.append(piece[skipped:])
        self._held_bytes += len(piece) - skipped
        if self._held_bytes >= PIECE_BYTES:
            self._keep(self._read(b"".join(self._pieces)))

    def end(self) -> bool:
        """Read what is left, and return whether the last object is cut; raises as `add`."""
        self._keep(self._read(b"".join(self._pieces)))
        left = b"".join(self._pieces)
        self._begins_by_steps(left)  # of too few bytes to be looked at before
        return self._to_skip > 0 or left.strip(b"\0") != b""

    def _keep(self, left: bytes) -> None:
        """Keep the bytes behind the last whole object, unless they are of one that is too large for a frame."""
        at = left.find(b"LOBJ", 0, _NEAR)
        size = OBJECT.unpack_from(left, at)[3] if at >= 0 and at + OBJECT.size <= len(left) else 0
        if size > PIECE_BYTES:
            self._found.other_events += 1
            self._to_skip = at + size - len(left)
            left = b""
        elif not left.strip(b"\0"):
            left = left[:_NEAR]
        self._begin += self._held_bytes - len(left)
        self._pieces, self._held_bytes = [left], len(left)

    def _read(self, objects: bytes) -> bytes:
        """Add the frames of the objects that are whole; return what is left behind them."""
        content = np.frombuffer(objects, dtype=np.uint8)
        begins = _begins_at_once(content)
        if begins is None:
            begins = self._begins_by_steps(objects)
        if not begins.size:
            return objects
        head = _fields(content, begins, _OBJECT_FIELDS)
        size = head["size"].astype(np.int64)
        versions = head["version"]
        is_frame = np.isin(head["kind"], (*_CLASSIC_TYPES, *_FD_TYPES, *_ERROR_TYPES))
        later = is_frame & ~np.isin(versions, list(_HEADER_SIZES))
        self.unknown_versions.update(versions[later].tolist())
        header = np.where(versions == 1, _HEADER_SIZES[1], _HEADER_SIZES[2])
        known = np.isin(versions, list(_HEADER_SIZES)) & (size >= header)
        contradicting = is_frame & known & (head["header"] != header)
        self._found.damaged += int(np.count_nonzero(contradicting))
        known &= ~contradicting
        classic = np.flatnonzero(
            known & np.isin(head["kind"], _CLASSIC_TYPES) & (size - header >= _CLASSIC.size) & (size >= 48)
        )
        plain = _add_classic(content, begins[classic], header[classic], self._begin, self._found)
        rest = np.ones(begins.size, dtype=bool)
        rest[classic[plain]] = False
        # Not one by one: a log may have millions of them
        other = ~known | ~is_frame
        self._found.other_events += int(np.count_nonzero(rest & other & ~contradicting & ~later))
        self.other_kinds.update(head["kind"][rest & ~is_frame].tolist())
        for k in np.flatnonzero(rest & ~other).tolist():
            begin = int(begins[k])
            self._found.place = self._begin + begin
            flags, ticks = _STAMP.unpack_from(objects, begin + OBJECT.size)
            body = objects[begin + int(header[k]) : begin + int(size[k])]
            try:
                _read_object(int(head["kind"][k]), ticks * _TICKS_NS.get(flags, 1), int(header[k]), body, self._found)
            except (struct.error, ValueError):
                self._found.damaged += 1
        return objects[int(begins[-1] + size[-1]) :]

    def _begins_by_steps(self, objects: bytes) -> NDArray[np.int64]:
        """Return where the whole objects begin, going from each to the next."""
        begins: list[int] = []
        at, end = 0, len(objects)
        while True:
            at = objects.find(b"LOBJ", start := at, at + _NEAR)
            if at < 0 or at + OBJECT.size > end:
                if end - start >= _NEAR and at < 0 and objects[start:].strip(b"\0"):
                    raise CorruptFileError(
                        "no object follows the one before", path=self._path,
                        place=f"byte {self._begin + start} of the inflated objects", expected="LOBJ",
                    )  # fmt: skip
                break
            size = OBJECT.unpack_from(objects, at)[3]
            if size < OBJECT.size:
                raise CorruptFileError(
                    "an object is smaller than its header", path=self._path,
                    place=f"byte {self._begin + at} of the inflated objects", found=f"{size} bytes",
                )  # fmt: skip
            if at + size > end:
                break
            begins.append(at)
            at += size
        return np.array(begins, dtype=np.int64)


def _begins_at_once(content: NDArray[np.uint8]) -> NDArray[np.int64] | None:
    """Return where the whole objects begin, by array operations.

    Returns
    -------
    ndarray or None
        Bytes at which objects begin; None if the places where they seem to begin do not follow each other: then data
        looks like an object, or the objects are damaged.
    """
    if content.size < OBJECT.size:
        return None
    begins = np.flatnonzero(content[: 1 - OBJECT.size] == ord("L"))
    for k, letter in enumerate(b"OBJ", start=1):
        begins = begins[content[begins + k] == letter]
    if not begins.size:
        return None
    size = _fields(content, begins, _OBJECT_FIELDS)["size"].astype(np.int64)
    gap = np.diff(begins) - size[:-1]
    behind = content.size - int(begins[-1] + size[-1])
    most = _NEAR - len(b"LOBJ")
    if begins[0] > most or (size < OBJECT.size).any() or (gap < 0).any() or (gap > most).any():
        return None
    if behind >= _NEAR + OBJECT.size:
        return None
    return begins if behind >= 0 else begins[:-1]


def _fields(content: NDArray[np.uint8], begins: NDArray[np.int64], fields: np.dtype[Any]) -> Any:
    """Return the records that begin at some bytes, all of them inside, shape (n_records,)."""
    return np.lib.stride_tricks.sliding_window_view(content, fields.itemsize)[begins].view(fields)[:, 0]


def _add_classic(
    content: NDArray[np.uint8],
    begins: NDArray[np.int64],
    header: NDArray[np.int64],
    place: int,
    found: FrameList,
) -> NDArray[np.bool_]:
    """Add the classic data frames of bytes that have a place in the log; return which of the objects they are."""
    if not begins.size:
        return np.zeros(0, dtype=bool)
    stamp = _fields(content, begins + OBJECT.size, _STAMP_FIELDS)
    body = _fields(content, begins + header, _CLASSIC_FIELDS)
    scale = np.where(stamp["flags"] == 1, _TICKS_NS[1], 1)
    latest = LATEST_NS // scale
    plain: NDArray[np.bool_] = (body["flags"] & _REMOTE == 0) & (stamp["ticks"] < latest) & (stamp["ticks"] > -latest)
    body, length = body[plain], np.minimum(body["length"][plain], np.uint8(8))
    data = body["data"].copy()
    data[np.arange(8) >= length[:, None]] = 0
    found.add_block(
        FrameBlock(
            place=place + begins[plain],
            time_ns=(stamp["ticks"] * scale)[plain],
            key=body["identifier"] & np.uint32(ID_MASK | EXTENDED),
            channel=body["channel"].copy(),
            length=length,
            data=data,
        )
    )
    return plain


def _read_object(kind: int, time_ns: int, header: int, body: bytes, found: FrameList) -> None:
    """Read a frame, or an error frame, behind its header of some bytes; whatever is no data frame is counted."""
    if kind in _CLASSIC_TYPES:
        channel, flags, length, identifier, data = _CLASSIC.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(length, 8)]
    elif kind == 100:
        channel, flags, code, identifier, _, _, _, valid, data = _FD.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(valid, 64)]
        if not remote:
            _check_lengths(valid, code)
    elif kind == 101:
        fields = _FD_64.unpack_from(body)
        channel, code, valid, _, identifier, _, flags = fields[:7]
        remote = bool(flags & _REMOTE_FD_64)
        if not remote:
            _check_lengths(valid, code)
        # writers leave out the zeros at the end of the data; an extension may follow, which its offset tells
        further_at = fields[13] - header if fields[13] else len(body)
        data = body[_FD_64.size : max(_FD_64.size, further_at)][: min(valid, 64)].ljust(min(valid, 64), b"\0")
    else:
        found.error_frames += 1
        return
    if remote:
        found.remote_frames += 1
    else:
        found.add(time_ns, identifier & (ID_MASK | EXTENDED), channel, data)


def _check_lengths(length: int, code: int) -> None:
    """Raise ValueError if a frame's number of bytes is not that of its length code.

    Some writers have the number in the code's place, or something there that is no code.
    """
    if code < len(FD_LENGTHS) and length != code and not is_length_of(length, code):
        raise ValueError(f"{length} bytes by the code {code}")


def read_blf(path: Path, content: bytes) -> CanLog:
    """Read a BLF log.

    Parameters
    ----------
    path
        File, for messages.
    content
        Bytes of the whole file.

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
    notes = found.notes()
    notes += [Caution(CautionCode.UNKNOWN_ENTRIES, None, not_known)] if not_known else []
    notes += [Note(NoteCode.CUT, None, cut) for cut in cuts]
    if start is None and any(header[14:22]):
        metadata[DATE_FAULT] = f"when the measurement began is not understood: {_system_time(header[14:22])}"
        notes.append(Note(NoteCode.TIME, None, metadata[DATE_FAULT]))
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
