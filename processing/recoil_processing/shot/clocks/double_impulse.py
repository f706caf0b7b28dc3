"""Mass by the camera alone: its displacement against the double integral of the force.

From the release on the travel is

    x(t) = D_F(t) / m + D_K(t) + x0 + v0 t + tau x'(t) + w(t) + n,

with D_F and D_K the double integrals of the force and of the acceleration that is no force over mass (gravity, the
carriage's motion), tau what is left of the clocks' offset, n the marker's white noise and w the walk that the force's
noise integrates to. No acceleration is measured: stress waves and zero shifts of accelerometers do not matter. At rest
before the release all that is unknown is x0.

It is generalized least squares: a Kalman filter of the walk makes the rows independent
(`recoil_processing.alignment.velocity_walk`). The first unknown is 1/m, the second the position at rest; each further
one may be restricted by its standard uncertainty. Noise levels are those that make the positions likeliest; the walk
has at least the noise that the force has in the pre-trigger baseline.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_finite, require_not_negative, require_positive
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.clocks.camera_track import CameraTrack

INFLATIONS = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)
"""Factors of the walk's density over that of the force's noise: what the model leaves out walks too."""
LEAST_DENSITY = 1e-9
"""Density of the walk, (m/s^2)^2/Hz: a force without noise has some."""
START = 1
"""Column of the position at rest."""
LIKELIER = 0.5
"""Log-likelihood that a larger density must gain."""
LEAST_MARKER_M = 1e-9
"""Noise of a marker; no camera is better."""
SIGMA_STEPS = 3
"""Steps of the marker's noise towards what its residuals call for; each one's error is a fraction of the one before."""
_SHIFT, _VELOCITY, _ERRORS = range(2, 5)
"""Columns behind the force's double integral and x0: tau, v0, and the force's errors."""


@dataclass(frozen=True, eq=False)
class DoubleImpulseMass(ReadOnlyArrays):
    """Mass by displacement and force.

    Attributes
    ----------
    mass_kg, u_kg
        Mass and its standard uncertainty by the random errors of camera and force.
    shift_s
        tau; 0 where it was held.
    marker_sigma_m
        Standard deviation of the marker's noise.
    density
        Density of the walk, (m/s^2)^2/Hz, two-sided.
    inflation
        Ratio of the density to that of the force's noise.
    u_shift_s
        Standard uncertainty of `shift_s`, with what was known of it; 0 where it was held.
    force_errors : ndarray, shape (n_errors,)
        Errors of the force, by the camera track and what was known of them.
    """

    mass_kg: float
    u_kg: float
    shift_s: float
    marker_sigma_m: float
    density: float
    inflation: float
    frames: int
    set_aside: int
    u_shift_s: float
    force_errors: Array


def double_impulse_mass(
    frame_times_s: Array,
    displacement_m: Array,
    start_s: float,
    step_s: float,
    force_n: Array,
    other_m_s2: Array | None = None,
    *,
    release_s: float,
    end_s: float = math.inf,
    rough_mass_kg: float,
    force_sigma_n: float = 0.0,
    u_shift_s: float = 0.0,
    u_velocity_m_s: float = 0.0,
    levels: tuple[float, float] | None = None,
    least_levels: tuple[float, float] = (LEAST_MARKER_M, LEAST_DENSITY),
    force_errors_n: Array | None = None,
    u_force_errors: Array | None = None,
) -> DoubleImpulseMass:
    """Estimate the mass by generalized least squares of the displacement on the force's double integral.

    Parameters
    ----------
    frame_times_s, displacement_m : ndarray, shape (n_frames,)
        Times on the force's clock, strictly increasing, and displacement; lost frames are NaN.
    start_s, step_s
        Time base of the force.
    force_n : ndarray, shape (n,)
        Force, finite, zero before the release.
    other_m_s2 : ndarray, shape (n,), optional
        Acceleration of the displacement that is no force over mass, zero before the release.
    release_s
        Instant from which on the part is free.
    end_s
        Instant up to which frames are used.
    rough_mass_kg
        Mass to a few percent.
    force_sigma_n
        White noise of the force per sample.
    u_shift_s, u_velocity_m_s
        Standard uncertainties of tau and v0, which are zero to this; 0 to hold them, infinite to free them.
    levels
        Marker's noise in m and the walk's density, if they are known; otherwise the likeliest.
    least_levels
        Levels that the noises are never taken to be better than.
    force_errors_n : ndarray, shape (n, n_errors), optional
        Errors that the force may have, finite, zero before the release, each by one unit, that are unknowns: what a
        shot sees in different mixtures it distinguishes.
    u_force_errors : ndarray, shape (n_errors,), optional
        Standard uncertainties of these, which are zero to this.

    Raises
    ------
    ValueError
        If shapes do not fit, a series is not finite, or an uncertainty is negative.
    IdentificationError
        If too few frames saw the motion, or force and displacement have nothing in common.
    """
    other = np.zeros_like(force_n) if other_m_s2 is None else other_m_s2
    if force_n.ndim != 1 or force_n.size < 2 or other.shape != force_n.shape:
        raise ValueError(
            f"two samples of the force and as many of the other are needed, not {force_n.shape}, {other.shape}"
        )
    require_finite(force_n=force_n, other_m_s2=other)
    require_not_negative(u_shift_s=u_shift_s, u_velocity_m_s=u_velocity_m_s, force_sigma_n=force_sigma_n)
    require_positive(rough_mass_kg=rough_mass_kg)
    impulse = DoubleIntegral.of(force_n, start_s, step_s)
    given = DoubleIntegral.of(other, start_s, step_s)
    rough = DoubleIntegral.of(force_n / rough_mass_kg + other, start_s, step_s)
    own_errors = np.zeros((force_n.size, 0)) if force_errors_n is None else force_errors_n
    u_errors = np.zeros(0) if u_force_errors is None else u_force_errors
    if own_errors.shape != (force_n.size, u_errors.size):
        raise ValueError(f"{u_errors.size} uncertainties do not fit errors of shape {own_errors.shape}")
    track = CameraTrack.of(frame_times_s, displacement_m, release_s, end_s, rough)
    t = track.times_s
    columns = [impulse.at(t)[0], np.ones_like(t), rough.at(t)[1], t - release_s]
    columns += [-DoubleIntegral.of(e / rough_mass_kg, start_s, step_s).at(t)[0] for e in own_errors.T]
    knowledge = [math.inf, math.inf, u_shift_s, u_velocity_m_s, *u_errors.tolist()]
    # an error that moves nothing is none
    free = [j for j, u in enumerate(knowledge) if u > 0 and (j < _ERRORS or np.any(columns[j]))]
    target = track.positions_m - given.at(t)[0]
    table = np.column_stack([*(columns[j] for j in free), target])
    scale = np.sqrt((table[:, :-1] ** 2).sum(axis=0))
    if not np.all(scale > 0):
        raise IdentificationError(
            "the force does not move the part while the camera sees it",
            expected="frames from the release on",
            remedy="check the camera's alignment",
        )
    table[:, :-1] /= scale
    priors = np.array([knowledge[j] for j in free]) * scale
    least = max((force_sigma_n / rough_mass_kg) ** 2 * step_s, least_levels[1])
    if levels is not None:
        found = ImpulseFit.of(track, table, priors, *levels)
    else:
        sigma = max(noise_sigma(track.positions_m), least_levels[0])
        densities = [inflation * least for inflation in INFLATIONS]
        found = ImpulseFit.likeliest(track, table, priors, sigma, densities, least_levels[0])
    values = dict(zip(free, (found.solution / scale).tolist(), strict=True))
    inverse = values[0]
    if not inverse > 0:
        raise IdentificationError(
            "force and displacement do not go together: no positive mass relates them",
            found=f"an acceleration per force of {inverse:.3g} 1/kg",
            remedy="check areas, units and polarities in the rig file",
        )
    mass = 1.0 / inverse
    own = mass**2 / float(scale[0])
    shift = free.index(_SHIFT) if _SHIFT in free else None
    return DoubleImpulseMass(
        mass_kg=mass,
        u_kg=own * found.u_by_rows,
        shift_s=values.get(_SHIFT, 0.0),
        marker_sigma_m=found.sigma,
        density=found.density,
        inflation=found.density / least,
        frames=int(t.size),
        set_aside=track.set_aside,
        u_shift_s=0.0 if shift is None else math.sqrt(float(found.covariance[shift, shift])) / float(scale[shift]),
        force_errors=np.array([values.get(_ERRORS + j, 0.0) for j in range(u_errors.size)]),
    )


@dataclass(frozen=True, eq=False)
class ImpulseFit(ReadOnlyArrays):
    """Solution for one pair of noise levels, the unknowns scaled as the table's columns.

    Attributes
    ----------
    solution : ndarray, shape (n_unknowns,)
    covariance : ndarray, shape (n_unknowns, n_unknowns)
    u_by_rows
        Standard uncertainty of the first unknown by the positions' errors alone.
    residuals : ndarray, shape (n_rows,)
        Residuals over the marker's noise.
    sigma, density
        Marker's noise, m, and the walk's density, (m/s^2)^2/Hz.
    log_likelihood
        Log-likelihood, up to a constant.
    """

    solution: Array
    covariance: Array
    u_by_rows: float
    residuals: Array
    sigma: float
    density: float
    log_likelihood: float

    @classmethod
    def of(cls, track: CameraTrack, table: Array, priors: Array, sigma: float, density: float) -> ImpulseFit:
        """Solve for one pair of noise levels.

        Parameters
        ----------
        table : ndarray, shape (n, n_unknowns + 1)
            Columns of the unknowns, and the positions as the last.
        priors : ndarray, shape (n_unknowns,)
            Standard uncertainties, in the columns' scale; infinite where nothing was known.
        """
        rows, log_determinant = track.whiten(table, density / sigma**2)
        rows /= sigma
        rest = np.zeros((1, table.shape[1]))
        if track.rest_frames:
            weight = math.sqrt(track.rest_frames) / sigma
            # the column of ones was scaled with the others
            rest[0, START] = weight * float(table[0, START])
            rest[0, -1] = weight * track.rest_m
        known = np.zeros((priors.size, table.shape[1]))
        known[:, :-1] = np.diag(np.where(np.isfinite(priors), 1.0 / np.where(priors > 0, priors, 1.0), 0.0))
        full = np.vstack([rows, rest, known])
        design, target = full[:, :-1], full[:, -1]
        # what is known far better than the camera track shows must not hide the rest from the pseudo-inverse
        size = np.sqrt((design**2).sum(axis=0))
        inverse = np.linalg.pinv(design / size) / size[:, np.newaxis]
        solution = inverse @ target
        residuals = (target - design @ solution)[: rows.shape[0]]
        u_by_rows = float(np.linalg.norm(inverse[0, : rows.shape[0] + 1]))
        misfit = float(residuals @ residuals) + log_determinant + 2.0 * rows.shape[0] * math.log(sigma)
        return cls(solution, inverse @ inverse.T, u_by_rows, residuals, sigma, density, -0.5 * misfit)

    @classmethod
    def likeliest(
        cls,
        track: CameraTrack,
        table: Array,
        priors: Array,
        sigma: float,
        densities: Sequence[float],
        least_sigma: float = LEAST_MARKER_M,
    ) -> ImpulseFit:
        """Find the marker's noise for each density of the walk, and the density that makes the positions likeliest.

        Parameters
        ----------
        track, table, priors
            Track, table and priors as in `of`.
        sigma
            A first guess of the marker's noise.
        densities
            Densities, rising.
        least_sigma
            Standard deviation that the marker's noise is never taken to be better than.

        Raises
        ------
        ValueError
            If there is no density.
        """
        best: ImpulseFit | None = None
        for density in densities:
            tried = cls.of(track, table, priors, sigma, density)
            for _ in range(SIGMA_STEPS):
                freedom = max(tried.residuals.size - tried.solution.size, 1)
                own = tried.sigma * math.sqrt(float(tried.residuals @ tried.residuals) / freedom)
                tried = cls.of(track, table, priors, max(own, least_sigma), density)
            if best is not None and tried.log_likelihood <= best.log_likelihood + LIKELIER:
                break
            best, sigma = tried, tried.sigma
        if best is None:
            raise ValueError("there must be a density to try")
        return best
