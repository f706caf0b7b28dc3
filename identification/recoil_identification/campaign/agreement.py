"""Whether shots agree: what each leaves of its own rows, and what is left between them.

These are two questions. The rows of a shot's summary that are about nothing but changes of the mass within it are
moved by nothing that shots share: what is left of them tells whether the noise of this shot is what its rows say. It is
no contradiction; where it is too much to be chance the shot's rows weigh less, by R. T. Birge's ratio (Phys. Rev. 40,
1932), and its random part grows. What is left of all other rows, once everything that shots share is estimated, and of
what was known beforehand, tells whether the shots differ from one another by more than their own errors; which of them
does is told by how much less is left without it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.campaign.constancy import CHANGES, beside_shared_change
from recoil_identification.campaign.joint_fit import JointFit, Trial, by_the_weight, joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows
from recoil_identification.estimate.rounding import in_kg

LEAST_OWN = 1e-3
"""Probability of what a shot leaves of its own rows, below which it is no chance that it is so much."""
LEAST_PROBABILITY = 1e-4
"""Probability of a misfit as large as what is left between shots, below which something is wrong that no column
explains."""
MOST_UNEXPLAINED = 1.5
"""Birge's ratio between shots of which none lies apart, beyond which they are not only noisier than stated."""
LEAST_SINGULAR = 1e-9
"""Singular value of a shot's rows over the largest, below which they say nothing in a direction."""
FEWEST = 3
"""Shots of which one can differ from the others."""


@dataclass(frozen=True)
class Misfit:
    """Weighted sum of squares of what is left of rows.

    Attributes
    ----------
    size
        Chi-square of rows whose errors are as stated.
    degrees_of_freedom
        Mean of such a chi-square.
    """

    size: float
    degrees_of_freedom: int

    @property
    def probability(self) -> float:
        """Probability of a misfit as large by chance; 1 where nothing is judged."""
        # scipy.stats has it too, but takes half a second to import
        from scipy.special import chdtrc

        return float(chdtrc(self.degrees_of_freedom, self.size)) if self.degrees_of_freedom > 0 else 1.0

    @property
    def birge_ratio(self) -> float:
        """Factor by which the errors are larger than stated, as the rows have it."""
        return math.sqrt(self.size / self.degrees_of_freedom) if self.degrees_of_freedom > 0 else 1.0


@dataclass(frozen=True)
class Apart:
    """A shot that does not agree with the others.

    Attributes
    ----------
    misfit
        Part of what is left between shots that goes with it.
    mass_kg, u_kg
        Mass of the first mechanism without the shot, and its standard uncertainty.
    """

    shot: str
    misfit: Misfit
    mass_kg: float
    u_kg: float


@dataclass(frozen=True)
class Agreement:
    """Whether the shots of a campaign agree.

    Attributes
    ----------
    own
        Misfit of its own rows by shot; none of shots whose summaries tell of no change.
    between
        Misfit between the shots.
    apart
        Shots that differ from the others, the most first; none where the shots agree.
    """

    own: tuple[tuple[str, Misfit], ...]
    between: Misfit
    apart: tuple[Apart, ...] = ()

    @property
    def noisy(self) -> dict[str, float]:
        """Shots whose own errors are larger than stated, and by which factor."""
        return {name: one.birge_ratio for name, one in self.own if one.probability < LEAST_OWN}

    @property
    def unexplained(self) -> float:
        """Factor by which the errors of all shots are larger than stated, where they disagree and none lies apart."""
        disagree = self.between.probability < LEAST_PROBABILITY and not self.apart
        return self.between.birge_ratio if disagree else 1.0

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Reason against one mass for all: shots that lie apart, the farthest first, or that all disagree."""
        if not self.apart and self.unexplained <= MOST_UNEXPLAINED:
            return ()
        if not self.apart:
            text = (
                f"the shots do not agree: what is left between them is {self.unexplained:.2g} times of what their "
                f"noise allows (limit {MOST_UNEXPLAINED:g}; probability {self.between.probability:.1g}), and no shot "
                "alone is the cause: check the shot log's masses, and what changed at the stand"
            )
            return (Reason(ReasonCode.AGREEMENT, "shots", text),)
        one, others = self.apart[0], ", ".join(other.shot for other in self.apart[1:])
        text = (
            f"shot {one.shot} does not agree with the others: a misfit of {one.misfit.size:.0f} with "
            f"{one.misfit.degrees_of_freedom} degrees of freedom goes with it (probability "
            f"{one.misfit.probability:.1g}); without it the mass is {in_kg(one.mass_kg, one.u_kg)}"
            + (f"; nor do {others}" if others else "")
            + ": check its row of the shot log, and its report"
        )
        return (Reason(ReasonCode.AGREEMENT, one.shot, text),)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes on shots that are noisier than their rows say."""
        found = [
            Note(
                NoteCode.AGREEMENT,
                name,
                f"shot {name} leaves {factor:.2g} times of its own rows what its noise allows (probability "
                f"{dict(self.own)[name].probability:.1g}): its random part is taken as that much larger",
            )
            for name, factor in self.noisy.items()
        ]
        if 1.0 < self.unexplained <= MOST_UNEXPLAINED:
            text = (
                f"between the shots {self.unexplained:.2g} times of what their noise allows is left (probability "
                f"{self.between.probability:.1g}), and no shot lies apart: the random part of all is taken as that "
                "much larger"
            )
            found.append(Note(NoteCode.AGREEMENT, None, text))
        return tuple(found)

    def __str__(self) -> str:
        agree = self.between.probability >= LEAST_PROBABILITY
        said = "agree with each other" if agree else "differ from each other by more than their noise allows"
        between = f"The shots {said} (probability {_percent(self.between.probability)})"
        if not self.own:
            return f"{between}."
        name, most = min(self.own, key=lambda one: one[1].probability)
        as_it_says = "each is as noisy as it says, shot" if not self.noisy else "not each is as noisy as it says, shot"
        return f"{between}; {as_it_says} {name} least (probability {_percent(most.probability)})."


def _percent(probability: float) -> str:
    if probability < LEAST_PROBABILITY:
        return f"{probability:.1g}"
    # two digits of what is nearly sure are three
    return f"{min(100 * probability, 99.0):.2g} %" if probability < 1.0 else "100 %"


def agreement_of(fit: JointFit) -> Agreement:
    """Judge whether the shots of a joint fit agree."""
    between = _between(fit.rows, fit.likeliest)
    apart = _apart(fit, between) if between.probability < LEAST_PROBABILITY else ()
    return Agreement(_own(fit), between, apart)


def weighed(rows: JointRows, agreement: Agreement) -> JointRows:
    """Let the rows of shots weigh less whose own errors are larger than stated."""
    factors = np.array([agreement.noisy.get(shot.name, 1.0) for shot in rows.shots]) * agreement.unexplained
    if np.all(factors == 1.0):
        return rows
    triangle, seen = rows.triangle / factors[:, np.newaxis, np.newaxis], rows.seen / factors[:, np.newaxis]
    return replace(rows, triangle=triangle, seen=seen, divided={})


def _own(fit: JointFit) -> tuple[tuple[str, Misfit], ...]:
    """Return what each shot leaves of the rows that are about changes of its mass, with what all share taken off."""
    rows, beside = fit.rows, beside_shared_change(fit)
    if beside is None:
        return ()
    at = _asked(rows)
    found = []
    for shot, left, triangle in zip(rows.shots, beside.left[:, at], rows.triangle[:, at][:, :, at], strict=True):
        judged = _told(triangle)
        found.append((shot.name, Misfit(float(np.sum((left @ judged) ** 2)), judged.shape[1])))
    return tuple(found)


def _between(rows: JointRows, trial: Trial) -> Misfit:
    """Return what is left of all rows but those about changes, and of what was known beforehand."""
    best, shared, own = trial.estimate, _shared(rows), _asked(rows)
    misfit, told = best.misfit - float(np.sum(rows.seen[:, own] ** 2)), 0
    for seen, triangle in zip(rows.seen[:, shared], rows.triangle[:, shared][:, :, shared], strict=True):
        judged = _told(triangle)
        told += judged.shape[1]
        # what stands where rows say nothing is of their errors alone, and another with every rounding
        misfit -= float(seen @ seen) - float(np.sum((seen @ judged) ** 2))
    return Misfit(max(misfit, 0.0), told + len(best.sources) - len(best.unknowns))


def _apart(fit: JointFit, between: Misfit) -> tuple[Apart, ...]:
    """Name the shots without which much less is left than chance allows."""
    rows, best, found = fit.rows, fit.likeliest, []
    for number, shot in enumerate(rows.shots):
        others = rows.without(number) if len(rows.shots) >= FEWEST else None
        if others is None:
            continue
        without = joint_fit_under(others, best.scatter)
        alike = next(one for one in without.trials if one.force == best.force)
        left = _between(others, alike)
        gone = Misfit(max(between.size - left.size, 0.0), between.degrees_of_freedom - left.degrees_of_freedom)
        if gone.probability * len(rows.shots) < LEAST_OWN:
            told = by_the_weight(without, lambda of: joint_fit_under(of, best.scatter))
            found.append(Apart(shot.name, gone, *told.mass_kg(rows.mechanisms[0])))
    return tuple(sorted(found, key=lambda one: one.misfit.probability))


def _asked(rows: JointRows) -> list[int]:
    """Return the places of the rows that are about what shots are only asked for: changes of the mass, and suspects."""
    return [at for at, name in enumerate(rows.parameters) if name in CHANGES or name in rows.suspected]


def _shared(rows: JointRows) -> list[int]:
    """Return the places of all other rows."""
    return [*set(range(len(rows.parameters))) - set(_asked(rows))]


def _told(triangle: Array) -> Array:
    """Return the directions in which rows say something, shape (n_rows, n_directions)."""
    directions, sizes, _ = np.linalg.svd(triangle)
    return np.asarray(directions[:, sizes > LEAST_SINGULAR * max(float(sizes.max(initial=0.0)), 1e-300)])
