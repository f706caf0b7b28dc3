"""A file's final name, taken only when its content is complete: never over another file, and forced to the disk."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def rename_to_new(temporary: Path, path: Path) -> None:
    """Give a complete file its final name unless something bears it by now.

    Parameters
    ----------
    temporary : Path
        In the same folder.
    path : Path

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


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk; Windows has no such call, and network file systems may refuse it."""
    if os.name == "nt":
        return
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
