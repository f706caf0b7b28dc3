"""The beginning of a file, read and decoded once, and what a reader says when it is shown it."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import read_beginning
from recoil_acquisition.readers.text_file import decode_head

HEAD_BYTES = 65536
"""Bytes of a file that a reader sees before it says whether it claims it."""

GZIP = b"\x1f\x8b\x08"
"""First bytes of a file that gzip packed (RFC 1952), with the only method there is, deflate."""


class Claim(IntEnum):
    """Sureness of a reader that a file is of its format; the surest claim takes the file.

    Attributes
    ----------
    NO
        The file is none of this format.
    SHAPE
        The file may be of this format, for which nothing but its shape speaks. It is taken where a rig says of which
        kind its source is.
    GENERIC
        The file is of a general format, such as HDF5, which a reader of something more special may know better.
    CERTAIN
        The file says itself that it is of this format.
    """

    NO = 0
    SHAPE = 1
    GENERIC = 2
    CERTAIN = 3


@dataclass(frozen=True)
class Head:
    """The first bytes of a file, for readers to recognise it by.

    Attributes
    ----------
    content
        First `HEAD_BYTES` bytes, or all of a shorter file.
    path
        File, for a reader that must look further.
    """

    content: bytes = field(repr=False)
    path: Path = Path()

    @classmethod
    def of(cls, path: Path) -> Head:
        """Read the head of a file.

        Raises
        ------
        ReadError
            If the file is missing, no file but a directory, a pipe or a device, empty or not readable.
        """
        content = read_beginning(path, HEAD_BYTES)
        if not content:
            raise ReadError("the file is empty", path=path, remedy="export it again")
        return cls(content, path)

    @cached_property
    def text(self) -> str:
        r"""The bytes as text with ``\n`` line ends; empty if they are not text."""
        return decode_head(self.content)

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The lines of the text; the last one may be cut."""
        return tuple(self.text.split("\n"))

    @cached_property
    def unpacked_text(self) -> str:
        """The text of what gzip packed; of any other file, its text."""
        if not self.content.startswith(GZIP):
            return self.text
        try:
            return decode_head(zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(self.content, HEAD_BYTES))
        except zlib.error:
            return ""

    def shows(self, sign: bytes | str) -> bool:
        """Whether the file begins with a pattern of bytes, or a pattern of text is in its unpacked text.

        Parameters
        ----------
        sign
            A regular expression.
        """
        if isinstance(sign, bytes):
            return re.match(sign, self.content) is not None
        return re.search(sign, self.unpacked_text) is not None
