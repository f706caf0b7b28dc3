"""The linear model behind a camera's alignment by motion: one Gauss-Newton step, and the likelihood's shape.

The model stands in `recoil_processing.alignment.motion_alignment`. Columns and camera positions are whitened by the
filter of the walk that the accelerometer's noise integrates to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.lag_fit import NEGLIGIBLE_STEP
from recoil_processing.alignment.velocity_walk import WalkFilter
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.picture_bends import picture_bends

LONGEST_STEP_S = 2e-3
"""Time by which the offset may move at once: over it a recoil's travel is nearly a parabola."""
LEAST_INDEPENDENCE = 1e-10
"""Smallest sine of the angle between a column and the others."""


@dataclass(frozen=True, eq=False)
class MotionModel(ReadOnlyArrays):
    """Both records of one motion.

    The clocks map by ``t_ref = t + shift + drift (t - origin)``: shift and drift are nearly independent
    wherever the camera's clock has its zero.

    Attributes
    ----------
    times_s, positions_m : ndarray, shape (n_frames,)
        Frames with a position, on the camera's clock.
    origin_s
        Middle of the camera's record.
    integral
        Integral of the acceleration, on the reference clock.
    shifted_from_s
        Instant of the reference clock from which on the acceleration's zero may be another; None if it is the same
        throughout.
    kicks_s
        Instants of the reference clock at which the acceleration's integral may be wrong by a velocity: samples that
        were lost there and bridged.
    u_bend_m
        Standard uncertainty of what the camera's optics bend the travel by in the first of
        `recoil_processing.picture_bends`; half of it is the next one's. 0 where they bend nothing.
    """

    times_s: Array
    positions_m: Array
    origin_s: float
    integral: DoubleIntegral
    shifted_from_s: float | None = None
    kicks_s: tuple[float, ...] = ()
    u_bend_m: float = 0.0

    def bends(self, inside: Flags) -> tuple[Array, Array]:
        """Return the bends of the picture at some of the frames, shape (n_inside, n_bends), and their u in metres."""
        if not self.u_bend_m > 0:
            return np.zeros((int(np.count_nonzero(inside)), 0)), np.zeros(0)
        shapes = np.column_stack(picture_bends(self.positions_m - np.min(self.positions_m)))[inside]
        return shapes, np.array([self.u_bend_m / 2**number for number in range(shapes.shape[1])])

    def mapped_s(self, shift_s: float, drift: float) -> Array:
        """Instants of the frames on the reference clock, shape (n_frames,)."""
        return np.asarray(self.times_s + shift_s + drift * (self.times_s - self.origin_s))

    def constants(self, inside: Flags, mapped_s: Array) -> Array:
        """Columns of the integration constants at some of the frames, shape (n_inside, 3 + n_errors).

        Behind them those of `errors`.

        Parameters
        ----------
        inside : ndarray of bool, shape (n_frames,)
        mapped_s : ndarray, shape (n_inside,)
            Instants of the positions on the reference clock.
        """
        since = self.times_s[inside] - self.origin_s
        return np.column_stack([np.ones_like(since), since, 0.5 * since**2, *self.errors(mapped_s)])

    def errors(self, mapped_s: Array) -> list[Array]:
        """Travel that a shifted zero, and then each kick, makes of nothing, at instants of the reference clock."""
        kicked = [np.maximum(mapped_s - kick_s, 0.0) for kick_s in self.kicks_s]
        if self.shifted_from_s is None:
            return kicked
        return [0.5 * np.maximum(mapped_s - self.shifted_from_s, 0.0) ** 2, *kicked]

    def error_rates(self, mapped_s: Array) -> list[Array]:
        """Rates of change of `errors`, m/s."""
        kicked = [np.where(mapped_s > kick_s, 1.0, 0.0) for kick_s in self.kicks_s]
        if self.shifted_from_s is None:
            return kicked
        return [np.maximum(mapped_s - self.shifted_from_s, 0.0), *kicked]


@dataclass(frozen=True, eq=False)
class MotionSolution(ReadOnlyArrays):
    """The outcome of one step.

    Attributes
    ----------
    shift_s, drift
        Shift and drift behind the step.
    gain, constants
        k; c0, c1, c2.
    errors : ndarray, shape (n_errors,)
        Coefficients of the model's errors, in the camera's scale.
    covariance : ndarray, shape (6 + n_errors + n_bends, 6 + n_errors + n_bends)
        Covariance of k, shift, drift, c0, c1, c2, of the errors' coefficients, and of the bends of the picture; never
        less than the residuals call for.
    innovation_statistic
        Mean squared normalised residual.
    inside : ndarray of bool, shape (n_frames,)
        Frames that fall into the recorder's record.
    converged
        Whether the step was negligible.
    residual : ndarray, shape (n_inside + 1 + n_bends,)
        Residuals that the columns leave of the whitened positions, and then of the priors of drift and bends.
    basis : ndarray, shape (n_inside + 1 + n_bends, 6 + n_errors + n_bends)
        Orthonormal columns that span the whitened model.
    """

    shift_s: float
    drift: float
    gain: float
    constants: tuple[float, float, float]
    errors: Array
    covariance: Array
    log_likelihood: float
    innovation_statistic: float
    inside: Flags
    walk: WalkFilter
    converged: bool
    residual: Array
    basis: Array

    def u_mapped_s(self, since_s: float) -> float:
        """Return the standard uncertainty of the mapped time at a camera time counted from the origin."""
        pick = np.zeros(self.covariance.shape[0])
        pick[1:3] = 1.0, since_s
        return math.sqrt(float(pick @ self.covariance @ pick))


def gauss_newton_step(
    model: MotionModel,
    shift_s: float,
    drift: float,
    *,
    marker_variance: float,
    density: float,
    drift_allowance: float,
    previous: MotionSolution | None = None,
) -> MotionSolution | None:
    """Improve a shift and a drift by least squares on ``D, V, V t, 1, t, t^2/2``, and the accelerometer's errors.

    Parameters
    ----------
    shift_s, drift
        Shift and drift to start from.
    marker_variance
        Variance of the camera's white noise, m^2.
    density
        Density of the accelerometer's white noise, (m/s^2)^2/Hz, two-sided.
    drift_allowance
        Standard deviation of the drift's prior, which has the mean 0.
    previous
        A step at the same noise levels, whose filter serves again if it was for the same frames.

    Returns
    -------
    MotionSolution or None
        Solution of the step; None where the columns are not independent.
    """
    mapped = model.mapped_s(shift_s, drift)
    inside = model.integral.covers(mapped)
    if not inside.any():
        return None
    if previous is not None and np.array_equal(previous.inside, inside):
        walk = previous.walk
    else:
        walk = WalkFilter.design(model.times_s[inside], marker_variance, density)
    travel, velocity = model.integral.at(mapped[inside])
    constants = model.constants(inside, mapped[inside])
    # as the camera sees it, without the velocity that the accelerometer's errors made
    rates = np.column_stack([velocity, *model.error_rates(mapped[inside])])
    since = constants[:, 1:2]
    bends, u_bends_m = model.bends(inside)
    rows = walk.whiten(np.column_stack([model.positions_m[inside], travel, constants, bends, rates, rates * since]))
    n_linear, n_bends = 1 + constants.shape[1], bends.shape[1]
    z, (linear, by_shift, by_drift) = (
        rows[:, 0],
        np.split(rows[:, 1:], np.cumsum([n_linear + n_bends, rates.shape[1]]), axis=1),
    )
    of_bends = np.zeros((n_bends, n_linear + n_bends))
    of_bends[:, n_linear:] = np.diag(1.0 / u_bends_m)
    first = np.linalg.lstsq(np.vstack([linear, of_bends]), np.append(z, np.zeros(n_bends)), rcond=None)[0]
    sizes = np.delete(first[:n_linear], [1, 2, 3])
    design = np.column_stack([linear[:, 0], by_shift @ sizes, by_drift @ sizes, linear[:, 1:]])
    prior = np.zeros((1 + n_bends, design.shape[1]))
    prior[0, 2] = 1.0 / max(drift_allowance, 1e-12)
    prior[1:, 2:] = of_bends
    design = np.vstack([design, prior])
    target = np.concatenate([z, [-drift * prior[0, 2]], np.zeros(n_bends)])
    scale = np.sqrt((design**2).sum(axis=0))
    if not np.all(scale > 0):
        return None
    q, r = np.linalg.qr(design / scale)
    if not np.abs(np.diag(r)).min() > LEAST_INDEPENDENCE:
        return None
    inverse = np.linalg.inv(r)
    solution = inverse @ (q.T @ target) / scale
    residual = target - design @ solution
    chi2 = float(residual @ residual)
    statistic = chi2 / z.size
    covariance = inverse @ inverse.T / np.outer(scale, scale) * max(1.0, statistic)
    step = float(np.clip(solution[1], -LONGEST_STEP_S, LONGEST_STEP_S))
    return MotionSolution(
        shift_s=shift_s + step,
        drift=drift + float(solution[2]),
        gain=float(solution[0]),
        constants=(float(solution[3]), float(solution[4]), float(solution[5])),
        errors=solution[6 : 2 + n_linear],
        covariance=covariance,
        log_likelihood=-0.5 * (chi2 + walk.log_determinant),
        innovation_statistic=statistic,
        inside=inside,
        walk=walk,
        converged=abs(step) < max(NEGLIGIBLE_STEP * math.sqrt(covariance[1, 1]), 1e-10),
        residual=residual,
        basis=q,
    )


def profile(model: MotionModel, solution: MotionSolution, around_s: Array) -> Array:
    """Log-likelihood at other shifts, gain and constants at their best for each, the drift held.

    Parameters
    ----------
    around_s : ndarray, shape (n_shifts,)
        Differences from the solution's shift.

    Returns
    -------
    ndarray, shape (n_shifts,)
        Log-likelihood of each shift, up to a constant.
    """
    inside = solution.inside
    mapped = model.mapped_s(solution.shift_s, solution.drift)[inside]
    shapes = [model.integral.at(mapped + shift)[0] for shift in around_s]
    bends, u_bends_m = model.bends(inside)
    others = np.column_stack([model.constants(inside, mapped), bends])
    rows = solution.walk.whiten(np.column_stack([model.positions_m[inside], others, *shapes]))
    n_others = others.shape[1]
    prior = np.zeros((u_bends_m.size, rows.shape[1]))
    prior[:, 1 + n_others - u_bends_m.size : 1 + n_others] = np.diag(1.0 / u_bends_m)
    rows = np.vstack([rows, prior])
    q, _ = np.linalg.qr(rows[:, 1 : 1 + n_others])
    left = rows - q @ (q.T @ rows)
    target, candidates = left[:, 0], left[:, 1 + n_others :]
    explained = (candidates.T @ target) ** 2 / np.einsum("ij,ij->j", candidates, candidates)
    return np.asarray(-0.5 * (target @ target - explained))
