"""The noise of a signal, estimated from the signal alone."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA


def robust_sigma(samples: NDArray[np.float64]) -> float:
    """Estimate the standard deviation from the median absolute deviation, blind to a minority of outliers.

    Parameters
    ----------
    samples : ndarray of float64, shape (n,)
        Samples; NaN are left out.

    Returns
    -------
    float
        Standard deviation; NaN if nothing is there.
    """
    present = samples[np.isfinite(samples)]
    if present.size == 0:
        return float("nan")
    return float(MAD_TO_SIGMA * np.median(np.abs(present - np.median(present))))


def welch_satterthwaite(contributions: Iterable[tuple[float, float]]) -> float:
    """Return the effective degrees of freedom of a sum, ``u^4 / sum(u_i^4 / nu_i)`` (JCGM 100:2008, G.2b).

    Parameters
    ----------
    contributions
        Standard uncertainty and degrees of freedom of each independent part; the latter may be infinite.

    Returns
    -------
    float
        Degrees of freedom; infinite where every part is taken as known, or one is not known at all.
    """
    parts = [(u, freedom) for u, freedom in contributions if u > 0]
    if not all(math.isfinite(u) for u, _ in parts):
        return math.inf
    fourth = math.fsum(u**4 / freedom for u, freedom in parts)
    return math.fsum(u**2 for u, _ in parts) ** 2 / fourth if fourth > 0 else math.inf


SILENT_SHARE = 3e-6
"""Share of its span below which what third differences leave of a motion is no noise that any picture has."""
LEAST_STEPS = 8
"""Steps between different neighbours that show a resolution."""


def noise_sigma(samples: NDArray[np.float64]) -> float:
    """Estimate the standard deviation of white noise on a smooth signal, from its third differences.

    The third difference of white noise has 1 + 9 + 9 + 1 = 20 times its variance; that of a smooth,
    well-sampled signal is small. It is taken over neighbours only: differences across NaN drop out.

    Parameters
    ----------
    samples : ndarray of float64, shape (n,)
        Samples, evenly spaced; NaN where missing.

    Returns
    -------
    float
        Standard deviation; NaN below four neighbouring samples.
    """
    third = np.diff(samples, n=3)
    third = third[np.isfinite(third)]
    if third.size == 0:
        return float("nan")
    return float(MAD_TO_SIGMA * np.median(np.abs(third)) / np.sqrt(20.0))


def hiding_resolution(samples: NDArray[np.float64]) -> float | None:
    """Return the resolution that hides the noise of a signal, as of an encoder; None where its noise is seen.

    All samples are then whole numbers of steps apart, and where the signal moves its noise is below a step: at rest it
    stands still for as long as it likes. So it does without any noise that its motion would show; the resolution is
    then its smallest step.

    Parameters
    ----------
    samples : ndarray of float64, shape (n,)
        Samples; NaN where they are missing.
    """
    present = samples[np.isfinite(samples)]
    steps = np.abs(np.diff(present))
    steps = steps[steps > 0]
    if steps.size < LEAST_STEPS:
        return None
    moved = np.flatnonzero(np.diff(present) != 0)
    noise = noise_sigma(present[moved[0] : moved[-1] + 2])
    finest = float(steps.min())
    if noise <= SILENT_SHARE * float(np.ptp(present)):
        return finest
    whole = steps / finest
    if noise > finest or np.any(np.abs(whole - np.round(whole)) > np.maximum(0.01, 1e-6 * whole)):
        return None
    return finest
