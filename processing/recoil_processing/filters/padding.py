"""Continuation of a record beyond its ends, so that a filter has something to start from."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PaddingKind = Literal["odd", "even", "constant"]

PADDING_KINDS: tuple[PaddingKind, ...] = ("odd", "even", "constant")
"""Reflected about the end point, which keeps value and slope; mirrored, which keeps the value; held."""


def check_padding(kind: str) -> None:
    """Refuse a kind of padding that is none of `PADDING_KINDS`.

    Raises
    ------
    ValueError
        If it is none of them.
    """
    if kind not in PADDING_KINDS:
        raise ValueError(f"padding must be one of {', '.join(PADDING_KINDS)}, not {kind!r}")


def before(samples: Array, length: int, kind: PaddingKind) -> Array:
    """Continue a record backward from its first sample.

    Parameters
    ----------
    samples : ndarray, shape (n, ...)
        The record's beginning, more than `length` samples of it where the padding reflects.
    kind : {"odd", "even", "constant"}

    Returns
    -------
    ndarray, shape (length, ...)
        In the order of time, a new array.

    Raises
    ------
    ValueError
        If the record is too short to be reflected so far.
    """
    if kind == "constant":
        return np.repeat(samples[:1], length, axis=0)
    if length >= samples.shape[0]:
        raise ValueError(f"{samples.shape[0]} samples can be reflected over fewer, not over {length}")
    mirrored = samples[length:0:-1]
    return 2.0 * samples[:1] - mirrored if kind == "odd" else mirrored.copy()


def after(samples: Array, length: int, kind: PaddingKind) -> Array:
    """Continue a record forward from its last sample, as `before` does backward from its first."""
    return before(samples[::-1], length, kind)[::-1]
