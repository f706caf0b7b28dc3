"""A bus's clock from a channel that repeats a channel of the reference recorder.

Both signals are low-passed alike, so that neither the slower sampling nor stress waves that only one
of the sensors felt decide; `alignment.lag_fit` then finds the lag, and what its uncertainty is made of.

A bus's stamps should lie on an even line (`alignment.stamps`). The alignment is then that of this line: the
wait by which the bus delays the aligning channel's frames is in the offset, whatever it is, and what else comes
the same way has it too. A frame of another message has a wait of its own.

A slow source folds ringing above half its sampling rate down into the motion's band, where it looks like
motion. How far that pulls the offset is found by letting the ringing that the reference felt come to the source's
samples as well (`recoil_processing.alignment.aliasing`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.readers.time.bursts import find_bursts
from recoil_processing.alignment.aliasing import folded_samples, usual_filter
from recoil_processing.alignment.correlation import coarse_lag
from recoil_processing.alignment.lag_fit import GRID_PER_PERIOD, LagRows, solve_lag
from recoil_processing.arguments import require_alike, require_finite, require_increasing
from recoil_processing.filters import LowPass
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_processing.gaps import near

LEAST_SAMPLES = 50
"""Number of samples below which, on either side, two records are not compared."""
LONGEST_GAP = 0.5
"""Periods of the cut-off beyond which nothing is interpolated: it takes two samples per period."""


@dataclass(frozen=True, eq=False)
class Beside(ReadOnlyArrays):
    """Effect on a source beside its reference, of known form, of a size that is more or less known.

    Attributes
    ----------
    columns : ndarray, shape (n_source, n_own)
        Amount that a size of one adds to what repeats the reference, at the source's samples.
    sizes : ndarray, shape (n_own,)
        Sizes as they are known.
    parts : ndarray, shape (n_reference, n_parts)
        Parts of the reference whose own scales may be off.
    u : ndarray, shape (n_own + n_parts,)
        Standard uncertainties of the sizes, and of these scales.
    counts : ndarray of bool, shape (n_source,)
        Samples that the form holds of.
    """

    columns: Array
    sizes: Array
    parts: Array
    u: Array
    counts: Flags


@dataclass(frozen=True, eq=False)
class RedundantFit:
    """The outcome of aligning a signal with its repeat.

    Attributes
    ----------
    offset_s, drift
        ``t_ref = (1 + drift) t_source + offset_s``.
    u_offset_s
        Standard uncertainty of the mapped time in the middle of the motion.
    u_alias_s
        Part of the offset's uncertainty that is due to ringing above half the source's sampling rate.
    gain, u_gain
        Source over reference.
    coarse_offset_s, correlation, second_peak
        Figures of the cross-correlation that came first.
    cutoff_hz
        -3 dB point of the low-pass that both signals passed.
    residual_share
        Root mean square of the residual over that of the source's signal.
    rows
        Number of rows that the offset rests on.
    converged
        Whether the last step towards the offset was negligible.
    """

    offset_s: float
    drift: float
    u_offset_s: float
    u_alias_s: float
    u_drift: float
    gain: float
    u_gain: float
    coarse_offset_s: float
    correlation: float
    second_peak: float
    at_search_edge: bool
    cutoff_hz: float
    residual_share: float
    rows: float
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
    derivative: int = 0,
    source_filter: AnalogLowPass | None = None,
    beside: Beside | None = None,
) -> RedundantFit | str:
    """Find the offset and drift between a source's clock and the reference's.

    Parameters
    ----------
    source_times_s, source : ndarray, shape (n_source,)
        Times on the source's clock, strictly increasing, and samples, lost ones NaN. What lies near gaps is not used.
    start_s, step_s
        Time base of the reference signal.
    reference : ndarray, shape (n_reference,)
        Reference channel of the same quantity, without missing samples.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before this record is seen.
    cutoff_hz
        -3 dB point of the common low-pass; 0.15 of the slower rate, 300 Hz at most, if left out.
    derivative
        Order of the source's derivative that repeats the reference: 0 for the source itself.
    source_filter
        The source's anti-alias filter; a gentle one near half its sampling rate if left out.
    beside
        Effects beside the reference; none if left out.

    Returns
    -------
    RedundantFit or str
        A sentence where the two cannot be aligned.

    Raises
    ------
    ValueError
        If shapes do not fit, times do not increase, or the reference is not finite.
    """
    require_alike(source_times_s=source_times_s, source=source)
    require_increasing(source_times_s=source_times_s)
    require_finite(reference=reference)
    present = np.isfinite(source)
    t, y = source_times_s[present], source[present]
    if min(t.size, reference.size) < LEAST_SAMPLES:
        return f"only {min(t.size, reference.size)} samples are there to align by"
    bursts = find_bursts(t)
    rate_hz = 1.0 / float(np.median(np.diff(t))) if bursts is None else (t.size - 1) / float(t[-1] - t[0])
    low_pass = LowPass(cutoff_hz if cutoff_hz is not None else min(300.0, 0.15 * rate_hz, 0.15 / step_s))
    grid_step = 1.0 / (GRID_PER_PERIOD * low_pass.cutoff_hz)
    grid, smooth, trusted = _smoothed(t, y, low_pass, grid_step, derivative=derivative)
    target = low_pass.apply(reference, 1.0 / step_s)
    columns, u = None, None
    parts: tuple[Array, ...] = ()
    if beside is not None:
        columns = _smoothed(t, beside.columns[present], low_pass, grid_step, derivative=0)[1]
        parts, u = tuple(low_pass.apply(part, 1.0 / step_s) for part in beside.parts.T), beside.u
        smooth = smooth - columns @ beside.sizes
        trusted &= np.interp(grid, t, beside.counts[present].astype(np.float64)) > 0.5
    if derivative > 1:
        # noise that was differentiated twice is wild where the filter knows one side of it only
        inner = slice(reach := math.ceil(low_pass.reach_s / grid_step), grid.size - reach)
        grid, smooth, trusted = grid[inner], smooth[inner], trusted[inner]
        columns = columns if columns is None else columns[inner]
        if grid.size < LEAST_SAMPLES:
            return f"a record of {t[-1] - t[0]:.3g} s is too short to be compared below {low_pass.cutoff_hz:.3g} Hz"
    lag = coarse_lag(grid, smooth, start_s, step_s, target, step_of_search_s=grid_step)
    if isinstance(lag, str):
        return lag if bursts is None else f"{bursts}: {lag}"
    rows = LagRows.of(grid, smooth, trusted, start_s, step_s, target, None, low_pass, columns, parts, u)
    found = solve_lag(rows, lag.offset_s, drift_allowance=drift_allowance)
    if isinstance(found, str):
        return found if bursts is None else f"{bursts}: so jittered, {found}"
    mapped = t + found.shift_s + found.drift * (t - rows.origin_s)
    anti_alias = source_filter or usual_filter(rate_hz)
    aliases = folded_samples(mapped, start_s, step_s, reference, anti_alias, integral=derivative)
    whole, folded, _ = _smoothed(t, aliases, low_pass, grid_step, derivative=derivative)
    at = rows.times_s[found.inside]
    pulls = [float(found.influence @ np.interp(at, whole, column)) for column in folded.T]
    # each band is there twice, a quarter of a period apart
    u_alias = abs(found.gain) * math.sqrt(0.5 * sum(pull**2 for pull in pulls))
    return RedundantFit(
        offset_s=found.shift_s - found.drift * rows.origin_s,
        drift=found.drift,
        u_offset_s=math.hypot(found.u_shift_s, u_alias),
        u_alias_s=u_alias,
        u_drift=found.u_drift,
        gain=found.gain,
        u_gain=found.u_gain,
        coarse_offset_s=lag.offset_s,
        correlation=lag.correlation,
        second_peak=lag.second_peak,
        at_search_edge=lag.at_search_edge,
        cutoff_hz=low_pass.cutoff_hz,
        residual_share=found.residual_share,
        rows=found.rows,
        converged=found.converged,
    )


def _smoothed(
    times_s: Array, samples: Array, low_pass: LowPass, grid_step_s: float, *, derivative: int
) -> tuple[Array, Array, Flags]:
    """Low-pass samples or their derivative on an even grid; false where a gap is in the filter's reach.

    ``samples`` may have columns, shape (n,) or (n, n_columns).
    """
    from scipy.interpolate import CubicSpline, make_interp_spline

    # what is differentiated twice is noise where it is quick: the low-pass comes first, none is left out before
    finer = math.ceil(grid_step_s / float(np.median(np.diff(times_s)))) if derivative > 1 else 1
    count = np.arange(times_s[0], times_s[-1], grid_step_s).size
    grid = times_s[0] + grid_step_s / finer * np.arange((count - 1) * finer + 1)
    after = np.clip(np.searchsorted(times_s, grid, side="right"), 1, times_s.size - 1)
    gap = times_s[after] - times_s[after - 1] > LONGEST_GAP / low_pass.cutoff_hz
    spline = CubicSpline(times_s, samples)
    values = spline(grid, derivative % 2)
    if gap.any():
        # a cubic swings out of a long gap; a straight line does not
        line = make_interp_spline(times_s, samples, k=1)(grid)
        values[gap] = (np.gradient(line, grid_step_s, axis=0) if derivative == 1 else line)[gap]
    trusted = ~near(gap, math.ceil(low_pass.reach_s * finer / grid_step_s))
    smooth = low_pass.apply(values, finer / grid_step_s)
    if derivative > 1:
        for _ in range(derivative):
            smooth = np.gradient(smooth, grid_step_s / finer, axis=0)
    return grid[::finer], smooth[::finer], trusted[::finer]
