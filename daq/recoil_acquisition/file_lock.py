"""Locks on files: one process holds one at a time.

The operating system gives a lock back when its holder ends, however it ends.
"""

from __future__ import annotations

import errno
import os
import sys
import time
from pathlib import Path
from types import TracebackType

LOOK_EVERY_S = 0.02
_HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EDEADLK})
"""Errors by which systems answer while another holds the lock; whatever else they answer, they have no such lock
there."""
_LOCKED_BYTE = 1 << 30
"""Place of the locked byte, beyond what any lock file holds: Windows lets nobody else read a byte that is locked."""
# a link that somebody put there would have another file written
_FLAGS = os.O_RDWR | os.O_CREAT | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_BINARY"))


class FileLock:
    """A lock that is waited for, with a small file whose content its holder may read and write.

    The file stays when the lock is given back. Where the file system has no locks, nobody is waited for.

    Parameters
    ----------
    path
        Path of the lock's file; made if it is missing.
    wait_s
        Time for which another holder is waited for.

    Raises
    ------
    TimeoutError
        If another holds it for so long.
    OSError
        If the file cannot be made.
    """

    def __init__(self, path: Path, wait_s: float) -> None:
        self.path = path
        until_s = time.monotonic() + wait_s
        while not self._taken():
            if time.monotonic() > until_s:
                raise TimeoutError(errno.ETIMEDOUT, f"another command has held it for {wait_s:g} s")
            time.sleep(LOOK_EVERY_S)

    def __enter__(self) -> FileLock:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._descriptor)

    def read(self) -> bytes:
        """Return what a holder wrote last."""
        os.lseek(self._descriptor, 0, os.SEEK_SET)
        return os.read(self._descriptor, os.fstat(self._descriptor).st_size)

    def write(self, content: bytes) -> None:
        """Replace the content of the file."""
        os.lseek(self._descriptor, 0, os.SEEK_SET)
        os.write(self._descriptor, content)
        os.ftruncate(self._descriptor, len(content))

    def _taken(self) -> bool:
        self._descriptor = os.open(self.path, _FLAGS, 0o666)
        try:
            os.lseek(self._descriptor, _LOCKED_BYTE, os.SEEK_SET)
            try_lock(self._descriptor)
            if _is_still(self.path, self._descriptor):
                return True
        except OSError as error:
            if error.errno not in _HELD:
                return True
        os.close(self._descriptor)
        return False


def _is_still(path: Path, descriptor: int) -> bool:
    """Return whether a file that was opened bears its name still: a lock on one that was removed keeps nobody out."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def try_lock(descriptor: int) -> None:
        """Take the lock of an open file, of the byte it stands at; OSError if another has it."""
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def try_lock(descriptor: int) -> None:
        """Take the lock of an open file; OSError if another has it."""
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
