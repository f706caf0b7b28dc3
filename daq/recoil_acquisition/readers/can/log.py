"""Logs of CAN buses in their vendors' formats, decoded by the bus's database.

The database is declared by the rig; the log alone has no signals. Logs that are text may be packed by gzip (RFC 1952),
and are unpacked within bounds.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as
from recoil_acquisition.readers.bounded_file import most_unpacked
from recoil_acquisition.readers.can.asc import is_asc, read_asc
from recoil_acquisition.readers.can.blf_objects import read_blf
from recoil_acquisition.readers.can.candump import is_candump, read_candump
from recoil_acquisition.readers.can.csv import (
    CANEDGE_HEADER,
    HEADER,
    is_can_csv,
    is_canedge_csv,
    read_can_csv,
    read_canedge_csv,
)
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.can.recording import CanRecording, declared_database
from recoil_acquisition.readers.can.second_recording import SecondRecordingError, refuse_second_recording
from recoil_acquisition.readers.can.sqlite import read_can_sqlite
from recoil_acquisition.readers.can.trc import is_trc, read_trc
from recoil_acquisition.readers.head import GZIP, Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.text_file import decode_text
from recoil_acquisition.remark import Note, NoteCode

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
        Sign by which it shows that the packed file was cut; empty if nothing shows that.

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


@dataclass(frozen=True)
class LogReader:
    """Reader of one format of logs.

    Attributes
    ----------
    read
        Function that reads the frames of a file.
    is_own
        Whether a text, unpacked, begins as this format does; a binary format is known by its sign.
    """

    name: str
    read: Callable[[Path], CanLog]
    is_own: Callable[[str], bool] = lambda _: True

    def claims(self, head: Head) -> Claim:
        """Be certain of a text that begins as the format does."""
        return Claim.CERTAIN if self.is_own(head.unpacked_text) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if it is damaged, or the database is missing or wrong."""
        database = declared_database(declared, path)
        log = self.read(path)
        refuse_second_recording(log, path)
        return CanRecording(path, self.name, log, database, declared)


def _read_lines(path: Path, read: Callable[[bytes, str], CanLog]) -> CanLog:
    """Read a text that may be compressed."""
    content, cut = read_unpacked(path)
    file = decode_text(path, content)
    try:
        log = read(file.data, file.encoding)
    except SecondRecordingError as error:
        raise error.of(path) from error
    signs = [sign for sign in (file.cut, cut) if sign]
    if not signs:
        return log
    notes = (*log.notes, *(Note(NoteCode.CUT, None, sign) for sign in signs))
    return replace(log, notes=notes, incomplete="; ".join(filter(None, (log.incomplete, *signs))))


def _headed(is_own: Callable[[str], bool], whose: str, expected: str, path: Path, text: bytes, encoding: str) -> None:
    """Refuse a text without the header of its format."""
    if not is_own(text[:4000].decode(encoding, errors="replace")):
        raise CorruptFileError(f"no header of {whose}", path=path, place="line 1", expected=expected)


def _read_asc(path: Path) -> CanLog:
    def read(text: bytes, encoding: str) -> CanLog:
        _headed(is_asc, "an ASC log", "`date` and `base hex` or `base dec`", path, text, encoding)
        return read_asc(text, encoding)

    return _read_lines(path, read)


def _read_blf(path: Path) -> CanLog:
    with system_errors_as(ReadError, path, "read"):
        return read_blf(path, path.read_bytes())


def _read_candump(path: Path) -> CanLog:
    try:
        return _read_lines(path, lambda text, _encoding: read_candump(text))
    except ValueError as error:
        raise ReadError(
            "the log does not say when its frames came", path=path, found=str(error),
            remedy="record with `candump -L`, or with `-ta` or `-tz` on a screen",
        ) from error  # fmt: skip


def _read_trc(path: Path) -> CanLog:
    return _read_lines(path, lambda text, encoding: read_trc(path, text, encoding))


def _read_can_csv(path: Path) -> CanLog:
    def read(text: bytes, encoding: str) -> CanLog:
        _headed(is_can_csv, "python-can", HEADER, path, text, encoding)
        return read_can_csv(text)

    return _read_lines(path, read)


def _read_canedge(path: Path) -> CanLog:
    def read(text: bytes, encoding: str) -> CanLog:
        _headed(is_canedge_csv, "CANedge", CANEDGE_HEADER, path, text, encoding)
        return read_canedge_csv(text)

    return _read_lines(path, read)


ASC = LogReader("Vector ASC log", _read_asc, is_asc)
BLF = LogReader("Vector BLF log", _read_blf)
CANDUMP = LogReader("candump log", _read_candump, is_candump)
TRC = LogReader("PEAK TRC trace", _read_trc, is_trc)
CAN_CSV = LogReader("python-can CSV log", _read_can_csv, is_can_csv)
CANEDGE_CSV = LogReader("CANedge CSV log", _read_canedge, is_canedge_csv)
CAN_SQLITE = LogReader("python-can SQLite log", read_can_sqlite)
