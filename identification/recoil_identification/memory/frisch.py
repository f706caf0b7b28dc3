"""The bracket that two opposite regressions set around a ratio when both sides carry errors, window by window.

Regression of the response on the regressor is drawn towards zero by errors in the regressor; the inverse of the
regression of the regressor on the response is drawn away from zero by errors in the response. With errors that are
independent of each other and of the signal the true ratio lies between the two in the limit of many samples, whatever
the errors' sizes (R. Frisch, "Statistical Confluence Analysis by Means of Complete Regression Systems", Oslo, 1934).
Their quotient is the squared correlation of both sides, so the bracket's width measures the errors directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.memory.limited_memory import limited_memory_least_squares
from recoil_identification.memory.window_factors import FloatArray


@dataclass(frozen=True, eq=False)
class FrischBracket:
    """Forward and reverse estimate of ``response = ratio * regressor`` in every window; NaN where there is none.

    Attributes
    ----------
    forward, reverse : ndarray, shape (n_samples,)
        Response on regressor, and one over regressor on response. Of one sign, the reverse one never the smaller in
        magnitude, but for round-off.
    u_forward, u_reverse : ndarray, shape (n_samples,)
        Standard errors for errors that are independent from sample to sample; the reverse one to first order.
    identified : ndarray of bool, shape (n_samples,)
        Where both regressions give a number.
    window : int
    """

    forward: FloatArray
    reverse: FloatArray
    u_forward: FloatArray
    u_reverse: FloatArray
    identified: NDArray[np.bool_]
    window: int

    @property
    def lower(self) -> FloatArray:
        """Lower end, shape (n_samples,)."""
        return np.asarray(np.minimum(self.forward, self.reverse))

    @property
    def upper(self) -> FloatArray:
        """Upper end, shape (n_samples,)."""
        return np.asarray(np.maximum(self.forward, self.reverse))

    @property
    def squared_correlation(self) -> FloatArray:
        """Forward over reverse: one without errors, shape (n_samples,)."""
        return np.asarray(self.forward / self.reverse)

    def holds(self, ratio: float, coverage_factor: float = 0.0) -> NDArray[np.bool_]:
        """Tell where a ratio lies in the bracket.

        Parameters
        ----------
        ratio : float
        coverage_factor : float, default 0.0
            Standard errors by which each end is moved outwards, for windows of few samples.

        Returns
        -------
        ndarray of bool, shape (n_samples,)
            False where there is no bracket.
        """
        forward_is_lower = self.forward <= self.reverse
        u_lower = np.where(forward_is_lower, self.u_forward, self.u_reverse)
        u_upper = np.where(forward_is_lower, self.u_reverse, self.u_forward)
        return np.asarray(
            (self.lower - coverage_factor * u_lower <= ratio) & (ratio <= self.upper + coverage_factor * u_upper)
        )


def frisch_bracket(
    regressor: ArrayLike,
    response: ArrayLike,
    window: int,
    *,
    weights: ArrayLike | None = None,
    partial: bool = False,
    engine: Literal["auto", "numpy", "numba"] = "auto",
    workers: int = 1,
) -> FrischBracket:
    """Estimate a ratio in both directions in every window of a record.

    Parameters
    ----------
    regressor, response : array_like, shape (n_samples,)
        Without an offset: the regressions pass through zero. NaN for a missing sample.
    window : int
        Samples of a window, at least 2.
    weights, partial, engine, workers
        As for `limited_memory_least_squares`.

    Returns
    -------
    FrischBracket
        Row k from samples ``k - window + 1`` to k.

    Raises
    ------
    ValueError, TypeError
        As `limited_memory_least_squares`, and for a regressor of more than one dimension.
    """
    x, y = np.asarray(regressor), np.asarray(response)
    if x.ndim != 1 or y.ndim != 1:
        raise ValueError(f"regressor and response must have one dimension, found shapes {x.shape} and {y.shape}")

    def slope_of(onto: NDArray[np.float64], of: NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
        estimates = limited_memory_least_squares(
            onto[:, np.newaxis], of, window, weights=weights, partial=partial, engine=engine, workers=workers
        )
        return estimates.parameters[:, 0], estimates.standard_errors[:, 0]

    forward, u_forward = slope_of(x, y)
    inverse, u_inverse = slope_of(y, x)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # no correlation at all has no reverse ratio
        reverse = 1.0 / inverse
        u_reverse = np.abs(reverse) * np.abs(u_inverse / inverse)
    identified = np.isfinite(forward) & np.isfinite(reverse) & np.isfinite(u_reverse)

    def where_identified(values: FloatArray) -> FloatArray:
        return np.where(identified, values, np.nan)

    return FrischBracket(
        forward=where_identified(forward),
        reverse=where_identified(reverse),
        u_forward=where_identified(u_forward),
        u_reverse=where_identified(u_reverse),
        identified=identified,
        window=int(window),
    )
