"""Where the part is let go, what the stop gives it meanwhile, and where its travel ends: from force and velocity."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.gaps import first_of_run, longest_run
from recoil_processing.shot.thinned import factor_of, thinned_beside

SUSTAINED = 10
"""Samples in a row with a driving force that count as the release."""
FEWEST, SUSTAINED_S = 3, 5e-3
"""Fewer of them, which count where they last so long: a slow recorder has no more while the breech drives."""
FREE_TRAVEL_M = 2e-4
"""Travel from the release on, after which the part has certainly left what stop and packing were compressed by."""


def release_index(times_s: Array, net_force_n: Array, onset_s: float) -> int:
    """Index of the first sample at which the gauges' net force drives the part to the rear.

    Samples that are faster than a shot needs are thinned first, as for `recoil_processing.shot.onset.find_onset`.
    Until then the battery stop holds it with a force that no gauge reads, so neither side of the
    equation of motion is known there.

    Parameters
    ----------
    times_s, net_force_n : ndarray, shape (n,)
        Breech force less brake, recuperator and friction; NaN where lost.

    Returns
    -------
    int
        Index of the first of `SUSTAINED` samples in a row with a driving force, or of fewer that last `SUSTAINED_S`
        where samples are so far apart that there are none; a lost sample does not drive.

    Raises
    ------
    IdentificationError
        If the net force never turns positive.
    """
    factor = factor_of(times_s)
    times_s, net_force_n = thinned_beside(times_s, net_force_n)
    driving = (times_s >= onset_s - 1e-9) & (np.nan_to_num(net_force_n, nan=-1.0) > 0)
    release = first_of_run(driving, SUSTAINED)
    if release is None and times_s.size > 1:
        fewer = max(FEWEST, math.ceil(SUSTAINED_S / float(times_s[1] - times_s[0])))
        release = first_of_run(driving, fewer) if fewer < SUSTAINED else None
    if release is None:
        present = net_force_n[np.isfinite(net_force_n)]
        largest = f"at most {present.max() / 1e3:.1f} kN" if present.size else "no sample of all three pressures"
        first, behind = longest_run(driving)
        raise IdentificationError(
            "the force by the gauges never drives the recoiling part to the rear",
            expected=f"a positive net force over {SUSTAINED} samples, or over {FEWEST} that last "
            f"{1e3 * SUSTAINED_S:g} ms",
            found=f"{largest}, over {behind - first} samples",
            remedy="check areas, units and polarities of the pressures in the rig file, or record faster",
        )
    return release * factor


class StopReleaseImpulse(NamedTuple):
    """Impulse that battery stop and packing give the part while they let it go, and no gauge reads.

    Attributes
    ----------
    per_s : ndarray, shape (n,)
        Shape of the impulse over time, of unit impulse; zero throughout where the release was not recorded.
    mean_n_s, u_n_s
        Mean impulse that is free, and its standard uncertainty.
    """

    per_s: Array
    mean_n_s: float
    u_n_s: float


def stop_release_impulse(times_s: Array, net_force_n: Array, onset_s: float, mass_kg: float) -> StopReleaseImpulse:
    """Return the shape in which stop and packing push the part on after its release, and how much that may be.

    They are springs: they push with what they held until the part has moved out of their compression, less and less.
    At most they push with all of what they held over `FREE_TRAVEL_M`; how much of that it is nobody knows, so that
    every impulse up to this is taken as likely as any other.

    Parameters
    ----------
    times_s, net_force_n : ndarray, shape (n,)
        Times on a uniform grid, and breech force less brake, recuperator and friction; NaN where lost.
    mass_kg
        Mass, roughly.

    Raises
    ------
    IdentificationError
        As of `release_index`.
    """
    release = release_index(times_s, net_force_n, onset_s)
    per_s = np.zeros(times_s.size)
    at_rest = net_force_n[(times_s < onset_s) & np.isfinite(net_force_n)]
    held_n = -float(np.median(at_rest)) if at_rest.size else 0.0
    step_s = float(times_s[1] - times_s[0])
    velocity = np.cumsum(np.nan_to_num(net_force_n[release:], nan=0.0)) * step_s / mass_kg
    free = np.flatnonzero(np.cumsum(velocity) * step_s >= FREE_TRAVEL_M)
    if held_n <= 0 or not free.size:
        return StopReleaseImpulse(per_s, 0.0, 0.0)
    count = max(int(free[0]), 1)
    per_s[release : release + count] = 1.0 - (np.arange(count) + 0.5) / count
    most_n_s = held_n * count * step_s
    return StopReleaseImpulse(per_s / (per_s.sum() * step_s), 0.5 * most_n_s, most_n_s / math.sqrt(12.0))


def end_of_travel(times_s: Array, velocity_m_s: Array, onset_s: float) -> float:
    """Instant at which the velocity of recoil first returns to zero after its peak.

    Parameters
    ----------
    times_s, velocity_m_s : ndarray, shape (n,)
        Times and velocity without missing samples.

    Returns
    -------
    float
        Instant, interpolated between samples; the record's last one where the velocity does not return.

    Raises
    ------
    IdentificationError
        If the part never moves to the rear after the onset.
    """
    first = int(np.searchsorted(times_s, onset_s))
    v = velocity_m_s[first:]
    peak = int(np.argmax(v)) if v.size else 0
    if v.size == 0 or not v[peak] > 0:
        raise IdentificationError(
            "the recoiling part never moves to the rear after the onset of force",
            found=f"a largest velocity of {v[peak]:.3g} m/s" if v.size else "no sample after the onset",
            remedy="check the accelerometer's polarity and that the record goes on after the shot",
        )
    below = np.flatnonzero(v[peak:] <= 0)
    if below.size == 0:
        return float(times_s[-1])
    i = first + peak + int(below[0])
    v0, v1 = velocity_m_s[i - 1], velocity_m_s[i]
    share = v0 / (v0 - v1)
    return float(times_s[i - 1] + share * (times_s[i] - times_s[i - 1]))
