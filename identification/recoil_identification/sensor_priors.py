"""What is known of the sensors besides the shot's rows: certificates, the pre-trigger baseline, the camera.

Each is a prior of the unknowns of `recoil_identification.equation_of_motion`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification import equation_of_motion as motion
from recoil_identification.inference.unknown import Prior
from recoil_identification.mass import ACCELERATION, FRICTION, GAUGES
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.assumptions import AREAS

Array = NDArray[np.float64]

ZERO = "recoil_acceleration zero"
RELEASE = "release from the battery stop"
CAMERA_SCALE = "camera scale"
CAMERA_GAIN = "gain of the camera's alignment"
CAMERA_ZERO = "camera zero of the acceleration"
CAMERA_SHIFT = "camera shift of the acceleration's zero"
"""Names of the further budget rows."""

DISTORTIONS = ("bow of the camera's picture", "S of the camera's picture")
"""Names of the distortions' sizes, and of their budget rows, m."""
LEAST_OWN = 1e-9
"""Of a sensor's scale, relative, where its certificate leaves nothing beside its standard and its area."""
LEAST_OWN_SHARE = 1e-6
"""Of a variance of the camera's fit, that is its own and not shared with the others: rounding must not take it away."""


@dataclass(frozen=True, eq=False)
class CameraScale(ReadOnlyArrays):
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
    by_distortion : ndarray, shape (2 + n_shifts, n_distortions)
        What a meter of each shape of distortion adds to these estimates.
    u_distortion_m
        Standard uncertainty of the first shape; half of it is that of the next.
    """

    gain: float
    zeros_m_s2: Array
    covariance: Array
    u_rel: float
    kick: int | None = None
    by_distortion: Array = field(default_factory=lambda: np.zeros((0, 0)))
    u_distortion_m: float = 0.0

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

    def alignment(self) -> Prior:
        """Return what its alignment says of the accelerometer's scale and zeros, in its own scale.

        With the errors ka and al of both scales the alignment finds ``ln gain = ka - al``.
        """
        shapes = range(self.zeros_m_s2.size - 1)
        covariance = self.covariance.copy()
        covariance[0] /= -self.gain
        covariance[:, 0] /= -self.gain
        covariance[np.diag_indices_from(covariance)] *= 1.0 + LEAST_OWN_SHARE
        rows = np.eye(covariance.shape[0], covariance.shape[0] + 1)
        rows[0, -1] = -1.0
        bent = self.by_distortion.copy()
        if self.distortions:
            bent[0] /= -self.gain
            rows = np.column_stack([rows, bent])
        return Prior(
            (CAMERA_GAIN, CAMERA_ZERO, *(f"{CAMERA_SHIFT} {i + 1}" for i in shapes)),
            (
                *(motion.ACCELERATION.name, motion.ZERO.name),
                *(motion.shift(i).name for i in shapes),
                motion.CAMERA.name,
                *(prior.unknowns[0] for prior in self.distortions),
            ),
            rows,
            np.append(-math.log(self.gain), self.zeros_m_s2),
            covariance,
        )

    @property
    def priors(self) -> list[Prior]:
        """What the camera alone says: its alignment, and how far its picture may be bent."""
        return [self.alignment(), *self.distortions]

    @property
    def distortions(self) -> list[Prior]:
        """Return what is known of the sizes of its distortion."""
        if not (self.by_distortion.size and self.u_distortion_m > 0):
            return []
        return [
            Prior.of(name, name, self.u_distortion_m / 2**number)
            for number, name in enumerate(DISTORTIONS[: self.by_distortion.shape[1]])
        ]

    def unit(self, source: str) -> str:
        """Return the unit of one of the sources of `alignment`."""
        if source == CAMERA_GAIN:
            return "1"
        return "m/s" if self.kick is not None and source == f"{CAMERA_SHIFT} {self.kick + 1}" else "m/s^2"


def certificates(scales: ScaleUncertainty, release: Prior, u_camera_rel: float | None) -> list[Prior]:
    """Return what other shots know as well: the sensors' scales, the friction, and how the stop lets go.

    A scale of which a part is an area's or a standard's is off by that part and by the sensor's own: the part is an
    unknown beside the scales, one for all sensors that share it.
    """
    of_roles = [
        *zip(GAUGES, PRESSURE_ROLES, motion.GAUGES, scales.gauges, strict=True),
        (ACCELERATION, "recoil_acceleration", motion.ACCELERATION, scales.acceleration),
    ]
    if u_camera_rel is not None:
        of_roles.append((CAMERA_SCALE, "recoil_displacement", motion.CAMERA, u_camera_rel))
    of_scales: list[Prior] = []
    parts: dict[str, float] = {}
    for source, role, scale, u in of_roles:
        listed = scales.parts.get(role, ())
        parts |= dict(listed)
        if not listed:
            of_scales.append(Prior.of(source, scale.name, u))
            continue
        own = math.sqrt(max(u**2 - math.fsum(part**2 for _, part in listed), LEAST_OWN**2))
        # an area that is listed has a row of its own
        own_source = source.removesuffix(" and area") if any(name in AREAS for name, _ in listed) else source
        names = (scale.name, *(f"ln {name}" for name, _ in listed))
        rows = np.array([[1.0, *(-1.0 for _ in listed)]])
        of_scales.append(Prior((own_source,), names, rows, np.zeros(1), np.array([[own**2]])))
    return [
        *of_scales[:3],
        Prior.of(FRICTION, motion.FRICTION.name, scales.friction_n),
        of_scales[3],
        release,
        *of_scales[4:],
        *(Prior.of(name, f"ln {name}", u) for name, u in parts.items()),
    ]
