"""Priors of the sensors besides the shot's rows: certificates, the pre-trigger baseline, the camera.

Each is a prior of the unknowns of `recoil_identification.rows.equation_of_motion`.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_identification.estimate.mass import FRICTION, force_scale, motion_scale
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import ScaleUncertainty

ZERO = ErrorSource(SourceKind.ZERO, "recoil_acceleration")
RELEASE = ErrorSource(SourceKind.RELEASE)
CAMERA_SCALE = ErrorSource(SourceKind.CAMERA_SCALE)
"""Sources of the further budget rows."""

LEAST_OWN = 1e-9
"""Least uncertainty of a sensor's scale, relative, where its certificate leaves nothing beside its standard and its
area."""


def part_of_scale(part: ErrorSource) -> Unknown:
    """Return what a scale may be off by beside its sensor: an area, a standard, a pulse, or one of several gauges.

    Parameters
    ----------
    part
        One of `recoil_processing.shot.sensor_scales.ScaleUncertainty.parts`.
    """
    of_sensor = part.kind in (SourceKind.SENSITIVITY, SourceKind.DYNAMIC_SCALE)
    return Unknown(f"ln {part}", scope="sensor" if of_sensor else "rig")


def parts_of_scales(scales: ScaleUncertainty) -> tuple[Unknown, ...]:
    """Return the unknowns of all parts of a rig's scales, each once."""
    parts = dict.fromkeys(part for listed in scales.parts.values() for part, _ in listed)
    return tuple(part_of_scale(part) for part in parts)


def certificates(
    scales: ScaleUncertainty, release: Prior, u_camera_rel: float | None, *, accelerometer: bool = True
) -> list[Prior]:
    """Return what other shots know as well: the sensors' scales, the friction, and how the stop lets go.

    A scale of which a part is an area's or a standard's is off by that part and by the sensor's own: the part is an
    unknown beside the scales, one for all sensors that share it.
    """
    count = len(scales.forces)
    of_roles = [
        (force_scale(name), name, motion.gauge(name), u) for name, u in zip(scales.forces, scales.gauges, strict=True)
    ]
    if accelerometer:
        role = scales.motion_role
        of_roles.append((motion_scale(role), role, motion.scale_of(role), scales.acceleration))
    if u_camera_rel is not None:
        of_roles.append((CAMERA_SCALE, "recoil_displacement", motion.CAMERA, u_camera_rel))
    of_scales: list[Prior] = []
    parts: dict[ErrorSource, float] = {}
    for source, role, scale, u in of_roles:
        listed = scales.parts.get(role, ())
        parts |= dict(listed)
        if not listed:
            of_scales.append(Prior.of(source, scale.name, u))
            continue
        own = math.sqrt(max(u**2 - math.fsum(part**2 for _, part in listed), LEAST_OWN**2))
        # an area that is listed has a row of its own
        with_area = any(part.kind is SourceKind.AREA for part, _ in listed)
        own_source = ErrorSource(SourceKind.SENSITIVITY, role) if with_area else source
        names = (scale.name, *(part_of_scale(part).name for part, _ in listed))
        rows = np.array([[1.0, *(-1.0 for _ in listed)]])
        of_scales.append(Prior((own_source,), names, rows, np.zeros(1), np.array([[own**2]])))
    return [
        *of_scales[:count],
        Prior.of(FRICTION, motion.FRICTION.name, scales.friction_n),
        *of_scales[count : count + 1],
        release,
        *of_scales[count + 1 :],
        *(Prior.of(part, part_of_scale(part).name, u) for part, u in parts.items()),
    ]
