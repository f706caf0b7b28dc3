"""Whether the mass changes within the shots of a campaign, each time alike.

One shot cannot tell a mass that changes slowly from a slow force that no gauge reads: (F / m)(1 + e(t)) is both. Shots
of several charges, and with a mass added, can, because the force is the rig's and of one shape over the travel. A drift
over the travel and a step at one of several instants are asked for, in all shots at once, without a new fit
(`recoil_identification.inference.score`), under every scatter and every size of that force, and the Bayes factors are
averaged by the probabilities of these.

A mass that changes in one shot alone, because something let go in it, is another matter: of each shot it is asked what
is left of its own rows by the estimate of all, with the change that all share among its unknowns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_identification.calibration.mass_over_time import DRIFT, STEP
from recoil_identification.campaign.joint_fit import JointFit
from recoil_identification.inference.change_odds import LEAST_FACTOR, could_hide_text, found_size, ln_odds_of_change
from recoil_identification.inference.score import Scores
from recoil_identification.shot.shot_summary import LN_MASS_DRIFT, STEPS_AT, ln_mass_step

MAY_REPEAT = 0.01
"""Share of the acceleration that forces and motion leave of one another in a coloured way, above which nothing is said:
friction that hangs on the place is alike in all shots, and would be a change of the mass in each."""


@dataclass(frozen=True)
class SharedChange:
    """Size that a change of the mass within each shot would have.

    Attributes
    ----------
    size_percent, u_percent
        Size in percent of the mass, negative if it becomes less, and its standard uncertainty.
    """

    size_percent: float
    u_percent: float

    def __str__(self) -> str:
        return f"{self.size_percent:+.2f} % (u {self.u_percent:.2f} %)"


@dataclass(frozen=True)
class SharedConstancy:
    """Test of the constancy of the mass within the shots of a campaign.

    Attributes
    ----------
    ln_bayes_factor
        Logarithm of the odds of a mass that changes in every shot alike, by a drift or a step, against one that does
        not, that the shots add.
    drift
        Drift over the travel, if there is nothing else.
    step, step_at
        Step that explains the shots best, if there is nothing else, and the share of the travel's time at which it
        comes.
    could_hide_percent
        Sizes of a ``drift`` over the travel and of a ``step`` that would have been found in 19 campaigns of 20, percent
        of the mass.
    step_explains_more
        Whether a step is likelier than a drift.
    unexplained_share
        Share of the acceleration that forces and motion leave of one another in a coloured way, the median of all
        shots.
    """

    ln_bayes_factor: float
    drift: SharedChange
    step: SharedChange
    step_at: float
    could_hide_percent: dict[str, float]
    step_explains_more: bool
    unexplained_share: float = 0.0

    @property
    def constant(self) -> bool:
        """Whether no change of the mass can be told."""
        return self.ln_bayes_factor <= LEAST_FACTOR or self.may_repeat

    @property
    def may_repeat(self) -> bool:
        """Whether what is left in a coloured way may look like a change of the mass in every shot alike."""
        return self.unexplained_share > MAY_REPEAT

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Reason against a mass that is one number; none if no change can be told."""
        if self.constant:
            return ()
        return (
            Reason(ReasonCode.CONSTANCY, "shots", f"{str(self).rstrip('.')}: one number does not describe the mass"),
        )

    def __str__(self) -> str:
        odds = f"ln of the Bayes factor {self.ln_bayes_factor:+.1f}, limit {LEAST_FACTOR:g}"
        if self.may_repeat and self.ln_bayes_factor > LEAST_FACTOR:
            return (
                f"No change of the mass within the shots can be told ({odds}): forces and motion leave "
                f"{100 * self.unexplained_share:.2g} % of one another that may be alike in all shots, as friction that "
                "hangs on the place is."
            )
        if self.constant:
            hidden = could_hide_text(self.could_hide_percent, "campaigns")
            return (
                f"No change of the mass within the shots can be told ({odds}): {hidden} behind forces that no gauge "
                "reads."
            )
        best = (
            f"a step of {self.step} at {100 * self.step_at:.0f} % of the travel's time"
            if self.step_explains_more
            else f"a drift of {self.drift} over the travel"
        )
        return (
            f"In every shot alike the mass changes, or the friction, or what the breech chain reads ({odds}): as a "
            f"mass {best}."
        )


CHANGES = (LN_MASS_DRIFT, *map(ln_mass_step, STEPS_AT))
"""Names of the changes that are asked for: a drift, and steps."""
SD = np.array([DRIFT, *[STEP] * len(STEPS_AT)])
"""Standard deviation of the mass's logarithm by each, if it changes."""


def shared_constancy(fit: JointFit) -> SharedConstancy | None:
    """Test whether the mass changes within all shots alike; None if none of them tells of it."""
    rows, names, sd = fit.rows, CHANGES, SD
    if any(name not in rows.parameters for name in names):
        return None
    # every trial: one that is unlikely with a constant mass may be the likely one with a mass that changes
    weights = fit.weights
    factors, sizes, variances = (np.zeros((weights.size, len(names))) for _ in range(3))
    likeliest = int(np.argmax(weights))
    hidden: dict[str, float] = {}
    for at, trial in enumerate(fit.trials):
        scores = fit.scores(trial, names)
        if not scores.identifiable[0] or not scores.identifiable[1:].any():
            return None
        factors[at] = scores.ln_bayes_factors(sd)
        if at == likeliest:
            middle = 1 + int(np.flatnonzero(scores.identifiable[1:])[np.count_nonzero(scores.identifiable[1:]) // 2])
            hidden = {
                "drift": 100 * found_size(scores, sd, 0),
                "step": 100 * found_size(scores, sd, middle),
            }
        information = np.where(scores.identifiable, scores.information, 1.0)
        variances[at] = np.where(scores.identifiable, 1.0 / information, np.inf)
        sizes[at] = scores.normalised / np.sqrt(information)
    told = np.isfinite(variances.sum(axis=0))
    # of each change its Bayes factor, averaged over what is not known beside it
    whole = np.logaddexp.reduce(factors + fit.ln_weights[:, np.newaxis], axis=0)
    of_step = float(np.logaddexp.reduce(whole[1:]) - math.log(len(STEPS_AT)))
    best = 1 + int(np.argmax(np.where(told[1:], whole[1:], -np.inf)))

    def change(column: int) -> SharedChange:
        mean = float(weights @ sizes[:, column])
        variance = float(weights @ (variances[:, column] + (sizes[:, column] - mean) ** 2))
        return SharedChange(100 * mean, 100 * math.sqrt(variance))

    return SharedConstancy(
        ln_bayes_factor=float(ln_odds_of_change(whole)),
        drift=change(0),
        step=change(best),
        step_at=STEPS_AT[best - 1],
        could_hide_percent=hidden,
        step_explains_more=of_step > whole[0],
        unexplained_share=median(shot.summary.unexplained_share for shot in rows.shots if shot.summary is not None),
    )


@dataclass(frozen=True, eq=False)
class BesideSharedChange(ReadOnlyArrays):
    """The rows of a joint fit with the likeliest change that all shots share among the unknowns.

    Attributes
    ----------
    left : ndarray, shape (n_shots, n_parameters)
        Rest that the fit and that change leave.
    slopes : ndarray, shape (n_shots, n_parameters, n_unknowns + 1)
    covariance : ndarray, shape (n_unknowns + 1, n_unknowns + 1)
    columns : ndarray, shape (n_shots, n_parameters, n_changes)
        Columns of all changes.
    """

    left: Array
    slopes: Array
    covariance: Array
    columns: Array


def beside_shared_change(fit: JointFit) -> BesideSharedChange | None:
    """Take the likeliest change that all shots share off their rows; None if not all of them tell of it."""
    rows, trial = fit.rows, fit.likeliest
    if any(name not in rows.parameters for name in CHANGES):
        return None
    places = [rows.parameters.index(name) for name in CHANGES]
    white = rows.whitened(trial.scatter)
    left, derivatives = white.by_shot(trial.values)
    columns = white.triangle[:, :, places]
    slopes, shapes = derivatives.reshape(-1, derivatives.shape[2]), columns.reshape(-1, len(places))
    covariance = trial.estimate.covariance
    factors = Scores.of(left.reshape(-1), slopes, covariance, shapes).ln_bayes_factors(SD)
    best = int(np.argmax(factors))
    moved = covariance @ (slopes.T @ shapes[:, best])
    own = float(shapes[:, best] @ (shapes[:, best] - slopes @ moved)) + SD[best] ** -2
    direction = np.append(-moved, 1.0)
    joint = np.zeros((moved.size + 1, moved.size + 1))
    joint[:-1, :-1] = covariance
    joint += np.outer(direction, direction) / own
    size = float(shapes[:, best] @ left.reshape(-1)) / own
    slopes = np.concatenate([derivatives, columns[:, :, best : best + 1]], axis=2)
    return BesideSharedChange(left - slopes @ (size * direction), slopes, joint, columns)


def changing_alone(fit: JointFit) -> dict[str, float]:
    """Return the shots in which the mass changes otherwise than in all of them.

    Returns
    -------
    dict of str to float
        By name of the shot the logarithm of the odds of a mass that changes in it alone, of each that is beyond
        `LEAST_FACTOR`.
    """
    beside = beside_shared_change(fit)
    if beside is None:
        return {}
    found = {}
    for shot, *of_shot in zip(fit.rows.shots, beside.left, beside.slopes, beside.columns, strict=True):
        left, slopes, columns = of_shot
        of_each = Scores.of(left, slopes, beside.covariance, columns).ln_bayes_factors(SD)
        factor = float(ln_odds_of_change(of_each))
        if factor > LEAST_FACTOR:
            found[shot.name] = factor
    return found
