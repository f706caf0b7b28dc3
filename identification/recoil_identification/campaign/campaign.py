"""Many shots of a rig as one answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from recoil_acquisition.remark import Note, Reason
from recoil_identification.calibration.suspicion import UNSTATED
from recoil_identification.campaign.advice import Advised
from recoil_identification.campaign.agreement import Agreement
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.changes import Change
from recoil_identification.campaign.charted import Charted
from recoil_identification.campaign.constancy import SharedConstancy
from recoil_identification.campaign.gauge_scales import GaugeScale
from recoil_identification.campaign.influence import Influence
from recoil_identification.campaign.joint_fit import JointFit
from recoil_identification.campaign.next_steps import NextStep, next_steps
from recoil_identification.campaign.peaks import PeakOfShots
from recoil_identification.campaign.suspects import SharedSuspicion
from recoil_identification.estimate.budget import BudgetRow, coverage_factor, effective_degrees_of_freedom
from recoil_identification.estimate.rounding import in_kg
from recoil_identification.inference.estimate import residual_against_none
from recoil_rigs.tables.specification import Specification


@dataclass(frozen=True)
class Estimated:
    """A mass, its standard uncertainty, and how well that is known.

    Attributes
    ----------
    degrees_of_freedom
        Degrees of freedom of `u_kg` by what is known beforehand, see `known_to`.
    """

    mass_kg: float
    u_kg: float
    degrees_of_freedom: float = math.inf

    @property
    def coverage_factor(self) -> float:
        """Factor on the standard uncertainty for the 95 % interval."""
        return coverage_factor(max(self.degrees_of_freedom, 1.0))

    @property
    def expanded_kg(self) -> float:
        """Half the width of the 95 % interval."""
        return self.coverage_factor * self.u_kg

    @property
    def interval_kg(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.mass_kg - self.expanded_kg, self.mass_kg + self.expanded_kg


def known_to(budget: Sequence[BudgetRow]) -> float:
    """Return the degrees of freedom by which a mass of many shots has its coverage factor; may be infinite.

    They are those of what is known beforehand alone: its u is averaged over all scatters that the shots allow, and has
    in it already that few shots hardly tell how much they scatter.
    """
    return effective_degrees_of_freedom(
        [replace(row, degrees_of_freedom=math.inf) if row.kind == "A" else row for row in budget]
    )


@dataclass(frozen=True)
class Learnt:
    """An influence that the shots of a campaign share, as they tell it, or the size of the force that no gauge reads.

    Attributes
    ----------
    value, u
        Error of the influence, in its unit, and the standard uncertainty that is left of it.
    normalised_residual
        Normalised residual of what was known before.
    moves_kg
        Change of the mass, if that had not been known.
    """

    influence: Influence
    value: float
    u: float
    normalised_residual: float
    moves_kg: float = 0.0

    @property
    def judged_residual(self) -> float:
        """Normalised residual, or against no delay at all for what can only be late and is found early."""
        w = self.normalised_residual
        early = w < 0 and self.influence.source.is_late_alone
        return residual_against_none(w, self.value / self.influence.u) if early else w

    @property
    def alone(self) -> float:
        """Error that all else says it has, as if nothing had been known of it, in the standard uncertainties stated.

        With x the error in them, v its variance and ``w = x / sqrt(1 - v)`` the normalised residual it is
        ``x / (1 - v) = w^2 / x``.
        """
        return self.normalised_residual**2 * self.influence.u / self.value if self.value else 0.0


@dataclass(frozen=True)
class UnreadForce:
    """Size of the force of unknown shape that no gauge reads: the same in all shots of a rig.

    Attributes
    ----------
    identity
        Name in campaigns.
    stated
        Size that the rig states: standard uncertainty as a share of the peak resistance.
    sizes, weights
        Sizes that were tried, and the probability of each.
    """

    identity: str
    stated: float
    sizes: tuple[float, ...]
    weights: tuple[float, ...]

    @property
    def u(self) -> float:
        """Standard uncertainty of the force now, share of the peak resistance: root mean square of the sizes."""
        return math.sqrt(math.fsum(w * size**2 for size, w in zip(self.sizes, self.weights, strict=True)))


@dataclass(frozen=True)
class Used:
    """A shot of the campaign.

    Attributes
    ----------
    excluded
        Reason why it was set aside; None if it was used.
    own_mass_kg, own_u_kg
        Mass by the shot's own readings, with what was added, if all that the shots share is as the campaign found it,
        and the standard uncertainty of that; None if it was set aside.
    joint_kg
        Mass of the shot by the campaign, with what was added; None if it was set aside.
    normalised_residual
        Distance of its mass from what all others say, over the standard deviation of that; None if it was set aside.
    """

    shot: CampaignShot
    excluded: str | None
    own_mass_kg: float | None = None
    own_u_kg: float | None = None
    joint_kg: float | None = None
    normalised_residual: float | None = None


@dataclass(frozen=True)
class Mechanism:
    """Configurations that are one mechanism, whatever was weighed and added to it.

    Attributes
    ----------
    name
        Name of the first of its configurations.
    mass
        Mass without what was added.
    difference
        Difference from the campaign's first mechanism; None for that one.
    """

    name: str
    shots: tuple[str, ...]
    mass: Estimated
    difference: Estimated | None


@dataclass(frozen=True, eq=False)
class Campaign:
    """The joint result of all shots.

    Attributes
    ----------
    shots
        Shots in the order in which they were fired.
    mechanisms
        The one that was fired first comes first; the others have other parts.
    common
        Knowledge of each influence that the shots share, but for the shapes of the force that no gauge reads.
    gauges
        Scale of each gauge in the shots.
    unread_force
        Size of that force; None where the shots state none.
    constancy
        Test whether the mass changes within the shots, in each alike; None where their summaries do not tell.
    agreement
        Misfit of each shot's own rows, and that between the shots.
    gain_scatter, friction_scatter
        Mean and 95 % bounds of the standard deviations by which gains and friction do not repeat, relative.
    changes
        Changes that nobody declared, the likeliest first.
    charts
        Charts of the residuals, of each quantity and of each sensor; what they show says nothing against the mass.
    peaks
        Quantities of the shots that were used, by how these were fired.
    cutoff_hz
        Cut-off of all shots' rows; None where they have passed no low-pass.
    reasons
        Reasons why the mass is not valid; empty if it is.
    notes
        Facts that a reader should know although it does not make the mass invalid.
    fit
        Fit that all of it comes from; with an unknown for what no rig states, where the shots show that.
    plain
        Fit without it, which the mass is averaged from.
    suspicion
        Shapes that no rig states, as all shots see them; None where their summaries do not tell.
    """

    rig: str
    shots: tuple[Used, ...]
    mechanisms: tuple[Mechanism, ...]
    common: tuple[Learnt, ...]
    gauges: tuple[GaugeScale, ...]
    unread_force: UnreadForce | None
    constancy: SharedConstancy | None
    agreement: Agreement
    gain_scatter: tuple[float, float, float]
    friction_scatter: tuple[float, float, float]
    changes: tuple[Change, ...]
    charts: tuple[Charted, ...]
    peaks: tuple[PeakOfShots, ...]
    cutoff_hz: float | None
    reasons: tuple[Reason, ...]
    notes: tuple[Note, ...]
    fit: JointFit
    plain: JointFit
    suspicion: SharedSuspicion | None = None

    @property
    def mass(self) -> Estimated:
        """Mass of the mechanism that was fired first, without what was added to it."""
        return self.mechanisms[0].mass

    @cached_property
    def budget(self) -> tuple[BudgetRow, ...]:
        """Contributions to the standard uncertainty of that mass; their root sum of squares is it."""
        rows = self.plain.budget(self.mechanisms[0].name)
        if self.suspicion is None:
            return rows
        _, variance_rel = self.suspicion.moved(0)
        u_kg = self.plain.mass_kg(self.mechanisms[0].name)[0] * math.sqrt(variance_rel)
        return (*rows, BudgetRow(UNSTATED, u_kg, "B", scope="rig"))

    @property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom of its standard uncertainty, see `known_to`."""
        return self.mass.degrees_of_freedom

    @cached_property
    def next_steps(self) -> Advised[NextStep]:
        """Measures that would lower the uncertainty of the mass, the most effective first."""
        return next_steps(self.fit)

    @property
    def u_between_shots_kg(self) -> float:
        """Standard deviation from shot to shot that is expected of the masses, root mean square."""
        own = [shot.own_u_kg for shot in self.shots if shot.own_u_kg is not None]
        return math.sqrt(math.fsum(u**2 for u in own) / len(own))

    @property
    def specification(self) -> Specification | None:
        """Specification of that mechanism without what was added; None where its shots' reports state none, or several.

        It does not enter the mass.
        """
        stated = specifications(self.mechanisms[0], self.shots)
        if len({one.mass_kg for one in stated}) != 1:
            return None
        return max(stated, key=lambda one: one.u_kg)

    @property
    def normalised_error(self) -> float:
        """E_n against it, see `recoil_rigs.tables.specification.Specification.normalised_error`; NaN without one."""
        if self.specification is None:
            return math.nan
        return self.specification.normalised_error(self.mass.mass_kg, self.mass.u_kg)

    @property
    def valid(self) -> bool:
        """True if nothing speaks against the mass."""
        return not self.reasons

    def __str__(self) -> str:
        used = sum(shot.excluded is None for shot in self.shots)
        verdict = "valid" if self.valid else "not valid: " + "; ".join(self.reasons)
        return f"{in_kg(self.mass.mass_kg, self.mass.u_kg)}, from {used} of {len(self.shots)} shots, {verdict}"


def specifications(mechanism: Mechanism, shots: Sequence[Used]) -> list[Specification]:
    """Return what the reports of a mechanism's shots compare with, nothing added; empty if one says nothing."""
    found = []
    for one in (used.shot for used in shots if used.shot.name in mechanism.shots and used.excluded is None):
        if one.specification is None:
            return []
        found.append(one.specification)
    return found
