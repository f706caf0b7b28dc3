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
from recoil_acquisition.readers.containers.stored_channels import Damaged
from recoil_acquisition.readers.containers.stored_time import MOST_COLUMNS
from recoil_acquisition.readers.recording import map_to_corrupt_file
from recoil_acquisition.readers.statements import MOST_SHOWN


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
        Full name in the file; of a field of records, that of the field behind that of its dataset.
    field
        Name of the field of records, or of the column of a matrix; empty where the samples are neither.
    column
        Axis of a matrix's columns, and the number of this one; None where it is none.
    axis
        Axis that has more than one entry; the others have one.
    """

    path: Path
    name: str
    axis: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    field: str = ""
    column: tuple[int, int] | None = None

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
        across, own = self.column or (-1, 0)
        part = tuple(
            slice(start, stop) if i == self.axis else own if i == across else 0 for i in range(len(self.shape))
        )
        with hdf5_file(self.path) as file:
            if not self.field:
                return np.atleast_1d(np.asarray(file[self.name][part]))
            records = file[self.name.removesuffix(f"/{self.field}")]
            if self.column is not None:
                return np.atleast_1d(np.asarray(records[part]))
            return np.atleast_1d(np.asarray(records.fields(self.field)[part]))


class Room:
    """Room that all datasets of a file together may take: stored, the bytes of the file; unpacked, so many times them.

    Parameters
    ----------
    path
        File, for messages.
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
    dtype = dataset.dtype
    if not is_real(dtype) or dataset.shape is None:
        return "not real numbers (no data)" if dataset.shape is None else _no_numbers(dtype)
    found = _axis_of(dataset, file_size)
    return found if isinstance(found, str) else Hdf5Vector(path, dataset.name, found, tuple(dataset.shape), dtype)


def column_vectors(path: Path, dataset: Any, file_size: int) -> list[Hdf5Vector]:
    """Describe the columns of a matrix that has more rows; none where it is no matrix that can be read.

    Parameters
    ----------
    file_size
        Bytes of the file.
    """
    shape, dtype = dataset.shape, dataset.dtype
    long = [] if shape is None else [i for i, length in enumerate(shape) if length > 1]
    if len(long) != 2 or not is_real(dtype) or _readable(dataset, file_size):
        return []
    rows, across = sorted(long, key=lambda i: -shape[i])
    if shape[across] == shape[rows] or shape[across] > MOST_COLUMNS:
        return []
    names = [f"column_{k + 1}" for k in range(shape[across])]
    return [
        Hdf5Vector(path, f"{dataset.name}/{name}", rows, tuple(shape), dtype, name, (across, k))
        for k, name in enumerate(names)
    ]


def record_vectors(path: Path, dataset: Any, file_size: int) -> list[Hdf5Vector | tuple[str, str]] | str:
    """Describe the fields of a dataset of records, or say why it has none; of a field that is no channel name and why.

    Parameters
    ----------
    file_size
        Bytes of the file.
    """
    found = _axis_of(dataset, file_size)
    if isinstance(found, str):
        return found
    shape = tuple(dataset.shape)
    vectors: list[Hdf5Vector | tuple[str, str]] = []
    for field in dataset.dtype.names:
        dtype, name = dataset.dtype[field], f"{dataset.name}/{field}"
        if is_real(dtype) and "/" not in field:
            vectors.append(Hdf5Vector(path, name, found, shape, dtype, field))
        else:
            vectors.append((name, _no_numbers(dtype)))
    return vectors


def is_real(dtype: np.dtype[Any]) -> bool:
    """Return whether numbers of a type are real ones of at most 64 bits, and do not stand for words."""
    return dtype.kind in "fiub" and dtype.itemsize <= 8 and not _words(dtype)


def _words(dtype: np.dtype[Any]) -> dict[str, int]:
    """Return the words of an enumeration, as h5py keeps them; empty of another type."""
    return dict((dtype.metadata or {"enum": {}}).get("enum", {}))


def _no_numbers(dtype: np.dtype[Any]) -> str:
    """Say what a type that `is_real` refuses holds instead."""
    words = ", ".join(map(repr, [*_words(dtype)][:MOST_SHOWN]))
    return f"an enumeration ({words})" if words else f"not real numbers ({dtype})"


def _axis_of(dataset: Any, file_size: int) -> int | str:
    """Return the one axis along which a dataset has more than one entry, or why its samples cannot be read."""
    shape = dataset.shape
    if shape is None:
        return "no data"
    long = [i for i, length in enumerate(shape) if length > 1]
    if not (dataset.is_virtual or dataset.external) and (not shape or len(long) > 1):
        return f"not one-dimensional (shape {shape})"
    return _readable(dataset, file_size) or (long[0] if long else 0)


def _readable(dataset: Any, file_size: int) -> str:
    """Say why the samples of a dataset cannot be read; empty if they can."""
    dtype, shape = dataset.dtype, dataset.shape
    if dataset.is_virtual or dataset.external:
        return "its samples are in another file"
    if prod(shape) == 0:
        return "no samples"
    stored, needed = dataset.id.get_storage_size(), prod(shape) * dtype.itemsize
    if stored == 0:
        return "never written"
    if stored > file_size or needed > DEFLATE_RATIO * stored:
        return Damaged(f"damaged: {needed} bytes stated, {stored} stored in a file of {file_size}")
    if dataset.chunks is not None:
        if prod(dataset.chunks) * dtype.itemsize > DEFLATE_RATIO * file_size:
            return f"damaged: chunks of shape {dataset.chunks}"
        expected = prod(ceil(n / c) for n, c in zip(shape, dataset.chunks, strict=True))
        if dataset.id.get_num_chunks() != expected:
            return f"{dataset.id.get_num_chunks()} of {expected} blocks were written"
    return _missing_filter(dataset)


def _missing_filter(dataset: Any) -> str:
    """Say by which filter samples are packed that is not at hand; empty if all are."""
    from h5py import h5z

    properties = dataset.id.get_create_plist()
    for index in range(properties.get_nfilters()):
        code, _, _, name = properties.get_filter(index)
        if not h5z.filter_avail(code):
            said = name.decode("latin-1") or f"number {code}"
            return f"packed by the filter {said}, which is not at hand: export it with gzip, or without compression"
    return ""
