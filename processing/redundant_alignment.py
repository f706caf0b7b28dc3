"""A bus's clock from a channel that repeats a channel of the reference recorder.

Both signals are low-passed alike, so that neither the slower sampling nor stress waves that only one
of the sensors felt decide; then ``y_i = g r((1 + gamma) t_i + tau) + c`` is solved for tau by
Gauss-Newton. The uncertainty has three parts:

- the curvature with the residual's variance, as if the residual were noise;
- the sandwich covariance of Newey and West (1987), Econometrica 55(3), with the residuals where they
  occur and correlated as they are: what two sensors do not have in common is largest in the motion;
- the scatter of the source's stamps about even steps: a bus delays frames by a varying wait, and the
  mean of that wait cannot be told from the clock's offset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from processing.correlation import coarse_lag
from processing.filters import LowPass
from processing.gaps import near
from processing.stamps import even_stamps

__all__ = ["RedundantFit", "align_redundant", "even_stamps"]

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_SAMPLES = 50
"""Below this, on either side, two records are not compared."""
LEAST_ROWS = 20
"""Below this the records hardly overlap."""
STRIDE = 4
"""Of the grid of ten points per period of the cut-off: rows 2.5 times per period."""
LONGEST_GAP = 0.5
"""Periods of the cut-off beyond which nothing is interpolated: two samples per period are the least that tell it."""
LONGEST_STEP_S = 5e-3
"""By which the offset may move at once."""
MOST_STEPS = 20
"""Of Gauss-Newton; three or four are usual."""
NEGLIGIBLE_STEP = 1e-2
"""Share of the offset's uncertainty below which a step is no step."""
MOST_CONDITION = 1e8
"""Of the scaled columns; more and they are not independent."""
CORRELATED_ROWS = 6
"""Over how many rows, about two periods of the cut-off, residuals are taken to be correlated."""


@dataclass(frozen=True, eq=False)
class RedundantFit:
    """The outcome of aligning a signal with its repeat.

    Attributes
    ----------
    offset_s, drift : float
        ``t_ref = (1 + drift) t_source + offset_s``.
    u_offset_s : float
        Standard uncertainty of the mapped time in the middle of the motion.
    u_drift : float
    gain, u_gain : float
        Source over reference.
    coarse_offset_s, correlation, second_peak : float
        Of the cross-correlation that came first.
    at_search_edge : bool
    cutoff_hz : float
        -3 dB point of the low-pass that both signals passed.
    stamp_scatter_s : float
        Standard deviation of the source's stamps about even steps.
    residual_share : float
        Root mean square of the residual over that of the source's signal.
    converged : bool
        Whether the last step towards the offset was negligible.
    """

    offset_s: float
    drift: float
    u_offset_s: float
    u_drift: float
    gain: float
    u_gain: float
    coarse_offset_s: float
    correlation: float
    second_peak: float
    at_search_edge: bool
    cutoff_hz: float
    stamp_scatter_s: float
    residual_share: float
    converged: bool = True


def align_redundant(
    source_times_s: Array,
    source: Array,
    start_s: float,
    step_s: float,
    reference: Array,
    *,
    drift_allowance: float,
    cutoff_hz: float | None = None,
) -> RedundantFit | str:
    """Find the offset and drift between a source's clock and the reference's.

    Parameters
    ----------
    source_times_s, source : ndarray, shape (n_source,)
        On the source's clock, strictly increasing; lost samples NaN. What lies near gaps is not used.
    start_s, step_s : float
        Time base of the reference signal.
    reference : ndarray, shape (n_reference,)
        The same quantity, without missing samples.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before this record is seen.
    cutoff_hz : float, optional
        -3 dB point of the common low-pass; 0.15 of the slower rate, 300 Hz at most, if left out.

    Returns
    -------
    RedundantFit or str
        A sentence where the two cannot be aligned.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, or the reference is not finite.
    """
    if source_times_s.ndim != 1 or source_times_s.shape != source.shape:
        raise ValueError(f"times and samples must be equally many, not {source_times_s.shape}, {source.shape}")
    if not np.all(np.diff(source_times_s) > 0):
        raise ValueError("source_times_s must increase strictly")
    if not np.all(np.isfinite(reference)):
        raise ValueError("reference must be finite; bridge lost samples first")
    present = np.isfinite(source)
    t, y = source_times_s[present], source[present]
    if min(t.size, reference.size) < LEAST_SAMPLES:
        return f"only {min(t.size, reference.size)} samples are there to align by"
    t, scatter_s = even_stamps(t)
    rate_hz = 1.0 / float(np.median(np.diff(t)))
    low_pass = LowPass(cutoff_hz if cutoff_hz is not None else min(300.0, 0.15 * rate_hz, 0.15 / step_s))
    grid_step = 1.0 / (10 * low_pass.cutoff_hz)
    grid, smooth, trusted = _smoothed(t, y, low_pass, grid_step)
    target = low_pass.apply(reference, 1.0 / step_s)
    lag = coarse_lag(grid, smooth, start_s, step_s, target, step_of_search_s=grid_step)
    if isinstance(lag, str):
        return lag
    rows = _Rows.of(grid, smooth, trusted, target, start_s, step_s, low_pass.reach_s)
    steps, shift, drift = 0, lag.offset_s, 0.0
    while True:
        step = _gauss_newton_step(rows, shift, drift, drift_allowance)
        if isinstance(step, str):
            return step
        steps += 1
        shift, drift = step.shift_s, step.drift
        if step.converged or steps == MOST_STEPS:
            break
    return RedundantFit(
        offset_s=shift - drift * rows.origin_s,
        drift=drift,
        u_offset_s=math.hypot(step.u_mapped_s, scatter_s),
        u_drift=min(math.sqrt(float(step.covariance[2, 2])), drift_allowance),
        gain=step.gain,
        u_gain=math.sqrt(float(step.covariance[0, 0])),
        coarse_offset_s=lag.offset_s,
        correlation=lag.correlation,
        second_peak=lag.second_peak,
        at_search_edge=lag.at_search_edge,
        cutoff_hz=low_pass.cutoff_hz,
        stamp_scatter_s=scatter_s,
        residual_share=step.residual_share,
        converged=step.converged,
    )


def _smoothed(times_s: Array, samples: Array, low_pass: LowPass, grid_step_s: float) -> tuple[Array, Array, Flags]:
    """Low-pass samples on an even grid; false where a gap of the source is in the filter's reach."""
    from scipy.interpolate import CubicSpline

    grid = np.arange(times_s[0], times_s[-1], grid_step_s)
    after = np.clip(np.searchsorted(times_s, grid, side="right"), 1, times_s.size - 1)
    gap = times_s[after] - times_s[after - 1] > LONGEST_GAP / low_pass.cutoff_hz
    # a cubic swings out of a long gap; a straight line does not
    values = np.where(gap, np.interp(grid, times_s, samples), CubicSpline(times_s, samples)(grid))
    trusted = ~near(gap, math.ceil(low_pass.reach_s / grid_step_s))
    return grid, low_pass.apply(values, 1.0 / grid_step_s), trusted


@dataclass(frozen=True, eq=False)
class _Rows:
    """Both low-passed signals, about as many rows of the source's as carry information of their own.

    The clocks map by ``t_ref = t + shift + drift (t - origin)``: shift and drift are nearly independent
    wherever the source's clock has its zero.
    """

    times_s: Array
    values: Array
    origin_s: float
    curve: PPoly
    slope: PPoly
    first_s: float
    last_s: float

    @classmethod
    def of(
        cls, grid: Array, smooth: Array, trusted: Flags, target: Array, start_s: float, step_s: float, reach_s: float
    ) -> _Rows:
        from scipy.interpolate import CubicSpline

        curve = CubicSpline(start_s + step_s * np.arange(target.size), target)
        end_s = start_s + step_s * (target.size - 1)
        at = np.arange(0, grid.size, STRIDE)
        at = at[trusted[at]]
        origin = 0.5 * float(grid[0] + grid[-1])
        return cls(grid[at], smooth[at], origin, curve, curve.derivative(), start_s + reach_s, end_s - reach_s)


@dataclass(frozen=True, eq=False)
class _Step:
    """Gain, shift, drift and constant behind one step; `covariance` is in that order."""

    shift_s: float
    drift: float
    gain: float
    covariance: Array
    u_mapped_s: float
    residual_share: float
    converged: bool


def _gauss_newton_step(rows: _Rows, shift_s: float, drift: float, drift_allowance: float) -> _Step | str:
    mapped = rows.times_s + shift_s + drift * (rows.times_s - rows.origin_s)
    inside = (mapped > rows.first_s) & (mapped < rows.last_s)
    if np.count_nonzero(inside) < LEAST_ROWS:
        return "the two records hardly overlap"
    since, values = rows.times_s[inside] - rows.origin_s, rows.values[inside]
    model, rate = rows.curve(mapped[inside]), rows.slope(mapped[inside])
    gain = float(np.linalg.lstsq(np.column_stack([model, np.ones_like(model)]), values, rcond=None)[0][0])
    design = np.column_stack([model, gain * rate, gain * rate * since, np.ones_like(model)])
    variance = _residual_variance(design, values)
    prior = np.array([0.0, 0.0, math.sqrt(variance) / max(drift_allowance, 1e-12), 0.0])
    full, target = np.vstack([design, prior]), np.append(values, -prior[2] * drift)
    scale = np.sqrt((full**2).sum(axis=0))
    if not np.all(scale > 0) or np.linalg.cond(full / scale) > MOST_CONDITION:
        return "what both records show does not tell one offset from another"
    bread = np.linalg.inv((full / scale).T @ (full / scale)) / np.outer(scale, scale)
    solution = bread @ (full.T @ target)
    residual = values - design @ solution
    leverage = np.einsum("ij,jk,ik->i", design, bread, design)
    # a row that bends the fit to itself hides its own error: MacKinnon and White (1985), J. Econometrics 29(3), HC2
    scores = _scores(design, residual / np.sqrt(np.maximum(1.0 - leverage, 0.05)), prior, variance)
    covariance = bread @ scores @ bread + bread * variance
    pick = np.array([0.0, 1.0, float(np.average(since, weights=rate**2)), 0.0])
    step = float(np.clip(solution[1], -LONGEST_STEP_S, LONGEST_STEP_S))
    return _Step(
        shift_s=shift_s + step,
        drift=drift + float(solution[2]),
        gain=float(solution[0]),
        covariance=covariance,
        u_mapped_s=math.sqrt(float(pick @ covariance @ pick)),
        residual_share=float(np.std(residual) / max(float(np.std(values)), 1e-300)),
        converged=abs(step) < max(NEGLIGIBLE_STEP * math.sqrt(float(covariance[1, 1])), 1e-10),
    )


def _residual_variance(design: Array, target: Array) -> float:
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    residual = target - design @ solution
    return float(max(residual @ residual / max(target.size - design.shape[1], 1), 1e-300))


def _scores(design: Array, residual: Array, prior: Array, variance: float) -> Array:
    """Covariance of the sum of ``design * residual``, correlated over `CORRELATED_ROWS`, and of the prior's row."""
    products = design * residual[:, None]
    total = products.T @ products
    for lag in range(1, CORRELATED_ROWS + 1):
        weight = 1.0 - lag / (CORRELATED_ROWS + 1)
        cross = products[lag:].T @ products[:-lag]
        total += weight * (cross + cross.T)
    return np.asarray(total + variance * np.outer(prior, prior), dtype=np.float64)
