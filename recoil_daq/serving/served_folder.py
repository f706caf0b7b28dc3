"""The folder that is served: which of its files a path of a request names, if it names one that may be read."""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote, unquote_to_bytes

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import open_regular

TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8",
    ".json": "application/json", ".csv": "text/plain; charset=utf-8", ".svg": "image/svg+xml", ".png": "image/png",
    ".pdf": "application/pdf",
}  # fmt: skip
"""Ending of a file that is served -> its type. Recordings, shot files and journals are not among them."""
NEWEST = ("live.html", "day.html")
"""Pages of which the one that was written last is shown where none is named: a session's, or its day's."""
ELSE = ("index.html", "campaign.html", "campaign/campaign.html")
"""Pages of which the first that is there is shown where there is none of these."""
LONGEST_PATH = 1_024
_MOST_PARTS = 8
_PART = re.compile(r"[^\x00-\x1f\x7f/\\:*?\"<>|.][^\x00-\x1f\x7f/\\:*?\"<>|]*", re.DOTALL)
"""Name of a file or a folder: not hidden, and of no sign that a system reads as more than a name."""


@dataclass(frozen=True)
class ServedFile:
    """File that may be read.

    Attributes
    ----------
    tag
        Text that differs where the file was changed.
    """

    file: BinaryIO
    size: int
    type: str
    tag: str


class ServedFolder:
    """Folder of which the pages, and what they refer to, may be read.

    Parameters
    ----------
    folder
        Folder; what a link in it leads to is not of it.
    """

    def __init__(self, folder: Path) -> None:
        self.root = Path(os.path.realpath(folder))

    def home(self) -> str | None:
        """Return the path of the page that is shown where none is named; None if there is none of these."""
        written = [(self.root / name, name) for name in (*NEWEST, *ELSE) if (self.root / name).is_file()]
        newest = [(path.stat().st_mtime_ns, name) for path, name in written if name in NEWEST]
        return max(newest)[1] if newest else next((name for _, name in written), None)

    def reports(self) -> list[str]:
        """Return the paths of the pages below the folder, of two folders' depth."""
        found = (path for depth in ("*.html", "*/*.html", "*/*/*.html") for path in self.root.glob(depth))
        paths = (path.relative_to(self.root).as_posix() for path in found if path.is_file() and self._is_plain(path))
        return sorted(path for path in paths if self._path(f"/{quote(os.fsencode(path))}".encode()) is not None)

    def open(self, raw: bytes) -> ServedFile | None:
        """Open what a path names; None if that is no file of the folder that may be read.

        Parameters
        ----------
        raw
            Path as the request has it, without what is asked behind it.
        """
        path = self._path(raw)
        if path is None or not self._is_plain(path):
            return None
        try:
            file = open_regular(path)
        except ReadError:
            return None
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            file.close()
            return None
        tag = f'"{status.st_mtime_ns:x}-{status.st_size:x}"'
        return ServedFile(file, status.st_size, TYPES[path.suffix.lower()], tag)

    def _path(self, raw: bytes) -> Path | None:
        """Return the path in the folder; None of one that is anything but names of files, each decoded once."""
        try:
            text = unquote_to_bytes(raw).decode("utf-8")
        except UnicodeDecodeError:
            return None
        first, *parts = text.split("/")
        whole = all(_PART.fullmatch(part) and part == part.rstrip(" .") and len(part) <= 255 for part in parts)
        if first or not parts or len(parts) > _MOST_PARTS or not whole or Path(parts[-1]).suffix.lower() not in TYPES:
            return None
        return self.root.joinpath(*parts)

    def _is_plain(self, path: Path) -> bool:
        """Return whether no part of a path is a link: it is where it says that it is."""
        try:
            return os.path.realpath(path) == str(path)
        except (OSError, ValueError):
            return False
