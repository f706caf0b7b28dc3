"""Inertia forces of the recoiling part and of all that hangs on the trunnion, from the motion; with their bands.

The inertia force of a body is minus its mass times its centre's acceleration (d'Alembert). Of the bodies that
hang on the trunnion A, the forces and the moment about A are minus the first, second and fourth row of the
equations of motion without gravity and without the carriage (`recoil_rigs.mechanism.mechanism_regressor`). Along the
bore, the inertia force and the weight's component together are ``-m3 a'`` of equation (36), which the gauges' net force
``P - R_f`` balances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.parameters.mechanism_fit import MechanismFit
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_rigs.mechanism.mechanism_regressor import PARAMETERS, Geometry, regressor, standard_parameters
from recoil_rigs.mechanism.model import Mechanism

FORCES = (
    "bore", "bore_inertia", "transverse", "recoiling_x", "recoiling_y", "recoiling_moment", "mechanism_x",
    "mechanism_y", "mechanism_moment",
)  # fmt: skip
"""Order of what is computed: along the bore, rearward, with and without the weight's component; across it, upward;
at the trunnion forward, upward and the moment that raises the muzzle, of the recoiling part, and of both parts."""
MOMENTS = ("recoiling_moment", "mechanism_moment")
"""Names of those that are moments."""
UNITS = tuple("N m" if name in MOMENTS else "N" for name in FORCES)
"""Unit of each."""
_RECOILING = slice(8, 12)
_TIPPING = slice(4, 12)
_MOMENT = 3
OWN = ("m2", "s2", "d2", "J2", "J3c", "b", "d")
"""Symbols of the mechanism that are taken as declared."""


def inertia_forces(geometry: Geometry, theta: Array, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Return the inertia forces of a motion.

    Parameters
    ----------
    theta : ndarray, shape (12,)
        Standard parameters in the order of `recoil_rigs.mechanism.mechanism_regressor.PARAMETERS`; those of the
        carriage are not used.
    q, qd, qdd : array_like, shape (n, 5)

    Returns
    -------
    ndarray, shape (n, 9)
        Forces in the order of `FORCES`, in `UNITS`; NaN where theta is NaN.
    """
    state = np.asarray(q, dtype=np.float64)
    weighing = regressor(geometry, q, qd, qdd)
    free = regressor(replace(geometry, g=0.0), q, qd, qdd)
    recoiling, mechanism = (-free[:, :, part] @ theta[part] for part in (_RECOILING, _TIPPING))
    # the resultant across the bore is that at the trunnion, turned
    phi2 = geometry.phi20 + state[:, 2] + state[:, 3]
    return np.column_stack(
        [
            -weighing[:, 4, _RECOILING] @ theta[_RECOILING],
            recoiling[:, 4],
            np.cos(phi2) * recoiling[:, 1] - np.sin(phi2) * recoiling[:, 0],
            *(recoiling[:, (0, 1, _MOMENT)].T),
            *(mechanism[:, (0, 1, _MOMENT)].T),
        ]
    )


def with_mass(mechanism: Mechanism, m3: float) -> Array:
    """Return the standard parameters with another recoiling mass; its centre and its own inertia stay."""
    return standard_parameters(replace(mechanism, m3=m3))


def mass_alone(mechanism: Mechanism) -> tuple[tuple[int, ...], Array]:
    """Return the leading parameter and its shares of all, shape (1, 12), where only m3 is not known.

    Its moments are those of a centre of mass at the declared place.
    """
    shares = np.zeros((1, len(PARAMETERS)))
    shares[0, 8:11] = 1.0, mechanism.b, mechanism.d
    return (8,), shares


@dataclass(frozen=True, eq=False)
class InertiaForces(ReadOnlyArrays):
    """Inertia forces over time, with standard uncertainties.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    values, u : ndarray, shape (n, 9)
        Forces in the order of `FORCES`; u is what all errors together leave.
    sources : mapping of str to ndarray, shape (n, 9)
        Change by one standard uncertainty of every independent source; the fit's, which are correlated, together.
    """

    times_s: Array
    values: Array
    u: Array
    sources: Mapping[str, Array]


def forces_with_bands(
    rows: MechanismRows, narrower: MechanismRows, fit: MechanismFit, mechanism: Mechanism
) -> InertiaForces:
    """Evaluate the inertia forces of a shot, and what every error leaves in them.

    The mass and the sensors' errors are those of one fit, and so is their covariance: an accelerometer that
    reads high makes the mass low, and their product is better known than either.

    Parameters
    ----------
    narrower
        The same rows behind cut-offs of 0.7 times theirs. What a filter takes off a peak goes with the square of
        its period, so that the change is about what the wider filter has taken off; it also holds what that one
        has left of stress waves. It is a standard uncertainty.
    fit
        Fit with m3 as its only parameter.
    mechanism
        Mechanism, which gives the parameters of the tipping part and the recoiling part's centre and inertia, with
        their ``u``.
    """
    mass = float(fit.values[0])

    def forces(errors: Array, m3: float, own: Mechanism, columns: Mapping[str, Array] | None = None) -> Array:
        moved = (rows if columns is None else replace(rows, columns={**rows.columns, **columns})).corrected(errors)
        return inertia_forces(moved.geometry, with_mass(own, m3), *moved.state())

    values = forces(fit.errors, mass, mechanism)
    # by the fit: along steps that are independent
    sources = {}
    together = np.zeros(values.shape)
    for step in np.linalg.cholesky(fit.inferred.covariance).T:
        together += (forces(fit.errors + step[:-1], mass + float(step[-1]), mechanism) - values) ** 2
    sources["mass and sensors, by the fit"] = np.sqrt(together)
    for name in OWN:
        if mechanism.u.get(name, 0.0) > 0:
            other = replace(mechanism, **{name: getattr(mechanism, name) + mechanism.u[name]})
            sources[name] = forces(fit.errors, mass, other) - values
    noise = np.zeros(values.shape)
    for name, deviation in rows.noise.items():
        noise += (forces(fit.errors, mass, mechanism, {name: rows.columns[name] + deviation}) - values) ** 2
    sources["noise of the sensors"] = np.sqrt(noise)
    other_filter = inertia_forces(
        narrower.geometry, with_mass(mechanism, mass), *narrower.corrected(fit.errors).state()
    )
    sources["low-pass"] = other_filter - values
    u = np.sqrt(sum((change**2 for change in sources.values()), np.zeros(values.shape)))
    return InertiaForces(rows.times_s, values, u, sources)


@dataclass(frozen=True)
class Peak:
    """The largest value by magnitude of one force."""

    time_s: float
    value: float
    u: float


def peak(times_s: Array, values: Array, u: Array) -> Peak | None:
    """Return the largest value by magnitude; None if there is none.

    The largest of several noisy values is too large on average: the apex of a parabola through five of them is
    less so.

    Parameters
    ----------
    times_s, values, u : ndarray, shape (n,)
        NaN where there is no value.
    """
    if not np.isfinite(values).any():
        return None
    i = int(np.nanargmax(np.abs(values)))
    own = float(values[i])
    window = values[max(i - 2, 0) : i + 3]
    if window.size == 5 and np.isfinite(window).all():
        bend, slope, middle = (float(v) for v in np.polyfit(np.arange(-2.0, 3.0), window, 2))
        if bend * own < 0 and abs(slope) < 2 * abs(bend):
            own = middle - slope**2 / (4 * bend)
    return Peak(float(times_s[i]), own, float(u[i]))
