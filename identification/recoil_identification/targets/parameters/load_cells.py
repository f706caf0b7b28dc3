"""The loads that act on the mechanism beside the gauges': what load cells measured, and what none did."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_identification.shot.preparation import Prepared
from recoil_processing.shot.channel_repair import mend_samples
from recoil_processing.shot.signals import at_instants, on_grid
from recoil_rigs.mechanism.mechanism_regressor import EQUATIONS, LOADS, Geometry, load_directions
from recoil_rigs.shots.fired_shot import FiredShot

LOAD_CELLS = MappingProxyType(
    {
        "elevating": "elevating_moment",
        "ground_x": "ground_force_x",
        "ground_y": "ground_force_y",
        "ground_d": "ground_force_d",
        "ground_friction": "ground_friction_d",
    }
)
"""Load of the model -> role of the load cell that measures it, in the opposite sign."""


def measured_loads(fired: FiredShot, prepared: Prepared) -> dict[str, Array]:
    """Bring the load cells on the grid, in the model's signs.

    Parameters
    ----------
    prepared
        Prepared signals, which give the grid and the alignments.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Loads by the names of `LOAD_CELLS`, N or N m; lost samples NaN. A cell whose clock could not be aligned, or none
        of whose samples can be used, is left out.
    """
    found = {}
    for load, role in LOAD_CELLS.items():
        channel = fired.shot.by_role(role)
        if channel is None:
            continue
        clock = channel.time_base.clock
        alignment = prepared.alignments.get(clock)
        if clock != fired.shot.reference_clock and (alignment is None or alignment.status == "failed"):
            continue
        spec = fired.rig.channel(channel.name)
        mended = mend_samples(channel, spec, fired.rig.source(spec.source).kind)
        dated = replace(at_instants(channel, fired), samples=mended.samples)
        series = -on_grid(dated, alignment, prepared.signals.times_s)
        if np.isfinite(series).any():
            found[load] = series
    return found


def eliminate(directions: Array, measured: Flags) -> tuple[Array, Flags]:
    """Combine the equations of motion so that loads that nothing measures cancel.

    Each such load is taken out by the equation that it enters most strongly, which is lost with it.

    Parameters
    ----------
    directions : ndarray, shape (n, 5, n_loads)
        Effect of a unit of each load in each equation; moments in units of a length, so that they compare.
    measured : ndarray of bool, shape (n_loads,)

    Returns
    -------
    combine : ndarray, shape (n, 5, 5)
        Matrix from the equations to their combinations, in each of which the equation of the same number has factor 1.
    usable : ndarray of bool, shape (5,)
        Combinations without a load that is not measured.
    """
    n = directions.shape[0]
    combine = np.broadcast_to(np.eye(5), (n, 5, 5)).copy()
    left = directions.copy()
    usable = np.ones(5, dtype=bool)
    for load in np.flatnonzero(~measured):
        strength = np.where(usable, np.abs(left[0, :, load]), 0.0)
        pivot = int(np.argmax(strength))
        if not strength[pivot] > 1e-9:
            continue
        usable[pivot] = False
        for row in np.flatnonzero(usable):
            factor = left[:, row, load] / left[:, pivot, load]
            left[:, row] -= factor[:, np.newaxis] * left[:, pivot]
            combine[:, row] -= factor[:, np.newaxis] * combine[:, pivot]
    return combine, usable


def usable_equations(geometry: Geometry, alpha: Array, beta: Array, measured: Flags) -> tuple[Array, tuple[int, ...]]:
    """Return `eliminate` for the mechanism, and the numbers of the usable combinations.

    Parameters
    ----------
    alpha, beta : ndarray, shape (n,)
        Rotations since battery, rad.
    measured : ndarray of bool, shape (7,)
        Whether each load is measured, in the order of `recoil_rigs.mechanism.mechanism_regressor.LOADS`.

    Returns
    -------
    combine : ndarray, shape (n, 5, 5)
        Matrix from the equations to their combinations, for N and N m.
    usable : tuple of int
    """
    length = float(np.hypot(geometry.XA, geometry.YA))
    units = np.array([1.0, 1.0, length, length, 1.0])
    combine, usable = eliminate(load_directions(geometry, alpha, beta) / units[:, np.newaxis], measured)
    return units[:, np.newaxis] * combine / units, tuple(int(i) for i in np.flatnonzero(usable))


def lost_equations(usable: tuple[int, ...], measured: Flags) -> str:
    """Say which equations of motion are lost, and for want of what; empty if none is."""
    lost = [EQUATIONS[i] for i in range(len(EQUATIONS)) if i not in usable]
    if not lost:
        return ""
    missing = [LOAD_CELLS[name] for name, there in zip(LOADS, measured, strict=True) if not there]
    return (
        f"no load cell of role {', '.join(missing)}: what the unmeasured loads do cannot be told from inertia, so the "
        f"equations {', '.join(lost)} say nothing of the masses"
    )
