"""The recoiling part's acceleration by the two routes of the model, and its travel.

The inertial route takes the accelerometer on the recoiling part; the kinematic route takes the
camera's displacement twice differentiated, with the carriage's accelerometers and the gyros. The two
share no sensor that matters, so they check one another.

A camera sees the travel along the tipping part, or from the ground the part's absolute motion along the bore at rest:
what it should see by the accelerometers is `seen_acceleration`, and the recoil is what is left of that without the
carriage's motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.motion_alignment import INFLATIONS
from recoil_processing.double_integral import integrate
from recoil_processing.filters import Filtered, LowPass, LowPassFilter, filter_alike
from recoil_processing.gaps import bridge
from recoil_processing.motion.derivative import second_derivative
from recoil_processing.motion.fusion import FusedMotion, fuse
from recoil_processing.noise import noise_sigma
from recoil_processing.repairs.bridged_gaps import bridge_errors
from recoil_processing.shot.signals import Signals, on_grid
from recoil_rigs.mechanism.model import (
    Mechanism,
    ground_acceleration,
    specific_acceleration_inertial,
    specific_acceleration_kinematic,
)
from recoil_rigs.rig import Rig
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS

ANGULAR_CUTOFF_HZ = 150.0
"""Low-pass of the angular rates before they are differentiated for the lever arms, which are small terms."""
TRAVEL_ROLES = ("recoil_acceleration", *CARRIAGE_ACCELERATIONS)
"""Roles of the accelerations whose double integral is the travel."""
LEAST_KICK_M_S = 3e-4
"""Error of a velocity that a camera of 50 um notices within a tenth of a second."""
MOST_KICKS = 6
"""Kicks in one record; with more of them its integral is hardly known."""
LEAST_REST_SAMPLES = 50
"""Samples of the accelerometer before the shot by which its noise is estimated."""
LEAST_NOISE_M_S2 = 1e-6
"""Noise of an accelerometer; none is better."""
LEAST_NOISE_SHARE = 5e-4
"""Share of the largest acceleration that its noise in the motion is at the least: a quiet rest is no fault, and what is
measured of a motion is no better than its sensor's linearity."""


@dataclass(frozen=True, eq=False)
class AngularMotion(ReadOnlyArrays):
    """Angular motion on the grid, SI; zero where it was not measured.

    Attributes
    ----------
    w1, w2 : ndarray, shape (n,)
        Angular rates of carriage and tipping part.
    dw1, dw2 : ndarray, shape (n,)
        Derivatives of the rates ``w1`` and ``w2``.
    beta : ndarray, shape (n,)
        Rotation of the tipping part relative to the carriage since rest.
    f_x, f_y : ndarray, shape (n,)
        Specific force of the carriage in its own axes.
    r_x, r_y
        Places of the carriage's accelerometers, from A.
    """

    w1: Array
    w2: Array
    dw1: Array
    dw2: Array
    beta: Array
    f_x: Array
    f_y: Array
    r_x: float
    r_y: float


def angular_motion(signals: Signals, rig: Rig) -> AngularMotion:
    """Collect the angular motion and the carriage's specific force; gaps are bridged for these small terms.

    What is on no carriage has neither.
    """
    mechanism = rig.mechanism
    if not mechanism.carriage_roles:
        return still(signals.times_s.size)
    low_pass = LowPass(min(ANGULAR_CUTOFF_HZ, 0.1 * signals.rate_hz))
    w1, w2 = (bridge(signals.get(role), otherwise=0.0) for role in ("carriage_rate", "tipping_rate"))
    smooth1, smooth2 = low_pass.apply(w1, signals.rate_hz), low_pass.apply(w2, signals.rate_hz)
    if "tipping_rate" not in signals.series:
        smooth2 = smooth1
    r_x, r_y = _position(rig, "carriage_acceleration_x")
    rest = {
        "carriage_acceleration_x": mechanism.g * np.sin(mechanism.phi10),
        "carriage_acceleration_y": mechanism.g * np.cos(mechanism.phi10),
    }
    f_x, f_y = (bridge(signals.get(role, level), otherwise=level) for role, level in rest.items())
    return AngularMotion(
        w1=smooth1,
        w2=smooth2,
        dw1=np.gradient(smooth1, signals.step_s),
        dw2=np.gradient(smooth2, signals.step_s),
        beta=integrate(smooth2 - smooth1, signals.step_s),
        f_x=f_x,
        f_y=f_y,
        r_x=r_x,
        r_y=r_y,
    )


def still(count: int) -> AngularMotion:
    """Return the motion of what nothing turns, of so many samples."""
    none = np.zeros(count)
    return AngularMotion(none, none, none, none, none, none, none, 0.0, 0.0)


def lacks(signals: Signals, rig: Rig, role: str) -> bool:
    """Return whether the rig has a channel of a role and the shot no usable one."""
    return role not in signals.series and rig.by_role(role) is not None


def turning_as_one(motion: AngularMotion) -> AngularMotion:
    """Let the carriage turn with the tipping part, where `angular_motion` has taken it for one at rest."""
    return replace(motion, w1=motion.w2, dw1=motion.dw2, beta=np.zeros_like(motion.w2))


def inertial_acceleration(signals: Signals, rig: Rig, motion: AngularMotion) -> Array:
    """Return a' of equation (36) by the accelerometer on the recoiling part, m/s^2, shape (n,); NaN where lost."""
    r5, r6 = _position(rig, "recoil_acceleration")
    return specific_acceleration_inertial(signals.series["recoil_acceleration"], motion.w2, motion.dw2, r5, r6)


def travel_acceleration(signals: Signals, rig: Rig, motion: AngularMotion) -> Array:
    """X'' by the accelerometers, m/s^2, shape (n,): what a camera on the tipping part would see."""
    inertial = bridge(inertial_acceleration(signals, rig, motion), otherwise=0.0)
    return relative_to_tipping_part(inertial, rig.mechanism, motion, signals.step_s)


def seen_acceleration(signals: Signals, rig: Rig, motion: AngularMotion) -> Array:
    """Return the second derivative of what the rig's camera sees, by the accelerometers, m/s^2, shape (n,).

    That of the travel along the tipping part where the rig has no camera, or it recoils on no carriage.
    """
    inertial = bridge(inertial_acceleration(signals, rig, motion), otherwise=0.0)
    return seen_by_camera(inertial, rig, motion, signals.step_s)


def seen_by_camera(inertial: Array, rig: Rig, motion: AngularMotion, step_s: float, free: Array | None = None) -> Array:
    """Return the second derivative of what the rig's camera sees of a part with a given a', m/s^2, shape (n,).

    Parameters
    ----------
    inertial, free : ndarray, shape (n,)
        Arguments of `relative_to_tipping_part`.
    """
    relative = relative_to_tipping_part(inertial, rig.mechanism, motion, step_s, free)
    spec = rig.by_role("recoil_displacement")
    if spec is None or not rig.camera_on_ground:
        return relative
    velocity = integrate(relative, step_s)
    terms = integrate(velocity, step_s), velocity, integrate(motion.w2, step_s), motion.w2, motion.dw2
    seen = ground_acceleration(
        rig.mechanism, inertial, *terms, motion.f_x, motion.f_y, motion.beta, w1=motion.w1, dw1=motion.dw1,
        r_x=motion.r_x, r_y=motion.r_y, p_5=spec.sensor.position[0], p_6=spec.sensor.position[1],
    )  # fmt: skip
    return seen if free is None else seen * free


def relative_to_tipping_part(
    inertial: Array, mechanism: Mechanism, motion: AngularMotion, step_s: float, free: Array | None = None
) -> Array:
    """X'' of a recoiling part with a given a', m/s^2, shape (n,).

    The travel that it needs itself, in the small centripetal term, is its own double integral.

    Parameters
    ----------
    inertial : ndarray, shape (n,)
        a' of equation (36), without missing samples.
    free : ndarray, shape (n,), optional
        0 where the part is held, 1 where it is free; free throughout if left out.
    """
    travel = np.zeros_like(inertial)
    for _ in range(2):
        acceleration = _relative(mechanism, inertial, travel, motion)
        if free is not None:
            acceleration = acceleration * free
        travel = integrate(integrate(acceleration, step_s), step_s)
    return acceleration


def kinematic_acceleration(
    signals: Signals,
    rig: Rig,
    motion: AngularMotion,
    camera: Channel,
    alignment: ClockAlignment,
    low_pass: LowPassFilter,
    *,
    longest_gap_s: float = 0.0,
) -> tuple[Array, Filtered]:
    """Return a' of equation (36) by the camera, already low-pass filtered, and what it was computed from.

    Parameters
    ----------
    signals, rig, motion
    camera
        Displacement on its own clock.
    alignment
        Alignment of the camera's clock.
    low_pass
        The filter of the regression; a displacement can only be differentiated behind it.
    longest_gap_s
        Longest gap that is bridged, as in `recoil_processing.shot.signals.on_grid`.

    Returns
    -------
    acceleration : ndarray, shape (n,)
    made_of : Filtered
        Columns that the motion was computed from; not trusted near lost frames and beyond the track's ends.
    """
    travel = on_grid(camera, alignment, signals.times_s, longest_gap_s=longest_gap_s)
    recorded = {"travel": travel, "f_x": motion.f_x, "f_y": motion.f_y}
    smooth = filter_alike(low_pass, recorded, signals.rate_hz)
    ddx = second_derivative(smooth["travel"], signals.step_s)
    if rig.camera_on_ground:
        return _from_the_ground(ddx, rig, replace(motion, f_x=smooth["f_x"], f_y=smooth["f_y"]), signals.step_s), smooth
    acceleration = specific_acceleration_kinematic(
        rig.mechanism, ddx, smooth["travel"], motion.w2, motion.dw2, smooth["f_x"], smooth["f_y"], motion.beta,
        w1=motion.w1, dw1=motion.dw1, r_x=motion.r_x, r_y=motion.r_y,
    )  # fmt: skip
    return acceleration, smooth


def _from_the_ground(seen: Array, rig: Rig, motion: AngularMotion, step_s: float) -> Array:
    """Return a' whose motion a camera on the ground sees, m/s^2, shape (n,); NaN where that is lost."""
    inertial = bridge(seen, otherwise=0.0) - rig.mechanism.g * np.sin(rig.mechanism.phi20)
    for _ in range(2):  # what the bore's turning changes is small
        inertial = inertial + bridge(seen, otherwise=0.0) - seen_by_camera(inertial, rig, motion, step_s)
    return np.where(np.isfinite(seen), inertial, np.nan)


def travel_and_velocity(fused: FusedMotion | None, acceleration: Array, step_s: float) -> tuple[Array, Array]:
    """Return travel and velocity of recoil on the grid, m and m/s, shape (n,) each.

    Those of `fused_motion`; the accelerometers' integrals where there is none.
    """
    if fused is not None:
        return fused.position_m, fused.velocity_m_s
    velocity = integrate(acceleration, step_s)
    return integrate(velocity, step_s), velocity


def bridged_samples(signals: Signals) -> Flags:
    """Return where `travel_acceleration` stands on a bridge across lost samples, shape (n,)."""
    roles = [role for role in TRAVEL_ROLES if role in signals.series]
    return np.asarray(np.any([np.isnan(signals.series[role]) for role in roles], axis=0))


def bridged_kicks(signals: Signals, acceleration: Array) -> tuple[float, ...]:
    """Instants from which on the velocity by the accelerometers may be wrong, because samples were bridged.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Acceleration of `travel_acceleration`.

    Returns
    -------
    tuple of float
        The middles of the worst gaps that matter, at most `MOST_KICKS`, in order.
    """
    gaps = bridge_errors(acceleration, bridged_samples(signals), signals.step_s)
    worst = sorted((g for g in gaps if g.error * g.duration_s > LEAST_KICK_M_S), key=lambda g: -g.error * g.duration_s)
    return tuple(sorted(signals.start_s + g.start_s + 0.5 * g.duration_s for g in worst[:MOST_KICKS]))


def fused_motion(
    signals: Signals,
    acceleration: Array,
    camera: Channel | None,
    alignment: ClockAlignment | None,
    along: Array | None = None,
) -> FusedMotion | None:
    """Fuse the camera's displacement with the accelerometers' on the grid, in the camera's scale.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Second derivative of what the camera sees by the accelerometers; lost samples bridged.
    camera
        Displacement, without the delay of its chain.
    alignment
        Alignment of the camera's clock. The noise levels are those that an alignment by motion found; otherwise they
        are estimated from the track's third differences, and from the pre-trigger baseline and the likelihood.
    along : ndarray, shape (n,), optional
        Second derivative of the travel along the tipping part, if the camera sees another.

    Returns
    -------
    FusedMotion or None
        Recoil by both sensors; None where there is no camera, its clock could not be aligned, or it saw too little of
        the motion.
    """
    if camera is None or alignment is None or alignment.status == "failed":
        return None
    details = alignment.details or {}
    seen = camera.measured
    sigma = float(details.get("marker_sigma_m", noise_sigma(seen)))
    density = details.get("acceleration_density") or [
        inflation * acceleration_noise(signals, acceleration) ** 2 * signals.step_s for inflation in INFLATIONS
    ]
    if not sigma > 0:
        return None
    fused = fuse(
        alignment.to_reference(camera.time_base.times_s),
        seen,
        signals.start_s,
        signals.step_s,
        acceleration,
        marker_sigma_m=sigma,
        acceleration_density=density,
        u_offset_s=alignment.u_offset_s,
        u_drift=alignment.u_drift,
        bridged=bridged_samples(signals),
    )
    if isinstance(fused, str):
        return None
    if along is None:
        return fused
    # the mechanism as a whole rests until the shot
    carried = integrate((along - acceleration) * (signals.times_s >= signals.onset_s), signals.step_s)
    return replace(
        fused,
        position_m=fused.position_m + integrate(carried, signals.step_s),
        velocity_m_s=fused.velocity_m_s + carried,
    )


def _position(rig: Rig, role: str) -> tuple[float, float]:
    """Return where the sensor of a role sits, m; the origin where there is none."""
    spec = rig.by_role(role)
    return (0.0, 0.0) if spec is None else spec.sensor.position


def acceleration_noise(signals: Signals, acceleration: Array) -> float:
    """Return the noise per sample of an acceleration on the grid, m/s^2, by its pre-trigger baseline if it has one.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
    """
    baseline = acceleration[signals.in_baseline]
    sigma = float(np.std(baseline)) if baseline.size >= LEAST_REST_SAMPLES else noise_sigma(acceleration)
    return max(sigma, LEAST_NOISE_M_S2)


def _relative(mechanism: Mechanism, inertial: Array, travel: Array, motion: AngularMotion) -> Array:
    return mechanism.travel_acceleration(
        inertial, travel, motion.w2, motion.dw2, motion.f_x, motion.f_y, motion.beta,
        w1=motion.w1, dw1=motion.dw1, r_x=motion.r_x, r_y=motion.r_y,
    )  # fmt: skip
