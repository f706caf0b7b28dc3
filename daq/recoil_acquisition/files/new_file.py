"""Files that bear their name only when they are complete: never over another unasked, and forced to the disk.

Whoever writes a file writes it under the name that `partial_path` gives, checks it, and lets `give_name` name it. What
a process left under a partial name when it ended before that, `remove_partials` takes away.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import time
from pathlib import Path

from recoil_acquisition.files.disk_sync import sync

_TOKEN_BYTES = 4

_NO_SUCH_CALL = frozenset(
    {
        errno.EACCES, errno.EISDIR, errno.EBADF, errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP,
    }
)  # fmt: skip
"""What a system or a file system answers that cannot force a folder to the disk, as PostgreSQL takes it
(``fsync_fname_ext`` in src/backend/storage/file/fd.c) and what file systems in user space answer."""


def partial_path(path: Path, *, keeps_suffix: bool = False) -> Path:
    """Return a hidden name beside a path, unlike any other, for what is not complete yet.

    Parameters
    ----------
    path
        Final name of the file.
    keeps_suffix
        Whether it ends as `path` does, for libraries that want that of a file they write.
    """
    token = f"{secrets.token_hex(_TOKEN_BYTES)}.partial"
    return path.with_name(f".{path.stem}.{token}{path.suffix}" if keeps_suffix else f".{path.name}.{token}")


def remove_partials(path: Path, *, idle_s: float = 0.0) -> None:
    """Remove what lies under partial names of a path and was not written for so long.

    Nobody must be writing it any more: who cannot know that names a time after which nobody does.
    """
    with contextlib.suppress(FileNotFoundError):
        for partial in partials_of(path):
            if not (idle_s and time.time() - partial.stat().st_mtime < idle_s):
                partial.unlink(missing_ok=True)


def remove_left_partials(folder: Path, *, idle_s: float) -> None:
    """Remove from a folder what lies under partial names, of whatever path, and was not written for so long.

    A name that keeps a suffix is left: whoever writes that takes it away.
    """
    partial = re.compile(rf"\..+\.[0-9a-f]{{{2 * _TOKEN_BYTES}}}\.partial")
    with contextlib.suppress(OSError):
        for left in folder.iterdir():
            if partial.fullmatch(left.name) and time.time() - left.stat().st_mtime >= idle_s:
                left.unlink(missing_ok=True)


def partials_of(path: Path) -> list[Path]:
    """Return what stands under partial names of a path, which keep no suffix, in the order of these names."""
    partial = re.compile(re.escape(f".{path.name}.") + f"[0-9a-f]{{{2 * _TOKEN_BYTES}}}" + re.escape(".partial"))
    return sorted(beside for beside in path.parent.iterdir() if partial.fullmatch(beside.name))


def give_name(temporary: Path, path: Path, *, overwrite: bool = False) -> None:
    """Force a complete file to the disk and give it its final name.

    Parameters
    ----------
    temporary
        Path of the finished file, in the same folder.
    overwrite
        Whether the file that bears the name by now is replaced.

    Raises
    ------
    FileExistsError
        If the name is taken and not to be replaced.
    OSError
        If it cannot be forced to the disk or renamed. Nothing of a new name is left then; a file that was to be
        replaced is there, or the new one is, complete.
    """
    sync_file(temporary)
    if overwrite:
        temporary.replace(path)
        sync_folder(path.parent)
        return
    _rename_to_new(temporary, path)
    try:
        sync_folder(path.parent)
    except OSError:
        path.unlink()
        raise


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Give a file its final name unless something bears it by now; the temporary name may stay beside it.

    Raises
    ------
    FileExistsError
        If the name is taken.
    OSError
        If it cannot be renamed; nothing of the new name is left then.
    """
    if os.name == "nt":
        temporary.rename(path)  # Windows refuses if the name is taken
        return
    try:
        path.hardlink_to(temporary)
    except FileExistsError:
        raise
    except OSError:
        # A file system without hard links: reserve the name first, then take it
        path.touch(exist_ok=False)
        try:
            temporary.replace(path)
        except OSError:
            path.unlink()
            raise


def sync_file(path: Path) -> None:
    """Force the content of a file to the disk; OSError if it cannot be."""
    with path.open("rb+") as stream:
        sync(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk.

    Windows has no such call, and some file systems refuse it: there the names are as safe as they can be, and nobody
    could do anything about it. A disk that fails is another thing, and what was promised about a name does not hold.

    Raises
    ------
    OSError
        If the disk fails.
    """
    if os.name == "nt":
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            sync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _NO_SUCH_CALL:
            raise
