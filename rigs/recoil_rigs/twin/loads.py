"""The loads of the virtual rig: brake, recuperator, packing, stop, elevating gear and ground.

One state at a time in plain floats, because a shot takes some hundred thousand evaluations. The rest in
battery is the equilibrium ``q = 0``: the loads of ground, elevating gear and stop at rest are found from
the weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from recoil_acquisition.errors import Fault, FaultCode
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import Unread

State = tuple[float, ...]


@dataclass(frozen=True)
class Rest:
    """The loads at rest in battery.

    Attributes
    ----------
    ground_c_n, ground_d_n
        Ground at C and D, upward.
    stop_n
        Push of the stop, rearward.
    """

    ground_c_n: float
    ground_d_n: float
    elevating_moment_n_m: float
    stop_n: float


Loads = tuple[float, float, float, float, float, float, State, float]
"""The loads at a state, in the signs of `recoil_rigs.mechanism.model.generalized_forces`; N, N m, Pa.

R_f with all its parts, the elevating moment, ground x, ground y, ground d, ground friction; what is recorded: brake
pressure, recuperator pressure, packing friction, contact, the five loads after R_f, and what no gauge reads; the rate
of the packing's bristle, m/s. A plain tuple, as it is made at every evaluation: names take time.
"""


def rest_in_battery(m: Mechanism, settings: TwinSettings, sag_n_m: float = 0.0) -> Rest:
    """Return the loads that hold the mechanism at ``q = 0``.

    Parameters
    ----------
    sag_n_m
        Moment that the sag of a flexible tube adds to that of the weights about the trunnion, positive if it lowers the
        muzzle.
    """
    c1, s1, c2, s2 = math.cos(m.phi10), math.sin(m.phi10), math.cos(m.phi20), math.sin(m.phi20)
    tipping = m.g * ((m.m2 * m.s2 + m.m3 * m.b) * c2 - (m.m2 * m.d2 + m.m3 * m.d) * s2) + sag_n_m
    Sx1, Sy1 = m.m1 * m.X1 + (m.m2 + m.m3) * m.XA, m.m1 * m.Y1 + (m.m2 + m.m3) * m.YA
    ground_d = (m.g * (Sx1 * c1 - Sy1 * s1) + tipping) / (m.L * c1)
    ground_c = (m.m1 + m.m2 + m.m3) * m.g - ground_d
    stop = settings.recuperator_pressure_pa * m.recuperator_area - m.m3 * m.g * s2
    return Rest(ground_c, ground_d, -tipping, stop)


def check_statics(m: Mechanism, settings: TwinSettings) -> list[Fault]:
    """Return why the mechanism cannot rest in battery, if it cannot."""
    rest = rest_in_battery(m, settings)
    faults = []
    if rest.ground_c_n <= 0 or rest.ground_d_n <= 0:
        problem = f"the mechanism tips over at rest: {rest.ground_c_n:.0f} N on C and {rest.ground_d_n:.0f} N on D"
        faults.append(Fault(("mechanism", "L"), problem, FaultCode.CONTRADICTION))
    if rest.stop_n <= 0:
        problem = f"does not hold the recoiling part in battery: {-rest.stop_n:.0f} N are missing"
        faults.append(Fault(("twin", "recuperator_pressure_pa"), problem, FaultCode.CONTRADICTION))
    return faults


def pressures_of(m: Mechanism, s: TwinSettings) -> Callable[[float, float], tuple[float, float]]:
    """Return a function from travel and its rate to the pressures of brake and recuperator."""
    throttle = 0.5 * s.oil_density_kg_m3 * (m.brake_area / s.discharge) ** 2
    gas, volume, area_r = s.recuperator_pressure_pa, s.recuperator_volume_m3, m.recuperator_area
    polytropic, stroke, leak, largest = s.polytropic, s.stroke_m, s.leak_m2, s.orifice_m2

    def pressures(x: float, dx: float) -> tuple[float, float]:
        opening = 1.0 - x / stroke
        orifice = leak + (largest * math.sqrt(opening) if opening > 0.0 else 0.0)
        p_brake = throttle * (dx / orifice) ** 2 if dx > 0.0 else 0.0
        return p_brake, gas * (volume / (volume - area_r * x)) ** polytropic

    return pressures


def loads_of(
    m: Mechanism, s: TwinSettings, friction_n: float, rest: Rest, unread: Unread | None
) -> Callable[..., Loads]:
    """Return a function from a state to its loads.

    Parameters
    ----------
    friction_n
        Packing friction while it slides.
    unread
        Force that no gauge reads; None if there is none.

    Returns
    -------
    callable
        Function of ``xi, eta, beta, x, dxi, deta, w1, dbeta, dx``, the packing's bristle, m, cosine and sine of
        phi1, and the time, s.
    """
    L, tanh, sin_phi10 = m.L, math.tanh, math.sin(m.phi10)
    rest_c, rest_d, rest_moment, rest_stop = rest.ground_c_n, rest.ground_d_n, rest.elevating_moment_n_m, rest.stop_n
    pressures = pressures_of(m, s)
    slip = friction_n / s.packing_stiffness_n_m
    area_b, area_r = m.brake_area, m.recuperator_area
    k_packing, k_stop, c_stop = s.packing_stiffness_n_m, s.stop_stiffness_n_m, s.stop_damping_n_s_m
    k_ground, c_ground = s.ground_stiffness_n_m, s.ground_damping_n_s_m
    k_gear, c_gear = s.elevating_stiffness_n_m_rad, s.elevating_damping_n_m_s_rad

    def loads(
        xi: float, eta: float, beta: float, x: float, dxi: float, deta: float, w1: float, dbeta: float, dx: float,
        bristle: float, c1: float, s1: float, t: float,
    ) -> Loads:  # fmt: skip
        p_brake, p_gas = pressures(x, dx)
        packing = k_packing * min(max(bristle, -slip), slip)
        contact = max(0.0, rest_stop - k_stop * x - c_stop * dx)
        if dx < 0.0:
            contact += s.counter_recoil_n_s2_m2 * dx * dx
        R = area_b * p_brake + area_r * p_gas + packing - contact
        hidden = 0.0
        if unread is not None:
            hidden = unread(x, dx, p_brake, p_gas, t)
            R += hidden
        M_C = rest_moment + k_gear * beta + c_gear * dbeta
        N_x = k_ground * xi + c_ground * dxi
        N_y = -max(0.0, rest_c - k_ground * eta - c_ground * deta)
        N_d = -max(0.0, rest_d - k_ground * (eta + L * (s1 - sin_phi10)) - c_ground * (deta + L * c1 * w1))
        N_f = -m.f * N_d * tanh((dxi - L * s1 * w1) / s.ground_slip_m_s)
        # the packing is dragged along until it slides
        drag = 0.0 if (bristle >= slip and dx > 0.0) or (bristle <= -slip and dx < 0.0) else dx
        return R, M_C, N_x, N_y, N_d, N_f, (p_brake, p_gas, packing, contact, M_C, N_x, N_y, N_d, N_f, hidden), drag

    return loads
