"""An ARX model as a value: its orders, its coefficients with their covariance, and how well it fits.

::

    y(k) = -a_1 y(k-1) - ... - a_na y(k-na) + b_0 u(k-d) + ... + b_nb u(k-d-nb) + e(k)

Equations (32) to (35) of the paper. The polynomial B has ``nb + 1`` coefficients, as there; MATLAB's
``nb`` counts one more. The mass is the case na = nb = d = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, order=True)
class ArxOrders:
    """How many samples of the past a model looks at.

    Parameters
    ----------
    na
        Order of A: past outputs; the paper's m.
    nb
        Order of B: ``nb + 1`` inputs; the paper's n.
    delay
        Samples by which the input is late, d.

    Raises
    ------
    ValueError
        If one is negative.
    TypeError
        If one is not an integer.
    """

    na: int = 0
    nb: int = 0
    delay: int = 0

    def __post_init__(self) -> None:
        for name in ("na", "nb", "delay"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer):
                raise TypeError(f"{name} must be an integer number, found {value!r}")
            if value < 0:
                raise ValueError(f"{name} must not be negative, found {value}")
            object.__setattr__(self, name, int(value))

    @property
    def n_parameters(self) -> int:
        """Coefficients to estimate, na + nb + 1."""
        return self.na + self.nb + 1

    @property
    def memory(self) -> int:
        """Samples before an instant that its row needs."""
        return max(self.na, self.delay + self.nb)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, a first."""
        return (*(f"a{i}" for i in range(1, self.na + 1)), *(f"b{j}" for j in range(self.nb + 1)))

    def __str__(self) -> str:
        """As reports write it."""
        return f"na {self.na}, nb {self.nb}, d {self.delay}"


@dataclass(frozen=True, eq=False)
class ArxModel:
    """An estimated model.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        a_1 .. a_na, b_0 .. b_nb; a without unit, b in units of the output per unit of the input.
    covariance : ndarray, shape (n_parameters, n_parameters)
        Of the parameters, for residuals that are white.
    residual_sum_of_squares
        In squared units of the output.
    n_rows
        Rows that were fitted.
    step_s
        Time between samples.
    """

    orders: ArxOrders
    parameters: Array
    covariance: Array
    residual_sum_of_squares: float
    n_rows: int
    step_s: float = 1.0

    @property
    def a(self) -> Array:
        """Coefficients of A without the leading 1, shape (na,)."""
        return self.parameters[: self.orders.na]

    @property
    def b(self) -> Array:
        """Coefficients of B, shape (nb + 1,)."""
        return self.parameters[self.orders.na :]

    @property
    def denominator(self) -> Array:
        """A in powers of 1/z, shape (na + 1,)."""
        return np.concatenate([[1.0], self.a])

    @property
    def numerator(self) -> Array:
        """B in powers of 1/z with the delay's leading zeros, shape (delay + nb + 1,)."""
        return np.concatenate([np.zeros(self.orders.delay), self.b])

    @property
    def standard_errors(self) -> Array:
        """Of the parameters, shape (n_parameters,); too small where residuals are correlated in time."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def noise_variance(self) -> float:
        """Of e, from the residuals and their degrees of freedom, squared units of the output."""
        return self.residual_sum_of_squares / (self.n_rows - self.orders.n_parameters)

    @property
    def loss(self) -> float:
        """Mean square of the residuals, the loss function V."""
        return self.residual_sum_of_squares / self.n_rows

    @property
    def fpe(self) -> float:
        """Akaike's final prediction error, ``V (1 + p/N) / (1 - p/N)`` (Ann. Inst. Stat. Math. 21, 1969, 243)."""
        share = self.orders.n_parameters / self.n_rows
        return self.loss * (1.0 + share) / (1.0 - share)

    @property
    def aic(self) -> float:
        """Akaike's information criterion; see `information_criteria`."""
        return information_criteria(self.residual_sum_of_squares, self.n_rows, self.orders.n_parameters).aic

    @property
    def aicc(self) -> float:
        """The same corrected for few rows."""
        return information_criteria(self.residual_sum_of_squares, self.n_rows, self.orders.n_parameters).aicc

    @property
    def bic(self) -> float:
        """Bayes' criterion."""
        return information_criteria(self.residual_sum_of_squares, self.n_rows, self.orders.n_parameters).bic


class Criteria(NamedTuple):
    """Information criteria; smaller is better, and only the difference on the same rows means anything."""

    aic: float
    aicc: float
    bic: float


def information_criteria(residual_sum_of_squares: float, n_rows: int, n_parameters: int) -> Criteria:
    """Compute information criteria of a regression with normal errors.

    The variance of the errors is not counted as a parameter, as in MATLAB's ``aic`` and statsmodels' OLS.

    Parameters
    ----------
    n_rows, n_parameters
        More rows than parameters.

    Returns
    -------
    Criteria
        Minus infinity for a perfect fit; `aicc` is infinite where rows are too few for its correction.

    Notes
    -----
    ``N (ln(2 pi V) + 1) + 2 p`` (H. Akaike, IEEE Trans. Autom. Control 19, 1974, 716-723), with
    ``2 p (p + 1) / (N - p - 1)`` more for few rows (C. M. Hurvich and C.-L. Tsai, Biometrika 76, 1989,
    297-307), and with ``p ln N`` in the place of ``2 p`` (G. Schwarz, Ann. Stat. 6, 1978, 461-464).
    """
    mean_square = residual_sum_of_squares / n_rows
    deviance = n_rows * (math.log(2.0 * math.pi * mean_square) + 1.0) if mean_square > 0.0 else -math.inf
    spare = n_rows - n_parameters - 1
    few = 2.0 * n_parameters * (n_parameters + 1) / spare if spare > 0 else math.inf
    aic = deviance + 2.0 * n_parameters
    return Criteria(aic, aic + few if math.isfinite(few) else math.inf, deviance + n_parameters * math.log(n_rows))
