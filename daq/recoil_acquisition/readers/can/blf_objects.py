"""Objects of a BLF log: frames and other events.

Layout (little endian), as documented by the open implementations of the format, Vector_BLF by Tobias Lorenz and
python-can: an object ``LOBJ`` states the size of its header, the header's version, its own size and its kind. Its
stamp is in units of 10 µs or 1 ns from the start of measurement, and negative before a trigger.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.can.frames import EXTENDED, ID_MASK, LATEST_NS, FrameBlock, FrameList

OBJECT = struct.Struct("<4sHHLL")

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
_REMOTE = 0x80
_REMOTE_FD_64 = 0x10


def read_objects(path: Path, objects: bytes, found: FrameList) -> bool:
    """Gather the frames of all objects.

    Parameters
    ----------
    path
        For messages.
    objects
        Of all containers in one piece.
    found
        The frames are added to it, and what is no data frame is counted.

    Returns
    -------
    bool
        Whether the last object is cut.

    Raises
    ------
    CorruptFileError
        If objects do not follow each other.
    """
    content = np.frombuffer(objects, dtype=np.uint8)
    begins = _begins_at_once(content, objects)
    cut = False
    if begins is None:
        begins, cut = _begins_by_steps(path, objects)
    if not begins.size:
        return cut
    head = _fields(content, begins, _OBJECT_FIELDS)
    size = head["size"].astype(np.int64)
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
    # Not one by one: a log may have millions of them
    other = ~known | ~np.isin(head["kind"], (*_CLASSIC_TYPES, *_FD_TYPES, *_ERROR_TYPES))
    found.other_events += int(np.count_nonzero(rest & whole & other))
    for at in np.flatnonzero(rest & whole & ~other).tolist():
        found.place = at
        begin = int(begins[at])
        flags, ticks = _STAMP.unpack_from(objects, begin + OBJECT.size)
        body = objects[begin + int(header[at]) : begin + int(size[at])]
        try:
            _read_object(int(head["kind"][at]), ticks * _TICKS_NS.get(flags, 1), int(header[at]), body, found)
        except struct.error:
            found.damaged += 1
    return cut or not bool(whole[-1])


def _begins_at_once(content: NDArray[np.uint8], objects: bytes) -> NDArray[np.int64] | None:
    """Return where the objects begin, by array operations.

    Returns
    -------
    ndarray or None
        None if the places where objects seem to begin do not follow each other: then data looks like an object,
        or the objects are damaged.
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
    last = int(begins[-1] + size[-1])
    behind = objects[last : last + 8]
    if begins[0] > 4 or (size < OBJECT.size).any() or (gap < 0).any() or (gap > 4).any() or behind.strip(b"\0"):
        return None
    return begins


def _fields(content: NDArray[np.uint8], begins: NDArray[np.int64], fields: np.dtype[Any]) -> Any:
    """Return the records that begin at some bytes, all of them inside, shape (n_records,)."""
    return np.lib.stride_tricks.sliding_window_view(content, fields.itemsize)[begins].view(fields)[:, 0]


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
    stamp = _fields(content, begins + OBJECT.size, _STAMP_FIELDS)
    body = _fields(content, begins + header, _CLASSIC_FIELDS)
    scale = np.where(stamp["flags"] == 1, _TICKS_NS[1], 1)
    latest = LATEST_NS // scale
    plain: NDArray[np.bool_] = (body["flags"] & _REMOTE == 0) & (stamp["ticks"] < latest) & (stamp["ticks"] > -latest)
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


def _begins_by_steps(path: Path, objects: bytes) -> tuple[NDArray[np.int64], bool]:
    """Return where the whole objects begin, going from each to the next, and whether one behind them is cut."""
    begins: list[int] = []
    at, end = 0, len(objects)
    while True:
        at = objects.find(b"LOBJ", start := at, at + 8)
        if at < 0 or at + OBJECT.size > end:
            if end - start >= 8 and at < 0:
                raise CorruptFileError(
                    "no object follows the one before",
                    path=path,
                    place=f"byte {start} of the inflated objects",
                    expected="LOBJ",
                )
            return np.array(begins, dtype=np.int64), at >= 0 or objects[start:].strip(b"\0") != b""
        size = OBJECT.unpack_from(objects, at)[3]
        if size < OBJECT.size:
            raise CorruptFileError(
                "an object is smaller than its header",
                path=path,
                place=f"byte {at} of the inflated objects",
                found=f"{size} bytes",
            )
        if at + size > end:
            return np.array(begins, dtype=np.int64), True
        begins.append(at)
        at += size


def _read_object(kind: int, time_ns: int, header: int, body: bytes, found: FrameList) -> None:
    """Read one object behind its header of some bytes; whatever is no data frame is counted."""
    if kind in _CLASSIC_TYPES:
        channel, flags, length, identifier, data = _CLASSIC.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(length, 8)]
    elif kind == 100:
        channel, flags, _, identifier, _, _, _, valid, data = _FD.unpack_from(body)
        remote, data = bool(flags & _REMOTE), data[: min(valid, 64)]
    elif kind == 101:
        fields = _FD_64.unpack_from(body)
        channel, _, valid, _, identifier, _, flags = fields[:7]
        remote = bool(flags & _REMOTE_FD_64)
        # writers leave out the zeros at the end of the data; an extension may follow, which its offset tells
        further_at = fields[13] - header if fields[13] else len(body)
        data = body[_FD_64.size : max(_FD_64.size, further_at)][: min(valid, 64)].ljust(min(valid, 64), b"\0")
    else:
        found.error_frames += kind in _ERROR_TYPES
        found.other_events += kind not in _ERROR_TYPES
        return
    if remote:
        found.remote_frames += 1
    else:
        found.add(time_ns, identifier & (ID_MASK | EXTENDED), channel, data)
