"""The mass by force, accelerometer and camera together, with a zero that shifts and a skew among the unknowns.

State of a Kalman smoother: travel, velocity, 1/m, the shift b of the accelerometer's zero at the release, by how much s
the force's record is later than the motion's, the camera's rest position and clock, and the errors g and c of the
accelerometer's and the camera's scale. 1/m to the last are constants and the model is nearly linear in them, so that
the iterated smoother is Gauss and Newton's iteration (B. M. Bell, SIAM J. Optim. 4(3), 1994): travel and velocity are
filtered out of every column of the linearised model (`alignment.velocity_walk`), the constants follow by
least squares, and the smoothed walk makes up travel and velocity.

Force and accelerometer both tell the true acceleration, and which of them drives the filter matters: what is best is
their mean, weighted by their noise at low frequency, because its error and that of their difference are
uncorrelated. So there are two kinds of independent rows:

    a - (1 + g) F(t + s)/m - b,          errors autoregressive (`recoil_identification.estimators.prewhitening`)
    x - (1 + c) double integral of [(1 - w) F(t + s)/m + w (a - b)/(1 + g)] - ...,   errors the marker's noise, a walk

with w the force's share of both variances. Noise levels are those that make each kind of row likeliest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.estimators.joint_model import (
    GAIN,
    MASS,
    SCALE,
    SHIFT,
    SKEW,
    UNKNOWNS,
    ZERO,
    JointModel,
    JointSolution,
)
from recoil_identification.estimators.joint_recoil import Knowledge, NoiseLevels, Recoil
from recoil_identification.estimators.prewhitening import prewhitened_mass
from recoil_processing.motion.walk_smoother import WalkSmoother
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.clocks.autoregressive_noise import MOST_ORDER, fit_noise
from recoil_processing.shot.clocks.double_impulse import LEAST_MARKER_M

Array = NDArray[np.float64]

MOST_ITERATIONS = 12
SETTLED = 1e-3
"""Share of its standard uncertainty by which the mass moves no more."""
NEGLIGIBLE = 1e-9
"""Share of the mass that counts as its uncertainty where a record has no noise."""
LONGEST_STEP_S = 5e-4
"""By which the skew moves at once: linear in it is the model over a part of the pulse's rise only."""


@dataclass(frozen=True, eq=False)
class JointMass(ReadOnlyArrays):
    """Mass by all three.

    Attributes
    ----------
    mass_kg, u_kg
        And its standard uncertainty by the random errors, those of the other unknowns among them.
    u_zero_kg, u_skew_kg, u_shift_kg, u_gain_kg, u_scale_kg
        By what was known beforehand of the zero, the skew, the camera's offset and the two scales.
    zero_m_s2, u_zero_m_s2
        b.
    skew_s, u_skew_s
        s: by how much the force's record is later than the motion's.
    shift_s
        What is added to the camera's times.
    gain_error, scale_error
        g and c.
    force_errors, force_sensitivities_kg : ndarray, shape (n_errors,)
        Of the force as found, and by how much the mass is too large if one of them is off by its u beforehand.
    frame_times_s, travel_m, velocity_m_s : ndarray, shape (n,)
        Smoothed, at the frames of the motion; the travel in the camera's scale and from its origin, the velocity true.
    residual_m : ndarray, shape (n,)
        Camera less travel.
    sensitivities_kg : ndarray, shape (n_perturbations,)
        By how much the mass is too large if the force is by one of the perturbations.
    """

    mass_kg: float
    u_kg: float
    u_zero_kg: float
    u_skew_kg: float
    u_shift_kg: float
    u_gain_kg: float
    u_scale_kg: float
    zero_m_s2: float
    u_zero_m_s2: float
    skew_s: float
    u_skew_s: float
    shift_s: float
    gain_error: float
    scale_error: float
    force_errors: Array
    force_sensitivities_kg: Array
    levels: NoiseLevels
    frame_times_s: Array
    travel_m: Array
    velocity_m_s: Array
    residual_m: Array
    sensitivities_kg: Array
    frames: int
    set_aside: int
    rows: int
    iterations: int
    settled: bool


def joint_mass(
    recoil: Recoil,
    known: Knowledge,
    *,
    levels: NoiseLevels | None = None,
    force_errors_n: Array | None = None,
    u_force_errors: Array | None = None,
    perturbations_n: Array | None = None,
    most_order: int = MOST_ORDER,
) -> JointMass:
    """Estimate the mass by force, accelerometer and camera.

    Parameters
    ----------
    levels
        If they are known; otherwise the likeliest.
    force_errors_n : ndarray, shape (n, n_errors), optional
        Errors that the force may have, each by one unit of it, finite, zero before the release: further unknowns.
    u_force_errors : ndarray, shape (n_errors,), optional
        What is known of them beforehand; 0 to hold one.
    perturbations_n : ndarray, shape (n, n_perturbations), optional
        Errors of the force that are no unknowns, of the same kind.
    most_order
        Of the accelerometer's autoregressive errors.

    Raises
    ------
    IdentificationError
        If there are too few rows or frames, or force and motion have nothing in common.
    """
    first = prewhitened_mass(
        recoil.acceleration_m_s2,
        recoil.force_n,
        used=recoil.used,
        noise=None if levels is None else levels.acceleration,
        most_order=most_order,
    )
    none = np.zeros((recoil.force_n.size, 0))
    model = JointModel.of(
        recoil,
        known,
        first.mass_kg,
        none if force_errors_n is None else force_errors_n,
        np.zeros(0) if u_force_errors is None else u_force_errors,
    )
    noise = first.noise if levels is None else levels.acceleration
    p = np.zeros(model.unknowns)
    p[MASS] = 1.0 / first.mass_kg
    density = (known.force_sigma_n / first.mass_kg) ** 2 * recoil.step_s
    sigma = max(noise_sigma(model.track.positions_m), LEAST_MARKER_M)
    if levels is not None:
        sigma, density = levels.marker_sigma_m, levels.density
    moved, iterations = math.inf, 0
    found: JointSolution | None = None
    while moved > SETTLED and iterations < MOST_ITERATIONS:
        residual, columns = model.accelerations(p)
        if levels is None and iterations < 2:
            noise = fit_noise(model.pieces(residual), most_order)
        accelerations = model.whitened(residual, columns, noise)
        positions, shapes = model.positions(p, noise)
        if levels is None and iterations < 1:
            sigma, density = model.likeliest(positions, shapes, accelerations, sigma, p, noise)
        rows = model.tracked(positions, shapes, sigma, density)
        found = model.solve(accelerations, rows, p, sigma)
        step = found.step.copy()
        step[SKEW] = float(np.clip(step[SKEW], -LONGEST_STEP_S, LONGEST_STEP_S))
        p = p + step
        if not p[MASS] > 0:
            raise IdentificationError(
                "force and motion do not go together: no positive mass relates them",
                found=f"an acceleration per force of {p[MASS]:.3g} 1/kg",
                remedy="check areas, units and polarities in the rig file",
            )
        u = math.sqrt(float(found.covariance[MASS, MASS]))
        moved = abs(float(step[MASS])) / max(u, NEGLIGIBLE * float(p[MASS]))
        iterations += 1
    if found is None:
        raise ValueError("there must be an iteration")
    perturbations = none if perturbations_n is None else perturbations_n
    return _result(model, p, found, NoiseLevels(noise, sigma, density), perturbations, iterations, moved <= SETTLED)


def _result(
    model: JointModel,
    p: Array,
    found: JointSolution,
    levels: NoiseLevels,
    perturbations: Array,
    iterations: int,
    settled: bool,
) -> JointMass:
    residual, _ = model.positions(p, levels.acceleration)
    t = model.track.times_s
    walk = WalkSmoother.design(
        t, np.ones(t.shape, dtype=bool), levels.marker_sigma_m**2, np.full(t.size - 1, levels.density)
    )
    states, _ = walk.smooth(residual[:, None])
    travel = model.track.positions_m - residual + states[:, 0, 0]
    mass = 1.0 / float(p[MASS])
    by = mass**2 * np.abs(found.by_priors)
    u = np.sqrt(np.diag(found.covariance))
    sensitivities = mass**2 * model.sensitivities(p, found, levels, perturbations)
    return JointMass(
        mass_kg=mass,
        u_kg=mass**2 * float(np.linalg.norm(found.by_rows)),
        u_zero_kg=float(by[ZERO]),
        u_skew_kg=float(by[SKEW]),
        u_shift_kg=float(by[SHIFT]),
        u_gain_kg=float(by[GAIN]),
        u_scale_kg=float(by[SCALE]),
        zero_m_s2=float(p[ZERO]),
        u_zero_m_s2=float(u[ZERO]),
        skew_s=float(p[SKEW]),
        u_skew_s=float(u[SKEW]),
        shift_s=float(p[SHIFT]),
        gain_error=float(p[GAIN]),
        scale_error=float(p[SCALE]),
        force_errors=p[UNKNOWNS:].copy(),
        force_sensitivities_kg=mass**2 * found.by_priors[UNKNOWNS:],
        levels=levels,
        frame_times_s=t,
        travel_m=travel,
        velocity_m_s=model.velocity(p, levels.acceleration) + states[:, 1, 0],
        residual_m=model.track.positions_m - travel,
        sensitivities_kg=sensitivities,
        frames=int(t.size),
        set_aside=model.track.set_aside,
        rows=int(np.count_nonzero(model.recoil.used)),
        iterations=iterations,
        settled=settled,
    )
