"""The laws of recuperator and brake with all that they may be wrong by: random errors, scales, zeros, clocks.

A scale changes a law in a known way. A zero or a clock that is off by its standard uncertainty is put into the
data, and the law is fitted again; the change is its contribution (JCGM 100:2008, 5.1.3, note 2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.resistance.resistance_law import BrakeProfile, GasLaw, fit_brake_profile, fit_gas_law
from recoil_identification.targets.resistance.resistance_record import ResistanceRecord
from recoil_processing.gaps import bridge
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.gauge_zero import MOVES_S, zero_moves

SCALE_OF_TRAVEL = "scale of the travel"
"""Cause that moves the throttle in a known way, too."""


@dataclass(frozen=True, eq=False)
class FittedGas(ReadOnlyArrays):
    """Gas law of the recuperator.

    Attributes
    ----------
    errors : mapping of str to ndarray, shape (3,)
        Change of ln p0, ln L and n by cause, if it is off by its standard uncertainty.
    """

    law: GasLaw
    errors: Mapping[str, Array]

    @property
    def u(self) -> Array:
        """Standard uncertainties of ln p0, ln L and n, shape (3,)."""
        return np.sqrt(np.diag(self.law.covariance) + sum((e**2 for e in self.errors.values()), np.zeros(3)))


@dataclass(frozen=True, eq=False)
class FittedBrake(ReadOnlyArrays):
    """Throttle of the brake, at some travels.

    Attributes
    ----------
    travel_m : ndarray, shape (n,)
    logarithm, u_random : ndarray, shape (n,)
        Logarithm of c in N s2/m2.
    errors : mapping of str to ndarray, shape (n,)
        Change of ln c by cause.
    """

    profile: BrakeProfile
    travel_m: Array
    logarithm: Array
    u_random: Array
    errors: Mapping[str, Array]

    @property
    def coefficient(self) -> Array:
        """Return c, N s2/m2, shape (n,)."""
        return np.exp(self.logarithm)

    @property
    def u_logarithm(self) -> Array:
        """Standard uncertainty of ln c, shape (n,)."""
        return np.sqrt(self.u_random**2 + sum((e**2 for e in self.errors.values()), np.zeros(self.travel_m.size)))


def fit_gas(record: ResistanceRecord) -> FittedGas | str:
    """Fit the gas law of the recuperator; a sentence where the shot cannot tell it."""
    x, p = record.rows["travel"], record.rows["recuperator"]
    law = fit_gas_law(x, p)
    if isinstance(law, str):
        return law
    role = "recuperator_pressure"
    errors = {
        "sensitivity of the gauge": np.array([record.u_gauges[2], 0.0, 0.0]),
        SCALE_OF_TRAVEL: np.array([0.0, record.u_scale, 0.0]),
    }
    for cause, changed in _changed(record, role, p).items():
        other = fit_gas_law(x, changed)
        if isinstance(other, str):
            return f"with {cause} off by its standard uncertainty, {other}"
        errors[cause] = other.parameters - law.parameters
    return FittedGas(law, errors)


def fit_brake(record: ResistanceRecord, area_m2: float, travel_m: Array) -> FittedBrake | str:
    """Fit the throttle of the brake and evaluate it at some travels, (n,); a sentence where the shot cannot tell it."""
    x, square = record.rows["travel"], record.rows["square"]
    v = np.sqrt(np.maximum(square, 0.0)) * np.where(record.rows["velocity"] > 0, 1.0, -1.0)
    pressure, u_v = record.rows["brake"], record.rows["u_velocity"]
    noise = _scatter(area_m2 * pressure)

    def fitted(travel: Array, force: Array, weight: float | None = None) -> BrakeProfile | str:
        return fit_brake_profile(travel, v, force, u_force_n=noise, u_velocity_m_s=u_v, weight=weight)

    profile = fitted(x, area_m2 * pressure)
    if isinstance(profile, str):
        return profile
    logarithm, u = profile.logarithm(travel_m)
    everywhere = np.ones_like(travel_m)
    errors = {"sensitivity and area of the gauge": record.u_gauges[1] * everywhere}
    changed = {cause: (x, area_m2 * p) for cause, p in _changed(record, "brake_pressure", pressure).items()}
    changed[SCALE_OF_TRAVEL] = ((1.0 + record.u_scale) * x, area_m2 * pressure)
    for cause, (travel, force) in changed.items():
        other = fitted(travel, force, profile.weight)
        if isinstance(other, str):
            return f"with {cause} off by its standard uncertainty, {other}"
        # where the changed one has no rows the change is that of the nearest that has
        errors[cause] = bridge(other.logarithm(travel_m)[0] - logarithm, otherwise=0.0)
    # the velocity, which c is divided by twice, has the same scale
    errors[SCALE_OF_TRAVEL] = errors[SCALE_OF_TRAVEL] - 2.0 * record.u_scale
    return FittedBrake(profile, travel_m, logarithm, u, errors)


def _changed(record: ResistanceRecord, role: str, pressure_pa: Array) -> dict[str, Array]:
    """Return the rows of a pressure with each cause off by its standard uncertainty."""
    changed = {}
    if record.u_zero_pa[role] > 0:
        changed["zero of the gauge"] = pressure_pa + record.u_zero_pa[role]
    times = record.rows["time"]
    for tau_s, shape in zip(MOVES_S, zero_moves(times, float(record.times_s[0])).T, strict=True):
        if record.u_moving_pa[role] > 0:
            changed[f"zero of the gauge that moves in {1e3 * tau_s:g} ms"] = (
                pressure_pa + record.u_moving_pa[role] * shape
            )
    if record.u_clock_s[role] > 0:
        slope = np.gradient(pressure_pa, times)
        changed["clock of the gauge"] = pressure_pa + record.u_clock_s[role] * slope
    for source, left in record.left_pa.items():
        if source.of == role:
            changed[source.detail] = pressure_pa + np.interp(times, record.times_s, left)
    return changed


def _scatter(force_n: Array) -> float:
    """Random error of a row by its third differences; the law itself bends little over four rows."""
    return max(noise_sigma(force_n), 1e-6 * float(np.max(np.abs(force_n))))
