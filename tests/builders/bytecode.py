"""What Python compiles in a test run, kept for all of its processes, and compiled by one of them.

Two workers that collect the same tests in the same order compile every file twice, at the same time. In opposite
orders they meet in the middle, and each finds the other's half done.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

LINKED = "linked"
"""This file beside the kept bytecode says that what is installed was linked into it."""


def keep_bytecode(folder: Path) -> None:
    """Let the processes that are started from now on keep what they compile in a folder.

    Where Python is told to leave nothing beside the sources, each of some hundred processes would compile them again.
    It then looks for bytecode in that folder alone: what is installed has its own beside it, which is linked there.
    """
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if not (folder / LINKED).exists():
        installed = [Path(place) for place in sys.path if Path(place).name == "site-packages"]
        with contextlib.suppress(OSError):  # without links it is compiled again
            link_installed(folder, installed)
            (folder / LINKED).touch()


def link_installed(folder: Path, installed: Iterable[Path]) -> None:
    """Link the bytecode of what is installed to where Python looks for it, given ``PYTHONPYCACHEPREFIX``.

    Python replaces a file of bytecode and never writes into one, so the link may be the file itself, by another name:
    a fifth of the time that symbolic links of ten thousands of files take.
    """
    for place in installed:
        for at, folders, _ in os.walk(place):
            if "__pycache__" not in folders:
                continue
            folders.remove("__pycache__")
            kept = folder.joinpath(*Path(at).parts[1:])
            kept.mkdir(parents=True, exist_ok=True)
            for cached in os.scandir(Path(at, "__pycache__")):
                with contextlib.suppress(FileExistsError):
                    _link(cached.path, kept / cached.name)


def _link(file: str, name: Path) -> None:
    try:
        os.link(file, name)
    except FileExistsError:
        raise
    except OSError:  # on another disk, or where the operating system refuses it
        name.symlink_to(file)


class Backwards(pytest.Dir):
    """A folder whose tests are collected from its last file to its first."""

    def collect(self) -> Iterable[pytest.Item | pytest.Collector]:
        """Return what is in it."""
        return reversed(list(super().collect()))


def collects_backwards() -> bool:
    """Return whether this process is every second one of several workers."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    return int(worker.removeprefix("gw")) % 2 == 1


def in_order(items: list[pytest.Item]) -> None:
    """Put collected tests into an order that is the same forwards and backwards; a file's own order stays."""
    items.sort(key=lambda item: item.path.parts)
