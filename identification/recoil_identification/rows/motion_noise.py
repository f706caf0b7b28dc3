"""Errors of a shot's rows that come with the motion: their parts, and how large the shot itself says that they are.

A record is quieter at rest than in motion: cables, structure and everything that rubs are noisy while the part moves.
So the covariance of the rows is that of the rest and of five parts that the motion adds,

    V = V_rest + sum_k theta_k^2 (w_k w_k') o C_k        (o: element by element)

white noise behind the filter that lasts as long as the motion, that goes with the acceleration, and that goes with the
velocity; and two that are correlated over a share of the travel's time, which are what friction that hangs on the place
leaves. Their sizes have the largest restricted likelihood, everything else being integrated out (H. D. Patterson,
R. Thompson, Biometrika 58(3), 1971), and half-Cauchy priors (A. Gelman, Bayesian Analysis 1(3), 2006). While they are
looked for the sensors' scales and the friction are released, so that a gauge that is off does not pass for noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.shot.regression import Regression

CORRELATED = (0.03, 0.1)
"""Correlation times of the coloured parts, share of the travel's time."""
WHITE = 3
"""Parts that are white behind the filter: the first ones."""
PARTS = WHITE + len(CORRELATED)
SLOW = 0.25
"""Share of the cut-off behind which the acceleration tells how its own part grows."""
PRIOR_SCALES = 3.0
"""Scale of each size's half-Cauchy prior, in the standard deviation of the rows at rest or of the white part."""
GRID = 9
"""Sizes that are tried of each part, geometrically spaced; none beside them."""
FINER = (-0.5, -0.2, 0.2, 0.5)
"""Exponents of the grid's ratio by which a size is moved afterwards."""
TURNS = 3
"""Times that all parts are gone through, the first over the whole grid."""
MOST_ROWS = 300
"""Rows from which sizes are found; of more each second, third ... counts."""
_BEYOND_ALL = 1e200
"""Square beyond those of all whitened residuals."""


@dataclass(frozen=True, eq=False)
class MotionParts(ReadOnlyArrays):
    """Shapes of the parts of the rows' errors that come with the motion.

    Attributes
    ----------
    shapes : ndarray, shape (n, PARTS)
        Standard deviation of each part at every sample for a size of one: w_k.
    duration_s
        Time of the travel, on a line of one stroke.
    least_m_s2
        Smallest size of the first part, which is read without any model: standard deviation of what the upper half of
        the band leaves of acceleration and force, beyond the rest's.
    """

    shapes: Array
    duration_s: float
    least_m_s2: float

    @classmethod
    def of(cls, regression: Regression, rows: NDArray[np.intp], mass_kg: float, rest_m_s2: float) -> MotionParts:
        """Set up the parts of a filtered regression's rows.

        Parameters
        ----------
        rows
            Rows that count.
        mass_kg
            First estimate.
        rest_m_s2
            Standard deviation of the rows at rest.
        """
        moving = np.clip(np.abs(regression.released), 0.0, 1.0)
        speed = np.abs(regression.moved(regression.acceleration_m_s2)[0])
        slow = np.abs(_behind(regression, SLOW, regression.acceleration_m_s2))
        shapes = [moving, *(one / max(float(np.max(one[rows], initial=0.0)), 1e-12) for one in (slow, speed))]
        shapes += [moving] * len(CORRELATED)
        least = _upper_half(regression, rows, mass_kg)
        return cls(np.column_stack(shapes), regression.stroke_s, math.sqrt(max(least**2 - rest_m_s2**2, 0.0)))

    def covariances(self, times_s: Array, rows: NDArray[np.intp], by_filter: Array) -> Array:
        """Return the covariance of each part for a size of one, shape (PARTS, n_rows, n_rows).

        Parameters
        ----------
        times_s : ndarray, shape (n_rows,)
            Instants of the rows.
        by_filter : ndarray, shape (n_rows, n_rows)
            Correlation of white noise behind the rows' filter.
        """
        apart_s = np.abs(times_s[:, np.newaxis] - times_s)
        slow = [np.exp(-apart_s / (share * self.duration_s)) for share in CORRELATED]
        correlations = np.array([*([by_filter] * WHITE), *slow])
        shapes = self.shapes[rows].T
        return np.asarray(shapes[:, :, np.newaxis] * shapes[:, np.newaxis, :] * correlations)


def _behind(regression: Regression, share: float, column: Array) -> Array:
    """Pass a column through the regression's filter at a share of its cut-off; that of recorded signals stays."""
    low_pass = regression.low_pass
    if low_pass is None:
        return column
    return low_pass.at(share * low_pass.cutoff_hz).apply(column, regression.rate_hz)


def _upper_half(regression: Regression, rows: NDArray[np.intp], mass_kg: float) -> float:
    """Return the standard deviation of the rows' white errors by the upper half of their band, m/s^2.

    The median tells it, so that what only some rows hold counts for little.
    """
    low_pass = regression.low_pass
    left = regression.acceleration_m_s2 - regression.force_n / mass_kg
    if low_pass is None or not rows.size:
        return 0.0
    upper = (left - _behind(regression, 0.5, left))[rows]
    half = low_pass.at(0.5 * low_pass.cutoff_hz)
    hz = np.linspace(0.0, min(4.0 * low_pass.cutoff_hz, 0.499 * regression.rate_hz), 2000)
    whole = low_pass.gain(hz, regression.rate_hz) ** 2
    kept = float((whole * (1.0 - half.gain(hz, regression.rate_hz)) ** 2).sum() / whole.sum())
    return 1.4826 * float(np.median(np.abs(upper))) / math.sqrt(kept)


def likeliest_sizes(
    left: Array,
    known: Array,
    parts: Array,
    level: float,
    least: float,
    start: Array,
    *,
    highest: float,
    white_only: bool = False,
) -> Array:
    """Find the sizes of the parts that have the largest restricted likelihood, from several starts.

    One start alone ends in local optima: what is coloured and what is white explain a short record almost alike.

    Parameters
    ----------
    left : ndarray, shape (n,)
        Residuals of the rows from a linear model, at the values that all beside the rows expects of its unknowns.
    known : ndarray, shape (n, n)
        Covariance of the rows without the parts, that of all that the unknowns may do in them included.
    parts : ndarray, shape (PARTS, n, n)
        Covariance of each part for a size of one.
    level
        Standard deviation of the rows without the parts, or of their white part, whichever is larger.
    least
        Smallest size of the first part.
    start : ndarray, shape (PARTS,)
        Sizes to begin with, those of an earlier search.
    highest
        Half of the largest size that is tried.
    white_only
        Whether the first part alone is looked for.

    Returns
    -------
    ndarray, shape (PARTS,)
    """
    stride = -(-left.size // MOST_ROWS)
    search = _Search(left[::stride], known[::stride, ::stride], parts[:, ::stride, ::stride], level, least, highest)
    if white_only:
        return search.climbed(start, (0,))[1]
    floor = np.zeros(PARTS)
    floor[0] = least
    white, long = tuple(range(WHITE)), tuple(range(WHITE, PARTS))
    orders = ((start, (*white, *long)), (floor, (*long[::-1], 0, 1, 2)), (floor, (*long, 0, 1, 2)))
    found = [search.climbed(*one) for one in (*orders, (floor, (*white, *long[::-1])))]
    return max(found, key=lambda one: one[0])[1]


class _Search:
    """Coordinates in turn."""

    def __init__(self, left: Array, known: Array, parts: Array, level: float, least: float, highest: float) -> None:
        # with the residuals as its last row, the factor of the covariance has them whitened there
        self._known = np.pad(known, (0, 1))
        self._known[-1, :-1], self._known[:-1, -1], self._known[-1, -1] = left, left, _BEYOND_ALL
        self._parts = np.pad(parts, ((0, 0), (0, 1), (0, 1)))
        self._covariance = np.empty_like(self._known)
        self._scale, self._least = PRIOR_SCALES * level, least
        highest = max(level, highest)
        self._grid = np.geomspace(0.5 * level, 2.0 * highest, GRID)
        self._ratio = (4.0 * highest / level) ** (1.0 / (GRID - 1))
        self._found: dict[bytes, float] = {}

    def likelihoods(self, sizes: Array, part: int, tried: Array) -> list[float]:
        """Return the logarithms of the restricted likelihood times the priors' of some sizes, up to a constant.

        Parameters
        ----------
        sizes : ndarray, shape (PARTS,)
            Sizes of the other parts.
        part, tried
            Part whose size is tried, and its sizes.
        """
        trials = np.repeat(sizes[np.newaxis], tried.size, axis=0)
        trials[:, part] = tried
        keys = [trial.tobytes() for trial in trials]
        new = [k for k, key in enumerate(keys) if key not in self._found]
        if new:
            others = np.flatnonzero(sizes)
            others = others[others != part]
            base = self._known + np.tensordot(sizes[others] ** 2, self._parts[others], 1)
            for k in new:
                self._found[keys[k]] = self._likelihood(base, part, trials[k])
        return [self._found[key] for key in keys]

    def _likelihood(self, base: Array, part: int, sizes: Array) -> float:
        from scipy.linalg.lapack import dpotrf

        np.multiply(self._parts[part], sizes[part] ** 2, out=self._covariance)
        self._covariance += base
        # in its place: the transpose of what is symmetric, whose upper half LAPACK sees as it stands
        factor, failed = dpotrf(self._covariance.T, lower=0, clean=0, overwrite_a=1)
        if failed:
            return -math.inf
        white = factor[:-1, -1]
        logs = float(np.log(np.diagonal(factor)[:-1]).sum())
        return -0.5 * float(white @ white) - logs - float(np.log1p((sizes / self._scale) ** 2).sum())

    def climbed(self, sizes: Array, order: Sequence[int]) -> tuple[float, Array]:
        """Move one size after the other to where the likelihood is largest."""
        (best,) = self.likelihoods(sizes, order[0], sizes[[order[0]]])
        for turn in range(TURNS):
            before = sizes
            for part in order:
                near = sizes[part] * self._ratio ** np.array(FINER) if sizes[part] else np.zeros(0)
                tried = np.array([0.0, *self._grid]) if turn == 0 else near
                if part == 0:
                    tried = np.maximum(tried, self._least)
                for size, found in zip(tried, self.likelihoods(sizes, part, tried), strict=True):
                    if found > best:
                        best, sizes = found, sizes.copy()
                        sizes[part] = size
            if turn and sizes is before:
                break
        return best, sizes
