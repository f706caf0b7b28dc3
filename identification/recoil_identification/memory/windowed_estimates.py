"""What a sliding least-squares window says: numbers, their errors, and the reason where there is none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.memory.window_factors import FloatArray

GUARDED_PIVOT = 1e-4
"""Gram is trusted above this smallest pivot: its relative error, about 30 eps / pivot, is below 1e-10 there."""
COLLINEAR_PIVOT = 1e-12
"""Below this smallest pivot the regressors are the same but for round-off in the data themselves."""
GUARDED_RESIDUAL = 1e-10
"""Gram is trusted above this share of the response's energy left over: its error there is 1e-5 of the RSS."""


class WindowStatus(IntEnum):
    """Whether a window gives a number, and why not where it does not."""

    IDENTIFIED = 0
    WINDOW_NOT_FULL = 1
    TOO_FEW_SAMPLES = 2
    NO_EXCITATION = 3
    COLLINEAR = 4


class WindowOperator(IntEnum):
    """How the sums of a window were formed: products (``GRAM``) or orthogonal rotations (``QR``)."""

    GRAM = 0
    QR = 1


REASONS: Mapping[WindowStatus, str] = MappingProxyType(
    {
        WindowStatus.IDENTIFIED: "identified",
        WindowStatus.WINDOW_NOT_FULL: "the record began less than one window ago",
        WindowStatus.TOO_FEW_SAMPLES: "too few samples of the window are present",
        WindowStatus.NO_EXCITATION: "the regressors carry too little signal in the window",
        WindowStatus.COLLINEAR: "the regressors cannot be told apart in the window",
    }
)
"""One sentence part for each status, for reports."""

STATUS_BITS = 0x0F
"""Bits of a window's mark that hold its `WindowStatus`."""
QR_BIT = 0x10
"""Bit of a window's mark that is set where rotations gave the number."""
SILENT_BIT = 0x20
"""Bit of a window's mark that is set where a regressor is zero throughout."""


@dataclass(frozen=True, eq=False)
class WindowedEstimates:
    """Least-squares estimates of every window of a record; row k belongs to samples k - window + 1 to k.

    What can be told from the marks and the counts is worked out when it is first asked for: of long records the
    writing of results takes most of the time.

    Attributes
    ----------
    parameters : ndarray, shape (n_samples, n_parameters) or (n_samples, n_parameters, n_outputs)
        Estimates in units of the response per unit of the regressor; NaN where not identified.
    standard_errors : ndarray, shape of `parameters`
        Ordinary least squares' own, sqrt(RSS / degrees of freedom * diag((X'WX)^-1)). They hold for
        errors that are independent from sample to sample: after a low-pass filter they are too small.
    residual_sum_of_squares : ndarray, shape (n_samples,) or (n_samples, n_outputs)
        Weighted, in squared units of the response times the weight's unit; NaN where not identified.
    marks : ndarray of uint8, shape (n_samples,)
        Status, operator and silence of each window, see `STATUS_BITS`, `QR_BIT`, `SILENT_BIT`.
    pivots : ndarray, shape (n_samples,), or None
        `smallest_pivot`; None for a single regressor, which explains itself.
    counts : ndarray of int64, shape (n_samples,), or None
        `count`; None where no sample of a record is missing.
    window
        Samples of a window.
    first
        Samples of the record before the first row.
    """

    parameters: FloatArray
    standard_errors: FloatArray
    residual_sum_of_squares: FloatArray
    marks: NDArray[np.uint8]
    pivots: FloatArray | None
    counts: NDArray[np.int64] | None
    window: int
    first: int = 0

    @property
    def n_parameters(self) -> int:
        """Number of regressors."""
        return int(self.parameters.shape[1])

    @cached_property
    def status(self) -> NDArray[np.uint8]:
        """`WindowStatus` of each window, shape (n_samples,)."""
        return np.asarray(self.marks & np.uint8(STATUS_BITS))

    @cached_property
    def operator(self) -> NDArray[np.uint8]:
        """`WindowOperator` that gave the number, shape (n_samples,)."""
        return np.where(self.marks & np.uint8(QR_BIT), WindowOperator.QR, WindowOperator.GRAM).astype(np.uint8)

    @property
    def identified(self) -> NDArray[np.bool_]:
        """Where there is a number, shape (n_samples,)."""
        return np.equal(self.status, WindowStatus.IDENTIFIED)

    @cached_property
    def count(self) -> NDArray[np.int64]:
        """Samples present in the window, int64, shape (n_samples,)."""
        if self.counts is not None:
            return self.counts
        return np.minimum(np.arange(self.first + 1, self.first + 1 + self.marks.size, dtype=np.int64), self.window)

    @cached_property
    def degrees_of_freedom(self) -> NDArray[np.int64]:
        """Samples present less parameters, not below zero, int64, shape (n_samples,)."""
        return np.maximum(self.count - self.n_parameters, 0)

    @cached_property
    def smallest_pivot(self) -> FloatArray:
        """Least share of a regressor's energy that the regressors before it do not explain, shape (n_samples,).

        One over the (uncentred) variance inflation factor. NaN where the window was too short to try.
        """
        if self.pivots is not None:
            return self.pivots
        pivots = np.where(self.marks & np.uint8(SILENT_BIT), 0.0, 1.0)
        pivots[
            np.equal(self.status, WindowStatus.WINDOW_NOT_FULL) | np.equal(self.status, WindowStatus.TOO_FEW_SAMPLES)
        ] = np.nan
        return pivots

    def residuals(self, last: int, regressors: ArrayLike, response: ArrayLike) -> FloatArray:
        """Residuals of one window, from the samples that it was estimated from.

        The record is not kept: a caller who has changed it in between would be given wrong residuals.

        Parameters
        ----------
        last
            Row of the window, which ends with this sample.
        regressors : array_like, shape (n_samples, n_parameters)
        response : array_like, shape (n_samples,) or (n_samples, n_outputs)
            Those of the estimate, from the first row on.

        Returns
        -------
        ndarray, shape (n_in_window,) or (n_in_window, n_outputs)
            Response less regressors times parameters, in the response's unit, without weights; NaN for a
            missing sample, and throughout where the window gave no number. A sample of weight zero has a residual.

        Raises
        ------
        IndexError
            If there is no such row.
        ValueError
            For shapes other than the estimate's.
        """
        n_samples = self.marks.size
        if not 0 <= last < n_samples:
            raise IndexError(f"last must lie between 0 and {n_samples - 1}, found {last}")
        columns, outputs = np.asarray(regressors, dtype=np.float64), np.asarray(response, dtype=np.float64)
        if columns.shape != (n_samples, self.n_parameters):
            raise ValueError(f"regressors must have the shape {(n_samples, self.n_parameters)}, found {columns.shape}")
        if outputs.shape != self.residual_sum_of_squares.shape:
            raise ValueError(
                f"response must have the shape {self.residual_sum_of_squares.shape}, found {outputs.shape}"
            )
        samples = slice(max(last + 1 - self.window, 0), last + 1)
        return np.asarray(outputs[samples] - columns[samples] @ self.parameters[last])


@dataclass(frozen=True, eq=False)
class WindowEstimate:
    """Least-squares estimate of one window: one row of `WindowedEstimates`.

    Attributes
    ----------
    parameters, standard_errors : ndarray, shape (n_parameters,) or (n_parameters, n_outputs)
        NaN where not identified.
    residual_sum_of_squares : float, or ndarray of shape (n_outputs,)
    """

    parameters: FloatArray
    standard_errors: FloatArray
    residual_sum_of_squares: float | FloatArray
    degrees_of_freedom: int
    count: int
    smallest_pivot: float
    operator: WindowOperator
    status: WindowStatus

    @property
    def identified(self) -> bool:
        """Whether there is a number."""
        return self.status == WindowStatus.IDENTIFIED

    @property
    def reason(self) -> str:
        """The status in words."""
        return REASONS[self.status]
