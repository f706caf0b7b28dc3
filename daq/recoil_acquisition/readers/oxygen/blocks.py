"""Blocks of a file of DEWETRON OXYGEN (.dmd): where each one is, and what is in those of text.

No description of this format is published. The layout below was worked out from the five test files that
DEWETRON publishes under the MIT licence beside its reader (github.com/DEWETRON/pyDmdReader, folder ``tests``);
no library was taken apart. Everything is little endian unless it says otherwise.

::

    0     "DMDF", u32 version (6 and 8 were seen), u32 20 ..., "DMD Library ver.2.3.0.0"
    75    u32 CRC-32 of bytes 0 to 74
    4096  blocks, one behind the other

    block
    0     "DMDH"
    4     u32 bytes of payload
    8     u32 bytes of the whole block: 20, the head of samples where there is one, and the payload
    12    u16 segment; 65535 for what belongs to the file
    14    u8 level: 0 for samples, above that minima, maxima, means and RMS values of many samples
    15    u8 type
    16    u32 CRC-32 (of zlib) of bytes 0 to 14: neither of the type nor of the payload

    type  1     XML ``dmd_cfg``: segments, with their names, time bases and compression
          2, 6  synchronous and asynchronous samples, with a head of 33 bytes before the payload:
                u8 7, u64 first tick, u64 ticks that it spans, u64 index of its first sample (all ones if
                synchronous), u64 number of samples
          4, 8  index tables; 8 is the last block of a finished file
          9     text: the setup and the events (`recoil_acquisition.readers.oxygen.setup`)

Behind the last block of a finished file old bytes follow up to a multiple of 4096. The two checksums were found
to hold for all 137 blocks of three files. **Samples carry no checksum**: a flipped bit in them cannot be seen.

XML texts are plain, or ``99 'MZX'`` (hexadecimal 99), u32 **big endian** length, and a zlib stream of that length.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as
from recoil_acquisition.remark import Note, NoteCode, Remark

MAGIC = b"DMDF"
LIBRARY = b"DMD Library"
FIRST_BLOCK = 4096
HEAD = struct.Struct("<4sIIHBBI")
SAMPLES_HEAD = struct.Struct("<BQQQQ")
WITH_ALL_INFORMATION = 7
"""First byte of a head of samples that holds ticks, span, index and count; no other was seen."""

CONFIG, SYNC, INDEX, ASYNC, ROOT, TEXT = 1, 2, 4, 6, 8, 9
MOST_TICKS = 1 << 51
"""Ticks beyond which float64 could not distinguish two."""

_FILE_HEAD = struct.Struct("<75sI")
_COLUMNS = 4

MOST_TEXT = 1 << 26
"""Bytes of one XML text, decompressed: the longest of the known files has 0.3 MB."""
_PACKED = b"\x99MZX"


@dataclass(frozen=True)
class TextBlock:
    """Place of a payload of text: its segment, its first byte and its length."""

    segment: int
    offset: int
    length: int


@dataclass(frozen=True, eq=False)
class SampleBlocks:
    """Blocks of samples of one segment, in the file's order.

    Attributes
    ----------
    kind
        Type of the blocks, `SYNC` or `ASYNC`.
    offset, length : ndarray of int64, shape (n_blocks,)
        First byte and number of bytes of each payload.
    tick, count : ndarray of int64, shape (n_blocks,)
        First tick and number of samples of each.
    """

    kind: int
    offset: NDArray[np.int64]
    length: NDArray[np.int64]
    tick: NDArray[np.int64]
    count: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BlockIndex:
    """Index of one file's blocks.

    Attributes
    ----------
    version
        Version of the format, from the file's head.
    library
        Name and version of the writer.
    configs
        Blocks of type 1.
    texts
        Blocks of type 9.
    samples
        Blocks of samples by segment, level 0 only.
    incomplete
        Sign by which it shows that the file was not finished; empty if it was.
    """

    path: Path
    version: int
    library: str
    configs: tuple[TextBlock, ...]
    texts: tuple[TextBlock, ...]
    samples: dict[int, SampleBlocks]
    incomplete: str
    notes: tuple[Remark, ...]


@dataclass
class _Found:
    """Blocks that were met on the way through a file."""

    configs: list[TextBlock] = field(default_factory=list)
    texts: list[TextBlock] = field(default_factory=list)
    columns: dict[tuple[int, int], array[int]] = field(default_factory=dict)
    unknown: dict[int, int] = field(default_factory=dict)


def is_oxygen(head: bytes) -> bool:
    """Return whether a file's first bytes are those of a .dmd file."""
    return head.startswith(MAGIC) and LIBRARY in head[:64]


def index_blocks(path: Path) -> BlockIndex:
    """Find the blocks of a file by reading their heads alone.

    Raises
    ------
    ReadError
        If the file cannot be read.
    CorruptFileError
        If it is none, or a head contradicts its checksum or its lengths.
    """
    with system_errors_as(ReadError, path, "read"), path.open("rb", buffering=0) as file:
        return _index(path, file)


def _index(path: Path, file: BinaryIO) -> BlockIndex:
    size = file.seek(0, 2)
    file.seek(0)
    head = file.read(_FILE_HEAD.size)
    if len(head) < _FILE_HEAD.size or not is_oxygen(head):
        raise CorruptFileError(
            "this is no .dmd file", path=path, place="byte 0", expected="DMDF and a head of 79 bytes"
        )
    content, checksum = _FILE_HEAD.unpack(head)
    if zlib.crc32(content) != checksum:
        raise CorruptFileError(
            "the file's head is damaged", path=path, place="byte 75",
            expected=f"checksum {zlib.crc32(content):08x}", found=f"{checksum:08x}", remedy="copy the file again",
        )  # fmt: skip
    found = _Found()
    notes: list[Remark] = []
    position, incomplete = FIRST_BLOCK, "it ends without its index: the recorder did not finish it, or it was cut off"
    while (block := _read_head(path, file, position, size)) is not None:
        length, whole, segment, kind, sample_head = block
        if position + whole > size:
            incomplete = f"it ends at byte {size} within the block at byte {position}"
            break
        _keep(path, found, position, length, segment, kind, sample_head)
        position += whole
        if kind == ROOT:
            incomplete = ""
            if _is_head(_read_at(file, position, HEAD.size)):
                text = f"blocks follow the index at byte {position}: they are not read"
                notes.append(Note(NoteCode.LEFT_OUT, None, text))
            break
    if incomplete:
        text = f"the file is not complete: {incomplete}; nothing beyond byte {min(position, size)} is read"
        notes.append(Note(NoteCode.CUT, None, text))
    for kind, count in sorted(found.unknown.items()):
        notes.append(Note(NoteCode.LEFT_OUT, None, f"{count} blocks of the unknown type {kind} are not read"))
    return BlockIndex(
        path, int.from_bytes(content[4:8], "little"), content[11:75].rstrip(b"\0").decode("ascii", "replace"),
        tuple(found.configs), tuple(found.texts), _sample_blocks(path, found), incomplete, tuple(notes),
    )  # fmt: skip


def _read_at(file: BinaryIO, position: int, length: int) -> bytes:
    file.seek(position)
    return file.read(length)


def _is_head(head: bytes) -> bool:
    return (
        len(head) >= HEAD.size
        and head.startswith(b"DMDH")
        and zlib.crc32(head[:15]) == int.from_bytes(head[16:20], "little")
    )


def _read_head(
    path: Path, file: BinaryIO, position: int, size: int
) -> tuple[int, int, int, int, tuple[int, ...] | None] | None:
    """Read one head; None if there is no block here."""
    head = _read_at(file, position, HEAD.size + SAMPLES_HEAD.size)
    if len(head) < HEAD.size or not head.startswith(b"DMDH"):
        return None
    _, length, whole, segment, level, kind, checksum = HEAD.unpack_from(head)
    if zlib.crc32(head[:15]) != checksum:
        raise CorruptFileError(
            "a block's head is damaged", path=path, place=f"byte {position}",
            expected=f"checksum {zlib.crc32(head[:15]):08x}", found=f"{checksum:08x}", remedy="copy the file again",
        )  # fmt: skip
    is_samples = kind in (SYNC, ASYNC)
    needed = HEAD.size + (SAMPLES_HEAD.size if is_samples else 0) + length
    if whole < needed:
        raise CorruptFileError(
            "a block is shorter than its payload", path=path, place=f"byte {position}",
            expected=f"at least {needed} bytes", found=f"{whole}",
        )  # fmt: skip
    if not is_samples or level or position + whole > size:
        return length, whole, segment, kind, None
    return length, whole, segment, kind, SAMPLES_HEAD.unpack_from(head, HEAD.size)


def _keep(
    path: Path,
    found: _Found,
    position: int,
    length: int,
    segment: int,
    kind: int,
    head: tuple[int, ...] | None,
) -> None:
    if kind == CONFIG:
        found.configs.append(TextBlock(segment, position + HEAD.size, length))
    elif kind == TEXT:
        found.texts.append(TextBlock(segment, position + HEAD.size, length))
    elif head is not None:
        information, tick, _, _, count = head
        if information != WITH_ALL_INFORMATION or tick + count >= MOST_TICKS:
            raise CorruptFileError(
                "a head of samples is not of the known layout", path=path, place=f"byte {position + HEAD.size}",
                expected=f"7 and ticks below {MOST_TICKS}", found=f"{information}, tick {tick}, {count} samples",
            )  # fmt: skip
        columns = found.columns.setdefault((segment, kind), array("q"))
        columns.extend((position + HEAD.size + SAMPLES_HEAD.size, length, tick, count))
    elif kind not in (SYNC, ASYNC, INDEX, ROOT):
        found.unknown[kind] = found.unknown.get(kind, 0) + 1


def _sample_blocks(path: Path, found: _Found) -> dict[int, SampleBlocks]:
    blocks: dict[int, SampleBlocks] = {}
    for (segment, kind), columns in found.columns.items():
        if segment in blocks:
            raise CorruptFileError(
                f"segment {segment} holds synchronous and asynchronous samples", path=path, expected="one of them"
            )
        table = np.frombuffer(columns, np.int64).reshape(-1, _COLUMNS)
        blocks[segment] = SampleBlocks(kind, *(np.ascontiguousarray(column) for column in table.T))
    return blocks


def read_xml(path: Path, file: BinaryIO, block: TextBlock) -> ET.Element:
    """Read and parse one text.

    Raises
    ------
    CorruptFileError
        If it is no XML of plausible length, or declares entities.
    """
    place = f"text at byte {block.offset}"
    if block.length > MOST_TEXT:
        raise CorruptFileError("a text is too long", path=path, place=place, found=f"{block.length} bytes")
    file.seek(block.offset)
    content = file.read(block.length)
    try:
        if content.startswith(_PACKED):
            content = _unpack(content)
        text = content.rstrip(b"\0").decode("utf-8")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("it declares entities")
        return ET.fromstring(text)  # noqa: S314  entities are refused above, and the length is bounded
    except (ValueError, LookupError, zlib.error, ET.ParseError, RecursionError) as error:
        raise CorruptFileError(f"a text is damaged: {error}", path=path, place=place) from error


def _unpack(content: bytes) -> bytes:
    length = int.from_bytes(content[4:8], "big")
    if length > MOST_TEXT:
        raise ValueError(f"{length} bytes are more than {MOST_TEXT}")
    stream = zlib.decompressobj()
    text = stream.decompress(content[8:], length + 1)
    if len(text) != length:
        raise ValueError(f"{length} bytes were promised, and at least {len(text)} came")
    return text


def local(element: ET.Element) -> str:
    """Return an element's name without its namespace."""
    return element.tag.rpartition("}")[2]


def named(element: ET.Element, name: str) -> Iterator[ET.Element]:
    """Yield the elements of a name, the element itself included, in any namespace."""
    return (child for child in element.iter() if local(child) == name)


def properties(element: ET.Element) -> Iterator[tuple[str, str]]:
    """Yield the properties below an element that have a plain value, strings without their quotes."""
    for found in named(element, "Property"):
        value = next(iter(found), None)
        if value is None:
            continue
        text = (value.text or "") if not len(value) else (value[0].text or "")
        if local(value) == "StringValue" and len(text) > 1 and text[0] == text[-1] == '"':
            text = text[1:-1]
        yield found.get("name", ""), text
