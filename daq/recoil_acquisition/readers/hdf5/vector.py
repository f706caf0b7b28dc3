"""One-dimensional numbers in an HDF5 file, found without reading them.

Sizes that a file states are held against the space that it takes in the file before anything is
read: deflate cannot shrink bytes by more than 1032 times (RFC 1951: a match of 258 bytes in 2 bits).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil, prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.bounded_file import DEFLATE_RATIO, most_unpacked
from recoil_acquisition.readers.recording import map_to_corrupt_file


@contextmanager
def hdf5_file(path: Path) -> Iterator[Any]:
    """Open a file to read.

    Raises
    ------
    CorruptFileError
        If it is damaged; also where the damage shows only within the block.
    """
    import h5py

    # Locking fails on read-only file systems and shares, and nothing is written here
    with map_to_corrupt_file(path, "a whole HDF5 file"), h5py.File(path, "r", locking=False) as file:
        yield file


@dataclass(frozen=True)
class Hdf5Vector:
    """A dataset of numbers along one axis.

    Attributes
    ----------
    name
        Its full name in the file.
    axis
        The axis that has more than one entry; the others have one.
    """

    path: Path
    name: str
    axis: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.shape[self.axis]

    def stored(self, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read samples as stored, shape (stop - start,).

        Raises
        ------
        CorruptFileError
            If the file is damaged.
        """
        part = tuple(slice(start, stop) if i == self.axis else 0 for i in range(len(self.shape)))
        with hdf5_file(self.path) as file:
            return np.atleast_1d(np.asarray(file[self.name][part]))


class Room:
    """Room that all datasets of a file together may take: stored, the bytes of the file; unpacked, so many times them.

    Parameters
    ----------
    path
        For messages.
    size
        Bytes of the file.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.size = size
        self._stored = self._unpacked = 0

    def take(self, vector: Hdf5Vector, stored: int) -> None:
        """Count one dataset.

        Raises
        ------
        ReadError
            If they unpack to more than a recording does.
        CorruptFileError
            If they take more than the file has.
        """
        self._stored += stored
        self._unpacked += prod(vector.shape) * vector.dtype.itemsize
        if self._stored > self.size:
            raise CorruptFileError(
                "datasets share their bytes", path=self.path, place=vector.name,
                expected=f"at most {self.size} bytes in all", found=f"{self._stored}", remedy="export it again",
            )  # fmt: skip
        if self._unpacked > most_unpacked(self.size):
            raise ReadError(
                f"the file unpacks to more than {most_unpacked(self.size) / 1e6:.0f} MB", path=self.path,
                place=vector.name, remedy="export fewer channels, or without compression, if this is right",
            )  # fmt: skip


def vector_of(path: Path, dataset: Any, file_size: int) -> Hdf5Vector | str:
    """Describe a dataset, or say why it is no channel.

    Parameters
    ----------
    file_size
        Bytes of the file.
    """
    dtype, shape = dataset.dtype, dataset.shape
    if dtype.kind not in "fiub" or shape is None or dtype.itemsize > 8:
        return f"not real numbers ({'no data' if shape is None else dtype})"
    if dataset.is_virtual or dataset.external:
        return "its samples are in another file"
    long = [i for i, length in enumerate(shape) if length > 1]
    if not shape or len(long) > 1:
        return f"not one-dimensional (shape {shape})"
    if prod(shape) == 0:
        return "no samples"
    stored, needed = dataset.id.get_storage_size(), prod(shape) * dtype.itemsize
    if stored == 0:
        return "never written"
    if stored > file_size or needed > DEFLATE_RATIO * stored:
        return f"damaged: {needed} bytes stated, {stored} stored in a file of {file_size}"
    if dataset.chunks is not None:
        if prod(dataset.chunks) * dtype.itemsize > DEFLATE_RATIO * file_size:
            return f"damaged: chunks of shape {dataset.chunks}"
        expected = prod(ceil(n / c) for n, c in zip(shape, dataset.chunks, strict=True))
        if dataset.id.get_num_chunks() != expected:
            return f"{dataset.id.get_num_chunks()} of {expected} blocks were written"
    return Hdf5Vector(path, dataset.name, long[0] if long else 0, tuple(shape), dtype)
