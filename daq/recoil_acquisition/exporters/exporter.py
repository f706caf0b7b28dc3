"""Interface of every exporter.

An exporter says what of a shot its format can carry, writes it, and reads back what it wrote. The comparison of
the two, and the names of the files, are the business of `recoil_acquisition.exporters.publication` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.exporters.content import Content, TimeBaseGroup
from recoil_acquisition.numerics.read_only import ReadOnlyArrays


@dataclass(frozen=True, eq=False)
class ExportedTable(ReadOnlyArrays):
    """The numbers of one time base as a format carries them, or as they were read back.

    Attributes
    ----------
    name
        Name of the group.
    times_s : ndarray of float64, shape (n_samples,)
    samples : mapping of str to ndarray, shape (n_samples,)
        Samples by the channels' names in the shot, in the type in which the format holds them.
    """

    name: str
    times_s: NDArray[np.float64]
    samples: Mapping[str, NDArray[np.floating[Any]]]


@dataclass(frozen=True, eq=False)
class Representation:
    """The part of some content that a format can represent.

    Attributes
    ----------
    tables
        Tables that must be read back, bit for bit.
    losses
        Differences from the shot, one line each; empty if all is exact.
    left_out
        Channels that the format cannot carry at all; each has its line in `losses`.
    """

    tables: tuple[ExportedTable, ...]
    losses: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


class Exporter(Protocol):
    """One format."""

    @property
    def name(self) -> str:
        """Name of the format on the command line."""

    @property
    def suffix(self) -> str:
        """Ending of its files."""

    @property
    def extra(self) -> str:
        """Name of the extra that it needs; empty if none."""

    @property
    def single_file(self) -> bool:
        """Whether one file takes all time bases; else each has its own."""

    def carried(self, content: Content) -> Representation:
        """Say what the format carries of the content."""

    def write(self, content: Content, path: Path) -> None:
        """Write a new file. Exceptions of libraries are mapped by the caller."""

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read from the file what `carried` says must be in it."""


def exact_table(
    group: TimeBaseGroup, convert: Callable[[NDArray[Any]], NDArray[Any]] = lambda samples: samples
) -> ExportedTable:
    """Return a group's numbers as the shot has them, or each channel's samples converted."""
    return ExportedTable(group.name, group.time_base.times_s, {c.name: convert(c.samples) for c in group.channels})


def free_name(name: str, taken: Mapping[str, Any] | list[str]) -> str:
    """Return a name, with underscores behind it until no channel bears it."""
    while name in taken:
        name += "_"
    return name


def first_difference(
    one: Sequence[ExportedTable], other: Sequence[ExportedTable], *, values_only: bool = False
) -> str | None:
    """Name the first place where two sets of numbers differ bit for bit; None if there is none.

    Parameters
    ----------
    values_only
        Whether float32 and float64 of the same value are the same.
    """
    if [table.name for table in one] != [table.name for table in other]:
        return "time bases"
    for a, b in zip(one, other, strict=True):
        if not _same(a.times_s, b.times_s, values_only):
            return f"times of {a.name}"
        if list(a.samples) != list(b.samples):
            return f"names of the channels of {a.name}"
        for name, samples in a.samples.items():
            if not _same(samples, b.samples[name], values_only):
                return f"samples of {name!r}"
    return None


def _same(one: NDArray[Any], other: NDArray[Any], values_only: bool) -> bool:
    """Compare arrays: every NaN is one and the same lost sample, and 0.0 is not -0.0."""
    if one.shape != other.shape or (one.dtype != other.dtype and not values_only):
        return False
    signs = (np.signbit(one) == np.signbit(other)) | np.isnan(one)
    return bool(np.array_equal(one, other, equal_nan=True) and signs.all())
