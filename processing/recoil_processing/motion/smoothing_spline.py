"""Derivatives by a quintic smoothing spline whose knots follow the motion.

The spline has as few knots as leave the residuals no larger than the noise: their sum of squares is ``s = n sigma^2``
(Reinsch 1967, Numer. Math. 10; knots after Dierckx 1975, J. Comput. Appl. Math. 1(3)). Its second derivative is a
cubic spline and does not vanish at the ends, as that of the usual cubic smoothing spline must.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from recoil_processing.motion.derivative import Derivatives, ScaledTrack

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Array = NDArray[np.float64]

DEGREE = 5
LEAST_FRAMES = 12
"""Twice the coefficients of one polynomial of fifth degree."""
CLOSER = 3.0
"""Of the misfit, whose variance is 2 n: with it errors over uncertainties are 0.7 to 1 in synthetic recoils."""
LOCAL_FRAMES = 9
"""Over which the difference of the two splines is averaged, by squares."""


def smooth_spline(times_s: Array, positions_m: Array, *, sigma_m: float | None = None) -> Derivatives:
    """Estimate velocity and acceleration.

    The uncertainties hold the noise, by least squares on the knots found, and what another spline says otherwise
    that is asked to leave `CLOSER` standard deviations less of the misfit: without it they are several times too
    small at the shot, where the knots are too few.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Strictly increasing; steps may be uneven.
    positions_m : ndarray, shape (n,)
        Lost frames NaN; they are left out.
    sigma_m : float, optional
        Of the positions' white noise; from the third differences if left out.

    Returns
    -------
    Derivatives
        A window is the interval between knots.

    Raises
    ------
    ValueError
        As `recoil_processing.motion.derivative.ScaledTrack.of`.
    """
    from scipy.interpolate import BSpline

    track = ScaledTrack.of(times_s, positions_m, sigma_m, LEAST_FRAMES)
    n = track.times.size
    spline = fit_spline(track.times, track.positions, float(n))
    closer = fit_spline(track.times, track.positions, max(n - CLOSER * math.sqrt(2.0 * n), 0.5 * n))
    knots = np.asarray(spline.t, dtype=np.float64)
    count = knots.size - DEGREE - 1
    basis = BSpline(knots, np.eye(count), DEGREE)
    covariance = np.linalg.pinv(np.asarray(basis(track.times)).T @ np.asarray(basis(track.times)), hermitian=True)
    states, deviations = np.empty((track.times.size, 3)), np.empty((track.times.size, 3))
    for order in range(3):
        rows = np.asarray(basis.derivative(order)(track.times) if order else basis(track.times))
        states[:, order] = rows @ np.asarray(spline.c)[:count]
        apart = (np.asarray(closer(track.times, order)) - states[:, order]) ** 2
        around = np.convolve(
            np.pad(apart, LOCAL_FRAMES // 2, mode="edge"), np.full(LOCAL_FRAMES, 1 / LOCAL_FRAMES), "valid"
        )
        deviations[:, order] = np.sqrt(np.maximum((rows @ covariance * rows).sum(axis=1), 0.0) + around)
    inner = np.unique(knots)
    interval = np.clip(np.searchsorted(inner, track.times, side="right") - 1, 0, inner.size - 2)
    half = 0.5 * np.diff(inner)[interval]
    return track.derivatives(states, deviations, track.edges(half), "quintic smoothing spline, s = n sigma^2")


def fit_spline(times: Array, positions: Array, misfit: float, *, legacy: bool | None = None) -> BSpline:
    """Fit the spline with the fewest knots that leaves a sum of squared residuals.

    Parameters
    ----------
    times, positions : ndarray, shape (n,)
        Of the order of the frames' number and of the noise; times strictly increasing.
    misfit : float
        Sum of squared residuals.
    legacy : bool, optional
        Whether to take FITPACK's own routine; if left out, where SciPy (before 1.15) has no other.
    """
    from scipy import interpolate

    if legacy is None:
        legacy = not hasattr(interpolate, "make_splrep")
    if legacy:
        return interpolate.BSpline(*interpolate.splrep(times, positions, k=DEGREE, s=misfit))
    return interpolate.make_splrep(times, positions, k=DEGREE, s=misfit)
