"""The propellant's force by regularised inversion of what the accelerometer and the camera show of it.

The force is a cubic spline that is zero until the release, the smoothest in the sense of its second derivative that
explains the rows (see `recoil_identification.targets.forces.regularised_inversion` beside this): the accelerometer
shows the force itself, the camera its double integral. Cross-validation needs rows with independent errors, but what
rings is the most regular error of all. So the accelerometer's rows are whitened by the covariance of noise and stress
waves together, which `recoil_identification.targets.forces.input_estimate` has found; how smooth the force is, is
decided here anew and by another principle.

A force that rises in two milliseconds and falls in twenty is not equally smooth throughout. A first, stiff solution
tells where it bends, and the second one is allowed to bend there in proportion (F. Abramovich, D. M. Steinberg,
J. Stat. Plan. Inference 49(3), 1996).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.forces.measured_force import MeasuredForce, TrackedTravel
from recoil_identification.targets.forces.regularised_inversion import Inversion, invert
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.gaps import bridge

KNOT_S = 4e-4
"""Between the spline's knots: a sixth of the rise to the peak."""
LOCAL_KNOTS = 2
"""Number of knots on both sides over which the bend of the first guess is taken."""
LEAST_BEND = 0.005
"""Share of the largest bend that is expected everywhere."""
BEFORE_S = 1e-3
"""Time before the release, s, from which on rows are taken."""
LEAST_ROWS = 30


@dataclass(frozen=True, eq=False)
class InvertedForce(ReadOnlyArrays):
    """The force by regularised inversion.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    force_n, u_force_n : ndarray, shape (n,)
        Force and its standard uncertainty from the release on; NaN before. It holds noises, and the errors of
        accelerometer and camera.
    impulse_n_s, u_impulse_n_s
        Impulse and its standard uncertainty from the release to the last instant.
    """

    times_s: Array
    force_n: Array
    u_force_n: Array
    impulse_n_s: float
    u_impulse_n_s: float
    inversion: Inversion

    @property
    def peak(self) -> tuple[float, float, float]:
        """Largest force, its standard uncertainty, and when."""
        i = int(np.nanargmax(self.force_n))
        return float(self.force_n[i]), float(self.u_force_n[i]), float(self.times_s[i])


def invert_force(
    measured: MeasuredForce,
    tracked: TrackedTravel | None,
    *,
    error_covariance_n2: Array,
    factor: int,
    onset_s: float,
    held_n: float,
    times_s: Array,
) -> InvertedForce:
    """Estimate the force that moved the part.

    Parameters
    ----------
    measured
        Measured force from rest on.
    error_covariance_n2 : ndarray, shape (n_thin, n_thin)
        Covariance of the accelerometer's errors, noise and stress waves, at the instants of the thinned record.
    factor
        Factor by which it was thinned.
    onset_s
        The release.
    held_n
        Force of the battery stop at rest.
    times_s : ndarray, shape (n,)
        Instants at which the force is wanted.

    Raises
    ------
    ValueError
        If there are too few rows behind the release.
    """
    from scipy.interpolate import BSpline
    from scipy.linalg import cholesky, solve_triangular

    thin = measured.thinned(factor)
    grid, step, m = thin.times_s, thin.step_s, thin.mass_kg
    end = float(grid[-1])
    inner = np.linspace(onset_s, end, max(5, round((end - onset_s) / KNOT_S) + 1))
    knots = np.concatenate([[onset_s] * 3, inner, [end] * 3])
    count = knots.size - 4

    def basis(at: Array) -> Array:
        """Values of the splines but the first, which is not zero at the release; zero before it."""
        values = np.zeros((at.size, count))
        inside = (at >= onset_s) & (at <= end)
        values[inside] = BSpline.design_matrix(at[inside], knots, 3).toarray()
        return values[:, 1:]

    scale = float(np.nanmax(np.abs(thin.force_n)))
    shapes = basis(grid)
    errors = np.column_stack([thin.acceleration_m_s2, np.ones_like(grid)]) * m / scale
    errors[grid < onset_s] = 0.0
    columns = np.column_stack([shapes, errors])
    seen = (bridge(thin.force_n) - held_n) / scale
    at = np.flatnonzero(np.isfinite(thin.force_n) & (grid >= onset_s - BEFORE_S))
    if at.size < LEAST_ROWS:
        raise ValueError(f"at least {LEAST_ROWS} rows behind the release are needed, found {at.size}")
    extra = 0 if tracked is None else 2
    unknowns = count - 1 + 2 + extra
    known = np.full(unknowns, np.inf)
    known[count - 1 : count + 1] = max(thin.u_gain, 1e-9), max(thin.u_zero_m_s2, 1e-9)
    frames, positions = np.zeros((0, unknowns)), np.zeros(0)
    if tracked is not None:
        frames, positions = _frames(thin, tracked, shapes, held_n, scale)
        known[-1] = max(tracked.u_scale, 1e-9)
    # the second derivative at the knots' middles
    middles = 0.5 * (inner[1:] + inner[:-1])
    penalty = np.zeros((middles.size, unknowns))
    for j in range(count - 1):
        one = np.zeros(count)
        one[j + 1] = 1.0
        penalty[:, j] = BSpline(knots, one, 3).derivative(2)(middles) * KNOT_S**2
    root = cholesky(error_covariance_n2[np.ix_(at, at)] / scale**2, lower=True)
    rows = np.zeros((at.size, unknowns))
    rows[:, : count + 1] = solve_triangular(root, columns[at], lower=True)
    data = solve_triangular(root, seen[at], lower=True)
    rows, data = np.vstack([rows, frames]), np.concatenate([data, positions])
    first = invert(rows, data, penalty, fixed=known, stiff=True)
    expected = _local_bend(penalty @ first.solution)
    found = invert(rows, data, penalty / expected[:, np.newaxis], fixed=known)
    wanted = basis(times_s)
    coefficients, own_covariance = found.solution[: count - 1], found.covariance[: count - 1, : count - 1]
    force = np.where(times_s >= onset_s, held_n + scale * wanted @ coefficients, np.nan)
    variance = np.maximum(np.einsum("ij,jk,ik->i", wanted, own_covariance, wanted), 0.0)
    # the stiff solution is the other end of what cross-validation would have allowed: a rectangular distribution
    stiffer = wanted @ (first.solution[: count - 1] - coefficients)
    u = scale * np.sqrt(variance + stiffer**2 / 12.0)
    whole = shapes.sum(axis=0) * step
    behind = times_s[times_s >= onset_s]
    duration = float(behind[-1] - onset_s) if behind.size else 0.0
    return InvertedForce(
        times_s,
        force,
        np.where(times_s >= onset_s, u, np.nan),
        held_n * duration + scale * float(whole @ coefficients),
        scale * math.sqrt(max(float(whole @ own_covariance @ whole), 0.0)),
        found,
    )


def _local_bend(bend: Array) -> Array:
    """Return how much bend is expected around each place, over the largest, shape (n,)."""
    window = np.ones(2 * LOCAL_KNOTS + 1) / (2 * LOCAL_KNOTS + 1)
    local = np.sqrt(np.convolve(np.pad(bend**2, LOCAL_KNOTS, mode="edge"), window, mode="valid"))
    largest = float(local.max())
    return np.maximum(local / largest, LEAST_BEND) if largest > 0 else np.ones_like(local)


def _frames(
    measured: MeasuredForce, tracked: TrackedTravel, shapes: Array, held_n: float, scale_n: float
) -> tuple[Array, Array]:
    """Rows and data of the camera, over its noise: the shapes, two of the accelerometer that it lacks, zero, scale."""
    m, step, start = measured.mass_kg, measured.step_s, measured.start_s

    def travel(acceleration: Array, at_s: Array) -> Array:
        return DoubleIntegral.of(acceleration, start, step).at(at_s)[0]

    inside = (tracked.times_s >= start) & (tracked.times_s <= measured.times_s[-1])
    t, z = tracked.times_s[inside], tracked.positions_m[inside]
    known = travel((held_n - measured.resistance_n) / m - measured.carried_m_s2, t)
    columns = [travel(np.ascontiguousarray(shape) * scale_n / m, t) for shape in shapes.T]
    rest = [np.zeros_like(t), np.zeros_like(t), np.ones_like(t), z - float(np.median(z[:5]))]
    return np.column_stack([*columns, *rest]) / tracked.sigma_m, (z - known) / tracked.sigma_m
