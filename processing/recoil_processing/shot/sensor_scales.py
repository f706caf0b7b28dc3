"""Scales that the mass hangs on, as the rig states them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from recoil_rigs.rig import Rig


@dataclass(frozen=True)
class ScaleUncertainty:
    """Standard uncertainties of what the scale of the mass hangs on.

    Attributes
    ----------
    acceleration
        Of the accelerometer's sensitivity, relative.
    gauges
        Of breech, brake and recuperator force, gauge and area together, relative.
    friction_n
        Of the packing friction, N: absolute, because a friction that is declared as zero may have one.
    """

    acceleration: float
    gauges: tuple[float, float, float]
    friction_n: float


def scale_uncertainty(rig: Rig) -> ScaleUncertainty:
    """Collect the standard uncertainties of the sensors' scales, areas included, and of the friction."""
    m = rig.mechanism

    def gauge(role: str, area: str) -> float:
        spec = rig.by_role(role)
        return math.hypot(spec.sensor.u_rel if spec else 0.0, m.u.get(area, 0.0) / getattr(m, area))

    accelerometer = rig.by_role("recoil_acceleration")
    return ScaleUncertainty(
        accelerometer.sensor.u_rel if accelerometer else 0.0,
        (
            gauge("breech_pressure", "bore_area"),
            gauge("brake_pressure", "brake_area"),
            gauge("recuperator_pressure", "recuperator_area"),
        ),
        m.u.get("friction", 0.0),
    )
