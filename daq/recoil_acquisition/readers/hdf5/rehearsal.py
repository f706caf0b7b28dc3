"""A first reading of an HDF5 file in a process of its own: what ends the library there does not end this one."""

from __future__ import annotations

import contextlib
import functools
import math
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import CorruptFileError, StoreError
from recoil_acquisition.readers.bounded_file import DEFLATE_RATIO, most_unpacked
from recoil_acquisition.readers.hdf5.kind import SIGNATURE

REHEARSAL = "rehearsal"
"""Name of this task for the process that reads."""

_PIECE_BYTES = 4 << 20
_REFUSALS = (OSError, ValueError, TypeError, LookupError, AttributeError, RuntimeError, OverflowError)
"""Exceptions of the library's binding where it refuses something; no memory is none of them."""


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
    from recoil_acquisition.processes.reader_process import READER

    try:
        _, fault = READER.ask(path, REHEARSAL, size)
    except StoreError as error:
        raise CorruptFileError(f"cannot be tried first: {error}", path=path) from error
    if fault:
        raise CorruptFileError(f"is damaged: {fault}", path=path, remedy="copy it again, or export it again")


def rehearse(path: Path) -> None:
    """Read everything that a file itself holds and a reader may read, piece by piece, and forget it.

    What the library refuses is no fault here: the reader meets it again and says so. What the readers refuse by its
    size alone, and never read, is not read here either.

    Raises
    ------
    MemoryError
        If a piece takes more than this process may have.
    """
    import h5py

    from recoil_acquisition.readers.hdf5.walk import objects_of

    left = 2 * most_unpacked(path.stat().st_size)
    with contextlib.suppress(*_REFUSALS), h5py.File(path, "r", locking=False) as file:
        for _, thing in objects_of(file):
            with contextlib.suppress(*_REFUSALS):
                _read_attributes(thing)
            if isinstance(thing, h5py.Dataset):
                with contextlib.suppress(*_REFUSALS):
                    left -= _read_samples(thing, left)


def _read_attributes(thing: Any) -> None:
    from recoil_acquisition.readers.hdf5.walk import LARGEST_ATTRIBUTE

    for name in thing.attrs:
        if thing.attrs.get_id(name).get_storage_size() <= LARGEST_ATTRIBUTE:
            with contextlib.suppress(*_REFUSALS):
                thing.attrs[name]


def _read_samples(thing: Any, most: int) -> int:
    """Read a dataset of at most so many bytes that the file has room for; return how many there were."""
    if thing.is_virtual or thing.external or not thing.size:
        return 0
    size, stored = thing.size * max(thing.dtype.itemsize, 1), thing.id.get_storage_size()
    chunk = math.prod(thing.chunks or ()) * thing.dtype.itemsize
    if max(size, chunk) > min(most, DEFLATE_RATIO * stored):
        return 0
    if not thing.shape:
        thing[()]
        return int(size)
    rows = max(_PIECE_BYTES * thing.shape[0] // size, 1)
    for at in range(0, thing.shape[0], rows):
        with contextlib.suppress(*_REFUSALS):
            thing[at : at + rows]
    return int(size)
