"""Contributions to the mass's uncertainty that no sensor's certificate states.

They are found by moving the cause by its standard uncertainty and estimating again: the clocks' offsets, the sensors'
zeros, and what repairs may have left. This is for the estimators that have no unknown for them; the inference has, see
`recoil_identification.causes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.shot import Shot
from recoil_identification.budget import BudgetRow
from recoil_identification.calibration import Calibration
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression, spaced_rows
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig

CUTOFF_FACTORS = (0.7, 1.4)
"""Cut-offs that a careful analyst might have chosen instead, as factors on the one chosen."""
LARGEST_CUTOFF_EFFECT = 9e-4
"""Of the mass by them, relative: as much is the noise of other samples, which the random part has already."""


def further_contributions(
    filtered: Regression, calibration: Calibration, signals: Signals, shot: Shot, rig: Rig
) -> tuple[BudgetRow, ...]:
    """Evaluate the clocks, the gauges' zeros and the repairs for the route by the accelerometer.

    Parameters
    ----------
    filtered
        Behind the low-pass.
    calibration
        Gives the correction under which the mass is evaluated.
    signals
        Gives the uncertainty of the zeros.
    shot, rig
        Tell which force hangs on which clock, and the areas.

    Returns
    -------
    tuple of BudgetRow
    """
    return (
        *clock_contributions(filtered, calibration, shot, "recoil_acceleration"),
        *zero_contributions(filtered, calibration, signals, rig),
        *repair_contributions(filtered, calibration, signals, rig),
    )


def note_on_cutoff(recorded: Regression, filtered: Regression, calibration: Calibration) -> str | None:
    """Say by how much other cut-offs would move the mass, where that is more than other noise would."""
    if filtered.low_pass is None:
        return None
    mass = corrected_mass(filtered, calibration)
    for other in other_cutoffs(filtered.low_pass, recorded.rate_hz):
        change = corrected_mass(recorded.filtered(other), calibration) / mass - 1.0
        if abs(change) > LARGEST_CUTOFF_EFFECT:
            return (
                f"a cut-off of {other.cutoff_hz:.0f} Hz would move the mass by {100 * change:+.2g} %, more than other "
                f"noise does ({100 * LARGEST_CUTOFF_EFFECT:.2g} %): look for what is left of the stress waves"
            )
    return None


def corrected_mass(regression: Regression, calibration: Calibration) -> float:
    """Mass by acceleration on force, with the sensors' errors as identified taken off, kg."""
    acceleration, force = calibration.correct(regression)
    rows = spaced_rows(regression)
    a, f = acceleration[rows], force[rows]
    return float(f @ f / (a @ f))


def clock_contributions(
    filtered: Regression, calibration: Calibration, shot: Shot, acceleration_role: str
) -> list[BudgetRow]:
    """Move all that hangs on a clock by the clock's uncertainty; the change of the mass is the contribution.

    The larger change of both directions counts: what has its pulse where the others have it loses mass,
    or gains it, either way.

    Parameters
    ----------
    acceleration_role
        Role of the channel that the acceleration comes from.
    """
    mass = corrected_mass(filtered, calibration)
    roles = (*PRESSURE_ROLES, acceleration_role)
    clocks = {role: c.time_base.clock for role in roles if (c := shot.by_role(role)) is not None}
    rows = []
    for clock in sorted(set(clocks.values())):
        u_s = shot.alignment(clock).u_offset_s
        if clock == shot.reference_clock or not math.isfinite(u_s):
            continue
        on_it = [clocks.get(role) == clock for role in roles]
        moved = [corrected_mass(_moved(filtered, on_it, shift_s), calibration) for shift_s in (u_s, -u_s)]
        rows.append(BudgetRow(f"alignment of clock {clock}", max(abs(m - mass) for m in moved), "B"))
    return rows


def _moved(regression: Regression, on_it: Sequence[bool], shift_s: float) -> Regression:
    """Make pressures' forces, and the acceleration as the last, late by a shift where they hang on a clock."""

    def late(column: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.interp(regression.times_s - shift_s, regression.times_s, column)

    forces = regression.forces_n.copy()
    for column in np.flatnonzero(on_it[:-1]):
        forces[:, column] = late(forces[:, column])
    acceleration = late(regression.acceleration_m_s2) if on_it[-1] else regression.acceleration_m_s2
    return replace(regression, forces_n=forces, acceleration_m_s2=acceleration)


def zero_contributions(filtered: Regression, calibration: Calibration, signals: Signals, rig: Rig) -> list[BudgetRow]:
    """Move every force by the uncertainty of its gauge's zero, from the noise of the pre-trigger baseline.

    A gauge whose zero is not known at all has no row: no number could be given.
    """
    mass = corrected_mass(filtered, calibration)
    rows = []
    for column, (role, area) in enumerate(zip(PRESSURE_ROLES, rig.mechanism.force_areas, strict=True)):
        u_pa = signals.offsets[role].u if role in signals.offsets else 0.0
        if not (math.isfinite(u_pa) and u_pa > 0):
            continue
        forces = filtered.forces_n.copy()
        forces[:, column] += u_pa * area * filtered.released
        change = abs(corrected_mass(replace(filtered, forces_n=forces), calibration) - mass)
        rows.append(BudgetRow(f"{role} zero", change, "A"))
    return rows


def repair_contributions(filtered: Regression, calibration: Calibration, signals: Signals, rig: Rig) -> list[BudgetRow]:
    """Add to a force, or to the acceleration, what a repair of its channel may have left wrong in it."""
    mass = corrected_mass(filtered, calibration)
    rows = []
    for (role, cause), left in signals.left.items():
        error = left * filtered.released
        if role in PRESSURE_ROLES:
            column = PRESSURE_ROLES.index(role)
            forces = filtered.forces_n.copy()
            forces[:, column] += error * rig.mechanism.force_areas[column]
            other = replace(filtered, forces_n=forces)
        elif role == "recoil_acceleration":
            other = replace(filtered, acceleration_m_s2=filtered.acceleration_m_s2 + error)
        else:
            continue
        rows.append(BudgetRow(f"{role} {cause}", abs(corrected_mass(other, calibration) - mass), "B"))
    return rows


def other_cutoffs(low_pass: LowPass, rate_hz: float) -> list[LowPass]:
    """Return the filters that might have been chosen instead, as far as the grid's rate allows them."""
    others = [LowPass(factor * low_pass.cutoff_hz, low_pass.half_order) for factor in CUTOFF_FACTORS]
    return [other for other in others if other.design_hz < 0.5 * rate_hz]
