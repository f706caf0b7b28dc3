"""Derivatives by local polynomials: Savitzky and Golay (1964), Anal. Chem. 36(8).

Around every frame a polynomial is fitted to those within half a window, by least squares, and its derivatives
there are taken. At the ends the outermost window serves. Lost frames are left out of the fit. The result is
linear in the positions, so that its noise is known exactly: the root of the weights' sum of squares.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_processing.motion.derivative import Derivatives, ScaledTrack

Array = NDArray[np.float64]

SAME_FRAME = 0.25
"""In steps: by how much a frame may be off its even place and still belong to a window."""


def local_polynomials(
    times_s: Array, positions_m: Array, *, window: int, order: int = 3, sigma_m: float | None = None
) -> Derivatives:
    """Estimate velocity and acceleration.

    The uncertainties are those of the noise alone; what the window smooths away is not in them. Where fewer
    frames than the polynomial has coefficients fall into a window there is no result.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Strictly increasing.
    positions_m : ndarray, shape (n,)
        Lost frames NaN.
    window : int
        Frames, odd, more than `order`.
    order : int
        Of the polynomial, at least 2.
    sigma_m : float, optional
        Of the positions' white noise; from the third differences if left out.

    Returns
    -------
    Derivatives

    Raises
    ------
    ValueError
        If window or order are none, or as `recoil_processing.motion.derivative.ScaledTrack.of`.
    """
    if order < 2 or window % 2 == 0 or window <= order:
        raise ValueError(f"the window must be odd and longer than the order, at least 2; not {window}, {order}")
    track = ScaledTrack.of(times_s, positions_m, sigma_m, window)
    weights, at = local_weights(track.times, window // 2, order)
    states = np.einsum("ikj,ij->ik", weights, track.positions[at])
    deviations = np.sqrt((weights**2).sum(axis=2))
    half = np.full(track.times.size, window / 2.0)
    return track.derivatives(states, deviations, track.edges(half), f"Savitzky-Golay, order {order}, {window} frames")


def local_weights(times: Array, half: int, order: int) -> tuple[Array, NDArray[np.int64]]:
    """Return what every position counts in the derivatives at every frame.

    Parameters
    ----------
    times : ndarray, shape (n,)
        In usual steps.
    half : int
        Steps to either side.
    order : int

    Returns
    -------
    weights : ndarray, shape (n, 3, m)
        Of position, velocity and acceleration; NaN where the polynomial is not determined.
    at : ndarray of int, shape (n, m)
        The positions that they belong to; what fills up a shorter window has no weight.
    """
    centre = np.clip(times, times[0] + half, max(times[-1] - half, times[0] + half))
    first = np.searchsorted(times, centre - half - SAME_FRAME)
    stop = np.searchsorted(times, centre + half + SAME_FRAME)
    at = first[:, None] + np.arange(int((stop - first).max()))
    inside = at < stop[:, None]
    at = np.where(inside, at, first[:, None])
    powers = ((times[at] - times[:, None]) / half)[:, :, None] ** np.arange(order + 1) * inside[:, :, None]
    inverse = np.linalg.pinv(powers)[:, :3] * inside[:, None, :]
    scale = np.array([1.0, 1.0 / half, 2.0 / half**2])
    weights = inverse * scale[:, None]
    weights[(stop - first) <= order] = np.nan
    return weights, at
