"""XML texts of a .dmd file of DEWETRON OXYGEN.

They are plain, or ``99 'MZX'`` (hexadecimal 99), u32 **big endian** length, and a zlib stream of that length.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree as ET

from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.oxygen.blocks import TextBlock

MOST_TEXT = 1 << 26
"""Bytes of one XML text, decompressed: the longest of the known files has 0.3 MB."""

_PACKED = b"\x99MZX"


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
