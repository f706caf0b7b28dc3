"""The acceleration a' of the identification equation (36), as sensors on the mechanism measure it.

Two ways lead to it and check one another: an accelerometer on the recoiling part, and the motion that a camera
sees, the relative one with accelerometers on the carriage, or from the ground the absolute one. Symbols, signs and
equation numbers are those of `recoil_rigs.mechanism.model`. Plain arrays, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.mechanism_parameters import Mechanism


def specific_acceleration(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Return a', the recoiling part's acceleration without gravity along -e5: ``m3 a' = P - R_f``, (36).

    Parameters
    ----------
    q, qd, qdd : array_like, shape (..., 5)
        State, rate and acceleration.

    Returns
    -------
    ndarray, shape (...)
        m/s^2, positive rearward; what an accelerometer at the centre of mass of B3 reads.

    Notes
    -----
    Misprint corrected: (10) has ``x''`` where ``x'' + d w2' + (b - x) w2^2`` stands, and (27) lacks the
    square of ``w2``.
    """
    m, state, rate = mechanism, np.asarray(q, dtype=np.float64), np.asarray(qd, dtype=np.float64)
    change = np.asarray(qdd, dtype=np.float64)
    f_x, f_y = carriage_specific_force(m, state, rate, change)
    return specific_acceleration_kinematic(
        m,
        change[..., 4],
        state[..., 4],
        rate[..., 2] + rate[..., 3],
        change[..., 2] + change[..., 3],
        f_x,
        f_y,
        state[..., 3],
    )


def carriage_specific_force(
    mechanism: Mechanism, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, r_x: float = 0.0, r_y: float = 0.0
) -> tuple[Array, Array]:
    """Return what accelerometers on the carriage read, gravity included, in carriage axes.

    Parameters
    ----------
    q, qd, qdd : array_like, shape (..., 5)
        State, rate and acceleration.
    r_x, r_y
        Place of the accelerometers from the trunnion A in carriage axes, m.

    Returns
    -------
    f_x, f_y : ndarray, shape (...)
        Specific force along the carriage's axes, m/s^2; at rest gravity resolved on them.

    Notes
    -----
    The acceleration of a point of B1, equation (1) differentiated. Misprint corrected: (1) labels
    accelerations as velocities.
    """
    m, state = mechanism, np.asarray(q, dtype=np.float64)
    rate, change = np.asarray(qd, dtype=np.float64), np.asarray(qdd, dtype=np.float64)
    phi1 = m.phi10 + state[..., 2]
    forward, up = change[..., 0], change[..., 1] + m.g
    x, y = m.XA + r_x, m.YA + r_y
    f_x = forward * np.cos(phi1) + up * np.sin(phi1) - change[..., 2] * y - rate[..., 2] ** 2 * x
    f_y = up * np.cos(phi1) - forward * np.sin(phi1) + change[..., 2] * x - rate[..., 2] ** 2 * y
    return f_x, f_y


def specific_acceleration_kinematic(
    mechanism: Mechanism,
    ddx: ArrayLike,
    x: ArrayLike,
    w2: ArrayLike,
    dw2: ArrayLike,
    f_x: ArrayLike,
    f_y: ArrayLike,
    beta: ArrayLike,
    *,
    w1: ArrayLike = 0.0,
    dw1: ArrayLike = 0.0,
    r_x: float = 0.0,
    r_y: float = 0.0,
) -> Array:
    """Return a' of (36) from the relative motion and the carriage's accelerometers.

    ``a' = x'' + d w2' + (b - x) w2^2 - (f_x cos(phi2 - phi1) + f_y sin(phi2 - phi1))`` with the specific
    force at A: gravity and the carriage's motion are all in it.

    Parameters
    ----------
    ddx, x : array_like, shape (...)
        Acceleration, m/s^2, and travel, m, of the recoiling part along the tipping part, rearward.
    w2, dw2 : array_like, shape (...)
        ``alpha' + beta'``, rad/s, and its derivative, rad/s^2.
    f_x, f_y : array_like, shape (...)
        Specific force that the carriage's accelerometers read, carriage axes, m/s^2.
    beta : array_like, shape (...)
        Rotation of the tipping part relative to the carriage from battery, rad.
    w1, dw1 : array_like, shape (...)
        ``alpha'``, rad/s, and its derivative, rad/s^2; needed if the accelerometers are not at A.
    r_x, r_y
        Place of the accelerometers from A, carriage axes, m.

    Returns
    -------
    ndarray, shape (...)
        m/s^2, positive rearward.

    Notes
    -----
    Misprints corrected: see `specific_acceleration`.
    """
    m = mechanism
    square1, angular1 = np.square(np.asarray(w1, dtype=np.float64)), np.asarray(dw1, dtype=np.float64)
    at_a_x = np.asarray(f_x, dtype=np.float64) + angular1 * r_y + square1 * r_x
    at_a_y = np.asarray(f_y, dtype=np.float64) - angular1 * r_x + square1 * r_y
    angle = m.phi20 - m.phi10 + np.asarray(beta, dtype=np.float64)
    turning = m.d * np.asarray(dw2, dtype=np.float64) + (m.b - np.asarray(x, dtype=np.float64)) * np.square(w2)
    total: Array = np.asarray(ddx, dtype=np.float64) + turning - at_a_x * np.cos(angle) - at_a_y * np.sin(angle)
    return total


def relative_acceleration(
    mechanism: Mechanism,
    a: ArrayLike,
    x: ArrayLike,
    w2: ArrayLike,
    dw2: ArrayLike,
    f_x: ArrayLike,
    f_y: ArrayLike,
    beta: ArrayLike,
    *,
    w1: ArrayLike = 0.0,
    dw1: ArrayLike = 0.0,
    r_x: float = 0.0,
    r_y: float = 0.0,
) -> Array:
    """Return x'' from a': the inverse of `specific_acceleration_kinematic`, whose parameters it shares.

    Parameters
    ----------
    a : array_like, shape (...)
        a' of (36), m/s^2, in the place of ``ddx``.

    Returns
    -------
    ndarray, shape (...)
        x'', m/s^2, positive rearward.

    Notes
    -----
    Misprints corrected: see `specific_acceleration`.
    """
    without_travel = specific_acceleration_kinematic(
        mechanism, 0.0, x, w2, dw2, f_x, f_y, beta, w1=w1, dw1=dw1, r_x=r_x, r_y=r_y
    )
    return np.asarray(a, dtype=np.float64) - without_travel


def specific_acceleration_inertial(
    acc: ArrayLike, w2: ArrayLike, dw2: ArrayLike, r5: float = 0.0, r6: float = 0.0
) -> Array:
    """Return a' of (36) from an accelerometer on the recoiling part: ``acc - r5 w2^2 - r6 w2'``.

    Parameters
    ----------
    acc : array_like, shape (...)
        Acceleration that the sensor reads along -e5, m/s^2, gravity included.
    w2, dw2 : array_like, shape (...)
        ``alpha' + beta'``, rad/s, and its derivative, rad/s^2.
    r5, r6
        Place of the sensor from the centre of mass of B3 along e5 and e6, m.

    Returns
    -------
    ndarray, shape (...)
        m/s^2, positive rearward.
    """
    squared, angular = np.square(np.asarray(w2, dtype=np.float64)), np.asarray(dw2, dtype=np.float64)
    return np.asarray(acc, dtype=np.float64) - r5 * squared - r6 * angular


def ground_acceleration(
    mechanism: Mechanism,
    a: ArrayLike,
    x: ArrayLike,
    dx: ArrayLike,
    turned: ArrayLike,
    w2: ArrayLike,
    dw2: ArrayLike,
    f_x: ArrayLike,
    f_y: ArrayLike,
    beta: ArrayLike,
    *,
    w1: ArrayLike = 0.0,
    dw1: ArrayLike = 0.0,
    r_x: float = 0.0,
    r_y: float = 0.0,
    p_5: float = 0.0,
    p_6: float = 0.0,
) -> Array:
    """Return the acceleration that a camera on the ground sees of a mark on B3 along the bore at rest, from a'.

    It sees ``s = -(r - r(0)) . e5(0)`` of the mark's place r. With the angle th by which the bore has turned since,
    ``e5(0) = e5 cos th - e6 sin th``, and the specific force of the centre of mass is -a' along e5 and f_6 along e6, so
    that ``s'' = a' cos th + f_6 sin th + g sin(phi20)`` there: gravity is constant on the ground. Across the bore
    ``f_6 = f_A,6 + (b - x) w2' - d w2^2 - 2 x' w2`` with the specific force f_A at the trunnion. A mark at (p_5, p_6)
    from the centre of mass adds the second derivative of ``p_5 (1 - cos th) + p_6 sin th``.

    Parameters
    ----------
    a : array_like, shape (...)
        a' of (36), m/s^2.
    x, dx : array_like, shape (...)
        Travel along the tipping part, m, and its rate, m/s, for terms that the angle makes small.
    turned : array_like, shape (...)
        th, rad.
    w2, dw2, f_x, f_y, beta, w1, dw1, r_x, r_y
        Arguments of `specific_acceleration_kinematic`.
    p_5, p_6
        Place of the mark from the centre of mass of B3 along e5 and e6, m.

    Returns
    -------
    ndarray, shape (...)
        m/s^2, positive rearward.
    """
    m = mechanism
    th, rate, change = (np.asarray(value, dtype=np.float64) for value in (turned, w2, dw2))
    square1, angular1 = np.square(np.asarray(w1, dtype=np.float64)), np.asarray(dw1, dtype=np.float64)
    at_a_x = np.asarray(f_x, dtype=np.float64) + angular1 * r_y + square1 * r_x
    at_a_y = np.asarray(f_y, dtype=np.float64) - angular1 * r_x + square1 * r_y
    angle = m.phi20 - m.phi10 + np.asarray(beta, dtype=np.float64)
    across = at_a_y * np.cos(angle) - at_a_x * np.sin(angle)
    across = across + (m.b - np.asarray(x, dtype=np.float64)) * change - m.d * rate**2
    across = across - 2.0 * np.asarray(dx, dtype=np.float64) * rate
    of_mark = p_5 * (change * np.sin(th) + rate**2 * np.cos(th)) + p_6 * (change * np.cos(th) - rate**2 * np.sin(th))
    total = np.asarray(a, dtype=np.float64) * np.cos(th) + across * np.sin(th) + m.g * np.sin(m.phi20) + of_mark
    return np.asarray(total, dtype=np.float64)
