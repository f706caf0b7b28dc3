"""One step of a regression's slope: whether there is one, when, and how large.

At every instant that may be its, a step column is added to the regression; the largest of the Wald statistics
is the test (D. W. K. Andrews, "Tests for parameter instability and structural change with unknown change
point", Econometrica 61(4), 1993). Its distribution is not taken from tables, which hold for regressors whose
energy comes in at an even rate: a shot's force is over in a few milliseconds. It is drawn, with the regressors
as they are (B. E. Hansen, "Testing for structural change in conditional models", J. Econometrics 97(1), 2000).
Plain arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays

Array = NDArray[np.float64]

DRAWS = 20_000
"""Of the largest statistic's distribution: probabilities of 1 % are then known to a tenth."""
AT_ONCE = 2000
"""Draws at a time: they stay in the processor's cache."""
LARGEST_CANDIDATES = 120
"""Instants among which the largest statistic is looked for; what lies between differs little from its neighbours."""
TRIMMED = 0.02
"""Share of the rows at either end in which no step is looked for."""
FINER = 81
"""Instants around the largest statistic, for the step's own instant."""
LEAST_REDUNDANCY = 1e-6
"""Below this share of a step column's energy the others say the same."""


@dataclass(frozen=True, eq=False)
class StepTest(ReadOnlyArrays):
    """The test for one step at an unknown instant, and the step that fits best.

    Attributes
    ----------
    instants_s : ndarray, shape (n_instants,)
        At which a step was tried.
    statistics : ndarray, shape (n_instants,)
        Wald statistic of each: chi-squared of one degree of freedom if the instant were known before.
    p_value
        Probability that the largest of them is as large without a step.
    critical_5, critical_1
        What the largest exceeds with a probability of 5 and 1 % without a step.
    slope
        Before the step that fits best.
    change, u_change
        Size of that step over the slope before it, and its standard uncertainty, that of the instant included.
    instant_s
        Most likely instant.
    interval_s
        In which it lies with a probability of 95 %, if there is one step.
    residual : ndarray, shape (n,)
        What that step leaves of each row, over the row's standard deviation.
    """

    instants_s: Array
    statistics: Array
    p_value: float
    critical_5: float
    critical_1: float
    slope: float
    change: float
    u_change: float
    instant_s: float
    interval_s: tuple[float, float]
    residual: Array

    @property
    def largest(self) -> float:
        """The largest statistic."""
        return float(np.max(self.statistics))


class _Rows:
    """Rows over their errors, with the calibrations as further rows; steps are told by what the others leave."""

    def __init__(self, response: Array, slope: Array, known: Array, free: Array, sigma: Array) -> None:
        self.sigma, self.slope = sigma, slope
        k = known.shape[1]
        regressors = np.column_stack([slope, free, known])
        prior = np.column_stack([np.zeros((k, regressors.shape[1] - k)), np.eye(k)])
        self.stacked = np.vstack([regressors / sigma[:, None], prior])
        self.target = np.concatenate([response / sigma, np.zeros(k)])
        self.scale = np.sqrt((self.stacked**2).sum(axis=0))
        self.scale[self.scale == 0] = 1.0
        u, s, _ = np.linalg.svd(self.stacked / self.scale, full_matrices=False)
        self.basis = u[:, s > 1e-12 * s[0]]
        self.residual = self.target - self.basis @ (self.basis.T @ self.target)

    def steps(self, risen: Array) -> Array:
        """Return the slope's regressor times how far each step is done, over the errors, shape (rows, n_instants)."""
        full = np.zeros((self.stacked.shape[0], risen.shape[1]))
        full[: self.sigma.size] = (self.slope / self.sigma)[:, None] * risen
        return full

    def without(self, columns: Array) -> Array:
        """Return columns without what the regressors explain of them."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))

    def fit(self, step: Array) -> tuple[float, float, Array]:
        """Return the slope before a step, the step, and the rows' residuals over their errors."""
        columns = np.column_stack([self.stacked / self.scale, step])
        found = np.linalg.lstsq(columns, self.target, rcond=1e-12)[0]
        left = (self.target - columns @ found)[: self.sigma.size]
        return float(found[0] / self.scale[0]), float(found[-1]), left


def step_test(
    times_s: Array,
    response: Array,
    slope: Array,
    known: Array,
    free: Array,
    sigma: Array,
    *,
    transition: Callable[[Array], Array] | None = None,
    draws: int = DRAWS,
    seed: int = 0,
) -> StepTest:
    """Test whether one slope holds for all rows.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Ascending.
    response : ndarray, shape (n,)
    slope : ndarray, shape (n,)
        The regressor whose coefficient may step.
    known : ndarray, shape (n, n_known)
        What one standard uncertainty of each calibrated error adds to the response.
    free : ndarray, shape (n, n_free)
        Regressors that nothing restricts and that do not step.
    sigma : ndarray, shape (n,)
        Standard deviation of each row's error; rows are independent.
    transition
        Of time from the step, s: how far it is done, 0 before and 1 after, what a filter makes of it in between.
    draws, seed
        Of the largest statistic's distribution.

    Raises
    ------
    ValueError
        If there are fewer than ten rows, or no instant at which a step could be told.
    """
    if times_s.size < 10:
        raise ValueError(f"{times_s.size} rows are too few to look for a step; at least 10 are needed")
    rise = transition if transition is not None else _at_once
    rows = _Rows(response, slope, known, free, sigma)
    trimmed = max(2, math.ceil(TRIMMED * times_s.size))
    inner = times_s[trimmed - 1 : times_s.size - trimmed + 1]
    count = min(LARGEST_CANDIDATES, inner.size - 1)
    places = np.linspace(0, inner.size - 1, count + 1)
    # a step between two rows is the same wherever between them it is
    instants = np.interp(0.5 * (places[1:] + places[:-1]), np.arange(inner.size), inner)

    def identifiable(at_s: Array) -> tuple[Array, Array, Array]:
        """Return the instants of which the rows can tell, their columns less what the others say, and the energy."""
        whole = rows.steps(rise(times_s[:, None] - at_s))
        left = rows.without(whole)
        energy = (left**2).sum(axis=0)
        enough = energy > LEAST_REDUNDANCY * np.maximum((whole**2).sum(axis=0), np.finfo(np.float64).tiny)
        return at_s[enough], left[:, enough], energy[enough]

    instants, columns, energy = identifiable(instants)
    if not instants.size:
        raise ValueError("the other regressors explain every step; none could be told")
    unit = columns / np.sqrt(energy)
    statistics = (unit.T @ rows.residual) ** 2
    largest = _largest_by_chance(unit, draws, seed)
    p = (1 + float((largest >= statistics.max()).sum())) / (largest.size + 1)
    near = instants[int(np.argmax(statistics))]
    spacing = float(np.max(np.diff(instants), initial=0.0))
    fine = near + 2 * spacing * np.linspace(-1, 1, FINER)
    fine = fine[(fine >= inner[0]) & (fine <= inner[-1])]
    all_instants = identifiable(np.union1d(instants, fine))
    u_change, instant_s, interval_s = _most_likely(rows.residual, *all_instants)
    before, step, left = rows.fit(rows.steps(rise(times_s[:, None] - np.array([instant_s])))[:, 0])
    return StepTest(
        instants_s=instants,
        statistics=statistics,
        p_value=p,
        critical_5=float(np.quantile(largest, 0.95)),
        critical_1=float(np.quantile(largest, 0.99)),
        slope=before,
        change=step / before,
        u_change=u_change / abs(before),
        instant_s=instant_s,
        interval_s=interval_s,
        residual=left,
    )


def _at_once(since_s: Array) -> Array:
    return (since_s >= 0.0).astype(np.float64)


def _largest_by_chance(unit: Array, draws: int, seed: int) -> Array:
    """Draw the largest statistic of rows that hold nothing but their errors."""
    correlation = unit.T @ unit
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-10 * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    rng = np.random.default_rng(seed)
    largest = np.empty(draws)
    for start in range(0, draws, AT_ONCE):
        part = largest[start : start + AT_ONCE]
        drawn = rng.standard_normal((part.size, root.shape[1])) @ root.T
        np.maximum(drawn.max(axis=1), -drawn.min(axis=1), out=part)
    return largest**2


def _most_likely(
    residual: Array, instants: Array, columns: Array, energy: Array
) -> tuple[float, float, tuple[float, float]]:
    """Return the deviation of the step's size, the likeliest instant and its interval, for flat priors of both."""
    sizes, variances = columns.T @ residual / energy, 1.0 / energy
    exponent = 0.5 * sizes**2 / variances
    edges = np.concatenate([instants[:1], 0.5 * (instants[1:] + instants[:-1]), instants[-1:]])
    width = np.diff(edges) if instants.size > 1 else np.ones(1)
    # a flat prior on the size leaves its standard deviation as a factor
    weights = np.exp(exponent - exponent.max()) * np.sqrt(variances) * width
    weights /= weights.sum()
    mean = float(weights @ sizes)
    u = math.sqrt(float(weights @ (variances + (sizes - mean) ** 2)))
    best = float(instants[int(np.argmax(exponent))])
    low, high = np.interp([0.025, 0.975], np.concatenate([[0.0], np.cumsum(weights)]), edges)
    return u, best, (min(float(low), best), max(float(high), best))
