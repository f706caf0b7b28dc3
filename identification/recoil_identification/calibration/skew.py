"""By how much the acceleration is later than the force, and the regression without it.

Channels of one recorder are taken for simultaneous, and are not where their filters or converters differ. Newton's law
tells: below the gap of the spectrum both sides of the equation of motion are one signal, once the sensors' errors
and a shift of the zero are taken off. What is found beyond its expanded uncertainty is corrected; the rest of it is
a row of the budget.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.rows.causes import SKEW
from recoil_processing.alignment.channel_skew import LEAST_NORMALISED_SKEW, measure_skew
from recoil_processing.shot.regression import Regression

AROUND_S = 0.03
"""Kept around the identification interval for the low-pass."""
MOST_CUTOFF = 0.2
"""Cut-off, as a share of the sampling rate, below which the two sides are compared: a user's own cut-off may be
higher."""
MOST_STEPS = 3
"""Rounds of correction; one is enough but where forces hang on a clock that was aligned by the accelerometer."""
MOST_SKEW_S = 2e-3
"""More is no skew of a recorder: an accelerometer would hang on another clock, or on a soft mount."""
U_CHAINS_S = 2e-6
"""Standard uncertainty of the delays of sound chains against one another: a tenth of a usual filter's tolerance."""


@dataclass(frozen=True)
class RecorderSkew:
    """The skew of both sides of one shot's equation of motion.

    Attributes
    ----------
    skew_s, u_s
        Time by which the acceleration was later than the force, and its standard uncertainty; NaN and infinity where it
        could not be told.
    corrected_s
        Skew that was taken off the regression.
    due_s
        Skew that is still to be corrected; 0 where the rest is not told from zero.
    steps
        Number of corrections: the forces on a clock that was aligned by the accelerometer move with it.
    reason
        Reason why it was or was not corrected, in words.
    """

    skew_s: float
    u_s: float
    corrected_s: float
    due_s: float
    steps: int
    reason: str

    def __str__(self) -> str:
        return self.reason

    @property
    def u_left_s(self) -> float:
        """Standard uncertainty of what is left: all of it where it was not told from zero; infinite if unknown."""
        return math.hypot(self.u_s, self.skew_s - self.corrected_s) if math.isfinite(self.u_s) else math.inf


def find_skew(
    filtered: Regression, calibration: Calibration, *, corrected_s: float = 0.0, steps: int = 0
) -> RecorderSkew:
    """Measure by how much the acceleration is later than the force.

    Parameters
    ----------
    calibration
        Calibration whose corrections are taken off both sides first.
    corrected_s
        Skew that was taken off the regression before.
    steps
        Number of corrections so far.
    """
    if filtered.low_pass is None:
        raise ValueError("the skew is measured behind the low-pass")
    first, last = np.searchsorted(
        filtered.times_s, [filtered.interval_s[0] - AROUND_S, filtered.interval_s[1] + AROUND_S]
    )
    part = slice(int(first), int(last))
    acceleration, force = calibration.correct(filtered, but=SKEW)
    force, acceleration = (np.where(filtered.trusted, side, np.nan)[part] for side in (force, acceleration))
    cutoff_hz = min(filtered.low_pass.cutoff_hz, MOST_CUTOFF * filtered.rate_hz)
    found = measure_skew(force, acceleration, filtered.rate_hz, cutoff_hz)
    if isinstance(found, str):
        return RecorderSkew(math.nan, math.inf, corrected_s, 0.0, steps, found)
    skew_s, u_s = corrected_s + found.skew_s, math.hypot(found.u_s, U_CHAINS_S)
    late = f"the acceleration is {1e6 * skew_s:+.1f} us (u {1e6 * u_s:.1f} us) later than the force"
    due = abs(found.skew_s) > LEAST_NORMALISED_SKEW * u_s
    if due and abs(skew_s) > MOST_SKEW_S:
        return RecorderSkew(skew_s, u_s, corrected_s, 0.0, steps, f"{late}: no skew of a recorder")
    if due and steps < MOST_STEPS:
        return RecorderSkew(skew_s, u_s, corrected_s, found.skew_s, steps, late)
    end = f"{1e6 * corrected_s:+.1f} us are corrected" if steps else "not told from zero, nothing is corrected"
    return RecorderSkew(skew_s, u_s, corrected_s, 0.0, steps, f"{late}: {end}")


def without_skew(times_s: Array, samples: Array, skew_s: float) -> Array:
    """Take samples from as much later as they came; what lies beside a lost one is lost, shape (n,)."""
    at, lost = times_s + skew_s, np.isnan(samples)
    moved = np.interp(at, times_s, np.where(lost, 0.0, samples))
    moved[np.interp(at, times_s, lost.astype(np.float64)) > 0.0] = np.nan
    return np.asarray(moved)
