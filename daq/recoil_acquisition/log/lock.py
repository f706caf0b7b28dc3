"""The lock that a log's writer holds, so that nobody recovers or removes a log that still grows."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from recoil_acquisition.file_lock import try_lock

NAME = "writer.lock"


class FolderLock:
    """Exclusive lock on a folder that one process writes; held from making it to `release`.

    Raises
    ------
    BlockingIOError
        If another writer holds it.
    OSError
        If the lock file cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            try_lock(self._descriptor)
            if os.fstat(self._descriptor).st_nlink == 0:
                raise BlockingIOError("its last holder was just removing it")
        except OSError as error:
            os.close(self._descriptor)
            raise BlockingIOError(*error.args) from error

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


def is_being_written(folder: Path) -> bool:
    """Return whether a writer, in this process or another, holds the lock of a folder."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDWR)
    except FileNotFoundError:
        return False
    try:
        try_lock(descriptor)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
