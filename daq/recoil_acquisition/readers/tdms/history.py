"""History of what a TDMS file says of its channels, segment by segment, walked before a library reads it.

A property that is stated anew in a later segment holds from there on: a program that is stopped and begun again on the
same file states another ``wf_start_time`` behind the samples of the first recording. npTDMS keeps what was stated last.

Layout: National Instruments, *TDMS File Format Internal Structure*: each segment begins with a lead-in of 28 bytes, a
tag, flags, a version, the length of what follows and that of its meta data. These are the number of its objects, and of
each its path, the index of its raw data (none, as before, of DAQmx, or type, dimension, number of values and, of texts,
bytes), and its properties: name, type, value.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import CorruptFileError, ReadError

TAG, INDEX_TAG = b"TDSm", b"TDSh"
LEAD_IN_BYTES = 28
BIG_ENDIAN = 1 << 6
OPEN_SEGMENT = 0xFFFFFFFFFFFFFFFF
"""Length of a segment that its writer never closed."""

_META_DATA, _NEW_LIST, _RAW_DATA = 1 << 1, 1 << 2, 1 << 3
_NO_DATA, _AS_BEFORE = 0xFFFFFFFF, 0
_DAQMX = {0x1269: 20, 0x126A: 17}
"""Indices of raw data of DAQmx, and bytes of each of their scalers."""
_TEXT, _STAMP = 0x20, 0x44
_FORMATS = {1: "b", 2: "h", 3: "i", 4: "q", 5: "B", 6: "H", 7: "I", 8: "Q", 9: "f", 10: "d", 0x19: "f", 0x1A: "d",
            0x21: "?"}  # fmt: skip
_SIZES = {0: 0, 11: 16, 0x1B: 16, _STAMP: 16, 0x08000C: 8, 0x10000D: 16}
STATED = ("wf_", "unit_string", "NI_Scal", "NI_Number_Of_Scales")
"""Beginnings of the names of properties that say what samples are and when."""
_PASSED_OVER = frozenset({"wf_samples"})
_MOST_STEPS = 1_000_000
"""Changes, and times that a change is filled into those before: a day's recording that states its start each second has
a tenth of it."""


def how_it_ends(path: Path) -> str:
    """Walk the segments and tell how the file was cut off; empty if nothing shows that.

    Raises
    ------
    ReadError
        If the file is an index, without samples.
    CorruptFileError
        If a segment does not begin where the one before ends.
    """
    size = path.stat().st_size
    at = 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            lead_in = file.read(LEAD_IN_BYTES)
            if lead_in[:4] == INDEX_TAG:
                raise ReadError(
                    "this is the index of a TDMS file, without samples", path=path, remedy="take the .tdms file"
                )
            if at and len(lead_in) < LEAD_IN_BYTES:
                return f"{len(lead_in)} bytes of a further segment at byte {at}: left out"
            if len(lead_in) < LEAD_IN_BYTES or lead_in[:4] != TAG:
                raise CorruptFileError(
                    "no segment", path=path, place=f"byte {at}", expected="TDSm", found=repr(lead_in[:4])
                )
            flags = struct.unpack_from("<I", lead_in, 4)[0]
            length = struct.unpack_from(">Q" if flags & BIG_ENDIAN else "<Q", lead_in, 12)[0]
            if length == OPEN_SEGMENT:
                return f"the segment at byte {at} was never closed by its writer: read as far as it goes"
            end = at + LEAD_IN_BYTES + length
            if end > size:
                return f"the segment at byte {at} ends at byte {size} of {end}: read as far as it goes"
            at = end
    return ""


@dataclass(frozen=True)
class TdmsStamp:
    """An instant: seconds since 1904-01-01 UTC, and what is beyond in 2^-64 s; named as npTDMS names them."""

    seconds: int
    second_fractions: int


@dataclass(frozen=True)
class Stretch:
    """Samples of a channel over which all that is stated of it holds.

    Attributes
    ----------
    first
        Index of the first sample.
    properties
        Properties that say what samples are and when, in force from the first sample on.
    """

    first: int
    properties: dict[str, Any]


@dataclass
class _Object:
    """An object as the walk has it: bytes and number of its values in a chunk, and what has been stated of it.

    Attributes
    ----------
    steps
        Number of steps that noting its statements has taken so far.
    """

    values: int = 0
    chunk_bytes: int = 0
    buffers: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    has_data: bool = False
    count: int = 0
    properties: dict[str, Any] = field(default_factory=dict)
    stretches: list[Stretch] = field(default_factory=list)
    steps: int = 0


class _Bytes:
    """The bytes of a segment's meta data, taken from their begin."""

    def __init__(self, content: bytes, order: str) -> None:
        self._content, self._order, self._at = content, order, 0

    def take(self, form: str) -> tuple[Any, ...]:
        layout = struct.Struct(self._order + form)
        found = layout.unpack_from(self._content, self._at)
        self._at += layout.size
        return found

    def number(self) -> int:
        return int(self.take("I")[0])

    def skip(self, size: int) -> bytes:
        if size > len(self._content) - self._at:
            raise ValueError(f"{size} bytes of meta data where {len(self._content) - self._at} are left")
        part = self._content[self._at : self._at + size]
        self._at += size
        return part

    def text(self) -> str:
        return self.skip(self.number()).decode("utf-8", "replace")

    def value(self) -> Any:
        """Take a property's value; of those of no plain type its bytes."""
        kind = self.number()
        if kind == _TEXT:
            return self.text()
        if kind in _FORMATS:
            return self.take(_FORMATS[kind])[0]
        if kind == _STAMP:
            if self._order == "<":
                fractions, seconds = self.take("Qq")
            else:
                seconds, fractions = self.take("qQ")
            return TdmsStamp(seconds, fractions)
        if kind not in _SIZES:
            raise ValueError(f"a property of type {kind:#x}")
        return self.skip(_SIZES[kind])


def stretches_of(path: Path) -> dict[str, tuple[Stretch, ...]]:
    """Return the stretches of each channel by its path, of those of which something changes behind samples.

    Raises
    ------
    ValueError, struct.error
        If meta data are damaged.
    """
    objects: dict[str, _Object] = {}
    listed: list[str] = []
    last = (0, b"")
    for flags, meta, raw_bytes in _segments(path):
        # the same meta data again change nothing, and a long recording has them thousands of times
        if flags & _META_DATA and last != (flags, meta):
            order = ">" if flags & BIG_ENDIAN else "<"
            listed = _met(_Bytes(meta, order), objects, [] if flags & _NEW_LIST else listed)
            last = (flags, meta)
        if flags & _RAW_DATA:
            _count(objects, listed, raw_bytes)
    return {path: tuple(one.stretches) for path, one in objects.items() if len(one.stretches) > 1}


def _segments(path: Path) -> Iterator[tuple[int, bytes, int]]:
    """Yield the flags of each whole segment, its meta data, and the number of bytes of its samples."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at + LEAD_IN_BYTES <= size:
            file.seek(at)
            lead_in = file.read(LEAD_IN_BYTES)
            (flags,) = struct.unpack_from("<I", lead_in, 4)
            length, meta_bytes = struct.unpack_from(">QQ" if flags & BIG_ENDIAN else "<QQ", lead_in, 12)
            end = size if length == OPEN_SEGMENT else min(at + LEAD_IN_BYTES + length, size)
            data_at = at + LEAD_IN_BYTES + meta_bytes
            if data_at > end:
                return
            yield flags, file.read(meta_bytes) if flags & _META_DATA else b"", end - data_at
            at = end


def _met(meta: _Bytes, objects: dict[str, _Object], before: list[str]) -> list[str]:
    """Take what a segment says of its objects; return the paths of those that it lists."""
    listed = dict.fromkeys(before)
    for _ in range(meta.number()):
        path = meta.text()
        listed[path] = None
        one = objects.setdefault(path, _Object())
        index = meta.number()
        one.has_data = index != _NO_DATA
        if index in _DAQMX:
            _of_daqmx(meta, one, _DAQMX[index])
        elif index not in (_NO_DATA, _AS_BEFORE):
            kind, _, one.values = meta.take("IIQ")
            width = struct.calcsize(_FORMATS.get(kind, "")) or _SIZES.get(kind, 0)
            one.chunk_bytes = meta.take("Q")[0] if kind == _TEXT else one.values * width
            one.buffers = {}
        _state(objects, path, {name: value for name, value in _properties(meta) if _is_of_samples(name)})
    return list(listed)


def _properties(meta: _Bytes) -> list[tuple[str, Any]]:
    return [(meta.text(), meta.value()) for _ in range(meta.number())]


def _is_of_samples(name: str) -> bool:
    return name.startswith(STATED) and name not in _PASSED_OVER


def _is_channel(path: str) -> bool:
    return "'/'" in path


def _is_below(path: str, above: str) -> bool:
    return _is_channel(path) and (above == "/" or path.startswith(f"{above}/"))


def _state(objects: Mapping[str, _Object], path: str, stated: Mapping[str, Any]) -> None:
    """Note what is stated of an object; what was not stated before holds for all samples."""
    one, followed = objects[path], [path]
    if not _is_channel(path):
        stated = {name: value for name, value in stated.items() if name.startswith("NI_")}
        followed = [other for other in objects if _is_below(other, path)] if stated else []
    changes = any(one.properties.get(name, value) != value for name, value in stated.items())
    is_new = not stated.keys() <= one.properties.keys()
    one.properties |= stated
    for other in (objects[path] for path in followed):
        for stretch in other.stretches if is_new else ():
            stretch.properties.update({n: v for n, v in stated.items() if n not in stretch.properties})
        other.steps += 1 + is_new * len(other.stretches)
        if other.steps > _MOST_STEPS:
            raise ValueError(f"what is said of a channel changes more than {_MOST_STEPS} times")
    for name in followed:
        if changes or not objects[name].stretches:
            _begin_stretch(objects, name)


def _begin_stretch(objects: Mapping[str, _Object], path: str) -> None:
    """Note what is stated of a channel from here on; what was stated before any sample is forgotten."""
    one = objects[path]
    group = path[: path.rindex("'/'") + 1]
    above = [objects[name].properties for name in ("/", group) if name in objects]
    properties = {name: value for level in above for name, value in level.items() if name.startswith("NI_")}
    if one.stretches and one.stretches[-1].first == one.count:
        one.stretches.pop()
    one.stretches.append(Stretch(one.count if one.stretches else 0, properties | one.properties))


def _of_daqmx(meta: _Bytes, one: _Object, scaler_bytes: int) -> None:
    _, _, one.values, scalers = meta.take("IIQI")
    used = set()
    for _ in range(scalers):
        used.add(meta.take("II")[1])
        meta.skip(scaler_bytes - 8)
    widths = [meta.number() for _ in range(meta.number())]
    one.buffers = {buffer: (one.values, widths[buffer]) for buffer in used}
    one.chunk_bytes = 0


def _count(objects: Mapping[str, _Object], listed: list[str], raw_bytes: int) -> None:
    """Add the values of a segment's chunks to its channels."""
    here = [objects[path] for path in listed if objects[path].has_data]
    buffers: dict[int, int] = {}
    for one in here:
        for buffer, (values, width) in one.buffers.items():
            buffers[buffer] = max(buffers.get(buffer, 0), values * width)
    chunk_bytes = sum(one.chunk_bytes for one in here) + sum(buffers.values())
    chunks = raw_bytes // chunk_bytes if chunk_bytes else 0
    for one in here:
        one.count += one.values * chunks
