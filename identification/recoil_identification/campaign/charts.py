"""Control charts of a series, one value a shot: individuals with moving range, EWMA, and a trend.

Individuals and moving range as in ISO 7870-2:2023 with the rules of `RULES`; EWMA as in ISO 7870-6:2016 with the limits
of each point; the trend is the median of all slopes (Theil 1950, Sen 1968), tested by Kendall's rank correlation with
the order of the shots (Mann 1945). Centre and sigma are those of the series itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.budget import COVERAGE

RULE_SET = "ISO 7870-2:2023, Nelson's rules 1, 2, 3, 5, 6"
RULES = {
    "rule 1": "beyond 3 sigma",
    "rule 2": "nine in a row on one side of the centre",
    "rule 3": "six in a row rising or falling",
    "rule 5": "two of three beyond 2 sigma on one side",
    "rule 6": "four of five beyond 1 sigma on one side",
}
MOVING_RANGE = "moving range"
EWMA_RULE = "EWMA"
TREND_RULE = "trend"
"""Names of what fires beside the rules of the individuals."""

LEAST_POINTS = 3
"""Fewest points of a chart."""
SETTLED_POINTS = 20
"""Fewest points with limits that are not provisional."""
D2, D4 = 1.128, 3.267
"""Constants of ranges of two: their mean over sigma, and their upper limit over their mean."""
LAMBDA, EWMA_SIGMAS = 0.2, 3.0
TREND_LEVEL = 0.005
"""Share of series without a trend in which one is reported."""
LEAST_SPREAD = 1e-9
"""Spread of a series over its largest magnitude, below which it is one number, as it was rounded."""


@dataclass(frozen=True, eq=False)
class IndividualsChart(ReadOnlyArrays):
    """Individuals and moving range.

    Attributes
    ----------
    values : ndarray, shape (n,)
    moving_range : ndarray, shape (n - 1,)
        Range of each value and the one before it.
    centre, sigma
        Mean, and mean moving range over 1.128.
    fired : mapping of str to ndarray of bool, shape (n,)
        Points, by rule and for the moving range, that complete a pattern. Only what fired.
    """

    values: Array
    moving_range: Array
    centre: float
    sigma: float
    fired: dict[str, Flags]

    @property
    def limits(self) -> tuple[float, float]:
        """Three sigma below and above the centre."""
        return self.centre - 3.0 * self.sigma, self.centre + 3.0 * self.sigma

    @property
    def moving_range_limit(self) -> float:
        """Upper control limit of the moving range."""
        return D4 * D2 * self.sigma

    @property
    def provisional(self) -> bool:
        """True if there are too few points for limits that stay."""
        return self.values.size < SETTLED_POINTS


@dataclass(frozen=True, eq=False)
class EwmaChart(ReadOnlyArrays):
    """Exponentially weighted moving average.

    Attributes
    ----------
    values, half_width : ndarray, shape (n,)
        The average, and the distance of its limits from the centre, which grows with each point.
    fired : ndarray of bool, shape (n,)
    """

    values: Array
    half_width: Array
    fired: Flags


@dataclass(frozen=True, eq=False)
class Trend(ReadOnlyArrays):
    """A monotonic change over the shots.

    Attributes
    ----------
    values : ndarray, shape (n,)
        Difference of each from the first.
    """

    values: Array

    @cached_property
    def p_value(self) -> float:
        """Probability of a rank correlation as large by chance (H. B. Mann, Econometrica 13(3), 1945)."""
        from scipy.stats import kendalltau

        p_value = float(kendalltau(np.arange(self.values.size), self.values).pvalue) if self.values.any() else 1.0
        return p_value if math.isfinite(p_value) else 1.0

    @property
    def fired(self) -> bool:
        """True if chance alone rarely makes such a trend."""
        return self.p_value < TREND_LEVEL

    @property
    def change(self) -> float:
        """From the first shot to the last: the median of all slopes (P. K. Sen, J. Am. Stat. Assoc. 63, 1968)."""
        return self._slope[0] * (self.values.size - 1)

    @property
    def u(self) -> float:
        """Its standard uncertainty, by the slopes' 95 % interval."""
        return self._slope[1] * (self.values.size - 1)

    @cached_property
    def _slope(self) -> tuple[float, float]:
        from scipy.stats import theilslopes

        found = theilslopes(self.values, np.arange(self.values.size), alpha=COVERAGE)
        return float(found.slope), float((found.high_slope - found.low_slope) / (2.0 * NormalDist().inv_cdf(0.975)))


def individuals_chart(values: ArrayLike) -> IndividualsChart:
    """Chart individuals and their moving range.

    Parameters
    ----------
    values : array-like, shape (n,)

    Raises
    ------
    ValueError
        If there are fewer than three values, or one is not finite.
    """
    series, from_first = _series(values)
    ranges = np.abs(np.diff(from_first))
    sigma = float(ranges.mean()) / D2
    apart = from_first - from_first.mean()
    found = _patterns(apart, sigma)
    found[MOVING_RANGE] = np.append(False, ranges > D4 * D2 * sigma) if sigma > 0 else np.zeros(series.size, bool)
    return IndividualsChart(
        series,
        ranges,
        float(series[0] + from_first.mean()),
        sigma,
        {name: flags for name, flags in found.items() if flags.any()},
    )


def ewma_chart(chart: IndividualsChart) -> EwmaChart:
    """Chart the weighted average of individuals about their centre, which sees small shifts that last."""
    n = chart.values.size
    apart, average = chart.values - chart.centre, np.empty(n)
    last = 0.0
    for i in range(n):
        last = LAMBDA * apart[i] + (1.0 - LAMBDA) * last
        average[i] = last
    spread = np.sqrt(LAMBDA / (2.0 - LAMBDA) * (1.0 - (1.0 - LAMBDA) ** (2 * np.arange(1, n + 1))))
    half = EWMA_SIGMAS * chart.sigma * spread
    return EwmaChart(chart.centre + average, half, (np.abs(average) > half) & (chart.sigma > 0))


def trend(values: ArrayLike) -> Trend:
    """Look for a monotonic change.

    Raises
    ------
    ValueError
        As `individuals_chart`.
    """
    return Trend(_series(values)[1])


def _series(values: ArrayLike) -> tuple[Array, Array]:
    """Return a series, and by how much each value is off the first, so that equal values are equal to the last bit."""
    series = np.asarray(values, dtype=np.float64)
    if series.ndim != 1 or series.size < LEAST_POINTS or not np.isfinite(series).all():
        raise ValueError(f"a chart needs {LEAST_POINTS} or more finite values; got shape {series.shape}")
    from_first = series - series[0]
    if np.ptp(from_first) <= LEAST_SPREAD * np.abs(series).max():
        from_first = np.zeros_like(series)
    return series, from_first


def _patterns(apart: Array, sigma: float) -> dict[str, Flags]:
    """Find the points that complete a pattern of `RULES`, of deviations from the centre."""
    found = {name: np.zeros(apart.size, dtype=bool) for name in RULES}
    if sigma == 0:
        return found
    found["rule 1"] = np.abs(apart) > 3.0 * sigma
    for side in (apart, -apart):
        found["rule 2"] |= _of_last(side > 0, 9) == 9
        # six points have five steps between them
        found["rule 3"] |= _of_last(np.diff(side, prepend=side[0]) > 0, 5) == 5
        # the point that completes a pattern is itself beyond
        found["rule 5"] |= (side > 2.0 * sigma) & (_of_last(side > 2.0 * sigma, 3) >= 2)
        found["rule 6"] |= (side > sigma) & (_of_last(side > sigma, 5) >= 4)
    return found


def _of_last(flags: Flags, count: int) -> NDArray[np.int_]:
    """Return how many of the last so many points are flagged, this one among them, shape (n,)."""
    total = np.cumsum(flags)
    return np.asarray(total - np.concatenate([np.zeros(count, dtype=int), total])[: flags.size])
