"""Numbers in a temporary file, written and read anywhere in it by several threads."""

from __future__ import annotations

import tempfile
import threading
import weakref
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError


class NumberFile:
    """A temporary file of float64 that vanishes with this object.

    Parameters
    ----------
    path
        The file whose numbers are kept, for messages.

    Raises
    ------
    ReadError
        If there is no room for it.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        try:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed when this object goes
        except OSError as error:
            raise self._full(error) from error
        weakref.finalize(self, self._file.close)

    def write(self, start: int, numbers: NDArray[np.float64]) -> None:
        """Write numbers, C-contiguous, from the one at ``start`` on.

        Raises
        ------
        ReadError
            If there is no room for them.
        """
        left = numbers.data.cast("B") if numbers.size else memoryview(b"")
        try:
            with self._lock:
                self._file.seek(8 * start)
                while left:
                    left = left[self._file.write(left) :]
        except OSError as error:
            raise self._full(error) from error

    def read(self, start: int, numbers: NDArray[np.float64]) -> None:
        """Fill an array, C-contiguous, with the numbers from the one at ``start`` on.

        Raises
        ------
        ReadError
            If they cannot be read back.
        """
        left = numbers.data.cast("B") if numbers.size else memoryview(b"")
        try:
            with self._lock:
                self._file.seek(8 * start)
                while left:
                    count = self._file.readinto(left)
                    if not count:
                        raise OSError(0, "it became shorter")
                    left = left[count:]
        except OSError as error:
            raise self._full(error) from error

    def _full(self, error: OSError) -> ReadError:
        return ReadError(
            f"its numbers cannot be kept in a temporary file: {error.strerror}", path=self._path,
            remedy="make room in the folder of temporary files, or name another in TMPDIR",
        )  # fmt: skip
