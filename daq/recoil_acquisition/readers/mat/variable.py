"""Variables of a MATLAB file, whichever version wrote it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.containers.stored_time import MOST_COLUMNS

LONGEST_TEXT = 1024
"""Characters of a text at most; a longer one is named and left out."""
MOST_VARIABLES = 5000
STRUCTURE = "a structure: save its fields as vectors, `save('x.mat', '-struct', '{name}')`"
CELL = "a cell: save its parts as vectors of their own"


def array_reason(shape: Sequence[int]) -> str:
    """Say of an array that is no vector what to save instead."""
    if 0 in shape:
        return "empty"
    return f"an array of shape {'x'.join(map(str, shape))}: save each of its columns as a vector of its own"


@dataclass(frozen=True, eq=False)
class MatVariable:
    """A vector of real numbers.

    Attributes
    ----------
    dtype
        Type of the numbers in MATLAB's workspace.
    read
        Function that reads numbers from one index to before another, into an array of the caller's own, shape (stop -
        start,).
    is_column
        Whether it is a column of a matrix, which its name begins with as that of a field with its structure's.
    """

    name: str
    count: int
    dtype: np.dtype[Any]
    read: Callable[[int, int], NDArray[Any]]
    is_column: bool = False

    @property
    def groups(self) -> list[str]:
        """Names of what it is in, the nearest first; the last one, empty, is the file."""
        parts = self.name.split(".")[:-1]
        return [".".join(parts[:n]) for n in range(len(parts), -1, -1)]

    @property
    def own_name(self) -> str:
        """Its name within what it is in."""
        return self.name.rpartition(".")[2]


@dataclass(frozen=True, eq=False)
class MatContents:
    """Contents of a file, which grow as its variables are looked at.

    Attributes
    ----------
    header
        Descriptive text of the file.
    vectors
        Vectors of two samples or more, and the columns of matrices.
    scalars, texts
        Single numbers and rows of characters.
    left_out
        Reasons why variables are none of these, by their names.
    incomplete
        Sign by which it shows that the file was cut off; empty if nothing shows that.
    """

    version: str
    header: str
    vectors: list[MatVariable] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    incomplete: str = ""

    def take_numbers(
        self, name: str, shape: Sequence[int], dtype: np.dtype[Any], read: Callable[[int, int], NDArray[Any]]
    ) -> None:
        """Take an array of real numbers: one number, a vector, or each column of a matrix that has more rows.

        Parameters
        ----------
        read
            Function that reads numbers of the whole array, which is stored column by column.
        """
        long = [n for n in shape if n != 1]
        if not long:
            self.scalars[name] = float(read(0, 1)[0])
        elif len(long) == 1 and long[0]:
            self.vectors.append(MatVariable(name, long[0], dtype, read))
        elif len(long) == 2 and 0 < long[1] < long[0] and long[1] <= MOST_COLUMNS:
            for k in range(long[1]):
                column = partial(_column, read, k * long[0])
                self.vectors.append(MatVariable(f"{name}.column_{k + 1}", long[0], dtype, column, True))
        else:
            self.left_out[name] = array_reason(shape)


def _column(read: Callable[[int, int], NDArray[Any]], first: int, start: int, stop: int) -> NDArray[Any]:
    return read(first + start, first + stop)
