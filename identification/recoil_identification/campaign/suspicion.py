"""How likely it is that what was stated is off by far more than its uncertainty.

A slip of the pen, a gauge that was dropped: what was stated may be wrong altogether, but the less likely the further it
lies beyond its stated uncertainty u. Its error has the density of a Cauchy distribution of scale u, whose tails are wide
(H. Jeffreys, Theory of Probability, 3rd edition 1961, section 5.2), so that of an error that the shots find as c with
the standard uncertainty s, where they gain g of log likelihood by it,

    ln of the Bayes factor = g + ln(sqrt(2 pi) s / (pi u (1 + (c / u)^2)))

by Laplace's approximation. Two suspects that explain the same differ by what was stated of them: 9 kg of a mass that
was weighed to 0.05 kg are less likely than 3 % of a gauge that is calibrated to 0.5 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Suspicion:
    """Error that something stated would have.

    Attributes
    ----------
    gain
        Amount by which it raises the log likelihood.
    size, u
        Error and its standard uncertainty, if nothing had been stated.
    stated_u
        Standard uncertainty that was stated, not zero.
    """

    gain: float
    size: float
    u: float
    stated_u: float

    @classmethod
    def of_prior(cls, value: float, u: float, stated_u: float, normalised_residual: float) -> Suspicion:
        """Take away what was stated of an error, which an estimate has as `value` with the standard uncertainty `u`."""
        told = 1.0 - min((u / stated_u) ** 2, 1.0)
        if told == 0.0:  # nothing else tells of it
            return cls(0.0, 0.0, math.inf, stated_u)
        return cls(0.5 * normalised_residual**2, value / told, u / math.sqrt(told), stated_u)

    @property
    def in_stated(self) -> float:
        """Its size in the standard uncertainty that was stated."""
        return self.size / self.stated_u

    @property
    def log_odds(self) -> float:
        """Logarithm of the Bayes factor for it."""
        if math.isinf(self.u):
            return 0.0
        return self.gain + math.log(math.sqrt(2.0 / math.pi) * (self.u / self.stated_u) / (1.0 + self.in_stated**2))
