"""One segment file of a log while it is written, and the lock that keeps others from a log that still grows."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import sys
from pathlib import Path

from recoil_acquisition.files.disk_sync import sync, sync_data
from recoil_acquisition.files.file_lock import LockTakenError, TakenLock, is_locked

LOCK_NAME = "writer.lock"
LONGEST_SESSION_S = 86_400.0
"""Age from which on a writer on another computer is taken to have ended, where the file system has no locks."""


class FolderLock:
    """Exclusive lock on a folder that one process writes; held from making it to `release`.

    Raises
    ------
    LockTakenError
        If another writer holds it.
    OSError
        If the lock file cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK_NAME
        self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            self._lock = TakenLock(self._descriptor, self._path, LONGEST_SESSION_S)
            if os.fstat(self._descriptor).st_nlink == 0:  # its last holder was just removing it
                self._lock.release()
                raise LockTakenError
        except OSError:
            os.close(self._descriptor)
            raise

    def release(self) -> None:
        """Give the lock back and remove its file."""
        if sys.platform == "win32":
            # An open file cannot be removed there
            os.close(self._descriptor)
            self._path.unlink(missing_ok=True)
        else:
            # Closed first, the file could be another writer's by the time it is removed
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
        self._lock.release()


def is_being_written(folder: Path) -> bool:
    """Return whether a writer, in this process or another, holds the lock of a folder."""
    path = folder / LOCK_NAME
    try:
        descriptor = _opened(path)
    except FileNotFoundError:
        return False
    try:
        return is_locked(descriptor, path, LONGEST_SESSION_S)
    finally:
        os.close(descriptor)


def _opened(path: Path) -> int:
    """Open a lock's file; only to be read where it cannot be written, as on a disk that was taken out of a machine."""
    try:
        return os.open(path, os.O_RDWR)
    except OSError as error:
        if error.errno not in (errno.EROFS, errno.EACCES, errno.EPERM):
            raise
        return os.open(path, os.O_RDONLY)


SUFFIX = ".rdlog"
"""Ending of a segment, and of a capture."""

_NAME = re.compile(r"(\d{6,})" + re.escape(SUFFIX))
_ZEROS = bytes(1 << 20)

# What a file system without the call answers; the others are real failures
_NOT_SUPPORTED = (errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class WritingSegment:
    """A segment whose space is reserved on the disk.

    The file has its full size from the start, zeros behind what is written. Where the system has no
    ``posix_fallocate`` the zeros are written; on a file system that copies on write neither is a promise.

    Parameters
    ----------
    path
        A file that is not there yet.
    size
        Number of bytes to reserve.

    Attributes
    ----------
    oldest_ns, newest_ns
        Earliest and latest host time at which its records' content arrived.
    count
        Number of records.
    spans
        First and last number within each source, and bytes of payload, of its records.

    Raises
    ------
    OSError
        If it cannot be made or the disk has no room; nothing is left of it then.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.size = size
        self.length = 0
        self.oldest_ns, self.newest_ns = (1 << 63) - 1, -(1 << 63)
        self.count = 0
        self.spans: dict[int, list[int]] = {}
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        self._descriptor = os.open(path, flags, 0o644)
        try:
            _reserve(self._descriptor, size)
            sync(self._descriptor)
        except OSError:
            self.discard()
            raise

    @property
    def room(self) -> int:
        """Bytes that still fit."""
        return self.size - self.length

    def write(self, *parts: bytes | memoryview) -> None:
        """Write the parts behind what is there, all of them or raise OSError."""
        _write_all(self._descriptor, parts)
        self.length += sum(len(part) for part in parts)

    def note(self, from_ns: int, host_ns: int) -> None:
        """Note when the content of the record that was written last arrived."""
        self.count += 1
        self.oldest_ns, self.newest_ns = min(self.oldest_ns, from_ns), max(self.newest_ns, host_ns)

    def settle(self) -> None:
        """Go on behind what an interrupted write has left."""
        self.length = os.lseek(self._descriptor, 0, os.SEEK_CUR)

    def sync(self) -> None:
        """Force what is written to the disk."""
        sync_data(self._descriptor)

    def finish(self) -> None:
        """Cut off the space that was not used, force the rest to the disk and close."""
        try:
            # Not `length`, which lags behind if the write was interrupted
            os.ftruncate(self._descriptor, os.lseek(self._descriptor, 0, os.SEEK_CUR))
            sync(self._descriptor)
        finally:
            os.close(self._descriptor)

    def abandon(self) -> None:
        """Close it as it is."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)

    def discard(self) -> None:
        """Close and remove."""
        os.close(self._descriptor)
        self.path.unlink(missing_ok=True)


def segment_name(number: int) -> str:
    """Return the file name of a segment."""
    return f"{number:06d}{SUFFIX}"


def segment_paths(folder: Path) -> dict[int, Path]:
    """Return the segments of a folder by their number, in order; OSError if the folder cannot be listed."""
    matches = ((_NAME.fullmatch(path.name), path) for path in folder.iterdir())
    return dict(sorted((int(match[1]), path) for match, path in matches if match))


def _reserve(descriptor: int, size: int) -> None:
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(descriptor, 0, size)
        except OSError as error:
            if error.errno not in _NOT_SUPPORTED:
                raise
        else:
            return
    left = size
    while left > 0:
        _write_all(descriptor, (memoryview(_ZEROS)[:left],))
        left -= min(left, len(_ZEROS))
    os.lseek(descriptor, 0, os.SEEK_SET)


def _write_all(descriptor: int, parts: tuple[bytes | memoryview, ...]) -> None:
    if hasattr(os, "writev"):
        written = os.writev(descriptor, parts)
        if written == sum(len(part) for part in parts):
            return
        rest = memoryview(b"".join(parts))[written:]
    else:
        # One call, so that a process that is killed leaves at most one record in part
        rest = memoryview(b"".join(parts))
    while rest:
        written = os.write(descriptor, rest)
        if written <= 0:
            raise OSError(errno.EIO, "the system took no bytes")
        rest = rest[written:]
