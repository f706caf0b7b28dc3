"""A file that never gives, nor makes room for, more than it has."""

from __future__ import annotations

import io
from pathlib import Path


class BoundedFile(io.BufferedReader):
    """A file opened to be read by a library that trusts the lengths in it.

    Python makes room for as many bytes as are asked for before it reads; a damaged length of 64 bits would
    take all memory.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self.length = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to `size` bytes, all that are left if it is negative or None."""
        left = max(0, self.length - self.tell())
        return super().read(left if size is None or size < 0 else min(size, left))
