"""Contributions to the mass's uncertainty that no sensor's certificate states.

They are found by moving the cause by its standard uncertainty and estimating again: the clocks'
offsets, the sensors' zeros, and the choice of the filter.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from daq.shot import Shot
from identification.calibration import Calibration
from identification.mass import BudgetRow
from identification.regression import AREAS, PRESSURE_ROLES, Regression, spaced_rows
from identification.signals import Signals
from processing.filters import LowPass
from rigs.rig import Rig

CUTOFF_FACTORS = (0.7, 1.4)
"""Cut-offs that a careful analyst might have chosen instead, as factors on the one chosen."""


def further_contributions(
    recorded: Regression,
    filtered: Regression,
    calibration: Calibration,
    signals: Signals,
    shot: Shot,
    rig: Rig,
) -> tuple[BudgetRow, ...]:
    """Evaluate the clocks, the gauges' zeros and the filter.

    Parameters
    ----------
    recorded, filtered : Regression
        Before and behind the low-pass.
    calibration : Calibration
        Gives the correction under which the mass is evaluated.
    signals : Signals
        Gives the uncertainty of the zeros.
    shot, rig : Shot, Rig
        Tell which force hangs on which clock, and the areas.

    Returns
    -------
    tuple of BudgetRow
    """
    return (
        *_clocks(filtered, calibration, shot),
        *_zeros(filtered, calibration, signals, rig),
        _filter(recorded, filtered, calibration),
    )


def corrected_mass(regression: Regression, calibration: Calibration) -> float:
    """Mass by acceleration on force, with the sensors' errors as identified taken off, kg."""
    acceleration, force = calibration.correct(regression)
    rows = spaced_rows(regression)
    a, f = acceleration[rows], force[rows]
    return float(f @ f / (a @ f))


def _clocks(filtered: Regression, calibration: Calibration, shot: Shot) -> list[BudgetRow]:
    """Move every force by the uncertainty of its clock; the change of the mass is the contribution."""
    mass = corrected_mass(filtered, calibration)
    clocks = {role: c.time_base.clock for role in PRESSURE_ROLES if (c := shot.by_role(role)) is not None}
    rows = []
    for clock in sorted(set(clocks.values())):
        alignment = shot.alignment(clock)
        if clock == shot.reference_clock or not math.isfinite(alignment.u_offset_s):
            continue
        forces = filtered.forces_n.copy()
        for column, role in enumerate(PRESSURE_ROLES):
            if clocks.get(role) == clock:
                forces[:, column] += alignment.u_offset_s * np.gradient(forces[:, column], filtered.step_s)
        shifted = replace(filtered, forces_n=forces)
        rows.append(BudgetRow(f"alignment of clock {clock}", abs(corrected_mass(shifted, calibration) - mass), "B"))
    return rows


def _zeros(filtered: Regression, calibration: Calibration, signals: Signals, rig: Rig) -> list[BudgetRow]:
    """Move every force by the uncertainty of its gauge's zero, from the noise of the silence before the shot."""
    mass = corrected_mass(filtered, calibration)
    rows = []
    for column, (role, area) in enumerate(zip(PRESSURE_ROLES, AREAS, strict=True)):
        u_pa = signals.offsets[role].u if role in signals.offsets else 0.0
        if not (math.isfinite(u_pa) and u_pa > 0):
            continue
        forces = filtered.forces_n.copy()
        forces[:, column] += u_pa * getattr(rig.mechanism, area) * filtered.released
        change = abs(corrected_mass(replace(filtered, forces_n=forces), calibration) - mass)
        rows.append(BudgetRow(f"{role} zero", change, "A"))
    return rows


def _filter(recorded: Regression, filtered: Regression, calibration: Calibration) -> BudgetRow:
    """Half the spread over other cut-offs, as the half width of a rectangular distribution."""
    masses = [corrected_mass(filtered, calibration)]
    if filtered.low_pass is not None:
        for factor in CUTOFF_FACTORS:
            other = LowPass(factor * filtered.low_pass.cutoff_hz, filtered.low_pass.half_order)
            if other.design_hz < 0.5 * recorded.rate_hz:
                masses.append(corrected_mass(recorded.filtered(other), calibration))
    return BudgetRow("low-pass cut-off", 0.5 * (max(masses) - min(masses)) / math.sqrt(3.0), "B")
