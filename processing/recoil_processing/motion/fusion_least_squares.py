"""The linear model behind the fusion of camera and accelerometer: its constants, its walk, and their covariances.

The model stands in `recoil_processing.motion.fusion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.motion_least_squares import LEAST_INDEPENDENCE
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.walk_smoother import WalkSmoother
from recoil_processing.repairs.bridged_gaps import BridgedGap

SAME_INSTANT = 1e-3
"""Share of the recorder's step within which a gap's edge and a frame are one node."""


@dataclass(frozen=True, eq=False)
class FusionSolution(ReadOnlyArrays):
    """Constants and walk, and what they owe to each unknown.

    Attributes
    ----------
    smoother
        Smoother over frames, gaps' edges and the record's ends.
    origin_s
        Instant that the constants count from: the middle of the frames.
    constants : ndarray, shape (4,)
        k, c0, c1, c2.
    factor : ndarray, shape (4, 4)
        Factor of the constants' covariance, which is ``factor @ factor.T``.
    walk : ndarray, shape (n_nodes, 2)
        w and w'.
    followed : ndarray, shape (n_nodes, 2, 4)
        Share of a unit of each constant that the walk would take up.
    clock_constants, clock_walk : ndarray, shape (4, 2) and (n_nodes, 2, 2)
        Shares that constants and walk take up of a unit of the clocks' offset in the middle of the motion, which is the
        mean of the frames' times weighted by the squared velocity, and of their drift about it.
    statistic
        Mean squared normalised innovation.
    shift_s, u_shift_s
        Clocks' offset by this motion, and its standard uncertainty.
    """

    smoother: WalkSmoother
    origin_s: float
    constants: Array
    factor: Array
    walk: Array
    followed: Array
    clock_constants: Array
    clock_walk: Array
    statistic: float
    log_likelihood: float
    shift_s: float
    u_shift_s: float

    @property
    def inflation(self) -> float:
        """Factor on variances: they are never less than the residuals call for."""
        return max(1.0, self.statistic)

    def residual(self, positions_m: Array, times_s: Array, travel: Array) -> Array:
        """Positions less the result at their instants, shape (n,), from the accelerometer's travel there."""
        walk, _ = self.smoother.interpolate(self.walk[:, :, None], self.smoother.between(times_s))
        return np.asarray(positions_m - self.constants @ _shapes(times_s - self.origin_s, travel) - walk[0])

    def state(
        self, times_s: Array, travel: Array, velocity: Array, u_clock: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Travel and velocity at any instants of the record, and their variances.

        Parameters
        ----------
        times_s : ndarray, shape (n,)
        travel, velocity : ndarray, shape (n,)
            Integrals of the acceleration.
        u_clock : ndarray, shape (2,)
            Standard uncertainties of offset and drift.

        Returns
        -------
        position, velocity, position_variance, velocity_variance : ndarray, shape (n,)
        """
        spread, counts = self.factor * self.inflation**0.5, np.flatnonzero(u_clock)
        weights = np.column_stack([self.constants, spread, (self.clock_constants * u_clock)[:, counts]])
        taken_up = np.concatenate(
            [self.walk[:, :, None], -self.followed @ spread, (self.clock_walk * u_clock)[:, :, counts]], axis=2
        )
        at = self.smoother.between(times_s)
        x, v = self.smoother.interpolate(taken_up, at)
        since = times_s - self.origin_s
        x += weights.T @ _shapes(since, travel)
        v += weights[[0, 2, 3]].T @ np.stack([velocity, np.ones_like(since), since])
        walk_x, walk_v = (self.inflation * variance for variance in self.smoother.variances(at))
        return x[0], v[0], walk_x + _squared_length(x[1:]), walk_v + _squared_length(v[1:])


def solve_fusion(
    times_s: Array,
    positions_m: Array,
    integral: DoubleIntegral,
    gaps: Sequence[BridgedGap],
    marker_variance: float,
    density: float,
) -> FusionSolution | None:
    """Estimate constants and walk from all frames.

    Parameters
    ----------
    times_s, positions_m : ndarray, shape (n_frames,)
        Frames with a position, within the record.
    integral
        Integral of the acceleration.
    gaps
        Gaps of the acceleration.
    marker_variance
        Variance of the camera's white noise, m^2.
    density
        Density of the accelerometer's noise outside the gaps, (m/s^2)^2/Hz, two-sided.

    Returns
    -------
    FusionSolution or None
        Solution of the fusion; None where the columns are not independent.
    """
    travel, velocity = integral.at(times_s)
    origin = 0.5 * float(times_s[0] + times_s[-1])
    since = times_s - origin
    smoother = _smoother(times_s, integral, gaps, marker_variance, density)
    states, rows = smoother.smooth(np.column_stack([positions_m, *_shapes(since, travel), velocity, velocity * since]))
    target, design, clock = rows[:, 0], rows[:, 1:5], rows[:, 5:]
    scale = np.sqrt((design**2).sum(axis=0))
    if not np.all(scale > 0):
        return None
    q, r = np.linalg.qr(design / scale)
    if not np.abs(np.diag(r)).min() > LEAST_INDEPENDENCE:
        return None
    factor = np.linalg.inv(r) / scale[:, None]
    constants = factor @ (q.T @ target)
    residual = target - design @ constants
    gain = float(constants[0])
    clock_constants = gain * factor @ (q.T @ clock)
    left = gain * clock[:, 0] - design @ clock_constants[:, 0]
    clock_walk = gain * states[:, :, 5:] - states[:, :, 1:5] @ clock_constants
    # the velocity is k V + c1 + c2 t: what the clocks do with the rest of it is a matter of the constants alone
    clock_constants[[1, 2], 0] += constants[[2, 3]]
    clock_constants[[2, 3], 1] += constants[2], 2.0 * constants[3]
    # the offset is known in the middle of the true motion; the drift then turns about it
    speed2 = (gain * velocity + constants[2] + constants[3] * since) ** 2
    middle = float(speed2 @ since) / float(speed2.sum()) if speed2.any() else 0.0
    clock_constants[:, 1] -= middle * clock_constants[:, 0]
    clock_walk[:, :, 1] -= middle * clock_walk[:, :, 0]
    energy = float(left @ left)
    chi2 = float(residual @ residual)
    followed = states[:, :, 1:5]
    return FusionSolution(
        smoother=smoother,
        origin_s=origin,
        constants=constants,
        factor=factor,
        walk=states[:, :, 0] - followed @ constants,
        followed=followed,
        clock_constants=clock_constants,
        clock_walk=clock_walk,
        statistic=chi2 / (target.size - 4),
        log_likelihood=-0.5 * (chi2 + smoother.log_determinant),
        shift_s=float(left @ residual) / energy if energy > 0 else 0.0,
        u_shift_s=energy**-0.5 if energy > 0 else float("inf"),
    )


def _shapes(since_s: Array, travel: Array) -> Array:
    """Rows of the constants in the travel, shape (4, n)."""
    return np.stack([travel, np.ones_like(since_s), since_s, 0.5 * since_s**2])


def _squared_length(rows: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", rows, rows))


def _smoother(
    times_s: Array, integral: DoubleIntegral, gaps: Sequence[BridgedGap], marker_variance: float, density: float
) -> WalkSmoother:
    """Lay nodes on the frames, the record's ends and the gaps' edges; within gaps the noise is that of the bridges."""
    end_s = integral.start_s + integral.step_s * (integral.acceleration.size - 1)
    edges = [(integral.start_s + gap.start_s, integral.start_s + gap.start_s + gap.duration_s) for gap in gaps]
    others = np.unique([integral.start_s, end_s, *(edge for pair in edges for edge in pair)])
    near = np.abs(others - times_s[np.clip(np.searchsorted(times_s, others), 0, times_s.size - 1)])
    before = np.abs(others - times_s[np.clip(np.searchsorted(times_s, others) - 1, 0, times_s.size - 1)])
    others = others[np.minimum(near, before) > SAME_INSTANT * integral.step_s]
    nodes = np.concatenate([times_s, others])
    order = np.argsort(nodes)
    nodes, seen = nodes[order], order < times_s.size
    densities = np.full(nodes.size - 1, density)
    middle = 0.5 * (nodes[:-1] + nodes[1:])
    for gap, (start, stop) in zip(gaps, edges, strict=True):
        densities[(middle > start) & (middle < stop)] += gap.density
    return WalkSmoother.design(nodes, seen, marker_variance, densities)
