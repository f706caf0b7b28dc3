"""A clock from edges that two recorders saw: one trigger, several, or the pulse of every frame.

The line through the pairs is first that of the median slope (H. Theil, Nederl. Akad. Wetensch. Proc. 53, 1950;
P. K. Sen, J. Amer. Statist. Assoc. 63, 1968), so that pairs that are none can be set aside; then least squares, with a
prior of mean 0 for the drift: two edges close to one another determine the offset, not the drift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.alignment.pulse_train import MOST_RATE, Indices, Pairing, pair_pulses
from recoil_processing.arguments import require_increasing, require_not_negative, require_positive
from recoil_processing.gaps import LONGEST_STEP
from recoil_processing.noise import robust_sigma

HYSTERESIS = 0.25
"""Share of a pulse's range, from either end, that the signal must reach: noise on a slow edge is one edge."""
LEAST_SHARE_AT_LEVELS = 0.6
"""Share of the samples within `HYSTERESIS` of either end: a pulse signal rests at its levels, noise does not."""
TOLERANCE = 8.0
"""Standard uncertainties by which a pair may lie off before the drift is known."""
OUTLIER_SIGMA = 5.0
"""Standard uncertainties, or robust standard deviations, off the median line beyond which a pair is none."""
MOST_SLOPES = 200
"""Pairs between which slopes are taken."""
PHASES_PER_U = 50.0
"""Residuals that differ by less than this part of an edge's uncertainty fell on one phase of the sampling."""


@dataclass(frozen=True)
class EdgeFit:
    """Offset and drift from edges: ``t_ref = (1 + drift) t_source + offset_s``.

    Attributes
    ----------
    offset_s, u_offset_s, drift, u_drift
        Offset and drift with their standard uncertainties; that of the offset is the mapped time's in the middle of the
        edges.
    edges
        Number of pairs of edges that were used.
    residual_s
        Largest departure of a pair from the line; 0 for one pair.
    set_aside
        Pairs that lie off the line through the others.
    rivals
        Number of other offsets that pair the edges as well.
    unpaired_source, unpaired_reference
        Instants of edges without a counterpart, s, each on its own clock; only those between the first and the last
        pair.
    all_source, all_reference
        Numbers of edges that each side has.
    """

    offset_s: float
    u_offset_s: float
    drift: float
    u_drift: float
    edges: int
    residual_s: float
    set_aside: int = 0
    rivals: int = 0
    unpaired_source: tuple[float, ...] = ()
    unpaired_reference: tuple[float, ...] = ()
    all_source: int = 0
    all_reference: int = 0


def rising_edges(times_s: Array, samples: Array) -> Array:
    """Instants at which a pulse signal rises through the middle of its range.

    Parameters
    ----------
    times_s, samples : ndarray, shape (n,)
        Times, strictly increasing, and samples, lost ones NaN.

    Returns
    -------
    ndarray, shape (n_edges,)
        Instants of the edges, interpolated linearly between the two samples around the first crossing after the signal
        was low. An edge that fell into a gap is left out, for its instant is not known; so are all if the signal is
        noise alone.
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
    source_edges_s: Array,
    reference_edges_s: Array,
    *,
    u_edge_s: float,
    drift_allowance: float,
    near_s: tuple[float, float] | None = None,
) -> EdgeFit | str:
    """Relate two clocks by the same edges on both.

    Edges may be missing on either side, and there may be some that do not belong; the offset is the one
    that pairs most of them; of a train at even intervals, the one at which both trains begin and end together as far
    as they can (`recoil_processing.alignment.pulse_train`).

    Parameters
    ----------
    source_edges_s, reference_edges_s : ndarray, shape (n_source,), (n_reference,)
        Edges of both sides, strictly increasing.
    u_edge_s
        Standard uncertainty of the difference of one pair.
    drift_allowance
        Standard uncertainty of the clocks' rate ratio before the edges are seen.
    near_s
        An offset that is known from elsewhere, in the middle of the source's edges, and by how much it may be off.

    Returns
    -------
    EdgeFit or str
        A sentence where the edges do not pair up.

    Raises
    ------
    ValueError
        If an uncertainty is not positive, or edges do not increase.
    """
    require_positive(u_edge_s=u_edge_s)
    require_not_negative(drift_allowance=drift_allowance)
    require_increasing(source_edges_s=source_edges_s, reference_edges_s=reference_edges_s)
    if source_edges_s.size == 0 or reference_edges_s.size == 0:
        where = "source" if reference_edges_s.size else "reference" if source_edges_s.size else "source and reference"
        return f"no trigger edge was recorded on {where}"
    pairing = None if near_s is not None else _in_order(source_edges_s, reference_edges_s, u_edge_s, drift_allowance)
    if pairing is None:
        half_s = 0.5 * float(source_edges_s[-1] - source_edges_s[0])
        tolerance = TOLERANCE * math.hypot(u_edge_s, drift_allowance * half_s)
        found = pair_pulses(source_edges_s, reference_edges_s, tolerance_s=tolerance, near_s=near_s)
        if isinstance(found, str):
            return found
        pairing = found
    own, other = source_edges_s[pairing.source], reference_edges_s[pairing.reference]
    middle = float(own.mean())
    good = _on_the_line(own - middle, other - own, u_edge_s)
    difference, since = (other - own)[good], (own - middle)[good]
    middle, since = middle + float(since.mean()), since - since.mean()
    n = int(np.count_nonzero(good))
    information = float(since @ since) / u_edge_s**2 + 1.0 / max(drift_allowance, 1e-12) ** 2
    drift = float(since @ difference) / u_edge_s**2 / information
    at_middle = float(difference.mean())
    residual = difference - at_middle - drift * since
    phases = np.unique(np.round(residual * PHASES_PER_U / u_edge_s)).size
    return EdgeFit(
        offset_s=at_middle - drift * middle,
        # edges that fall on few phases of the sampling share their rounding: it does not average out
        u_offset_s=u_edge_s * max(1.0 / math.sqrt(n), 1.0 / phases),
        drift=drift,
        u_drift=1.0 / math.sqrt(information),
        edges=n,
        residual_s=float(np.abs(residual).max()),
        set_aside=int(np.count_nonzero(~good)),
        rivals=pairing.rivals,
        unpaired_source=_unpaired(source_edges_s, pairing.source),
        unpaired_reference=_unpaired(reference_edges_s, pairing.reference),
        all_source=source_edges_s.size,
        all_reference=reference_edges_s.size,
    )


def _in_order(own: Array, other: Array, u_edge_s: float, drift_allowance: float) -> Pairing | None:
    """Pair equally many edges one by one, if all of them lie on one line that clocks can have."""
    n = own.size
    if n != other.size:
        return None
    slope, left = _median_line(own - own[0], other - own)
    possible = MOST_RATE if n > 2 else 0.0
    if n > 1:
        possible = max(possible, TOLERANCE * math.hypot(drift_allowance, u_edge_s / float(own[-1] - own[0])))
    if abs(slope) > possible or np.abs(left).max() > OUTLIER_SIGMA * u_edge_s:
        return None
    every = np.arange(n, dtype=np.intp)
    # any other offset leaves one edge on either side without a counterpart
    return Pairing(every, every, 0, 1.0 + slope)


def _median_line(since: Array, difference: Array) -> tuple[float, Array]:
    """Return the median slope and what is left of the differences."""
    if since.size == 1:
        return 0.0, np.zeros(1)
    some = np.unique(np.linspace(0, since.size - 1, min(since.size, MOST_SLOPES)).astype(np.int64))
    one, later = np.triu_indices(some.size, k=1)
    slopes = (difference[some][later] - difference[some][one]) / (since[some][later] - since[some][one])
    slope = float(np.median(slopes))
    left = difference - slope * since
    return slope, left - float(np.median(left))


def _on_the_line(since: Array, difference: Array, u_edge_s: float) -> Flags:
    """Return which pairs lie on the line of the median slope."""
    if since.size < 3:
        return np.ones(since.size, dtype=np.bool_)
    _, left = _median_line(since, difference)
    limit = OUTLIER_SIGMA * max(u_edge_s, robust_sigma(left))
    return np.asarray(np.abs(left) <= limit, dtype=np.bool_)


def _unpaired(edges_s: Array, paired: Indices) -> tuple[float, ...]:
    """Return the edges between the pairs that have no counterpart."""
    return tuple(edges_s[np.setdiff1d(np.arange(paired[0], paired[-1] + 1), paired)].tolist())
