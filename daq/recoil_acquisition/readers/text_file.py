"""Text files of unknown encoding and line ends.

What instruments export as text differs in encoding (byte order mark, UTF-8, Windows code page) and
line ends, and neither is written down in the file: both are found from the bytes.
"""

from __future__ import annotations

import codecs
import re
import tempfile
import threading
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as

ENCODING_BYTES = 1 << 20
"""Bytes of a file that decide on its encoding: all but numbers stands in the first lines."""

HEADER_LINES = 60
"""Lines within which the header of a table of text must end."""

LOOKED_AT = 50
"""Rows by which is found how a table is written; later rows that break it are errors."""

PART_BYTES = 1 << 18
"""Bytes that are read at a time of what is gone through once."""

CHUNK_BYTES = 1 << 22
"""Bytes that are held at a time of a file that must be transcoded."""


MOST_QUOTED_BYTES, MOST_QUOTED_LINES = 2000, 20
"""Size of a cell in quotes that has line breaks in it; what is longer begins with a quote that is none."""

_BREAK_IN_QUOTES = re.compile(rb'(?:(?<=[\t;,|\r\n])|\A)"[^"\r\n]*[\r\n]')
_QUOTED = re.compile(rb'(?:(?<=[\t;,|\r\n])|\A)"(?:[^"]|""){0,%d}"(?=[\t;,|\r\n]|\Z)' % MOST_QUOTED_BYTES)
_BREAK = re.compile(rb"\r\n|\r|\n")

_REMEDY = "check its name and permissions"


@dataclass(frozen=True)
class TextFile:
    r"""A text file's content with one byte per ASCII character and ``\n`` as its only line end.

    Attributes
    ----------
    data
        Content without byte order mark; UTF-16 is held as UTF-8.
    encoding
        Encoding in which `data` is held.
    cut
        Sign by which it shows that the file was cut off; empty if nothing does.
    """

    path: Path
    data: bytes
    encoding: str
    cut: str = ""

    line_end = b"\n"

    @property
    def size(self) -> int:
        """Number of bytes."""
        return len(self.data)

    def read(self, start: int, stop: int) -> bytes:
        """Return some of the bytes."""
        return self.data[start:stop]

    def parts(self, start: int, stop: int) -> Iterator[bytes]:
        """Return some of the bytes, a part at a time."""
        for at in range(start, stop, PART_BYTES):
            yield self.data[at : min(at + PART_BYTES, stop)]

    def lines(self, count: int) -> list[str]:
        """Return up to ``count`` lines from the beginning, without their line ends."""
        return [row.decode(self.encoding, errors="replace") for row in self.data.split(b"\n", count)[:count]]

    def line_start(self, index: int) -> int:
        """Return the byte at which a line begins, counted from 0; the size if there are fewer."""
        start = 0
        for _ in range(index):
            start = self.data.find(b"\n", start) + 1
            if not start:
                return self.size
        return start


class LongText:
    """A text file that is read in parts; UTF-16 is transcoded to UTF-8 in a temporary file.

    Encoding and line end are found from its beginning; `lines` sees no more of it either.

    Raises
    ------
    ReadError
        If it cannot be read.
    CorruptFileError
        If it announces UTF-16 and is not.
    """

    def __init__(self, path: Path, encoding: str | None = None) -> None:
        self.path = path
        self._transcoded: IO[bytes] | None = None
        self._lock = threading.Lock()
        with system_errors_as(ReadError, path, "read", _REMEDY), path.open("rb") as file:
            head = file.read(ENCODING_BYTES)
            self.size = file.seek(0, 2)
        self._skip = 0
        wide = codecs.lookup(encoding).name.startswith("utf-16") if encoding else False
        if wide or head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            self._transcode(encoding if wide and encoding else "utf-16")
            head = self.read(0, ENCODING_BYTES)
            self.encoding = "utf-8"
        else:
            self._skip = len(codecs.BOM_UTF8) if head.startswith(codecs.BOM_UTF8) else 0
            self.size -= self._skip
            head = head[self._skip :]
            self.encoding = encoding or ("utf-8" if _is_utf8(head) else "cp1252")
        self.cut = ""
        if head.endswith(b"\0") or (self.size and self.read(self.size - 1, self.size) == b"\0"):
            self._leave_nul_bytes_out()
            head = head[: self.size]
        if join_quoted_lines(head) != head:
            self._join_quoted_lines()
            head = self.read(0, ENCODING_BYTES)
        self._head = head
        self.line_end = b"\r" if b"\r" in head and b"\n" not in head else b"\n"

    def _join_quoted_lines(self) -> None:
        """Write the text to a temporary file in which no line ends within a cell in quotes."""
        joined = tempfile.TemporaryFile()  # noqa: SIM115 - closed when this object goes
        waiting = b""
        for part in self._parts(0, self.size, CHUNK_BYTES):
            waiting += part
            whole = waiting.rfind(b"\n") + 1
            # a cell in quotes that is not closed goes on in the next part
            while whole and waiting.count(b'"', 0, whole) % 2 and len(waiting) - whole < MOST_QUOTED_BYTES:
                whole = waiting.rfind(b"\n", 0, whole - 1) + 1
            joined.write(join_quoted_lines(waiting[:whole]))
            waiting = waiting[whole:]
        joined.write(join_quoted_lines(waiting))
        weakref.finalize(self, joined.close)
        self._transcoded, self._skip, self.size = joined, 0, joined.tell()

    def _leave_nul_bytes_out(self) -> None:
        """End the text before the NUL bytes at the end of the file."""
        size = self.size
        while self.size:
            start = max(self.size - PART_BYTES, 0)
            kept = len(self.read(start, self.size).rstrip(b"\0"))
            self.size = start + kept
            if kept:
                break
        self.cut = nul_bytes(size - self.size)

    def _transcode(self, encoding: str) -> None:
        """Write the file as UTF-8 to a temporary one that vanishes with this object."""
        decoder = codecs.getincrementaldecoder(encoding)()
        at = 0
        try:
            with system_errors_as(ReadError, self.path, "read", _REMEDY), self.path.open("rb") as file:
                self._transcoded = tempfile.TemporaryFile()  # noqa: SIM115 - closed when this object goes
                weakref.finalize(self, self._transcoded.close)
                while chunk := file.read(CHUNK_BYTES):
                    text = decoder.decode(chunk)
                    at += len(chunk)
                    self._transcoded.write((text.removeprefix("\ufeff") if at == len(chunk) else text).encode("utf-8"))
                self.size = self._transcoded.tell()
        except (UnicodeDecodeError, UnicodeEncodeError) as error:
            place = f"byte {at + error.start}"
            raise CorruptFileError("is not the UTF-16 it announces", path=self.path, place=place) from error

    def read(self, start: int, stop: int) -> bytes:
        """Read some of the bytes.

        Raises
        ------
        ReadError
            If the file cannot be read any more.
        """
        return b"".join(self._parts(start, stop, max(stop - start, 1)))

    def parts(self, start: int, stop: int) -> Iterator[bytes]:
        """Read some of the bytes, a part at a time: what is soon gone through stays near the processor.

        Raises
        ------
        ReadError
            If the file cannot be read any more.
        """
        return self._parts(start, stop, PART_BYTES)

    def _parts(self, start: int, stop: int, size: int) -> Iterator[bytes]:
        stop = min(stop, self.size)
        with system_errors_as(ReadError, self.path, "read", _REMEDY):
            if self._transcoded is None:
                with self.path.open("rb") as file:
                    file.seek(self._skip + start)
                    for at in range(start, stop, size):
                        yield self._complete(file.read(min(size, stop - at)), min(size, stop - at))
                return
            for at in range(start, stop, size):
                with self._lock:
                    self._transcoded.seek(at)
                    part = self._transcoded.read(min(size, stop - at))
                yield self._complete(part, min(size, stop - at))

    def _complete(self, part: bytes, count: int) -> bytes:
        if len(part) != count:
            raise ReadError("became shorter while it was read", path=self.path, remedy="read it when it is complete")
        return part

    def lines(self, count: int) -> list[str]:
        """Return up to ``count`` lines from the beginning, without their line ends."""
        rows = self._head.split(self.line_end, count)[:count]
        return [row.removesuffix(b"\r").decode(self.encoding, errors="replace") for row in rows]

    def line_start(self, index: int) -> int:
        """Return the byte at which one of the first lines begins, counted from 0; the size if there are fewer."""
        start = 0
        for _ in range(index):
            start = self._head.find(self.line_end, start) + 1
            if not start:
                return self.size
        return start


Text = TextFile | LongText
"""Bytes of a text, one per ASCII character, wherever they are held."""


def read_text(path: Path) -> TextFile:
    """Read a text file: byte order mark, else UTF-8, else Windows-1252.

    Raises
    ------
    ReadError
        If it cannot be read.
    CorruptFileError
        If it announces UTF-16 and is not.
    """
    with system_errors_as(ReadError, path, "read", _REMEDY):
        raw = path.read_bytes()
    file = decode_text(path, raw)
    return replace(file, data=join_quoted_lines(file.data))


def decode_text(path: Path, raw: bytes) -> TextFile:
    """Decode the content of a text file: byte order mark, else UTF-8, else Windows-1252.

    Raises
    ------
    CorruptFileError
        If it announces UTF-16 and is not.
    """
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            text = raw[: len(raw) // 2 * 2].decode("utf-16")
        except UnicodeDecodeError as error:
            raise CorruptFileError("is not the UTF-16 it announces", path=path, place=f"byte {error.start}") from error
        whole = text.rstrip("\0")
        cut = nul_bytes(2 * (len(text) - len(whole)))
        return TextFile(path, one_line_end(whole.encode("utf-8")), "utf-8", cut)
    raw = raw.removeprefix(codecs.BOM_UTF8)
    text_bytes = raw.rstrip(b"\0")
    encoding = "utf-8" if _is_utf8(text_bytes[:ENCODING_BYTES]) else "cp1252"
    return TextFile(path, one_line_end(text_bytes), encoding, nul_bytes(len(raw) - len(text_bytes)))


def nul_bytes(count: int) -> str:
    """Return what NUL bytes at the end of a text show; empty if there are none."""
    return f"{count} NUL bytes stand behind the text: power or the disk failed, and it is cut off" if count else ""


def decode_head(head: bytes) -> str:
    r"""Decode a file's first bytes to text with ``\n`` line ends; empty if they are not text.

    NUL bytes at their end are left out: a file that was allocated beforehand ends with them where power failed.
    """
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = head[: len(head) // 2 * 2].decode("utf-16", errors="replace").rstrip("\0")
    else:
        head = head.removeprefix(codecs.BOM_UTF8).rstrip(b"\0")
        text = head.decode("utf-8" if _is_utf8(head) else "cp1252", errors="replace")
    if "\0" in text:
        return ""
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return (
        join_quoted_lines(text.encode("utf-8", "surrogatepass")).decode("utf-8", "surrogatepass")
        if '"' in text
        else text
    )


def join_quoted_lines(data: bytes) -> bytes:
    """Return a text with a blank for each line break within a cell in quotes, as RFC 4180 allows it."""
    if b'"' not in data or _BREAK_IN_QUOTES.search(data) is None:
        return data

    def joined(found: re.Match[bytes]) -> bytes:
        cell = found.group()
        breaks = len(_BREAK.findall(cell))
        return _BREAK.sub(b" ", cell) if 0 < breaks <= MOST_QUOTED_LINES else cell

    return _QUOTED.sub(joined, data)


def _is_utf8(data: bytes) -> bool:
    """Return whether bytes are UTF-8, the last character possibly cut."""
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data, final=False)
    except UnicodeDecodeError:
        return False
    return True


def one_line_end(data: bytes) -> bytes:
    r"""Return bytes with ``\n`` as their only line end."""
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data
