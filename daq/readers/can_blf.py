"""Vector BLF: objects in compressed containers.

Layout (little endian), as documented by the open implementations of the format, Vector_BLF by
Tobias Lorenz and python-can: a file header ``LOGG`` with its own size, the file's size, the number
of objects and two SYSTEMTIMEs, then objects ``LOBJ``. An object of type 10 holds a zlib stream of
further objects, which may run on from one container into the next. Object stamps are in units of 10 µs or
1 ns from the start of measurement, and negative before a trigger.
"""

from __future__ import annotations

import datetime as dt
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.errors import CorruptFileError
from daq.readers.can_frames import EXTENDED, ID_MASK, LATEST_NS, CanLog, FrameBlock, FrameList
from daq.timebase import AbsoluteStart

MAGIC = b"LOGG"

_FILE_HEADER = struct.Struct("<4sL8BQQLL8H8H")
_OBJECT = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_STAMP = struct.Struct("<L4xq")
_CLASSIC = struct.Struct("<HBBL8s")
_FD = struct.Struct("<HBBLLBBB5x64s")
_FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")
_OBJECT_FIELDS = np.dtype([("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4")])
_STAMP_FIELDS = np.dtype([("flags", "<u4"), ("client", "<u2"), ("version", "<u2"), ("ticks", "<i8")])
_CLASSIC_FIELDS = np.dtype(
    [("channel", "<u2"), ("flags", "u1"), ("length", "u1"), ("identifier", "<u4"), ("data", "u1", 8)]
)
_CONTAINER_TYPE = 10
_CLASSIC_TYPES = (1, 86)
_ERROR_TYPES = (2, 73, 104)
_HEADER_SIZES = {1: 32, 2: 40}
_TICKS_NS = {1: 10_000, 2: 1}
_REMOTE = 0x80
_REMOTE_FD_64 = 0x10


def read_blf(path: Path, content: bytes) -> CanLog:
    """Read a BLF log.

    Parameters
    ----------
    path : Path
        For messages.
    content : bytes
        The whole file.

    Returns
    -------
    CanLog
        Time from the start of measurement.

    Raises
    ------
    CorruptFileError
        If its header is cut, a container does not inflate, or objects do not follow each other.
    """
    if len(content) < _FILE_HEADER.size or not content.startswith(MAGIC):
        raise CorruptFileError(
            "the file header is cut",
            path=path,
            expected=f"{_FILE_HEADER.size} bytes beginning with LOGG",
            found=f"{len(content)} bytes",
        )
    header = _FILE_HEADER.unpack_from(content)
    header_size, file_size, object_count = header[1], header[10], header[12]
    cuts = []
    if file_size and file_size > len(content):
        cuts.append(f"the file is cut: its header states {file_size} bytes, it has {len(content)}")
    objects, cut = _inflate(path, content, header_size)
    found = FrameList()
    cut_inside = _walk_at_once(objects, found)
    if cut_inside is None:
        cut_inside = _walk(path, objects, found)
    if cut or cut_inside:
        cuts.append("the log ends inside an object: what follows is lost")
    metadata = {**found.counts(), "objects_stated": object_count, "measurement_start": _system_time(header[14:22])}
    return CanLog(found.frames()[0], _start(header[14:22]), (*found.notes(), *cuts), "; ".join(cuts), metadata)


def _inflate(path: Path, content: bytes, at: int) -> tuple[bytes, bool]:
    """Return the objects of all containers in one piece, and whether the last container is cut."""
    pieces: list[bytes] = []
    while at < len(content):
        found = content.find(b"LOBJ", at, at + 8)
        if found < 0 or found + _OBJECT.size > len(content):
            if content[at:].strip(b"\0") == b"":
                break
            if len(content) - at < _OBJECT.size + 4:
                return b"".join(pieces), True
            raise CorruptFileError("no object follows the one before", path=path, place=f"byte {at}", expected="LOBJ")
        _, _, _, size, kind = _OBJECT.unpack_from(content, found)
        if size < _OBJECT.size:
            raise CorruptFileError(
                "an object is smaller than its header", path=path, place=f"byte {found}", found=f"{size} bytes"
            )
        whole = found + size <= len(content)
        if kind == _CONTAINER_TYPE and found + _OBJECT.size + _CONTAINER.size <= len(content):
            method, stated = _CONTAINER.unpack_from(content, found + _OBJECT.size)
            packed = content[found + _OBJECT.size + _CONTAINER.size : found + size]
            pieces.append(_unpack(path, found, method, stated, packed, whole=whole))
        elif kind != _CONTAINER_TYPE and whole:
            pieces.append(content[found : found + size])
        if not whole:
            return b"".join(pieces), True
        at = found + size
    return b"".join(pieces), False


def _unpack(path: Path, at: int, method: int, stated: int, packed: bytes, *, whole: bool) -> bytes:
    if method == 0:
        return packed
    if method != 2:
        raise CorruptFileError(
            "a container's compression is unknown", path=path, place=f"byte {at}", expected="0 or 2", found=str(method)
        )
    try:
        objects = zlib.decompressobj().decompress(packed, max(stated, 1))
    except zlib.error as error:
        raise CorruptFileError(
            "a container does not inflate", path=path, place=f"byte {at}", remedy="copy the file again"
        ) from error
    if whole and len(objects) != stated:
        raise CorruptFileError(
            "a container is incomplete",
            path=path,
            place=f"byte {at}",
            expected=f"{stated} bytes",
            found=f"{len(objects)}",
        )
    return objects


def _walk_at_once(objects: bytes, found: FrameList) -> bool | None:
    """Gather the frames of all objects by array operations; return whether the last object is cut.

    Returns
    -------
    bool or None
        None, and nothing gathered, if the places where objects seem to begin do not follow each other: then
        data looks like an object, or the objects are damaged.
    """
    content = np.frombuffer(objects, dtype=np.uint8)
    if content.size < _OBJECT.size:
        return None
    begins = np.flatnonzero(content[: 1 - _OBJECT.size] == ord("L"))
    for k, letter in enumerate(b"OBJ", start=1):
        begins = begins[content[begins + k] == letter]
    if not begins.size:
        return None
    head = np.lib.stride_tricks.sliding_window_view(content, _OBJECT.size)[begins].view(_OBJECT_FIELDS)[:, 0]
    size = head["size"].astype(np.int64)
    gap = np.diff(begins) - size[:-1]
    last = int(begins[-1] + size[-1])
    behind = objects[last : last + 8]
    if begins[0] > 4 or (size < _OBJECT.size).any() or (gap < 0).any() or (gap > 4).any() or behind.strip(b"\0"):
        return None
    whole = begins + size <= content.size
    known = np.isin(head["version"], list(_HEADER_SIZES))
    header = np.where(head["version"] == 1, _HEADER_SIZES[1], _HEADER_SIZES[2])
    known &= size >= header
    classic = np.flatnonzero(
        whole & known & np.isin(head["kind"], _CLASSIC_TYPES) & (size - header >= _CLASSIC.size) & (size >= 48)
    )
    plain = _add_classic(content, begins[classic], header[classic], classic, found)
    rest = np.ones(begins.size, dtype=bool)
    rest[classic[plain]] = False
    for at in np.flatnonzero(rest & whole).tolist():
        found.place = at
        begin = int(begins[at])
        if not known[at]:
            found.other_events += 1
            continue
        flags, ticks = _STAMP.unpack_from(objects, begin + _OBJECT.size)
        body = objects[begin + int(header[at]) : begin + int(size[at])]
        try:
            _read_object(int(head["kind"][at]), ticks * _TICKS_NS.get(flags, 1), body, found)
        except struct.error:
            found.damaged += 1
    return not bool(whole[-1])


def _add_classic(
    content: NDArray[np.uint8],
    begins: NDArray[np.int64],
    header: NDArray[np.int64],
    place: NDArray[np.int64],
    found: FrameList,
) -> NDArray[np.bool_]:
    """Add the classic data frames; return which of the objects they are."""
    if not begins.size:
        return np.zeros(0, dtype=bool)
    stamp = np.lib.stride_tricks.sliding_window_view(content, _STAMP_FIELDS.itemsize)
    stamp = stamp[begins + _OBJECT.size].view(_STAMP_FIELDS)[:, 0]
    body = np.lib.stride_tricks.sliding_window_view(content, _CLASSIC.size)[begins + header].view(_CLASSIC_FIELDS)[:, 0]
    scale = np.where(stamp["flags"] == 1, _TICKS_NS[1], 1)
    latest = LATEST_NS // scale
    plain = (body["flags"] & _REMOTE == 0) & (stamp["ticks"] < latest) & (stamp["ticks"] > -latest)
    body, length = body[plain], np.minimum(body["length"][plain], 8).astype(np.int64)
    data = body["data"].copy()
    data[np.arange(8) >= length[:, None]] = 0
    found.add_block(
        FrameBlock(
            place=place[plain],
            time_ns=(stamp["ticks"] * scale)[plain],
            key=body["identifier"] & np.uint32(ID_MASK | EXTENDED),
            channel=body["channel"].astype(np.int64),
            length=length,
            data=data,
        )
    )
    return plain


def _walk(path: Path, objects: bytes, found: FrameList) -> bool:
    """Gather the frames of all objects; return whether the last object is cut."""
    at, end = 0, len(objects)
    while True:
        at = objects.find(b"LOBJ", start := at, at + 8)
        if at < 0 or at + _OBJECT.size > end:
            if end - start >= 8 and at < 0:
                raise CorruptFileError(
                    "no object follows the one before",
                    path=path,
                    place=f"byte {start} of the inflated objects",
                    expected="LOBJ",
                )
            return at >= 0 or objects[start:].strip(b"\0") != b""
        _, _, version, size, kind = _OBJECT.unpack_from(objects, at)
        if size < _OBJECT.size:
            raise CorruptFileError(
                "an object is smaller than its header",
                path=path,
                place=f"byte {at} of the inflated objects",
                found=f"{size} bytes",
            )
        if at + size > end:
            return True
        if version in _HEADER_SIZES and size >= _HEADER_SIZES[version]:
            flags, ticks = _STAMP.unpack_from(objects, at + _OBJECT.size)
            body = objects[at + _HEADER_SIZES[version] : at + size]
            try:
                _read_object(kind, ticks * _TICKS_NS.get(flags, 1), body, found)
            except struct.error:
                found.damaged += 1
        else:
            found.other_events += 1
        at += size


def _read_object(kind: int, time_ns: int, body: bytes, found: FrameList) -> None:
    """Read one object; whatever is no data frame is counted."""
    if kind in _CLASSIC_TYPES:
        channel, flags, length, identifier, data = _CLASSIC.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(length, 8)]
    elif kind == 100:
        channel, flags, _, identifier, _, _, _, valid, data = _FD.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(valid, 64)]
    elif kind == 101:
        channel, _, valid, _, identifier, _, flags = _FD_64.unpack_from(body)[:7]
        remote = bool(flags & _REMOTE_FD_64)
        data = body[_FD_64.size : _FD_64.size + min(valid, 64)]
    else:
        found.error_frames += kind in _ERROR_TYPES
        found.other_events += kind not in _ERROR_TYPES
        return
    if remote:
        found.remote_frames += 1
    else:
        found.add(time_ns, identifier & (ID_MASK | EXTENDED), channel, data)


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
