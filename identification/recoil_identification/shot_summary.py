"""A shot's own information on mass and scales, for what combines many shots of a rig.

The likelihood of a shot about what other shots share is kept as a triangle, without any certificate in it, so that
each certificate counts once however many shots there are. What is the shot's alone, its zeros, its clocks and the
alignment of its camera, is taken out by an orthogonal reduction: the shot's own columns first, and what is left below
them is about the shared ones (G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification import equation_of_motion as motion
from recoil_identification.calibration import Calibration
from recoil_identification.camera_rows import OTHER
from recoil_identification.inference.unknown import Prior
from recoil_identification.mass import FRICTION, GAUGES
from recoil_identification.sensor_priors import CAMERA_SCALE, DISTORTIONS, RELEASE
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.sensor_scales import of_gauge
from recoil_rigs.assumptions import AREAS
from recoil_rigs.rig import Rig

Array = NDArray[np.float64]

SCHEMA = 1


@dataclass(frozen=True)
class Parameter:
    """One of the shared unknowns.

    Attributes
    ----------
    influences
        What it may be off by, each with its identity and its standard uncertainty in the parameter's own unit: two
        shots, and two campaigns, that name the same identity share the same error.
    """

    name: str
    influences: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class ShotSummary(ReadOnlyArrays):
    """What a shot says of the shared unknowns: ``|R (x - reference) - y|^2``.

    Attributes
    ----------
    reference : ndarray, shape (n,)
        The logarithm of the mass in kg first, scales as logarithms, the friction that is declared too large as a share
        of what is declared (in N where none is), the release beyond what is expected in its standard uncertainties.
    triangle : ndarray, shape (n, n)
        R. It is singular: a common factor of mass and forces changes no row.
    seen : ndarray, shape (n,)
        y.
    """

    parameters: tuple[Parameter, ...]
    reference: Array
    triangle: Array
    seen: Array

    def to_json(self, *, cutoff_hz: float | None, zero_shift: bool) -> dict[str, Any]:
        """Return it as the report has it."""
        return {
            "schema": SCHEMA,
            "parameters": [
                {"name": one.name, "influences": [list(influence) for influence in one.influences]}
                for one in self.parameters
            ],
            "reference": self.reference.tolist(),
            "R": self.triangle.tolist(),
            "y": self.seen.tolist(),
            # relative standard uncertainty of the mass that no column holds: there is nothing without one
            "own_u_rel": 0.0,
            "cutoff_hz": cutoff_hz,
            "zero_shift": zero_shift,
        }


def shot_summary(calibration: Calibration, rig: Rig) -> ShotSummary:
    """Summarise a shot."""
    inferred, regression = calibration.inferred, calibration.block.regression
    friction_n, u_release_m_s = rig.mechanism.friction, regression.u_release_n_s / calibration.m0_kg
    gauges = zip(motion.GAUGES, PRESSURE_ROLES, AREAS, strict=True)
    stated = {
        motion.MASS: (Parameter("ln mass"), 1.0),
        **{gauge: (Parameter(gauge.name, _gauge(rig, role, area)), 1.0) for gauge, role, area in gauges},
        motion.FRICTION: (Parameter("friction share" if friction_n else "friction", _friction(rig)), friction_n or 1.0),
        motion.ACCELERATION: (Parameter("ln recoil_acceleration", _scale(rig, "recoil_acceleration")), 1.0),
        motion.RELEASE: (Parameter("release"), u_release_m_s),
        motion.CAMERA: (Parameter("ln camera", _scale(rig, "recoil_displacement")), 1.0),
    }
    own = list(calibration.own)
    if not u_release_m_s:  # nothing was given at the release
        del stated[motion.RELEASE]
        own.append(Prior.of("release", motion.RELEASE.name, 0.0))
    shared = [unknown for unknown in inferred.unknowns if unknown.scope != "shot" and unknown in stated]
    names = [unknown.name for unknown in shared]
    triangle, seen = inferred.about(names, own)
    units = np.array([stated[unknown][1] for unknown in shared])
    reference = np.array([inferred.value(name) for name in names]) / units
    reference[0] += math.log(calibration.m0_kg)
    if u_release_m_s:  # counted from what is expected of it, so that its prior is zero as the others' are
        reference[names.index(motion.RELEASE.name)] -= regression.release_n_s / regression.u_release_n_s
    return ShotSummary(
        parameters=tuple(stated[unknown][0] for unknown in shared),
        reference=reference,
        triangle=triangle * units,
        seen=seen,
    )


def scopes_of(rig: Rig) -> dict[str, str]:
    """Return what shares each source of a budget, a sensor or all shots of the rig; the others are a shot's own."""
    standards = (f"standard {channel.sensor.reference}" for channel in rig.channels if channel.sensor.reference)
    of_rig = (FRICTION, RELEASE, OTHER.name, "bore_friction", *AREAS, *DISTORTIONS, *standards)
    scopes = dict.fromkeys(of_rig, "rig")
    of_roles = {"recoil_displacement": CAMERA_SCALE, **dict(zip(PRESSURE_ROLES, GAUGES, strict=True))}
    for channel in (one for one in rig.channels if one.role):
        several = len(rig.with_role(channel.role)) > 1
        sources = {of_gauge(channel.name)} if several else {f"{channel.role} sensitivity"}
        sources |= {of_roles[channel.role]} if channel.role in of_roles and not several else set()
        scopes |= dict.fromkeys(sources, f"sensor {channel.sensor.serial or f'{rig.name}/{channel.name}'}")
    return scopes


def _scale(rig: Rig, role: str) -> tuple[tuple[str, float], ...]:
    """Return what the scale of a role may be off by; of the mean of several gauges each has its part."""
    channels = rig.with_role(role)
    found: dict[str, float] = {}
    for channel in channels:
        sensor = channel.sensor
        calibrated = "" if sensor.calibrated is None else f":{sensor.calibrated.isoformat()}"
        # without a serial number a sensor is known by its place
        identity = sensor.serial or f"{rig.name}/{channel.name}"
        own = math.sqrt(sensor.u_rel**2 - sensor.u_reference_rel**2)
        found[f"sensor:{role}:{identity}{calibrated}"] = own / len(channels)
        if sensor.u_reference_rel:
            name = f"standard:{sensor.reference}"
            found[name] = found.get(name, 0.0) + sensor.u_reference_rel / len(channels)
    return tuple(found.items())


def _gauge(rig: Rig, role: str, area: str) -> tuple[tuple[str, float], ...]:
    u_area = rig.mechanism.u.get(area, 0.0) / getattr(rig.mechanism, area)
    of_bore = role == "breech_pressure" and rig.mechanism.u_bore_friction_rel
    bore = ((f"rig:{rig.name}:bore_friction", rig.mechanism.u_bore_friction_rel),) if of_bore else ()
    return (*_scale(rig, role), (f"rig:{rig.name}:{area}", u_area), *bore)


def _friction(rig: Rig) -> tuple[tuple[str, float], ...]:
    u_friction, friction_n = rig.mechanism.u.get("friction", 0.0), rig.mechanism.friction
    return ((f"rig:{rig.name}:friction", u_friction / (friction_n or 1.0)),)
