"""Changes among the shots of a campaign: steps of the mass, drifting sensors, shots that lie apart.

Each possible change is a column of the joint fit. How much the fit would gain by it is told without fitting anew, by
the score test of the column (Baarda's w for any pattern; `recoil_identification.inference.score` has its source),
under every scatter of gains and friction on the grid: a scatter that is large enough explains a change as well, so that
what counts is by how much the column raises the largest likelihood of all. The best column is added, and the rest is
asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.remark import Caution
from recoil_identification.campaign.advice import weighed_to_kg
from recoil_identification.campaign.joint_fit import JointFit, Trial, joint_fit
from recoil_identification.campaign.joint_rows import GAINS, Column, JointRows
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.campaign.suspicion import CERTIFIED, WRITTEN, Suspicion
from recoil_identification.inference.estimate import LEAST_REDUNDANCY
from recoil_identification.shot.shot_summary import LN_MASS

MOST_CHANGES = 3
LEVEL = 0.005
"""Share of campaigns without any change in which one is reported."""
LEAST_SHOTS = 3
"""Number of shots from which on one may lie apart: of two, none is apart from the other."""
TIE = 2
"""Decimals of a log likelihood up to which two are the same."""
CLOSE, MOST_CONTENDERS = 0.9, 6
"""Share of the largest gain from which on a candidate comes close; and how many are looked at."""
LARGE = 40.0
"""Gain, that of nine standard deviations, from which on a change is not linear."""
MOST_RIVALS = 3
"""How many of what is stated are weighed against one another."""
MASS = "mass"
"""Influence that is no sensor."""
STEP, DRIFT, OUTLIER, ADDED, OFF = (
    SignalKind.STEP,
    SignalKind.DRIFT,
    SignalKind.OUTLIER,
    SignalKind.ADDED,
    SignalKind.OFF,
)


@dataclass(frozen=True)
class Change:
    """One change that the shots tell.

    Attributes
    ----------
    kind
        Kind of the change; none of a chart.
    influence
        ``mass``, or the sensor.
    shots
        A step: the first shot after it, to the last; a drift: the first and the last; else all that it concerns.
    size, u
        Size and its standard uncertainty in `unit`: of a step the kg by which the mass rose, of a drift the share by
        which readings rose from the first shot to the last.
    gain
        Amount by which it raises the largest log likelihood.
    instead
        The next best explanation, of another kind or by another influence, with its own gain; empty if there is none.
    """

    kind: SignalKind
    influence: str
    shots: tuple[str, ...]
    size: float
    u: float
    unit: str
    gain: float
    instead: str = ""

    def remark(self) -> Caution:
        """Return it as a warning."""
        return Caution(self.kind, self.influence, str(self))

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
    """A change that is asked for.

    Attributes
    ----------
    parameter
        Parameter of a summary that it moves.
    names
        Names of all shots.
    at
        Place of the first shot that it concerns.
    level : ndarray, shape (n_shots,), or None
        Size of the change in each shot, over that of the whole; None for an outlier and a step, of which there are as
        many as shots.
    gain
        Amount by which it would raise the largest log likelihood.
    stated_u
        Standard uncertainty that is stated of what is off, in the unit of the column's size; 0 where nothing is.
    """

    kind: SignalKind
    influence: str
    parameter: str
    names: tuple[str, ...]
    at: int
    level: Array | None = None
    gain: float = 0.0
    stated_u: float = 0.0

    @property
    def shots(self) -> tuple[str, ...]:
        """Which it concerns, as of `Change`."""
        concerned = tuple(self.names[i] for i in np.flatnonzero(self.column.shares))
        return (self.names[self.at], concerned[-1]) if self.kind == DRIFT else concerned

    @property
    def column(self) -> Column:
        """Number of its column in the joint fit."""
        places = np.arange(len(self.names))
        alike = places == self.at if self.kind == OUTLIER else places >= self.at
        shares = alike.astype(np.float64) if self.level is None else self.level
        return Column(self.name, self.parameter, shares)

    @property
    def name(self) -> str:
        """Name of its column."""
        without = self.at if self.kind == OUTLIER else -1
        last = without if self.level is None else int(np.flatnonzero(self.level)[-1])
        return f"{self.kind}: {self.influence}, {self.names[self.at]} to {self.names[last]}"

    def __str__(self) -> str:
        return {
            STEP: f"a step of the mass before shot {self.names[self.at]}",
            DRIFT: f"a drift of {self.influence}",
            ADDED: f"another mass added to shots {', '.join(self.shots)}",
            OFF: f"{self.influence} off in all shots",
            OUTLIER: f"{self.influence} of shot {self.names[self.at]} alone",
        }[self.kind]


def joint_fit_with_changes(rows: JointRows, first: JointFit | None = None) -> tuple[JointFit, tuple[Change, ...]]:
    """Estimate everything that the shots share, and what changed among them, the likeliest change first.

    Parameters
    ----------
    first
        Fit of the rows without any change, if it is there already.
    """
    fit, found, instead = first or joint_fit(rows), list[Candidate](), list[str]()
    while len(rows.shots) >= LEAST_SHOTS and len(found) < MOST_CHANGES:
        candidates = candidates_of(fit, found)
        if not candidates or candidates[0].gain < least_gain(len(candidates)):
            break
        fit_with = _fits_beside(rows, found)
        best = _likeliest(fit_with, _best(fit_with, candidates), candidates)
        fit = fit_with(best)
        others = (one for one in candidates if (one.kind, one.influence) != (best.kind, best.influence))
        other = next(others, None)
        found.append(best)
        instead.append("" if other is None else _beside(other, best))
    return fit, tuple(_change(fit, one, other) for one, other in zip(found, instead, strict=True))


def _fits_beside(rows: JointRows, found: Sequence[Candidate]) -> Callable[[Candidate], JointFit]:
    """Return what fits one more change beside those that were found, each once: most of a campaign goes into it."""
    columns = tuple(one.column for one in found)
    fits: dict[str, JointFit] = {}

    def fit_with(one: Candidate) -> JointFit:
        if one.name not in fits:
            fits[one.name] = joint_fit(rows, [*columns, one.column])
        return fits[one.name]

    return fit_with


def _beside(other: Candidate, best: Candidate) -> str:
    """Say how another explanation compares with the one that was chosen."""
    less = ", but is less likely by what was stated of it" if other.gain > best.gain and best.stated_u else ""
    return f"{other}, {other.gain:.1f} against {best.gain:.1f} of log likelihood{less}"


def _best(fit_with: Callable[[Candidate], JointFit], candidates: Sequence[Candidate]) -> Candidate:
    """Choose the change that explains most; a large one is not linear, so that the few that come close are fitted."""
    contenders = [one for one in candidates if one.gain > CLOSE * candidates[0].gain][:MOST_CONTENDERS]
    levels = [one.gain for one in contenders]
    if len(contenders) > 1 and levels[0] > LARGE:
        levels = [max(trial.level for trial in fit_with(each).trials) for each in contenders]
    # a number that somebody wrote into the log, and then the mass, rather than a sensor that looks the same
    preferred = [(one.kind == ADDED, one.influence == MASS) for one in contenders]
    return contenders[max(range(len(contenders)), key=lambda i: (round(levels[i], TIE), *preferred[i]))]


def _likeliest(
    fit_with: Callable[[Candidate], JointFit], best: Candidate, candidates: Sequence[Candidate]
) -> Candidate:
    """Choose among what is stated, where one of these explains most, by what was stated of each as well."""
    rivals = [one for one in candidates if one.stated_u > 0.0][:MOST_RIVALS]
    if best not in rivals or len(rivals) < 2:
        return best

    def log_odds(one: Candidate) -> float:
        fit = fit_with(one)
        level = max(trial.level for trial in fit.trials)
        freedom = WRITTEN if one.kind == ADDED else CERTIFIED
        return Suspicion(level, fit.value(one.column.name), fit.u(one.column.name), one.stated_u, freedom).log_odds

    return max(rivals, key=log_odds)


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
    rows, told = fit.rows, {one.name for one in found}
    asked = {parameter: _asked(rows, parameter) for parameter in (LN_MASS, *GAINS) if parameter in rows.parameters}
    best = {parameter: np.full(len(of_it), -np.inf) for parameter, of_it in asked.items()}
    for trial in fit.trials:
        score = _Score.of(rows, trial)
        for parameter, of_it in asked.items():
            level = trial.log_likelihood + 0.5 * score.of_candidates(parameter, of_it) ** 2
            np.maximum(best[parameter], level, out=best[parameter])
    base = max(trial.log_likelihood for trial in fit.trials)
    candidates = [
        replace(one, gain=level - base)
        for parameter, of_it in asked.items()
        for one, level in zip(of_it, best[parameter].tolist(), strict=True)
        if one.name not in told
    ]
    return sorted(candidates, key=lambda one: -one.gain)


def normalised_residuals(fit: JointFit) -> Array:
    """Return how far the mass of each shot lies from what all others say, standard normal, shape (n_shots,)."""
    return _Score.of(fit.rows, fit.likeliest).of_shots(LN_MASS)


def _asked(rows: JointRows, parameter: str) -> list[Candidate]:
    """List the changes of a parameter that are asked for: each shot apart, the steps, and all others."""
    names = tuple(shot.name for shot in rows.shots)
    n, sensors = len(names), _sensors(rows, parameter)
    label = ", ".join(rows.influences[at].source for at in sensors) or f"{parameter[3:]} scale"
    found = [Candidate(OUTLIER, MASS if parameter == LN_MASS else label, parameter, names, i) for i in range(n)]
    if parameter == LN_MASS:
        # one shot after it, or before, is one that lies apart
        found += [Candidate(STEP, MASS, parameter, names, i) for i in range(2, n - 1)]
        for number, weighed in enumerate(rows.weighed):
            bear = rows.weight == number
            if 1 < np.count_nonzero(bear) < n:
                level, influence = bear.astype(np.float64), f"{MASS} of {weighed} added"
                mass_kg, u_kg = rows.weights[number]
                stated_u = max(u_kg, weighed_to_kg(abs(mass_kg))) / rows.reference_kg
                at = int(np.argmax(bear))
                found.append(Candidate(ADDED, influence, parameter, names, at, level, stated_u=stated_u))
    for identity, level in sensors.items():
        borne, sensor = np.flatnonzero(level), rows.influences[identity]
        at = int(borne[0])
        found.append(Candidate(OFF, sensor.source, parameter, names, at, level, stated_u=sensor.u))
        if borne.size >= LEAST_SHOTS:
            ramp = np.zeros(n)
            ramp[borne] = level[borne] * np.linspace(0.0, 1.0, borne.size)
            found.append(Candidate(DRIFT, sensor.source, parameter, names, at, ramp))
    return found


def _sensors(rows: JointRows, parameter: str) -> dict[int, Array]:
    """Return the sensors of a parameter, by their places among the influences, and how much each moves it in a shot."""
    moved = rows.loads[:, rows.parameters.index(parameter)]
    return {at: moved[:, at] / one.u for at, one in enumerate(rows.influences) if one.is_sensor and moved[:, at].any()}


@dataclass(frozen=True, eq=False)
class _Score:
    """Residuals of the shots' rows by the estimate under one scatter."""

    rows: JointRows
    trial: Trial
    triangle: Array
    left: Array
    derivatives: Array

    @classmethod
    def of(cls, rows: JointRows, trial: Trial) -> _Score:
        white = rows.whitened(trial.scatter)
        return cls(rows, trial, white.triangle, *white.by_shot(trial.values))

    def by_shot(self, parameter: str) -> tuple[Array, Array, Array]:
        """Return what each shot alone tells of a parameter in it.

        Returns
        -------
        energy : ndarray, shape (n_shots,)
            Energy of the shot's column.
        shared : ndarray, shape (n_shots, n_unknowns)
            Product of the column with what the common unknowns move.
        product : ndarray, shape (n_shots,)
            Product of the column with what is left of the rows.
        """
        place = self.rows.parameters.index(parameter)
        column = self.triangle[:, :, place]
        if parameter == LN_MASS:  # one kg is a smaller share of a heavier part
            whole_kg = np.exp(self.rows.modelled(self.trial.values)[0][:, place])
            column = column * (self.rows.reference_kg / whole_kg)[:, np.newaxis]
        shared = np.einsum("nkp,nk->np", self.derivatives, column)
        return np.einsum("nk,nk->n", column, column), shared, np.einsum("nk,nk->n", column, self.left)

    def of_shots(self, parameter: str) -> Array:
        """Return w of a parameter that is off in each shot alone, shape (n_shots,)."""
        return self._w(*self.by_shot(parameter))

    def of_candidates(self, parameter: str, asked: Sequence[Candidate]) -> Array:
        """Return w of the candidates that move a parameter, as `_asked` lists them, shape (n_candidates,)."""
        energy, shared, product = self.by_shot(parameter)
        steps = slice(2, max(len(energy) - 1, 2)) if parameter == LN_MASS else slice(0)
        later = (np.cumsum(each[::-1], axis=0)[::-1][steps] for each in (energy, shared, product))
        levels = np.array([one.level for one in asked if one.level is not None]).reshape(-1, len(energy))
        return np.concatenate(
            [
                self._w(energy, shared, product),
                self._w(*later),
                self._w(levels**2 @ energy, levels @ shared, levels @ product),
            ]
        )

    def _w(self, energy: Array, shared: Array, product: Array) -> Array:
        """Return w of columns that no unknown stands for, shape (n_columns,); 0 where nothing tells of one.

        Parameters
        ----------
        energy, shared, product
            Results of `by_shot`, of columns instead of shots.
        """
        own = energy - ((shared @ self.trial.estimate.covariance) * shared).sum(axis=1)
        judged = own > LEAST_REDUNDANCY * np.maximum(energy, np.finfo(np.float64).tiny)
        return np.where(judged, product / np.sqrt(np.where(judged, own, 1.0)), 0.0)


def _change(fit: JointFit, found: Candidate, instead: str) -> Change:
    """State a change as the fit with all of them has it."""
    size, u = fit.value(found.column.name), fit.u(found.column.name)
    unit, scale = ("kg", fit.rows.reference_kg) if found.column.parameter == LN_MASS else ("1", 1.0)
    return Change(
        found.kind, found.influence, found.shots, size * scale, u * scale, unit, gain=found.gain, instead=instead
    )
