"""The recoiling part's acceleration by the two routes of the model, and its travel.

The inertial route takes the accelerometer on the recoiling part; the kinematic route takes the
camera's displacement twice differentiated, with the carriage's accelerometers and the gyros. The two
share no sensor that matters, so they check one another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.shot import ClockAlignment
from identification.signals import Signals, on_grid
from processing.filters import LowPass
from processing.fusion import smooth_walk
from processing.gaps import bridge
from processing.motion_alignment import integrate
from rigs.mechanism import (
    Mechanism,
    relative_acceleration,
    specific_acceleration_inertial,
    specific_acceleration_kinematic,
)
from rigs.rig import Rig

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ANGULAR_CUTOFF_HZ = 150.0
"""Low-pass of the angular rates before they are differentiated for the lever arms, which are small terms."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Angular motion on the grid, SI; zero where it was not measured.

    Attributes
    ----------
    w1, w2 : ndarray, shape (n,)
        Angular rates of carriage and tipping part.
    dw1, dw2 : ndarray, shape (n,)
        Their derivatives.
    beta : ndarray, shape (n,)
        Rotation of the tipping part relative to the carriage since rest.
    f_x, f_y : ndarray, shape (n,)
        Specific force of the carriage in its own axes.
    r_x, r_y : float
        Where the carriage's accelerometers sit, from A.
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


def turning(signals: Signals, rig: Rig) -> Turning:
    """Collect the angular motion and the carriage's specific force; gaps are bridged for these small terms."""
    mechanism = rig.mechanism
    low_pass = LowPass(min(ANGULAR_CUTOFF_HZ, 0.1 * signals.rate_hz))
    w1, w2 = (bridge(signals.get(role), otherwise=0.0) for role in ("carriage_rate", "tipping_rate"))
    smooth1, smooth2 = low_pass.apply(w1, signals.rate_hz), low_pass.apply(w2, signals.rate_hz)
    if "tipping_rate" not in signals.series:
        smooth2 = smooth1
    spec = rig.by_role("carriage_acceleration_x")
    r_x, r_y = spec.sensor.position if spec is not None else (0.0, 0.0)
    return Turning(
        w1=smooth1,
        w2=smooth2,
        dw1=np.gradient(smooth1, signals.step_s),
        dw2=np.gradient(smooth2, signals.step_s),
        beta=integrate(smooth2 - smooth1, signals.step_s),
        f_x=bridge(signals.get("carriage_acceleration_x", mechanism.g * np.sin(mechanism.phi10)), otherwise=0.0),
        f_y=bridge(signals.get("carriage_acceleration_y", mechanism.g * np.cos(mechanism.phi10)), otherwise=0.0),
        r_x=r_x,
        r_y=r_y,
    )


def inertial_acceleration(signals: Signals, rig: Rig, motion: Turning) -> Array:
    """Return a' of equation (36) by the accelerometer on the recoiling part, m/s^2, shape (n,); NaN where lost."""
    spec = rig.by_role("recoil_acceleration")
    r5, r6 = spec.sensor.position if spec is not None else (0.0, 0.0)
    return specific_acceleration_inertial(signals.series["recoil_acceleration"], motion.w2, motion.dw2, r5, r6)


def travel_acceleration(signals: Signals, rig: Rig, motion: Turning) -> Array:
    """X'' by the accelerometers, m/s^2, shape (n,): what a camera on the tipping part would see.

    The travel that it needs itself, in the small centripetal term, is its own double integral.
    """
    inertial = bridge(inertial_acceleration(signals, rig, motion), otherwise=0.0)
    travel = np.zeros_like(inertial)
    for _ in range(2):
        acceleration = _relative(rig.mechanism, inertial, travel, motion)
        travel = integrate(integrate(acceleration, signals.step_s), signals.step_s)
    return acceleration


def kinematic_acceleration(
    signals: Signals, rig: Rig, motion: Turning, camera: Channel, alignment: ClockAlignment, low_pass: LowPass
) -> tuple[Array, Flags]:
    """Return a' of equation (36) by the camera, already low-pass filtered, and where it can be trusted.

    Parameters
    ----------
    signals, rig, motion
    camera : Channel
        Displacement on its own clock.
    alignment : ClockAlignment
        Of that clock.
    low_pass : LowPass
        The filter of the regression; a displacement can only be differentiated behind it.

    Returns
    -------
    acceleration : ndarray, shape (n,)
    trusted : ndarray of bool, shape (n,)
        False near lost frames and beyond the track's ends.
    """
    raw = on_grid(camera, alignment, signals.times_s, 0.0)
    travel, trusted = low_pass.apply_with_gaps(raw, signals.rate_hz)
    ddx = np.gradient(np.gradient(travel, signals.step_s), signals.step_s)
    smooth = [low_pass.apply(f, signals.rate_hz) for f in (motion.f_x, motion.f_y)]
    acceleration = specific_acceleration_kinematic(
        rig.mechanism, ddx, travel, motion.w2, motion.dw2, smooth[0], smooth[1], motion.beta,
        w1=motion.w1, dw1=motion.dw1, r_x=motion.r_x, r_y=motion.r_y,
    )  # fmt: skip
    return acceleration, trusted


def travel_and_velocity(
    signals: Signals, acceleration: Array, camera: Channel | None, alignment: ClockAlignment | None
) -> tuple[Array, Array]:
    """Travel and velocity of recoil on the grid, m and m/s, shape (n,) each.

    The accelerometers' integrals; where a camera was aligned by motion, in its scale, with its
    integration constants, and with what the accelerometers' noise did to the integrals taken off.
    """
    velocity = integrate(acceleration, signals.step_s)
    travel = integrate(velocity, signals.step_s)
    details = None if alignment is None or alignment.status == "failed" else alignment.details
    if camera is None or alignment is None or not details or "integration_constants" not in details:
        return travel, velocity
    c0, c1, c2 = details["integration_constants"]
    t = alignment.to_source(signals.times_s) - details["origin_s"]
    travel = details["gain"] * travel + c0 + c1 * t + 0.5 * c2 * t**2
    velocity = details["gain"] * velocity + c1 + c2 * t
    frames = alignment.to_reference(camera.time_base.times_s)
    seen = np.asarray(camera.samples, dtype=np.float64)
    inside = (frames >= signals.times_s[0]) & (frames <= signals.times_s[-1])
    residual = np.where(inside, seen - np.interp(frames, signals.times_s, travel), np.nan)
    walk = smooth_walk(frames, residual, details["marker_sigma_m"] ** 2, details["acceleration_density"])
    drifted, rate = walk.at(signals.times_s)
    return travel + drifted, velocity + rate


def _relative(mechanism: Mechanism, inertial: Array, travel: Array, motion: Turning) -> Array:
    return relative_acceleration(
        mechanism, inertial, travel, motion.w2, motion.dw2, motion.f_x, motion.f_y, motion.beta,
        w1=motion.w1, dw1=motion.dw1, r_x=motion.r_x, r_y=motion.r_y,
    )  # fmt: skip
