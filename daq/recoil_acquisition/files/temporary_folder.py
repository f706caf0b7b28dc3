"""Folders for what is needed for a while, and those of processes that were killed taken away later."""

from __future__ import annotations

import contextlib
import tempfile
import time
from pathlib import Path

PREFIX = "recoil-daq-"
"""Beginning of their names, in the system's temporary folder."""
LEFT_AFTER_S = 3600.0
"""Time without a change after which an empty one is nobody's, s."""


def temporary_folder(purpose: str = "") -> tempfile.TemporaryDirectory[str]:
    """Make a folder that goes with its last use; take away empty ones that killed processes left.

    Parameters
    ----------
    purpose
        Word in its name.
    """
    remove_left_folders()
    return tempfile.TemporaryDirectory(prefix=PREFIX + (f"{purpose}-" if purpose else ""))


def remove_left_folders() -> None:
    """Remove empty temporary folders that nobody has changed for an hour; who may not remove one leaves it."""
    with contextlib.suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            with contextlib.suppress(OSError):
                if folder.is_dir() and not folder.is_symlink() and time.time() - folder.stat().st_mtime > LEFT_AFTER_S:
                    folder.rmdir()  # refuses one with something in it
