"""The projectile in the bore, by the breech force: its travel, its exit, and what a muzzle brake then does.

Plain arrays on a uniform grid, SI units. Its travel is the integral of the integral of ``P / m_p``: what engraving and
drag take off, and that the gas moves with it, changes the exit by a few parts in a hundred of a millisecond or two.
"""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_rigs.mechanism.mechanism_parameters import Mechanism

RISE_S = 3e-4
"""Time constant with which a muzzle brake's force comes up behind the projectile."""


def projectile_travel_m(breech_force_n: Array, step_s: float, mass_kg: float) -> Array:
    """Return how far the breech force has driven a projectile; shape (n,) to (n,).

    Parameters
    ----------
    breech_force_n : ndarray, shape (n,)
        Breech force; lost samples, NaN, are bridged, and what pulls does nothing.
    """
    driving = np.maximum(bridge(breech_force_n, otherwise=0.0), 0.0)
    return integrate(integrate(driving, step_s), step_s) / mass_kg


def risen_behind(times_s: Array, exit_s: float) -> Array:
    """Return how far a muzzle brake's force has come up at instants, 0 to 1, shape (n,); none before the exit."""
    return np.asarray(-np.expm1(-np.maximum(times_s - exit_s, 0.0) / RISE_S))


def muzzle_force_n(breech_force_n: Array, step_s: float, mechanism: Mechanism) -> Array:
    """Return the breech force behind the exit, which a muzzle brake's share is of; shape (n,) to (n,).

    Zero where the mechanism states no projectile or no bore, or the projectile does not leave.
    """
    if not (mechanism.projectile_mass and mechanism.bore_length):
        return np.zeros_like(breech_force_n)
    travel_m = projectile_travel_m(breech_force_n, step_s, mechanism.projectile_mass)
    out = travel_m >= mechanism.bore_length
    if not out.any():
        return np.zeros_like(breech_force_n)
    at = int(np.argmax(out))
    before_m, behind_m = travel_m[at - 1], travel_m[at]
    part = (mechanism.bore_length - before_m) / (behind_m - before_m)
    times_s = step_s * np.arange(breech_force_n.size, dtype=np.float64)
    return np.asarray(breech_force_n * risen_behind(times_s, float(times_s[at - 1] + part * step_s)))


def breech_force_on_body_n(pressure_pa: Array, step_s: float, mechanism: Mechanism) -> Array:
    """Return the breech's force on the recoiling part from its gauge, what a muzzle brake takes off it; shape (n,)."""
    force_n = mechanism.force_areas[0] * pressure_pa
    if not mechanism.muzzle_brake:
        return force_n
    return force_n - mechanism.muzzle_brake * muzzle_force_n(force_n, step_s, mechanism)
