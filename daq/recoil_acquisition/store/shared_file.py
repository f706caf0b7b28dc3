"""A small file that commands change and people save in place, so that nothing of either is lost.

A program that saves in place empties a file and writes it anew, in parts: what is read meanwhile is a part of it, also
where it ends on a whole line. So a file that others changed a moment ago is waited for, by whoever reads or changes it.
Commands change it one after another, under a lock, and in one step: beside the file stands, as a whole, what it is to
be, and takes its name only if the file is still what the change was made to. A save that falls between these two is
found in the file that was replaced, and the change is made to that one again.

Beside ``NAME`` stand ``.NAME.lock``, which says what commands wrote; ``.NAME.before``, the file that was replaced last,
to which a program may still write that had it open; copies ``NAME.<date>T<time>Z.bak`` of what was replaced, where
somebody else had written it or something in it was changed; and of the oldest of those an archive, ``NAME.bak.zip``.
"""

from __future__ import annotations

import datetime as dt
import glob
import hashlib
import json
import os
import shutil
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.file_lock import FileLock
from recoil_acquisition.new_file import give_name, partial_path, remove_partials
from recoil_acquisition.regular_file import read_small

QUIET_S = 2.0
"""Time for which others must have left a file alone before what they changed is complete."""
COARSE_S = 2.0
"""Largest step in which a file system keeps times: by so much longer a whole second is waited for."""
LOOK_EVERY_S = 0.05
LONGEST_SAVE_S = 30.0
"""Longest time for which a file is waited for that others change again and again."""
LONGEST_QUEUE_S = 120.0
"""Longest time for which other commands are waited for; each of them may wait for a save."""
MOST_BACKUPS = 20
"""Copies of what was replaced, beyond which the older half goes into one archive."""
_REMEMBERED = 8
"""Number of the last files that commands wrote of which it is known which they were."""


class _State(NamedTuple):
    """State of a file: one that was written since has another, also where its content is that of an earlier one."""

    sha256: str
    inode: int
    size: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path, content: bytes) -> _State:
        status = path.stat()
        return cls(digest(content), status.st_ino, status.st_size, status.st_mtime_ns)


class _Memory(NamedTuple):
    """Content of a lock's file.

    Attributes
    ----------
    ours
        Files that commands wrote, the last one first.
    before
        Digest of the file that was replaced last, as it was then; empty if it has no second name.
    """

    ours: tuple[_State, ...] = ()
    before: str = ""

    @classmethod
    def of(cls, content: bytes) -> _Memory:
        """Read it; nothing is known where it cannot be read."""
        try:
            found = json.loads(content)
            ours = tuple(_State(str(a), int(b), int(c), int(d)) for a, b, c, d in found["ours"])
            return cls(ours[:_REMEMBERED], str(found["before"]))
        except (ValueError, LookupError, TypeError, RecursionError):
            return cls()

    def content(self) -> bytes:
        return json.dumps({"ours": self.ours[:_REMEMBERED], "before": self.before}).encode()


class SharedFile:
    """A file that others write in place, under the lock of those who change it.

    Parameters
    ----------
    path
        Path of the file. A link stays one: what it names is changed.
    largest_bytes, what
        Size beyond which the file is none of its kind, and the name of that kind, for messages.
    """

    def __init__(self, path: Path, largest_bytes: int, what: str, lock: FileLock) -> None:
        self.path = path
        self._target = Path(os.path.realpath(path))
        self._largest_bytes, self._what, self._lock = largest_bytes, what, lock
        self._before = self._target.with_name(f".{self._target.name}.before")

    @classmethod
    @contextmanager
    def held(cls, path: Path, largest_bytes: int, what: str) -> Iterator[SharedFile]:
        """Hold the lock of a file.

        Raises
        ------
        StoreError
            If another command holds it for `LONGEST_QUEUE_S`, or the folder cannot be written.
        """
        target = Path(os.path.realpath(path))
        try:
            lock = FileLock(_lock_path(target), LONGEST_QUEUE_S)
        except OSError as error:
            raise _not_written(path, error) from error
        with lock:
            # whoever left a part of a file behind is not there any more: it held the lock
            with suppress(OSError):
                remove_partials(target)
            yield cls(path, largest_bytes, what, lock)

    def read(self) -> bytes | None:
        """Return the content when nobody else is changing it; None without a file.  Errors as of `read_settled`."""
        return read_settled(self.path, self._largest_bytes, self._what)

    def replace(self, content: bytes | None, by: bytes, *, keep: bool) -> bool:
        """Replace the file in one step if it still has a content.

        Parameters
        ----------
        content
            Content that the file must have; None if there must be none.
        by
            Content that the file is to have.
        keep
            Whether a copy of what is replaced is kept in any case; else only if somebody else wrote it.

        Returns
        -------
        bool
            False if the file has another content now: it is as it was then.

        Raises
        ------
        StoreError
            If it cannot be written; it is as it was then.
        """
        ours = _Memory.of(self._lock.read()).ours
        temporary = partial_path(self._target)
        try:
            with temporary.open("xb") as stream:
                stream.write(by)
                stream.flush()
                os.fsync(stream.fileno())
            before = ""
            if content is not None:
                shutil.copymode(self._target, temporary)
                if keep or digest(content) not in {one.sha256 for one in ours}:
                    self._keep(content)
                before = digest(content) if self._linked() else ""
            # told first: whoever reads the file when it has its name must know it for a command's
            self._lock.write(_Memory((_State.of(temporary, by), *ours), before).content())
            if content is not None and self._target.read_bytes() != content:
                return False
            _name(temporary, self._target, overwrite=content is not None)
        except FileExistsError:
            return False
        except OSError as error:
            if isinstance(error, FileNotFoundError) and content is not None and self._target.parent.is_dir():
                return False
            raise _not_written(self.path, error) from error
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
        return True

    def late(self) -> bytes | None:
        """Return what somebody wrote into the file that was replaced last, who had it open; None if nobody did.

        It is said once, and a copy of it is kept.
        """
        memory = _Memory.of(self._lock.read())
        try:
            if not memory.before or not self._before.is_file() or self._before.samefile(self._target):
                return None
            found = _settled(self._before, memory.before, self._largest_bytes, self._what)
            if digest(found) == memory.before:
                return None
            self._keep(found)
        except (OSError, ReadError):
            return None
        self._lock.write(memory._replace(before=digest(found)).content())
        return found

    def _linked(self) -> bool:
        """Give the file that is to be replaced a second name; False where there are none."""
        try:
            self._before.unlink(missing_ok=True)
            self._before.hardlink_to(self._target)
        except OSError:
            return False
        return True

    def _keep(self, content: bytes) -> None:
        """Keep a copy beside the file, unless the newest one is the same."""
        kept = backups_of(self._target)
        if kept and kept[-1].read_bytes() == content:
            return
        temporary = partial_path(self._target)
        stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        try:
            temporary.write_bytes(content)
            with suppress(FileExistsError):  # of this very microsecond, and so of this content
                give_name(temporary, self._target.with_name(f"{self._target.name}.{stamp}.bak"))
        finally:
            temporary.unlink(missing_ok=True)
        if len(kept) >= MOST_BACKUPS:
            _archive(self._target, kept[: len(kept) // 2])


def read_settled(path: Path, largest_bytes: int, what: str) -> bytes | None:
    """Read a file when nobody but commands has changed it for `QUIET_S`.

    Returns
    -------
    bytes or None
        None if there is no file.

    Raises
    ------
    ReadError
        If it cannot be read, is too large, or others change it for longer than `LONGEST_SAVE_S`.
    """
    target = Path(os.path.realpath(path))
    until_s = time.monotonic() + QUIET_S
    while not os.path.lexists(target):
        # some programs take a file away and give its name to a new one
        ours = _ours(target)
        if os.path.lexists(path) and not ours:
            break  # a link to nothing
        if not ours or not _is_young(target.parent) or time.monotonic() > until_s:
            return None
        time.sleep(LOOK_EVERY_S)
    return _settled(target, "", largest_bytes, what, path)


def digest(content: bytes) -> str:
    """Return the SHA-256 of a content, hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def backups_of(path: Path) -> list[Path]:
    """Return the copies of what was replaced that stand beside a file, the oldest first."""
    return sorted(one for one in path.parent.glob(f"{glob.escape(path.name)}.[0-9]*Z.bak") if one.is_file())


def _settled(target: Path, sha256: str, largest_bytes: int, what: str, path: Path | None = None) -> bytes:
    """Read a file when it is as a command wrote it, has a digest, or is left alone for a while.

    Parameters
    ----------
    path
        Path by which the file is named to people; the one that is read if left out.
    """
    path = target if path is None else path
    started_s = steady_since_s = time.monotonic()
    seen: _State | None = None
    while True:
        content = read_small(path, largest_bytes, what)
        state, now_s = None, time.monotonic()
        with suppress(OSError):
            state = _State.of(target, content)
        if state is None or state != seen:
            seen, steady_since_s = state, now_s
        if state is not None and state.size == len(content):
            if state.sha256 == sha256 or state in _ours(target) or not _is_young(target):
                return content
            # by this computer's clock alone: the one that dates the file may be another
            if now_s - steady_since_s >= QUIET_S:
                return content
        if now_s - started_s > LONGEST_SAVE_S:
            raise ReadError(
                f"another program has been changing it for {LONGEST_SAVE_S:g} s", path=path,
                remedy="close it there, and run the command again",
            )  # fmt: skip
        time.sleep(LOOK_EVERY_S)


def _is_young(path: Path) -> bool:
    """Return whether a file was changed a moment ago, by the clock that dates it."""
    with suppress(OSError):
        changed_ns = path.stat().st_mtime_ns
        coarse_s = 0.0 if changed_ns % 1_000_000_000 else COARSE_S
        return time.time() - changed_ns / 1e9 < QUIET_S + coarse_s
    return False


def _lock_path(target: Path) -> Path:
    return target.with_name(f".{target.name}.lock")


def _ours(target: Path) -> tuple[_State, ...]:
    """Return which files commands wrote last, as those who only read learn it."""
    lock = _lock_path(target)
    with suppress(OSError, ReadError):
        if not lock.is_symlink():
            return _Memory.of(read_small(lock, 10_000, "a lock")).ours
    return ()


def _name(temporary: Path, target: Path, *, overwrite: bool) -> None:
    """Give a file its name; on Windows nobody can while another has it open, as every reader does for a moment."""
    until_s = time.monotonic() + QUIET_S
    while True:
        try:
            give_name(temporary, target, overwrite=overwrite)
            return
        except PermissionError:
            if os.name != "nt" or time.monotonic() > until_s:
                raise
            time.sleep(LOOK_EVERY_S)


def _archive(target: Path, files: list[Path]) -> None:
    """Move copies into the archive: at any instant each is in one of the two; what cannot be moved stays."""
    archive, temporary = target.with_name(f"{target.name}.bak.zip"), partial_path(target)
    try:
        if os.path.lexists(archive):
            if not archive.is_file():
                return
            shutil.copyfile(archive, temporary)
        with zipfile.ZipFile(temporary, "a", zipfile.ZIP_DEFLATED) as into:
            there = frozenset(into.namelist())
            for file in files:
                if file.name not in there:
                    into.write(file, file.name)
        give_name(temporary, archive, overwrite=archive.exists())
        for file in files:
            file.unlink()
    except (OSError, ValueError, zipfile.BadZipFile):
        pass
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _not_written(path: Path, error: OSError) -> StoreError:
    return StoreError(
        f"cannot be written: {error.strerror or error}", path=path,
        remedy="close it in other programs, or give permission there",
    )  # fmt: skip
