"""Skew of one channel of a recorder against another that obeys one linear relation with it.

Converters that take turns, filters of different kinds and sensors of different makes skew the channels of one recorder
against one another; a skew of 0.2 ms takes 0.2 % off an identified mass, one of 1 ms takes 5 %. Two
channels show it that are proportional below some frequency: two accelerometers on one body, or the net force and
the acceleration of the body that it moves, below the gap of the spectrum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.alignment.correlation import coarse_lag
from recoil_processing.alignment.lag_fit import GRID_PER_PERIOD, LagRows, solve_lag
from recoil_processing.arguments import require_alike
from recoil_processing.filters import LowPass

LEAST_SAMPLES = 50
"""Number of samples below which two records are not compared."""
LEAST_CORRELATION = 0.8
"""Correlation below which the two records are not proportional."""
MOST_PERIODS = 2.0
"""Periods of the cut-off by which one may be later; more is no skew within a recorder, or not of one motion."""
LEAST_NORMALISED_SKEW = 2.0
"""Standard uncertainties from which on a skew is one: its expanded uncertainty with the coverage factor 2."""


@dataclass(frozen=True)
class Skew:
    """Delay of the second of two channels after the first.

    Attributes
    ----------
    skew_s, u_s
        Skew and its standard uncertainty: ``second(t) = gain * first(t - skew) + constant``.
    gain, u_gain
        Ratio of second to first, low by the share of noise in the first's low-passed power, and its standard
        uncertainty.
    correlation
        Largest normalised correlation of the two, signed as the gain.
    cutoff_hz
        -3 dB point of the low-pass that both passed.
    residual_share
        Root mean square of what is not proportional over that of the second.
    rows
        Number of instants that the skew rests on.
    """

    skew_s: float
    u_s: float
    gain: float
    u_gain: float
    correlation: float
    cutoff_hz: float
    residual_share: float
    rows: float

    @property
    def significant(self) -> bool:
        """Whether the skew exceeds its expanded uncertainty; below that nothing is to be corrected."""
        return abs(self.skew_s) > LEAST_NORMALISED_SKEW * self.u_s


def measure_skew(first: Array, second: Array, rate_hz: float, cutoff_hz: float) -> Skew | str:
    """Measure by how much the second channel is later than the first.

    Both pass the same zero-phase low-pass; the lag is found by least squares, and its uncertainty from the residual as
    it is, largest in the motion and correlated (`recoil_processing.alignment.lag_fit`).

    It must not be used

    - below a cut-off that lets ringing through that both channels feel: it comes to the two by ways of their own;
    - where the relation has a part that depends on the velocity, as friction and brake forces do unless they were
      measured and are part of the net force: it looks like a delay;
    - where the one's sensor is a filter of its own, as on a soft mount: what is found is then its delay at the
      frequencies of the motion, which is what is to be corrected if the motion is to be compared.

    A wrong gain of either does not matter, nor does a constant offset.

    Parameters
    ----------
    first, second : ndarray, shape (n,)
        Samples of both channels at the same instants, in any units; lost samples are NaN, and nothing within the
        filter's reach of them is used.
    cutoff_hz
        -3 dB point of the common low-pass: below the gap between the motion and the ringing.

    Returns
    -------
    Skew or str
        A sentence where the skew is not identifiable.

    Raises
    ------
    ValueError
        If the shapes differ, a rate is not positive, or the cut-off is not below a quarter of the sampling rate.
    """
    require_alike(first=first, second=second)
    if not (math.isfinite(rate_hz) and rate_hz > 0 and 0 < cutoff_hz < 0.25 * rate_hz):
        raise ValueError(f"cutoff_hz must lie between 0 and a quarter of rate_hz, not {cutoff_hz} of {rate_hz}")
    present = [int(np.count_nonzero(np.isfinite(channel))) for channel in (first, second)]
    if min(present) < LEAST_SAMPLES:
        return f"only {min(present)} samples are there to compare"
    low_pass = LowPass(cutoff_hz)
    target, target_trusted = low_pass.apply_with_gaps(first, rate_hz)
    smooth, trusted = low_pass.apply_with_gaps(second, rate_hz)
    step_s = 1.0 / rate_hz
    lag = _signed_lag(smooth, target, step_s, 1.0 / (GRID_PER_PERIOD * cutoff_hz))
    if isinstance(lag, str):
        return lag
    offset_s, correlation = lag
    if abs(correlation) < LEAST_CORRELATION:
        return f"correlation {correlation:.2f}: the two are not proportional below {cutoff_hz:g} Hz"
    if abs(offset_s) > MOST_PERIODS / cutoff_hz:
        return f"the two fit best {1e3 * abs(offset_s):.3g} ms apart, which is no skew of two channels of one recorder"
    every = rate_hz / (GRID_PER_PERIOD * cutoff_hz)
    at = np.round(np.arange(0.0, smooth.size - 1, max(every, 1.0))).astype(np.int64)
    rows = LagRows.of(
        np.asarray(at * step_s, dtype=np.float64),
        smooth[at],
        trusted[at],
        0.0,
        step_s,
        target,
        target_trusted,
        low_pass,
    )
    found = solve_lag(rows, offset_s, drift_allowance=0.0)
    if isinstance(found, str):
        return found
    if not found.converged:
        return "the search for the skew did not settle"
    return Skew(
        skew_s=-found.shift_s,
        u_s=found.u_shift_s,
        gain=found.gain,
        u_gain=found.u_gain,
        correlation=correlation,
        cutoff_hz=cutoff_hz,
        residual_share=found.residual_share,
        rows=found.rows,
    )


def _signed_lag(second: Array, first: Array, step_s: float, search_s: float) -> tuple[float, float] | str:
    """Offset of the best correlation, of either sign, and that correlation."""
    times = np.asarray(step_s * np.arange(second.size), dtype=np.float64)
    lags = [coarse_lag(times, sign * second, 0.0, step_s, first, step_of_search_s=search_s) for sign in (1.0, -1.0)]
    found = [(lag, sign) for lag, sign in zip(lags, (1.0, -1.0), strict=True) if not isinstance(lag, str)]
    if not found:
        return str(lags[0])
    best, sign = max(found, key=lambda pair: pair[0].correlation)
    return best.offset_s, sign * best.correlation
