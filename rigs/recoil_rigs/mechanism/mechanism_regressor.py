"""The equations of motion as they are linear in the masses: ``Y(q, q', q'') theta = Q``.

Every term of `model.mass_matrix` and `model.velocity_terms` is linear in the bodies' masses,
first moments of mass and moments of inertia once the recoiling part is described about the trunnion A in
battery::

    theta = [m1, m1 X1, m1 Y1, J1,  m2, m2 s2, m2 d2, J2,  m3, m3 b, m3 d, J3A]
    J3A   = J3c + m3 (b^2 + d^2)

A recoil x moves the recoiling part's own moment and inertia by ``-m3 x`` and by ``-2 x m3 b + m3 x^2``. The
carriage's moments are about C in carriage axes, those of the tipping part about A in tipping axes. What stays
outside of theta is geometry: the trunnion's place, the angles in battery, the lines along which loads act.

Model: R. Xu, Q. Chen, G. Yang, H. Yan, Journal of Vibroengineering, 2013, equations (18) to (27), with the
misprints corrected that `recoil_rigs.mechanism.model` names. Linearity in these parameters: M. Gautier, W. Khalil,
"Direct calculation of minimum set of inertial parameters of serial robots", IEEE Trans. Robotics and Automation 6,
1990.

Plain arithmetic on arrays, SI units: states have shape ``(..., 5)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.model import Mechanism

PARAMETERS = ("m1", "m1 X1", "m1 Y1", "J1", "m2", "m2 s2", "m2 d2", "J2", "m3", "m3 b", "m3 d", "J3A")
"""Order of the standard parameters."""
PARAMETER_UNITS = ("kg", "kg m", "kg m", "kg m^2") * 3
LOADS = ("breech", "resistance", "elevating", "ground_x", "ground_y", "ground_d", "ground_friction")
"""Order of the loads: arguments of `recoil_rigs.mechanism.model.generalized_forces`, in its signs."""
EQUATIONS = ("forward", "upward", "turning about C", "turning about A", "along the bore")
"""Order of the equations of motion."""


@dataclass(frozen=True)
class Geometry:
    """Geometry of a mechanism that the regressor takes as known, m and rad, m/s^2.

    Attributes
    ----------
    XA, YA
        Trunnion from C, carriage axes.
    phi10, phi20
        Angles of carriage and bore axis over the horizontal in battery.
    force_line
        Line of the breech force above A in tipping axes: ``e + d``.
    L
        Ground contact D ahead of C.
    """

    XA: float
    YA: float
    phi10: float
    phi20: float
    force_line: float
    L: float
    g: float

    @classmethod
    def of(cls, mechanism: Mechanism) -> Geometry:
        """Take the geometry of a mechanism; NaN where it is not declared."""
        m = mechanism
        return cls(m.XA, m.YA, m.phi10, m.phi20, m.e + m.d, m.L, m.g)


def standard_parameters(mechanism: Mechanism) -> Array:
    """Return theta of a mechanism, shape (12,), in the order of `PARAMETERS`; NaN where it is not declared."""
    m = mechanism
    return np.array(
        [
            *(m.m1, m.m1 * m.X1, m.m1 * m.Y1, m.J1),
            *(m.m2, m.m2 * m.s2, m.m2 * m.d2, m.J2),
            *(m.m3, m.m3 * m.b, m.m3 * m.d, m.J3c + m.m3 * (m.b**2 + m.d**2)),
        ]
    )


def regressor(geometry: Geometry, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Return Y of ``Y theta = M q'' + h``, the five equations of motion.

    Parameters
    ----------
    q, qd, qdd : array_like, shape (..., 5)
        State ``[xi, eta, alpha, beta, x]``, its rate and its acceleration, SI.

    Returns
    -------
    ndarray, shape (..., 5, 12)
        Columns in the order of `PARAMETERS`; N, or N m, per unit of each.
    """
    state, rate, change = (np.asarray(v, dtype=np.float64) for v in (q, qd, qdd))
    k = geometry
    phi1 = k.phi10 + state[..., 2]
    phi2 = k.phi20 + state[..., 2] + state[..., 3]
    c1, s1, c2, s2 = np.cos(phi1), np.sin(phi1), np.cos(phi2), np.sin(phi2)
    cd, sd = np.cos(phi2 - phi1), np.sin(phi2 - phi1)
    A5, A6 = k.XA * cd + k.YA * sd, k.YA * cd - k.XA * sd
    x, dx, ddx = state[..., 4], rate[..., 4], change[..., 4]
    w1, w2 = rate[..., 2], rate[..., 2] + rate[..., 3]
    dw1, dw2 = change[..., 2], change[..., 2] + change[..., 3]
    forward, up = change[..., 0], change[..., 1] + k.g

    Y = np.zeros((*np.broadcast_shapes(state.shape, rate.shape, change.shape)[:-1], 5, len(PARAMETERS)))
    # a mass at C, then one that is moved along, and across, the carriage
    Y[..., 0, 0], Y[..., 1, 0] = forward, up
    Y[..., 0, 1], Y[..., 1, 1], Y[..., 2, 1] = -s1 * dw1 - c1 * w1**2, c1 * dw1 - s1 * w1**2, c1 * up - s1 * forward
    Y[..., 0, 2], Y[..., 1, 2], Y[..., 2, 2] = -c1 * dw1 + s1 * w1**2, -s1 * dw1 - c1 * w1**2, -s1 * up - c1 * forward
    Y[..., 2, 3] = dw1
    # a mass at A: one at C, moved to the trunnion
    Y[..., :, 4] = Y[..., :, 0] + k.XA * Y[..., :, 1] + k.YA * Y[..., :, 2] + (k.XA**2 + k.YA**2) * Y[..., :, 3]
    # specific force of A along e5 and e6
    a5 = c2 * forward + s2 * up - dw1 * A6 - w1**2 * A5
    a6 = c2 * up - s2 * forward + dw1 * A5 - w1**2 * A6
    along = np.stack((-s2 * dw2 - c2 * w2**2, c2 * dw2 - s2 * w2**2), axis=-1)
    across = np.stack((-c2 * dw2 + s2 * w2**2, -s2 * dw2 - c2 * w2**2), axis=-1)
    # the moment about C is that about A and, with the lever A, of the force
    Y[..., :2, 5], Y[..., 3, 5] = along, a6
    Y[..., 2, 5] = a6 + A5 * dw2 + A6 * w2**2
    Y[..., :2, 6], Y[..., 3, 6] = across, -a5
    Y[..., 2, 6] = -a5 - A5 * w2**2 + A6 * dw2
    Y[..., 2, 7] = Y[..., 3, 7] = dw2
    Y[..., :, 8] = Y[..., :, 4] - x[..., np.newaxis] * Y[..., :, 5]
    coriolis = 2.0 * dx * w2
    Y[..., 0, 8] += -c2 * ddx + s2 * coriolis
    Y[..., 1, 8] += -s2 * ddx - c2 * coriolis
    Y[..., 2, 8] += A6 * ddx - A5 * coriolis + x**2 * dw2 + 2.0 * x * dx * w2
    Y[..., 3, 8] += x**2 * dw2 + 2.0 * x * dx * w2
    Y[..., 4, 8] = ddx - a5 - x * w2**2
    Y[..., :, 9] = Y[..., :, 5]
    Y[..., 2, 9] += -2.0 * x * dw2 - coriolis
    Y[..., 3, 9] += -2.0 * x * dw2 - coriolis
    Y[..., 4, 9] = w2**2
    Y[..., :, 10] = Y[..., :, 6]
    Y[..., 2, 10] += ddx
    Y[..., 3, 10] += ddx
    Y[..., 4, 10] = dw2
    Y[..., :, 11] = Y[..., :, 7]
    return Y


def load_directions(geometry: Geometry, alpha: ArrayLike, beta: ArrayLike) -> Array:
    """Return B of ``Q = B loads``: what a unit of each load does in each equation, equations (6) and (17).

    Parameters
    ----------
    alpha, beta : array_like, shape (...)
        Rotations since battery, rad.

    Returns
    -------
    ndarray, shape (..., 5, 7)
        Columns in the order of `LOADS`.
    """
    k = geometry
    first, second = np.asarray(alpha, dtype=np.float64), np.asarray(beta, dtype=np.float64)
    phi1, phi2 = k.phi10 + first, k.phi20 + first + second
    A6 = k.YA * np.cos(phi2 - phi1) - k.XA * np.sin(phi2 - phi1)
    B = np.zeros((*np.broadcast_shapes(first.shape, second.shape), 5, len(LOADS)))
    B[..., 0, 0], B[..., 1, 0], B[..., 2, 0] = -np.cos(phi2), -np.sin(phi2), k.force_line + A6
    B[..., 3, 0], B[..., 4, 0] = k.force_line, 1.0
    B[..., 4, 1] = B[..., 3, 2] = B[..., 0, 3] = B[..., 1, 4] = B[..., 1, 5] = B[..., 0, 6] = -1.0
    B[..., 2, 5], B[..., 2, 6] = -k.L * np.cos(phi1), k.L * np.sin(phi1)
    return B
