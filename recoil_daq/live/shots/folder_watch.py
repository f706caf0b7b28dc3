"""Files that other instruments drop into a folder: each is reported once, when it has stopped growing."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.store.shot_log import SHOT_LOG

LOOK_EVERY_S = 0.5
"""Time between two looks into the folder, s: it may lie on a network, and hold a day's files."""

_CLOCK_TRIES = 5
AWAY_S = 2.0
"""Time for which a folder must not have been readable, s, before it counts as away: a network has moments."""

SETTLE_S = 1.0
"""Time for which size and time of change of a complete file stay the same, s, as far as a watcher can see."""


@dataclass(frozen=True)
class DroppedFile:
    """A file that has stopped growing.

    Attributes
    ----------
    seen_s
        Time at which it was first seen, s, by the host's monotonic clock.
    written_s
        Time of its last change, s, by the host's monotonic clock: from its age by the wall clock when that change was
        first seen. So it stays right where somebody sets the wall clock while a session runs.
    """

    path: Path
    seen_s: float
    written_s: float | None = None


@dataclass
class _Growing:
    seen_s: float
    size: int
    changed_ns: int
    steady_since_s: float
    written_s: float


class FolderWatch:
    """Watches one folder, not those in it.

    What lies there already when the watch begins is left alone, unless it is said to be new. Hidden files, empty ones
    and a shot log are not reported.

    Parameters
    ----------
    folder
        Folder that is watched; made if it is missing.
    settle_s
        Function from a file's name to how long it must have stayed the same, s; `SETTLE_S` for each if left out.
    is_new
        Function that returns whether a file that lies there already counts as one that comes now.

    Attributes
    ----------
    made
        Whether the folder was missing.

    Raises
    ------
    ReadError
        If it is no folder, or cannot be made or read.
    """

    def __init__(
        self,
        folder: Path,
        *,
        settle_s: Callable[[str], float] = lambda _: SETTLE_S,
        is_new: Callable[[Path], bool] = lambda _: False,
    ) -> None:
        self.folder = folder
        self._settle_s = settle_s
        self.made = not folder.exists()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            there = [path for path in folder.iterdir() if not is_new(path)]
        except OSError as error:
            raise ReadError(
                f"cannot be watched: {error.strerror or error}", path=folder, expected="a folder"
            ) from error
        self._known: dict[str, tuple[int, int]] = {}
        for path in there:
            with contextlib.suppress(OSError):  # gone again, or a link to nothing
                self._known[path.name] = _version(path.stat())
        self._growing: dict[str, _Growing] = {}
        self._looked_s = -math.inf
        self._fault, self._away_since_s = "", math.inf

    @property
    def growing(self) -> frozenset[str]:
        """Names of the files that had not stopped growing at the last look."""
        return frozenset(self._growing)

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of these files at the last look, in bytes, by their names."""
        return {name: one.size for name, one in self._growing.items()}

    @property
    def away(self) -> str:
        """Reason why the folder could not be read at any look for `AWAY_S`; empty if it could."""
        return self._fault if self._looked_s - self._away_since_s >= AWAY_S else ""

    def poll(self, now_s: float | None = None, *, at_once: bool = False) -> tuple[DroppedFile, ...]:
        """Return the files that are complete since the last look; a call soon after it does not look again.

        Parameters
        ----------
        now_s
            Time by the host's monotonic clock, s; read if left out.
        at_once
            Whether to look even if the last look was just now.
        """
        now_s = time.monotonic() if now_s is None else now_s
        complete: list[DroppedFile] = []
        if not at_once and now_s - self._looked_s < LOOK_EVERY_S:
            return ()
        self._looked_s = now_s
        listed = self._listed()
        names = {path.name for path in listed}
        self._growing = {name: one for name, one in self._growing.items() if name in names or self._fault}
        for path in listed:
            try:
                stat = path.stat()
            except OSError:
                continue  # gone again, or renamed: seen under its new name next time
            if path.name.startswith((".", SHOT_LOG)) or not stat.st_size or not path.is_file():
                continue
            if self._known.get(path.name) == _version(stat):
                continue
            growing = self._growing.get(path.name)
            if growing is None or (growing.size, growing.changed_ns) != (stat.st_size, stat.st_mtime_ns):
                seen_s = now_s if growing is None else growing.seen_s
                written_s = _monotonic_s(stat.st_mtime_ns / 1e9)
                self._growing[path.name] = _Growing(seen_s, stat.st_size, stat.st_mtime_ns, now_s, written_s)
            elif now_s - growing.steady_since_s >= self._settle_s(path.name):
                self._known[path.name] = _version(stat)
                del self._growing[path.name]
                complete.append(DroppedFile(path, growing.seen_s, growing.written_s))
        return tuple(complete)

    def _listed(self) -> list[Path]:
        try:
            listed = sorted(self.folder.iterdir())
        except OSError as error:
            self._fault = error.strerror or str(error)
            self._away_since_s = min(self._away_since_s, self._looked_s)
            return []
        self._fault, self._away_since_s = "", math.inf
        return listed


def _monotonic_s(wall_s: float) -> float:
    """Return a time of the wall clock on the monotonic one, by readings of both that no halt of the machine parts."""
    tries = []
    for _ in range(_CLOCK_TRIES):
        before_s, now_s, after_s = time.monotonic(), time.time(), time.monotonic()
        tries.append((after_s - before_s, (before_s + after_s) / 2.0 - now_s))
    return min(tries)[1] + wall_s


def _version(stat: os.stat_result) -> tuple[int, int]:
    """Return what changes when a file does: its time of change, and, as some disks keep whole seconds, its size."""
    return stat.st_mtime_ns, stat.st_size
