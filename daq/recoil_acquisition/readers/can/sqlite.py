"""Frames in a table of an SQLite database, as python-can writes them.

Layout: the table ``messages`` with the columns `COLUMNS`, one row per frame in the order of arrival; the file
format is that of SQLite (https://www.sqlite.org/fileformat2.html), whose header states the number of pages.
Channel and direction are not stored.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError, system_errors_as
from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanLog, FrameList, start_of_stamps

MAGIC = b"SQLite format 3\0"
TABLE = "messages"
COLUMNS = ("ts", "arbitration_id", "extended", "remote", "error", "dlc", "data")

_HEADER_BYTES = 100
_STEPS_PER_BYTE = 10
"""Steps of SQLite's machine per byte of a table; far more are those of a table that never ends."""
_STEPS = 10_000
_LEAST_ROW_BYTES = 16
"""Bytes of a row at least: a stamp of 8 bytes, a header of 8; more rows than that allows are pages that are given again
and again."""


def read_can_sqlite(path: Path) -> CanLog:
    """Read such a table.

    Returns
    -------
    CanLog
        Time counts from the first data frame if the stamps are those of a clock; else it is as stored.

    Raises
    ------
    ReadError
        If the file cannot be read.
    CorruptFileError
        If it is cut, damaged, or has no such table.
    """
    with system_errors_as(ReadError, path, "read", "check its permissions"):
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(_HEADER_BYTES)
    _check_size(path, head, size)
    found = FrameList()
    try:
        for row in _rows(path, size):
            _read_row(row, found)
    except (sqlite3.Error, UnicodeError, OverflowError) as error:
        raise CorruptFileError(
            f"the database cannot be read: {error}", path=path, expected=f"the table `{TABLE}` of python-can"
        ) from error
    frames, start = start_of_stamps(found)
    beside = [path.name + end for end in ("-journal", "-wal") if path.with_name(path.name + end).exists()]
    incomplete = f"{', '.join(beside)} beside it was not read: its last frames may be missing" if beside else ""
    log = found.log(frames, start, incomplete, channels="not stored by this format")
    return log.without_buses()


def _check_size(path: Path, head: bytes, size: int) -> None:
    if len(head) < _HEADER_BYTES or not head.startswith(MAGIC):
        raise CorruptFileError("no header of an SQLite database", path=path, place="byte 0")
    page = int.from_bytes(head[16:18], "big")
    page = 65536 if page == 1 else page
    pages = int.from_bytes(head[28:32], "big")
    if size < page * max(pages, 1):
        raise CorruptFileError(
            "the database is cut",
            path=path,
            file_end=FileEnd.MISSING,
            expected=f"{pages} pages of {page} bytes",
            found=f"{size} bytes",
            remedy="copy the file again, after the recorder has been stopped",
        )


def _rows(path: Path, size: int) -> Iterator[tuple[object, ...]]:
    """Yield the table's rows; raises sqlite3.Error."""
    # immutable: neither locks nor journals are touched, so that nothing is ever written beside a recording
    with closing(sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)) as base:
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(size, 1 << 16))
        left = [_STEPS_PER_BYTE * size // _STEPS + 1000]

        def is_too_long() -> bool:
            left[0] -= 1
            return left[0] < 0

        base.set_progress_handler(is_too_long, _STEPS)
        base.execute("PRAGMA trusted_schema = OFF")
        base.execute("PRAGMA cell_size_check = ON")
        kinds = base.execute("SELECT type, rootpage FROM sqlite_master WHERE name = ?", (TABLE,)).fetchall()
        if len(kinds) != 1 or kinds[0][0] != "table" or not kinds[0][1]:
            raise sqlite3.DatabaseError(f"{TABLE!r} is no plain table")
        names = [row[1] for row in base.execute(f"PRAGMA table_xinfo({TABLE})") if row[6] == 0]
        if not set(COLUMNS) <= set(names):
            raise sqlite3.DatabaseError(f"the table has the columns {', '.join(map(str, names[:20]))}")
        # Types and lengths are given without reading a value, which may be as large as the file, in every row
        numbers = [f"CASE WHEN typeof({name}) IN ('integer', 'real') THEN {name} END" for name in COLUMNS[:-1]]
        data = "CASE WHEN typeof(data) = 'blob' AND length(data) <= 64 THEN data END"
        rows = base.execute(f"SELECT {', '.join(numbers)}, {data} FROM {TABLE} ORDER BY rowid")  # noqa: S608  constants
        for number, row in enumerate(rows):
            if number > size // _LEAST_ROW_BYTES:
                raise sqlite3.DatabaseError("more rows than the file has room for")
            yield row


def _read_row(row: tuple[object, ...], found: FrameList) -> None:
    stamp_s, identifier, extended, remote, error, length, data = row
    if error == 1:
        found.error_frames += 1
    elif remote == 1:
        found.remote_frames += 1
    elif (
        isinstance(stamp_s, float | int)
        and abs(stamp_s) < 1e10
        and isinstance(identifier, int)
        and isinstance(data, bytes)
        and (extended, remote, error) in ((0, 0, 0), (1, 0, 0))
        and len(data) == length
        and len(data) in FD_LENGTHS
    ):
        whole_s = int(stamp_s)  # apart, because the product would lose what the stamp still has
        time_ns = whole_s * 1_000_000_000 + round((stamp_s - whole_s) * 1e9)
        found.add_identified(time_ns, identifier, 0, data, extended=bool(extended))
    else:
        found.damaged += 1
