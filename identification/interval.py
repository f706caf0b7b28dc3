"""When the recoiling part is held, when it moves, and when its travel ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from daq.errors import IdentificationError

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def release_index(times_s: Array, net_force_n: Array, onset_s: float) -> int:
    """Index of the first sample at which the gauges' net force drives the part to the rear.

    Until then the battery stop holds it with a force that no gauge reads, so neither side of the
    equation of motion is known there.

    Parameters
    ----------
    times_s, net_force_n : ndarray, shape (n,)
        Breech force less brake, recuperator and friction; NaN where lost.
    onset_s : float

    Raises
    ------
    IdentificationError
        If the net force never turns positive.
    """
    driving = (times_s >= onset_s - 1e-9) & (np.nan_to_num(net_force_n, nan=-1.0) > 0)
    # a single noisy sample is not a release: ten in a row are
    run = np.convolve(driving, np.ones(10), mode="full")[9 : 9 + driving.size]
    sustained = np.flatnonzero(run > 9.5)
    if sustained.size == 0:
        raise IdentificationError(
            "the force by the gauges never drives the recoiling part to the rear",
            found=f"a largest net force of {np.nanmax(net_force_n) / 1e3:.1f} kN",
            remedy="check areas, units and polarities of the pressures in the rig file",
        )
    return int(sustained[0])


def end_of_travel(times_s: Array, velocity_m_s: Array, onset_s: float) -> float:
    """Instant at which the velocity of recoil first returns to zero after its peak.

    Interpolated between samples; the record's last instant where it does not return.

    Parameters
    ----------
    times_s, velocity_m_s : ndarray, shape (n,)
    onset_s : float
    """
    after = np.flatnonzero(times_s >= onset_s)
    v = velocity_m_s[after]
    peak = int(np.argmax(v))
    below = np.flatnonzero(v[peak:] <= 0)
    if below.size == 0:
        return float(times_s[-1])
    i = after[0] + peak + int(below[0])
    v0, v1 = velocity_m_s[i - 1], velocity_m_s[i]
    share = v0 / (v0 - v1) if v0 != v1 else 0.0
    return float(times_s[i - 1] + share * (times_s[i] - times_s[i - 1]))
