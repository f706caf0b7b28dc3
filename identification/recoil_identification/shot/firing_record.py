"""Thin curves of a firing, to lay over those of other shots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.shot.identified import Identification

CURVES = ("breech_pressure_pa", "recoil_acceleration_m_s2", "recoil_travel_m")
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
