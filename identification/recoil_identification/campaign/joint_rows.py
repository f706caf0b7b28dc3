"""The summaries of many shots as rows about what they share.

With theta the parameters of a shot's summary (`recoil_identification.shot.shot_summary`), the rows of shot i are

    |R_i (theta_i - reference_i) - y_i|^2,   theta_i = [ln(M + d_i), sum of influences, ...] + own scatter

M is the mass of the mechanism without the mass d_i that was weighed and added to it, and every other parameter is what
its common influences are off together, each counted in its standard uncertainty. A gain that does not repeat from shot
to shot, and the friction, have an own part of variance D in each shot: it makes the errors of the shot's rows
correlated, with covariance ``1 + R D R'``, by whose Cholesky factor they are divided. The share of the resistance that
no gauge reads has one, too, of a size that is taken as known. The shapes of the force that no gauge reads are the
rig's: as each shot's own they would average away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.influence import Influence, influences_of
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.equation_of_motion import LARGEST_STEP
from recoil_identification.shot.shot_summary import (
    FRICTION_SHARE,
    LN_ACCELERATION,
    LN_MASS,
    UNREAD_SHARE,
    ShotSummary,
    Suspected,
)
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import PRESSURE_ROLES

USUAL_GAIN_REL, USUAL_FRICTION_REL = 5e-4, 0.03
"""Means of what is known of scatters beforehand, exponential: gauges repeat to .05 % or .1 %, packings to a few
percent."""
UNREAD_SHARE_SD = 0.002
"""Standard deviation from shot to shot of the share of the resistance that no gauge reads."""
FEW = 0.2
"""Groups of shots that are alike, as a share of the shots, beyond which they are not put together."""
LEAST_SHARE = 0.01
"""Share of the reference below which no recoiling mass is."""
MOST_KEPT_BYTES = 1 << 24
"""Of rows that were divided by a scatter, which a campaign's fits share: those of a hundred shots under all of them."""
FORGOTTEN = 30.0
"""Factor on the standard uncertainty of a certificate that is not used: beside what shots tell it is none."""
WEIGHED = ("{0:g} kg", "{0:g} kg (u {1:g} kg)", "{0!r} kg (u {1!r} kg)")
"""Spellings of a weight by its mass and uncertainty, the shortest first."""
GAINS = (*(f"ln {role}" for role in PRESSURE_ROLES), LN_ACCELERATION)
"""Parameters whose gains may not repeat from shot to shot."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviations from shot to shot of what does not repeat; that of the share that no gauge reads is fixed.

    Attributes
    ----------
    gain_rel
        Standard deviation of each gain.
    friction_rel
        Scatter of the friction, as a share of it.
    """

    gain_rel: float = 0.0
    friction_rel: float = 0.0

    @property
    def unlikely(self) -> float:
        """How unlikely it is beforehand: the negative logarithm of its density, up to a constant."""
        return self.gain_rel / USUAL_GAIN_REL + self.friction_rel / USUAL_FRICTION_REL

    def variance(self, parameter: str) -> float:
        """Return the variance of a parameter of a summary; that of a friction of which nothing is declared is 0."""
        known = {FRICTION_SHARE: self.friction_rel**2, UNREAD_SHARE: UNREAD_SHARE_SD**2}
        return {**dict.fromkeys(GAINS, self.gain_rel**2), **known}.get(parameter, 0.0)


@dataclass(frozen=True, eq=False)
class Column(ReadOnlyArrays):
    """A further unknown: by how much a parameter is off in some shots.

    Attributes
    ----------
    parameter
        Parameter of a summary; that of the mass is off by kg, counted in the reference, not by a share.
    shares : ndarray, shape (n_shots,)
        Share of its size in each shot.
    """

    name: str
    parameter: str
    shares: Array


@dataclass(frozen=True, eq=False)
class JointRows(ReadOnlyArrays):
    """Rows of all shots.

    Attributes
    ----------
    shots
        Shots in the order in which they were fired, each with a summary.
    mechanisms
        Name of each mass that is looked for.
    mechanism : ndarray of int, shape (n_shots,)
        Number of the mechanism of each shot.
    parameters
        Parameters of all summaries.
    influences
        Influences that the shots share.
    weights
        Mass in kg, negative if it was taken off, and standard uncertainty of each mass that was added, once: what was
        weighed twice, with another uncertainty, is two.
    weight : ndarray of int, shape (n_shots,)
        Number of the weight that each shot has; -1 for none.
    reference_kg
        Mass from which the logarithms of the masses count.
    reference, seen : ndarray, shape (n_shots, n_parameters)
    triangle : ndarray, shape (n_shots, n_parameters, n_parameters)
        Zero where a shot lacks a parameter.
    loads : ndarray, shape (n_shots, n_parameters, n_influences)
        Standard uncertainty by which an influence moves a parameter of a shot.
    columns
        Further unknowns.
    suspected
        Shape that no rig states, of each parameter that is the size of one, by its name.
    forgotten
        Identities of influences of which is not used what was stated of them.
    divided
        Rows as the scatters divided them that were asked for. They hang on no column, and most of a
        campaign is fits with one more of them; whoever replaces anything else begins anew.
    """

    shots: tuple[CampaignShot, ...]
    mechanisms: tuple[str, ...]
    mechanism: NDArray[np.intp]
    parameters: tuple[str, ...]
    influences: tuple[Influence, ...]
    weights: tuple[tuple[float, float], ...]
    weight: NDArray[np.intp]
    reference_kg: float
    reference: Array
    triangle: Array
    seen: Array
    loads: Array
    columns: tuple[Column, ...] = ()
    suspected: Mapping[str, Suspected] = field(default_factory=dict)
    forgotten: frozenset[str] = frozenset()
    divided: dict[Scatter, tuple[Array, Array, float]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, shots: Sequence[CampaignShot], mechanism_of: Mapping[str, str]) -> JointRows:
        """Stack summaries.

        Parameters
        ----------
        shots
            Shots in order, each with a summary.
        mechanism_of
            The mechanism of each configuration.
        """
        summaries = [_summary(shot) for shot in shots]
        parameters = tuple(dict.fromkeys(one.name for summary in summaries for one in summary.parameters))
        influences = influences_of(shots)
        suspected = {one.name: one.suspected for summary in summaries for one in summary.parameters if one.suspected}
        places = {influence.identity: at for at, influence in enumerate(influences)}
        n, k = len(shots), len(parameters)
        reference, seen, triangle = np.zeros((n, k)), np.zeros((n, k)), np.zeros((n, k, k))
        loads = np.zeros((n, k, len(influences)))
        for i, summary in enumerate(summaries):
            at = [parameters.index(one.name) for one in summary.parameters]
            reference[i, at], seen[i, at] = summary.reference, summary.seen
            triangle[i][np.ix_(at, at)] = summary.triangle
            for place, parameter in zip(at, summary.parameters, strict=True):
                for identity, u in parameter.influences:
                    if u > 0:
                        loads[i, place, places[identity]] = u
        named = [mechanism_of[shot.configuration] for shot in shots]
        mechanisms = tuple(one for one in dict.fromkeys(mechanism_of.values()) if one in named)
        added = [(shot.added_mass_kg, shot.u_added_mass_kg) for shot in shots]
        weights = tuple(dict.fromkeys(one for one in added if one[0] != 0))
        return cls(
            shots=tuple(shots),
            mechanisms=mechanisms,
            mechanism=np.array([mechanisms.index(name) for name in named], dtype=np.intp),
            parameters=parameters,
            influences=influences,
            weights=weights,
            weight=np.array([weights.index(one) if one[0] != 0 else -1 for one in added], dtype=np.intp),
            reference_kg=float(np.mean([shot.mass_kg - shot.added_mass_kg for shot in shots])),
            reference=reference,
            triangle=triangle,
            seen=seen,
            loads=loads,
            suspected=suspected,
        )

    @cached_property
    def alike(self) -> list[NDArray[np.intp]]:
        """Shots that all unknowns move alike, in groups."""
        moved = [self.mechanism, self.weight, *(column.shares for column in self.columns)]
        features = np.column_stack([*moved, self.loads.reshape(len(self.shots), -1)])
        groups = np.unique(features, axis=0, return_inverse=True)[1].reshape(-1)
        return [np.flatnonzero(groups == group) for group in dict.fromkeys(groups.tolist())]

    @property
    def mechanism_of(self) -> dict[str, str]:
        """Mechanism of each configuration, the first mechanism first."""
        pairs = zip(self.mechanism.tolist(), (shot.configuration for shot in self.shots), strict=True)
        return {configuration: self.mechanisms[at] for at, configuration in sorted(pairs)}

    @property
    def masses(self) -> tuple[str, ...]:
        """Names of the unknowns that are masses: logarithms over the reference."""
        return tuple(f"ln mass of {name}" for name in self.mechanisms)

    @cached_property
    def weighed(self) -> tuple[str, ...]:
        """Name of each weight: its kg, and its uncertainty and all digits where that is needed to tell it apart."""
        spelled = [[spelling.format(*one) for one in self.weights] for spelling in WEIGHED]
        return tuple(
            next((names[at] for names in spelled if names.count(names[at]) == 1), spelled[-1][at])
            for at in range(len(self.weights))
        )

    @cached_property
    def added(self) -> tuple[ErrorSource, ...]:
        """Names of the added masses' errors."""
        return tuple(ErrorSource(SourceKind.ADDED_MASS, detail=name) for name in self.weighed)

    @cached_property
    def all_unknowns(self) -> tuple[Unknown, ...]:
        """All that the rows hang on."""
        return (
            *(Unknown(name, scope="rig", largest_step=LARGEST_STEP) for name in self.masses),
            *(Unknown(name, scope="rig") for name in self.added),
            *(Unknown(one.identity, scope=one.scope) for one in self.influences),
            # a shape that no rig states is linear however large, and in units of its own
            *(
                Unknown(one.name) if one.parameter in self.suspected else Unknown(one.name, largest_step=LARGEST_STEP)
                for one in self.columns
            ),
        )

    def priors(self, force: float = 1.0) -> list[Prior]:
        """Return the priors of all influences and added masses, each once and counted in its standard uncertainty.

        Parameters
        ----------
        force
            Factor on what the rig states of the force that no gauge reads.
        """
        if force not in self._priors:
            self._priors[force] = self._stated(force)
        return self._priors[force]

    @cached_property
    def _priors(self) -> dict[float, list[Prior]]:
        """The priors by that factor: no scatter changes them."""
        return {}

    def _stated(self, force: float) -> list[Prior]:
        known: dict[str, float] = dict(zip(self.added, (1.0 if u > 0 else 0.0 for _, u in self.weights), strict=True))
        known |= {one.identity: force if one.is_shape else 1.0 for one in self.influences}
        known |= dict.fromkeys(self.forgotten, FORGOTTEN)
        exact = [Prior.of(name, name, 0.0) for name, u in known.items() if u == 0]
        names = tuple(name for name, u in known.items() if u > 0)
        if not names:
            return exact
        variances = np.square([known[name] for name in names])
        return [*exact, Prior(names, names, np.eye(len(names)), np.zeros(len(names)), np.diag(variances))]

    @property
    def shapes(self) -> int:
        """Number of shapes of the force that no gauge reads."""
        return sum(one.is_shape for one in self.influences)

    @property
    def by_the_weight(self) -> JointRows:
        """Rows of shots with two weights without what was stated of the gauges that drive; the same of all others.

        What drives both is the same, and the ratio of their accelerations is that of their masses.
        """
        parameter = f"ln {PRESSURE_ROLES[0]}"
        of_column = any(one.parameter == parameter for one in self.columns)
        if np.unique(self.weight).size < 2 or parameter not in self.parameters or of_column:
            return self
        moved = self.loads[:, self.parameters.index(parameter)].sum(axis=0)
        gauges = [one.identity for one, moves in zip(self.influences, moved, strict=True) if moves and one.is_sensor]
        return replace(self, forgotten=frozenset(gauges))

    def with_columns(self, columns: Sequence[Column]) -> JointRows:
        """Look for further unknowns."""
        return replace(self, columns=tuple(columns))

    def without(self, number: int) -> JointRows | None:
        """Leave a shot out, by its place; None if it is the only one of its mechanism."""
        if np.count_nonzero(self.mechanism == self.mechanism[number]) < 2:
            return None
        kept = (replace(one, shares=np.delete(one.shares, number)) for one in self.columns)
        arrays = {
            name: getattr(self, name) for name in ("mechanism", "weight", "reference", "seen", "triangle", "loads")
        }
        return replace(
            self,
            shots=(*self.shots[:number], *self.shots[number + 1 :]),
            columns=tuple(one for one in kept if one.shares.any()),
            divided={},
            **{name: np.delete(one, number, axis=0) for name, one in arrays.items()},
        )

    def whitened(self, scatter: Scatter) -> WhiteRows:
        """Divide the rows of each shot by the factor of their covariance."""
        divided = self.divided.get(scatter)
        if divided is None:
            divided = self._divide(scatter)
            if len(self.divided) * self.triangle.nbytes < MOST_KEPT_BYTES:
                self.divided[scatter] = divided
        return WhiteRows(self, scatter, *divided)

    def _divide(self, scatter: Scatter) -> tuple[Array, Array, float]:
        n, k = self.seen.shape
        variances = np.tile([scatter.variance(name) for name in self.parameters], (n, 1))
        if UNREAD_SHARE in self.parameters:  # where a rig states it as exact it does not scatter
            place = self.parameters.index(UNREAD_SHARE)
            variances[:, place] *= self.loads[:, place].any(axis=1)
        covariance = np.eye(k) + (self.triangle * variances[:, np.newaxis]) @ self.triangle.transpose(0, 2, 1)
        factors = np.linalg.cholesky(covariance)
        rows = np.linalg.solve(factors, np.concatenate([self.triangle, self.seen[:, :, np.newaxis]], axis=2))
        log_determinant = 2.0 * float(np.log(np.diagonal(factors, axis1=1, axis2=2)).sum())
        return rows[:, :, :-1], rows[:, :, -1], log_determinant

    def modelled(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the parameters of each shot, and their derivatives.

        Returns
        -------
        theta : ndarray, shape (n_shots, n_parameters)
        derivatives : ndarray, shape (n_shots, n_parameters, n_unknowns)
        """
        at, n = self.parameters.index(LN_MASS), len(self.shots)
        masses = self.reference_kg * np.exp([values[name] for name in self.masses])
        added = np.array([[mass_kg + u * values[name], u] for name, (mass_kg, u) in self._added]).reshape(-1, 2)
        added = np.vstack([added, np.zeros(2)])  # the last one is that of a shot without
        bare = masses[self.mechanism]
        whole = bare + added[self.weight, 0]
        for column in self.columns:
            if column.parameter == LN_MASS:
                whole = whole + self.reference_kg * values[column.name] * column.shares
        whole = np.maximum(whole, LEAST_SHARE * self.reference_kg)
        common = np.array([values[one.identity] for one in self.influences])
        theta = self.loads @ common if self.influences else np.zeros((n, len(self.parameters)))
        theta[:, at] += np.log(whole)
        first, second = len(self.masses), len(self.masses) + len(self.weights)
        third = second + len(self.influences)
        derivatives = np.zeros((n, len(self.parameters), third + len(self.columns)))
        shots = np.arange(n)
        derivatives[shots, at, self.mechanism] = bare / whole
        heavier = self.weight >= 0
        derivatives[shots[heavier], at, first + self.weight[heavier]] = (added[self.weight, 1] / whole)[heavier]
        derivatives[:, :, second:third] = self.loads
        for number, column in enumerate(self.columns):
            place = self.parameters.index(column.parameter)
            if place == at:
                derivatives[:, at, third + number] = self.reference_kg * column.shares / whole
                continue
            theta[:, place] += values[column.name] * column.shares
            derivatives[:, place, third + number] = column.shares
        return theta, derivatives

    @property
    def _added(self) -> list[tuple[str, tuple[float, float]]]:
        return list(zip(self.added, self.weights, strict=True))


@dataclass(frozen=True, eq=False)
class WhiteRows(ReadOnlyArrays):
    """Rows of all shots whose errors are independent: a block of the inference.

    Attributes
    ----------
    scatter
        Scatter by which they were divided.
    triangle : ndarray, shape (n_shots, n_parameters, n_parameters)
    seen : ndarray, shape (n_shots, n_parameters)
    log_determinant
        Log determinant of the covariance of all rows, by which they were divided.
    """

    rows: JointRows
    scatter: Scatter
    triangle: Array
    seen: Array
    log_determinant: float

    @cached_property
    def unknowns(self) -> tuple[str, ...]:
        """Names of all that the rows hang on."""
        return tuple(unknown.name for unknown in self.rows.all_unknowns)

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the common unknowns leave of the rows, and the derivatives; shots that are alike are one."""
        if len(self.rows.alike) > FEW * len(self.rows.shots):
            rest, slopes = self.by_shot(values)
            return rest.reshape(-1), slopes.reshape(-1, slopes.shape[-1])
        theta, derivatives = self.rows.modelled(values)
        left, moved = [], []
        for shot, condensed in self._condensed:
            off = condensed[:, :-1] @ (theta[shot] - self.rows.reference[shot])
            left.append(condensed[:, -1] - off)
            moved.append(condensed[:, :-1] @ derivatives[shot])
        return np.concatenate(left), np.concatenate(moved)

    @cached_property
    def _condensed(self) -> list[tuple[int, Array]]:
        """The rows of shots with the same parameters as a triangle, with the first of them: about its reference."""
        found = []
        for shots in self.rows.alike:
            first = shots[0]
            apart = (self.rows.reference[shots] - self.rows.reference[first])[:, :, np.newaxis]
            seen = self.seen[shots] + (self.triangle[shots] @ apart)[:, :, 0]
            stacked = np.concatenate([self.triangle[shots], seen[:, :, np.newaxis]], axis=2)
            triangle = np.asarray(np.linalg.qr(stacked.reshape(-1, stacked.shape[2]), mode="r"))
            found.append((int(first), triangle))
        return found

    def by_shot(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the same, shapes (n_shots, n_parameters) and (n_shots, n_parameters, n_unknowns)."""
        theta, derivatives = self.rows.modelled(values)
        off = (self.triangle @ (theta - self.rows.reference)[:, :, np.newaxis])[:, :, 0]
        return self.seen - off, self.triangle @ derivatives


def _summary(shot: CampaignShot) -> ShotSummary:
    if shot.summary is None:
        raise ValueError(f"shot {shot.name} has no summary")
    return shot.summary
