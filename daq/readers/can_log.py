"""Logs of CAN buses in their vendors' formats, decoded by the bus's database.

The database (DBC) is declared by the rig; the log alone has no signals.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from daq.errors import CorruptFileError, ReadError
from daq.readers.can_blf import MAGIC, read_blf
from daq.readers.can_frames import CanLog
from daq.readers.can_recording import CanRecording, declared_database
from daq.readers.can_text import is_asc, is_candump, read_asc, read_candump
from daq.readers.reader import Declarations
from daq.readers.text_file import decode_head, read_text


def _open(path: Path, declared: Declarations, name: str, read: Callable[[Path], CanLog]) -> CanRecording:
    database = declared_database(declared, path)
    return CanRecording(path, name, read(path), database, declared)


class AscReader:
    """Reader of Vector's text log."""

    name = "Vector ASC log"
    kind = "can"
    suffixes = (".asc",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the header states a number base."""
        return is_asc(decode_head(head))

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if the database is missing or wrong."""

        def read(path: Path) -> CanLog:
            file = read_text(path)
            text = file.data.decode(file.encoding, errors="replace")
            if not is_asc(text):
                raise CorruptFileError(
                    "no header of an ASC log", path=path, place="line 1", expected="`date` and `base hex` or `base dec`"
                )
            return read_asc(text)

        return _open(path, declared, self.name, read)


class BlfReader:
    """Reader of Vector's binary log."""

    name = "Vector BLF log"
    kind = "can"
    suffixes = (".blf",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the file begins with LOGG."""
        return head.startswith(MAGIC)

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
    kind = "can"
    suffixes = (".log",)

    def claims(self, head: bytes) -> bool:
        """Tell whether the first line is a stamped frame."""
        return is_candump(decode_head(head))

    def open(self, path: Path, declared: Declarations) -> CanRecording:
        """Open a log; raises `ReadError` if the database is missing or wrong."""

        def read(path: Path) -> CanLog:
            file = read_text(path)
            return read_candump(file.data.decode(file.encoding, errors="replace"))

        return _open(path, declared, self.name, read)
