"""A zero of an accelerometer that shifts at the shot, found together with the force that acted.

A piezoelectric accelerometer that was overloaded or strained comes back to another zero, at once or slowly. A
high-pass is no cure: it takes the recoil with the shift. What tells the two apart is the force. From

    a = F / m + level + step s(t) + decaying s(t) exp(-(t - t0) / tau),         s(t) = 1 from the onset t0 on,

mass, level and shift follow by linear least squares, with tau from a grid: an exponential that is fitted freely to
the tail is not to be identified. Both sides and all columns pass one and the same low-pass, so that ringing is
neither motion nor shift. A shift is taken only where it is earned: where the F-test of the further columns and the
Bayesian information criterion (G. Schwarz, Ann. Statist. 6(2), 1978) both say so, with as many samples as the
residual's autocorrelation leaves.

A brake gauge that reads wrong looks like a shift to the force alone. Where gauges are in doubt the same columns
belong into the regression that knows their uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from processing.filters import LowPass
from processing.shifted_zero import DECAYING, LEVEL, STEP, TAU, ZeroShift
from processing.zero_shift_rows import Shape, ShiftRows, cost, f_test

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIME_CONSTANTS_S: tuple[float, ...] = (0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.056, 0.08, 0.11, 0.16, 0.22)
"""Of decays that are tried: shorter ones are part of the pulse, longer ones are steps over one recoil."""
LONGEST_DECAY = 0.5
"""Of the record behind the onset, up to which a decay is told from a step."""
CUTOFF_HZ = 300.0
MARGIN = 6.0
"""By which the criterion must fall: strong in the words of Kass and Raftery (1995), J. Am. Stat. Assoc. 90."""
FALSE_ALARM = 0.01
"""Probability by chance that the F-test allows, over all shapes that were tried."""
LEAST_ROWS = 20
"""Independent rows below which nothing is decided."""
EVEN = 0.01
"""Of the time step, by which steps may differ."""


def zero_shift_columns(times_s: Array, onset_s: float, time_constants_s: Sequence[float] = TIME_CONSTANTS_S) -> Array:
    """Return the shapes of a shift as further columns of a regression: a step, and steps that decay.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
    onset_s : float
        When the shift happens; 0 before it.
    time_constants_s : sequence of float

    Returns
    -------
    ndarray, shape (n, 1 + n_time_constants)
        Before any filter; pass them through that of the regression's other columns.

    Raises
    ------
    ValueError
        If a time constant is not positive.
    """
    if not all(tau > 0 for tau in time_constants_s):
        raise ValueError(f"time constants must be positive, not {list(time_constants_s)}")
    since = times_s - onset_s
    step = (since >= 0).astype(np.float64)
    decays = [step * np.exp(-np.maximum(since, 0.0) / tau) for tau in time_constants_s]
    return np.column_stack([step, *decays])


def fit_zero_shift(
    acceleration_m_s2: Array,
    force_n: Array,
    times_s: Array,
    onset_s: float,
    *,
    used: Flags | None = None,
    low_pass: LowPass | None = None,
    time_constants_s: Sequence[float] = TIME_CONSTANTS_S,
) -> ZeroShift:
    """Find the shift of an accelerometer's zero from the force that acted on its body.

    Parameters
    ----------
    acceleration_m_s2, force_n : ndarray, shape (n,)
        On one clock, without skew and unfiltered, or filtered alike; lost samples NaN. The force is the sum of all
        that acts along the axis.
    times_s : ndarray, shape (n,)
        Even.
    onset_s : float
        Of the force. Before it there must be silence, or level and step are one.
    used : ndarray of bool, shape (n,), optional
        Where the force is all that acts: not at a stop that no gauge reads.
    low_pass : LowPass, optional
        Below the ringing; 300 Hz if left out.
    time_constants_s : sequence of float
        Those beyond half of the record behind the onset are left out.

    Returns
    -------
    ZeroShift

    Raises
    ------
    ValueError
        If shapes do not fit, times are not even, the onset is not inside the record with silence before it, or too
        few rows are left.
    """
    rate_hz = _rate_hz(times_s, acceleration_m_s2, force_n)
    low_pass = LowPass(CUTOFF_HZ) if low_pass is None else low_pass
    taus = [tau for tau in time_constants_s if tau <= LONGEST_DECAY * (times_s[-1] - onset_s)]
    acceleration, sound_a = low_pass.apply_with_gaps(acceleration_m_s2, rate_hz)
    force, sound_f = low_pass.apply_with_gaps(force_n, rate_hz)
    columns = low_pass.apply(zero_shift_columns(times_s, onset_s, taus), rate_hz)
    trusted = sound_a & sound_f & (True if used is None else used)
    # a sampling theorem's worth of rows: what lies between them the filter has made of them
    rows = np.arange(0, times_s.size, max(1, math.floor(rate_hz / (2 * low_pass.cutoff_hz))))
    rows = rows[trusted[rows]]
    before = int(np.count_nonzero(times_s[rows] < onset_s))
    if min(before, rows.size - before) < LEAST_ROWS // 2:
        raise ValueError(
            f"{before} independent rows before the onset and {rows.size - before} behind it; "
            f"{LEAST_ROWS // 2} are needed on either side"
        )
    problem = ShiftRows(acceleration[rows], np.column_stack([force[rows], np.ones(rows.size)]), columns[rows])
    shapes: list[Shape] = [(0,), *((1 + j,) for j in range(len(taus)))]
    shapes += [(0, 1 + j) for j in range(len(taus))]
    sums = {shape: problem.squares(shape) for shape in [(), *shapes]}
    effective = problem.effective_rows(min(shapes, key=lambda shape: sums[shape]))
    criteria = {shape: effective * math.log(max(s, 1e-300)) + cost(shape) * math.log(effective)
                for shape, s in sums.items()}  # fmt: skip
    best = min(shapes, key=lambda shape: criteria[shape])
    fall = criteria[()] - criteria[best]
    f_statistic, p = f_test(sums[()], sums[best], cost(best), effective - 2 - cost(best))
    p = min(1.0, p * len(shapes))
    earned = fall > MARGIN and p < FALSE_ALARM
    values, covariance, sigma = problem.solve(best if earned else (), taus, times_s[rows] - onset_s, effective)
    return ZeroShift(
        onset_s=onset_s,
        inverse_mass_per_kg=float(values[0]),
        level_m_s2=float(values[LEVEL]),
        step_m_s2=float(values[STEP]),
        decaying_m_s2=float(values[DECAYING]),
        time_constant_s=float(values[TAU]),
        covariance=covariance,
        earned=earned,
        f_statistic=f_statistic,
        p_value=p,
        bic_difference=max(fall, 0.0),
        rows=int(rows.size),
        effective_rows=effective,
        residual_m_s2=sigma,
        reason=_told(earned, values, covariance, fall, p),
    )


def _rate_hz(times_s: Array, *series: Array) -> float:
    if any(one.shape != times_s.shape for one in series) or times_s.ndim != 1 or times_s.size < LEAST_ROWS:
        raise ValueError(
            f"times and both records must be equally many, at least {LEAST_ROWS}, not {times_s.shape}, "
            f"{', '.join(str(one.shape) for one in series)}"
        )
    steps = np.diff(times_s)
    step = (times_s[-1] - times_s[0]) / (times_s.size - 1)
    if not (step > 0 and np.all(np.abs(steps - step) <= EVEN * step)):
        raise ValueError("times_s must be even; bring both records onto one grid first")
    return float(1.0 / step)


def _told(earned: bool, values: Array, covariance: Array, fall: float, p: float) -> str:
    if not earned:
        return (
            f"no shift of the zero is earned: the information criterion falls by {max(fall, 0.0):.1f} "
            f"(limit {MARGIN:g}), "
            f"chance makes as much with a probability of {p:.2g} (limit {FALSE_ALARM:g})"
        )
    u = np.sqrt(np.diag(covariance))
    parts = []
    if u[STEP]:
        parts.append(f"by {values[STEP]:+.3g} m/s^2 (u {u[STEP]:.2g}) to stay")
    if u[DECAYING]:
        parts.append(f"by {values[DECAYING]:+.3g} m/s^2 (u {u[DECAYING]:.2g}) that decay in {1e3 * values[TAU]:.3g} ms")
    return f"the zero shifted {' and '.join(parts)}: the information criterion falls by {fall:.0f}"
