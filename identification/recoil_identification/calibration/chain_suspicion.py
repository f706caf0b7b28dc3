"""Shapes of the breech chain that nobody stated: whether one of them explains a shot, and which.

A bent gauge, one that sits ahead of the breech face, a muzzle brake and a tube that swings are there while the breech
drives, as the effect of a mass would be that changes early; and of a gauge or a clock they ask for the impossible. None
is an unknown until a rig states it. So each is asked for by what the estimate leaves (score test, see
`recoil_identification.calibration.mass_over_time`), and is suspected where it is far likelier than that nothing is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import LEAST_FACTOR, as_if_known
from recoil_identification.rows.breech_chain import BREECH, SUSPECTED_HZ, Suspect, in_column
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.equation_of_motion import MASS
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression

AS_WELL = 2.0
"""Logarithm of the Bayes factor by which another shape may lie below the likeliest and explains the shot as well."""


@dataclass(frozen=True, eq=False)
class ChainSuspicion(ReadOnlyArrays):
    """The shape of the breech chain that explains a shot best.

    Attributes
    ----------
    source
        Source that it is.
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
    explained
        Everything else if it is the likeliest; the estimate that was tested where nothing is suspected.
    """

    source: ErrorSource
    normalised: float
    size: float
    u_size: float
    u_expected: float
    ln_bayes_factor: float
    others: tuple[ErrorSource, ...]
    moves_rel: float
    spread_rel: float
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

    def __str__(self) -> str:
        odds = f"ln of the Bayes factor {self.ln_bayes_factor:+.1f}, limit {LEAST_FACTOR:g}"
        if not self.suspected:
            return f"Nothing of the breech chain, a muzzle brake or the tube can be told ({odds})."
        others = f", {' and '.join(self.others)} nearly as well" if self.others else ""
        return (
            f"The breech chain, a muzzle brake or the tube; or the mass ({odds}): {self._likeliest} explains the shot "
            f"best{others}; the mass would move by {100 * self.moves_rel:+.2g} %; {self._remedy}."
        )

    @property
    def _likeliest(self) -> str:
        if self.source.kind is SourceKind.TUBE:
            what = "a tube that swings along its axis" if self.size > 0 else "a bracket under the accelerometer"
            return f"{what}, at some {self.swings_hz:.2g} Hz,"
        size, u_size = (100.0 * one for one in (self.size, self.u_size))
        return f"{_SHAPES[self.source.kind]}, {size:.2g} % (u {u_size:.1g} %) {_OF[self.source.kind]},"

    @property
    def _remedy(self) -> str:
        if self.source.kind is SourceKind.TUBE and self.size < 0:
            return "stiffen what carries the accelerometer"
        return f"have it measured, and state {_KEYS[self.source.kind]} in the rig file"


_SHAPES = {
    SourceKind.LINEARITY: "a breech gauge whose line is bent",
    SourceKind.GAUGE_AHEAD: "a breech gauge ahead of the breech face",
    SourceKind.MUZZLE_BRAKE: "a muzzle brake",
}
_OF = {
    SourceKind.LINEARITY: "of full scale",
    SourceKind.GAUGE_AHEAD: "of the pressure",
    SourceKind.MUZZLE_BRAKE: "of the breech force",
}
_KEYS = {
    SourceKind.LINEARITY: "`u_linearity_rel` in the breech gauge's sensor",
    SourceKind.GAUGE_AHEAD: "`gauge_ahead` in the breech gauge's sensor",
    SourceKind.MUZZLE_BRAKE: "`muzzle_brake` with `u_muzzle_brake`, `projectile_mass` and `bore_length`",
    SourceKind.TUBE: "`tube_axial_hz`",
}


def chain_suspicion(calibration: Calibration, suspects: Sequence[Suspect]) -> ChainSuspicion | None:
    """Ask a shot for the shapes of the breech chain; None where it can tell none of them.

    Parameters
    ----------
    suspects
        Shapes on the grid of the calibration's regression, see `recoil_identification.rows.breech_chain.suspects`.
    """
    regression = calibration.block.regression
    tried = [(suspect, _cause(regression, suspect, forces_n)) for suspect in suspects for forces_n in suspect.forces_n]
    if not tried:
        return None
    of = np.array([suspects.index(suspect) for suspect, _ in tried])
    names = [f"shape {number} of the breech chain" for number in range(len(tried))]
    causes = [
        replace(cause, source=ErrorSource(SourceKind.CHOICE, detail=name))
        for (_, cause), name in zip(tried, names, strict=True)
    ]
    asked = replace(calibration, block=replace(calibration.block, causes=(*calibration.block.causes, *causes))).rows
    derivatives = asked.linearised(calibration.values | dict.fromkeys(names, 0.0))[1]
    columns = derivatives[:, [asked.unknowns.index(name) for name in names]]
    scores = calibration.scores(columns)
    factors = scores.ln_bayes_factors(np.array([suspect.u for suspect, _ in tried]))
    wrong_way = np.array([suspect.positive for suspect, _ in tried]) & (scores.normalised < 0)
    factors = np.where(scores.identifiable & ~wrong_way, factors, -np.inf)
    if not np.isfinite(factors).any():
        return None
    best, counts = int(np.argmax(factors)), np.bincount(of)[of]
    sizes = scores.normalised / np.sqrt(np.where(scores.identifiable, scores.information, np.inf))
    moves = _moves(calibration, columns) * sizes
    nearly, odds = factors > factors[best] - AS_WELL, np.exp(factors - factors[best]) / counts
    joint = np.logaddexp.reduce(factors - np.log(counts)) - math.log(np.unique(of).size)
    suspect, cause = tried[best]
    others = dict.fromkeys(tried[at][0].source for at in np.flatnonzero(nearly) if of[at] != of[best])
    return ChainSuspicion(
        source=suspect.source,
        normalised=float(scores.normalised[best]),
        size=float(sizes[best]),
        u_size=1.0 / math.sqrt(scores.information[best]),
        u_expected=suspect.u,
        ln_bayes_factor=float(joint),
        others=tuple(others),
        moves_rel=float(moves[best]),
        spread_rel=math.sqrt(float(odds @ np.where(odds > 0, moves, 0.0) ** 2 / odds.sum())),
        # a sound shot is solved once
        explained=calibration.with_cause(cause) if joint > LEAST_FACTOR else calibration,
    )


def _cause(regression: Regression, suspect: Suspect, forces_n: Array) -> Cause:
    """Return a suspected shape as a cause."""
    columns = in_column(regression, BREECH, forces_n)
    return Cause(suspect.source, "1", suspect.u, "B", columns, np.zeros(forces_n.size))


def _moves(calibration: Calibration, columns: Array) -> Array:
    """Return by how much the mass's logarithm moves for a size of one of each column, shape (n_columns,)."""
    derivatives = calibration.rows.linearised(calibration.values)[1]
    at = [[one.name for one in calibration.inferred.unknowns].index(name) for name in calibration.rows.unknowns]
    of_mass = calibration.inferred.covariance[np.ix_(at, at)][calibration.rows.unknowns.index(MASS.name)]
    return np.asarray(-(of_mass @ (derivatives.T @ columns)))
