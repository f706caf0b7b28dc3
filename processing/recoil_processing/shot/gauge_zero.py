"""Zero of a sensor in a shot: how far it may move, in which shapes, and when the breech gauge reads nothing else."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.shot.thinned import thinned_beside
from recoil_rigs.rig import ChannelSpec
from recoil_rigs.tables.channel_table import UNRESTED_U_ZERO_REL, range_si

MOVES_S = (2e-3, 30e-3, 0.3)
"""Time constants of the ways in which a gauge's zero may move at the shot: at once, as a late ramp does and one that is
there while the breech still drives; slowly; and at once, to die down again with the last of them."""
U_GAS_PA = 10e3
"""Standard uncertainty of the pressure in a bore that is empty."""
EARLIEST_S = 60e-3
"""Time after the onset, s: no bore is taken to be empty before."""
LONG_GONE = 0.3
"""Share of `U_GAS_PA` to which the pressure has died down to when the bore is taken to be empty."""
FALLING = (0.1, 0.01)
"""Shares of the peak between which it is told how fast the pressure dies down."""


def zero_moves(times_s: Array, onset_s: float) -> Array:
    """Return the shapes in which a gauge's zero may move from the onset on, shape (n, n_shapes).

    Their squares add up to at most one at every instant: if the size of each is as uncertain as the zero is stated to
    be, and none is known to be the one, the zero itself is never more uncertain than that.
    """
    since = np.maximum(times_s - onset_s, 0.0)
    at_once, slowly, later = (-np.expm1(-since / tau) for tau in MOVES_S)
    return np.column_stack([at_once, slowly, at_once - later]) / math.sqrt(len(MOVES_S))


def moving_zero_pa(spec: ChannelSpec, reading_pa: Array) -> float:
    """Return by how much a gauge's zero may move: a share of its range, or of what it reads where none is declared."""
    return spec.sensor.u_moving_zero_rel * _largest(spec, reading_pa)


def unrested_zero(spec: ChannelSpec, reading: Array) -> float:
    """Return by how much the zero may be off of a sensor that was not seen at rest, in SI: a share likewise."""
    stated = spec.sensor.u_zero_rel
    return (UNRESTED_U_ZERO_REL if stated is None else stated) * _largest(spec, reading)


def _largest(spec: ChannelSpec, reading: Array) -> float:
    low, high = range_si(spec) or (0.0, float(np.nanmax(np.abs(reading), initial=0.0)))
    return max(abs(low), abs(high))


def empty_bore_s(times_s: Array, reading_pa: Array, interval_s: tuple[float, float]) -> float:
    """Return from when on the bore is empty: as late as the fall of the pressure says; infinite if it does not fall."""
    times_s, reading_pa = thinned_beside(times_s, reading_pa)
    part = (times_s >= interval_s[0]) & (times_s <= interval_s[1]) & np.isfinite(reading_pa)
    times, reading = times_s[part], reading_pa[part]
    if not times.size or not reading.max() > 0:
        return math.inf
    peak = int(np.argmax(reading))
    below = [np.flatnonzero(reading[peak:] < share * reading[peak]) for share in FALLING]
    if not all(found.size for found in below):
        return math.inf
    first, second = (float(times[peak + int(found[0])]) for found in below)
    time_constant_s = (second - first) / math.log(FALLING[0] / FALLING[1])
    left = max(FALLING[1] * float(reading[peak]) / (LONG_GONE * U_GAS_PA), 1.0)
    return max(second + time_constant_s * math.log(left), interval_s[0] + EARLIEST_S)
