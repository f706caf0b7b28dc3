"""Conformity of a mass with its tolerance: how probable it is that the true value lies inside.

JCGM 106:2012, "The role of measurement uncertainty in conformity assessment": what is known of a quantity after it was
measured is a distribution, and its share between the tolerance limits is the probability of conformity, section 7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from recoil_rigs.tables.specification import Specification

ENOUGH = 0.95
"""Probability from which on a mass is said to conform, and its complement for one that does not."""


@dataclass(frozen=True)
class Conformity:
    """A mass against its tolerance.

    Attributes
    ----------
    tolerance_kg
        Lower and upper limit about the specification, which are exact.
    specification_kg
        Specification of the mass.
    deviation_kg
        Mass less the specification.
    u_kg
        Standard uncertainty of that deviation: of the mass, of what was added and of what goes along.
    degrees_of_freedom
        Degrees of freedom of `u_kg`; infinite for the normal distribution.
    """

    tolerance_kg: tuple[float, float]
    specification_kg: float
    deviation_kg: float
    u_kg: float
    degrees_of_freedom: float = math.inf

    @property
    def probability(self) -> float:
        """Probability that the true deviation lies within the tolerance; NaN without an uncertainty."""
        if not self.u_kg > 0:
            return math.nan
        low, high = (self._below((limit - self.deviation_kg) / self.u_kg) for limit in self.tolerance_kg)
        return high - low

    @property
    def conforms(self) -> bool | None:
        """Whether the mass conforms, or does not, with a probability of `ENOUGH`; None where neither is shown."""
        if self.probability >= ENOUGH:
            return True
        return False if self.probability <= 1.0 - ENOUGH else None

    def _below(self, quantile: float) -> float:
        if math.isinf(self.degrees_of_freedom):
            return 0.5 * math.erfc(-quantile / math.sqrt(2.0))
        from scipy.special import stdtr

        return float(stdtr(self.degrees_of_freedom, quantile))

    def to_json(self) -> dict[str, Any]:
        """Return it as reports have it."""
        return {
            "tolerance_kg": list(self.tolerance_kg),
            "limits_kg": [self.specification_kg + limit for limit in self.tolerance_kg],
            "deviation_kg": self.deviation_kg,
            "u_kg": self.u_kg,
            "probability": self.probability,
            "enough": ENOUGH,
            "conforms": self.conforms,
        }


def conformity_of(
    tolerance_kg: tuple[float, float] | None,
    specification: Specification | None,
    mass_kg: float,
    u_kg: float,
    degrees_of_freedom: float = math.inf,
) -> Conformity | None:
    """Return the conformity of a mass; None where there is no tolerance or nothing that it is about.

    The uncertainty of the specification of m3 is not in it: the tolerance is about the mass that is specified.
    """
    if tolerance_kg is None or specification is None or not math.isfinite(mass_kg):
        return None
    u_all_kg = math.hypot(u_kg, specification.u_added_kg, specification.u_carried_kg)
    off_kg = mass_kg - specification.mass_kg
    return Conformity(tolerance_kg, specification.mass_kg, off_kg, u_all_kg, degrees_of_freedom)
