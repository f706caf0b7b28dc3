"""Bridges across lost samples that a low-pass does not notice.

A low-pass spreads a sample over its own length: a gap of a few samples of fifty thousand in a second, bridged by a
straight line, moves what comes out of it by the bridge's error times the gap's share of that length. Where that is
less than what the sensor's linearity leaves open, or the bridge misses by no more than noise, the gap costs what it
holds and no more; a longer one, or one where the signal bends more, stays lost.

What the bridge of one gap misses says nothing of that of another: what several miss adds up in squares, behind the
low-pass and in the mass.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.quantities.quantity import Unit
from recoil_processing.gaps import bridge, runs_of
from recoil_processing.noise import noise_sigma
from recoil_processing.repairs.bridged_gaps import NEARBY_LENGTHS
from recoil_processing.repairs.repair import Repair, Repaired, RepairKind

HIGHEST_CUTOFF_HZ = 1000.0
"""Cut-off of the widest low-pass behind which a bridge must not be noticed: that of the mass is lower."""
LARGEST_SHARE = 2e-3
"""Share of the signal's span that bridges may move behind that low-pass: few sensors are more linear than that."""
NOISE_SHARE = 2.0
"""Standard deviations of the noise below which a bridge misses by noise alone, whatever the span; a straight line
between two noisy samples misses a third one by 1.2 of them."""
LONGEST_GAP = 8
"""Lost samples in a row beyond which no gap is short, at whatever rate."""
LEAST_PLACES = 4
"""Places beside a gap at which a bridge must have been tried."""
LEFT = "bridged samples"
"""Cause of what the bridges leave in the samples."""
SHAPES = 8
"""Shapes in which they leave it; whatever a sum of the samples is weighted with, its u is right to one in four."""


def bridge_short_gaps(
    samples: Array, step_s: float, *, kept: Flags | None = None, unit: str = "", shown_in: Unit | None = None
) -> Repaired:
    """Bridge the gaps that a low-pass does not notice.

    What it may have left are independent errors of the gaps. They are told by `SHAPES` shapes, in each of which every
    gap has its error with a sign drawn at random: together they move each sample by its bridge's error, and any sum of
    samples by as much, in expectation, as independent errors do.

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
    Repaired
        The same samples where nothing is bridged; at most one repair.
    """
    lost = np.isnan(samples)
    short = [(start, stop) for start, stop in runs_of(lost) if _may_be_bridged(start, stop, samples.size, kept)]
    if not short:
        return Repaired(samples)
    whole, there, share = bridge(samples), samples[~lost], 2.0 * HIGHEST_CUTOFF_HZ * step_s
    runs = np.array(short)
    lengths = runs[:, 1] - runs[:, 0]
    errors = _errors(whole, lost, runs)
    sigma = noise_sigma(there)
    moved = min(1.0, share) * _summed_nearby(runs[:, 0], lengths * errors, max(1.0, 1.0 / share))
    chosen = (moved <= LARGEST_SHARE * np.ptp(there)) | (errors <= NOISE_SHARE * sigma)
    if not chosen.any():
        return Repaired(samples)
    runs, lengths, errors, moved = runs[chosen], lengths[chosen], errors[chosen], moved[chosen]
    at = np.concatenate([np.arange(start, stop) for start, stop in runs])
    flags = np.zeros(samples.size, dtype=np.bool_)
    flags[at] = True
    squares = float(np.sum(lengths * errors**2))
    growth = float(np.sqrt(1.0 + squares / (samples.size * sigma**2)) - 1.0) if sigma > 0 else 0.0
    figures = {
        "longest_run": float(lengths.max()),
        "largest_error": float(errors.max()),
        "largest_error_filtered": float(moved.max()),
        "noise_growth": growth,
    }
    factor = 1.0 if shown_in is None else shown_in.factor
    sentence = (
        f"{at.size} lost samples, at most {lengths.max()} in a row, are bridged by straight lines: lines tried beside "
        f"them miss by {errors.max() / factor:.2g} {unit}".rstrip()
        + f", of which a low-pass of {HIGHEST_CUTOFF_HZ:g} Hz leaves {moved.max() / factor:.1g} {unit}".rstrip()
        + f"; the channel's noise grows by {100 * growth:.2g} %"
    )
    signs = np.random.default_rng(SHAPES).choice([-1.0, 1.0], size=(SHAPES, len(runs)))
    left = np.zeros((SHAPES, samples.size))
    left[:, at] = np.repeat(signs * errors / np.sqrt(SHAPES), lengths, axis=1)
    repair = Repair(RepairKind.LOST_BRIDGED, flags, sentence, figures)
    return Repaired(np.where(flags, whole, samples), (repair,), {LEFT: left})


def _may_be_bridged(start: int, stop: int, count: int, kept: Flags | None) -> bool:
    """Return whether a gap is short, has a sample on either side, and is none of those that stay lost."""
    if stop - start > LONGEST_GAP or start == 0 or stop == count:
        return False
    return kept is None or not kept[start:stop].any()


def _errors(whole: Array, lost: Flags, runs: NDArray[np.int64]) -> Array:
    """Return the standard errors of bridges, shape (n_runs,); infinite where too few could be tried beside a gap.

    Bridges of a gap's length are tried within `NEARBY_LENGTHS` of it, wherever all samples are there.
    """
    lost_before = np.concatenate([[0], np.cumsum(lost, dtype=np.int64)])
    lengths, errors = runs[:, 1] - runs[:, 0], np.full(len(runs), np.inf)
    for length in np.unique(lengths).tolist():
        before, behind = whole[: -length - 1], whole[length + 1 :]
        squares = np.zeros(before.size)
        for at in range(1, length + 1):
            line = before + at / (length + 1) * (behind - before)
            squares += (whole[at : at + before.size] - line) ** 2 / length
        # a bridge from the sample at this place on
        tried = lost_before[length + 2 :] == lost_before[: before.size]
        count = np.concatenate([[0], np.cumsum(tried)])
        summed = np.concatenate([[0.0], np.cumsum(np.where(tried, squares, 0.0))])
        of_length = lengths == length
        first = runs[of_length, 0]
        low = np.maximum(first - 1 - NEARBY_LENGTHS * length, 0)
        high = np.minimum(first + NEARBY_LENGTHS * length, before.size)
        places = count[high] - count[low]
        mean = np.maximum(summed[high] - summed[low], 0.0) / np.maximum(places, 1)
        errors[of_length] = np.where(places >= LEAST_PLACES, np.sqrt(mean), np.inf)
    return errors


def _summed_nearby(at: NDArray[np.int64], errors: Array, length: float) -> Array:
    """Add up errors in squares, shape (n,), of places no more than half a length from each."""
    finite = np.where(np.isfinite(errors), errors, 0.0)
    summed = np.concatenate([[0.0], np.cumsum(finite**2)])
    low, high = np.searchsorted(at, at - 0.5 * length), np.searchsorted(at, at + 0.5 * length, side="right")
    return np.asarray(np.where(np.isfinite(errors), np.sqrt(summed[high] - summed[low]), np.inf))
