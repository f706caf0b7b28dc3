"""Errors that repeat themselves: autoregressive noise, and the uncertainty of sums of what is correlated.

The coefficients are Burg's (J. P. Burg, thesis, Stanford, 1975), so that the process is stable whatever the record; the
order has the least corrected information criterion (C. M. Hurvich and C.-L. Tsai, Biometrika 76, 1989).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

MOST_ORDER = 32
"""Four coefficients per mode of a dozen samples per period or less, and some for the chain's own filter."""
WANDERING = 1e-6
"""Difference of one and the sum of the coefficients, below which a process returns to no mean."""
SAMPLES_PER_COEFFICIENT = 10
"""Number of samples that one coefficient needs at least."""


@dataclass(frozen=True, eq=False)
class AutoregressiveNoise(ReadOnlyArrays):
    """A stationary process ``e_t = sum_k c_k e_(t-k) + w_t`` with white w.

    Attributes
    ----------
    predictors : ndarray, shape (order + 1, order)
        Row k holds the k coefficients of the best prediction from the k samples before, the nearest first.
    deviations : ndarray, shape (order + 1,)
        Standard deviation of the error of each prediction; that of the process first, that of w last.
    """

    predictors: Array
    deviations: Array

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return int(self.predictors.shape[1])

    @property
    def sigma(self) -> float:
        """Standard deviation of w."""
        return float(self.deviations[-1])

    @property
    def slow_density(self) -> float:
        """Spectral density at low frequency times the sampling rate: sigma^2 / (1 - sum c)^2.

        Of a process that only wanders, which has none, it is the variance of what was seen of it.
        """
        left = 1.0 - float(self.predictors[-1].sum())
        return float(self.deviations[0]) ** 2 if abs(left) < WANDERING else (self.sigma / left) ** 2


def few_samples_factor(samples: int, order: int) -> float:
    """Return the factor on an uncertainty that comes from an autoregressive spectrum of a short record.

    At frequency zero the spectrum's relative variance is 4 p / n (K. N. Berk, Ann. Statist. 2, 1974), that of n / (2 p)
    degrees of freedom; the standard deviation of the scaled and shifted t-distribution is by sqrt(nu / (nu - 2))
    larger (JCGM 101:2008, 6.4.9.4).
    """
    freedom = max(samples / (2.0 * max(order, 1)), 4.0)
    return math.sqrt(freedom / (freedom - 2.0))


def fit_noise(pieces: Sequence[Array], most_order: int = MOST_ORDER) -> AutoregressiveNoise:
    """Fit an autoregressive process by Burg's method; its order by the corrected information criterion of Akaike.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Consecutive samples of mean zero each, with gaps of any length between the pieces.
    most_order
        No more than every `SAMPLES_PER_COEFFICIENT`-th sample allows is tried.

    Raises
    ------
    ValueError
        If there is no sample, a sample is not finite, or the order is negative.
    """
    samples = sum(piece.size for piece in pieces)
    if samples == 0 or not all(np.all(np.isfinite(piece)) for piece in pieces):
        raise ValueError("there must be samples, and all must be finite")
    if most_order < 0:
        raise ValueError(f"most_order must not be negative, not {most_order}")
    highest = min(most_order, samples // SAMPLES_PER_COEFFICIENT, max(piece.size for piece in pieces) - 1)
    forward, backward = [piece.copy() for piece in pieces], [piece.copy() for piece in pieces]
    power = max(sum(float(piece @ piece) for piece in pieces) / samples, np.finfo(np.float64).tiny)
    table, powers = [np.zeros(0)], [power]
    for k in range(1, highest + 1):
        f, b = [piece[1:] for piece in forward], [piece[:-1] for piece in backward]
        energy = sum(float(x @ x + y @ y) for x, y in zip(f, b, strict=True))
        if energy <= 0 or powers[-1] <= 1e-12 * power:
            break
        reflection = 2.0 * sum(float(x @ y) for x, y in zip(f, b, strict=True)) / energy
        forward = [x - reflection * y for x, y in zip(f, b, strict=True)]
        backward = [y - reflection * x for x, y in zip(f, b, strict=True)]
        table.append(np.append(table[-1] - reflection * table[-1][::-1], reflection))
        powers.append(powers[-1] * max(1.0 - reflection**2, 1e-12))
        if sum(piece.size for piece in forward) <= SAMPLES_PER_COEFFICIENT * k:
            break
    orders = np.arange(len(powers))
    criterion = samples * np.log(powers) + 2.0 * (orders + 1) * samples / np.maximum(samples - orders - 2, 1)
    order = int(np.argmin(criterion))
    predictors = np.zeros((order + 1, order))
    for k in range(1, order + 1):
        predictors[k, :k] = table[k]
    return AutoregressiveNoise(predictors, np.sqrt(np.array(powers[: order + 1])))


def long_run_variance(scores: Sequence[Array], most_order: int = MOST_ORDER) -> float:
    """Variance of the sum of correlated scores, by the low end of an autoregressive spectrum.

    W. J. den Haan and A. Levin, Handbook of Statistics 15, 1997, chapter 12: parametric where the windows of other
    estimators are too short for waves that repeat.

    Parameters
    ----------
    scores : sequence of ndarray, shape (n_i,)
        Pieces; their mean is zero.
    """
    noise = fit_noise(scores, most_order)
    samples = sum(score.size for score in scores)
    return samples * noise.slow_density * few_samples_factor(samples, noise.order) ** 2
