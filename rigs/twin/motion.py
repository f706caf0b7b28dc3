"""The true motion of the virtual rig: loads, equations of motion, integration.

The equations are those of `rigs.mechanism`, here for one state at a time in plain floats, because a
shot takes some hundred thousand evaluations. The rest in battery is the equilibrium ``q = 0``: the
loads of ground, elevating gear and stop at rest are found from the weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.errors import Fault
from rigs.mechanism import Mechanism
from rigs.twin.settings import TwinSettings

Array = NDArray[np.float64]
State = tuple[float, ...]

_LARGEST_STEP_S = 25e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """True states and loads at the instants of the reference clock, shape (n,) each.

    Attributes
    ----------
    times_s : ndarray
        Uniform, from 0; rest before.
    q, qd, qdd : ndarray, shape (n, 5)
        State, rate and acceleration in the order of `rigs.mechanism`.
    breech_pressure_pa, brake_pressure_pa, recuperator_pressure_pa : ndarray
    friction_n : ndarray
        Packing friction, positive against recoil.
    contact_n : ndarray
        What the stop, and the throttling of the counter-recoil, push rearward.
    elevating_moment_n_m, ground_x_n, ground_y_n, ground_d_n, ground_friction_n : ndarray
        Loads in the signs of `rigs.mechanism.generalized_forces`.
    t_fire_s, t_end_s : float
        First rise of the breech force; end of recoil travel, NaN if it lies behind the record.
    """

    times_s: Array
    q: Array
    qd: Array
    qdd: Array
    breech_pressure_pa: Array
    brake_pressure_pa: Array
    recuperator_pressure_pa: Array
    friction_n: Array
    contact_n: Array
    elevating_moment_n_m: Array
    ground_x_n: Array
    ground_y_n: Array
    ground_d_n: Array
    ground_friction_n: Array
    t_fire_s: float
    t_end_s: float

    def resistance_n(self, mechanism: Mechanism) -> Array:
        """Return R_f with all its parts, shape (n,)."""
        return (
            mechanism.brake_area * self.brake_pressure_pa
            + mechanism.recuperator_area * self.recuperator_pressure_pa
            + self.friction_n
            - self.contact_n
        )


def breech_pressure(times_s: Array, peak_pa: float, rise_s: float, decay_s: float) -> Array:
    """Return a breech pressure that rises like ``1 - exp(-(t / rise)^3)`` and decays like ``exp(-t / decay)``.

    Parameters
    ----------
    times_s : ndarray
        From the first rise; zero before.
    peak_pa : float
        Its largest value.
    rise_s, decay_s : float
        Time constants.
    """

    def shape(t: Array) -> Array:
        since = np.maximum(t, 0.0)
        pulse: Array = -np.expm1(-((since / rise_s) ** 3)) * np.exp(-since / decay_s)
        return pulse

    highest = float(shape(np.linspace(0.0, 5.0 * (rise_s + decay_s), 50_001)).max())
    return peak_pa / highest * shape(times_s)


def _statics(m: Mechanism, settings: TwinSettings) -> tuple[float, float, float, float]:
    """Return the loads at rest in battery: ground at C and D upward, elevating moment, stop; N and N m."""
    c1, s1, c2, s2 = math.cos(m.phi10), math.sin(m.phi10), math.cos(m.phi20), math.sin(m.phi20)
    tipping = m.g * ((m.m2 * m.s2 + m.m3 * m.b) * c2 - (m.m2 * m.d2 + m.m3 * m.d) * s2)
    Sx1, Sy1 = m.m1 * m.X1 + (m.m2 + m.m3) * m.XA, m.m1 * m.Y1 + (m.m2 + m.m3) * m.YA
    ground_d = (m.g * (Sx1 * c1 - Sy1 * s1) + tipping) / (m.L * c1)
    ground_c = (m.m1 + m.m2 + m.m3) * m.g - ground_d
    stop = settings.recuperator_pressure_pa * m.recuperator_area - m.m3 * m.g * s2
    return ground_c, ground_d, -tipping, stop


def check_statics(m: Mechanism, settings: TwinSettings) -> list[Fault]:
    """Return why the mechanism cannot rest in battery, if it cannot."""
    ground_c, ground_d, _, stop = _statics(m, settings)
    faults = []
    if ground_c <= 0 or ground_d <= 0:
        problem = f"the mechanism tips over at rest: {ground_c:.0f} N on C and {ground_d:.0f} N on D"
        faults.append(Fault("mechanism.L", problem))
    if stop <= 0:
        problem = f"does not hold the recoiling part in battery: {-stop:.0f} N are missing"
        faults.append(Fault("twin.recuperator_pressure_pa", problem))
    return faults


def _equations(m: Mechanism, s: TwinSettings, friction_n: float) -> Callable[[State, float], tuple[State, State]]:
    """Return a function from (state and rate, breech force) to (accelerations, loads)."""
    sin, cos, tanh = math.sin, math.cos, math.tanh
    rest_c, rest_d, rest_moment, rest_stop = _statics(m, s)
    mass, g, XA, YA, b, d, L, m3 = m.m1 + m.m2 + m.m3, m.g, m.XA, m.YA, m.b, m.d, m.L, m.m3
    Sx1, Sy1 = m.m1 * m.X1 + (m.m2 + m3) * XA, m.m1 * m.Y1 + (m.m2 + m3) * YA
    Sy2, m2s2 = m.m2 * m.d2 + m3 * d, m.m2 * m.s2
    J_tip = m.J2 + m.J3c + m3 * d * d
    J_all = m.J1 + (m.m2 + m3) * (XA * XA + YA * YA)
    difference, sin_phi10 = m.phi20 - m.phi10, sin(m.phi10)
    throttle = 0.5 * s.oil_density_kg_m3 * (m.brake_area / s.discharge) ** 2
    slip = friction_n / s.packing_stiffness_n_m
    gas, volume, area_r = s.recuperator_pressure_pa, s.recuperator_volume_m3, m.recuperator_area
    k_ground, c_ground = s.ground_stiffness_n_m, s.ground_damping_n_s_m

    def evaluate(y: State, P: float) -> tuple[State, State]:
        xi, eta, alpha, beta, x, dxi, deta, w1, dbeta, dx, bristle = y
        phi1, angle = m.phi10 + alpha, difference + beta
        c1, s1, cd, sd = cos(phi1), sin(phi1), cos(angle), sin(angle)
        c2, s2 = c1 * cd - s1 * sd, s1 * cd + c1 * sd
        w2, lever = w1 + dbeta, b - x
        A5, A6 = XA * cd + YA * sd, YA * cd - XA * sd
        Sx2 = m2s2 + m3 * lever

        opening = 1.0 - x / s.stroke_m
        orifice = s.leak_m2 + (s.orifice_m2 * math.sqrt(opening) if opening > 0.0 else 0.0)
        p_brake = throttle * (dx / orifice) ** 2 if dx > 0.0 else 0.0
        p_gas = gas * (volume / (volume - area_r * x)) ** s.polytropic
        packing = s.packing_stiffness_n_m * min(max(bristle, -slip), slip)
        contact = max(0.0, rest_stop - s.stop_stiffness_n_m * x - s.stop_damping_n_s_m * dx)
        if dx < 0.0:
            contact += s.counter_recoil_n_s2_m2 * dx * dx
        R = m.brake_area * p_brake + area_r * p_gas + packing - contact
        M_C = rest_moment + s.elevating_stiffness_n_m_rad * beta + s.elevating_damping_n_m_s_rad * dbeta
        N_x = k_ground * xi + c_ground * dxi
        N_y = -max(0.0, rest_c - k_ground * eta - c_ground * deta)
        N_d = -max(0.0, rest_d - k_ground * (eta + L * (s1 - sin_phi10)) - c_ground * (deta + L * c1 * w1))
        N_f = -m.f * N_d * tanh((dxi - L * s1 * w1) / s.ground_slip_m_s)

        side1, rise1 = Sx1 * s1 + Sy1 * c1, Sx1 * c1 - Sy1 * s1
        side2, rise2 = Sx2 * s2 + Sy2 * c2, Sx2 * c2 - Sy2 * s2
        swing = Sy2 * A5 - Sx2 * A6
        coriolis = 2.0 * m3 * dx * w2
        r1 = -P * c2 - N_x - N_f + rise1 * w1 * w1 + rise2 * w2 * w2 - coriolis * s2
        r2 = -P * s2 - N_y - N_d + side1 * w1 * w1 + side2 * w2 * w2 + coriolis * c2 - mass * g
        r3 = P * (m.e + d + A6) + (N_f * s1 - N_d * c1) * L + swing * (w2 * w2 - w1 * w1)
        r3 += coriolis * (A5 + lever) - g * (rise1 + rise2)
        r4 = P * (m.e + d) - M_C - swing * w1 * w1 + coriolis * lever - g * rise2
        r5 = P - R - m3 * (A5 * w1 * w1 + lever * w2 * w2 - g * s2)

        # the two translations have a diagonal block: take them out, three equations remain
        a13, a14, a15 = -(side1 + side2), -side2, -m3 * c2
        a23, a24, a25 = rise1 + rise2, rise2, -m3 * s2
        coupling = Sx2 * A5 + Sy2 * A6
        J23 = J_tip + m3 * lever * lever
        k33 = J_all + J23 + 2.0 * coupling - (a13 * a13 + a23 * a23) / mass
        k34 = J23 + coupling - (a13 * a14 + a23 * a24) / mass
        k35 = m3 * (d + A6) - (a13 * a15 + a23 * a25) / mass
        k44 = J23 - (a14 * a14 + a24 * a24) / mass
        k45 = m3 * d - (a14 * a15 + a24 * a25) / mass
        k55 = m3 - (a15 * a15 + a25 * a25) / mass
        r3 -= (a13 * r1 + a23 * r2) / mass
        r4 -= (a14 * r1 + a24 * r2) / mass
        r5 -= (a15 * r1 + a25 * r2) / mass
        l43, l53 = k34 / k33, k35 / k33
        k44 -= l43 * k34
        k45 -= l43 * k35
        r4 -= l43 * r3
        l54 = k45 / k44
        ddx = (r5 - l53 * r3 - l54 * r4) / (k55 - l53 * k35 - l54 * k45)
        ddbeta = (r4 - k45 * ddx) / k44
        ddalpha = (r3 - k34 * ddbeta - k35 * ddx) / k33
        ddxi = (r1 - a13 * ddalpha - a14 * ddbeta - a15 * ddx) / mass
        ddeta = (r2 - a23 * ddalpha - a24 * ddbeta - a25 * ddx) / mass
        # the packing is dragged along until it slides
        drag = 0.0 if (bristle >= slip and dx > 0.0) or (bristle <= -slip and dx < 0.0) else dx
        return (ddxi, ddeta, ddalpha, ddbeta, ddx, drag), (p_brake, p_gas, packing, contact, M_C, N_x, N_y, N_d, N_f)

    return evaluate


def _trial(y: State, along: State, rates: State, step: float) -> State:
    """Return ``y`` moved by a step along the velocities of another state and given accelerations."""
    place = [p + step * v for p, v in zip(y[:5], along[5:10], strict=True)]
    speed = [v + step * a for v, a in zip(y[5:], rates, strict=True)]
    return (*place, *speed)


def simulate_motion(
    mechanism: Mechanism, settings: TwinSettings, *, peak_pressure_pa: float, friction_n: float
) -> Motion:
    """Integrate the equations of motion through one shot by the classical Runge-Kutta method.

    Parameters
    ----------
    mechanism : Mechanism
        With the true recoiling mass.
    settings : TwinSettings
    peak_pressure_pa : float
        Of this shot.
    friction_n : float
        True packing friction.

    Raises
    ------
    ValueError
        If the mechanism cannot rest in battery (see `check_statics`) or ``friction_n`` is negative.
    """
    if check_statics(mechanism, settings):
        raise ValueError("the mechanism cannot rest in battery")
    if not friction_n >= 0:
        raise ValueError(f"friction_n must not be negative, found {friction_n!r}")
    substeps = math.ceil(1.0 / (settings.sample_rate_hz * _LARGEST_STEP_S) - 1e-9)
    rate_hz = settings.sample_rate_hz * substeps
    step = 1.0 / rate_hz
    count = round(settings.duration_s * rate_hz)
    half_times = np.arange(2 * count) / (2.0 * rate_hz) - settings.pre_trigger_s
    pressure = breech_pressure(half_times, peak_pressure_pa, settings.rise_s, settings.decay_s)
    forces = (mechanism.bore_area * pressure).tolist()
    evaluate = _equations(mechanism, settings, friction_n)
    slip = friction_n / settings.packing_stiffness_n_m

    y: State = (0.0,) * 11
    states, changes, loads = [], [], []
    for i in range(count):
        k1, load = evaluate(y, forces[2 * i])
        states.append(y)
        changes.append(k1)
        loads.append(load)
        if forces[2 * i + 1] == 0.0:
            continue  # rest is an equilibrium: nothing moves before the shot
        y2 = _trial(y, y, k1, 0.5 * step)
        k2, _ = evaluate(y2, forces[2 * i + 1])
        y3 = _trial(y, y2, k2, 0.5 * step)
        k3, _ = evaluate(y3, forces[2 * i + 1])
        y4 = _trial(y, y3, k3, step)
        k4, _ = evaluate(y4, forces[min(2 * i + 2, 2 * count - 1)])
        sixth = step / 6.0
        velocities = zip(y[:5], y[5:10], y2[5:10], y3[5:10], y4[5:10], strict=True)
        place = [p + sixth * (a + 2 * (b + c) + d) for p, a, b, c, d in velocities]
        speed = [v + sixth * (a + 2 * (b + c) + d) for v, a, b, c, d in zip(y[5:], k1, k2, k3, k4, strict=True)]
        y = (*place, *speed[:5], min(max(speed[5], -slip), slip))
    q = np.array(states)
    qd = q[:, 5:10]
    ended = np.flatnonzero((qd[:-1, 4] > 0) & (qd[1:, 4] <= 0) & (q[:-1, 4] > 1e-3))
    end = math.nan
    if ended.size:
        last = int(ended[0])
        end = (last + qd[last, 4] / (qd[last, 4] - qd[last + 1, 4])) / rate_hz
    times = np.arange(count) / rate_hz
    p_brake, p_gas, packing, contact, M_C, N_x, N_y, N_d, N_f = np.array(loads).T
    return Motion(
        times, q[:, :5], qd, np.array(changes)[:, :5], pressure[::2], p_brake, p_gas, packing, contact, M_C, N_x, N_y,
        N_d, N_f, t_fire_s=settings.pre_trigger_s, t_end_s=float(end),
    )  # fmt: skip
