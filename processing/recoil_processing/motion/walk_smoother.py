"""The walk that an accelerometer's noise integrates to, estimated at and between the camera's frames.

State ``[w, w']`` from zero at the first node. Nodes are frames, and other instants at which nothing was
seen but from which on the noise is another one. Over a step the walk is driven by white noise of one
density (Bar-Shalom, Li, Kirubarajan 2001, Estimation with Applications to Tracking and Navigation,
section 6.2.2), so that what is known between two nodes is exact: given the states at both, the mean is
the cubic with these positions and velocities, and the rest is an integrated Brownian bridge.

The smoother is that of de Jong (1989), J. Am. Stat. Assoc. 84(408): backward recursions of a vector r and a
matrix N, which need no inverse of a covariance and therefore nodes at no distance from one another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.arguments import require_increasing, require_positive

_HERMITE = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
"""Powers of the share of a step, by columns, in the weights of position and velocity at its two ends."""
_RATE = np.diag([1.0, 2.0, 3.0], k=-1)[:, :3]
"""Derivatives of the powers."""


@dataclass(frozen=True, eq=False)
class Between:
    """Instants between nodes.

    Attributes
    ----------
    i : ndarray of int, shape (m,)
        Number of the node before.
    s : ndarray, shape (m,)
        Share of the step that has passed.
    """

    i: NDArray[np.int64]
    s: Array

    def polynomials(self, coefficients: Array) -> Array:
        """Evaluate the polynomial in s of each instant's step.

        Parameters
        ----------
        coefficients : ndarray, shape (degree + 1, n_steps, n_columns)
            Coefficients by rising power.

        Returns
        -------
        ndarray, shape (n_columns, m)
        """
        total = np.empty((coefficients.shape[2], self.s.size))
        for column in range(total.shape[0]):
            values = total[column]
            values[:] = coefficients[-1, :, column][self.i]
            for power in coefficients[-2::-1, :, column]:
                values *= self.s
                values += power[self.i]
        return total


@dataclass(frozen=True, eq=False)
class WalkSmoother:
    """Gains and covariances of the smoother, which depend on nodes and noise levels alone.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Times of the nodes, strictly increasing.
    seen : ndarray of bool, shape (n,)
        Whether there is a position.
    densities : ndarray, shape (n - 1,)
        Densities of the acceleration in each step, (m/s^2)^2/Hz, two-sided.
    gains : ndarray, shape (n, 2)
        Gains of position and velocity, per metre of innovation; zero where nothing was seen.
    innovation_variances : ndarray, shape (n,)
        Variances of the innovations, m^2; infinite where nothing was seen.
    covariances : ndarray, shape (n, 2, 2)
        Covariances of the states, given all positions.
    lagged : ndarray, shape (n - 1, 2, 2)
        Covariance of each node's state with the next one's, given all positions.
    """

    times_s: Array
    seen: Flags
    densities: Array
    gains: Array
    innovation_variances: Array
    covariances: Array
    lagged: Array
    _transitions: Array
    _predicted: Array

    @classmethod
    def design(cls, times_s: Array, seen: Flags, marker_variance: float, densities: Array) -> WalkSmoother:
        """Find gains and covariances.

        Parameters
        ----------
        times_s : ndarray, shape (n,)
            Times, strictly increasing, at least two.
        seen : ndarray of bool, shape (n,)
        marker_variance
            Variance of the positions' white noise, m^2.
        densities : ndarray, shape (n - 1,)
            Densities of the acceleration, all positive, (m/s^2)^2/Hz, two-sided.

        Raises
        ------
        ValueError
            If there are fewer than two nodes, shapes do not fit, nodes do not increase, or a noise level is not
            positive and finite.
        """
        if times_s.size < 2 or seen.shape != times_s.shape or densities.shape != (times_s.size - 1,):
            raise ValueError(
                f"n nodes, n flags and n - 1 densities are needed, n at least 2, "
                f"not {times_s.shape}, {seen.shape}, {densities.shape}"
            )
        require_increasing(times_s=times_s)
        require_positive(
            marker_variance=marker_variance, least_density=densities.min(), largest_density=densities.max()
        )
        steps = np.diff(times_s)
        predicted, gains, variances = _filter(steps, seen, marker_variance, densities)
        forward = np.zeros((steps.size, 2, 2))
        forward[:, 0, 0] = forward[:, 1, 1] = 1.0
        forward[:, 0, 1] = steps
        keep = np.tile(np.eye(2), (times_s.size, 1, 1))
        keep[:, :, 0] -= gains
        transitions = forward @ keep[:-1]
        behind = _information(transitions, variances)
        covariances = predicted - predicted @ behind @ predicted
        lagged = predicted[:-1] @ transitions.transpose(0, 2, 1) @ (np.eye(2) - behind[1:] @ predicted[1:])
        return cls(times_s, seen, densities, gains, variances, covariances, lagged, transitions, predicted)

    @property
    def log_determinant(self) -> float:
        """Sum of the logarithms of the innovations' variances."""
        return float(np.log(self.innovation_variances[self.seen]).sum())

    def smooth(self, columns: Array) -> tuple[Array, Array]:
        """Estimate the walk from positions, and turn those into independent ones.

        Parameters
        ----------
        columns : ndarray, shape (n_seen, n_columns)
            Each one a series of positions at the nodes that were seen; every column by itself.

        Returns
        -------
        states : ndarray, shape (n, 2, n_columns)
            w in m and w' in m/s at all nodes.
        rows : ndarray, shape (n_seen, n_columns)
            Innovations of unit variance, if the columns' errors are marker noise plus the walk.
        """
        from scipy.linalg.lapack import dtbtrs

        n, m = self.times_s.size, columns.shape[1]
        values = np.zeros((n, m))
        values[self.seen] = columns
        band = self._recursion()
        driven = np.zeros((n, 2, m))
        # F K z; a transition is F (1 - K H), so that its first column is F's less F K
        forward = np.stack([1.0 - self._transitions[:, 0, 0], -self._transitions[:, 1, 0]], axis=1)
        driven[1:] = forward[:, :, None] * values[:-1, None, :]
        before, _ = dtbtrs(band, driven.reshape(2 * n, m), uplo="L", diag="U")
        before = before.reshape(n, 2, m)
        innovations = values - before[:, 0]
        source = np.zeros((n, 2, m))
        source[:, 0] = innovations / self.innovation_variances[:, None]
        back, _ = dtbtrs(band, source.reshape(2 * n, m), uplo="L", trans="T", diag="U")
        states = before + self._predicted @ back.reshape(n, 2, m)
        rows = innovations[self.seen] / np.sqrt(self.innovation_variances[self.seen])[:, None]
        return states, rows

    def between(self, times_s: Array) -> Between:
        """Find the steps that instants fall into, shape (m,), between the first and the last node."""
        i = np.clip(np.searchsorted(self.times_s, times_s, side="right") - 1, 0, self.times_s.size - 2)
        return Between(i, (times_s - self.times_s[i]) / np.diff(self.times_s)[i])

    def interpolate(self, states: Array, at: Between) -> tuple[Array, Array]:
        """Mean of the walk between nodes: the cubics with their positions and velocities.

        Parameters
        ----------
        states : ndarray, shape (n, 2, n_columns)
        at
            m instants.

        Returns
        -------
        position, velocity : ndarray, shape (n_columns, m)
        """
        step = np.diff(self.times_s)[:, None]
        p0, p1, v0, v1 = states[:-1, 0], states[1:, 0], step * states[:-1, 1], step * states[1:, 1]
        rise = p1 - p0
        quadratic, cubic = 3 * rise - 2 * v0 - v1, v0 + v1 - 2 * rise
        position = at.polynomials(np.stack([p0, v0, quadratic, cubic]))
        return position, at.polynomials(np.stack([v0, 2 * quadratic, 3 * cubic]) / step)

    def variances(self, at: Between) -> tuple[Array, Array]:
        """Variance of the walk's position and velocity between nodes.

        With the joint covariance C of the states at both ends, and the weights h that Hermite's cubic gives
        them, it is ``h' C h`` plus that of a bridge which starts and ends at rest: with s the share of a
        step T of density q that has passed, ``q T^3 s^3 (1 - s)^3 / 3`` of the position and
        ``q T s (1 - s) (1 - 3 s (1 - s))`` of the velocity.

        Parameters
        ----------
        at
            m instants.

        Returns
        -------
        position, velocity : ndarray, shape (m,)
            m^2 and m^2/s^2.
        """
        step = np.diff(self.times_s)
        scale = np.stack([np.ones_like(step), step, np.ones_like(step), step], axis=1)
        joint = np.empty((step.size, 4, 4))
        joint[:, :2, :2], joint[:, 2:, 2:] = self.covariances[:-1], self.covariances[1:]
        joint[:, :2, 2:], joint[:, 2:, :2] = self.lagged, self.lagged.transpose(0, 2, 1)
        joint *= scale[:, :, None] * scale[:, None, :]
        position = _HERMITE.T @ joint @ _HERMITE
        velocity = _RATE.T @ position @ _RATE / step[:, None, None] ** 2
        bridge = self.densities * step
        mixed = at.s * (1.0 - at.s)
        x = at.polynomials(_squares(position))[0] + (bridge * step**2 / 3.0)[at.i] * mixed**3
        v = at.polynomials(_squares(velocity))[0] + bridge[at.i] * mixed * (1.0 - 3.0 * mixed)
        return np.maximum(x, 0.0), np.maximum(v, 0.0)

    def _recursion(self) -> Array:
        """Lower band of the recursion of the predicted states, each from the one before."""
        t = self._transitions
        band = np.zeros((4, 2 * self.times_s.size))
        band[0] = 1.0
        band[1, 1:-2:2] = -t[:, 0, 1]
        band[2, 0:-2:2] = -t[:, 0, 0]
        band[2, 1:-2:2] = -t[:, 1, 1]
        band[3, 0:-2:2] = -t[:, 1, 0]
        return band


def _filter(steps: Array, seen: Flags, marker_variance: float, densities: Array) -> tuple[Array, Array, Array]:
    """Predicted covariances, gains and variances of the innovations: Kalman (1960), J. Basic Eng. 82(1)."""
    rows = []
    p00 = p01 = p11 = 0.0
    for h, q, there in zip([0.0, *steps.tolist()], [0.0, *densities.tolist()], seen.tolist(), strict=True):
        p00 += h * (2 * p01 + h * p11) + q * h**3 / 3
        p01 += h * p11 + q * h**2 / 2
        p11 += q * h
        if not there:
            rows.append((p00, p01, p11, 0.0, 0.0, math.inf))
            continue
        s = p00 + marker_variance
        g0, g1 = p00 / s, p01 / s
        rows.append((p00, p01, p11, g0, g1, s))
        # marker_variance / s is 1 - g0 without the cancellation where the walk outgrows the marker's noise
        left = marker_variance / s
        p00, p01, p11 = left * p00, left * p01, p11 - g1 * p01
    table = np.array(rows)
    return table[:, (0, 1, 1, 2)].reshape(-1, 2, 2), table[:, 3:5], table[:, 5]


def _information(transitions: Array, variances: Array) -> Array:
    """Return de Jong's N of every node, its own position and all later ones, shape (n, 2, 2)."""
    n = variances.size
    with_own = [(0.0, 0.0, 0.0)] * n
    weights, steps = (1.0 / variances).tolist(), transitions.reshape(-1, 4).tolist()
    n00, n01, n11 = weights[-1], 0.0, 0.0
    with_own[-1] = n00, n01, n11
    for i in range(n - 2, -1, -1):
        a, b, c, d = steps[i]
        u0, u1, v0, v1 = n00 * a + n01 * c, n01 * a + n11 * c, n00 * b + n01 * d, n01 * b + n11 * d
        n00, n01, n11 = a * u0 + c * u1 + weights[i], a * v0 + c * v1, b * v0 + d * v1
        with_own[i] = n00, n01, n11
    return np.array(with_own)[:, (0, 1, 1, 2)].reshape(-1, 2, 2)


def _squares(forms: Array) -> Array:
    """Turn forms ``p' F p`` in the powers p of s, shape (n, k, k), into coefficients, shape (2 k - 1, n, 1)."""
    k = forms.shape[1]
    rows = [
        sum(forms[:, a, power - a] for a in range(max(0, power - k + 1), min(power, k - 1) + 1))
        for power in range(2 * k - 1)
    ]
    return np.array(rows)[:, :, None]
