"""The uncertainty budget of a mass after the GUM: contributions, effective degrees of freedom, coverage factor.

JCGM 100:2008, "Guide to the expression of uncertainty in measurement": the contributions are combined by
equation (10), the effective degrees of freedom by Welch and Satterthwaite's formula (G.2b), and the coverage
factor is the quantile of Student's t for them (G.3.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from recoil_identification.inference.unknown import Scope
from recoil_processing.noise import welch_satterthwaite
from recoil_processing.shot.error_source import ErrorSource, SourceGroup, SourceKind

COVERAGE_FACTOR = 1.959963984540054
"""97.5 % quantile of the normal distribution."""
COVERAGE = 0.95
"""Coverage probability of every interval."""
CHOICE_FACTORS = (0.7, 1.4)
"""Cut-offs and widths that a careful analyst might have chosen instead, as factors on the one chosen."""
MOST_DEGREES_OF_FREEDOM = 1e4
"""Degrees of freedom from which on Student's t is the normal distribution to five digits."""

Distribution = Literal["normal", "rectangular"]


@dataclass(frozen=True)
class BudgetRow:
    """One line of an uncertainty budget.

    Attributes
    ----------
    u_kg
        Contribution to the standard uncertainty of the mass.
    kind
        ``A`` by statistics of this shot, ``B`` by other knowledge (JCGM 100:2008, 4.2 and 4.3).
    sensitivity
        Change of the mass in kg if the source is off by one `sensitivity_per`; None where the mass does
        not depend on one figure.
    sensitivity_per
        ``1`` for a relative error of a scale, ``N`` for the friction, ``m/s^2`` for a zero.
    degrees_of_freedom
        Degrees of freedom of `u_kg`; infinite where it is taken as known.
    distribution
        ``normal`` or ``rectangular``.
    scope
        Reach of the source: every shot of a sensor, every shot of a rig, or this shot alone.
    """

    source: ErrorSource
    u_kg: float
    kind: str
    sensitivity: float | None = None
    sensitivity_per: str = "1"
    degrees_of_freedom: float = math.inf
    distribution: Distribution = "normal"
    scope: Scope = "shot"

    @property
    def group(self) -> SourceGroup:
        """Group of the source."""
        return self.source.group

    @property
    def u_source(self) -> float | None:
        """Standard uncertainty of the source itself, in `sensitivity_per`; None where there is no sensitivity."""
        return None if not self.sensitivity else self.u_kg / abs(self.sensitivity)


WHOLE_OF = {SourceKind.UNREAD_SHAPE: SourceKind.UNREAD_FORCE, SourceKind.BRIDGED_SHAPE: SourceKind.BRIDGED}
"""Kind of a shape -> kind of what has several shapes."""


def with_shapes_together(rows: Sequence[BudgetRow]) -> tuple[BudgetRow, ...]:
    """Put the shapes of one error together, last: the force that no gauge reads is one force, whatever its shape."""
    shapes: dict[ErrorSource, list[BudgetRow]] = {}
    for row in rows:
        if row.source.kind in WHOLE_OF:
            shapes.setdefault(ErrorSource(WHOLE_OF[row.source.kind], row.source.of), []).append(row)
    whole = [BudgetRow(source, combined_u(each), "B", scope=each[0].scope) for source, each in shapes.items()]
    return (*(row for row in rows if row.source.kind not in WHOLE_OF), *whole)


def combined_u(rows: Sequence[BudgetRow]) -> float:
    """Root sum of squares of independent contributions, kg."""
    return math.sqrt(math.fsum(row.u_kg**2 for row in rows))


def effective_degrees_of_freedom(rows: Sequence[BudgetRow]) -> float:
    """Degrees of freedom of the combined standard uncertainty, ``u^4 / sum(u_i^4 / nu_i)`` (G.2b); may be infinite."""
    return welch_satterthwaite((row.u_kg, row.degrees_of_freedom) for row in rows)


def coverage_factor(degrees_of_freedom: float) -> float:
    """Factor on a standard uncertainty for `COVERAGE`: a quantile of Student's t.

    Parameters
    ----------
    degrees_of_freedom
        Degrees of freedom, at least 1; infinite for the normal distribution.

    Raises
    ------
    ValueError
        If there is less than one.
    """
    if not degrees_of_freedom >= 1:
        raise ValueError(f"a coverage factor needs at least one degree of freedom, not {degrees_of_freedom}")
    if degrees_of_freedom > MOST_DEGREES_OF_FREEDOM:
        return COVERAGE_FACTOR
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 * (1 + COVERAGE)))
