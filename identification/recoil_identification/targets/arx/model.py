"""ARX models, equations (32) to (35): their orders, their estimation by least squares, and what they simulate.

::

    y(k) = -a_1 y(k-1) - ... - a_na y(k-na) + b_0 u(k-d) + ... + b_nb u(k-d-nb) + e(k)

The polynomial B has ``nb + 1`` coefficients, as in the paper; MATLAB's ``nb`` counts one more. The mass is the case
na = nb = d = 0. A row of the regression exists where all its samples were measured: a lost sample (NaN) leaves out
every row that needs it and is never bridged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.memory.limited_memory import LeastSquaresFit, least_squares


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
    """

    na: int = 0
    nb: int = 0
    delay: int = 0

    @property
    def n_parameters(self) -> int:
        """Coefficients to estimate, na + nb + 1."""
        return self.na + self.nb + 1

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, those of a first."""
        return (*(f"a{i}" for i in range(1, self.na + 1)), *(f"b{j}" for j in range(self.nb + 1)))

    def __str__(self) -> str:
        """As reports write it."""
        return f"na {self.na}, nb {self.nb}, d {self.delay}"


@dataclass(frozen=True, eq=False)
class ArxModel(ReadOnlyArrays):
    """An estimated model.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        a_1 .. a_na, b_0 .. b_nb; a without unit, b in units of the output per unit of the input.
    covariance : ndarray, shape (n_parameters, n_parameters)
        Covariance of the parameters, for residuals that are white.
    residual_sum_of_squares
        Sum of squares of the residuals in squared units of the output.
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
        """Standard errors of the parameters, shape (n_parameters,); too small where residuals are correlated."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def loss(self) -> float:
        """Mean square of the residuals, the loss function V."""
        return self.residual_sum_of_squares / self.n_rows

    @property
    def bic(self) -> float:
        """Bayes' criterion, ``N (ln(2 pi V) + 1) + p ln N`` (G. Schwarz, Ann. Stat. 6, 1978, 461-464).

        The variance of the errors is not counted as a parameter, as in statsmodels' OLS; minus infinity for a perfect
        fit.
        """
        deviance = self.n_rows * (math.log(2.0 * math.pi * self.loss) + 1.0) if self.loss > 0.0 else -math.inf
        return deviance + self.orders.n_parameters * math.log(self.n_rows)


def arx_regressors(input_: Array, output: Array, orders: ArxOrders) -> Array:
    """Set up the rows phi(k) of equation (35).

    Parameters
    ----------
    input_, output : ndarray, shape (n_samples,)
        Evenly sampled; NaN for a lost sample.

    Returns
    -------
    ndarray, shape (n_samples, n_parameters)
        Row k is ``[-y(k-1) .. -y(k-na), u(k-d) .. u(k-d-nb)]``; NaN where a sample was lost or the
        record had not begun.
    """
    columns = [(-output, i) for i in range(1, orders.na + 1)]
    columns += [(input_, orders.delay + j) for j in range(orders.nb + 1)]
    rows = np.full((input_.size, orders.n_parameters), np.nan)
    for column, (series, lag) in enumerate(columns):
        rows[lag:, column] = series[: max(series.size - lag, 0)]
    return rows


def estimate_arx(
    input_: Array, output: Array, orders: ArxOrders, *, step_s: float = 1.0, rows: Flags | None = None
) -> ArxModel:
    """Estimate a model from a whole record by orthogonal factorisation.

    Parameters
    ----------
    input_, output : ndarray, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. Never modified.
    step_s
        Time between samples.
    rows : ndarray of bool, shape (n_samples,), optional
        Instants whose equations are fitted; their past may lie outside. All if left out.

    Raises
    ------
    IdentificationError
        If there is no number to give: too few rows, an input without signal, or regressors that cannot
        be told apart.
    """
    fit = _fitted(arx_regressors(input_, output, orders), output, rows)
    return ArxModel(
        orders, fit.parameters, fit.variance * fit.covariance_factor, fit.residual_sum_of_squares, fit.count, step_s
    )


def _fitted(regressors: Array, output: Array, rows: Flags | None) -> LeastSquaresFit:
    return least_squares(regressors, output) if rows is None else least_squares(regressors[rows], output[rows])


def robust_covariance(model: ArxModel, input_: Array, output: Array, *, rows: Flags | None = None) -> Array:
    """Return the parameters' covariance for residuals that are correlated in time and of changing size.

    Bartlett's kernel over ``4 (N / 100)^(2/9)`` lags (W. K. Newey and K. D. West, Econometrica 55, 1987, 703-708),
    with the factor ``N / (N - p)`` for the parameters that were fitted. Lags count samples of the record, also
    across a gap.

    Parameters
    ----------
    input_, output : ndarray, shape (n_samples,)
        Signals that the model was estimated from.
    rows : ndarray of bool, shape (n_samples,), optional
        Rows, see `estimate_arx`.

    Returns
    -------
    ndarray, shape (n_parameters, n_parameters)
    """
    regressors = arx_regressors(input_, output, model.orders)
    factor = _fitted(regressors, output, rows).covariance_factor
    scores = regressors * (output - regressors @ model.parameters)[:, np.newaxis]
    present = np.isfinite(scores).all(axis=1)
    if rows is not None:
        present &= rows
    scores[~present] = 0.0
    count = int(present.sum())
    most = int(4.0 * (count / 100.0) ** (2.0 / 9.0))
    meat = scores.T @ scores
    for lag in range(1, min(most, output.size - 1) + 1):
        shifted = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (most + 1.0)) * (shifted + shifted.T)
    return np.asarray(factor @ meat @ factor * count / (count - model.orders.n_parameters))


def residuals(model: ArxModel, input_: Array, output: Array) -> Array:
    """Return e(k), the errors of predicting one sample ahead, shape (n_samples,); NaN where a row lacks samples."""
    return np.asarray(output - arx_regressors(input_, output, model.orders) @ model.parameters)


def simulate(model: ArxModel, input_: Array, output: Array) -> Array:
    """Simulate the output from the measured input alone.

    Parameters
    ----------
    input_, output : ndarray, shape (n_samples,)
        NaN for a lost sample. The record begins at rest; behind a gap of the input the measured output gives the
        state in which the simulation begins anew, and nothing else.

    Returns
    -------
    ndarray, shape (n_samples,)
        NaN where the input was lost, and until a state is known again behind that.
    """
    from scipy.signal import lfilter, lfiltic

    inputs, outputs = model.numerator.size - 1, model.orders.na
    simulated = np.full(input_.size, np.nan)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], np.isfinite(input_), [False]])))
    for start, stop in ends.reshape(-1, 2):
        first, past_u, past_y = int(start), np.zeros(inputs), np.zeros(outputs)
        if start > 0:
            first = max(start + inputs, outputs)
            while first < stop and not np.isfinite(output[first - outputs : first]).all():
                first += 1
            past_u, past_y = input_[first - inputs : first], output[first - outputs : first]
        if first >= stop:
            continue
        if inputs == outputs == 0:
            simulated[first:stop] = model.numerator[0] * input_[first:stop]
            continue
        state = lfiltic(model.numerator, model.denominator, past_y[::-1], past_u[::-1])
        simulated[first:stop] = lfilter(model.numerator, model.denominator, input_[first:stop], zi=state)[0]
    return simulated


def fit_percent(measured: Array, modelled: Array, rows: Flags) -> float:
    """Return ``100 (1 - ||y - y_model|| / ||y - mean(y)||)``, what MATLAB's ``compare`` prints as fit.

    Parameters
    ----------
    measured, modelled : ndarray, shape (n_samples,)
        Instants at which either is NaN do not count.
    rows : ndarray of bool, shape (n_samples,)
        Instants that count.

    Returns
    -------
    float
        100 for a perfect model, 0 for one no better than the mean, negative below that, without limit for an
        unstable one; NaN where the output does not vary.
    """
    present = np.isfinite(measured) & np.isfinite(modelled) & rows
    if not present.any():
        return math.nan
    y = measured[present]
    spread = float(np.linalg.norm(y - y.mean()))
    with np.errstate(over="ignore"):  # an unstable model may leave float64: it explains nothing
        left = float(np.linalg.norm(y - modelled[present]))
    return 100.0 * (1.0 - left / spread) if spread > 0 else math.nan
