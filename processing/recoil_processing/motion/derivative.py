"""The derivatives of a motion."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array

_CENTRAL = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0


_FIRST = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0


def first_derivative(samples: Array, step_s: float) -> Array:
    """Differentiate even samples.

    The central difference of sixth order (Fornberg 1988, Math. Comput. 51) is right to ``(w h)^6 / 140``, w being the
    angular frequency and h the step; a gradient loses ``(w h)^2 / 6``.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        n at least 2; the three at each end are differentiated by gradients.

    Returns
    -------
    ndarray, shape (n,)
    """
    result = np.gradient(samples, step_s)
    if samples.size >= _FIRST.size:
        result[3:-3] = np.convolve(samples, _FIRST, mode="valid") / step_s
    return np.asarray(result)


def second_derivative(samples: Array, step_s: float) -> Array:
    """Differentiate even samples twice, that were low-pass filtered and have no noise left to speak of.

    The central difference of sixth order (Fornberg 1988, Math. Comput. 51) is right to ``(w h)^6 / 560``, w being the
    angular frequency and h the step; two gradients in a row lose ``(w h)^2 / 3``, 3 % at a twentieth
    of the sampling rate.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        n at least 3; the three at each end are differentiated by gradients.

    Returns
    -------
    ndarray, shape (n,)
    """
    result = np.gradient(np.gradient(samples, step_s), step_s)
    if samples.size >= _CENTRAL.size:
        result[3:-3] = np.convolve(samples, _CENTRAL, mode="valid") / step_s**2
    return result
