"""A range's record of every firing: its peaks, and thin curves to lay over those of other shots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.shot.identified import Identification
from recoil_processing.shot.regression import PRESSURE_ROLES

CURVES = ("breech_pressure_pa", "recoil_acceleration_m_s2", "recoil_travel_m")
OF_ROLE = {
    "recoil_acceleration": ("recoil_acceleration_m_s2",),
    "breech_pressure": ("breech_pressure_pa", "impulse_n_s"),
}
"""Peaks that hang on the tips of a channel; of another pressure its own peak."""
CURVE_POINTS = 300
BEFORE, AFTER = 0.05, 0.1
"""Shares of the time of recoil by which the curves begin before the onset of force, and end after the end of travel."""


@dataclass(frozen=True, eq=False)
class Curves(ReadOnlyArrays):
    """Curves of one shot, to be laid over those of others.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Instants after the onset of force, s, ascending.
    values : mapping of str to ndarray, shape (n,)
        Values by the names of `CURVES`, or of more pressures; NaN where nothing was recorded.
    """

    times_s: Array
    values: dict[str, Array]


def peaks_of(found: Identification) -> dict[str, float]:
    """Return the largest values of a shot between the onset of force and the end of recoil travel, units in the names.

    Pressures are as recorded; acceleration, velocity and travel as identified. The impulse is that of the breech force
    over the same time, without what the projectile's friction takes off. On a line it is that of all that drives, the
    velocity is the largest of either direction, and the travel counts from where the body is furthest back. What the
    shot has no channel for is not in it, nor what a clipped channel would have to tell: of its tips a repair is no
    measurement.
    """
    signals, recorded, inside = found.route.signals, found.route.recorded, found.route.recorded.inside
    t0, t1 = recorded.interval_s
    peaks = {f"{role}_pa": _largest(signals.series[role][inside]) for role in PRESSURE_ROLES if role in signals.series}
    velocity, travel = recorded.outward(found.route.velocity_m_s[inside], found.route.travel_m[inside])
    drives = [column for column, sign in enumerate(recorded.signs) if sign > 0]
    peaks |= {
        "recoil_acceleration_m_s2": _largest(np.abs(found.route.filtered.acceleration_m_s2[inside])),
        "recoil_velocity_m_s": _largest(velocity),
        "recoil_travel_m": _largest(travel),
        "recoil_time_s": t1 - t0,
        # what was lost adds nothing: where that is much the report has its verdict
        "impulse_n_s": float(np.nansum(recorded.forces_n[inside][:, drives])) * recorded.step_s,
    }
    clipped = {one.role for one in signals.repairs if one.repair.kind.clips}
    untold = {name for role in clipped for name in OF_ROLE.get(role, (f"{role}_pa",))}
    return {name: value for name, value in peaks.items() if math.isfinite(value) and name not in untold}


def curves_of(found: Identification, pressures: Sequence[str] = ("breech_pressure",)) -> Curves:
    """Thin a shot's curves: pressures and acceleration behind the report's low-pass, and travel.

    Parameters
    ----------
    pressures
        Roles of the pressures; one without a channel is left out.
    """
    filtered, signals = found.route.filtered, found.route.signals
    t0, t1 = filtered.interval_s
    after_onset_s = np.linspace(-BEFORE * (t1 - t0), (1.0 + AFTER) * (t1 - t0), CURVE_POINTS)
    columns: dict[str, Array] = {}
    for role in pressures:
        if role not in signals.series:
            continue
        pressure_pa, low_pass = signals.series[role], filtered.low_pass
        if low_pass is not None:
            pressure_pa, trusted = low_pass.apply_with_gaps(pressure_pa, signals.rate_hz)
            pressure_pa = np.where(trusted, pressure_pa, np.nan)
        columns[f"{role}_pa"] = pressure_pa
    columns |= {"recoil_acceleration_m_s2": filtered.acceleration_m_s2, "recoil_travel_m": found.route.travel_m}
    values = {
        name: np.interp(after_onset_s, filtered.times_s - t0, column, left=np.nan, right=np.nan)
        for name, column in columns.items()
    }
    return Curves(after_onset_s, values)


def _largest(values: Array) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else math.nan
