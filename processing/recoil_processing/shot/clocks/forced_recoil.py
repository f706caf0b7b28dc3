"""The recoil as the gauges' forces drive it: what a camera sees of it, where no accelerometer rides along.

The forces over a first mass, with what the carriage's sensors measured of the tipping part's own motion, give the
acceleration that the camera's displacement is the double integral of. A camera is aligned by it, and the mass is
what brings both in line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.double_integral import integrate
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass, double_impulse_mass
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.kinematics import (
    AngularMotion,
    angular_motion,
    relative_to_tipping_part,
    seen_by_camera,
)
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression, build_regression, missing_forces
from recoil_processing.shot.sensor_scales import ScaleUncertainty, scale_uncertainty
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS

RATE_ROLES = ("carriage_rate", "tipping_rate")
"""Roles that state how carriage and tipping part turn, relative to which a camera sees the recoil."""
PASSES = 3
"""Passes over the motion and the end of travel that it gives itself: the friction turns with the velocity."""
STRAIGHTNESS = 3e-4
"""Share of the acceleration's peak that the forces are never taken to be better than: no gauge is straighter, nor is a
rigid part that slides and strikes what it is written down as."""
STRAIGHT_S = 1e-3
"""Time for which such an error stays the same."""
LINEARITY = 1e-5
"""Share of the travel that the frames are never taken to be better than: no lens is."""
ROUGH_STEPS = 3
"""Steps of the mass that the model is linearised at; each leaves some thousandths of what the one before did."""


@dataclass(frozen=True, eq=False)
class ForcedRecoil(ReadOnlyArrays):
    """A recoil by its forces.

    Attributes
    ----------
    recorded
        Forces as recorded; the acceleration is zero throughout, for none was measured.
    mass_kg
        Mass over which the forces are the acceleration.
    acceleration_m_s2 : ndarray, shape (n,)
        Second derivative of what the camera sees of the travel, lost samples of the forces bridged.
    """

    fired: FiredShot
    signals: Signals
    motion: AngularMotion
    recorded: Regression
    mass_kg: float
    acceleration_m_s2: Array

    @classmethod
    def of(
        cls,
        fired: FiredShot,
        signals: Signals,
        mass_kg: float | None = None,
        velocity_m_s: Array | None = None,
    ) -> ForcedRecoil:
        """Let the forces drive the recoiling part.

        Parameters
        ----------
        fired, signals
        mass_kg
            Mass over which the forces are the acceleration; the specification mass if left out.
        velocity_m_s : ndarray, shape (n,), optional
            Velocity of recoil, whose sign is that of the friction; the one that the forces give if left out.

        Raises
        ------
        IdentificationError
            If a pressure is missing, or the forces never drive the part to the rear.
        """
        require_forces(signals)
        mass, motion = mass_kg or fired.rig.mechanism.m3, angular_motion(signals, fired.rig)
        # until it is known when the part turns back it is taken to recoil
        velocity = np.ones(signals.times_s.size) if velocity_m_s is None else velocity_m_s
        nothing = np.zeros(velocity.size)
        for _ in range(PASSES):
            recorded = build_regression(signals, fired.rig.mechanism, nothing, velocity, 0.0)
            inputs = EstimatorInputs(recorded, recorded, signals, fired)
            acceleration = relative_to_tipping_part(
                inputs.force_n / mass, fired.rig.mechanism, motion, signals.step_s, recorded.released
            )
            if velocity_m_s is not None:
                break
            velocity = integrate(acceleration, signals.step_s)
        if fired.rig.camera_on_ground:
            acceleration = seen_by_camera(inputs.force_n / mass, fired.rig, motion, signals.step_s, recorded.released)
        return cls(fired, signals, motion, recorded, mass, acceleration)

    @cached_property
    def inputs(self) -> EstimatorInputs:
        """The forces as the estimators take them."""
        return EstimatorInputs(self.recorded, self.recorded, self.signals, self.fired)

    @cached_property
    def scales(self) -> ScaleUncertainty:
        """Return the standard uncertainties of the gauges' scales and of the friction."""
        return scale_uncertainty(self.fired.rig)

    @cached_property
    def other_m_s2(self) -> Array:
        """The seen acceleration that is no force over mass, shape (n,): gravity, and the carriage's motion."""
        return np.asarray(self.acceleration_m_s2 - self.inputs.force_n / self.mass_kg * (self.recorded.released > 0))

    @cached_property
    def along_m_s2(self) -> Array:
        """Second derivative of the travel along the tipping part, shape (n,), which a camera on the ground sees not."""
        if not self.fired.rig.camera_on_ground:
            return self.acceleration_m_s2
        rigid = self.inputs.force_n / self.mass_kg
        return relative_to_tipping_part(
            rigid, self.fired.rig.mechanism, self.motion, self.signals.step_s, self.recorded.released
        )

    @cached_property
    def least_levels(self) -> tuple[float, float]:
        """Noise that frames and forces are never taken to be better than: m, and a density of (m/s^2)^2/Hz."""
        inside = self.recorded.inside
        peak = float(np.max(np.abs(self.acceleration_m_s2[inside])))
        travel = float(np.ptp(integrate(integrate(self.acceleration_m_s2, self.signals.step_s), self.signals.step_s)))
        return LINEARITY * travel, (STRAIGHTNESS * peak) ** 2 * STRAIGHT_S

    def corrected(self, found: DoubleImpulseMass) -> ForcedRecoil:
        """Take off the forces what a camera track found wrong with them, and drive the mass that it found.

        Parameters
        ----------
        found
            Result of `camera_track_mass`.
        """
        r, errors = self.recorded, found.force_errors
        forces = r.forces_n.copy()
        forces[:, :-1] /= 1.0 + errors[:-1]
        forces[:, -1] -= errors[-1] * r.friction_direction
        recorded = replace(r, forces_n=forces)
        force = EstimatorInputs(recorded, recorded, self.signals, self.fired).force_n
        acceleration = seen_by_camera(
            force / found.mass_kg, self.fired.rig, self.motion, self.signals.step_s, r.released
        )
        return replace(self, recorded=recorded, mass_kg=found.mass_kg, acceleration_m_s2=acceleration)

    def camera_track_mass(
        self,
        frame_times_s: Array,
        displacement_m: Array,
        *,
        u_shift_s: float,
    ) -> DoubleImpulseMass:
        """Estimate the mass by a camera track, the gauges' scales and the friction being unknowns that are restricted.

        Parameters
        ----------
        frame_times_s, displacement_m : ndarray, shape (n_frames,)
            Times on the reference clock, and displacement; lost frames are NaN.
        u_shift_s
            Standard uncertainty of these times beforehand; infinite where nothing is known.

        Raises
        ------
        IdentificationError
            If too few frames saw the motion, or force and displacement have nothing in common.
        """
        r, rough = self.recorded, self.mass_kg
        errors = np.column_stack([self.inputs.forces_n[:, :-1], r.friction_direction])
        u = np.array([*self.scales.gauges, self.scales.friction_n])
        for _ in range(ROUGH_STEPS):
            found = double_impulse_mass(
                frame_times_s,
                displacement_m,
                float(r.times_s[0]),
                r.step_s,
                self.inputs.force_n,
                self.other_m_s2,
                release_s=self.inputs.release_s,
                end_s=r.interval_s[1],
                rough_mass_kg=rough,
                force_sigma_n=self.inputs.slow_force_n,
                u_shift_s=u_shift_s,
                u_velocity_m_s=r.rms_release_n_s / rough,
                least_levels=self.least_levels,
                force_errors_n=errors,
                u_force_errors=u,
            )
            rough = found.mass_kg
        return found


def carriage_lacks(signals: Signals, rig: Rig) -> list[str]:
    """Return the roles that are missing to tell how the tipping part moves, on which a camera's origin is.

    Both accelerometers of the carriage are needed, and one of the two rates: how much a rig turns nothing else tells.
    A camera on the ground needs a rate alone: it sees the bore turn, and no carriage moves its origin.
    """

    def usable(role: str) -> bool:
        return role in signals.series and bool(np.isfinite(signals.series[role]).any())

    missing = [role for role in CARRIAGE_ACCELERATIONS if not (rig.camera_on_ground or usable(role))]
    return missing if any(map(usable, RATE_ROLES)) else [*missing, " or ".join(RATE_ROLES)]


def require_forces(signals: Signals) -> None:
    """Refuse signals that lack a force.

    Raises
    ------
    IdentificationError
        Naming every role that is missing.
    """
    missing = [
        role for role in PRESSURE_ROLES if role not in signals.series or not np.isfinite(signals.series[role]).any()
    ]
    if missing:
        raise missing_forces(missing)
