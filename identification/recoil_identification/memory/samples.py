"""Samples of a linear regression: checked, and as scaled rows in blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.memory.window_factors import FloatArray

NEGLIGIBLE = 2.0**-150
"""Share of a regressor's largest value that counts as zero, so that no product can leave float64."""
LARGEST_EXPONENT = 1000
"""Exponent of two up to which columns are scaled: the scales themselves stay in float64."""
FOLDED_ROWS = 64
"""Rows that are looked through side by side for the largest value of narrow tables."""
CACHED_NUMBERS = 2**15
"""Numbers that are looked through twice before the next."""


def checked_samples(
    regressors: ArrayLike,
    response: ArrayLike,
    weights: ArrayLike | None,
    *,
    many_outputs: bool = False,
    scanned_later: bool = False,
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Check the samples of a regression, and take them as float64.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
    response : array_like, shape (n_samples,)
    weights : array_like, shape (n_samples,), optional
    many_outputs
        Whether a response of shape (n_samples, n_outputs) is taken as well.
    scanned_later
        Whether the search for infinite samples is left to `ScaledRecord.of`, which looks at every sample anyway.

    Returns
    -------
    regressors, response, weights : ndarray
        The caller's own arrays where they are float64 already.

    Raises
    ------
    ValueError
        For shapes that do not fit, infinite samples, weights that are not finite or negative.
    TypeError
        For complex samples.
    """
    if any(np.iscomplexobj(values) for values in (regressors, response, weights) if values is not None):
        raise TypeError("regressors, response and weights must be real")
    columns = np.asarray(regressors, dtype=np.float64)
    outputs = np.asarray(response, dtype=np.float64)
    if columns.ndim != 2 or columns.shape[1] < 1:
        raise ValueError(f"regressors must have the shape (n_samples, n_parameters), found {columns.shape}")
    if many_outputs and outputs.ndim == 2:
        if outputs.shape[0] != columns.shape[0] or outputs.shape[1] < 1:
            raise ValueError(
                f"response must have the shape {columns.shape[:1]} or ({columns.shape[0]}, n_outputs), "
                f"found {outputs.shape}"
            )
    elif outputs.shape != columns.shape[:1]:
        raise ValueError(f"response must have the shape {columns.shape[:1]}, found {outputs.shape}")
    if not scanned_later:
        for values in (columns, outputs):
            # of finite samples the extremes are finite, which two quick passes tell
            if values.size and not (np.isfinite(values.max()) and np.isfinite(values.min())):
                _refuse_infinite(values)
    if weights is None:
        return columns, outputs, None
    weight = np.asarray(weights, dtype=np.float64)
    if weight.shape != columns.shape[:1]:
        raise ValueError(f"weights must have the shape {columns.shape[:1]}, found {weight.shape}")
    if not (np.isfinite(weight) & (weight >= 0.0)).all():
        raise ValueError("weights must be finite and not negative")
    return columns, outputs, weight


def _refuse_infinite(*tables: FloatArray) -> None:
    if any(np.isinf(table).any() for table in tables):
        raise ValueError("regressors and response must be finite; a missing sample is NaN")


@dataclass(frozen=True, eq=False)
class ScaledRecord:
    """A record as rows of [X | Y] in blocks, scaled by powers of two, which costs no round-off.

    Attributes
    ----------
    regressors : ndarray, shape (n_samples, n_parameters)
    response : ndarray, shape (n_samples, n_outputs)
    root_weights : ndarray, shape (n_samples,), or None
        Square roots of the weights, scaled.
    gaps : ndarray of bool, shape (n_samples,), or None
        `present`; None where no sample is missing.
    exponents : ndarray of int64, shape (n_parameters + n_outputs,)
        Of two, by which the columns of [X | Y] are scaled down.
    weight_exponent
        The same for the roots of the weights.
    block
        Samples of a block.
    """

    regressors: FloatArray
    response: FloatArray
    root_weights: FloatArray | None
    gaps: NDArray[np.bool_] | None
    exponents: NDArray[np.int64]
    weight_exponent: int
    block: int

    @classmethod
    def of(
        cls,
        regressors: FloatArray,
        response: FloatArray,
        weights: FloatArray | None,
        block: int,
    ) -> ScaledRecord:
        """Find what is present, and the scales.

        Parameters
        ----------
        regressors : ndarray, shape (n_samples, n_parameters)
        response : ndarray, shape (n_samples,) or (n_samples, n_outputs)
        weights : ndarray, shape (n_samples,), or None

        Raises
        ------
        ValueError
            For infinite samples.
        """
        response = response[:, np.newaxis] if response.ndim == 1 else response
        largest = np.concatenate([largest_magnitudes(regressors), largest_magnitudes(response)])
        if not np.isfinite(largest).all():
            # a NaN hides an infinity of its column
            _refuse_infinite(regressors, response)
        complete = not np.isnan(largest).any() and (weights is None or bool((weights > 0.0).all()))
        present: NDArray[np.bool_] | None = None
        if not complete:
            present = np.asarray(~(np.isnan(regressors).any(axis=1) | np.isnan(response).any(axis=1)))
            if weights is not None:
                present &= weights > 0.0
            largest = np.array([_largest_present(c, present) for c in (*regressors.T, *response.T)])
        root_weights, weight_exponent = None, 0
        if weights is not None:
            root_weights = np.sqrt(weights)
            weight_exponent = int(_exponents(root_weights.max(where=True if present is None else present, initial=0.0)))
            root_weights = np.ldexp(root_weights, -weight_exponent)
        return cls(regressors, response, root_weights, present, _exponents(largest), weight_exponent, block)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Where a sample is not missing, shape (n_samples,)."""
        return np.ones(self.n_samples, dtype=np.bool_) if self.gaps is None else self.gaps

    @property
    def scaled(self) -> bool:
        """Whether any scale differs from one."""
        return bool(self.exponents.any()) or self.weight_exponent != 0

    @property
    def n_samples(self) -> int:
        """Samples of the record, missing ones too."""
        return int(self.regressors.shape[0])

    @property
    def n_columns(self) -> int:
        """Parameters and outputs."""
        return int(self.exponents.shape[0])

    @property
    def n_blocks(self) -> int:
        """Blocks begun."""
        return -(-self.n_samples // self.block)

    def rows(self, first: int, stop: int) -> FloatArray:
        """Give the rows of a run of blocks.

        Parameters
        ----------
        first, stop
            Blocks; the first may be -1, the block before the record.

        Returns
        -------
        ndarray, shape (n_columns, stop - first, block)
            Zero outside the record and where a sample is missing.
        """
        start, end = first * self.block, stop * self.block
        inside = slice(max(start, 0), min(end, self.n_samples))
        rows = np.empty((self.n_columns, end - start))
        rows[:, : inside.start - start], rows[:, inside.stop - start :] = 0.0, 0.0
        filled = rows[:, inside.start - start : inside.stop - start]
        n_parameters = self.regressors.shape[1]
        scale = np.ldexp(1.0, -self.exponents)[:, np.newaxis]
        np.multiply(self.regressors[inside].T, scale[:n_parameters], out=filled[:n_parameters])
        np.multiply(self.response[inside].T, scale[n_parameters:], out=filled[n_parameters:])
        if self.root_weights is not None:
            filled *= self.root_weights[inside]
        if self.gaps is not None:
            filled[:, ~self.gaps[inside]] = 0.0
        regressors = filled[:n_parameters]
        negligible = np.abs(regressors) < NEGLIGIBLE
        if negligible.any():
            regressors[negligible] = 0.0
        return rows.reshape(self.n_columns, stop - first, self.block)


def largest_magnitudes(table: FloatArray) -> FloatArray:
    """Return the largest magnitude of each column; not finite where a sample is not.

    Parameters
    ----------
    table : ndarray, shape (n_samples, n_columns)
    """
    n_rows, n_columns = table.shape
    if not table.flags.c_contiguous:
        return np.array([max(float(c.max(initial=0.0)), -float(c.min(initial=0.0))) for c in table.T])
    folded = n_rows - n_rows % FOLDED_ROWS
    # rows side by side: numpy's maximum along the first axis of a narrow table runs through one row at a time
    wide = table[:folded].reshape(-1, FOLDED_ROWS * n_columns)
    extremes = [np.zeros(n_columns)]
    # both extremes of as many as stay in the processor's cache
    at_once = max(1, CACHED_NUMBERS // wide.shape[1])
    for first in range(0, wide.shape[0], at_once):
        part = wide[first : first + at_once]
        extremes += [part.max(axis=0), -part.min(axis=0)]
    largest = np.concatenate(extremes).reshape(-1, n_columns).max(axis=0)
    rest = table[folded:]
    return np.asarray(np.maximum(largest, np.abs(rest).max(axis=0, initial=0.0)))


def _largest_present(column: FloatArray, present: NDArray[np.bool_]) -> float:
    """Largest magnitude of a column among the samples that are present."""
    return max(float(column.max(where=present, initial=0.0)), -float(column.min(where=present, initial=0.0)))


def _exponents(largest: FloatArray | np.float64 | float) -> NDArray[np.int64]:
    """Exponents of two just above magnitudes."""
    return np.asarray(np.clip(np.frexp(largest)[1].astype(np.int64), -LARGEST_EXPONENT, LARGEST_EXPONENT))
