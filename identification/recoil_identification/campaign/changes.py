"""What changed among the shots of a campaign: steps of the mass, drifting sensors, shots that lie apart.

Each possible change is a column of the joint fit. How much the fit would gain by it is told without fitting anew, by
the score test of the column (Baarda's w for any pattern; `recoil_identification.inference.score` has its source),
under every scatter of gains and friction on the grid: a scatter that is large enough explains a change as well, so that
what counts is by how much the column raises the largest likelihood of all. The best column is added, and the rest is
asked again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from recoil_identification.campaign.joint_fit import JointFit, Trial, joint_fit
from recoil_identification.campaign.joint_rows import GAINS, Column, JointRows
from recoil_identification.inference.estimate import LEAST_REDUNDANCY
from recoil_identification.shot_summary import LN_MASS

Array = NDArray[np.float64]

MOST_CHANGES = 3
LEVEL = 0.005
"""Share of campaigns without any change in which one is reported."""
LEAST_SHOTS = 3
"""Of two, none is apart from the other."""
TIE = 2
"""Decimals of a log likelihood up to which two are the same."""
CLOSE, MOST_CONTENDERS = 0.9, 6
"""Share of the largest gain from which on a candidate is fitted, because a large change is not linear; and how many."""
MASS, STEP, DRIFT, OUTLIER, ADDED, OFF = "mass", "mass step", "sensor drift", "outlier", "added mass", "calibration"
"""Influence, and kinds."""


@dataclass(frozen=True)
class Change:
    """One change that the shots tell.

    Attributes
    ----------
    kind
        ``mass step``, ``sensor drift``, ``outlier``; ``added mass`` and ``calibration``, if what was declared is wrong.
    influence
        ``mass``, or the sensor.
    shots
        A step: the first shot after it, to the last; a drift: the first and the last; else all that it concerns.
    size, u
        In `unit`: of a step the kg by which the mass rose, of a drift the share by which readings rose from the first
        shot to the last.
    gain
        By how much it raises the largest log likelihood.
    instead
        The next best explanation, of another kind or by another influence, with its own gain; empty if there is none.
    """

    kind: str
    influence: str
    shots: tuple[str, ...]
    size: float
    u: float
    unit: str
    gain: float
    instead: str = ""

    @property
    def normalised_residual(self) -> float:
        """Its size over its standard uncertainty."""
        return self.size / self.u

    def __str__(self) -> str:
        places = 1 if self.unit == "kg" else 2
        scale, unit = (1.0, "kg") if self.unit == "kg" else (100.0, "%")
        told = f"{scale * self.size:+.{places}f} {unit}, u {scale * self.u:.{places + 1}f} {unit}"
        where = {
            STEP: f"the mass changed by {told} from shot {self.shots[0]} on",
            DRIFT: f"{self.influence} drifted by {told} from shot {self.shots[0]} to {self.shots[-1]}",
            ADDED: f"the mass added to shots {', '.join(self.shots)} is off by {told}",
            OFF: f"{self.influence} is off by {told} in all shots, and its calibration does not allow that",
            OUTLIER: f"shot {self.shots[0]} lies apart: its {self.influence} is off by {told}",
        }[self.kind]
        return where + (f" (next best: {self.instead})" if self.instead else "")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A change that is asked for: its column, and by how much it would raise the largest log likelihood."""

    kind: str
    influence: str
    shots: tuple[str, ...]
    column: Column
    gain: float

    def __str__(self) -> str:
        return {
            STEP: f"a step of the mass before shot {self.shots[0]}",
            DRIFT: f"a drift of {self.influence}",
            ADDED: f"another mass added to shots {', '.join(self.shots)}",
            OFF: f"{self.influence} off in all shots",
            OUTLIER: f"{self.influence} of shot {self.shots[0]} alone",
        }[self.kind]


def joint_fit_with_changes(rows: JointRows) -> tuple[JointFit, tuple[Change, ...]]:
    """Estimate everything that the shots share, and what changed among them, the likeliest change first."""
    fit, found, instead = joint_fit(rows), list[Candidate](), list[str]()
    while len(rows.shots) >= LEAST_SHOTS and len(found) < MOST_CHANGES:
        candidates = candidates_of(fit, found)
        if not candidates or candidates[0].gain < least_gain(len(candidates)):
            break
        contenders = [one for one in candidates if one.gain > CLOSE * candidates[0].gain][:MOST_CONTENDERS]
        fits = [joint_fit(rows, [*(one.column for one in found), each.column]) for each in contenders]
        levels = [max(trial.level for trial in each.trials) for each in fits]
        # a number that somebody wrote into the log, and then the mass, rather than a sensor that looks the same
        preferred = [(one.kind == ADDED, one.influence == MASS) for one in contenders]
        at = max(range(len(fits)), key=lambda i: (round(levels[i], TIE), *preferred[i]))
        best, fit = contenders[at], fits[at]
        others = (one for one in candidates if (one.kind, one.influence) != (best.kind, best.influence))
        other = next(others, None)
        found.append(best)
        instead.append("" if other is None else f"{other}, {other.gain:.1f} against {best.gain:.1f} of log likelihood")
    return fit, tuple(_change(fit, one, other) for one, other in zip(found, instead, strict=True))


def least_gain(count: int) -> float:
    """Return by how much the best of so many candidates must raise the log likelihood to be no chance (Bonferroni)."""
    return 0.5 * NormalDist().inv_cdf(1.0 - 0.5 * LEVEL / count) ** 2


def candidates_of(fit: JointFit, found: Sequence[Candidate] = ()) -> list[Candidate]:
    """List all changes that can be told from what is in the fit, the likeliest first.

    Parameters
    ----------
    found
        Columns of the fit.
    """
    rows, names = fit.rows, [shot.name for shot in fit.rows.shots]
    n, reference = len(names), fit.likeliest
    theta = rows.modelled(reference.values)[0]
    # a change of one kg of the mass is a smaller share of a heavier part
    of_mass = rows.reference_kg / np.exp(theta[:, rows.parameters.index(LN_MASS)])
    told = [f"{one.kind} {one.influence} {one.shots}" for one in found]
    gains: list[tuple[str, str, tuple[str, ...], str, Array, float]] = []

    def ask(kind: str, influence: str, shots: Sequence[str], parameter: str, shares: Array, gain: float) -> None:
        if math.isfinite(gain) and f"{kind} {influence} {tuple(shots)}" not in told:
            gains.append((kind, influence, tuple(shots), parameter, shares, gain))

    base = max(trial.log_likelihood for trial in fit.trials)
    for parameter in (name for name in (LN_MASS, *GAINS) if name in rows.parameters):
        scores = [_Score.of(trial, rows.parameters.index(parameter)) for trial in fit.trials]
        shares, ones = of_mass if parameter == LN_MASS else np.ones(n), np.ones(n)

        def best(patterns: Array, scores: list[_Score] = scores) -> Array:
            """Return by how much each pattern, a row of shares of shots, raises the largest likelihood."""
            return np.asarray(np.max([one.level(patterns) for one in scores], axis=0) - base)

        apart = np.max([one.level_of_each(shares) for one in scores], axis=0) - base
        label = MASS if parameter == LN_MASS else _label(rows, parameter)
        for i, gain in enumerate(apart.tolist()):
            ask(OUTLIER, label, names[i : i + 1], parameter, ones * (np.arange(n) == i), gain)
        if parameter == LN_MASS:
            steps = np.max([one.level_of_steps(shares) for one in scores], axis=0) - base
            # one shot alone lies apart
            for i in range(2, n - 1):
                ask(STEP, MASS, names[i:], parameter, ones * (np.arange(n) >= i), float(steps[i]))
            for number, weight in enumerate(rows.weights):
                bears = rows.weight == number
                concerned = [name for name, one in zip(names, bears.tolist(), strict=True) if one]
                if 1 < len(concerned) < n:
                    what = f"{MASS} of {weight[0]:g} kg added"
                    ask(ADDED, what, concerned, parameter, ones * bears, float(best((shares * bears)[np.newaxis])[0]))
            continue
        for identity, where in _sensors(rows, parameter).items():
            at, name = np.flatnonzero(where), rows.influences[identity].label
            level = rows.loads[:, rows.parameters.index(parameter), identity] / rows.influences[identity].u
            ask(OFF, name, [names[i] for i in at], parameter, level, float(best(level[np.newaxis])[0]))
            if at.size >= LEAST_SHOTS:
                ramp = level.copy()
                ramp[at] *= np.linspace(0.0, 1.0, at.size)
                ask(DRIFT, name, [names[at[0]], names[at[-1]]], parameter, ramp, float(best(ramp[np.newaxis])[0]))
    gains.sort(key=lambda one: -one[-1])
    return [
        Candidate(kind, influence, shots, Column(f"{kind}: {influence}, {' '.join(shots)}", parameter, shares), gain)
        for kind, influence, shots, parameter, shares, gain in gains
    ]


def normalised_residuals(fit: JointFit) -> Array:
    """Return how far the mass of each shot lies from what all others say, standard normal, shape (n_shots,)."""
    score = _Score.of(fit.likeliest, fit.rows.parameters.index(LN_MASS))
    return score.normalised_of_each(np.ones(len(fit.rows.shots)))


@dataclass(frozen=True, eq=False)
class _Score:
    """Of one parameter under one scatter: what each shot tells of a column, shapes (n,), (n,), (n, n_unknowns)."""

    trial: Trial
    product: Array
    energy: Array
    shared: Array

    @classmethod
    def of(cls, trial: Trial, place: int) -> _Score:
        left, derivatives = trial.rows.by_shot(trial.values)
        column = trial.rows.triangle[:, :, place]
        return cls(
            trial,
            np.einsum("nk,nk->n", column, left),
            np.einsum("nk,nk->n", column, column),
            np.einsum("nkp,nk->np", derivatives, column),
        )

    def _normalised(self, product: Array, energy: Array, shared: Array) -> Array:
        own = energy - np.einsum("np,pq,nq->n", shared, self.trial.estimate.covariance, shared)
        judged = own > LEAST_REDUNDANCY * np.maximum(energy, np.finfo(np.float64).tiny)
        return np.where(judged, product / np.sqrt(np.where(judged, own, 1.0)), 0.0)

    def normalised_of_each(self, shares: Array) -> Array:
        """Return w of one shot apart, for each shot."""
        return self._normalised(self.product * shares, self.energy * shares**2, self.shared * shares[:, np.newaxis])

    def level_of_each(self, shares: Array) -> Array:
        """Return the log likelihood with a column for one shot, for each shot."""
        return np.asarray(self.trial.log_likelihood + 0.5 * self.normalised_of_each(shares) ** 2)

    def level_of_steps(self, shares: Array) -> Array:
        """Return the log likelihood with a column for all shots from one on, for each shot."""

        def from_here(values: Array) -> Array:
            return np.cumsum(values[::-1], axis=0)[::-1]

        w = self._normalised(
            from_here(self.product * shares),
            from_here(self.energy * shares**2),
            from_here(self.shared * shares[:, np.newaxis]),
        )
        return np.asarray(self.trial.log_likelihood + 0.5 * w**2)

    def level(self, patterns: Array) -> Array:
        """Return the log likelihood with a column of given shares, for each row of patterns."""
        w = self._normalised(patterns @ self.product, patterns**2 @ self.energy, patterns @ self.shared)
        return np.asarray(self.trial.log_likelihood + 0.5 * w**2)


def _sensors(rows: JointRows, parameter: str) -> dict[int, NDArray[np.bool_]]:
    """Return the sensors of a parameter, by their places among the influences, and the shots that each is in."""
    place = rows.parameters.index(parameter)
    places = (at for at, one in enumerate(rows.influences) if one.is_sensor and np.any(rows.loads[:, place, at]))
    return {at: rows.loads[:, place, at] > 0 for at in places}


def _label(rows: JointRows, parameter: str) -> str:
    """Name the sensors of a parameter; the parameter itself where none is uncertain."""
    return ", ".join(rows.influences[at].label for at in _sensors(rows, parameter)) or f"{parameter[3:]} scale"


def _change(fit: JointFit, found: Candidate, instead: str) -> Change:
    """State a change as the fit with all of them has it."""
    size, u = fit.value(found.column.name), fit.u(found.column.name)
    unit, scale = ("kg", fit.rows.reference_kg) if found.column.parameter == LN_MASS else ("1", 1.0)
    return Change(
        found.kind, found.influence, found.shots, size * scale, u * scale, unit, gain=found.gain, instead=instead
    )
