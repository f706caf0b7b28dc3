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

import numpy as np
from numpy.typing import NDArray

from processing.correlation import coarse_lag
from processing.filters import LowPass

Array = NDArray[np.float64]

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
        On the source's clock, increasing; lost samples NaN.
    start_s, step_s : float
        Time base of the reference signal.
    reference : ndarray, shape (n_reference,)
        The same quantity, without missing samples.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before this record is seen.
    cutoff_hz : float, optional
        -3 dB point of the common low-pass; 0.15 of the source's rate, 300 Hz at most, if left out.

    Returns
    -------
    RedundantFit or str
        A sentence where the two cannot be aligned.
    """
    from scipy.interpolate import CubicSpline

    present = np.isfinite(source)
    t, y = source_times_s[present], source[present]
    if t.size < 50:
        return f"only {t.size} samples are there to align by"
    t, scatter_s = even_stamps(t)
    rate_hz = 1.0 / float(np.median(np.diff(t)))
    low_pass = LowPass(cutoff_hz if cutoff_hz is not None else min(300.0, 0.15 * rate_hz))
    grid_step = 1.0 / (10 * low_pass.cutoff_hz)
    grid = np.arange(t[0], t[-1], grid_step)
    smooth = low_pass.apply(CubicSpline(t, y)(grid), 1.0 / grid_step)
    target = low_pass.apply(reference, 1.0 / step_s)
    lag = coarse_lag(grid, smooth, start_s, step_s, target, step_of_search_s=grid_step)
    if isinstance(lag, str):
        return lag

    stride = 4  # rows 2.5 times per period of the cut-off: about as many as carry information of their own
    rows_t, rows_y = grid[::stride], smooth[::stride]
    curve = CubicSpline(start_s + step_s * np.arange(target.size), target)
    end_s = start_s + step_s * (target.size - 1)
    slope = curve.derivative()
    offset, drift = lag.offset_s, 0.0
    margin = low_pass.reach_s
    for _ in range(20):
        mapped = (1.0 + drift) * rows_t + offset
        inside = (mapped > start_s + margin) & (mapped < end_s - margin)
        if np.count_nonzero(inside) < 20:
            return "the two records hardly overlap"
        tt, mm, yy = rows_t[inside], mapped[inside], rows_y[inside]
        model, rate = curve(mm), slope(mm)
        gain = float(np.linalg.lstsq(np.column_stack([model, np.ones_like(model)]), yy, rcond=None)[0][0])
        design = np.column_stack([model, gain * rate, gain * rate * tt, np.ones_like(model)])
        residual_variance = _residual_variance(design, yy)
        prior = np.array([[0.0, 0.0, math.sqrt(residual_variance) / max(drift_allowance, 1e-12), 0.0]])
        full, rhs = np.vstack([design, prior]), np.append(yy, -prior[0, 2] * drift)
        scale = np.sqrt((full**2).sum(axis=0))
        solution, *_ = np.linalg.lstsq(full / scale, rhs, rcond=None)
        solution = solution / scale
        offset += float(np.clip(solution[1], -5e-3, 5e-3))
        drift += float(solution[2])
        if abs(solution[1]) < 1e-9:
            break
    residual = yy - design @ solution
    bread = np.linalg.inv((full / scale).T @ (full / scale)) / np.outer(scale, scale)
    covariance = bread @ _scores(design, residual, prior[0], residual_variance) @ bread + bread * residual_variance
    middle = float(np.average(tt, weights=rate**2))
    pick = np.array([0.0, 1.0, middle, 0.0])
    return RedundantFit(
        offset_s=offset,
        drift=drift,
        u_offset_s=math.hypot(math.sqrt(float(pick @ covariance @ pick)), scatter_s),
        u_drift=min(math.sqrt(float(covariance[2, 2])), drift_allowance),
        gain=float(solution[0]),
        u_gain=math.sqrt(float(covariance[0, 0])),
        coarse_offset_s=lag.offset_s,
        correlation=lag.correlation,
        second_peak=lag.second_peak,
        at_search_edge=lag.at_search_edge,
        cutoff_hz=low_pass.cutoff_hz,
        stamp_scatter_s=scatter_s,
        residual_share=float(np.std(residual) / max(float(np.std(yy)), 1e-300)),
    )


def even_stamps(times_s: Array) -> tuple[Array, float]:
    """Lay a line through stamps of a source that samples evenly and is stamped with jitter.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Increasing; some steps may be multiples of the others where samples were lost.

    Returns
    -------
    times_s : ndarray, shape (n,)
        On the line; as given where the source does not sample evenly.
    scatter_s : float
        Standard deviation about the line; 0 where the source does not sample evenly.
    """
    steps = np.diff(times_s)
    counts = np.round(steps / np.median(steps))
    if np.any(counts < 1):
        return times_s, 0.0
    index = np.concatenate([[0.0], np.cumsum(counts)])
    index -= index.mean()
    slope = float(index @ times_s / (index @ index))
    line = times_s.mean() + slope * index
    scatter = float(np.std(times_s - line))
    return (line, scatter) if scatter < 0.25 * slope else (times_s, 0.0)


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
