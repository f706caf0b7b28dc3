"""A clock from trigger edges that two recorders saw."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HYSTERESIS = 0.25
"""Share of a pulse's range, from either end, that the signal must reach: noise on a slow edge is one edge."""
LEAST_SHARE_AT_LEVELS = 0.6
"""Share of the samples within `HYSTERESIS` of either end: a pulse signal rests at its levels, noise does not."""
LONGEST_STEP = 2.5
"""Steps across which an edge is interpolated: over one lost sample it is, over more its instant is not known."""


@dataclass(frozen=True)
class EdgeFit:
    """Offset and drift from edges: ``t_ref = (1 + drift) t_source + offset_s``.

    Attributes
    ----------
    offset_s, u_offset_s, drift, u_drift : float
        The uncertainty of the offset is that of the mapped time in the middle of the edges.
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
        Times strictly increasing; lost samples NaN.

    Returns
    -------
    ndarray, shape (n_edges,)
        Interpolated linearly between the two samples around the first crossing after the signal was low.
        An edge that fell into a gap is left out, for its instant is not known; so are all if the signal
        is noise alone.
    """
    present = np.isfinite(samples)
    t, y = times_s[present], samples[present]
    if y.size < 2:
        return np.empty(0)
    low, high = float(np.min(y)), float(np.max(y))
    if not high > low:
        return np.empty(0)
    middle = 0.5 * (low + high)
    state = np.zeros(y.size, dtype=np.int8)
    state[y < low + HYSTERESIS * (high - low)] = -1
    state[y > high - HYSTERESIS * (high - low)] = 1
    decided = np.flatnonzero(state)
    if decided.size < LEAST_SHARE_AT_LEVELS * y.size:
        return np.empty(0)
    rises = np.flatnonzero((state[decided[:-1]] < 0) & (state[decided[1:]] > 0))
    step = float(np.median(np.diff(t)))
    edges = []
    for before, after in zip(decided[rises], decided[rises + 1], strict=True):
        i = before + int(np.argmax(y[before + 1 : after + 1] >= middle))
        if t[i + 1] - t[i] <= LONGEST_STEP * step:
            edges.append(t[i] + (middle - y[i]) / (y[i + 1] - y[i]) * (t[i + 1] - t[i]))
    return np.array(edges, dtype=np.float64)


def align_edges(
    source_edges_s: Array, reference_edges_s: Array, *, u_edge_s: float, drift_allowance: float
) -> EdgeFit | str:
    """Relate two clocks by the same edges on both.

    Weighted least squares of the differences on time, with a prior of mean 0 for the drift: two edges
    close to one another tell the offset, not the drift.

    Parameters
    ----------
    source_edges_s, reference_edges_s : ndarray, shape (n_edges,)
        Equally many, strictly increasing.
    u_edge_s : float
        Standard uncertainty of the difference of one pair.
    drift_allowance : float
        Standard uncertainty of the clocks' rate ratio before the edges are seen.

    Returns
    -------
    EdgeFit or str
        A sentence where the edges do not pair up.

    Raises
    ------
    ValueError
        If an uncertainty is not positive, or edges do not increase.
    """
    if not (u_edge_s > 0 and drift_allowance >= 0):
        raise ValueError(f"u_edge_s must be positive, not {u_edge_s}, drift_allowance not negative: {drift_allowance}")
    n = source_edges_s.size
    if n == 0 or reference_edges_s.size == 0:
        where = "source" if reference_edges_s.size else "reference" if n else "source and reference"
        return f"no trigger edge was recorded on {where}"
    if n != reference_edges_s.size:
        return f"{n} edges on the source, {reference_edges_s.size} on the reference"
    if not (np.all(np.diff(source_edges_s) > 0) and np.all(np.diff(reference_edges_s) > 0)):
        raise ValueError("edges must increase strictly")
    difference = reference_edges_s - source_edges_s
    middle = float(source_edges_s.mean())
    since = source_edges_s - middle
    information = float(since @ since) / u_edge_s**2 + 1.0 / max(drift_allowance, 1e-12) ** 2
    drift = float(since @ difference) / u_edge_s**2 / information
    at_middle = float(difference.mean())
    return EdgeFit(
        offset_s=at_middle - drift * middle,
        u_offset_s=u_edge_s / math.sqrt(n),
        drift=drift,
        u_drift=1.0 / math.sqrt(information),
        edges=n,
        residual_s=float(np.abs(difference - at_middle - drift * since).max()),
    )
