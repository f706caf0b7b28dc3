"""A clock from trigger edges that two recorders saw."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EdgeFit:
    """Offset and drift from edges: ``t_ref = (1 + drift) t_source + offset_s``.

    Attributes
    ----------
    offset_s, u_offset_s, drift, u_drift : float
        The uncertainty is that of the mapped time at the edges.
    edges : int
        How many pairs of edges were used.
    residual_s : float
        Largest departure of a pair from the line; 0 for one pair.
    """

    offset_s: float
    u_offset_s: float
    drift: float
    u_drift: float
    edges: int
    residual_s: float


def rising_edges(times_s: Array, samples: Array) -> Array:
    """Instants at which a pulse signal rises through the middle of its range.

    Parameters
    ----------
    times_s, samples : ndarray, shape (n,)
        Lost samples NaN.

    Returns
    -------
    ndarray, shape (n_edges,)
        Interpolated linearly between the two samples around the crossing.
    """
    present = np.isfinite(samples)
    t, y = times_s[present], samples[present]
    if y.size < 2 or not np.ptp(y) > 0:
        return np.empty(0)
    low, high = np.percentile(y, 1), np.max(y)
    middle = 0.5 * (low + high)
    at = np.flatnonzero((y[:-1] < middle) & (y[1:] >= middle))
    share = (middle - y[at]) / (y[at + 1] - y[at])
    return np.asarray(t[at] + share * (t[at + 1] - t[at]))


def align_edges(
    source_edges_s: Array, reference_edges_s: Array, *, u_edge_s: float, drift_allowance: float
) -> EdgeFit | str:
    """Relate two clocks by the same edges on both.

    Parameters
    ----------
    source_edges_s, reference_edges_s : ndarray
        Equally many, in order.
    u_edge_s : float
        Standard uncertainty of the difference of one pair.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio where one edge cannot tell it.

    Returns
    -------
    EdgeFit or str
        A sentence where the edges do not pair up.
    """
    n = source_edges_s.size
    if n == 0 or reference_edges_s.size == 0:
        return "no trigger edge was recorded"
    if n != reference_edges_s.size:
        return f"{n} edges on the source, {reference_edges_s.size} on the reference"
    difference = reference_edges_s - source_edges_s
    if n == 1:
        return EdgeFit(float(difference[0]), u_edge_s, 0.0, drift_allowance, 1, 0.0)
    middle = float(source_edges_s.mean())
    since = source_edges_s - middle
    drift = float(since @ difference / (since @ since))
    at_middle = float(difference.mean())
    residual = difference - at_middle - drift * since
    return EdgeFit(
        offset_s=at_middle - drift * middle,
        u_offset_s=u_edge_s / math.sqrt(n),
        drift=drift,
        u_drift=u_edge_s / math.sqrt(float(since @ since)),
        edges=n,
        residual_s=float(np.abs(residual).max()),
    )
