"""The noise of a signal, estimated from the signal alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.normal_distribution import MAD_TO_SIGMA


def robust_sigma(samples: NDArray[np.float64]) -> float:
    """Estimate the standard deviation from the median absolute deviation, blind to a minority of outliers.

    Parameters
    ----------
    samples : ndarray of float64, shape (n,)
        NaN are left out.

    Returns
    -------
    float
        NaN if nothing is there.
    """
    present = samples[np.isfinite(samples)]
    if present.size == 0:
        return float("nan")
    return float(MAD_TO_SIGMA * np.median(np.abs(present - np.median(present))))


def noise_sigma(samples: NDArray[np.float64]) -> float:
    """Estimate the standard deviation of white noise on a smooth signal, from its third differences.

    The third difference of white noise has 1 + 9 + 9 + 1 = 20 times its variance; that of a smooth,
    well-sampled signal is small. It is taken over neighbours only: differences across NaN drop out.

    Parameters
    ----------
    samples : ndarray of float64, shape (n,)
        Evenly spaced; NaN where missing.

    Returns
    -------
    float
        NaN below four neighbouring samples.
    """
    third = np.diff(samples, n=3)
    third = third[np.isfinite(third)]
    if third.size == 0:
        return float("nan")
    return float(MAD_TO_SIGMA * np.median(np.abs(third)) / np.sqrt(20.0))
