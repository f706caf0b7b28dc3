"""What is known of the sensors besides the shot's rows: calibrations, the silence before the shot, the camera.

Each is an observation of the unknowns of `recoil_identification.calibration`: mass, three gauges, friction,
accelerometer, its zero, the release, and the shapes in which the zero may have shifted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recoil_identification.mass import ACCELERATION, FRICTION, GAUGES
from recoil_processing.shot.sensor_scales import ScaleUncertainty

Array = NDArray[np.float64]

ZERO = "recoil_acceleration zero"
RELEASE = "release from the battery stop"
CAMERA_SCALE = "camera scale"
CAMERA_ZERO = "camera zero of the acceleration"
CAMERA_SHIFT = "camera shift of the acceleration's zero"
"""Names of the further budget rows."""

MASS, GAUGE, FRICTION_ERROR, SENSITIVITY, BIAS, RELEASE_VELOCITY = 0, slice(1, 4), 4, 5, 6, 7
"""Where the unknowns stand."""
UNKNOWNS = 8
"""How many there are without shapes of a shifted zero."""

SMALLEST_U = 1e-9
"""In the place of a standard uncertainty of zero: what is exactly known must not divide by it."""


@dataclass(frozen=True, eq=False)
class CameraScale:
    """What the camera says of the accelerometer.

    Attributes
    ----------
    gain
        Camera's scale over the accelerometer's.
    zeros_m_s2 : ndarray, shape (1 + n_shifts,)
        By how much the accelerometer reads too high throughout, and the size of each shape in which its zero
        shifted, in its own scale.
    covariance : ndarray, shape (2 + n_shifts, 2 + n_shifts)
        Of these estimates, the gain's first, by the fit of the displacement alone.
    u_rel
        Relative standard uncertainty of the camera's own scale.
    kick
        Which of the shapes, if any, is an impulse: its size is in m/s.
    """

    gain: float
    zeros_m_s2: Array
    covariance: Array
    u_rel: float
    kick: int | None = None

    @classmethod
    def of_constant(
        cls, gain: float, u_gain: float, constant_m_s2: float, u_constant_m_s2: float, correlation: float, u_rel: float
    ) -> CameraScale:
        """Take gain and constant of an alignment by motion: the constant is the gain times what the zero lacks.

        Parameters
        ----------
        constant_m_s2, u_constant_m_s2
            Constant acceleration in the camera's scale that the accelerometer lacks.
        correlation
            Of these two estimates.
        """
        own = correlation * u_gain * u_constant_m_s2
        change = np.array([[1.0, 0.0], [constant_m_s2 / gain**2, -1.0 / gain]])
        covariance = change @ np.array([[u_gain**2, own], [own, u_constant_m_s2**2]]) @ change.T
        return cls(gain, np.array([-constant_m_s2 / gain]), covariance, u_rel)


class Observation(NamedTuple):
    """What is known besides the shot's rows.

    The unknowns weighted by ``row`` were seen as ``value`` with standard uncertainty ``u``. If the source
    reads high by one ``unit``, the value is by that much below what the unknowns then are: the value of
    a calibration stays 0 while the sensor's error is 1.
    """

    source: str
    row: Array
    value: float
    u: float
    unit: str


def observations_of(
    scales: ScaleUncertainty, u_bias_m_s2: float, u_release_m_s: float, camera: CameraScale | None, shifts: int
) -> list[Observation]:
    """Return calibrations, the silence before the shot, the release and the camera as observations of the unknowns."""
    only = np.eye(UNKNOWNS + shifts)
    observations = [
        Observation(source, only[1 + j], 0.0, max(u, SMALLEST_U), "1")
        for j, (source, u) in enumerate(zip(GAUGES, scales.gauges, strict=True))
    ]
    observations.append(Observation(FRICTION, only[FRICTION_ERROR], 0.0, max(scales.friction_n, SMALLEST_U), "N"))
    u_acceleration = max(scales.acceleration, SMALLEST_U)
    observations.append(Observation(ACCELERATION, only[SENSITIVITY], 0.0, u_acceleration, "1"))
    if math.isfinite(u_bias_m_s2):
        observations.append(Observation(ZERO, only[BIAS], 0.0, max(u_bias_m_s2, SMALLEST_U), "m/s^2"))
    observations.append(Observation(RELEASE, only[RELEASE_VELOCITY], 0.0, max(u_release_m_s, SMALLEST_U), "m/s"))
    if camera is not None:
        observations += _by_camera(camera, shifts)
    return observations


def _by_camera(camera: CameraScale, shifts: int) -> list[Observation]:
    """Return the camera's observations, made independent of one another.

    With the camera's own scale error dc the fit finds ``gain = (1 + dc) / (1 + da)``, so that ``1 / gain - 1``
    is da less dc. The errors of the fit's estimates are correlated; from each observation the part is taken off
    that those before it tell of it.
    """
    values = np.append(1.0 / camera.gain - 1.0, camera.zeros_m_s2)
    covariance = np.array(camera.covariance)
    covariance[0, 0] += (camera.u_rel * camera.gain) ** 2
    covariance[0] /= -(camera.gain**2)
    covariance[:, 0] /= -(camera.gain**2)
    seen = np.zeros((values.size, UNKNOWNS + shifts))
    seen[0, SENSITIVITY] = seen[1, BIAS] = 1.0
    for j in range(2, values.size):
        seen[j, UNKNOWNS + j - 2] = 1.0
    observations = []
    for i in range(values.size):
        told = np.linalg.lstsq(covariance[:i, :i], covariance[:i, i], rcond=None)[0] if i else np.zeros(0)
        variance = max(float(covariance[i, i] - told @ covariance[:i, i]), 1e-6 * float(covariance[i, i]))
        name = (CAMERA_SCALE, CAMERA_ZERO)[i] if i < 2 else f"{CAMERA_SHIFT} {i - 1}"
        row, value = seen[i] - told @ seen[:i], float(values[i] - told @ values[:i])
        unit = "1" if i == 0 else "m/s" if camera.kick is not None and i == 2 + camera.kick else "m/s^2"
        observations.append(Observation(name, row, value, max(math.sqrt(variance), SMALLEST_U), unit))
    return observations
