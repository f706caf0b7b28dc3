"""Samples of a linear regression: checked, and as scaled rows in blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.windows import FloatArray

NEGLIGIBLE = 2.0**-150
"""Share of a regressor's largest value that counts as zero, so that no product can leave float64."""
LARGEST_EXPONENT = 1000
"""Exponent of two up to which columns are scaled: the scales themselves stay in float64."""


def checked_samples(
    regressors: ArrayLike, response: ArrayLike, weights: ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Check the samples of a regression, and take them as float64.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
    response : array_like, shape (n_samples,)
    weights : array_like, shape (n_samples,), optional

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
    response_column = np.asarray(response, dtype=np.float64)
    if columns.ndim != 2 or columns.shape[1] < 1:
        raise ValueError(f"regressors must have the shape (n_samples, n_parameters), found {columns.shape}")
    if response_column.shape != columns.shape[:1]:
        raise ValueError(f"response must have the shape {columns.shape[:1]}, found {response_column.shape}")
    if np.isinf(columns).any() or np.isinf(response_column).any():
        raise ValueError("regressors and response must be finite; a missing sample is NaN")
    if weights is None:
        return columns, response_column, None
    weight = np.asarray(weights, dtype=np.float64)
    if weight.shape != response_column.shape:
        raise ValueError(f"weights must have the shape {response_column.shape}, found {weight.shape}")
    if not (np.isfinite(weight) & (weight >= 0.0)).all():
        raise ValueError("weights must be finite and not negative")
    return columns, response_column, weight


@dataclass(frozen=True, eq=False)
class ScaledRecord:
    """A record as rows of [X | y] in blocks, scaled by powers of two, which costs no round-off.

    Attributes
    ----------
    regressors : ndarray, shape (n_samples, n_parameters)
    response : ndarray, shape (n_samples,)
    root_weights : ndarray, shape (n_samples,), or None
        Square roots of the weights, scaled.
    present : ndarray of bool, shape (n_samples,)
        Where a sample is not missing.
    exponents : ndarray of int64, shape (n_parameters + 1,)
        Of two, by which the columns of [X | y] are scaled down.
    weight_exponent : int
        The same for the roots of the weights.
    block : int
        Samples of a block.
    """

    regressors: FloatArray
    response: FloatArray
    root_weights: FloatArray | None
    present: NDArray[np.bool_]
    exponents: NDArray[np.int64]
    weight_exponent: int
    block: int

    @classmethod
    def of(cls, regressors: FloatArray, response: FloatArray, weights: FloatArray | None, block: int) -> ScaledRecord:
        """Find what is present, and the scales.

        Parameters
        ----------
        regressors : ndarray, shape (n_samples, n_parameters)
        response : ndarray, shape (n_samples,)
        weights : ndarray, shape (n_samples,), or None
        block : int

        Returns
        -------
        ScaledRecord
        """
        present = ~np.isnan(response)
        for column in regressors.T:
            present &= ~np.isnan(column)
        root_weights, weight_exponent = None, 0
        if weights is not None:
            present &= weights > 0.0
            root_weights = np.sqrt(weights)
            weight_exponent = int(_exponents(root_weights[:, np.newaxis], present)[0])
            root_weights = np.ldexp(root_weights, -weight_exponent)
        exponents = np.append(_exponents(regressors, present), _exponents(response[:, np.newaxis], present))
        return cls(regressors, response, root_weights, present, exponents, weight_exponent, block)

    @property
    def n_samples(self) -> int:
        """Samples of the record, missing ones too."""
        return int(self.response.shape[0])

    @property
    def n_columns(self) -> int:
        """Parameters plus one."""
        return int(self.exponents.shape[0])

    @property
    def n_blocks(self) -> int:
        """Blocks begun."""
        return -(-self.n_samples // self.block)

    def rows(self, first: int, stop: int) -> FloatArray:
        """Give the rows of a run of blocks.

        Parameters
        ----------
        first, stop : int
            Blocks; the first may be -1, the block before the record.

        Returns
        -------
        ndarray, shape (n_columns, stop - first, block)
            Zero outside the record and where a sample is missing.
        """
        start, end = first * self.block, stop * self.block
        rows = np.zeros((self.n_columns, end - start))
        inside = slice(max(start, 0), min(end, self.n_samples))
        filled = rows[:, inside.start - start : inside.stop - start]
        scale = np.ldexp(1.0, -self.exponents)
        np.multiply(self.regressors[inside].T, scale[:-1, np.newaxis], out=filled[:-1])
        np.multiply(self.response[inside], scale[-1], out=filled[-1])
        if self.root_weights is not None:
            filled *= self.root_weights[inside]
        missing = ~self.present[inside]
        if missing.any():
            filled[:, missing] = 0.0
        filled[:-1][np.abs(filled[:-1]) < NEGLIGIBLE] = 0.0
        return rows.reshape(self.n_columns, stop - first, self.block)


def _exponents(columns: FloatArray, present: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Exponents of two of each column's largest magnitude among the samples that are present."""
    where: bool | NDArray[np.bool_] = True if present.all() else present
    largest = [
        max(float(column.max(where=where, initial=0.0)), -float(column.min(where=where, initial=0.0)))
        for column in columns.T
    ]
    return np.asarray(np.clip(np.frexp(largest)[1].astype(np.int64), -LARGEST_EXPONENT, LARGEST_EXPONENT))
