"""Loads of elevating gear and ground from the measured motion, by inverse dynamics.

Equations (1) to (4) of the model, solved for the moment of the elevating gear and for the reactions of the
ground instead of for the accelerations::

    M_C            = P (e + d) - Q4
    N_Cxi + N_D,f  = -P cos(phi2) - Q1
    N_Ceta + N_D   = -P sin(phi2) - Q2
    N_D            = [P (e + d + A6) - Q3] / (L (cos(phi1) + f sigma sin(phi1))),      Q = M q'' + h

with sigma, between -1 and 1, the direction in which the foot D slides: its friction is ``-f N_D sigma``. The
motion comes from angular rates and accelerometers, the recoiling part's acceleration from the forces on
it or from its accelerometer; nothing is differentiated but the angular rates, and nothing but small lever
arms and slow weights hangs on an integral. All functions are plain arithmetic on arrays; loads have the signs of
`recoil_rigs.mechanism.model.generalized_forces`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.double_integral import integrate
from recoil_rigs.mechanism.model import (
    Mechanism,
    generalized_forces,
    mass_matrix,
    relative_acceleration,
    velocity_terms,
)

SLIDING_M_S = 5e-3
"""Velocity at which the foot's friction is taken to be fully there: no ground switches within no time."""
REST_S = 0.01
"""Length of the rest before the shot, whose mean is the zero of velocities and displacements: short enough that the
accelerometers' noise has not walked far, long enough to average the gyros'."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion(ReadOnlyArrays):
    """The measured motion of one shot on one uniform grid that begins at rest, SI.

    Attributes
    ----------
    w1, w2 : ndarray, shape (n,)
        Angular rates of carriage and tipping part, rad/s.
    f_x, f_y : ndarray, shape (n,)
        Specific force of the carriage at the accelerometers, carriage axes, m/s^2.
    r_x, r_y
        Their place from the trunnion A, m.
    breech_force_n : ndarray, shape (n,)
        P.
    acceleration_m_s2 : ndarray, shape (n,)
        a' of equation (36): of the recoiling part without gravity, rearward.
    travel_m, velocity_m_s : ndarray, shape (n,)
        Travel and velocity of recoil.
    rest
        Number of samples before the first force; at least one.
    """

    step_s: float
    w1: Array
    w2: Array
    f_x: Array
    f_y: Array
    r_x: float
    r_y: float
    breech_force_n: Array
    acceleration_m_s2: Array
    travel_m: Array
    velocity_m_s: Array
    rest: int = 1


@dataclass(frozen=True, eq=False)
class State(ReadOnlyArrays):
    """The model's coordinates, ``[xi, eta, alpha, beta, x]``, shape (n, 5) each.

    Attributes
    ----------
    q, qd, qdd : ndarray, shape (n, 5)
        m and rad, their rates and accelerations; zero at rest in battery.
    """

    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True, eq=False)
class Loads(ReadOnlyArrays):
    """Loads in the signs of `recoil_rigs.mechanism.model.generalized_forces`, shape (n,) each.

    Attributes
    ----------
    elevating_moment_n_m
        M_C, weight included.
    ground_x_n
        Horizontal reaction at C and friction at D together.
    ground_c_n, ground_d_n
        Vertical reactions at C and D; negative where the foot presses on the ground.
    sliding
        sigma of the foot D.
    """

    elevating_moment_n_m: Array
    ground_x_n: Array
    ground_c_n: Array
    ground_d_n: Array
    sliding: Array


def state_of(mechanism: Mechanism, motion: MeasuredMotion) -> State:
    """Integrate the measured motion to coordinates of the model.

    The accelerometers' readings are moved to the base point C, turned upright and freed of gravity, as
    `recoil_rigs.mechanism.model.carriage_specific_force` solved for ``xi''`` and ``eta''``; the travel's acceleration
    is that of `recoil_rigs.mechanism.model.relative_acceleration`.
    """
    m, step = mechanism, motion.step_s
    dw1, dw2 = np.gradient(motion.w1, step), np.gradient(motion.w2, step)

    def from_rest(rate: Array) -> Array:
        total = integrate(rate, step)
        return total - np.mean(total[max(0, motion.rest - round(REST_S / step)) : max(motion.rest, 1)])

    alpha, beta = from_rest(motion.w1), from_rest(motion.w2 - motion.w1)
    x, y = m.XA + motion.r_x, m.YA + motion.r_y
    along = motion.f_x + dw1 * y + motion.w1**2 * x
    across = motion.f_y - dw1 * x + motion.w1**2 * y
    c1, s1 = np.cos(m.phi10 + alpha), np.sin(m.phi10 + alpha)
    ddxi, ddeta = along * c1 - across * s1, along * s1 + across * c1 - m.g
    dxi, deta = from_rest(ddxi), from_rest(ddeta)
    ddx = relative_acceleration(
        m, motion.acceleration_m_s2, motion.travel_m, motion.w2, dw2, motion.f_x, motion.f_y, beta,
        w1=motion.w1, dw1=dw1, r_x=motion.r_x, r_y=motion.r_y,
    )  # fmt: skip
    return State(
        q=np.column_stack([from_rest(dxi), from_rest(deta), alpha, beta, motion.travel_m]),
        qd=np.column_stack([dxi, deta, motion.w1, motion.w2 - motion.w1, motion.velocity_m_s]),
        qdd=np.column_stack([ddxi, ddeta, dw1, dw2 - dw1, ddx]),
    )


def foot_velocity(mechanism: Mechanism, state: State) -> Array:
    """Return the horizontal velocity of the foot D, forward, m/s, shape (n,)."""
    phi1 = mechanism.phi10 + state.q[:, 2]
    return np.asarray(state.qd[:, 0] - mechanism.L * np.sin(phi1) * state.qd[:, 2])


def foot_displacement(mechanism: Mechanism, state: State) -> tuple[Array, Array]:
    """Return how far the foot D has risen, m, and how fast it rises, m/s, shape (n,) each."""
    phi1 = mechanism.phi10 + state.q[:, 2]
    rise = state.q[:, 1] + mechanism.L * (np.sin(phi1) - np.sin(mechanism.phi10))
    return np.asarray(rise), np.asarray(state.qd[:, 1] + mechanism.L * np.cos(phi1) * state.qd[:, 2])


def loads_of(mechanism: Mechanism, state: State, breech_force_n: Array, sliding_m_s: float = SLIDING_M_S) -> Loads:
    """Solve equations (1) to (4) for the loads.

    Parameters
    ----------
    breech_force_n : ndarray, shape (n,)
    sliding_m_s
        See `SLIDING_M_S`.
    """
    required = np.einsum("nij,nj->ni", mass_matrix(mechanism, state.q), state.qdd)
    required += velocity_terms(mechanism, state.q, state.qd)
    left = generalized_forces(mechanism, state.q, breech_force_n) - required
    phi1 = mechanism.phi10 + state.q[:, 2]
    sliding = np.tanh(foot_velocity(mechanism, state) / sliding_m_s)
    ground_d = left[:, 2] / (mechanism.L * (np.cos(phi1) + mechanism.f * sliding * np.sin(phi1)))
    return Loads(left[:, 3], left[:, 0], left[:, 1] - ground_d, ground_d, sliding)


def rest_loads(mechanism: Mechanism) -> Loads:
    """Return the loads of the weights at rest in battery, shape (1,) each."""
    zero = np.zeros((1, 5))
    return loads_of(mechanism, State(zero, zero, zero), np.zeros(1))
