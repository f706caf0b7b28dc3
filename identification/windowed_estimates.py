"""What a sliding least-squares window says: numbers, their errors, and the reason where there is none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.windows import FloatArray, Solution

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


@dataclass(frozen=True, eq=False)
class WindowedEstimates:
    """Least-squares estimates of every window of a record; row k belongs to samples k - window + 1 to k.

    Attributes
    ----------
    parameters : ndarray, shape (n_samples, n_parameters)
        Estimates in units of the response per unit of the regressor; NaN where not identified.
    standard_errors : ndarray, shape (n_samples, n_parameters)
        Ordinary least squares' own, sqrt(RSS / degrees of freedom * diag((X'WX)^-1)). They hold for
        errors that are independent from sample to sample: after a low-pass filter they are too small.
    residual_sum_of_squares : ndarray, shape (n_samples,)
        Weighted, in squared units of the response times the weight's unit; NaN where not identified.
    degrees_of_freedom : ndarray of int64, shape (n_samples,)
        Samples present less parameters, not below zero.
    count : ndarray of int64, shape (n_samples,)
        Samples present in the window.
    smallest_pivot : ndarray, shape (n_samples,)
        Least share of a regressor's energy that the regressors before it do not explain: one over
        the (uncentred) variance inflation factor. NaN where the window was too short to try.
    operator : ndarray of uint8, shape (n_samples,)
        `WindowOperator` that gave the number.
    status : ndarray of uint8, shape (n_samples,)
        `WindowStatus`.
    """

    parameters: FloatArray
    standard_errors: FloatArray
    residual_sum_of_squares: FloatArray
    degrees_of_freedom: NDArray[np.int64]
    count: NDArray[np.int64]
    smallest_pivot: FloatArray
    operator: NDArray[np.uint8]
    status: NDArray[np.uint8]

    @property
    def identified(self) -> NDArray[np.bool_]:
        """Where there is a number, shape (n_samples,)."""
        return np.equal(self.status, WindowStatus.IDENTIFIED)


@dataclass(frozen=True, eq=False)
class WindowEstimate:
    """Least-squares estimate of one window: one row of `WindowedEstimates`.

    Attributes
    ----------
    parameters, standard_errors : ndarray, shape (n_parameters,)
        NaN where not identified.
    residual_sum_of_squares, smallest_pivot : float
    degrees_of_freedom, count : int
    operator : WindowOperator
    status : WindowStatus
    """

    parameters: FloatArray
    standard_errors: FloatArray
    residual_sum_of_squares: float
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


@dataclass(frozen=True, eq=False)
class WindowPolicy:
    """When a window may give a number.

    Parameters
    ----------
    n_parameters : int
    window : int
        Samples of a window, at least ``n_parameters + 1``: one degree of freedom is the least from
        which an error can be told.
    min_excitation : float or array_like, shape (n_parameters,), optional
        Least weighted sum of squares of each regressor in a window, in its own squared unit times
        the weight's. Zero excitation never gives a number.
    max_relative_error : float, optional
        Largest standard error of the first parameter over its magnitude.
    minimum_count : int, optional
        Least number of samples present, ``n_parameters + 1`` if omitted.
    partial : bool, default False
        Whether the first ``window - 1`` rows, whose window the record does not fill, are tried too.

    Raises
    ------
    ValueError
        If a limit is out of range or of another shape.
    TypeError
        If a number of samples is not an integer.
    """

    n_parameters: int
    window: int
    min_excitation: Any = None
    max_relative_error: float | None = None
    minimum_count: int | None = None
    partial: bool = False

    def __post_init__(self) -> None:
        for name in ("n_parameters", "window", "minimum_count"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer | None):
                raise TypeError(f"{name} must be an integer number, found {value!r}")
        if self.n_parameters < 1:
            raise ValueError(f"n_parameters must be at least 1, found {self.n_parameters}")
        if self.window < self.least_count:
            raise ValueError(
                f"window must hold one sample more than there are parameters, "
                f"at least {self.least_count}, found {self.window}"
            )
        if not self.least_count <= self.needed_count <= self.window:
            raise ValueError(
                f"minimum_count must lie between {self.least_count} and the window {self.window}, "
                f"found {self.minimum_count}"
            )
        limits = np.asarray(0.0 if self.min_excitation is None else self.min_excitation, dtype=np.float64)
        if limits.shape not in ((), (self.n_parameters,)):
            raise ValueError(f"min_excitation must be one number or {self.n_parameters}, found shape {limits.shape}")
        if not (np.isfinite(limits) & (limits >= 0.0)).all():
            raise ValueError("min_excitation must be finite and not negative")
        if self.max_relative_error is not None and not self.max_relative_error > 0.0:
            raise ValueError(f"max_relative_error must be positive, found {self.max_relative_error}")
        object.__setattr__(self, "min_excitation", np.broadcast_to(limits, (self.n_parameters,)).copy())

    @property
    def least_count(self) -> int:
        """Samples below which no window has a degree of freedom."""
        return self.n_parameters + 1

    @property
    def needed_count(self) -> int:
        """Samples below which a window is not tried."""
        return self.least_count if self.minimum_count is None else self.minimum_count


def judged(
    solution: Solution,
    degrees_of_freedom: NDArray[np.int64],
    min_excitation: FloatArray,
    max_relative_error: float | None,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """Judge windows that hold enough samples.

    Parameters
    ----------
    solution : Solution
    degrees_of_freedom : ndarray, shape (n_windows,)
    min_excitation : ndarray, shape (n_parameters,)
        In the solution's units.
    max_relative_error : float or None

    Returns
    -------
    status : ndarray of uint8, shape (n_windows,)
    standard_errors : ndarray, shape (n_parameters, n_windows)
        In the solution's units.
    """
    variance = solution.residual_sum_of_squares / np.maximum(degrees_of_freedom, 1)
    standard_errors = np.sqrt(variance * solution.variance_factors)
    excited = ((solution.energies > 0.0) & (solution.energies >= min_excitation[:, np.newaxis])).all(axis=0)
    status = np.full(excited.shape, WindowStatus.IDENTIFIED, dtype=np.uint8)
    if max_relative_error is not None:
        precise = standard_errors[0] <= max_relative_error * np.abs(solution.parameters[0])
        status[~precise] = WindowStatus.NO_EXCITATION
    status[solution.smallest_pivot < COLLINEAR_PIVOT] = WindowStatus.COLLINEAR
    status[~excited] = WindowStatus.NO_EXCITATION
    return status, standard_errors


def is_sound(solution: Solution) -> NDArray[np.bool_]:
    """Whether sums of products are accurate enough for a window, or have nothing to be accurate about.

    Parameters
    ----------
    solution : Solution
        Of sums of products.

    Returns
    -------
    ndarray of bool, shape (n_windows,)
    """
    accurate = (solution.smallest_pivot >= GUARDED_PIVOT) & (
        solution.residual_sum_of_squares >= GUARDED_RESIDUAL * solution.response_energy
    )
    return np.asarray(accurate | (solution.energies == 0.0).any(axis=0))
