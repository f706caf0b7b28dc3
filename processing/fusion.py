"""Camera and accelerometer together: what the accelerometer's noise did to its double integral.

The double integral of an accelerometer's white noise is a random walk of the velocity, integrated once
more: millimetres after some tenths of a second. The camera sees the motion without it, frame by frame.
A Kalman filter of that walk over the frames, run forward, and the Rauch-Tung-Striebel smoother, run
backward, estimate it from all frames; the walk is then added to the accelerometer's integrals, which
keep the high rate. See Smyth and Wu (2007), Mech. Syst. Signal Process. 21(2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.outliers import isolated_outliers
from processing.velocity_walk import WalkFilter

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Walk:
    """The smoothed walk at the frames that were seen.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        At least two, strictly increasing.
    position, velocity : ndarray, shape (n,)
        m and m/s.
    u_position, u_velocity : ndarray, shape (n,)
        Standard uncertainties, given that the walk starts from zero at the first frame.
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

    Single frames that contradict their neighbours are left out, as they are when the clocks are aligned.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Strictly increasing.
    residual : ndarray, shape (n,)
        Camera less accelerometer, m; NaN where a frame is lost.
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
        If fewer than two frames are there, the frames do not increase, or a noise level is not positive.
    """
    seen = np.isfinite(residual)
    t, z = times_s[seen], residual[seen]
    if t.size < 2:
        raise ValueError(f"{t.size} of {times_s.size} frames have a position; two are needed")
    if not marker_variance > 0:
        raise ValueError(f"marker_variance must be positive, not {marker_variance}")
    odd = isolated_outliers(t, z, math.sqrt(marker_variance))
    t, z = t[~odd], z[~odd]
    states, deviations = WalkFilter.design(t, marker_variance, density).smooth(z)
    return Walk(t, states[:, 0], states[:, 1], deviations[:, 0], deviations[:, 1])
