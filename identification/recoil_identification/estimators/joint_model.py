"""The rows of force, accelerometer and camera together, linearised: see `estimators.joint_smoother`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.estimators.joint_recoil import Knowledge, NoiseLevels, Recoil
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.shot.clocks.autoregressive_noise import AutoregressiveNoise, runs
from recoil_processing.shot.clocks.camera_track import CameraTrack
from recoil_processing.shot.clocks.double_impulse import INFLATIONS, LEAST_DENSITY, LEAST_MARKER_M, LIKELIER

Array = NDArray[np.float64]

PROBE_S = 5e-4
"""To both sides of an instant, over which the force is differentiated: its noise must not count as its slope."""
MASS, ZERO, SKEW, START, SHIFT, GAIN, SCALE = range(7)
UNKNOWNS = 7
"""1/m, b, s, x0, what is left of the camera's offset, g and c."""


@dataclass(frozen=True, eq=False)
class JointSolution(ReadOnlyArrays):
    """One step of all unknowns, their covariance, and the sensitivities of 1/m to rows and to one u of each prior."""

    step: Array
    covariance: Array
    by_rows: Array
    by_priors: Array


@dataclass(frozen=True, eq=False)
class JointModel(ReadOnlyArrays):
    """What the unknowns make of a recoil, and its derivatives.

    Attributes
    ----------
    recoil, known, track
    step_shape : ndarray, shape (n,)
        Of a zero that shifts at the release.
    other, felt, step_integral
        Of the acceleration that is not a', of what the accelerometer reads from the release on, and of the step.
    force_errors_n : ndarray, shape (n, n_errors)
        Errors that the force may have, each by one unit; as many unknowns follow the named ones.
    u_force_errors : ndarray, shape (n_errors,)
        What is known of them beforehand.
    """

    recoil: Recoil
    known: Knowledge
    track: CameraTrack
    step_shape: Array
    other: DoubleIntegral
    felt: DoubleIntegral
    step_integral: DoubleIntegral
    rough_mass_kg: float
    force_errors_n: Array
    u_force_errors: Array

    @property
    def unknowns(self) -> int:
        """How many there are."""
        return UNKNOWNS + self.u_force_errors.size

    @classmethod
    def of(
        cls, recoil: Recoil, known: Knowledge, rough_mass_kg: float, force_errors_n: Array, u_force_errors: Array
    ) -> JointModel:
        """Integrate what is given, and take the frames.

        Raises
        ------
        IdentificationError
            If too few frames saw the motion.
        """

        def integral(series: Array) -> DoubleIntegral:
            return DoubleIntegral.of(series, recoil.start_s, recoil.step_s)

        step = (recoil.times_s >= recoil.release_s).astype(np.float64)
        rough = integral(recoil.force_n / rough_mass_kg + recoil.other_m_s2)
        track = CameraTrack.of(recoil.frame_times_s, recoil.displacement_m, recoil.release_s, recoil.end_s, rough)
        # what it reads before the release is noise that moves nothing
        felt = integral(recoil.acceleration_m_s2 * step)
        return cls(
            recoil,
            known,
            track,
            step,
            integral(recoil.other_m_s2),
            felt,
            integral(step),
            rough_mass_kg,
            force_errors_n,
            u_force_errors,
        )

    def force_n(self, p: Array) -> Array:
        """Return the force without the errors that the unknowns say, shape (n,)."""
        return np.asarray(self.recoil.force_n - self.force_errors_n @ p[UNKNOWNS:])

    def pieces(self, series: Array) -> list[Array]:
        """Return the runs of used samples of a series."""
        return [series[begin:end] for begin, end in runs(self.recoil.used)]

    def accelerations(self, p: Array) -> tuple[Array, Array]:
        """Return what the accelerometer reads beyond the model, (n,), and the model's derivatives, (n, n_unknowns)."""
        r, t = self.recoil, self.recoil.times_s
        series = self.force_n(p)
        force = np.interp(t + p[SKEW], t, series)
        ahead, behind = (np.interp(t + p[SKEW] + by, t, series) for by in (PROBE_S, -PROBE_S))
        columns = np.zeros((t.size, self.unknowns))
        gain = 1.0 + p[GAIN]
        columns[:, MASS] = gain * force
        columns[:, ZERO] = self.step_shape
        columns[:, SKEW] = gain * p[MASS] * (ahead - behind) / (2.0 * PROBE_S)
        columns[:, GAIN] = p[MASS] * force
        for j, error in enumerate(self.force_errors_n.T):
            columns[:, UNKNOWNS + j] = -gain * p[MASS] * np.interp(t + p[SKEW], t, error)
        return r.acceleration_m_s2 - gain * p[MASS] * force - p[ZERO] * self.step_shape, columns

    def whitened(self, residual: Array, columns: Array, noise: AutoregressiveNoise) -> Array:
        """Return independent rows of the derivatives and, last, the residual, as their triangle."""
        rows = self.independent(np.column_stack([columns, residual]), noise)
        return np.asarray(np.linalg.qr(rows, mode="r"))

    def independent(self, table: Array, noise: AutoregressiveNoise) -> Array:
        """Return independent rows of the accelerometer's used samples, no less noisy than before the shot."""
        rows = np.vstack([noise.whiten(table[begin:end]) for begin, end in runs(self.recoil.used)])
        quiet = math.hypot(self.known.quiet_sigma_m_s2, self.known.force_sigma_n / self.rough_mass_kg) ** 2
        return rows / math.sqrt(max(1.0, quiet / noise.slow_density))

    def force_share(self, noise: AutoregressiveNoise) -> float:
        """Return w, the accelerometer's weight in what drives the filter: the force's share of both variances."""
        force = (self.known.force_sigma_n / self.rough_mass_kg) ** 2
        return min(force / max(noise.slow_density, self.known.quiet_sigma_m_s2**2, 1e-300), 1.0)

    def positions(self, p: Array, noise: AutoregressiveNoise) -> tuple[Array, Array]:
        """Return what the camera saw beyond the model, and the model's derivatives, shapes (n,) and (n, n_unknowns)."""
        r, t, w = self.recoil, self.track.times_s, self.force_share(noise)
        impulse = DoubleIntegral.of(self.force_n(p), r.start_s, r.step_s)
        travel, velocity = impulse.at(t + p[SKEW])
        gain, scale = 1.0 + p[GAIN], 1.0 + p[SCALE]
        steps, other = self.step_integral.at(t)[0], self.other.at(t)
        felt = self.felt.at(t)[0] - p[ZERO] * steps
        moved = p[MASS] * (1.0 - w) * travel + w * felt / gain + other[0]
        columns = np.empty((t.size, self.unknowns))
        columns[:, MASS] = scale * (1.0 - w) * travel
        columns[:, ZERO] = -scale * w * steps / gain
        columns[:, SKEW] = scale * p[MASS] * (1.0 - w) * velocity
        columns[:, START] = 1.0
        columns[:, SHIFT] = p[MASS] * velocity + other[1]
        columns[:, GAIN] = -scale * w * felt / gain**2
        columns[:, SCALE] = moved
        for j, error in enumerate(self.force_errors_n.T):
            driven = DoubleIntegral.of(error, r.start_s, r.step_s).at(t + p[SKEW])[0]
            columns[:, UNKNOWNS + j] = -scale * p[MASS] * (1.0 - w) * driven
        model = scale * moved + p[START] + p[SHIFT] * columns[:, SHIFT]
        return self.track.positions_m - model, columns

    def velocity(self, p: Array, noise: AutoregressiveNoise) -> Array:
        """Return the modelled velocity at the frames, shape (n,)."""
        r, t, w = self.recoil, self.track.times_s, self.force_share(noise)
        impulse = DoubleIntegral.of(self.force_n(p), r.start_s, r.step_s).at(t + p[SKEW])[1]
        felt = self.felt.at(t)[1] - p[ZERO] * self.step_integral.at(t)[1]
        return np.asarray(p[MASS] * (1.0 - w) * impulse + w * felt / (1.0 + p[GAIN]) + self.other.at(t)[1])

    def tracked(self, residual: Array, columns: Array, sigma: float, density: float) -> Array:
        """Return independent rows of the derivatives and, last, the residual, shape (n_frames, n_unknowns + 1)."""
        return self.track.whiten(np.column_stack([columns, residual]), density / sigma**2)[0] / sigma

    def likeliest(
        self,
        residual: Array,
        columns: Array,
        accelerations: Array,
        sigma: float,
        p: Array,
        noise: AutoregressiveNoise,
    ) -> tuple[float, float]:
        """Find the marker's noise and the walk's density that make the positions likeliest."""
        share = self.force_share(noise)
        force = (self.known.force_sigma_n / self.rough_mass_kg) ** 2 * self.recoil.step_s
        least = max(force * (1.0 - share), LEAST_DENSITY)
        table = np.column_stack([columns, residual])
        best: tuple[float, float, float] | None = None
        for inflation in INFLATIONS:
            density = inflation * least
            for _ in range(2):
                rows, log_determinant = self.track.whiten(table, density / sigma**2)
                rows /= sigma
                step = self.solve(accelerations, rows, p, sigma).step
                left = rows[:, -1] - rows[:, :-1] @ step
                misfit = float(left @ left) + log_determinant + 2.0 * left.size * math.log(sigma)
                used, sigma = sigma, max(sigma * math.sqrt(float(left @ left) / left.size), LEAST_MARKER_M)
            if best is not None and -0.5 * misfit <= best[0] + LIKELIER:
                break
            best = -0.5 * misfit, used, density
        if best is None:
            raise ValueError("there must be a density to try")
        return best[1], best[2]

    def solve(self, accelerations: Array, rows: Array, p: Array, sigma: float) -> JointSolution:
        """Solve for one step from p: both kinds of rows, the rest before the release, and what is known beforehand."""
        k = self.known
        named = [math.inf, k.u_zero_m_s2, k.u_skew_s, math.inf, k.u_shift_s, k.u_gain, k.u_scale]
        known = np.concatenate([named, self.u_force_errors])
        rest = np.zeros((1, known.size + 1))
        if self.track.rest_frames:
            weight = math.sqrt(self.track.rest_frames) / sigma
            rest[0, START], rest[0, -1] = weight, weight * (self.track.rest_m - p[START])
        finite = np.flatnonzero(np.isfinite(known) & (known > 0))
        priors = np.zeros((finite.size, known.size + 1))
        priors[np.arange(finite.size), finite] = 1.0 / known[finite]
        priors[:, -1] = -p[finite] / known[finite]
        full = np.vstack([accelerations, rows, rest, priors])
        free = np.flatnonzero(known > 0)
        design, target = full[:, free], full[:, -1]
        scale = np.sqrt((design**2).sum(axis=0))
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(design / scale) / scale[:, None]
        covariance, step = np.zeros((known.size, known.size)), np.zeros(known.size)
        covariance[np.ix_(free, free)] = inverse @ inverse.T
        step[free] = inverse @ target
        by_priors = np.zeros(known.size)
        by_priors[finite] = inverse[0, full.shape[0] - finite.size :]
        by_rows = inverse[0, : full.shape[0] - finite.size]
        return JointSolution(step, covariance, by_rows, by_priors)

    def sensitivities(self, p: Array, found: JointSolution, levels: NoiseLevels, perturbations: Array) -> Array:
        """Return by how much errors of the force lower 1/m, shape (n_perturbations,)."""
        r, w = self.recoil, self.force_share(levels.acceleration)
        # what the model has too much of, in the accelerometer's rows and in the camera's
        sizes = p[MASS] * perturbations
        _, columns = self.accelerations(p)
        rows = self.independent(np.column_stack([columns, (1.0 + p[GAIN]) * sizes]), levels.acceleration)
        driven = [DoubleIntegral.of(size, r.start_s, r.step_s).at(self.track.times_s)[0] for size in sizes.T]
        _, shapes = self.positions(p, levels.acceleration)
        frames = np.column_stack([shapes, *((1.0 + p[SCALE]) * (1.0 - w) * travel for travel in driven)])
        seen = self.track.whiten(frames, levels.density / levels.marker_sigma_m**2)[0] / levels.marker_sigma_m
        lowered = [(side[:, : p.size] @ found.covariance[MASS]) @ side[:, p.size :] for side in (rows, seen)]
        return np.asarray(lowered[0] + lowered[1])
