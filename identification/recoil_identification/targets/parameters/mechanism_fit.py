"""Masses, first moments and inertias from the equations of motion, with the sensors' errors as further unknowns.

The regressor is measured like everything else: a gyro that reads 1 % high makes a whole column, and parts of
others, 1 % high in every row. Ordinary least squares takes that for motion, and white-noise total least squares
for something that averages out; both then state intervals that are far too narrow. Here the parameters and one
unknown for every such error are solved for together, each error restricted by its standard uncertainty, and by
what other sensors say of it:

    minimise  sum over rows and equations of ((Y(g) theta - Q(g)) / sigma)^2  +  sum of ((R g - v) / u)^2

by Gauss and Newton's iteration, of which each step is one `recoil_identification.inference.solve.solve`: every
equation of motion a block of rows, every calibration a prior (structured total least squares; generalized least
squares with the calibrations as observations).

Noise that the low-pass leaves on the regressor attenuates: it adds to the columns' energy, and its product with
the noise of the residual does not vanish on average. Both are seen in the pre-trigger baseline, where the
equations hold nothing else, and what they do to the estimate is taken off to first order (bias-compensated least
squares; P. Stoica, T. Soderstrom, "Bias correction in least-squares identification", Int. J. Control 35, 1982).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.mass import correlation_factor
from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.estimate import Estimate
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.targets.parameters.base_parameters import (
    BaseParameters,
    IdentifiablePart,
    identifiable_part,
    structural_base,
)
from recoil_identification.targets.parameters.load_cells import usable_equations
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.mechanism.mechanism_regressor import PARAMETER_UNITS, PARAMETERS, Geometry, regressor

PREFERRED = tuple(PARAMETERS.index(name) for name in (
    "m1", "m1 X1", "m1 Y1", "J1", "m3", "m3 b", "m3 d", "J3A", "m2 s2", "m2 d2", "m2", "J2",
))  # fmt: skip
"""Parameters that lead a combination before others do: those of the carriage rather than the tipping part's."""
LARGEST_U = 0.15
"""Standard uncertainty, in natural scales, beyond which a combination is not identifiable."""
LEAST_ROWS = 20
"""Fewest rows of an equation of motion; fewer say nothing of its noise."""
SMALLEST_SIGMA, LARGEST_SIGMA = 1e-6, 0.01
"""Shares of an equation's largest force that its noise may have; for what is beyond, the sensors must answer."""
MOST_ITERATIONS = 12


@dataclass(frozen=True, eq=False)
class MechanismFit(ReadOnlyArrays):
    """One shot's estimate of the mechanism's parameters.

    Attributes
    ----------
    structural
        Combinations that the equations that can be used could tell with motions of any kind.
    values, covariance : ndarray, shape (r,) and (r, r)
        Combinations of `structural` by this shot; standard uncertainties are infinite where the shot says nothing.
    identifiable
        Part of them that this shot tells, combined from the columns of `structural`.
    inferred
        Errors of the sensors and `values`, without what the regressor's noise takes off them, as rows and calibrations
        say.
    told
        The same where parameters that lead none of `identifiable` are zero: `errors` and `residuals` are of it.
    usable
        Numbers of the equations that can be used.
    residuals : ndarray, shape (n, 5)
        NaN where a row is not used.
    """

    structural: BaseParameters
    values: Array
    covariance: Array
    identifiable: IdentifiablePart
    inferred: Estimate
    told: Estimate
    usable: tuple[int, ...]
    residuals: Array

    @property
    def rows(self) -> int:
        """How many rows of equations of motion it rests on."""
        return self.inferred.rows

    @property
    def errors(self) -> Array:
        """Errors of the sensors, as this shot and their calibrations say, shape (n_errors,)."""
        return self.told.values[: -len(self.structural.leading)]

    @property
    def u_errors(self) -> Array:
        """Standard uncertainties of `errors`."""
        return np.asarray(np.sqrt(np.diag(self.inferred.covariance)[: self.errors.size]))


def natural_scales(geometry: Geometry, mass_kg: float) -> Array:
    """Return the natural size of every standard parameter, shape (12,).

    A mass is one specification mass of the recoiling part, lengths are those from C to the trunnion: no guess
    of the parameters is in it.
    """
    length = math.hypot(geometry.XA, geometry.YA)
    return mass_kg * np.array([1.0, length, length, length**2] * 3)


def structural_parameters(geometry: Geometry, usable: tuple[int, ...]) -> BaseParameters:
    """Find what the usable equations could tell with motions of any kind.

    Parameters
    ----------
    usable
        Equations.
    """
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.normal(0.0, 1.0, (3, 40, 5))
    design = regressor(geometry, q, qd, qdd) - regressor(geometry, *np.zeros((3, 1, 5)))
    return structural_base(design[:, list(usable)].reshape(-1, len(PARAMETERS)), PREFERRED)


def fit_mechanism(
    rows: MechanismRows,
    observations: Sequence[Prior],
    mass_kg: float,
    *,
    equations: tuple[int, ...] = (0, 1, 2, 3, 4),
    unknowns: BaseParameters | None = None,
) -> MechanismFit:
    """Estimate all that the equations of motion tell of a shot.

    Parameters
    ----------
    observations
        Priors of the sensors' errors, besides their own standard uncertainties.
    mass_kg
        Natural scale of a mass.
    equations
        Equations to use, as far as their loads are measured.
    unknowns
        Parameters to solve for in the place of what the equations can tell: the standard parameters are then these
        times the rows of `combinations`, of which every parameter has the leading one's share.

    Raises
    ------
    IdentificationError
        If no equation has enough rows.
    """
    combine, usable = usable_equations(rows.geometry, rows.columns["alpha"], rows.columns["beta"], rows.measured)
    usable = tuple(i for i in usable if i in equations)
    used = np.column_stack([rows.recoils if i == 4 else rows.trusted for i in range(5)])
    used[:, [i for i in range(5) if i not in usable]] = False
    usable = tuple(i for i in usable if np.count_nonzero(used[:, i]) >= LEAST_ROWS)
    used[:, [i for i in range(5) if i not in usable]] = False
    if not usable:
        raise IdentificationError(
            "no equation of motion has rows enough",
            expected=f"{LEAST_ROWS} or more without lost samples",
            found=f"{int(used.any(axis=1).sum())}",
            remedy="check for lost samples, raise the cut-off, or record faster",
        )
    structural = structural_parameters(rows.geometry, usable) if unknowns is None else unknowns
    leading = list(structural.leading)
    spread = np.eye(len(PARAMETERS))[:, leading] if unknowns is None else unknowns.combinations.T
    scales = natural_scales(rows.geometry, mass_kg)[leading]

    def both_sides(errors: Array, other: Mapping[str, Array] | None = None) -> tuple[Array, Array]:
        moved = rows if other is None else replace(rows, columns={**rows.columns, **other})
        Y, Q = moved.corrected(errors).equations()
        return (combine @ Y @ spread)[used], np.einsum("nij,nj->ni", combine, Q)[used]

    equation = np.broadcast_to(np.arange(5), used.shape)[used]
    names = tuple(PARAMETERS[j] for j in leading)
    parameters = [Unknown(PARAMETERS[j], PARAMETER_UNITS[j]) for j in leading]
    sought = [*(Unknown(error.source, error.unit) for error in rows.errors), *parameters]
    priors = [*(error.prior for error in rows.errors), *observations]
    u = np.array([error.u for error in rows.errors])
    errors = np.zeros(u.size)
    Y, Q = both_sides(errors)
    theta = solve(parameters, _blocks(parameters, Y, Q, equation, _largest(Q, equation)), []).values
    sigmas = _noise(Y @ theta - Q, Q, equation)
    for _ in range(MOST_ITERATIONS):
        columns = np.empty((Q.size, u.size))
        for k, step in enumerate(u):
            moved = errors.copy()
            moved[k] += step
            Y_moved, Q_moved = both_sides(moved)
            columns[:, k] = ((Y_moved - Y) @ theta - (Q_moved - Q)) / step
        blocks = _blocks(sought, np.hstack([columns, Y]), Q + columns @ errors, equation, sigmas)
        inferred = solve(sought, blocks, priors)
        free, left = inferred.about(names, priors)
        seen = left + free @ inferred.values[u.size :]
        leads = identifiable_part(free, seen, scales, LARGEST_U).base.leading
        # what this shot does not tell must not move the others
        untold = [
            Prior.of(ErrorSource(SourceKind.PARAMETER, name), name, 0.0)
            for j, name in enumerate(names)
            if j not in leads
        ]
        told = solve(sought, blocks, [*priors, *untold])
        before, errors_before, sigmas_before = theta, errors, sigmas
        errors, theta = told.values[: u.size], told.values[u.size :]
        Y, Q = both_sides(errors)
        sigmas = _noise(Y @ theta - Q, Q, equation)
        settled = np.nanmax(np.abs(sigmas / sigmas_before - 1.0)) < 1e-3
        if settled and np.max(np.abs(errors - errors_before) / u) < 1e-3 and np.allclose(theta, before, rtol=1e-4):
            break
    score = np.zeros(scales.size)
    for name, deviation in rows.noise.items():
        Y_noisy, Q_noisy = both_sides(errors, {name: rows.columns[name] + deviation})
        weight = 1.0 / sigmas_before[equation] ** 2
        score += (Y_noisy - Y).T @ (weight * ((Y_noisy - Y) @ theta - (Q_noisy - Q)))
    covariance = inferred.covariance[u.size :, u.size :]
    attenuation = covariance @ score
    # the variance of a variance from n independent samples is 2 / n of its square
    doubt = 2.0 / max(2.0 * rows.cutoff_hz * rows.baseline_s, 1.0)
    shift = free @ attenuation
    residuals = np.full(used.shape, np.nan)
    residuals[used] = Y @ theta - Q
    return MechanismFit(
        structural=structural,
        values=inferred.values[u.size :] + attenuation,
        covariance=covariance + doubt * np.outer(attenuation, attenuation),
        identifiable=identifiable_part(free, seen + shift, scales, LARGEST_U, doubt * np.outer(shift, shift)),
        inferred=inferred,
        told=told,
        usable=usable,
        residuals=residuals,
    )


def _blocks(
    sought: Sequence[Unknown], columns: Array, recorded: Array, equation: NDArray[np.int64], sigmas: Array
) -> list[LinearBlock]:
    """Return the rows of each equation, which have a noise of their own."""
    names = tuple(one.name for one in sought)
    numbers = [(i, equation == i) for i in np.unique(equation)]
    return [LinearBlock(names, columns[own], recorded[own], float(sigmas[i])) for i, own in numbers]


def _largest(Q: Array, equation: NDArray[np.int64]) -> Array:
    """Return every equation's largest force or moment, shape (5,)."""
    return np.array([max(float(np.max(np.abs(Q[equation == i]), initial=0.0)), 1e-9) for i in range(5)])


def _noise(residual: Array, Q: Array, equation: NDArray[np.int64]) -> Array:
    """Return every equation's standard deviation, widened by its correlation in time, shape (5,); NaN without rows."""
    sigmas, largest = np.full(5, np.nan), _largest(Q, equation)
    for i in np.unique(equation):
        own = residual[equation == i]
        deviation = math.sqrt(float(own @ own) / max(own.size - 2, 1)) * correlation_factor(own)
        sigmas[i] = min(max(deviation, SMALLEST_SIGMA * largest[i]), LARGEST_SIGMA * largest[i])
    return sigmas
