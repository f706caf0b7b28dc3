"""The mass of a campaign's mechanism, and what the campaign learnt of its sensors, from all shots at once.

The shots' rows and what is known beforehand of the influences that they share are one least-squares problem
(`recoil_identification.campaign.joint_rows`). By how much gains and friction scatter from shot to shot is not known
either: each scatter on a grid has the marginal likelihood of the rows under it,

    log p(rows | scatter) = -1/2 (misfit + log det S + log det Lambda) + constant

with S the covariance of the rows and Lambda the information on all unknowns, and what is reported is the mean over the
grid by these weights, and the covariance within and between its points (A. Gelman et al., Bayesian Data Analysis, 3rd
edition 2013, section 13.1 on averaging over a grid).

How large the force of unknown shape is that no gauge reads is a further coordinate of that grid: one shot cannot tell
it from a gauge's scale, many shots of one rig can. Its prior is half-Cauchy about what the rig states (A. Gelman,
Bayesian Analysis 1(3), 2006), at factors that are geometrically spaced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.campaign.joint_rows import FORGOTTEN, Column, JointRows, Scatter, WhiteRows
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.inference.estimate import Estimate
from recoil_identification.inference.score import Scores
from recoil_identification.inference.solve import solve
from recoil_identification.rows.unread_resistance import FORCE as UNREAD_FORCE
from recoil_identification.shot.shot_summary import FRICTION_SHARE
from recoil_processing.shot.error_source import ErrorSource, SourceKind

GAINS_REL = (0.0, 1e-4, 2e-4, 3.5e-4, 5e-4, 7e-4, 1e-3, 1.5e-3, 2e-3, 3e-3, 5e-3)
FRICTIONS_REL = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Standard deviations from shot to shot that are tried, of gains and of the friction."""
HOPELESS = 25.0
"""Distance below the largest log likelihood from which on no larger scatter is tried."""
FORCES = (1.0, 1.5, 2.2, 3.3, 5.0)
"""Factors on what the rig states of the force that no gauge reads."""
LEAST_WEIGHT = 0.01
"""Share of the largest probability of a scatter, below which other sizes of that force are not tried with it."""


MOST_COST = 1.1
"""Factor on the standard uncertainty of the mass, up to which it is taken by the weight."""


@dataclass(frozen=True, eq=False)
class Trial(ReadOnlyArrays):
    """The estimate under one scatter and one size of the force that no gauge reads.

    Attributes
    ----------
    force
        Factor on what the rig states of that force.
    log_likelihood
        Marginal, with what is known of the scatter and of the force beforehand; up to a constant.
    level
        The largest one of any values, instead of that of all of them.
    """

    scatter: Scatter
    force: float
    estimate: Estimate
    log_likelihood: float
    level: float

    @property
    def values(self) -> dict[str, float]:
        """Values of all unknowns, by name."""
        names = [unknown.name for unknown in self.estimate.unknowns]
        return dict(zip(names, self.estimate.values.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class JointFit(ReadOnlyArrays):
    """The joint estimate by all shots.

    Attributes
    ----------
    rows
        Rows of all shots, before they are divided by any scatter.
    trials
        One for each scatter on the grid, and for each other size of the force where that scatter is likely.
    weights : ndarray, shape (n_trials,)
        Probability of each.
    """

    rows: JointRows
    trials: tuple[Trial, ...]
    weights: Array

    @property
    def likeliest(self) -> Trial:
        """The trial of the largest probability."""
        return self.trials[int(np.argmax(self.weights))]

    @property
    def ln_weights(self) -> Array:
        """Logarithm of the probability of each; minus infinity of one that is as good as impossible."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.weights))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns."""
        return tuple(unknown.name for unknown in self.trials[0].estimate.unknowns)

    @cached_property
    def values(self) -> Array:
        """Values of all unknowns, shape (n_unknowns,)."""
        return np.asarray(self.weights @ np.array([one.estimate.values for one in self.trials]))

    @cached_property
    def covariance(self) -> Array:
        """Covariance of all unknowns, shape (n_unknowns, n_unknowns)."""
        apart = np.array([one.estimate.values for one in self.trials]) - self.values
        within = np.tensordot(self.weights, np.array([one.estimate.covariance for one in self.trials]), 1)
        return np.asarray(within + (apart.T * self.weights) @ apart)

    @property
    def before_any_shot(self) -> JointFit:
        """The same trials under one scatter, with the probability that each has before anything is recorded.

        Of shots in which nothing is off the likelihood would say that no force acts that the rig does not state: real
        ones hardly tell how large it is.
        """
        weights = np.array([one.force / (1.0 + one.force**2) for one in self.trials])
        return replace(self, weights=weights / weights.sum())

    def value(self, name: str) -> float:
        """Return the value of an unknown."""
        return float(self.values[self.names.index(name)])

    def u(self, name: str) -> float:
        """Return its standard uncertainty."""
        at = self.names.index(name)
        return math.sqrt(float(self.covariance[at, at]))

    def mass_kg(self, mechanism: str) -> tuple[float, float]:
        """Return the mass of a mechanism without what was added to it, and its standard uncertainty."""
        name = self.rows.masses[self.rows.mechanisms.index(mechanism)]
        mass_kg = self.rows.reference_kg * math.exp(self.value(name))
        return mass_kg, mass_kg * self.u(name)

    def moves_kg(self, mechanism: str, source: str) -> float:
        """Return by how much a mechanism's mass would change if nothing had been known of an influence or a weight.

        Of one value more that is seen as x with the variance v and forgotten, everything else moves by its covariance
        with it times ``x / (1 - v)``, both in the standard uncertainty that was stated.
        """
        estimate = self.likeliest.estimate
        if not estimate.normalised_residual(source):  # nothing else tells of it
            return 0.0
        name = self.rows.masses[self.rows.mechanisms.index(mechanism)]
        place, at = self.names.index(name), self.names.index(source)
        alone = estimate.normalised_residual(source) ** 2 / estimate.value(source)
        return self.mass_kg(mechanism)[0] * float(estimate.covariance[place, at]) * alone

    def difference_kg(self, mechanism: str, other: str) -> tuple[float, float]:
        """Return by how much one mechanism's mass exceeds another's, and the standard uncertainty of that.

        It is smaller than those of the masses tell, because both hang on the same sensors.
        """
        (mass_kg, _), (other_kg, _) = self.mass_kg(mechanism), self.mass_kg(other)
        row = np.zeros(len(self.names))
        for name, size in ((mechanism, mass_kg), (other, -other_kg)):
            row[self.names.index(self.rows.masses[self.rows.mechanisms.index(name)])] += size
        return mass_kg - other_kg, math.sqrt(max(float(row @ self.covariance @ row), 0.0))

    def scores(self, trial: Trial, parameters: Sequence[str]) -> Scores:
        """Score parameters that are off alike in all shots, each by a size of one, under one of the trials."""
        white = self.rows.whitened(trial.scatter)
        left, derivatives = white.by_shot(trial.values)
        columns = white.triangle[:, :, [self.rows.parameters.index(name) for name in parameters]]
        slopes, shapes = (one.reshape(-1, one.shape[2]) for one in (derivatives, columns))
        return Scores.of(left.reshape(-1), slopes, trial.estimate.covariance, shapes)

    @property
    def forces(self) -> dict[float, float]:
        """Factors on what the rig states of the force that no gauge reads, and the probability of each."""
        found = dict.fromkeys(sorted({one.force for one in self.trials}), 0.0)
        for one, weight in zip(self.trials, self.weights.tolist(), strict=True):
            found[one.force] += weight
        return found

    def budget(self, mechanism: str) -> tuple[BudgetRow, ...]:
        """Return what a mechanism's mass is uncertain by, from each influence and at random.

        Averaged over the trials as the covariance is; how far the masses under them lie apart counts as random. The
        shapes of the force that no gauge reads are one force, whose size is averaged over as well. What is known
        beforehand has the degrees of freedom that the shots' reports state of it; what is random has as many as its
        variance spreads over the trials, ``2 (v / u(v))^2`` (JCGM 100:2008, G.3).
        """
        mass_kg, u_kg = self.mass_kg(mechanism)
        name = self.rows.masses[self.rows.mechanisms.index(mechanism)]
        # a sensor that reads high has a value that lies too low; what was weighed too heavy makes the rest too light
        counted = {one.identity: one.u for one in self.rows.influences}
        counted |= {identity: FORGOTTEN * counted[identity] for identity in self.rows.forgotten}
        sources = {one.identity: (one.source, counted[one.identity], one.unit, -1.0) for one in self.rows.influences}
        for of_weight, (_, u_added_kg) in zip(self.rows.added, self.rows.weights, strict=True):
            sources[of_weight] = (of_weight, u_added_kg, "kg", 1.0)
        scopes = {one.name: one.scope for one in self.rows.all_unknowns}
        known_to = {one.identity: one.degrees_of_freedom for one in self.rows.influences}
        at = self.names.index(name)
        random = np.array([float(one.estimate.covariance[at, at]) for one in self.trials])
        rows, shapes_kg = [], []
        for known, (source, u, unit, sign) in sources.items():
            if known not in self.likeliest.estimate.sources:  # exactly known
                continue
            found = np.array([one.estimate.contribution(known, name) for one in self.trials])
            random -= found**2
            contribution_kg = mass_kg * math.sqrt(float(self.weights @ found**2))
            if source.kind is SourceKind.UNREAD_SHAPE:
                shapes_kg.append(contribution_kg)
                continue
            change_kg = math.copysign(contribution_kg, sign * float(self.weights @ found))
            freedom = known_to.get(known, math.inf)
            rows.append(BudgetRow(source, contribution_kg, "B", change_kg / u, unit, freedom, scope=scopes[known]))
        if shapes_kg:
            rows.append(BudgetRow(UNREAD_FORCE, math.hypot(*shapes_kg), "B", scope="rig"))
        random_kg = math.sqrt(max(u_kg**2 - math.fsum(row.u_kg**2 for row in rows), 0.0))
        freedom = self._degrees_of_freedom((random_kg / mass_kg) ** 2, random)
        return (
            BudgetRow(ErrorSource(SourceKind.RANDOM_OF_SHOTS), random_kg, "A", degrees_of_freedom=freedom),
            *rows,
        )

    def _degrees_of_freedom(self, variance: float, under: Array) -> float:
        """Return those of a variance which the trials have `under` them; infinite where they agree."""
        spread = float(self.weights @ (under - self.weights @ under) ** 2)
        return 2.0 * variance**2 / spread if spread > 0.0 else math.inf

    def scatter(self, which: str) -> tuple[float, float, float]:
        """Return mean, lower and upper 95 % bound of a scatter, ``gain_rel`` or ``friction_rel``."""
        sizes = np.array([getattr(one.scatter, which) for one in self.trials])
        levels, places = np.unique(sizes, return_inverse=True)
        share = np.cumsum(np.bincount(places, self.weights))
        low, high = (float(levels[min(int(np.searchsorted(share, p)), levels.size - 1)]) for p in (0.025, 0.975))
        return float(self.weights @ sizes), low, high


def joint_fit(rows: JointRows, columns: Sequence[Column] = ()) -> JointFit:
    """Estimate everything that the shots share.

    Parameters
    ----------
    columns
        Further unknowns beside those that the rows have: what changed among the shots.
    """
    wanted, trials, best = rows.with_columns([*rows.columns, *columns]), list[Trial](), -math.inf
    for friction_rel in FRICTIONS_REL if FRICTION_SHARE in wanted.parameters else (0.0,):
        row: list[Trial] = []
        for gain_rel in GAINS_REL:
            row.append(_trial(wanted.whitened(Scatter(gain_rel, friction_rel)), FORCES[0], row[-1] if row else None))
            best = max(best, row[-1].log_likelihood)
            # a change among the shots only makes a smaller scatter likelier
            falling = len(row) > 1 and row[-1].log_likelihood < row[-2].log_likelihood
            if falling and row[-1].log_likelihood < best - HOPELESS:
                break
        trials += row
        if max(one.log_likelihood for one in row) < best - HOPELESS:
            break
    if wanted.shapes:
        likely = _weights(trials)
        for first in [one for one, weight in zip(trials, likely, strict=True) if weight > LEAST_WEIGHT * likely.max()]:
            trials += _other_forces(wanted.whitened(first.scatter), first)
    return JointFit(wanted, tuple(trials), _weights(trials))


def joint_fit_under(rows: JointRows, scatter: Scatter) -> JointFit:
    """Estimate everything that the shots share, where it is known by how much gains and friction do not repeat."""
    white = rows.whitened(scatter)
    first = _trial(white, FORCES[0], None)
    trials = [first, *(_other_forces(white, first) if rows.shapes else ())]
    return JointFit(rows, tuple(trials), _weights(trials))


def by_the_weight(fit: JointFit, anew: Callable[[JointRows], JointFit]) -> JointFit:
    """Take the mass by the weight, where shots with two tell it nearly as well without the certificate of what drives.

    What a certificate says of a gauge that is off by more than it allows would draw the mass to itself.

    Parameters
    ----------
    fit
        Fit that uses all that was stated; it is returned where there is no second weight, or too light a one.
    anew
        Function that fits other rows like it.
    """
    rows, mass = fit.rows.by_the_weight, fit.rows.masses[0]
    if rows is fit.rows:
        return fit
    by_weight = anew(rows)
    return by_weight if by_weight.u(mass) <= MOST_COST * fit.u(mass) else fit


def _other_forces(white: WhiteRows, first: Trial) -> list[Trial]:
    """Estimate everything with other sizes of the force that no gauge reads."""
    found = [first]
    for force in FORCES[1:]:
        found.append(_trial(white, force, found[-1]))
    return found[1:]


def _weights(trials: Sequence[Trial]) -> Array:
    """Return the probability of each trial, shape (n_trials,)."""
    levels = np.array([one.log_likelihood for one in trials])
    weights = np.exp(levels - levels.max()) * _widths(trials)
    return np.asarray(weights / weights.sum())


def _trial(white: WhiteRows, force: float, neighbour: Trial | None) -> Trial:
    """Estimate everything under one scatter, from where the estimate under a neighbour's is."""
    rows, scatter = white.rows, white.scatter
    start = {} if neighbour is None else neighbour.values
    estimate = solve(rows.all_unknowns, [white], rows.priors(force), start)
    exact = {name for name, (_, u) in zip(rows.added, rows.weights, strict=True) if u == 0}
    free = np.array([name not in exact for name in white.unknowns])
    level = -0.5 * (estimate.misfit + white.log_determinant) - scatter.unlikely
    # the sizes of the shapes have the density of a normal distribution, and the factor a half-Cauchy's per logarithm
    level += math.log(force / (1.0 + force**2)) - rows.shapes * math.log(force)
    log_likelihood = level + 0.5 * float(np.linalg.slogdet(estimate.covariance[np.ix_(free, free)])[1])
    return Trial(scatter, force, estimate, log_likelihood, level)


def _widths(trials: Sequence[Trial]) -> Array:
    """Return which part of the plane of scatters each trial stands for, by the trapezoidal rule."""

    def widths(which: str) -> Array:
        sizes = np.array([getattr(one.scatter, which) for one in trials])
        levels, places = np.unique(sizes, return_inverse=True)
        if levels.size == 1:
            return np.ones(sizes.size)
        edges = np.concatenate([levels[:1], 0.5 * (levels[1:] + levels[:-1]), levels[-1:]])
        return np.asarray(np.diff(edges)[places])

    return widths("gain_rel") * widths("friction_rel")
