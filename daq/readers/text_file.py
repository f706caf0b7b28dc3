"""Text files of unknown encoding and line ends.

What instruments export as text differs in encoding (byte order mark, UTF-8, Windows code page) and
line ends, and neither is written down in the file: both are found from the bytes.
"""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from pathlib import Path

from daq.errors import CorruptFileError, ReadError

ENCODING_BYTES = 1 << 20
"""How much of a file decides on its encoding: all but numbers stands in the first lines."""


@dataclass(frozen=True)
class TextFile:
    r"""A text file's content with one byte per ASCII character and ``\n`` as its only line end.

    Attributes
    ----------
    path : Path
    data : bytes
        Content without byte order mark; UTF-16 is held as UTF-8.
    encoding : str
        In which `data` is held.
    """

    path: Path
    data: bytes
    encoding: str

    def lines(self, start: int, count: int) -> list[str]:
        """Return up to ``count`` lines from byte ``start``, without their line ends."""
        rows = self.data[start:].split(b"\n", count) if start else self.data.split(b"\n", count)
        return [row.decode(self.encoding, errors="replace") for row in rows[:count]]

    def start_of(self, line: int) -> int:
        """Return the byte at which a line begins, counted from 0; the end of the file behind its last one."""
        start = 0
        for _ in range(line):
            end = self.data.find(b"\n", start)
            if end < 0:
                return len(self.data)
            start = end + 1
        return start


def read_text(path: Path) -> TextFile:
    """Read a text file: byte order mark, else UTF-8, else Windows-1252.

    Raises
    ------
    ReadError
        If it cannot be read.
    CorruptFileError
        If it announces UTF-16 and is not.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ReadError(
            f"cannot be read: {error.strerror}", path=path, remedy="check its name and permissions"
        ) from error
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            text = raw[: len(raw) // 2 * 2].decode("utf-16")
        except UnicodeDecodeError as error:
            raise CorruptFileError("is not the UTF-16 it announces", path=path, place=f"byte {error.start}") from error
        return TextFile(path, _one_line_end(text.encode("utf-8")), "utf-8")
    raw = raw.removeprefix(codecs.BOM_UTF8)
    encoding = "utf-8" if _is_utf8(raw[:ENCODING_BYTES]) else "cp1252"
    return TextFile(path, _one_line_end(raw), encoding)


def decode_head(head: bytes) -> str:
    r"""Decode a file's first bytes to text with ``\n`` line ends; empty if they are not text."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = head[: len(head) // 2 * 2].decode("utf-16", errors="replace")
    else:
        head = head.removeprefix(codecs.BOM_UTF8)
        text = head.decode("utf-8" if _is_utf8(head) else "cp1252", errors="replace")
    return "" if "\0" in text else text.replace("\r\n", "\n").replace("\r", "\n")


def _is_utf8(data: bytes) -> bool:
    """Tell whether bytes are UTF-8, the last character possibly cut."""
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data, final=False)
    except UnicodeDecodeError:
        return False
    return True


def _one_line_end(data: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data
