"""The mass together with the scales of the sensors, restricted by their calibrations.

A shot sees every force in another mixture: first the breech, then brake and recuperator. If the
breech gauge reads 0.7 % low, the mass that its phase gives disagrees with the mass that the brake's
phase gives. So the equation of motion is solved for the mass and for an error of every sensor at once
(`recoil_identification.rows.equation_of_motion`); each error is restricted by its standard uncertainty, the
accelerometer's also by the camera, which measured the same motion in another scale
(`recoil_identification.rows.sensor_priors`). This is Bayesian regression with normal priors, or
generalized least squares with the calibrations as further observations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.estimate.monte_carlo import Draw
from recoil_identification.estimate.rounding import in_kg
from recoil_identification.inference.block import Block, JointBlock, LinearBlock
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.estimate import Estimate, residual_against_none
from recoil_identification.inference.score import Scores
from recoil_identification.inference.solve import MOST_STEPS, solve
from recoil_identification.inference.unknown import Prior, Reliability
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.late_readings import GAS
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.rows.sensor_priors import RELEASE
from recoil_identification.rows.travel_rows import ForcedTravel, TravelRows
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression

FURTHEST_DRAW = 1.0
"""Largest departure of a drawn logarithm of the mass that is kept."""
UNREAD = (SourceKind.UNREAD_SHARE, SourceKind.UNREAD_SHAPE)
"""Kinds of sources that are resistance that no gauge reads."""


@dataclass(frozen=True, eq=False)
class Calibration(ReadOnlyArrays):
    """Mass and sensor errors as this shot and the calibrations together say.

    Attributes
    ----------
    estimate
        Estimate of a constant mass.
    noise
        Noise of every sample behind the regression's filter.
    block
        The rows of the motion.
    correlation
        Correlation of the rows of the motion and of the camera, see
        `recoil_identification.rows.row_noise.correlation_of`.
    inferred
        Values and covariance of all unknowns.
    common, own
        Priors that certificates state, and those that this shot alone knows beside its rows, see
        `recoil_identification.rows.sensor_priors`.
    further
        Rows of the breech gauge once the bore is empty, and of several gauges' differences, if there are any.
    camera
        Rows of its frames, if there are any: beside those of the motion, or in their place where the forces alone tell
        it.
    misfit
        Standard deviation of the mass's logarithm that a line's record says of beside its rows' noise.
    """

    estimate: MassEstimate
    noise: RowNoise
    block: EquationOfMotion
    inferred: Estimate
    common: tuple[Prior, ...]
    own: tuple[Prior, ...]
    correlation: Correlation | None = None
    further: tuple[LinearBlock, ...] = ()
    camera: CameraRows | ForcedTravel | None = None
    misfit: float = 0.0

    @property
    def m0_kg(self) -> float:
        """First estimate of the mass, from which `inferred` counts."""
        return self.block.m0_kg

    @cached_property
    def rows(self) -> JointBlock:
        """The rows of the motion, those of the camera after them."""
        return joined_rows(self.block, self.camera, self.correlation)

    @property
    def by_rows(self) -> MassEstimate:
        """The estimate by the noise of its rows alone, without what a line's record says beside it."""
        random, *others = self.estimate.budget
        u_kg = math.sqrt(max(random.u_kg**2 - (self.misfit * self.estimate.mass_kg) ** 2, 0.0))
        row = replace(random, u_kg=u_kg, degrees_of_freedom=self.noise.degrees_of_freedom)
        return replace(self.estimate, budget=(row, *others)) if self.misfit else self.estimate

    @property
    def is_by_camera(self) -> bool:
        """Whether frames stand in the place of the motion's rows."""
        return isinstance(self.camera, ForcedTravel)

    @property
    def values(self) -> dict[str, float]:
        """Values of all unknowns, by name."""
        return {unknown.name: self.inferred.value(unknown.name) for unknown in self.inferred.unknowns}

    @property
    def gauge_errors(self) -> Array:
        """Relative errors of the measured forces, shape (n_gauges,)."""
        return np.asarray(np.expm1([self.inferred.value(gauge.name) for gauge in self.block.gauges]))

    @property
    def friction_error_n(self) -> float:
        """By how much the declared friction is too large."""
        return self.inferred.value(motion.FRICTION.name)

    @property
    def acceleration_error(self) -> float:
        """Relative error of the scale of what measured the motion."""
        return math.expm1(self.inferred.value(self.block.scale.name))

    @property
    def bias_m_s2(self) -> float:
        """Error of its zero."""
        return self.inferred.value(motion.ZERO.name)

    @property
    def release_m_s(self) -> float:
        """Velocity that stop and packing gave the part while they let it go."""
        return self.inferred.value(motion.RELEASE.name)

    @property
    def shifts_m_s2(self) -> Array:
        """Size of each shape of the regression's `shifts`, shape (n_shifts,)."""
        return np.array([self.inferred.value(name) for name in self._shifts])

    @property
    def u_shifts_m_s2(self) -> Array:
        """Standard uncertainty of each of them, shape (n_shifts,)."""
        return np.array([self.inferred.u(name) for name in self._shifts])

    @property
    def _shifts(self) -> list[str]:
        shifts = self.block.regression.shifts
        return [] if shifts is None else [motion.shift(i).name for i in range(shifts.shape[1])]

    @property
    def sources(self) -> tuple[ErrorSource, ...]:
        """Sources of what is known beforehand, in the order of the inference; those known exactly are left out."""
        return sources_of(self.inferred)

    @property
    def pulls(self) -> dict[ErrorSource, float]:
        """By how many of its standard uncertainties each sensor is off; those known exactly are left out."""
        return dict(zip(self.sources, self.inferred.pulls.tolist(), strict=True))

    @property
    def normalised_residuals(self) -> dict[ErrorSource, float]:
        """The same over its own standard deviation (Baarda's w-test of one observation among the others).

        Standard normal if all calibrations hold. It exceeds the pull where the shot can tell little of a sensor; 0
        where it can tell nothing.
        """
        return dict(zip(self.sources, self.inferred.normalised_residuals.tolist(), strict=True))

    @property
    def judged_residuals(self) -> dict[ErrorSource, float]:
        """Normalised residuals of what can be off.

        How the stop lets go is of the firing, and of no sensor; a force of unknown shape is no certificate that is
        wrong. What can only be late is judged against no delay at all where it is found early.
        """
        pulls = self.pulls
        return {
            source: residual_against_none(w, pulls[source]) if source.is_late_alone and w < 0 else w
            for source, w in self.normalised_residuals.items()
            if source != RELEASE and source.kind is not SourceKind.UNREAD_SHAPE
        }

    @property
    def known_beforehand(self) -> dict[ErrorSource, tuple[float, str]]:
        """Standard uncertainty of each sensor beside the shot, and its unit; ``1`` for a logarithm or a share."""
        units = {row.source: row.sensitivity_per for row in self.estimate.budget}
        found = zip(self.sources, self.inferred.u_sources.tolist(), strict=True)
        return {source: (u, units.get(source, "1")) for source, u in found}

    def with_changes(self, shapes: Array, u: float = math.inf) -> Calibration:
        """Let the mass's logarithm change in given shapes, and estimate anew.

        Parameters
        ----------
        shapes : ndarray, shape (n, n_shapes)
            Shapes on the regression's grid.
        u
            Standard uncertainty of each shape's size, which is expected to be zero; infinite if nothing is known. With
            0 it is none, and `inferred` is what it was, with the columns of the shapes.

        Returns
        -------
        Calibration
            Calibration with the change; its `estimate` is still that of a constant mass.
        """
        changing = replace(self, block=replace(self.block, changes=shapes))
        sizes = [motion.change(i) for i in range(shapes.shape[1])]
        known = [Prior.of(size.name, size.name, u) for size in sizes] if math.isfinite(u) else []
        priors = [*self.common, *self.own, *known]
        blocks: list[Block] = [changing.rows, *self.further]
        named = {one.name for one in self.inferred.unknowns}
        asked = [one.unknown for one in self.block.causes if one.source not in named]
        unknowns, most_steps = [*self.inferred.unknowns, *asked, *sizes], MOST_STEPS if u > 0 else 0
        return replace(changing, inferred=solve(unknowns, blocks, priors, self.values, most_steps=most_steps))

    def with_cause(self, cause: Cause, late: Mapping[str, Array] = MappingProxyType({})) -> Calibration:
        """Let the readings have one further error, of whose size nothing is known, and estimate anew.

        Parameters
        ----------
        late
            Argument of `with_causes`.

        Returns
        -------
        Calibration
            Calibration with the error; its `estimate` is still that without it.
        """
        with_it = self.with_causes([cause], late)
        blocks: list[Block] = [with_it.rows, *with_it.further]
        unknowns = [*self.inferred.unknowns, cause.unknown]
        return replace(with_it, inferred=solve(unknowns, blocks, [*self.common, *self.own], self.values))

    def with_causes(self, causes: Sequence[Cause], late: Mapping[str, Array] = MappingProxyType({})) -> Calibration:
        """Give the rows columns for further errors of the readings; `inferred` is without them.

        Parameters
        ----------
        late
            Amounts that a size of one of a cause adds to the late readings of the breech gauge, by its source.
        """
        camera, block = self.camera, replace(self.block, causes=(*self.block.causes, *causes))
        if isinstance(camera, CameraRows):
            camera = camera.with_causes(causes, self.block.regression)
        further = (one.with_columns(late) if GAS.name in one.unknowns else one for one in self.further)
        return replace(self, block=block, camera=camera, further=tuple(further))

    def scores_of(self, sources: Sequence[str]) -> Scores:
        """Score unknowns that `inferred` has not, by what it leaves of all rows."""
        values = self.values | dict.fromkeys(sources, 0.0)
        names = [*(one.name for one in self.inferred.unknowns), *sources]
        blocks: list[Block] = [self.rows, *self.further]
        left, derivatives = zip(*(_of(block, values, names) for block in blocks), strict=True)
        whole, known = np.vstack(derivatives), len(self.inferred.unknowns)
        return Scores.of(np.concatenate(left), whole[:, :known], self.inferred.covariance, whole[:, known:])

    def scores(self, columns: Array) -> Scores:
        """Score columns of `rows` that no unknown stands for, shape (n_rows, n_columns), by what is left of these."""
        left, derivatives = self.rows.linearised(self.values)
        at = [[one.name for one in self.inferred.unknowns].index(name) for name in self.rows.unknowns]
        return Scores.of(left, derivatives, self.inferred.covariance[np.ix_(at, at)], columns)

    def without_prior(self, source: str) -> Calibration:
        """Forget what is known beforehand of one source, and estimate anew; `estimate` stays what it is."""
        common, own = (tuple(one for one in priors if one.sources != (source,)) for priors in (self.common, self.own))
        blocks: list[Block] = [self.rows, *self.further]
        inferred = solve(self.inferred.unknowns, blocks, [*common, *own], self.values)
        return replace(self, common=common, own=own, inferred=inferred)

    @cached_property
    def without_unread(self) -> Calibration:
        """The same rows under the condition that gauges and friction read all of the resistance; `estimate` stays."""
        own = tuple(
            Prior.of(prior.sources[0], prior.unknowns[0], 0.0) if _is_unread(prior) else prior for prior in self.own
        )
        if not any(_is_unread(prior) for prior in self.own):
            return self
        blocks: list[Block] = [self.rows, *self.further]
        inferred = solve(self.inferred.unknowns, blocks, [*self.common, *own], self.values)
        return replace(self, own=own, inferred=inferred)

    def correct(self, regression: Regression, but: str = "") -> tuple[Array, Array]:
        """Return a' and F' with the sensors' errors, the release and all causes taken off, shape (n,) each.

        Parameters
        ----------
        regression
            Regression on the grid of the block's own; the causes are as that one's filter left them.
        but
            Source of a cause that is left in.
        """
        zero = self.bias_m_s2 * regression.released + self.release_m_s * regression.release_per_s
        if regression.shifts is not None:
            zero = zero + regression.shifts @ self.shifts_m_s2
        per_gauge = 1.0 / (1.0 + self.gauge_errors)
        forces = regression.forces_n[:, :-1] @ per_gauge + regression.forces_n[:, -1]
        for cause in (one for one in self.block.causes if one.source != but):
            size = self.inferred.value(cause.source)
            zero += size * cause.acceleration_m_s2
            forces += cause.forces_n @ (size * per_gauge)
            if cause.beside_n is not None:
                forces += size * cause.beside_n
        a = (regression.acceleration_m_s2 - zero) / (1.0 + self.acceleration_error)
        return a, np.asarray(forces - self.friction_error_n * regression.friction_direction)

    def errors_left(self, regression: Regression, span: slice = slice(None)) -> Array:
        """Return what may be left of the sensors' errors in a' at some samples, shape (n_samples, n_errors).

        Each column is one standard uncertainty of an error that is independent of the others.
        """
        rows = np.arange(regression.times_s.size)[span]
        sigma = np.ones(rows.size)
        block = replace(self.block, regression=regression, rows=rows, sigma_m_s2=sigma, changes=None)
        _, derivatives = block.linearised(self.values)
        # of those that the equation has, the mass apart
        n = len(block.unknowns)
        covariance = self.inferred.covariance[1:n, 1:n]
        # each in its own standard uncertainty: beside the variance of a force in N that of a scale would be rounding
        u = np.sqrt(np.diag(covariance))
        known = np.where(u > 0, u, 1.0)
        variances, directions = np.linalg.eigh(covariance / np.outer(known, known))
        return np.asarray((derivatives[:, 1:] * u) @ (directions * np.sqrt(np.maximum(variances, 0.0))))

    def __str__(self) -> str:
        return f"{self.estimate}\n{self.inferred}"

    def __repr__(self) -> str:
        size = len(self.inferred.unknowns)
        return f"Calibration({in_kg(self.estimate.mass_kg, self.estimate.u_kg)}, {size} unknowns)"

    def draws(self, known: Mapping[str, Reliability] = MappingProxyType({})) -> Draw:
        """Return what draws masses, linearly in the logarithms of mass and scales.

        Parameters
        ----------
        known
            Knowledge of the uncertainties of sources, see `recoil_identification.estimate.reliability`.

        Returns
        -------
        callable
            A draw is NaN that is off by more than `FURTHEST_DRAW`.
        """
        degrees_of_freedom = self.noise.degrees_of_freedom

        def draw(rng: np.random.Generator, count: int) -> Array:
            logs = self.inferred.draws(motion.MASS.name, rng, count, degrees_of_freedom, known)
            if self.misfit:
                logs += self.misfit * rng.standard_normal(count)
            # so far off no model holds that is linear in the logarithms
            logs[np.abs(logs - self.inferred.value(motion.MASS.name)) > FURTHEST_DRAW] = np.nan
            return np.asarray(self.m0_kg * np.exp(logs))

        return draw


def _of(block: Block, values: Mapping[str, float], names: Sequence[str]) -> tuple[Array, Array]:
    """Return what a block's rows leave at some values, and their derivatives by all unknowns."""
    left, derivatives = block.linearised(values)
    whole = np.zeros((left.size, len(names)))
    whole[:, [names.index(name) for name in block.unknowns]] = derivatives
    return left, whole


def _is_unread(prior: Prior) -> bool:
    """Return whether a prior is of the share or of the shapes of the resistance that no gauge reads."""
    return isinstance(prior.sources[0], ErrorSource) and prior.sources[0].kind in UNREAD and not prior.exact


def sources_of(inferred: Estimate) -> tuple[ErrorSource, ...]:
    """Return the sources that an inference knows as names: every prior of a calibration is made with one."""
    return tuple(source for source in inferred.sources if isinstance(source, ErrorSource))


def joined_rows(
    block: EquationOfMotion, camera: CameraRows | ForcedTravel | None, correlation: Correlation | None
) -> JointBlock:
    """Put the rows of a camera's frames after those of the motion, or in their place."""
    if isinstance(camera, ForcedTravel):
        return JointBlock((TravelRows(block, camera),), correlation)
    return JointBlock((block,) if camera is None else (block, camera), correlation)
