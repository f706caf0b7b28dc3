"""NumPy's arrays (``.npy``): a matrix of times and channels, or records with names.

An array has neither units nor, unless it holds records, names: its columns are ``column_1`` and so on, as those of
MATLAB's matrices, and the one that rises is the time. A field is the time by its name, ``t`` or ``time_ms`` say.
Arrays of objects, which NumPy would have to run code for, are refused.

Layout: NumPy Enhancement Proposal 1: six bytes, version, length and text of a head of three keys, the numbers.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, FileEnd, ReadError
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.containers.stored_time import (
    MOST_COLUMNS,
    rising_column,
    selected,
    time_from_vector,
)
from recoil_acquisition.readers.containers.time_axis import unit_in_time_name
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.time.time_units import time_unit_s
from recoil_acquisition.remark import Note, NoteCode, Remark

_HEAD_BYTES = 10_000
"""Longest head that is read: that of records has their names."""
_REMEDY = "save one array of a column of times and one column for each channel"
NO_UNITS = "arrays have no units: the rig must state them"


class NpyReader:
    """Reader of NumPy's arrays."""

    name = "NumPy array"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open an array; columns are read one at a time to find the time, and no samples kept.

        Raises
        ------
        ReadError
            If it has no time, or holds what is no number.
        CorruptFileError
            If it is damaged.
        """
        with map_to_corrupt_file(path, "a whole NumPy array"):
            array, incomplete = _array_of(path)
            return _recording(path, array, incomplete, declared.clock)


@dataclass(frozen=True)
class _Array:
    """Place and shape of an array's numbers: its rows, and the columns or fields in each."""

    path: Path
    dtype: np.dtype[Any]
    at: int
    rows: int
    columns: int
    is_by_column: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.dtype.names or tuple(f"column_{k + 1}" for k in range(self.columns))

    def read(self, column: int, start: int, stop: int) -> NDArray[Any]:
        """Read some rows of one column, shape (stop - start,)."""
        shape = (self.rows,) if self.dtype.names else (self.rows, self.columns)
        mapped = np.memmap(self.path, self.dtype, "r", self.at, shape, "F" if self.is_by_column else "C")
        part = mapped[start:stop]
        return np.array(part[self.dtype.names[column]] if self.dtype.names else part[:, column])


def _array_of(path: Path) -> tuple[_Array, str]:
    """Read the head of an array; return also the sign by which it shows that it was cut off."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = io.BytesIO(file.read(_HEAD_BYTES + 12))
    version = np.lib.format.read_magic(head)
    read: Callable[..., Any] = {
        (1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0
    }[version]  # fmt: skip
    shape, is_by_column, dtype = read(head, max_header_size=_HEAD_BYTES)
    kinds = [dtype[name] for name in dtype.names] if dtype.names else [dtype]
    if dtype.hasobject or any(kind.kind not in "fiub" or kind.itemsize > 8 for kind in kinds):
        raise ReadError("the array holds what is no number", path=path, found=str(dtype)[:200], remedy=_REMEDY)
    long = [length for length in shape if length != 1]
    if len(long) != (1 if dtype.names else 2) or 0 in long or (not dtype.names and not 1 < long[1] <= MOST_COLUMNS):
        raise ReadError(
            "this array is no table of times and channels", path=path, expected=f"rows of 2 to {MOST_COLUMNS} columns",
            found=f"shape {shape}", remedy=_REMEDY,
        )  # fmt: skip
    columns = len(dtype.names) if dtype.names else long[1]
    row_bytes = dtype.itemsize * (1 if dtype.names else columns)
    there = (size - head.tell()) // row_bytes
    if there < 1 or (there < long[0] and is_by_column):
        raise CorruptFileError(
            "the array ends early", path=path, expected=f"{long[0] * row_bytes} bytes of numbers",
            found=f"{size - head.tell()}", remedy="copy it again",
        )  # fmt: skip
    incomplete = "" if there >= long[0] else f"the array ends at row {there} of {long[0]}: these were read"
    return _Array(path, dtype, head.tell(), min(there, long[0]), columns, is_by_column), incomplete


def _recording(path: Path, array: _Array, incomplete: str, clock: str) -> Recording:
    notes: list[Remark] = [Note(NoteCode.CUT, None, incomplete)] if incomplete else []
    notes.append(Note(NoteCode.UNITS, None, NO_UNITS))
    whole = {name: partial(array.read, k, 0, array.rows) for k, name in enumerate(array.names)}
    named = [name for name in array.names if unit_in_time_name(name) is not None]
    found, reason = (named[0], "") if len(named) == 1 else rising_column(whole)
    # in the rows behind a cut the time may be the only column that rises
    end = FileEnd.MISSING if incomplete else FileEnd.THERE
    if found is None:
        raise ReadError("no time in this array", path=path, found=reason, remedy=_REMEDY, file_end=end)
    unit = unit_in_time_name(found) or ""
    if not unit:
        notes.append(Note(NoteCode.TIME, found, f"{found}: states no unit: read as seconds"))
    time = time_from_vector(clock, whole[found](), (time_unit_s(unit) if unit else None) or 1.0, found, notes)
    if isinstance(time, str):
        raise ReadError("no time in this array", path=path, found=time, remedy=_REMEDY, file_end=end)
    channels = []
    for k, name in enumerate(array.names):
        if name == found:
            continue
        stored = partial(selected, time.kept, partial(array.read, k))
        kind = array.dtype[name] if array.dtype.names else array.dtype
        is_counted = kind.kind in "iu"
        header = SignalHeader(name, "", time.time_base.count, metadata={"time": found})
        channels.append(
            StoredChannel(
                header, time.time_base, partial(_samples, stored), partial(_raw, stored) if is_counted else None,
                beside=Statements({}, (), is_counted),
            )
        )  # fmt: skip
    metadata = {"dtype": str(array.dtype)[:200], "rows": array.rows}
    return container_recording(path, NpyReader.name, channels, metadata, notes, incomplete, remedy=_REMEDY)


def _samples(stored: Callable[[int, int], NDArray[Any]], start: int, stop: int) -> NDArray[np.float64]:
    return stored(start, stop).astype(np.float64)


def _raw(stored: Callable[[int, int], NDArray[Any]], start: int, stop: int) -> RawCounts:
    return RawCounts(stored(start, stop), 1.0, 0.0, "")
