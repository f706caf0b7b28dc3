"""Exact repeats of a position that are no fault: a mark at rest, seen by what has no noise.

A camera's mark is never seen twice at exactly the same place; an encoder's, or one that is printed coarser than its
noise, is, wherever it rests or creeps. Noise shows in the motion: where third differences are no larger than the
resolution makes them there is none, and an equal position says that nothing moved. It says so only where the motion
comes to the rest and leaves it as a motion does: a mark that stands between two fast steps is stuck. Positions with
more digits than any resolution are not judged: of what has none, a rest cannot be known from a filled end.
"""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA

ROUNDING = 0.6
"""Noise in steps of the resolution up to which rounding alone makes it; rounding itself makes 0.3 to 0.4."""
LEAST_FASTEST = 3.0
"""Steps of the resolution that the fastest one is at least: of less, it is not known what the resolution is."""
LEAST_MOVES = 12
"""Different positions in a row by which noise is seen."""
SLOW_STEPS = 3.0
"""Steps of the resolution per frame up to which a mark creeps."""
SLOW_SHARE = 0.01
"""Share of the fastest step up to which a mark creeps."""
GROWTH = 1.5
"""Times that the second step from a rest is the first one: three times where the acceleration is constant."""


def rest_repeats(positions: Array) -> Flags:
    """Find the frames that are exactly as the frame before because the mark rests and nothing has noise.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_axes)
        Positions, NaN where lost.

    Returns
    -------
    ndarray of bool, shape (n_frames,)
        Whether each frame is such a repeat; none is where the motion shows noise, or is too short to show that there is
        none.
    """
    flags = np.zeros(len(positions), dtype=bool)
    if not (np.diff(positions, axis=0) == 0).all(axis=1).any():
        return flags
    seen = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if seen.size < LEAST_MOVES:
        return flags
    x = positions[seen]
    first = np.flatnonzero(np.r_[True, (np.diff(x, axis=0) != 0).any(axis=1)])
    moves = x[first]
    slow = _slowest(moves)
    if slow is None:
        return flags
    steps = np.abs(np.diff(moves, axis=0)) / slow  # of which the fastest axis counts
    fast = steps.max(axis=1) > 1
    ends = np.append(first[1:], len(x))
    for i in np.flatnonzero(ends - first > 1):
        before = i > 0 and fast[i - 1]
        after = i < len(fast) and fast[i]
        if before and (after or i == len(fast)):
            continue  # it stands between two fast steps, or never goes on behind one
        if after and i == 0 and not _speeds_up(steps):
            continue  # it goes on at full speed, which it had before it was seen
        flags[seen[first[i] + 1 : ends[i]]] = True
    return flags


def _slowest(moves: Array) -> Array | None:
    """Return the step per frame up to which each axis creeps, shape (n_axes,); None if there is noise in an axis."""
    if len(moves) < LEAST_MOVES:
        return None
    slow = np.full(moves.shape[1], np.inf)
    for i, axis in enumerate(moves.T):
        travel = float(np.ptp(axis))
        if travel == 0:
            continue
        gaps = np.diff(np.unique(axis))
        resolution = float(gaps[gaps > 1e-9 * travel].min())
        noise = MAD_TO_SIGMA * float(np.median(np.abs(np.diff(axis, n=3)))) / 20**0.5
        fastest = float(np.abs(np.diff(axis)).max())
        if noise > ROUNDING * resolution or fastest < LEAST_FASTEST * resolution:
            return None
        slow[i] = max(SLOW_STEPS * resolution, SLOW_SHARE * fastest)
    return slow


def _speeds_up(steps: Array) -> bool:
    axis = int(np.argmax(steps[0]))
    return bool(steps[1, axis] > GROWTH * steps[0, axis])
