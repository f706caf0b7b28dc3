"""Channels of many rates on one even grid of instants, and what that takes off them.

What a grid cannot hold is taken out before by a symmetric FIR filter of Kaiser's window (A. V. Oppenheim, R. W.
Schafer, Discrete-Time Signal Processing, 3rd ed., section 7.6), which moves nothing in time; between its samples, which
the filter makes several times as many as the grid's, a channel is read by a cubic spline. A slower channel is read
between its own samples by one: the grid adds no information to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags

PASSED = 0.4
"""Share of the grid's rate up to which a channel passes as it is, to a thousandth."""
_STOPPED = 0.5
"""Share from which on it is a thousandth."""
_KAISER_BETA, _KAISER_LENGTH = 5.65, 3.62
"""Shape of the window, and its length in periods of the transition, for 60 dB (the same, (7.75) and (7.76))."""
_FINER = 4
"""Samples for each of the grid's between which a spline is as good as the filter."""
MOST_LOST = 0.1
"""Share of the filter's weight on lost samples beyond which what it gives is lost; a spline bridges fewer of them."""
MOST_INSTANTS = 50_000_000
"""Instants of a grid beyond which it is refused: a rate in Hz was meant otherwise."""


@dataclass(frozen=True, eq=False)
class OnGrid:
    """One channel on a grid.

    Attributes
    ----------
    samples : ndarray, shape (n_instants,)
        Samples in the channel's unit; NaN before its record, behind it, and where most of what it would be read from
        is lost.
    passed_hz
        Frequency up to which everything is there; None of a channel that is slower than the grid.
    taken_out
        Root mean square of what the filter took out, in the channel's unit; 0 of a slower channel.
    largest_before, largest
        Largest magnitude as recorded, and on the grid; NaN of a channel of which nothing is there.
    """

    samples: Array
    passed_hz: float | None
    taken_out: float
    largest_before: float
    largest: float


def grid(spans_s: list[tuple[float, float]], rate_hz: float) -> tuple[float, int]:
    """Return first instant and number of instants of a grid over spans; 0 is one of its instants or would be.

    Raises
    ------
    ValueError
        If the rate is no positive number, or the grid would have more than `MOST_INSTANTS`.
    """
    if not (math.isfinite(rate_hz) and rate_hz > 0):
        raise ValueError(f"rate_hz must be positive, not {rate_hz!r}")
    first = math.ceil(min(low for low, _ in spans_s) * rate_hz - 1e-6)
    last = math.floor(max(high for _, high in spans_s) * rate_hz + 1e-6)
    count = last - first + 1
    if count > MOST_INSTANTS:
        raise ValueError(f"{count:,} instants at {rate_hz:g} Hz; at most {MOST_INSTANTS:,} make sense")
    return first / rate_hz, max(count, 0)


def read_on_grid(times_s: Array, samples: Array, instants_s: Array, rate_hz: float) -> OnGrid:
    """Read a channel at the instants of a grid.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Instants of the samples, increasing, on the clock of the grid.
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    instants_s : ndarray, shape (n_instants,)
        Instants of the grid, evenly spaced.
    rate_hz
        Rate of the grid.
    """
    from scipy.interpolate import CubicSpline  # only here: whoever reads a shot would wait for it

    known = np.isfinite(samples)
    largest_before = _largest(samples)
    if np.count_nonzero(known) < 2:
        return OnGrid(np.full(instants_s.size, np.nan), None, 0.0, largest_before, math.nan)
    step_s = float(np.median(np.diff(times_s)))
    if step_s * rate_hz >= 1.0 - 1e-9:
        first_s, last_s = times_s[known][[0, -1]]
        found = CubicSpline(times_s[known], samples[known])(np.clip(instants_s, first_s, last_s))
        found[_between_lost(times_s, known, instants_s)] = np.nan
        return OnGrid(found, None, 0.0, largest_before, _largest(found))
    even_s = times_s[0] + step_s * np.arange(round((times_s[-1] - times_s[0]) / step_s) + 1)
    spline = CubicSpline(times_s[known], samples[known])
    even = spline(np.clip(even_s, times_s[known][0], times_s[known][-1]))
    lost = _between_lost(times_s, known, even_s)
    finer = math.ceil(_FINER * rate_hz * step_s)
    passed = _passed(even, rate_hz * step_s, finer)
    share = _passed(lost.astype(np.float64), rate_hz * step_s, 1)
    there = ~lost & (share <= MOST_LOST)
    finer_s = times_s[0] + step_s / finer * np.arange(passed.size)
    found = CubicSpline(finer_s, passed)(np.clip(instants_s, finer_s[0], finer_s[-1]))
    found[_between_lost(even_s, there, instants_s)] = np.nan
    taken_out = float(np.sqrt(np.mean((even - passed[::finer])[there] ** 2))) if there.any() else 0.0
    return OnGrid(found, PASSED * rate_hz, taken_out, largest_before, _largest(found))


def _passed(samples: Array, rate_share: float, finer: int) -> Array:
    """Stop what a grid of a share of the samples' rate cannot hold; shape (n,) to ((n - 1) * finer + 1,)."""
    from scipy.signal import firwin, upfirdn  # as above

    width = (_STOPPED - PASSED) * rate_share
    half = math.ceil(0.5 * _KAISER_LENGTH / width)
    weights = firwin(2 * half * finer + 1, (PASSED + _STOPPED) * rate_share / finer, window=("kaiser", _KAISER_BETA))
    if samples.size > half:
        padded = np.pad(samples, half, mode="reflect", reflect_type="odd")
    else:
        padded = np.pad(samples, half, mode="edge")
    whole = upfirdn(weights * (finer / weights.sum()), padded, finer)
    return np.asarray(whole[2 * half * finer :][: (samples.size - 1) * finer + 1])


def _between_lost(times_s: Array, known: Flags, instants_s: Array) -> Flags:
    """Return whether a neighbour of each instant, before or behind, is lost or not there at all."""
    slack = 1e-6 * (times_s[-1] - times_s[0]) / max(times_s.size - 1, 1)
    behind = np.searchsorted(times_s, instants_s - slack, side="left")
    before = np.searchsorted(times_s, instants_s + slack, side="right") - 1
    outside = (before < 0) | (behind >= times_s.size)
    before, behind = np.clip(before, 0, times_s.size - 1), np.clip(behind, 0, times_s.size - 1)
    return np.asarray(outside | ~known[before] | ~known[behind])


def _largest(samples: Array) -> float:
    there = samples[np.isfinite(samples)]
    return float(np.max(np.abs(there))) if there.size else math.nan
