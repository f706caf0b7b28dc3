"""Columns of one regression that have all passed one filter, and no way to have it otherwise.

A linear filter on one side of ``F = m a`` alone biases the mass by per cents; the same filter on both sides
does not bias it at all. So a regression does not take filtered columns, it takes a `Filtered`; and a
`Filtered` is made only from recorded columns, by `filter_alike`, which takes one filter for all of them::

    table = filter_alike(low_pass, {"acceleration": a, "breech": f1, "brake": f2}, rate_hz)
    mass = np.linalg.lstsq(..., table["acceleration"][table.trusted], ...)
    table = table.joined_by({"zero shift": step})      # one more column, by the same filter, over the same gaps

Neither its columns nor their samples can be replaced afterwards, by assignment, in place, or by
`dataclasses.replace`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NoReturn

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.filters.zero_phase_filter import FilterDescription, ZeroPhaseFilter


class Filtered(Mapping[str, Array]):
    """A table of columns and the one filter that they have all passed; made by `filter_alike` alone.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (n_samples,)
        Filtered columns, read-only, in the order in which they were given. The table itself is this mapping too.
    trusted : ndarray of bool, shape (n_samples,)
        Flags, true where no column depends on a missing sample of its own.
    rate_hz
        Samples per second.

    Raises
    ------
    TypeError
        If it is made by anything else, or changed.
    """

    __slots__ = ("columns", "rate_hz", "trusted", "zero_phase")

    columns: Mapping[str, Array]
    trusted: Flags
    zero_phase: ZeroPhaseFilter
    rate_hz: float

    def __new__(cls, *_: object, **__: object) -> Filtered:
        """Refuse to be made from columns that are filtered already."""
        raise TypeError("a Filtered is made from recorded columns, by filter_alike")

    def __init_subclass__(cls) -> NoReturn:
        """Refuse another type that could be made otherwise."""
        raise TypeError("Filtered has no subclasses: they could be made otherwise than by filter_alike")

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise TypeError(f"a Filtered cannot be changed: {name}")

    def __delattr__(self, name: str) -> NoReturn:
        raise TypeError(f"a Filtered cannot be changed: {name}")

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    # a table is itself alone: arrays cannot be compared to one truth value
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __copy__(self) -> Filtered:
        return self

    def __deepcopy__(self, _: object) -> Filtered:
        # nothing in it can change
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, (dict(self.columns), self.trusted, self.zero_phase, self.rate_hz)

    def __repr__(self) -> str:
        return f"Filtered({', '.join(self.columns)}; {self.zero_phase!r} at {self.rate_hz:g} samples/s)"

    def describe(self) -> FilterDescription:
        """Say what the columns have passed, at their sampling rate."""
        return self.zero_phase.describe(self.rate_hz)

    def joined_by(self, columns: Mapping[str, Array]) -> Filtered:
        """Return a table with more columns, which pass the same filter first.

        Parameters
        ----------
        columns : mapping of str to ndarray, shape (n_samples,)
            Columns as recorded; missing samples are NaN.

        Returns
        -------
        Filtered
            Table with the columns of both, trusted where both are.

        Raises
        ------
        ValueError
            If a name is there already, or as in `filter_alike`.
        """
        twice = sorted(set(columns) & set(self.columns))
        if twice:
            raise ValueError(f"columns of that name are there already: {', '.join(twice)}")
        more = filter_alike(self.zero_phase, columns, self.rate_hz)
        if more.trusted.shape != self.trusted.shape:
            raise ValueError(f"columns have {more.trusted.size} samples, the table has {self.trusted.size}")
        return _made({**self.columns, **more.columns}, self.trusted & more.trusted, self.zero_phase, self.rate_hz)


def filter_alike(zero_phase: ZeroPhaseFilter, columns: Mapping[str, Array], rate_hz: float) -> Filtered:
    """Pass every column of a regression through one and the same filter.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (n_samples,)
        Columns as recorded, at the same instants; missing samples are NaN. None is changed.
    rate_hz
        Samples per second, of all of them.

    Raises
    ------
    ValueError
        If there are no columns, they are not of one length, or the filter refuses one, whose name is in the message.
    """
    if not columns:
        raise ValueError("there are no columns to filter")
    shapes = {name: np.shape(column) for name, column in columns.items()}
    first = next(iter(shapes.values()))
    odd = [f"{name} {shape}" for name, shape in shapes.items() if len(shape) != 1 or shape != first]
    if odd:
        raise ValueError(f"columns must each have the shape (n_samples,) of the first, {first}, not {', '.join(odd)}")
    filtered: dict[str, Array] = {}
    trusted = np.ones(first, dtype=bool)
    for name, column in columns.items():
        try:
            filtered[name], sound = zero_phase.apply_with_gaps(np.asarray(column, dtype=np.float64), rate_hz)
        except ValueError as error:
            raise ValueError(f"column {name}: {error}") from error
        trusted &= sound
    return _made(filtered, trusted, zero_phase, rate_hz)


def _made(columns: Mapping[str, Array], trusted: Flags, zero_phase: ZeroPhaseFilter, rate_hz: float) -> Filtered:
    for array in (*columns.values(), trusted):
        array.flags.writeable = False
    table: Filtered = object.__new__(Filtered)
    for name, value in (
        ("columns", MappingProxyType(dict(columns))),
        ("trusted", trusted),
        ("zero_phase", zero_phase),
        ("rate_hz", float(rate_hz)),
    ):
        object.__setattr__(table, name, value)
    return table
