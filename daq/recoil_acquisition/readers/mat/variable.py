"""Variables of a MATLAB file, whichever version wrote it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST_TEXT = 1024
"""Characters; a longer text is named and left out."""


@dataclass(frozen=True, eq=False)
class MatVariable:
    """A vector of real numbers.

    Attributes
    ----------
    dtype
        As stored in MATLAB's workspace.
    read
        Reads numbers from one index to before another, into an array of the caller's own, shape (stop - start,).
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
        Its descriptive text.
    vectors
        With two samples or more.
    scalars, texts
        Single numbers and rows of characters.
    left_out
        What is neither, with the reason.
    incomplete
        How it shows that the file was cut off.
    """

    version: str
    header: str
    vectors: tuple[MatVariable, ...]
    scalars: dict[str, float]
    texts: dict[str, str]
    left_out: tuple[str, ...]
    incomplete: str = ""
