"""Misfit of a record: what its stretches, and rows weighed evenly, say of its mass beside the noise of its rows.

A body on a line that goes to and fro rubs by the place, the direction and the temperature, in ways that no stationary
noise is: the masses of its strokes differ by more than their rows allow. With h the influence of each whitened row on
the logarithm of the mass and r what the fit leaves of it, the sums ``g_b`` of ``h r`` over stretches b are what each
stretch moves the mass by, and each hides the share of itself that bends the fit (the jackknife of R. G. Miller,
Biometrika 61(1), 1974; clusters as in R. M. Bell, D. F. McCaffrey, Survey Methodology 28(2), 2002).

Where rows are weighed evenly, and not by the noise that was found, the mass is another one, by no more than that noise
allows if the model holds (J. A. Hausman, Econometrica 46(6), 1978): what is beyond is misfit, too.

Both stand beside the random part of the rows, for they are of another cause. Little is known of them: of nu degrees
of freedom the share ``nu / (nu + 2)`` counts, with ``nu + 2``: an inverse chi-square prior of two, at nothing.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array

SHARES_OF_STROKE = (0.1, 0.3, 1.0)
"""Lengths of a stretch that are tried, share of a stroke: that which says most counts."""
MOST_OF_ITSELF = 0.8
"""Share of the information that a stretch may have: of one that has more nothing else tells."""
PRIOR_FREEDOM = 2.0
"""Degrees of freedom of the prior, at no misfit."""


def largest_misfit(times_s: Array, influence: Array, left: Array, stroke_s: float) -> tuple[float, float]:
    """Return the largest misfit of stretches of any length, and its degrees of freedom; see `misfit_of_stretches`."""
    each = [misfit_of_stretches(times_s, influence, left, share * stroke_s) for share in SHARES_OF_STROKE]
    return max(each)


def misfit_of_stretches(times_s: Array, influence: Array, left: Array, stretch_s: float) -> tuple[float, float]:
    """Return the standard deviation of the mass's logarithm from stretch to stretch, and its degrees of freedom.

    Parameters
    ----------
    times_s, influence, left : ndarray, shape (n_rows,)
        Instants of whitened rows, the change of the logarithm of the mass per unit of each, and what the fit leaves.
    stretch_s
        Length of a stretch.

    Raises
    ------
    ValueError
        If the length is not positive.
    """
    if not stretch_s > 0:
        raise ValueError(f"stretch_s must be positive, not {stretch_s}")
    stretch = np.floor((times_s - times_s.min(initial=math.inf)) / stretch_s).astype(np.int64)
    information = np.bincount(stretch, influence**2)
    if not information.sum() > 0:
        return 0.0, PRIOR_FREEDOM
    share = information / information.sum()
    moved = np.bincount(stretch, influence * left) / (1.0 - np.minimum(share, MOST_OF_ITSELF))
    freedom = 1.0 / float(share @ share) - 1.0
    counts = freedom / (freedom + PRIOR_FREEDOM)
    return math.sqrt(counts * float(moved @ moved)), freedom + PRIOR_FREEDOM


def misfit_of_weights(apart: float, variance: float) -> tuple[float, float]:
    """Return what two weighings say of a mass beside its noise, in its logarithm, and its degrees of freedom.

    Parameters
    ----------
    apart
        Difference of the logarithms of the masses by both.
    variance
        Variance of it if the model holds.
    """
    counts = 1.0 / (1.0 + PRIOR_FREEDOM)
    return math.sqrt(counts * max(apart**2 - max(variance, 0.0), 0.0)), 1.0 + PRIOR_FREEDOM
