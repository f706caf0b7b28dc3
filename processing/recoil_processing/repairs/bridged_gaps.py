"""Error of a bridge across an accelerometer's lost samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.gaps import runs_of

NEARBY_S = 0.02
"""Time around a gap within which bridges are tried at least: the recoil pulse is shorter."""
NEARBY_LENGTHS = 10
"""Lengths of the gap around it within which bridges are tried at least."""
MOST_PLACES = 400
"""Number of places at which a bridge is tried beside one gap."""


@dataclass(frozen=True)
class BridgedGap:
    """A run of lost samples and its bridge.

    Attributes
    ----------
    first, last
        The samples that are there on either side; the record's ends where it begins or ends with the gap.
    start_s, duration_s
        Start and duration of the gap, between the samples beside it, from the record's start.
    error
        Root mean square by which the bridge may be wrong, in the samples' unit.
    """

    first: int
    last: int
    start_s: float
    duration_s: float
    error: float

    @property
    def density(self) -> float:
        """Density of a white noise that changes the velocity over the gap as much as an error that stays the same.

        Such an error e over a time T changes the velocity by ``e T``; white noise of density q by ``sqrt(q T)``.
        """
        return self.error**2 * self.duration_s


def bridge_errors(samples: Array, bridged: Flags, step_s: float) -> list[BridgedGap]:
    """Find the gaps, and what bridges of the same length miss beside them.

    Straight bridges over samples that are there are compared with those; the worst one within
    `NEARBY_LENGTHS` lengths of the gap, and at least within `NEARBY_S`, counts. Where no such place is free of gaps
    the span of all samples there are does.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples, bridged.
    bridged : ndarray of bool, shape (n,)

    Returns
    -------
    list of BridgedGap
        Gaps in the order of time.
    """
    there = samples[~bridged]
    span = float(np.ptp(there)) if there.size else 0.0
    count = np.concatenate([[0], np.cumsum(bridged, dtype=np.int64)])
    gaps = []
    for start, stop in runs_of(bridged):
        first, last = max(start - 1, 0), min(stop, samples.size - 1)
        error = _worst_bridge(samples, count, start, stop, max(1, round(NEARBY_S / step_s)))
        gaps.append(
            BridgedGap(first, last, step_s * first, step_s * max(last - first, 1), span if error is None else error)
        )
    return gaps


def _worst_bridge(samples: Array, count: NDArray[np.int64], start: int, stop: int, nearby: int) -> float | None:
    """Return the largest root mean square error of bridges as long as a gap, near it; None where none can be tried."""
    length = stop - start
    reach = max(nearby, NEARBY_LENGTHS * length)
    low, high = max(start - reach, 1), min(stop + reach, samples.size - 1) - length
    if high < low:
        return None
    places = np.arange(low, high + 1)
    # thinned only afterwards: what is lost may come as regularly as the places that are tried
    places = places[count[places + length + 1] == count[places - 1]]
    places = places[:: max(1, places.size // MOST_PLACES)]
    if places.size == 0:
        return None
    inner = samples[places[:, None] + np.arange(length)]
    share = np.arange(1, length + 1) / (length + 1)
    before, behind = samples[places - 1, None], samples[places + length, None]
    missed = inner - (before + share * (behind - before))
    return float(np.sqrt((missed**2).mean(axis=1).max()))
