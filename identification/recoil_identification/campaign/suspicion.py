"""How likely it is that what was stated is off by far more than its uncertainty.

What was stated may be wrong altogether, but the less likely the further it lies beyond its stated uncertainty u. Its
error has the density of Student's t of scale u, whose tails are wide: with one degree of freedom, Cauchy's (H.
Jeffreys, Theory of Probability, 3rd edition 1961, section 5.2), what a hand wrote into a log, a slip of the pen; with
three what a laboratory certified. Of an error that the shots find as c with the standard uncertainty s, where they gain
g of log likelihood by it, the logarithm of the Bayes factor is, by Laplace's approximation,

    g + ln(sqrt(2 pi) s p(c))

Two suspects that explain the same differ by what was stated of them: 9 kg of a mass that was weighed to 0.05 kg are
less likely than 3 % of a gauge that is calibrated to 0.5 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

WRITTEN, CERTIFIED = 1.0, 3.0
"""Degrees of freedom of the error of what a hand wrote, and of what was certified."""


@dataclass(frozen=True)
class Suspicion:
    """Error that something stated would have.

    Attributes
    ----------
    gain
        Amount by which it raises the log likelihood.
    size, u
        Error and its standard uncertainty, if nothing had been stated; u may be infinite.
    stated_u
        Standard uncertainty that was stated, not zero.
    degrees_of_freedom
        Degrees of freedom of its density beforehand.
    """

    gain: float
    size: float
    u: float
    stated_u: float
    degrees_of_freedom: float

    @classmethod
    def of_prior(
        cls, value: float, u: float, stated_u: float, normalised_residual: float, degrees_of_freedom: float
    ) -> Suspicion:
        """Take away what was stated of an error, which an estimate has as `value` with the standard uncertainty `u`."""
        told = 1.0 - min((u / stated_u) ** 2, 1.0)
        if told == 0.0:  # nothing else tells of it
            return cls(0.0, 0.0, math.inf, stated_u, degrees_of_freedom)
        gain = 0.5 * normalised_residual**2
        return cls(gain, value / told, u / math.sqrt(told), stated_u, degrees_of_freedom)

    @property
    def log_odds(self) -> float:
        """Logarithm of the Bayes factor for it."""
        if math.isinf(self.u):
            return 0.0
        n = self.degrees_of_freedom
        density = math.lgamma(0.5 * (n + 1.0)) - math.lgamma(0.5 * n) - 0.5 * math.log(n * math.pi)
        density -= 0.5 * (n + 1.0) * math.log1p((self.size / self.stated_u) ** 2 / n)
        return self.gain + math.log(math.sqrt(2.0 * math.pi) * self.u / self.stated_u) + density
