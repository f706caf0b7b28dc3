"""Variables of a MATLAB file, whichever version wrote it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST_TEXT = 1024
"""Characters of a text at most; a longer one is named and left out."""


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
    """

    name: str
    count: int
    dtype: np.dtype[Any]
    read: Callable[[int, int], NDArray[Any]]


@dataclass(frozen=True, eq=False)
class MatContents:
    """Contents of a file.

    Attributes
    ----------
    header
        Descriptive text of the file.
    vectors
        Vectors of two samples or more.
    scalars, texts
        Single numbers and rows of characters.
    left_out
        Reasons why variables are none of these, by their names.
    incomplete
        Sign by which it shows that the file was cut off; empty if nothing shows that.
    """

    version: str
    header: str
    vectors: tuple[MatVariable, ...]
    scalars: dict[str, float]
    texts: dict[str, str]
    left_out: Mapping[str, str]
    incomplete: str = ""
