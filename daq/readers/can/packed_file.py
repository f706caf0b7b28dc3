"""Files that were compressed by gzip (RFC 1952), read within bounds."""

from __future__ import annotations

import zlib
from pathlib import Path

from daq.errors import CorruptFileError, ReadError
from daq.readers.reader import HEAD_BYTES

MAGIC = b"\x1f\x8b\x08"
"""Gzip with the only method there is, deflate."""

LARGEST_RATIO = 100
"""A text of measured numbers shrinks to a tenth; deflate's own limit is a thousandth."""

_SPARE_BYTES = 1 << 20
_GZIP = 16 + zlib.MAX_WBITS


def unpacked_head(head: bytes) -> bytes:
    """Return a file's first bytes, unpacked if they are gzip's; empty if they cannot be unpacked."""
    if not head.startswith(MAGIC):
        return head
    try:
        return zlib.decompressobj(_GZIP).decompress(head, HEAD_BYTES)
    except zlib.error:
        return b""


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
        If it cannot be read, or would unpack to more than `LARGEST_RATIO` times its size.
    CorruptFileError
        If it does not unpack, or its checksum is wrong.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ReadError(
            f"cannot be read: {error.strerror}", path=path, remedy="check its name and permissions"
        ) from error
    if not content.startswith(MAGIC):
        return content, ""
    limit = LARGEST_RATIO * len(content) + _SPARE_BYTES
    pieces: list[bytes] = []
    size, left = 0, content
    while left.startswith(MAGIC):
        member = zlib.decompressobj(_GZIP)
        try:
            pieces.append(member.decompress(left, limit - size + 1))
        except zlib.error as error:
            raise CorruptFileError(
                "the compressed file does not unpack", path=path, found=str(error), remedy="copy the file again"
            ) from error
        size += len(pieces[-1])
        if size > limit:
            raise ReadError(
                f"the compressed file unpacks to more than {LARGEST_RATIO} times its size",
                path=path,
                remedy="unpack it first if this is right",
            )
        if not member.eof:
            return b"".join(pieces), f"the compressed file is cut: {size} bytes could be unpacked"
        left = member.unused_data
    if left.strip(b"\0"):
        raise CorruptFileError(
            "something else follows the compressed data",
            path=path,
            place=f"byte {len(content) - len(left)}",
            remedy="copy the file again",
        )
    return b"".join(pieces), ""
