"""Locks on files: one process holds one at a time.

The operating system gives a lock back when its holder ends, however it ends. Some file systems have none (FUSE, NFS,
SMB): there a file beside the locked one says who holds it, which only one process can make. Who ended without taking it
away is known by being of this computer and not there any more; of another computer, by its age.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import errno
import hashlib
import json
import os
import platform
import secrets
import sys
import time
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import visible

LOOK_EVERY_S = 0.02
LONGEST_COMMAND_S = 600.0
"""Age from which on another computer's command that changes a small file is taken to have ended."""
_HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EDEADLK})
"""Errors by which systems answer while another holds the lock; whatever else they answer, they have no such lock
there."""
_LOCKED_BYTE = 1 << 30
"""Place of the locked byte, beyond what any lock file holds: Windows lets nobody else read a byte that is locked."""
# a link that somebody put there would have another file written
_FLAGS = os.O_RDWR | os.O_CREAT | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_BINARY"))
_LARGEST_MARK = 1000


class LockTakenError(BlockingIOError):
    """Another process holds a lock.

    Attributes
    ----------
    holder
        Who holds it, and the file to remove if that is not so; None where the operating system keeps the lock.
    """

    def __init__(self, holder: str | None = None) -> None:
        super().__init__(errno.EAGAIN, "another process holds it")
        self.holder = holder


class FileLock:
    """A lock that is waited for, with a small file whose content its holder may read and write.

    The file stays when the lock is given back.

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
        while (taken := self._taken()) is not None:
            if time.monotonic() > until_s:
                by = "" if taken.holder is None else f", {taken.holder}"
                raise TimeoutError(errno.ETIMEDOUT, f"another command has held it for {wait_s:g} s{by}")
            time.sleep(LOOK_EVERY_S)

    def __enter__(self) -> FileLock:
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()
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

    def _taken(self) -> LockTakenError | None:
        """Take the lock; return what another holder is known by."""
        self._descriptor = os.open(self.path, _FLAGS, 0o666)
        try:
            os.lseek(self._descriptor, _LOCKED_BYTE, os.SEEK_SET)
            self._lock = TakenLock(self._descriptor, self.path, LONGEST_COMMAND_S)
            if _is_still(self.path, self._descriptor):
                return None
            self._lock.release()
            taken = LockTakenError()
        except LockTakenError as error:
            taken = error
        except BaseException:
            os.close(self._descriptor)
            raise
        os.close(self._descriptor)
        return taken


class TakenLock:
    """The lock of an open file, of the byte it stands at; it is given back by `release`, or by closing the file.

    Parameters
    ----------
    descriptor, path
        The open file, and its path.
    longest_s
        Age from which on a holder on another computer is taken to have ended, where the file system has no locks.

    Raises
    ------
    LockTakenError
        If another has it.
    OSError
        If there is neither a lock nor a way to write beside the file.
    """

    def __init__(self, descriptor: int, path: Path, longest_s: float) -> None:
        self._mark: Path | None = None
        if not _locked(descriptor):
            self._mark = mark_path(path)
            self._told = _Mark.of_this_process().content()
            while not _made(self._mark, self._told):
                content, holder = _look(self._mark, longest_s)
                if holder is not None:
                    raise LockTakenError(holder)
                if content is not None:
                    _take_away(self._mark, content, self._told, longest_s)

    def release(self) -> None:
        """Take away what says that it is held; the file is the caller's to close."""
        if self._mark is not None:
            with contextlib.suppress(OSError):
                if self._mark.read_bytes() == self._told:
                    self._mark.unlink()


def is_locked(descriptor: int, path: Path, longest_s: float) -> bool:
    """Return whether a process holds the lock of a file; parameters as of `TakenLock`. Nothing is written."""
    try:
        return not _locked(descriptor) and _look(mark_path(path), longest_s)[1] is not None
    except LockTakenError:
        return True


def mark_path(path: Path) -> Path:
    """Return the path of the file that says who holds a lock where the file system has none."""
    return path.with_name(f"{path.name}.held")


class _Mark(NamedTuple):
    """Content of a holder's file: computer, process, and a text that no other holder has."""

    host: str
    pid: int
    token: str

    @classmethod
    def of_this_process(cls) -> _Mark:
        return cls(platform.node(), os.getpid(), secrets.token_hex(8))

    def content(self) -> bytes:
        return json.dumps(self._asdict()).encode()

    @classmethod
    def of(cls, content: bytes) -> _Mark | None:
        try:
            said = json.loads(content)
            return cls(str(said["host"]), int(said["pid"]), str(said["token"]))
        except (ValueError, LookupError, TypeError, RecursionError):
            return None


def _made(mark: Path, told: bytes) -> bool:
    """Make a holder's file; False if there is one."""
    try:
        descriptor = os.open(mark, _FLAGS | os.O_EXCL, 0o666)
    except FileExistsError:
        return False
    try:
        os.write(descriptor, told)
    finally:
        os.close(descriptor)
    return True


def _look(mark: Path, longest_s: float) -> tuple[bytes | None, str | None]:
    """Return what a holder's file says (None if there is none), and who holds the lock (None if that one has ended)."""
    try:
        content, since_s = _read(mark)
    except FileNotFoundError:
        return None, None
    said = _Mark.of(content)
    if said is not None and said.host == platform.node() and sys.platform != "win32":
        ended = not _runs(said.pid)
    else:
        ended = time.time() - since_s > longest_s
    who = "a process" if said is None else f"process {said.pid} of {visible(said.host)}"
    since = dt.datetime.fromtimestamp(since_s).astimezone().isoformat(timespec="seconds")
    return content, None if ended else f"{who} since {since}; if that has ended, remove {mark}"


def _read(mark: Path) -> tuple[bytes, float]:
    """Return what a holder's file says, and since when."""
    with mark.open("rb") as stream:
        return stream.read(_LARGEST_MARK), os.fstat(stream.fileno()).st_mtime


def _take_away(mark: Path, content: bytes, told: bytes, longest_s: float) -> None:
    """Take away the file of a holder that has ended.

    Only one process may take away a content, and what another process made meanwhile is never touched: the right to it
    is a holder's file too, with a name of its own for each content, and who ended before it was used leaves it to be
    taken away likewise.
    """
    right = mark.with_name(f"{mark.name}.{hashlib.sha256(content).hexdigest()[:8]}")
    if _made(right, told):
        with contextlib.suppress(FileNotFoundError):  # another had the right before, and used it
            if _read(mark)[0] == content:
                mark.unlink()
        right.unlink(missing_ok=True)
        return
    of_right, holder = _look(right, longest_s)
    if holder is not None:
        raise LockTakenError(holder)
    if of_right is not None:
        _take_away(right, of_right, told, longest_s)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass  # another person's
    return True


def _locked(descriptor: int) -> bool:
    """Take the operating system's lock; False where the file system has none, LockTakenError if another has it."""
    try:
        try_lock(descriptor)
    except OSError as error:
        if error.errno in _HELD:
            raise LockTakenError from error
        return False
    return True


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
