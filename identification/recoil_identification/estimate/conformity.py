"""Conformity of a mass with its tolerance: what is known of the true value, the decision rule, and its one word.

JCGM 106:2012, "The role of measurement uncertainty in conformity assessment": what is known of a quantity after it was
measured is a distribution, and its share between the tolerance limits is the probability of conformity, section 7.
ILAC-G8:09/2019, "Guidelines on Decision Rules and Statements of Conformity": simple acceptance looks at the measured
value alone, 4.2.1; a guard band of the width w = U on both sides of a limit leaves between them what shows neither,
4.2.3. Which rule counts is agreed with the customer before (ISO/IEC 17025:2017, 7.1.3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from recoil_identification.estimate.budget import coverage_factor
from recoil_rigs.tables.issue import GUARD_BAND, SIMPLE, USUAL_RULE, DecisionRule, Issue
from recoil_rigs.tables.specification import Specification


class Word(StrEnum):
    """The word in which a statement of conformity ends."""

    CONFORMS = "conforms"
    DOES_NOT_CONFORM = "does not conform"
    NOT_SHOWN = "not shown"
    NOT_STATED = "not stated"


DECIDED = {Word.CONFORMS: True, Word.DOES_NOT_CONFORM: False}
"""Words that decide -> whether the mass conforms."""
NO_TOLERANCE = "no tolerance is stated"
"""Why no conformity is stated where nothing is agreed."""
NOT_VALID = "the result is not valid"
"""Why no conformity is stated of a result that is not to be relied on."""


@dataclass(frozen=True)
class Conformity:
    """A mass against its tolerance.

    Attributes
    ----------
    tolerance_kg
        Lower and upper limit about the specification, which are exact; one of them may be infinite.
    specification_kg
        Specification of the mass.
    deviation_kg
        Mass less the specification.
    u_kg
        Standard uncertainty of that deviation: of the mass, of what was added and of what goes along.
    degrees_of_freedom
        Degrees of freedom of `u_kg`; infinite for the normal distribution.
    rule
        Decision rule.
    U_per_u
        Expanded uncertainty that is reported, in standard ones; None for the quantile of Student's t.
    """

    tolerance_kg: tuple[float, float]
    specification_kg: float
    deviation_kg: float
    u_kg: float
    degrees_of_freedom: float = math.inf
    rule: DecisionRule = USUAL_RULE
    U_per_u: float | None = None

    @property
    def probability(self) -> float:
        """Probability that the true deviation lies within the tolerance; NaN without an uncertainty."""
        if not self.u_kg > 0:
            return math.nan
        low, high = (self._below((limit - self.deviation_kg) / self.u_kg) for limit in self.tolerance_kg)
        return high - low

    @property
    def guard_band_kg(self) -> float:
        """Width U of the guard band on both sides of a limit, of a coverage of 95 %."""
        by_quantile = self.U_per_u is None or not math.isfinite(self.U_per_u)
        factor = coverage_factor(max(self.degrees_of_freedom, 1.0)) if by_quantile else self.U_per_u
        return float(factor or 0.0) * self.u_kg

    @property
    def word(self) -> Word:
        """The word by the decision rule; nothing is stated without an uncertainty."""
        if math.isnan(self.probability):
            return Word.NOT_STATED
        if isinstance(self.rule, str):
            # by how much the nearer limit is kept; negative where it is not
            kept_kg = min(self.deviation_kg - self.tolerance_kg[0], self.tolerance_kg[1] - self.deviation_kg)
            needed_kg = 0.0 if self.rule == SIMPLE else self.guard_band_kg
            if kept_kg >= needed_kg:
                return Word.CONFORMS
            return Word.DOES_NOT_CONFORM if kept_kg < -needed_kg else Word.NOT_SHOWN
        if self.probability >= self.rule:
            return Word.CONFORMS
        return Word.DOES_NOT_CONFORM if self.probability <= 1.0 - self.rule else Word.NOT_SHOWN

    def _below(self, quantile: float) -> float:
        if math.isinf(quantile):
            return float(quantile > 0)
        if math.isinf(self.degrees_of_freedom):
            return 0.5 * math.erfc(-quantile / math.sqrt(2.0))
        from scipy.special import stdtr

        return float(stdtr(self.degrees_of_freedom, quantile))

    def to_json(self) -> dict[str, Any]:
        """Return it as reports have it; a side without a limit is infinite."""
        return {
            "word": self.word,
            "rule": self.rule,
            "probability": self.probability,
            "tolerance_kg": list(self.tolerance_kg),
            "limits_kg": [self.specification_kg + limit for limit in self.tolerance_kg],
            "guard_band_kg": self.guard_band_kg if self.rule == GUARD_BAND else None,
            "deviation_kg": self.deviation_kg,
            "u_kg": self.u_kg,
            "conforms": DECIDED.get(self.word),
        }


def conformity_of(
    tolerance_kg: tuple[float, float] | None,
    specification: Specification | None,
    mass_kg: float,
    u_kg: float,
    degrees_of_freedom: float = math.inf,
    rule: DecisionRule = USUAL_RULE,
    expanded_kg: float | None = None,
) -> Conformity | None:
    """Return the conformity of a mass; None where there is no tolerance or nothing that it is about.

    The uncertainty of the specification of m3 is not in it: the tolerance is about the mass that is specified.

    Parameters
    ----------
    expanded_kg
        Expanded uncertainty U of the mass as it is reported: a guard band is as wide, where nothing was added. None for
        that by Student's t.
    """
    if tolerance_kg is None or specification is None or not math.isfinite(mass_kg):
        return None
    u_all_kg = math.hypot(u_kg, specification.u_added_kg, specification.u_carried_kg)
    off_kg = mass_kg - specification.mass_kg
    per_u = None if expanded_kg is None or not u_kg > 0 else expanded_kg / u_kg
    return Conformity(tolerance_kg, specification.mass_kg, off_kg, u_all_kg, degrees_of_freedom, rule, per_u)


def stated_conformity(
    issued: Issue,
    specification: Specification | None,
    mass_kg: float,
    u_kg: float,
    degrees_of_freedom: float = math.inf,
    *,
    valid: bool,
    expanded_kg: float | None = None,
) -> dict[str, Any]:
    """State the conformity of a mass with what was agreed, as documents have it; of one that is not valid nothing.

    Parameters
    ----------
    issued
        Identity of the document, with tolerance and decision rule.
    valid
        Whether the mass may be relied on.
    expanded_kg
        Expanded uncertainty of the mass, as of `conformity_of`.
    """
    rule = USUAL_RULE if issued.decision_rule is None else issued.decision_rule
    found = conformity_of(issued.tolerance_kg, specification, mass_kg, u_kg, degrees_of_freedom, rule, expanded_kg)
    if found is None:
        return dict(UNSTATED)
    return found.to_json() if valid else {**found.to_json(), **UNSTATED, "rule": rule, "why": NOT_VALID}


UNSTATED: Mapping[str, Any] = MappingProxyType(
    {"word": Word.NOT_STATED, "rule": None, "probability": None, "conforms": None, "why": NO_TOLERANCE}
)
"""Statement of a conformity of which nothing is agreed."""
