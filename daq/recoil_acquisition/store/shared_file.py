"""A small file that commands change and people save in place, so that nothing of either is lost.

A program that saves in place empties a file and writes it anew, in parts: what is read meanwhile is a part of it, also
where it ends on a whole line. So a file that others changed a moment ago is waited for, by whoever reads or changes it,
and for longer where it lacks what was there when a command last looked: one that stays so is refused until somebody
says that it is meant. Commands change it one after another, under a lock, and in one step: beside the file stands, as a
whole, what it is to be, and takes its name only if the file is still what the change was made to. A save that falls
between these two, or that goes on later, is found in the file that was replaced, and joined with what changed since.

Beside ``NAME`` stand ``.NAME.lock``, which says what commands wrote; ``.NAME.seen``, what a command last saw or wrote;
``.NAME.<date>T<time>Z.before``, files that were replaced within `KEPT_S`, to which a program may still write that had
them open, each with a note on what it held then (``.was``); copies ``NAME.<date>T<time>Z.bak`` of what was replaced,
where somebody else had written it or something in it was changed; and of the oldest of those an archive,
``NAME.bak.zip``.
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
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import ErrorCode, ReadError, StoreError
from recoil_acquisition.files.disk_sync import sync
from recoil_acquisition.files.file_lock import FileLock
from recoil_acquisition.files.new_file import give_name, partial_path, remove_partials
from recoil_acquisition.files.regular_file import read_small

QUIET_S = 2.0
"""Time for which others must have left a file alone before what they changed is complete."""
COARSE_S = 2.0
"""Largest step in which a file system keeps times: by so much longer a whole second is waited for."""
LOOK_EVERY_S = 0.05
LONGEST_SAVE_S = 30.0
"""Longest time for which a file is waited for that others change again and again, or have left in part."""
KEPT_S = 3600.0
"""Time for which a file that was replaced is kept, since a program last wrote to it that had it open."""
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


def _ours_in(content: bytes) -> tuple[_State, ...]:
    """Return which files commands wrote, the last one first, by a lock's file; none where it cannot be read."""
    try:
        found = json.loads(content)["ours"]
        return tuple(_State(str(a), int(b), int(c), int(d)) for a, b, c, d in found[:_REMEMBERED])
    except (ValueError, LookupError, TypeError, RecursionError):
        return ()


class FileKind(NamedTuple):
    """Kind of files: its name, and how one that is being saved is known.

    Attributes
    ----------
    what
        Name of the kind, for messages.
    largest_bytes
        Size beyond which a file is none of the kind.
    lacks
        Function of a content, None without a file, and of that which a command last saw, None if none did; it returns
        what the former plainly lacks, as while it is being saved, in words, empty if nothing.
    remedy
        Sentence on what to do where it stays so; ``{folder}`` in it is the folder of the file.
    """

    what: str
    largest_bytes: int
    lacks: Callable[[bytes | None, bytes | None], str]
    remedy: str


class LateWriting(NamedTuple):
    """Writing of somebody into a file that was replaced, who had it open.

    Attributes
    ----------
    base
        Content of the file as far as it was known before.
    is_now
        Content that it has.
    base_path
        Path of the note on it.
    """

    base: bytes
    is_now: bytes
    base_path: Path

    def note(self, target: Path) -> None:
        """Note what is known of it."""
        _write_beside(target, self.base_path, digest(self.is_now).encode() + b"\n" + self.base)


class SharedFile:
    """A file that others write in place, under the lock of those who change it.

    Parameters
    ----------
    path
        Path of the file. A link stays one: what it names is changed.
    """

    def __init__(self, path: Path, kind: FileKind, lock: FileLock) -> None:
        self.path = path
        self._target = Path(os.path.realpath(path))
        self._kind, self._lock = kind, lock

    @classmethod
    @contextmanager
    def held(cls, path: Path, kind: FileKind) -> Iterator[SharedFile]:
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
            yield cls(path, kind, lock)

    def read(self, *, as_it_is: bool = False) -> bytes | None:
        """Return the content when nobody else is changing it; None without a file.  Errors as of `read_settled`.

        Parameters
        ----------
        as_it_is
            Whether what it lacks is meant.
        """
        return read_settled(self.path, self._kind, as_it_is=as_it_is)

    def replace(self, content: bytes | None, by: bytes, *, keep: bool, base: bytes | None = None) -> bool:
        """Replace the file in one step if it still has a content.

        Parameters
        ----------
        content
            Content that the file must have; None if there must be none.
        by
            Content that the file is to have.
        keep
            Whether a copy of what is replaced is kept in any case; else only if somebody else wrote it.
        base
            Content that counts as known of the file that is replaced, if that is more than its own.

        Returns
        -------
        bool
            False if the file has another content now: it is as it was then.

        Raises
        ------
        StoreError
            If it cannot be written; it is as it was then.
        """
        ours = _ours_in(self._lock.read())
        temporary = partial_path(self._target)
        aside: Path | None = None
        try:
            with temporary.open("xb") as stream:
                stream.write(by)
                stream.flush()
                sync(stream.fileno())
            if content is not None:
                shutil.copymode(self._target, temporary)
                if keep or digest(content) not in {one.sha256 for one in ours}:
                    self._keep(content)
                aside = self._aside(content, content if base is None else base)
            # told first: whoever reads the file when it has its name must know it for a command's
            told = json.dumps({"ours": (_State.of(temporary, by), *ours)[:_REMEMBERED]})
            self._lock.write(told.encode())
            if content is not None and self._target.read_bytes() != content:
                return False
            if aside is not None and not aside.with_suffix(".before").exists():
                self._target.rename(aside.with_suffix(".before"))
            _name(temporary, self._target, overwrite=os.path.lexists(self._target) and content is not None)
            aside = None
        except FileExistsError:
            return False
        except OSError as error:
            if isinstance(error, FileNotFoundError) and content is not None and self._target.parent.is_dir():
                return False
            raise _not_written(self.path, error) from error
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
                if aside is not None:  # nothing was replaced
                    if not os.path.lexists(self._target):
                        aside.with_suffix(".before").rename(self._target)
                    _forget(aside)
        self.seen(by)
        return True

    def seen(self, content: bytes) -> None:
        """Note a content as that which a command last saw."""
        path = _seen_path(self._target)
        if _read_whole(path) != content:
            with suppress(OSError):  # of an earlier one less is known
                _write_beside(self._target, path, content)

    def noted(self, late: Iterable[LateWriting]) -> None:
        """Note that what was written late is in the file now, and forget files that nobody wrote to for long."""
        with suppress(OSError):
            for one in late:
                self._keep(one.is_now)
                one.note(self._target)
            for before, noted in _replaced(self._target):
                if _is_young(noted, KEPT_S) or _is_young(before, KEPT_S):
                    continue
                content = _read_whole(before)
                if content is not None and digest(content) != _noted(noted)[0]:
                    self._keep(content)
                _forget(noted)

    def _aside(self, content: bytes, base: bytes) -> Path:
        """Give the file that is to be replaced a second name, and return the path of a note on what it holds now."""
        stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S.%fZ")
        noted = self._target.with_name(f".{self._target.name}.{stamp}.was")
        LateWriting(base, content, noted).note(self._target)
        with suppress(OSError):  # a file system without second names: it is moved away
            noted.with_suffix(".before").hardlink_to(self._target)
        return noted

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


def read_settled(path: Path, kind: FileKind, *, as_it_is: bool = False) -> bytes | None:
    """Read a file when nobody but commands has changed it for `QUIET_S`, and it is no part of what is being saved.

    Parameters
    ----------
    as_it_is
        Whether what it lacks is meant.

    Returns
    -------
    bytes or None
        None if there is no file.

    Raises
    ------
    ReadError
        If it cannot be read, is too large, or others change it, or leave it in part, for longer than `LONGEST_SAVE_S`.
    """
    target = Path(os.path.realpath(path))
    earlier = None if as_it_is else last_seen(target)
    begun_s = time.monotonic()
    while not os.path.lexists(target):
        # some programs take a file away and give its name to a new one
        ours = _ours(target)
        if os.path.lexists(path) and not ours:
            break  # a link to nothing
        lacks = "" if earlier is None else kind.lacks(None, earlier)
        wait_s = LONGEST_SAVE_S if lacks else QUIET_S
        if not ours or not _is_young(target.parent, wait_s) or time.monotonic() - begun_s > wait_s:
            if lacks:
                raise _in_part(path, lacks, kind)
            return None
        time.sleep(LOOK_EVERY_S)
    return _settled(target, kind, path, earlier, as_it_is=as_it_is)


def late_writing(path: Path, kind: FileKind) -> tuple[LateWriting, ...]:
    """Return what somebody wrote into files that commands replaced, who had them open; the oldest of these first."""
    target, found = Path(os.path.realpath(path)), list[LateWriting]()
    for before, noted in _replaced(target):
        sha256, base = _noted(noted)
        content = _read_whole(before)
        if content is None or digest(content) == sha256:
            continue
        with suppress(ReadError, OSError):
            if not before.samefile(target):
                found.append(LateWriting(base, _settled(before, kind, before, base, insist=False), noted))
    return tuple(found)


def last_seen(path: Path) -> bytes | None:
    """Return what a command last saw or wrote of a file; None if none did."""
    return _read_whole(_seen_path(Path(os.path.realpath(path))))


def digest(content: bytes) -> str:
    """Return the SHA-256 of a content, hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def backups_of(path: Path) -> list[Path]:
    """Return the copies of what was replaced that stand beside a file, the oldest first."""
    return sorted(one for one in path.parent.glob(f"{glob.escape(path.name)}.[0-9]*Z.bak") if one.is_file())


def _settled(
    target: Path, kind: FileKind, path: Path, earlier: bytes | None, *, as_it_is: bool = False, insist: bool = True
) -> bytes:
    """Read a file when it is as a command wrote it, or is left alone for a while and lacks nothing of an earlier one.

    Parameters
    ----------
    path
        Path by which the file is named to people.
    insist
        Whether one is refused that lacks something of the earlier one when it was waited for.
    """
    started_s = steady_since_s = time.monotonic()
    seen: _State | None = None
    while True:
        content = read_small(path, kind.largest_bytes, kind.what)
        state, now_s = None, time.monotonic()
        with suppress(OSError):
            state = _State.of(target, content)
        if state is None or state != seen:
            seen, steady_since_s = state, now_s
        late = now_s - started_s > LONGEST_SAVE_S
        if state is not None and state.size == len(content):
            if state in _ours(target):
                return content
            # by this computer's clock alone: the one that dates the file may be another
            if now_s - steady_since_s >= QUIET_S or not _is_young(target, QUIET_S):
                lacks = "" if as_it_is else kind.lacks(content, earlier)
                if not lacks:
                    return content
                if late or not _is_young(target, LONGEST_SAVE_S):
                    if insist and earlier is not None:
                        raise _in_part(path, lacks, kind)
                    return content
                late = False  # nobody is changing it
        if late:
            raise ReadError(
                f"another program has been changing it for {LONGEST_SAVE_S:g} s", path=path,
                remedy="close it there, and run the command again",
            )  # fmt: skip
        time.sleep(LOOK_EVERY_S)


def _in_part(path: Path, lacks: str, kind: FileKind) -> ReadError:
    return ReadError(
        f"it lacks what was there when a command last looked: {lacks}", code=ErrorCode.CUT_OFF, path=path,
        remedy=kind.remedy.replace("{folder}", str(path.parent)),
    )  # fmt: skip


def _is_young(path: Path, within_s: float) -> bool:
    """Return whether a file was changed a moment ago, by the clock that dates it."""
    with suppress(OSError):
        changed_ns = path.stat().st_mtime_ns
        coarse_s = 0.0 if changed_ns % 1_000_000_000 else COARSE_S
        return time.time() - changed_ns / 1e9 < within_s + coarse_s
    return False


def _replaced(target: Path) -> list[tuple[Path, Path]]:
    """Return files that were replaced, the oldest first, each with the path of the note on what is known of it."""
    notes = sorted(target.parent.glob(f".{glob.escape(target.name)}.[0-9]*Z.was"))
    return [(noted.with_suffix(".before"), noted) for noted in notes]


def _noted(noted: Path) -> tuple[str, bytes]:
    """Return the digest of a file that was replaced as it was looked at last, and what was known of it then."""
    sha256, _, base = (_read_whole(noted) or b"").partition(b"\n")
    return sha256.decode("ascii", "replace"), base


def _forget(noted: Path) -> None:
    noted.with_suffix(".before").unlink(missing_ok=True)
    noted.unlink(missing_ok=True)


def _seen_path(target: Path) -> Path:
    return target.with_name(f".{target.name}.seen")


def _read_whole(path: Path) -> bytes | None:
    """Return the content of a file that commands keep; None if there is none that could be read."""
    with suppress(OSError):
        if path.is_file() and not path.is_symlink():
            return path.read_bytes()
    return None


def _write_beside(target: Path, path: Path, content: bytes) -> None:
    """Write a file that commands keep beside another one, in one step."""
    temporary = partial_path(target)
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _lock_path(target: Path) -> Path:
    return target.with_name(f".{target.name}.lock")


def _ours(target: Path) -> tuple[_State, ...]:
    """Return which files commands wrote last, as those who only read learn it."""
    lock = _lock_path(target)
    with suppress(OSError, ReadError):
        if not lock.is_symlink():
            return _ours_in(read_small(lock, 10_000, "a lock"))
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
