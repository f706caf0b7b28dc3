"""Shapes that nobody stated: whether one of them explains a shot, which, and what all of them do to the mass.

A bent gauge, one that sits ahead of the breech face, a muzzle brake and a tube that swings are there while the breech
drives, as the effect of a mass would be that changes early; and of a gauge or a clock they ask for the impossible. A
part that hangs elastically is felt late, and an amplifier that droops reads less and less. None is an unknown until a
rig states it. So each is asked for by what the estimate leaves (score test, see
`recoil_identification.calibration.mass_over_time`), and is suspected where it is far likelier than that nothing is.
Below that the mass is the mean over all of them and none, each as likely as the shot makes it
(`recoil_identification.inference.averaging`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import as_if_known
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.estimate.monte_carlo import Draw
from recoil_identification.inference.averaging import Hypotheses
from recoil_identification.inference.change_odds import LEAST_FACTOR
from recoil_identification.rows.equation_of_motion import MASS
from recoil_identification.rows.suspects import SUSPECTED_HZ, Suspect, columns_of
from recoil_processing.shot.error_source import ErrorSource, SourceKind

LITTLE = 0.8
"""Change of the mass by what nobody stated, in its standard uncertainties, which its interval holds."""
AS_WELL = 2.0
"""Logarithm of the Bayes factor by which another shape may lie below the likeliest and explains the shot as well."""
UNSTATED = ErrorSource(SourceKind.UNSTATED)
"""Source of the budget row of all shapes together."""


@dataclass(frozen=True, eq=False)
class ShotSuspicion(ReadOnlyArrays):
    """The shapes that a rig does not state, as a shot sees them.

    Attributes
    ----------
    source, variant
        Source that explains the shot best, and what was taken of what nobody stated, in words.
    normalised
        Rest of the shape that the estimate leaves, over its standard deviation.
    size, u_size, u_expected
        Size of it that would explain the shot, its standard uncertainty, and the standard deviation that it was
        expected to have; shares, of the tube of what one has that swings at `SUSPECTED_HZ`.
    ln_bayes_factor
        Logarithm of the odds of any of the shapes against none that the shot adds.
    others
        Shapes that explain it nearly as well.
    moves_rel
        Change of the mass by the likeliest, relative.
    spread_rel
        Root mean square of the changes by all shapes, relative, each as likely as the shot says.
    hypotheses
        All shapes.
    by : ndarray, shape (n_shapes,)
        Amount by which the mass's logarithm moves for a size of one of each.
    explained
        Everything else if the likeliest is there; the estimate that was tested where nothing is suspected.
    """

    source: ErrorSource
    variant: str
    normalised: float
    size: float
    u_size: float
    u_expected: float
    ln_bayes_factor: float
    others: tuple[ErrorSource, ...]
    moves_rel: float
    spread_rel: float
    hypotheses: Hypotheses
    by: Array
    explained: Calibration

    @property
    def suspected(self) -> bool:
        """Whether it is far likelier that one of the shapes is there than that none is."""
        return self.ln_bayes_factor > LEAST_FACTOR

    @property
    def gain(self) -> float:
        """By how much it raises the largest log likelihood, what several shapes find by chance taken off."""
        return 0.5 * as_if_known(self.normalised) ** 2

    @property
    def off(self) -> float:
        """Size of it in the standard deviations that it was expected to have."""
        return abs(self.size) / self.u_expected

    @property
    def swings_hz(self) -> float:
        """Frequency at which a tube would swing, or a bracket under the accelerometer, whose size is negative; NaN."""
        if self.source.kind is not SourceKind.TUBE:
            return math.nan
        return SUSPECTED_HZ / math.sqrt(self.size if self.size > 0 else -2.0 * self.size)

    def averaged(self, estimate: MassEstimate) -> MassEstimate:
        """Return the mean of a mass over all shapes and none, with a row of the budget for what they leave open."""
        mean_rel, variance_rel = self.hypotheses.moved(self.by)
        mass_kg = estimate.mass_kg * (1.0 + mean_rel)
        row = BudgetRow(UNSTATED, mass_kg * math.sqrt(variance_rel), "B", scope="rig")
        return replace(estimate, mass_kg=mass_kg, budget=(*estimate.budget, row))

    def draws(self, draw: Draw) -> Draw:
        """Return what draws masses of all shapes and none, of what draws them of none."""
        weights = self.hypotheses.weights

        def drawn(rng: np.random.Generator, count: int) -> Array:
            masses = draw(rng, count)
            which = rng.choice(weights.size + 1, count, p=[*weights, max(1.0 - weights.sum(), 0.0)])
            sizes = np.append(self.hypotheses.sizes, 0.0)[which]
            sizes = sizes + np.append(np.sqrt(self.hypotheses.variances), 0.0)[which] * rng.standard_normal(count)
            return np.asarray(masses * (1.0 + np.append(self.by, 0.0)[which] * sizes))

        return drawn

    def __str__(self) -> str:
        odds = f"ln of the Bayes factor {self.ln_bayes_factor:+.1f}, limit {LEAST_FACTOR:g}"
        if not self.suspected:
            return f"Nothing of the breech chain, a muzzle brake, the tube and their like can be told ({odds})."
        others = f", {' and '.join(self.others)} nearly as well" if self.others else ""
        what, remedy = described(self.source, self.variant, self.size, self.u_size)
        return (
            f"The breech chain, a muzzle brake, the tube or their like; or the mass ({odds}): {what} explains the shot "
            f"best{others}; the mass would move by {100 * self.moves_rel:+.2g} %; {remedy}."
        )


def described(source: ErrorSource, variant: str, size: float, u_size: float) -> tuple[str, str]:
    """Say what a shape of a size is, and what to do about it.

    Parameters
    ----------
    variant
        Value that was taken of what nobody stated, in words.
    """
    kind, stiff = source.kind, size < 0
    if kind is SourceKind.TUBE:
        what, swings_hz = ("a bracket under the accelerometer", -2.0 * size) if stiff else (_TUBE, size)
        remedy = "stiffen what carries the accelerometer" if stiff else _REMEDIES[kind]
        return f"{what}, at some {SUSPECTED_HZ / math.sqrt(swings_hz):.2g} Hz,", remedy
    if kind is SourceKind.TIME_CONSTANT:
        what = f"an amplifier of {source.of} with a time constant of {1.0 / size:.2g} s"
        return what, _REMEDIES[kind].format(of=source.of)
    if kind is SourceKind.BREAKAWAY:
        return f"friction that breaks away, {size:.2g} N (u {u_size:.1g} N) more below {variant},", _REMEDIES[kind]
    of = _OF[kind].format(variant=variant)
    return f"{_SHAPES[kind]}, {100.0 * size:.2g} % (u {100.0 * u_size:.1g} %) {of},", _REMEDIES[kind]


_TUBE = "a tube that swings along its axis"
_SHAPES = {
    SourceKind.LINEARITY: "a breech gauge whose line is bent",
    SourceKind.GAUGE_AHEAD: "a breech gauge ahead of the breech face",
    SourceKind.MUZZLE_BRAKE: "a muzzle brake",
    SourceKind.HANGING_PART: "a part that hangs elastically",
}
_OF = {
    SourceKind.LINEARITY: "of full scale",
    SourceKind.GAUGE_AHEAD: "of the pressure",
    SourceKind.MUZZLE_BRAKE: "of the breech force",
    SourceKind.HANGING_PART: "of the mass, at {variant}",
}
_STATED = "have it measured, and state {} in the rig file"
_REMEDIES = {
    SourceKind.LINEARITY: _STATED.format("`u_linearity_rel` in the breech gauge's sensor"),
    SourceKind.GAUGE_AHEAD: _STATED.format("`gauge_ahead` in the breech gauge's sensor"),
    SourceKind.MUZZLE_BRAKE: _STATED.format(
        "`muzzle_brake` with `u_muzzle_brake`, `projectile_mass` and `bore_length`"
    ),
    SourceKind.TUBE: _STATED.format("`tube_axial_hz`"),
    SourceKind.HANGING_PART: "tie down what swings on the recoiling part: oil, hoses, a sight",
    SourceKind.BREAKAWAY: "look at the packing: worn, dry or new ones grip harder near to rest",
    SourceKind.TIME_CONSTANT: "look up the amplifier, and state `time_constant_s` in the sensor of {of}",
}


def suspicion(calibration: Calibration, suspects: Sequence[Suspect]) -> ShotSuspicion | None:
    """Ask a shot for the shapes that its rig does not state; None where it can tell none of them.

    Parameters
    ----------
    suspects
        Shapes on the grid of the calibration's regression, see `recoil_identification.rows.suspects.suspects`.
    """
    regression = calibration.block.regression
    tried = [(suspect, at) for suspect in suspects for at in range(len(suspect.shapes))]
    if not tried:
        return None
    causes, late = columns_of(regression, suspects)
    scores = calibration.with_causes(causes, late).scores_of([cause.source for cause in causes])
    of = np.array([suspects.index(suspect) for suspect, _ in tried])
    asked_for = np.array([(suspect.u, suspect.positive) for suspect, _ in tried])
    found = Hypotheses.of(scores, of, asked_for[:, 0], asked_for[:, 1] > 0)
    factors = found.ln_bayes_factors
    if not np.isfinite(factors).any():
        return None
    best = int(np.argmax(factors))
    sizes = scores.normalised / np.sqrt(np.where(scores.identifiable, scores.information, np.inf))
    by = -scores.moves[[one.name for one in calibration.inferred.unknowns].index(MASS.name)]
    nearly = np.flatnonzero(factors > factors[best] - AS_WELL)
    suspect, variant = tried[best]
    cause = suspect.cause(regression, variant)
    others = dict.fromkeys(tried[at][0].source for at in nearly if of[at] != of[best])
    weights = found.weights
    suspected = found.ln_bayes_factor > LEAST_FACTOR
    return ShotSuspicion(
        source=suspect.source,
        variant=suspect.variants[variant],
        normalised=float(scores.normalised[best]),
        size=float(sizes[best]),
        u_size=1.0 / math.sqrt(scores.information[best]),
        u_expected=suspect.u,
        ln_bayes_factor=found.ln_bayes_factor,
        others=tuple(others),
        moves_rel=float(by[best] * sizes[best]),
        spread_rel=math.sqrt(float(weights @ (by * sizes) ** 2 / weights.sum())),
        hypotheses=found,
        by=by,
        # a sound shot is solved once
        explained=calibration.with_cause(cause, {} if suspect.late is None else {cause.source: suspect.late})
        if suspected
        else calibration,
    )
