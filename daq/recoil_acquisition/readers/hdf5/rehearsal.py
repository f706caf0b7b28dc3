"""A first reading of an HDF5 file in a process of its own: what ends the library there does not end this one."""

from __future__ import annotations

import contextlib
import functools
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import CorruptFileError, StoreError
from recoil_acquisition.readers.hdf5.kind import SIGNATURE

REHEARSAL = "rehearsal"
"""What the process that reads is asked for."""

_PIECE_BYTES = 4 << 20
_REFUSALS = (OSError, ValueError, TypeError, LookupError, AttributeError, RuntimeError, OverflowError)
"""What the library's binding raises where it refuses something; no memory is none of it."""


def needs_rehearsal(head: bytes) -> bool:
    """Return whether the HDF5 library would read a file of such first bytes: at once, or behind a MATLAB header."""
    return head.startswith(SIGNATURE) or head[512 : 512 + len(SIGNATURE)] == SIGNATURE


def rehearse_apart(path: Path) -> None:
    """Let the process that reads shot files read all of a file, once for each state of it.

    Raises
    ------
    CorruptFileError
        If that process ended over it, or had not done with it in time.
    """
    with contextlib.suppress(OSError):  # whoever opens it next says what is wrong
        stat = path.stat()
        _rehearsed(path.absolute(), stat.st_size, stat.st_mtime_ns)


@functools.lru_cache(maxsize=256)
def _rehearsed(path: Path, size: int, changed_ns: int) -> None:  # noqa: ARG001 - a file that changed is another one
    from recoil_acquisition.reader_process import READER

    try:
        _, fault = READER.ask(path, REHEARSAL, size)
    except StoreError as error:
        raise CorruptFileError(f"cannot be tried first: {error}", path=path) from error
    if fault:
        raise CorruptFileError(f"is damaged: {fault}", path=path, remedy="copy it again, or export it again")


def rehearse(path: Path) -> None:
    """Read everything that a file itself holds, piece by piece, and forget it.

    What the library refuses is no fault here: the reader meets it again and says so.

    Raises
    ------
    MemoryError
        If a piece takes more than this process may have.
    """
    import h5py

    def look(_: str, thing: Any) -> None:
        with contextlib.suppress(*_REFUSALS):
            dict(thing.attrs)
        if not isinstance(thing, h5py.Dataset) or thing.is_virtual or thing.external or not thing.size:
            return
        with contextlib.suppress(*_REFUSALS):
            if not thing.shape:
                thing[()]
                return
            rows = max(_PIECE_BYTES * thing.shape[0] // max(thing.size * thing.dtype.itemsize, 1), 1)
            for at in range(0, thing.shape[0], rows):
                thing[at : at + rows]

    with contextlib.suppress(*_REFUSALS), h5py.File(path, "r", locking=False) as file:
        file.visititems(look)
