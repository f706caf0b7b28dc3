"""Averages over hypotheses that add one effect to an estimate, without a new fit.

An estimate without any of the effects stands against one with each of them. With z the normalised score of an effect,
I the information on its size and s the standard deviation of the size if there is one, the size is found as

    z sqrt(I) / (I + 1 / s^2)    with the variance    1 / (I + 1 / s^2)

and what a size of one moves, the estimate moves by it. What is reported is the mean over all hypotheses, each as
likely as the rows make it, and the variance within and between them (J. A. Hoeting et al., Bayesian Model Averaging:
A Tutorial, Statistical Science 14(4), 1999). Of an effect that has one sign the size is half-normal beforehand, and
normal cut off at zero afterwards (N. L. Johnson et al., Continuous Univariate Distributions 1, 1994, section 10.1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.score import Scores


@dataclass(frozen=True, eq=False)
class Hypotheses(ReadOnlyArrays):
    """Effects of which one may be there, or none.

    Attributes
    ----------
    kinds : ndarray of int, shape (n,)
        Number of the kind that each is a variant of.
    ln_bayes_factors : ndarray, shape (n,)
        Logarithm of the odds of each against none; minus infinity where it is not identifiable.
    sizes, variances : ndarray, shape (n,)
        Mean and variance of its size if it is there.
    """

    kinds: NDArray[np.intp]
    ln_bayes_factors: Array
    sizes: Array
    variances: Array

    @classmethod
    def of(cls, scores: Scores, kinds: NDArray[np.intp], sd: Array, one_sided: Flags) -> Hypotheses:
        """Ask what an estimate leaves for each effect.

        Parameters
        ----------
        scores
            Scores of the effects' columns.
        kinds : ndarray of int, shape (n,)
        sd : ndarray, shape (n,)
            Standard deviation of each size if it is there.
        one_sided : ndarray of bool, shape (n,)
            Whether a size cannot be negative.
        """
        from scipy.special import log_ndtr

        precision = scores.information + sd**-2.0
        means, u = scores.normalised * np.sqrt(scores.information) / precision, 1.0 / np.sqrt(precision)
        at = means / u
        ln_share = log_ndtr(at)
        hazard = np.exp(-0.5 * at**2 - 0.5 * math.log(2.0 * math.pi) - ln_share)
        factors = scores.ln_bayes_factors(sd) + np.where(one_sided, ln_share + math.log(2.0), 0.0)
        return cls(
            kinds,
            np.where(scores.identifiable, factors, -np.inf),
            np.where(one_sided, means + u * hazard, means),
            np.where(one_sided, np.maximum(1.0 - at * hazard - hazard**2, 0.0), 1.0) * u**2,
        )

    @property
    def _ln_prior(self) -> Array:
        """Logarithm of the probability of each beforehand, if one is there: all kinds alike, and all of a kind."""
        of_kind = np.bincount(self.kinds)
        return np.asarray(-np.log(of_kind[self.kinds]) - math.log(np.count_nonzero(of_kind)))

    @property
    def ln_bayes_factor(self) -> float:
        """Logarithm of the odds of any of them against none."""
        return float(np.logaddexp.reduce(self.ln_bayes_factors + self._ln_prior))

    @property
    def weights(self) -> Array:
        """Probability of each, where one of them was as likely beforehand as none; shape (n,)."""
        whole = np.logaddexp(0.0, self.ln_bayes_factor)
        return np.asarray(np.exp(self.ln_bayes_factors + self._ln_prior - whole))

    def moved(self, by: Array) -> tuple[float, float]:
        """Return by how much an estimate moves on the mean over all of them and none, and the variance that it gains.

        Parameters
        ----------
        by : ndarray, shape (n,)
            Amount by which a size of one moves it.
        """
        weights, moves = self.weights, by * self.sizes
        mean = float(weights @ moves)
        within = float(weights @ (by**2 * self.variances))
        return mean, within + float(weights @ moves**2) - mean**2
