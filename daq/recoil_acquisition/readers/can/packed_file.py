"""Files that were compressed by gzip (RFC 1952), read within bounds."""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import BinaryIO

from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.head import GZIP

LARGEST_RATIO = 100
"""Unpacked over packed size of a short log; a long one has the bound of all files. Logs of a bus shrink 4 to 12 times,
those of a bus at rest 25 times; deflate's own limit is a thousand times."""

PART_BYTES = 1 << 16
"""Bytes of the packed file that are held at a time."""

_SPARE_BYTES = 1 << 20
_GZIP = 16 + zlib.MAX_WBITS


def read_unpacked(path: Path) -> tuple[bytes, str]:
    """Read a file, unpacked if it is gzip's.

    Returns
    -------
    content : bytes
    incomplete : str
        How it shows that the packed file was cut; empty if nothing shows that.

    Raises
    ------
    ReadError
        If it cannot be read, or would unpack to more than a log does.
    CorruptFileError
        If it does not unpack, or its checksum is wrong.
    """
    with system_errors_as(ReadError, path, "read", "check its name and permissions"), path.open("rb") as file:
        head = file.read(len(GZIP))
        file.seek(0)
        return _unpacked(path, file) if head == GZIP else (file.read(), "")


def _unpacked(path: Path, file: BinaryIO) -> tuple[bytes, str]:
    """Unpack a file part by part: all of its members, and zeros behind them."""
    stored = os.fstat(file.fileno()).st_size
    limit = min(LARGEST_RATIO * stored + _SPARE_BYTES, most_unpacked(stored))
    pieces: list[bytes] = []
    size, part, member = 0, b"", zlib.decompressobj(_GZIP)
    while part or (part := file.read(PART_BYTES)):
        if member.eof:
            part += file.read(len(GZIP) - 1)
            if not part.startswith(GZIP):
                _check_padding(path, file, part)
                break
            member = zlib.decompressobj(_GZIP)
        try:
            pieces.append(member.decompress(part, limit - size + 1))
        except zlib.error as error:
            raise CorruptFileError(
                "the compressed file does not unpack", path=path, found=str(error), remedy="copy the file again"
            ) from error
        part = member.unused_data
        size += len(pieces[-1])
        if size > limit:
            raise ReadError(
                f"the compressed file unpacks to more than {limit / 1e6:.0f} MB",
                path=path,
                remedy="unpack it first if this is right",
            )
    cut = "" if member.eof else f"the compressed file is cut: {size} bytes could be unpacked"
    return b"".join(pieces), cut


def _check_padding(path: Path, file: BinaryIO, part: bytes) -> None:
    """Refuse anything but zeros behind the last member."""
    while part:
        if part.strip(b"\0"):
            raise CorruptFileError(
                "something else follows the compressed data",
                path=path,
                place=f"byte {file.tell() - len(part.lstrip(bytes(1)))}",
                remedy="copy the file again",
            )
        part = file.read(PART_BYTES)
