"""Camera and accelerometer together: what the accelerometer's noise did to its double integral.

The double integral of an accelerometer's white noise is a random walk of the velocity, integrated once
more: millimetres after some tenths of a second. The camera sees the motion without it, frame by frame.
A Kalman filter of that walk over the frames, run forward, and the Rauch-Tung-Striebel smoother, run
backward, estimate it from all frames; the walk is then added to the accelerometer's integrals, which
keep the high rate. See Smyth and Wu (2007), Mech. Syst. Signal Process. 21(2); Rauch, Tung, Striebel
(1965), AIAA J. 3(8).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Walk:
    """The smoothed walk at the frames that were seen.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    position, velocity : ndarray, shape (n,)
    u_position, u_velocity : ndarray, shape (n,)
        Standard uncertainties.
    """

    times_s: Array
    position: Array
    velocity: Array
    u_position: Array
    u_velocity: Array

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """Position and velocity between the frames, by cubic Hermite interpolation, shape of `times_s`.

        Beyond the first and the last frame the velocity there goes on.
        """
        t, inside = self.times_s, np.clip(times_s, self.times_s[0], self.times_s[-1])
        i = np.clip(np.searchsorted(t, inside, side="right") - 1, 0, t.size - 2)
        h = t[i + 1] - t[i]
        s = (inside - t[i]) / h
        p0, p1, v0, v1 = self.position[i], self.position[i + 1], h * self.velocity[i], h * self.velocity[i + 1]
        rise = p1 - p0
        position = p0 + s * (v0 + s * (3 * rise - 2 * v0 - v1 + s * (v0 + v1 - 2 * rise)))
        velocity = (v0 + s * (2 * (3 * rise - 2 * v0 - v1) + 3 * s * (v0 + v1 - 2 * rise))) / h
        return position + velocity * (times_s - inside), velocity


def smooth_walk(times_s: Array, residual: Array, marker_variance: float, density: float) -> Walk:
    """Estimate a random walk of the velocity from noisy positions.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Increasing.
    residual : ndarray, shape (n,)
        Camera less accelerometer, NaN where a frame is lost.
    marker_variance : float
        Of the camera's white noise, m^2.
    density : float
        Of the acceleration that drives the walk, (m/s^2)^2/Hz, two-sided.

    Returns
    -------
    Walk

    Raises
    ------
    ValueError
        If fewer than two frames are there.
    """
    seen = np.isfinite(residual)
    t, z = times_s[seen], residual[seen]
    if t.size < 2:
        raise ValueError("fewer than two frames have a position")
    n = t.size
    steps = np.diff(t, prepend=t[0])
    state = np.empty((n, 2))
    covariance = np.empty((n, 2, 2))
    predicted = np.empty((n, 2, 2))
    x = np.zeros(2)
    p = np.zeros((2, 2))
    for i in range(n):
        h = steps[i]
        x = np.array([x[0] + h * x[1], x[1]])
        p00 = p[0, 0] + h * (2 * p[0, 1] + h * p[1, 1]) + density * h**3 / 3
        p01 = p[0, 1] + h * p[1, 1] + density * h**2 / 2
        p11 = p[1, 1] + density * h
        predicted[i] = (p00, p01), (p01, p11)
        s = p00 + marker_variance
        gain = np.array([p00 / s, p01 / s])
        x = x + gain * (z[i] - x[0])
        p = np.array([[(1 - gain[0]) * p00, (1 - gain[0]) * p01], [(1 - gain[0]) * p01, p11 - gain[1] * p01]])
        state[i], covariance[i] = x, p
    smooth, spread = state.copy(), covariance.copy()
    for i in range(n - 2, -1, -1):
        h = steps[i + 1]
        forward = np.array([[1.0, h], [0.0, 1.0]])
        back = np.linalg.solve(predicted[i + 1], forward @ covariance[i]).T
        ahead = np.array([state[i, 0] + h * state[i, 1], state[i, 1]])
        smooth[i] = state[i] + back @ (smooth[i + 1] - ahead)
        spread[i] = covariance[i] + back @ (spread[i + 1] - predicted[i + 1]) @ back.T
    deviation = np.sqrt(np.maximum(spread[:, (0, 1), (0, 1)], 0.0))
    return Walk(t, smooth[:, 0], smooth[:, 1], deviation[:, 0], deviation[:, 1])
