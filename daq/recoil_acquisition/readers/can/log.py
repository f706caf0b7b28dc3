"""Logs of CAN buses in their vendors' formats, decoded by the bus's database.

The database is declared by the rig; the log alone has no signals. Logs that are text may be compressed by gzip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.can.asc import is_asc, read_asc
from recoil_acquisition.readers.can.blf import read_blf
from recoil_acquisition.readers.can.candump import is_candump, read_candump
from recoil_acquisition.readers.can.csv import HEADER, is_can_csv, read_can_csv
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.can.packed_file import read_unpacked
from recoil_acquisition.readers.can.recording import CanRecording, declared_database
from recoil_acquisition.readers.can.sqlite import read_can_sqlite
from recoil_acquisition.readers.can.trc import is_trc, read_trc
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.text.text_file import decode_text


def _open(path: Path, declared: Declarations, name: str, read: Callable[[Path], CanLog]) -> CanRecording:
    database = declared_database(declared, path)
    return CanRecording(path, name, read(path), database, declared)


def _read_lines(path: Path, read: Callable[[bytes, str], CanLog]) -> CanLog:
    """Read a text that may be compressed."""
    content, cut = read_unpacked(path)
    file = decode_text(path, content)
    log = read(file.data, file.encoding)
    if not cut:
        return log
    return replace(log, notes=(*log.notes, cut), incomplete="; ".join(filter(None, (log.incomplete, cut))))


class AscReader:
    """Reader of Vector's text log."""

    name = "Vector ASC log"

    def claims(self, head: Head) -> Claim:
        """Be certain of a header that states a number base."""
        return Claim.CERTAIN if is_asc(head.unpacked_text) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if the database is missing or wrong."""

        def read(text: bytes, encoding: str) -> CanLog:
            if not is_asc(text[:4000].decode(encoding, errors="replace")):
                raise CorruptFileError(
                    "no header of an ASC log", path=path, place="line 1", expected="`date` and `base hex` or `base dec`"
                )
            return read_asc(text, encoding)

        return _open(path, declared, self.name, lambda path: _read_lines(path, read))


class BlfReader:
    """Reader of Vector's binary log."""

    name = "Vector BLF log"

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if it is damaged, or the database is missing or wrong."""

        def read(path: Path) -> CanLog:
            try:
                return read_blf(path, path.read_bytes())
            except OSError as error:
                raise ReadError(f"cannot be read: {error.strerror}", path=path) from error

        return _open(path, declared, self.name, read)


class CandumpReader:
    """Reader of the log of can-utils."""

    name = "candump log"

    def claims(self, head: Head) -> Claim:
        """Be certain of a first line that is a stamped frame."""
        return Claim.CERTAIN if is_candump(head.unpacked_text) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if the database is missing or wrong."""

        def read(path: Path) -> CanLog:
            try:
                return _read_lines(path, lambda text, _encoding: read_candump(text))
            except ValueError as error:
                raise ReadError(
                    "the log does not say when its frames came", path=path, found=str(error),
                    remedy="record with `candump -L`, or with `-ta` or `-tz` on a screen",
                ) from error  # fmt: skip

        return _open(path, declared, self.name, read)


class TrcReader:
    """Reader of PEAK's traces."""

    name = "PEAK TRC trace"

    def claims(self, head: Head) -> Claim:
        """Be certain of a header that states a version, and of a first entry of version 1.0."""
        return Claim.CERTAIN if is_trc(head.unpacked_text) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a trace; raises `ReadError` if its version is unknown, or the database is missing or wrong."""
        return _open(
            path,
            declared,
            self.name,
            lambda path: _read_lines(path, lambda text, encoding: read_trc(path, text, encoding)),
        )


class CanCsvReader:
    """Reader of python-can's comma-separated values."""

    name = "python-can CSV log"

    def claims(self, head: Head) -> Claim:
        """Be certain of a first line that is python-can's header."""
        return Claim.CERTAIN if is_can_csv(head.unpacked_text) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if the database is missing or wrong."""

        def read(text: bytes, encoding: str) -> CanLog:
            if not is_can_csv(text[:4000].decode(encoding, errors="replace")):
                raise CorruptFileError("no header of python-can", path=path, place="line 1", expected=HEADER)
            return read_can_csv(text)

        return _open(path, declared, self.name, lambda path: _read_lines(path, read))


class CanSqliteReader:
    """Reader of python-can's databases."""

    name = "python-can SQLite log"

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if it is damaged, or the database is missing or wrong."""
        return _open(path, declared, self.name, read_can_sqlite)
