"""Do repeated shots repeat? The rigid body's peak should, what rings need not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.filters import LowPassFilter
from recoil_processing.quality.limits import LIMITS, Outcome

LEAST_SHOTS = 3
"""Number of shots below which a spread is no figure."""
RINGS = 2.0
"""Multiple of the filtered spread beyond which that of the raw peaks is put down to ringing."""


@dataclass(frozen=True)
class ShotPeaks:
    """Largest magnitude of one channel in one shot.

    Attributes
    ----------
    raw, filtered
        Peak as recorded, and behind the low-pass; in one and the same unit.
    """

    shot: str
    raw: float
    filtered: float


def shot_peaks(shot: str, samples: Array, rate_hz: float, low_pass: LowPassFilter) -> ShotPeaks:
    """Find the peaks of one channel in one shot.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Offset taken off; lost samples NaN.
    rate_hz
        Samples per second.
    low_pass
        Low-pass, one and the same for all shots that are compared.

    Raises
    ------
    ValueError
        If fewer than two samples are there, or the low-pass does not fit the rate.
    """
    filtered, trusted = low_pass.apply_with_gaps(samples, rate_hz)
    if not np.isfinite(filtered).any():
        raise ValueError(f"{np.count_nonzero(~np.isnan(samples))} of {samples.size} samples are there")
    kept = np.abs(filtered[trusted]) if trusted.any() else np.abs(filtered)
    return ShotPeaks(shot, float(np.nanmax(np.abs(samples))), float(kept.max()))


def check_repeat_peaks(peaks: Sequence[ShotPeaks]) -> Outcome:
    """Compare the spread of the rigid body's peak over several shots with that of the raw peak.

    The spread is the sample standard deviation over the mean.

    Parameters
    ----------
    peaks
        Peaks of one channel, on one rig, with one charge.
    """
    if len(peaks) < LEAST_SHOTS:
        return "ok", f"{len(peaks)} shots: too few for a spread (at least {LEAST_SHOTS})"
    raw, filtered = (np.array([getattr(p, name) for p in peaks]) for name in ("raw", "filtered"))
    if not (np.all(np.isfinite(raw)) and np.all(np.isfinite(filtered)) and filtered.mean() > 0 and raw.mean() > 0):
        return "warn", "a peak is no number, or zero: look at the shots one by one"
    spread_raw, spread = (float(np.std(v, ddof=1) / np.mean(v)) for v in (raw, filtered))
    limit = LIMITS["repeat_share"]
    text = (
        f"over {len(peaks)} shots the rigid body's peak spreads by {100 * spread:.1f} %, the raw peak by "
        f"{100 * spread_raw:.1f} %"
    )
    if limit.verdict(spread) != "ok":
        odd = max(peaks, key=lambda p: abs(p.filtered - float(np.median(filtered))))
        return "warn", (
            f"{text} (limit {100 * limit.warn:g} %): shot {odd.shot} is furthest off with {odd.filtered:.4g}; compare "
            "its charge, ranges and mounting with the others' before the next shot"
        )
    if spread_raw > RINGS * max(spread, 1e-3):
        return "ok", f"{text}: what differs is ringing, which the low-pass takes off"
    return "ok", text
