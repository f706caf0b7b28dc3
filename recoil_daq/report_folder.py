"""The folder of one shot's reports: what is written into it appears whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from daq.errors import StoreError


def refuse_existing(folder: Path, names: Sequence[str]) -> None:
    """Refuse a folder that holds any of some files.

    Raises
    ------
    StoreError
        Naming the first of them.
    """
    for name in names:
        if (folder / name).exists():
            raise StoreError(
                "the report exists already", path=folder / name, remedy="give another --out, or --overwrite"
            )


def publish(folder: Path, write: Callable[[Path], None]) -> None:
    """Let files be written beside their place, then put them there.

    Parameters
    ----------
    folder : Path
        Is made if it is not there. Of one that is, only the files that are written are replaced: it may hold
        somebody's notes.
    write : callable
        Given an empty folder, writes the files into it.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".partial", dir=folder.parent))
    except OSError as error:
        raise StoreError(f"cannot write here: {error.strerror}", path=folder.parent, remedy="choose --out") from error
    try:
        write(partial)
        # a temporary folder is private to its owner; a report is not
        partial.chmod(0o777 & ~_umask())
        if folder.exists():
            for part in sorted(partial.iterdir()):
                part.replace(folder / part.name)
        else:
            partial.rename(folder)
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror}", path=folder, remedy="check space and permissions"
        ) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
