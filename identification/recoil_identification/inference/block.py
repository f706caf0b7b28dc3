"""Rows of a record that a model explains by unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.correlation import Correlation


class Block(Protocol):
    """Rows whose errors are independent of one another, of standard deviation one."""

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of those that the model hangs on, in the order of its derivatives."""
        ...

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the model leaves of the rows, and its derivatives.

        Parameters
        ----------
        values
            Values of all unknowns, by name.

        Returns
        -------
        left : ndarray, shape (n_rows,)
            Recorded less modelled, over the standard deviation of each row's error.
        derivatives : ndarray, shape (n_rows, n_unknowns)
            Derivatives of the modelled rows by the block's own unknowns, over the same.
        """
        ...


@dataclass(frozen=True, eq=False)
class LinearBlock(ReadOnlyArrays):
    """Rows that are linear in the unknowns: ``columns @ unknowns`` is ``recorded``, with errors.

    Attributes
    ----------
    columns : ndarray, shape (n_rows, n_unknowns)
    recorded : ndarray, shape (n_rows,)
    sigma
        Standard deviation of a row's error.
    """

    unknowns: tuple[str, ...]
    columns: Array
    recorded: Array
    sigma: float

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the columns leave of the rows, and the columns, over the standard deviation."""
        modelled = self.columns @ np.array([values[name] for name in self.unknowns])
        return (self.recorded - modelled) / self.sigma, self.columns / self.sigma

    def with_columns(self, columns: Mapping[str, Array]) -> LinearBlock:
        """Let the rows hang on further unknowns, each with its column, shape (n_rows,)."""
        if not columns:
            return self
        more = np.column_stack([self.columns, *columns.values()])
        return replace(self, unknowns=(*self.unknowns, *columns), columns=more)


@dataclass(frozen=True, eq=False)
class JointBlock(ReadOnlyArrays):
    """Rows of several blocks, whose errors are correlated.

    Attributes
    ----------
    parts
        Each with its rows over their own standard deviations.
    correlation
        Correlation of all rows; None if they are independent.
    """

    parts: tuple[Block, ...]
    correlation: Correlation | None = None

    @cached_property
    def unknowns(self) -> tuple[str, ...]:
        """Names of those of all parts, each once."""
        return tuple(dict.fromkeys(name for part in self.parts for name in part.unknowns))

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the models leave of all rows, and its derivatives, in rows of independent errors."""
        found = []
        for part in self.parts:
            left, derivatives = part.linearised(values)
            rows = np.zeros((left.size, len(self.unknowns) + 1))
            rows[:, [self.unknowns.index(name) for name in part.unknowns]] = derivatives
            rows[:, -1] = left
            found.append(rows)
        whole = self.whitened(np.vstack(found))
        return whole[:, -1], whole[:, :-1]

    def whitened(self, rows: Array) -> Array:
        """Turn rows of all parts into rows of independent errors, shape (n_rows, n_columns) as given."""
        return rows if self.correlation is None else self.correlation.whitened(rows)
