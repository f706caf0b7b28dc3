"""Files that somebody names, opened only if they are files.

A pipe that nobody writes to would be waited for without end, a device may never end, and opening one may do something:
each is recognised by its status before it is opened, and again once it is open. A link to a file is a file.
"""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from recoil_acquisition.errors import ReadError

_KINDS = (
    (stat.S_ISDIR, "directory"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
    (stat.S_ISSOCK, "socket"),
)
LONGEST_NAME_BYTES = 255
"""Bytes of a file's longest name, on any usual file system."""
_HOLES_FROM_BYTES = 1 << 26
_LARGEST_HOLES = 64
_LEAST_ROOM_BYTES = 1 << 16
# POSIX alone has the first three, Windows the last: what is opened there without it is text
REGULAR_FLAGS = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"))


def open_regular(path: Path) -> io.BufferedReader:
    """Open a file to read its bytes.

    Raises
    ------
    ReadError
        If it is missing, cannot be read, is a directory, a pipe, a device or a socket, or was never written for
        the most part.
    """
    with _map_to_read_error(path):
        _refuse_special(path, path.stat())
        handle = os.open(path, REGULAR_FLAGS)
        try:
            status = os.fstat(handle)
            _refuse_special(path, status)
            _refuse_holes(path, status)
        except ReadError:
            os.close(handle)
            raise
        return os.fdopen(handle, "rb")


FileState = tuple[Path, int, int, int, int]
"""What differs of a file that somebody wrote since: its path, times, size and place on the disk."""


def state_of(path: Path) -> FileState:
    """Return the state of a file; OSError if there is none."""
    state = path.stat()
    return path.absolute(), state.st_mtime_ns, state.st_ctime_ns, state.st_size, state.st_ino


def check_regular(path: Path) -> None:
    """Raise `ReadError` if `open_regular` does."""
    open_regular(path).close()


def read_beginning(path: Path, count: int) -> bytes:
    """Read the first bytes of a file, `count` at most; raises `ReadError` as `open_regular` does."""
    with open_regular(path) as file, _map_to_read_error(path):
        # room is taken for all that is asked for: no more of it than the file needs, some systems' own files state none
        return file.read(min(count, max(os.fstat(file.fileno()).st_size, _LEAST_ROOM_BYTES) + 1))


def read_small(path: Path, largest_bytes: int, what: str) -> bytes:
    """Read all of a file that is small by its nature.

    Parameters
    ----------
    what
        Kind of file that it should be, for the message.

    Raises
    ------
    ReadError
        As `open_regular`; also if the file is larger.
    """
    content = read_beginning(path, largest_bytes + 1)
    if len(content) > largest_bytes:
        raise ReadError("the file is too large", path=path, expected=f"{what} of at most {largest_bytes / 1e6:g} MB")
    return content


def require_name(name: str) -> None:
    """Raise ValueError where what a document calls a file is more than a name, and could lead out of its folder."""
    if name in ("", "..") or Path(name).name != name or len(os.fsencode(name)) > LONGEST_NAME_BYTES:
        raise ValueError(f"a file called {name[:40]!r}, which is no name of one")


@contextmanager
def _map_to_read_error(path: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise ReadError("no such file", path=path, remedy="check the name and the folder") from error
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror}", path=path, remedy="check its permissions") from error
    except ValueError as error:  # a name that holds a zero byte
        raise ReadError(f"no such file: {error}", path=path, remedy="check the name and the folder") from error


def _refuse_holes(path: Path, status: os.stat_result) -> None:
    # Disks that compress store zeros in a thirtieth; Windows does not say
    stored = 512 * getattr(status, "st_blocks", status.st_size)
    if status.st_size > _HOLES_FROM_BYTES and stored * _LARGEST_HOLES < status.st_size:
        raise ReadError(
            "most of the file was never written", path=path, expected=f"{status.st_size} bytes",
            found=f"{stored} on the disk", remedy="copy it again",
        )  # fmt: skip


def _refuse_special(path: Path, status: os.stat_result) -> None:
    if stat.S_ISREG(status.st_mode):
        return
    kind = next((name for is_kind, name in _KINDS if is_kind(status.st_mode)), "special file")
    remedy = "name the files in it" if kind == "directory" else "copy what it gives into a file"
    raise ReadError(f"this is a {kind}", path=path, expected="a file", remedy=remedy)
