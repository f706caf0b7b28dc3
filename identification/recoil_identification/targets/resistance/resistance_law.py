"""The law of the recoil resistance: gas of the recuperator over travel, throttle of the brake over travel.

::

    F_gas   = A p0 (L / (L - x))^n          a polytropic change of state in the volume V0 = A L
    F_brake = c(x) v^2                      turbulent flow through an orifice that narrows along the stroke

The gas law is fitted to the pressure by Gauss and Newton's iteration. ln c is a cubic spline in x, as smooth as
generalised cross-validation has it (`recoil_identification.targets.forces.regularised_inversion`):
``c = A rho / 2 (A / (C_d a(x)))^2`` is positive whatever the orifice a(x) is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.mass import correlation_factor
from recoil_identification.targets.forces.regularised_inversion import invert

MOST_ITERATIONS = 60
LEAST_COMPRESSION = 0.05
"""Compression of the gas column without which its exponent and its length are not to be told apart."""
KNOTS = 24
"""Knots of the throttle's profile, over the travel."""
LEAST_ROWS = 15
LEAST_SIGNAL = 8.0
"""Brake force over its noise, from which on its logarithm is worth a row."""


@dataclass(frozen=True, eq=False)
class GasLaw(ReadOnlyArrays):
    """A polytropic gas law.

    Attributes
    ----------
    pressure_pa
        p0, in battery.
    length_m
        L, volume over piston area.
    exponent
        n.
    covariance : ndarray, shape (3, 3)
        Covariance of ln p0, ln L and n, from the residuals with their autocorrelation.
    """

    pressure_pa: float
    length_m: float
    exponent: float
    covariance: Array

    @property
    def parameters(self) -> Array:
        """Ln p0, ln L and n, shape (3,)."""
        return np.array([math.log(self.pressure_pa), math.log(self.length_m), self.exponent])

    def pressure(self, travel_m: Array) -> Array:
        """Return the pressure at a travel, Pa, shape (n,)."""
        return np.asarray(self.pressure_pa * (1.0 - travel_m / self.length_m) ** -self.exponent)


def fit_gas_law(travel_m: Array, pressure_pa: Array) -> GasLaw | str:
    """Fit a polytropic gas law to pressure over travel.

    Parameters
    ----------
    travel_m, pressure_pa : ndarray, shape (n,)
        Travel and pressure in order of time, finite.

    Returns
    -------
    GasLaw or str
        A sentence where the rows cannot tell it.

    Raises
    ------
    ValueError
        If the shapes differ or something is not finite.
    """
    x, p = _checked(travel_m, pressure_pa)
    if x.size < LEAST_ROWS:
        return f"{x.size} rows of the recuperator's pressure are too few for a law of three parameters"
    if not np.all(p > 0):
        return "the recuperator's pressure is not positive throughout"
    if not float(np.ptp(np.log(p))) > LEAST_COMPRESSION:
        return (
            f"the recuperator's pressure changes by {100 * np.ptp(np.log(p)):.1f} % only: no law is to be told from it"
        )
    reach = float(x.max())
    # begin with n = 1.3 and the length that gives the ratio of the pressures
    ratio = float(np.exp(-np.ptp(np.log(p)) / 1.3))
    theta = np.array([math.log(float(p[np.argmin(x)])), math.log(reach / (1.0 - ratio)), 1.3])
    damping, misfit = 1e-3, math.inf
    design, residual = _gas_rows(theta, x, p)
    misfit = float(residual @ residual)
    for _ in range(MOST_ITERATIONS):
        normal = design.T @ design
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), design.T @ residual)
        tried = theta + step
        if math.exp(min(tried[1], 50.0)) > 1.001 * reach and abs(float(tried[2])) < 50:
            moved, left = _gas_rows(tried, x, p)
            if float(left @ left) <= misfit:
                settled = misfit - float(left @ left) <= 1e-12 * misfit
                theta, design, residual, misfit = tried, moved, left, float(left @ left)
                damping = max(0.1 * damping, 1e-12)
                if settled:
                    break
                continue
        damping *= 10.0
        if damping > 1e12:
            break
    deviation = math.sqrt(misfit / (x.size - 3))
    scale = np.linalg.norm(design, axis=0)
    inverse = np.linalg.pinv(design / scale) / scale[:, None]
    covariance = (deviation * correlation_factor(residual)) ** 2 * inverse @ inverse.T
    return GasLaw(math.exp(theta[0]), math.exp(theta[1]), float(theta[2]), covariance)


def _gas_rows(theta: Array, x: Array, p: Array) -> tuple[Array, Array]:
    """Return the derivatives of the pressure by ln p0, ln L and n, and the residual."""
    length = math.exp(theta[1])
    opening = 1.0 - x / length
    model = np.exp(theta[0]) * opening ** -theta[2]
    design = np.column_stack([model, -theta[2] * model * (x / length) / opening, -model * np.log(opening)])
    return design, p - model


@dataclass(frozen=True, eq=False)
class BrakeProfile(ReadOnlyArrays):
    """The throttle of the brake along the travel.

    Attributes
    ----------
    knots : ndarray, shape (n_coefficients + 4,)
        Knots of the cubic spline ln c.
    coefficients : ndarray, shape (n_coefficients,)
    covariance : ndarray, shape (n_coefficients, n_coefficients)
        Random errors.
    weight
        Weight of the smoothness.
    variance
        Variance of the rows by the residuals; 1 if their errors are as supposed.
    reach_m
        Travel between which there are rows.
    """

    knots: Array
    coefficients: Array
    covariance: Array
    weight: float
    variance: float
    reach_m: tuple[float, float]

    def logarithm(self, travel_m: Array) -> tuple[Array, Array]:
        """Return ln c and its standard uncertainty at a travel, shape (n,) each; NaN where there are no rows."""
        from scipy.interpolate import BSpline

        low, high = self.reach_m
        inside = (travel_m >= low) & (travel_m <= high)
        value, u = np.full(travel_m.shape, np.nan), np.full(travel_m.shape, np.nan)
        if not inside.any():
            return value, u
        basis = BSpline.design_matrix(travel_m[inside], self.knots, 3).toarray()
        value[inside] = basis @ self.coefficients
        u[inside] = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, self.covariance, basis), 0.0))
        return value, u

    def force(self, travel_m: Array, velocity_m_s: Array) -> Array:
        """Return the brake's force in recoil, N, shape (n,); NaN where there are no rows."""
        return np.asarray(np.exp(self.logarithm(travel_m)[0]) * velocity_m_s**2)


def fit_brake_profile(
    travel_m: Array,
    velocity_m_s: Array,
    force_n: Array,
    *,
    u_force_n: float,
    u_velocity_m_s: Array,
    weight: float | None = None,
) -> BrakeProfile | str:
    """Fit the throttle's profile to the force of the brake in recoil.

    Parameters
    ----------
    travel_m, velocity_m_s, force_n : ndarray, shape (n,)
        Travel, velocity and force in order of time, finite; rows with independent errors.
    u_force_n
        Random error of a force.
    u_velocity_m_s : ndarray, shape (n,)
    weight
        Weight of the smoothness; by cross-validation if left out.

    Returns
    -------
    BrakeProfile or str
        A sentence where the rows cannot tell it.

    Raises
    ------
    ValueError
        If the shapes differ, or something is not finite.
    """
    from scipy.interpolate import BSpline

    x, v, f, u_v = _checked(travel_m, velocity_m_s, force_n, u_velocity_m_s)
    used = (v > 0) & (f > LEAST_SIGNAL * u_force_n) & (v > LEAST_SIGNAL * u_v) & (x > 0)
    x, v, f, u_v = x[used], v[used], f[used], u_v[used]
    if x.size < LEAST_ROWS:
        return f"{x.size} rows with a force of the brake above its noise are too few for its throttle"
    low, high = float(x.min()), float(x.max())
    inner = np.linspace(low, high, min(KNOTS, x.size // 2))
    knots = np.concatenate([[low] * 3, inner, [high] * 3])
    rows = BSpline.design_matrix(x, knots, 3).toarray()
    u = np.hypot(u_force_n / f, 2.0 * u_v / v)
    middles = 0.5 * (inner[1:] + inner[:-1])
    bends = [BSpline(knots, one, 3).derivative(2)(middles) for one in np.eye(knots.size - 4)]
    found = invert(
        rows / u[:, None], np.log(f / v**2) / u, (inner[1] - inner[0]) ** 2 * np.column_stack(bends), weight=weight
    )
    # residuals that go on alike tell less than their number
    widened = correlation_factor(found.residual) ** 2
    return BrakeProfile(knots, found.solution, widened * found.covariance, found.weight, found.variance, (low, high))


def block_means(columns: Array, block: int) -> Array:
    """Return the means of blocks of rows, shape (n // block, n_columns); a block with a lost sample is NaN.

    Raises
    ------
    ValueError
        If the block is not positive.
    """
    if block < 1:
        raise ValueError(f"a block must hold at least one row, not {block}")
    count = columns.shape[0] // block
    return np.asarray(columns[: count * block].reshape(count, block, columns.shape[1]).mean(axis=1))


def _checked(*columns: Array) -> tuple[Array, ...]:
    arrays = tuple(np.asarray(c, dtype=np.float64) for c in columns)
    if len({a.shape for a in arrays}) != 1 or arrays[0].ndim != 1:
        raise ValueError(f"columns of one length are needed, not {[a.shape for a in arrays]}")
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise ValueError("columns must be finite")
    return arrays
