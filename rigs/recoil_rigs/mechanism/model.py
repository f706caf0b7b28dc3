"""The three-body model of the recoiling mechanism: M(q) q'' + h(q, q') = Q.

Three rigid bodies move in the vertical plane of symmetry: the carriage B1 on the ground, the tipping
part B2 on the trunnion A, and the recoiling part B3 that slides along B2. The generalized coordinates
are ``q = [xi, eta, alpha, beta, x]``: the displacement of the carriage's base point C (forward and up,
m), the rotation of the carriage and of the tipping part relative to it (rad), and the recoil travel
(rearward, m). With the angles over the horizontal::

    phi1 = phi10 + alpha            carriage axis
    phi2 = phi20 + alpha + beta     bore axis; e5 points to the muzzle, e6 is e5 turned by +90 degrees
    w2   = alpha' + beta'           angular rate of B2 and B3

Model and equation numbers: R. Xu, Q. Chen, G. Yang, H. Yan, "Identification of a certain mechanism's
recoiling mass by limited memory least square method", Journal of Vibroengineering, 2013, equations
(1) to (36). The paper writes ``A q'' = F`` with ``A = -M`` and ``F = h - Q``. Several of its printed
terms are misprints. The functions hold the terms that Lagrange's equations give, and each docstring
names the misprints that it corrects.

All functions are plain arithmetic on arrays: states have shape ``(..., 5)``, loads any shape that
broadcasts with ``(...)``. SI units throughout; forces in N, moments in N m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.measured_acceleration import (
    carriage_specific_force,
    ground_acceleration,
    relative_acceleration,
    specific_acceleration,
    specific_acceleration_inertial,
    specific_acceleration_kinematic,
)
from recoil_rigs.mechanism.mechanism_parameters import Mechanism

__all__ = [
    "Mechanism",
    "accelerations",
    "carriage_specific_force",
    "generalized_forces",
    "ground_acceleration",
    "kinetic_energy",
    "mass_matrix",
    "momentum",
    "potential_energy",
    "relative_acceleration",
    "specific_acceleration",
    "specific_acceleration_inertial",
    "specific_acceleration_kinematic",
    "velocity_terms",
]


class _Geometry(NamedTuple):
    """Directions, moments of mass and the trunnion's place in tipping axes at a state, each (...)."""

    c1: Array
    s1: Array
    c2: Array
    s2: Array  # the sine of phi2; the length s2 stays an attribute of the mechanism
    Sx1: float
    Sy1: float
    Sx2: Array
    Sy2: float
    A5: Array  # XA cos(phi2 - phi1) + YA sin(phi2 - phi1): from C to A along e5
    A6: Array  # YA cos(phi2 - phi1) - XA sin(phi2 - phi1): from C to A along e6


def _geometry(mechanism: Mechanism, q: Array) -> _Geometry:
    m = mechanism
    phi1 = m.phi10 + q[..., 2]
    phi2 = m.phi20 + q[..., 2] + q[..., 3]
    cd, sd = np.cos(phi2 - phi1), np.sin(phi2 - phi1)
    return _Geometry(
        c1=np.cos(phi1),
        s1=np.sin(phi1),
        c2=np.cos(phi2),
        s2=np.sin(phi2),
        Sx1=m.m1 * m.X1 + (m.m2 + m.m3) * m.XA,
        Sy1=m.m1 * m.Y1 + (m.m2 + m.m3) * m.YA,
        Sx2=m.m2 * m.s2 + m.m3 * (m.b - q[..., 4]),
        Sy2=m.m2 * m.d2 + m.m3 * m.d,
        A5=m.XA * cd + m.YA * sd,
        A6=m.YA * cd - m.XA * sd,
    )


def mass_matrix(mechanism: Mechanism, q: ArrayLike) -> Array:
    """Return the mass matrix M of the equations of motion, equations (22) to (26).

    Parameters
    ----------
    q : array_like, shape (..., 5)
        State ``[xi, eta, alpha, beta, x]``, m and rad.

    Returns
    -------
    ndarray, shape (..., 5, 5)
        Symmetric and positive definite; kg, kg m and kg m^2.

    Notes
    -----
    Misprints corrected: the paper's a_33 lacks the term of ``m2 d2 + m3 d`` with the trunnion (22), its
    a_45 has the wrong sign (25), and its a_53 lacks ``m3 d`` (26); A must be symmetric.
    """
    m, state = mechanism, np.asarray(q, dtype=np.float64)
    k = _geometry(m, state)
    lever = m.b - state[..., 4]
    J23 = m.J2 + m.J3c + m.m3 * (lever**2 + m.d**2)
    coupling = k.Sx2 * k.A5 + k.Sy2 * k.A6
    M = np.zeros((*state.shape[:-1], 5, 5))
    M[..., 0, 0] = M[..., 1, 1] = m.m1 + m.m2 + m.m3
    M[..., 0, 3] = -(k.Sx2 * k.s2 + k.Sy2 * k.c2)
    M[..., 0, 2] = M[..., 0, 3] - (k.Sx1 * k.s1 + k.Sy1 * k.c1)
    M[..., 0, 4] = -m.m3 * k.c2
    M[..., 1, 3] = k.Sx2 * k.c2 - k.Sy2 * k.s2
    M[..., 1, 2] = M[..., 1, 3] + k.Sx1 * k.c1 - k.Sy1 * k.s1
    M[..., 1, 4] = -m.m3 * k.s2
    M[..., 2, 2] = m.J1 + J23 + (m.m2 + m.m3) * (m.XA**2 + m.YA**2) + 2 * coupling
    M[..., 2, 3] = J23 + coupling
    M[..., 2, 4] = m.m3 * (m.d + k.A6)
    M[..., 3, 3] = J23
    M[..., 3, 4] = m.m3 * m.d
    M[..., 4, 4] = m.m3
    for row, column in ((0, 2), (0, 3), (0, 4), (1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)):
        M[..., column, row] = M[..., row, column]
    return M


def velocity_terms(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike) -> Array:
    """Return h of the equations of motion: centrifugal, Coriolis and gravity terms, within (20) to (27).

    Parameters
    ----------
    q, qd : array_like, shape (..., 5)
        State, m and rad, and its rate, m/s and rad/s.

    Returns
    -------
    ndarray, shape (..., 5)
        N, N, N m, N m, N.

    Notes
    -----
    Misprints corrected: two signs and the term ``-2 m3 x' w2 cos phi2`` of f2 (21), the missing square of
    ``w2`` in f5 (27), and the weights' moments in (7), (8) and (17), where ``s2 sin phi2`` stands for
    ``d2 sin phi2`` and ``d sin phi1`` for ``d sin phi2``.
    """
    m, state, rate = mechanism, np.asarray(q, dtype=np.float64), np.asarray(qd, dtype=np.float64)
    k = _geometry(m, state)
    w1, w2, dx = rate[..., 2], rate[..., 2] + rate[..., 3], rate[..., 4]
    lever = m.b - state[..., 4]
    weight_moment = m.g * (k.Sx2 * k.c2 - k.Sy2 * k.s2)
    swing = k.Sy2 * k.A5 - k.Sx2 * k.A6
    h1 = -(k.Sx1 * k.c1 - k.Sy1 * k.s1) * w1**2 - (k.Sx2 * k.c2 - k.Sy2 * k.s2) * w2**2 + 2 * m.m3 * dx * w2 * k.s2
    h2 = -(k.Sx1 * k.s1 + k.Sy1 * k.c1) * w1**2 - (k.Sx2 * k.s2 + k.Sy2 * k.c2) * w2**2 - 2 * m.m3 * dx * w2 * k.c2
    h3 = -swing * (w2**2 - w1**2) - 2 * m.m3 * (k.A5 + lever) * dx * w2
    h4 = swing * w1**2 - 2 * m.m3 * lever * dx * w2
    h5 = m.m3 * (k.A5 * w1**2 + lever * w2**2 - m.g * k.s2)
    return np.stack(
        (
            h1,
            h2 + (m.m1 + m.m2 + m.m3) * m.g,
            h3 + m.g * (k.Sx1 * k.c1 - k.Sy1 * k.s1) + weight_moment,
            h4 + weight_moment,
            h5,
        ),
        axis=-1,
    )


def generalized_forces(
    mechanism: Mechanism,
    q: ArrayLike,
    breech_force: ArrayLike = 0.0,
    resistance: ArrayLike = 0.0,
    elevating_moment: ArrayLike = 0.0,
    ground_x: ArrayLike = 0.0,
    ground_y: ArrayLike = 0.0,
    ground_d: ArrayLike = 0.0,
    ground_friction: ArrayLike | None = None,
) -> Array:
    """Return the generalized forces Q of the loads, equations (6) and (17), in the paper's signs.

    Parameters
    ----------
    q : array_like, shape (..., 5)
        State, m and rad.
    breech_force : array_like, shape (...)
        P, rearward on B3 along a line e above its centre of mass, N.
    resistance : array_like, shape (...)
        R_f, forward on B3 and rearward on B2, N.
    elevating_moment : array_like, shape (...)
        M_C between B1 and B2, positive if it lowers the muzzle, N m.
    ground_x, ground_y : array_like, shape (...)
        N_Cxi and N_Ceta at C, N; a carriage that presses on the ground has a negative ``ground_y``.
    ground_d : array_like, shape (...)
        N_Deta at D, N, in the same sign.
    ground_friction : array_like, shape (...), optional
        Horizontal reaction at D, N, in the same sign; the paper's ``f N_Deta`` if left out.

    Returns
    -------
    ndarray, shape (..., 5)
        N, N, N m, N m, N.

    Notes
    -----
    Misprints corrected: Q2 holds N_Ceta, not N_Cxi (6), (17); the third load term of (8) is L_p3.
    """
    m, state = mechanism, np.asarray(q, dtype=np.float64)
    k = _geometry(m, state)
    P, R, M_C = (np.asarray(v, dtype=np.float64) for v in (breech_force, resistance, elevating_moment))
    N_x, N_y, N_d = (np.asarray(v, dtype=np.float64) for v in (ground_x, ground_y, ground_d))
    friction = m.f * N_d if ground_friction is None else np.asarray(ground_friction, dtype=np.float64)
    parts = (
        -P * k.c2 - N_x - friction,
        -P * k.s2 - N_y - N_d,
        P * (m.e + m.d + k.A6) - N_d * m.L * k.c1 + friction * m.L * k.s1,
        P * (m.e + m.d) - M_C,
        P - R,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def accelerations(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike, Q: ArrayLike) -> Array:
    """Solve the equations of motion for q'', equation (18).

    Parameters
    ----------
    q, qd, Q : array_like, shape (..., 5)
        State, rate and generalized forces.

    Returns
    -------
    ndarray, shape (..., 5)
        m/s^2 and rad/s^2.

    Notes
    -----
    Misprints corrected: (18) leaves out ``alpha''`` behind a_13, has a_22 for a_11 before ``xi''``, and
    writes ``m3 d2`` for ``m3 d``.
    """
    right = np.asarray(Q, dtype=np.float64) - velocity_terms(mechanism, q, qd)
    solution = np.linalg.solve(mass_matrix(mechanism, q), right[..., np.newaxis])[..., 0]
    return np.asarray(solution, dtype=np.float64)


def kinetic_energy(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike) -> Array:
    """Return the kinetic energy ``q'^T M q' / 2``, J, shape (...); q and qd as in `velocity_terms`."""
    rate = np.asarray(qd, dtype=np.float64)
    return np.asarray(0.5 * np.einsum("...i,...ij,...j->...", rate, mass_matrix(mechanism, q), rate), dtype=np.float64)


def potential_energy(mechanism: Mechanism, q: ArrayLike) -> Array:
    """Return the potential energy of the weights over C in battery, J, shape (...); q as in `mass_matrix`."""
    m, state = mechanism, np.asarray(q, dtype=np.float64)
    k = _geometry(m, state)
    moments = k.Sx1 * k.s1 + k.Sy1 * k.c1 + k.Sx2 * k.s2 + k.Sy2 * k.c2
    return m.g * ((m.m1 + m.m2 + m.m3) * state[..., 1] + moments)


def momentum(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike) -> Array:
    """Return the linear momentum (forward, up) of all bodies, kg m/s, shape (..., 2)."""
    rows = mass_matrix(mechanism, q)[..., :2, :]
    return np.asarray(np.einsum("...ij,...j->...i", rows, np.asarray(qd, dtype=np.float64)), dtype=np.float64)
