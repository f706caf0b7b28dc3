"""The supports of the mechanism: elevating gear, and ground at C and D, each with load, deflection and contact.

::

    elevating gear   M_C beyond rest            beta, beta'
    ground, along    N_Cxi + friction at D      xi, xi', and N_D in the direction of sliding (coefficient f)
    ground at C      N_Ceta beyond rest         eta, eta'
    ground at D      N_D beyond rest            eta_D = eta + L (sin phi1 - sin phi10), eta_D'

Moment and vertical balance tell the loads on C and D apart. A ground pushes and does not pull: a foot whose
load falls to nothing has lifted off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.targets.stiffness.carriage_record import CarriageRecord
from recoil_identification.targets.stiffness.mechanism_loads import (
    SLIDING_M_S,
    foot_displacement,
    loads_of,
    rest_loads,
    state_of,
)
from recoil_identification.targets.stiffness.support_filter import Support
from recoil_processing.filters import LowPass
from recoil_rigs.mechanism.model import Mechanism

CONTACT_SHARE = 0.06
"""Share of the load at rest below which a foot counts as lifted off."""
CONTACT_HZ = 80.0
"""Low-pass of the load that tells contact."""

PARAMETERS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "elevating": ("k_elevating", "c_elevating"),
        "ground_x": ("k_ground_x", "c_ground_x", "friction_d"),
        "ground_c": ("k_ground_c", "c_ground_c"),
        "ground_d": ("k_ground_d", "c_ground_d"),
    }
)
"""Support -> symbols of its parameters, in the order of its columns."""
SUPPORT_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "elevating": "elevating gear",
        "ground_x": "ground, horizontal",
        "ground_c": "ground at C, vertical",
        "ground_d": "ground at D, vertical",
    }
)
"""Support -> its name in words."""


@dataclass(frozen=True)
class Assumptions:
    """Assumptions about the ground where nothing measures it.

    Attributes
    ----------
    contact_share
        See `CONTACT_SHARE`.
    sliding_m_s
        See `recoil_identification.targets.stiffness.mechanism_loads.SLIDING_M_S`.
    """

    contact_share: float = CONTACT_SHARE
    sliding_m_s: float = SLIDING_M_S


def supports_of(
    record: CarriageRecord, mechanism: Mechanism, assumptions: Assumptions | None = None
) -> dict[str, Support]:
    """Find loads and deflections of all supports.

    Returns
    -------
    dict of str to Support
        Keys of `PARAMETERS`.
    """
    a = assumptions if assumptions is not None else Assumptions()
    motion = record.motion(mechanism)
    state = state_of(mechanism, motion)
    loads = loads_of(mechanism, state, motion.breech_force_n, a.sliding_m_s)
    rest = rest_loads(mechanism)
    rise, rising = foot_displacement(mechanism, state)
    everywhere = np.ones_like(record.times_s)
    rest_c, rest_d = float(rest.ground_c_n[0]), float(rest.ground_d_n[0])

    def support(name: str, load: Array, columns: tuple[Array, ...], contact: Array) -> Support:
        return Support(name, record.times_s, load, dict(zip(PARAMETERS[name], columns, strict=True)), contact)

    def bearing(load: Array, at_rest: float) -> Array:
        smooth = LowPass(min(CONTACT_HZ, 0.2 / record.step_s)).apply(load, 1.0 / record.step_s)
        return (smooth < a.contact_share * at_rest).astype(np.float64)

    return {
        "elevating": support(
            "elevating",
            loads.elevating_moment_n_m - float(rest.elevating_moment_n_m[0]),
            (state.q[:, 3], state.qd[:, 3]),
            everywhere,
        ),
        "ground_x": support(
            "ground_x",
            loads.ground_x_n,
            (state.q[:, 0], state.qd[:, 0], -loads.ground_d_n * loads.sliding),
            everywhere,
        ),
        "ground_c": support(
            "ground_c", loads.ground_c_n - rest_c, (state.q[:, 1], state.qd[:, 1]), bearing(loads.ground_c_n, rest_c)
        ),
        "ground_d": support("ground_d", loads.ground_d_n - rest_d, (rise, rising), bearing(loads.ground_d_n, rest_d)),
    }
