"""The motion as a camera that was aligned by it and the accelerometers recorded it together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.motion_alignment import INFLATIONS
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.scale_and_zero import CameraMotion, camera_motion
from recoil_processing.shot.signals import Signals


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Motion by a camera, beside the accelerometers.

    Attributes
    ----------
    motion
        Motion on the grid of the signals.
    densities
        Densities of the accelerometer's noise that are tried, (m/s^2)^2/Hz, two-sided.
    u_rel
        Relative standard uncertainty of the camera's own scale.
    clock
        The camera's.
    drift, u_rate
        Drift by which its frames lie on the reference clock, and the standard uncertainty of one before they were seen.
    """

    motion: CameraMotion
    densities: tuple[float, ...]
    u_rel: float
    clock: str
    drift: float
    u_rate: float


def motion_fit(alignment: ClockAlignment | None) -> Mapping[str, Any] | None:
    """Return the details of a camera's clock that was found by the motion without doubt, with its accelerometer's zero.

    None if it was found in another way.
    """
    details = None if alignment is None or alignment.status != "ok" else alignment.details
    return details if details and "u_bias_m_s2" in details else None


def recorded_motion(
    signals: Signals, acceleration_m_s2: Array, camera: Channel | None, alignment: ClockAlignment | None
) -> RecordedMotion | None:
    """Return the motion as camera and accelerometers recorded it; None unless the camera was aligned by motion.

    Parameters
    ----------
    acceleration_m_s2 : ndarray, shape (n,)
        Second derivative of the travel by the accelerometers, on the grid.
    camera
        Displacement, without the delay of its chain.
    """
    d = motion_fit(alignment)
    if camera is None or alignment is None or d is None:
        return None
    integral = DoubleIntegral.of(acceleration_m_s2, signals.start_s, signals.step_s)
    motion = camera_motion(
        alignment.to_reference(camera.time_base.times_s),
        camera.measured,
        integral,
        gain=d["gain"],
        marker_sigma_m=d["marker_sigma_m"],
        u_offset_s=alignment.u_offset_s,
        u_bias_m_s2=math.inf,  # the pre-trigger baseline has its say where the mass is found
    )
    quietest = d["acceleration_density"] / d["noise_inflation"]
    densities = tuple(quietest * inflation for inflation in INFLATIONS)
    u_rate = float(d["drift_allowance"])
    return RecordedMotion(motion, densities, camera.u_rel, alignment.clock, alignment.drift, u_rate)
