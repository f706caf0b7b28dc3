"""A camera's frames as rows of the inference, where the forces alone tell the motion.

No accelerometer rides along: what the camera saw is the double integral of what the equation of motion makes of the
forces. With the error ka of the camera's scale, whatever else may be wrong in the forces and in what the carriage's
sensors tell of the tipping part (`recoil_identification.rows.causes`), and the mass in a',

    x = II[e^ka (a' + o) + b r + v d + sum c h] + x0 + tau v + theta v (t - t_m) + D d + noise

II is the double integral from the release on, o the travel's acceleration that is no force over mass (gravity, the
carriage's motion), tau what is left of the clocks' offset, theta of their rates, and D the shapes in which optics bend
the picture. The noise is the frames' own and the walk that the forces' noise integrates to: their covariance is written
down, as that of an accelerometer's rows is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.camera_rows import LATE, MEAN_S, RATE, START, U_START_M, picture_origin_m
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.motion_noise import CORRELATED
from recoil_identification.rows.row_noise import walked
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.picture_bends import picture_bends
from recoil_processing.shot.clocks.camera_track import CameraTrack
from recoil_processing.shot.clocks.forced_recoil import ForcedRecoil
from recoil_processing.shot.error_source import ErrorSource, SourceKind

BAND_HZ = 100.0
"""Band within which white noise of the acceleration is counted."""


@dataclass(frozen=True, eq=False)
class ForcedTravel(ReadOnlyArrays):
    """Means of frames of a motion that the forces drive; the first is that of all frames at rest, if there are any.

    Attributes
    ----------
    frames_s : ndarray, shape (n_frames,)
        Instants of the frames on the reference clock, s.
    places : ndarray of int, shape (n_frames,)
        Place of each frame's mean.
    times_s, recorded_m, sigma_m : ndarray, shape (n_rows,)
        Instants and displacements of the means, and the standard deviation of the camera's own error.
    release_s
        Instant, s, from which on accelerations are integrated.
    density
        Density of the forces' noise over the mass, (m/s^2)^2/Hz, two-sided.
    other_m_s2 : ndarray, shape (n,)
        o, on the regression's grid; zero before the release.
    velocity_m_s : ndarray, shape (n_rows,)
    bends : ndarray, shape (n_rows, n_distortions)
        Per meter of each.
    clock
        The camera's.
    drift
        Drift of that clock by which the frames lie where they lie, where it was found from them; else 0.
    u_shift_s, u_rate, u_distortion_m
        Standard uncertainties of tau, of the clock's drift and of the first distortion; half of it is the next one's.
        Infinite where nothing is known beforehand.
    origin_m
        Place of the battery in the picture, by `picture_origin_m`.
    motion_m2 : ndarray, shape (n_rows, n_rows), or None
        Covariance of what the motion's own noise integrates to; None while it is not known.
    """

    frames_s: Array
    places: NDArray[np.intp]
    times_s: Array
    recorded_m: Array
    sigma_m: Array
    release_s: float
    density: float
    other_m_s2: Array
    velocity_m_s: Array
    bends: Array
    clock: str
    u_shift_s: float
    u_rate: float
    u_distortion_m: float
    drift: float = 0.0
    origin_m: float = 0.0
    motion_m2: Array | None = None

    @classmethod
    def of(
        cls,
        forced: ForcedRecoil,
        track: CameraTrack,
        levels: tuple[float, float],
        *,
        clock: str,
        u_shift_s: float,
        u_rate: float,
        drift: float = 0.0,
    ) -> ForcedTravel:
        """Average the frames of a track.

        Parameters
        ----------
        levels
            Standard deviation of the marker's noise in m, and the density of the forces' noise over the mass.
        """
        start_s, step_s = float(forced.recorded.times_s[0]), forced.recorded.step_s
        numbers = np.floor((track.times_s - track.release_s) / MEAN_S).astype(np.int64)
        _, places, counts = np.unique(numbers, return_inverse=True, return_counts=True)
        frames_s, positions_m = track.times_s, track.positions_m
        if track.rest_frames:
            frames_s = np.append(track.release_s, frames_s)
            positions_m = np.append(track.rest_m, positions_m)
            places, counts = np.append(0, places + 1), np.append(1, counts)

        def means(values: Array) -> Array:
            return np.asarray(np.bincount(places, values) / counts)

        sigma_m = levels[0] / np.sqrt(counts)
        if track.rest_frames:
            sigma_m[0] = levels[0] / math.sqrt(track.rest_frames)
        specs = forced.fired.rig.with_role("recoil_displacement")
        velocity = DoubleIntegral.of(forced.acceleration_m_s2, start_s, step_s).at(frames_s)[1]
        return cls(
            frames_s=frames_s,
            places=places,
            times_s=means(frames_s),
            recorded_m=means(positions_m),
            sigma_m=sigma_m,
            release_s=track.release_s,
            density=levels[1],
            other_m_s2=forced.other_m_s2,
            velocity_m_s=means(velocity),
            bends=np.column_stack([means(bend) for bend in picture_bends(positions_m - positions_m[0])]),
            clock=clock,
            u_shift_s=u_shift_s,
            u_rate=u_rate,
            drift=drift,
            u_distortion_m=max((spec.sensor.u_bent_m for spec in specs), default=0.0),
            origin_m=picture_origin_m(track.rest_m) if track.rest_frames else 0.0,
        )

    @property
    def priors(self) -> list[Prior]:
        """Priors of the unknowns that are in no force; those without one are told by the frames alone."""
        known = [
            (START.name, START.name, U_START_M, 0.0),
            (ErrorSource(SourceKind.ALIGNMENT, self.clock), LATE.name, self.u_shift_s, 0.0),
            (ErrorSource(SourceKind.CLOCK_RATE, self.clock), RATE.name, self.u_rate, -self.drift),
            *((name, name, self.u_distortion_m / 2**number, 0.0) for number, name in enumerate(DISTORTIONS)),
        ]
        return [Prior.of(*one) for one in known if math.isfinite(one[2])]

    @property
    def covariance_m2(self) -> Array:
        """Covariance of all rows by the noise of camera and forces at rest, shape (n_rows, n_rows)."""
        moving_s = np.maximum(self.times_s - self.release_s, 0.0)
        return np.asarray(self.density * walked(moving_s) + np.diag(self.sigma_m**2))

    @cached_property
    def correlation(self) -> Correlation:
        """Correlation of all rows."""
        covariance = self.covariance_m2
        if self.motion_m2 is not None:
            covariance = covariance + self.motion_m2
        return Correlation.of(covariance / np.outer(self.sigma_m, self.sigma_m))

    @property
    def level_m_s2(self) -> float:
        """Standard deviation of the forces' noise over the mass within `BAND_HZ`."""
        return math.sqrt(2.0 * BAND_HZ * self.density)

    def motion_parts(self, equation: EquationOfMotion) -> tuple[Array, float]:
        """Return what the parts of the motion's own noise integrate to, and how large the motion is.

        Parameters
        ----------
        equation
            Equation of motion of every sample.

        Returns
        -------
        covariances_m2 : ndarray, shape (PARTS, n_rows, n_rows)
            Covariance of each part, `recoil_identification.rows.motion_noise`, for a size of 1 m/s^2; white noise is
            counted within `BAND_HZ`.
        acceleration_m_s2
            Root mean square of the acceleration.
        """
        regression = equation.regression
        start_s, end_s = regression.interval_s
        grid_s = np.arange(self.release_s, end_s, MEAN_S) + 0.5 * MEAN_S
        a = np.interp(grid_s, regression.times_s, regression.force_n / equation.m0_kg)
        speed = np.maximum((np.cumsum(a) - 0.5 * a) * MEAN_S, 0.0)  # at the middle of each step, as the rest
        weights = [np.ones(grid_s.size), *(np.abs(one) / max(np.max(np.abs(one)), 1e-12) for one in (a, speed))]
        twice = np.maximum(self.times_s[:, np.newaxis] - grid_s, 0.0) * MEAN_S
        white = np.eye(grid_s.size) / (2.0 * BAND_HZ * MEAN_S)
        apart_s = np.abs(grid_s[:, np.newaxis] - grid_s)
        slow = (np.exp(-apart_s / (share * (end_s - start_s))) for share in CORRELATED)
        found = [twice @ (np.outer(one, one) * white) @ twice.T for one in weights]
        found += [twice @ one @ twice.T for one in slow]
        return np.array(found), float(np.sqrt(np.mean(a**2)))


@dataclass(frozen=True, eq=False)
class TravelRows:
    """Rows of frames.

    Attributes
    ----------
    equation
        Equation of motion of every sample as recorded, without an acceleration, each over a standard deviation of one;
        its motion was measured in the camera's scale.
    travel
    """

    equation: EquationOfMotion
    travel: ForcedTravel

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of those that the rows hang on."""
        return (*self.equation.unknowns, START.name, LATE.name, RATE.name, *DISTORTIONS)

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the forces leave of the frames, and its derivatives, over the standard deviation."""
        seen, r = self.travel, self.equation.regression
        left, derivatives = self.equation.linearised(values)
        other = math.exp(values[motion.CAMERA.name]) * seen.other_m_s2
        columns = np.column_stack([other - left, derivatives])
        columns[:, 1 + self.equation.unknowns.index(motion.CAMERA.name)] += other
        columns *= (r.released > 0)[:, np.newaxis]
        counts = np.bincount(seen.places)
        integrated = np.column_stack(
            [
                np.bincount(seen.places, DoubleIntegral.of(one, float(r.times_s[0]), r.step_s).at(seen.frames_s)[0])
                / counts
                for one in columns.T
            ]
        )
        since_s = seen.times_s - float(np.mean(r.interval_s))
        added = np.column_stack(
            [np.ones_like(since_s), seen.velocity_m_s, seen.velocity_m_s * since_s, seen.bends],
        )
        given = np.array([values[name] for name in (START.name, LATE.name, RATE.name, *DISTORTIONS)])
        modelled = integrated[:, 0] + added @ given
        whole = (
            np.column_stack([seen.recorded_m - seen.origin_m - modelled, integrated[:, 1:], added])
            / seen.sigma_m[:, np.newaxis]
        )
        return whole[:, 0], whole[:, 1:]
