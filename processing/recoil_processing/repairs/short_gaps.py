"""Bridges across lost samples that a low-pass does not notice.

A low-pass spreads a sample over its own length: a gap of a few samples of fifty thousand in a second, bridged by a
straight line, moves what comes out of it by the bridge's error times the gap's share of that length. Where that is
less than what the sensor's linearity leaves open, the gap costs what it holds and no more; a longer one, or one where
the signal bends, stays lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.quantity import Unit
from recoil_processing.gaps import bridge, runs_of
from recoil_processing.noise import noise_sigma
from recoil_processing.repairs.bridged_gaps import NEARBY_S, bridge_errors
from recoil_processing.repairs.repair import Repair, RepairKind

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HIGHEST_CUTOFF_HZ = 1000.0
"""Cut-off of the widest low-pass behind which a bridge must not be noticed: that of the mass is lower."""
LARGEST_SHARE = 5e-4
"""Share of the signal's span that a bridge may move behind that low-pass: a sensor is no more linear than that."""
LONGEST_GAP = 8
"""Lost samples in a row beyond which no gap is short, at whatever rate."""


def bridge_short_gaps(
    samples: Array, step_s: float, *, kept: Flags | None = None, unit: str = "", shown_in: Unit | None = None
) -> tuple[Array, tuple[Repair, ...]]:
    """Bridge the gaps that a low-pass does not notice.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples, evenly spaced; lost ones are NaN.
    step_s
        Time from one to the next.
    kept : ndarray of bool, shape (n_samples,), optional
        Samples that stay lost whatever lies beside them: at a clipped tip a straight line is known to be wrong.
    unit, shown_in
        Name and unit of the sentence, where the samples are in SI and it is another.

    Returns
    -------
    samples : ndarray, shape (n_samples,)
        The same array where nothing is bridged.
    repairs
        What was bridged, at most one.
    """
    lost = np.isnan(samples)
    short = [(start, stop) for start, stop in runs_of(lost) if _may_be_bridged(start, stop, samples.size, kept)]
    if not short:
        return samples, ()
    there = samples[~lost]
    span, share = float(np.ptp(there)), 2.0 * HIGHEST_CUTOFF_HZ * step_s
    errors = {(gap.first + 1, gap.last): gap.error for gap in bridge_errors(bridge(samples), lost, step_s)}
    # an error of that many samples, spread over the samples of the low-pass
    moved = {run: errors[run] * min(1.0, share * (run[1] - run[0])) for run in short}
    chosen = [run for run in short if moved[run] <= LARGEST_SHARE * span]
    if not chosen:
        return samples, ()
    flags = np.zeros(samples.size, dtype=np.bool_)
    for start, stop in chosen:
        flags[start:stop] = True
    bridged = np.where(flags, bridge(samples), samples)
    worst, longest = max(chosen, key=moved.__getitem__), max(stop - start for start, stop in chosen)
    squares = sum((stop - start) * errors[start, stop] ** 2 for start, stop in chosen)
    sigma = noise_sigma(there)
    growth = float(np.sqrt(1.0 + squares / (samples.size * sigma**2)) - 1.0) if sigma > 0 else 0.0
    factor = 1.0 if shown_in is None else shown_in.factor
    figures = {
        "longest_run": longest,
        "largest_error": errors[worst],
        "largest_error_filtered": moved[worst],
        "noise_growth": growth,
    }
    count = int(np.count_nonzero(flags))
    sentence = (
        f"{count} lost samples, at most {longest} in a row, are bridged by straight lines: lines tried within "
        f"{1e3 * NEARBY_S:g} ms of them miss by {errors[worst] / factor:.2g} {unit}".rstrip()
        + f", of which a low-pass of {HIGHEST_CUTOFF_HZ:g} Hz leaves {moved[worst] / factor:.1g} {unit}".rstrip()
        + f"; the channel's noise grows by {100 * growth:.2g} %"
    )
    return bridged, (Repair(RepairKind.LOST_BRIDGED, flags, sentence, figures),)


def _may_be_bridged(start: int, stop: int, count: int, kept: Flags | None) -> bool:
    """Return whether a gap is short, has a sample on either side, and is none of those that stay lost."""
    if stop - start > LONGEST_GAP or start == 0 or stop == count:
        return False
    return kept is None or not kept[start:stop].any()
