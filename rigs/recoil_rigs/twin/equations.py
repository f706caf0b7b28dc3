"""The equations of motion for one state at a time, those of `recoil_rigs.mechanism.model` in plain floats.

The rows of the rigid bodies are set up once for both models: the rigid one takes them apart by hand, the
one with a flexible tube (`recoil_rigs.twin.tube_equations`) adds to them what bending does.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.loads import Rest, State, loads_of
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import Unread

Equations = Callable[[State, float, float], tuple[State, State]]
"""Function from state (coordinates, rates, bristle of the packing), breech force and time to their rates' rates and the
loads: accelerations of all coordinates and the bristle's drag, and what `recoil_rigs.twin.loads.Loads` has recorded."""


Rows = tuple[State, State, State, State, float]
"""Mass matrix and right-hand sides of the rigid bodies at a state, their geometry, what is recorded, and the drag.

The matrix holds M13, M14, M15, M23, M24, M25, M33, M34, M35, M44 and M45; the diagonal of the translations and
M55 are the masses themselves. The geometry holds cos phi2, sin phi2, the trunnion along e5 and e6 from C, and
b - x. What is recorded and the bristle's drag are those of `recoil_rigs.twin.loads.Loads`.
"""


def rigid_rows(
    m: Mechanism, s: TwinSettings, friction_n: float, rest: Rest, unread: Unread | None
) -> Callable[[State, State, float, float, float], Rows]:
    """Return a function from coordinates, rates, bristle, breech force and time to the rows of the rigid bodies.

    Parameters
    ----------
    rest
        State of the mechanism at rest before anything let go.
    unread
        Force that no gauge reads; None if there is none.
    """
    sin, cos = math.sin, math.cos
    mass, g, XA, YA, b, d, L, m3 = m.m1 + m.m2 + m.m3, m.g, m.XA, m.YA, m.b, m.d, m.L, m.m3
    Sx1, Sy1 = m.m1 * m.X1 + (m.m2 + m3) * XA, m.m1 * m.Y1 + (m.m2 + m3) * YA
    Sy2, m2s2 = m.m2 * m.d2 + m3 * d, m.m2 * m.s2
    J_tip = m.J2 + m.J3c + m3 * d * d
    J_all = m.J1 + (m.m2 + m3) * (XA * XA + YA * YA)
    difference = m.phi20 - m.phi10
    loads = loads_of(m, s, friction_n, rest, unread)

    def rows(q: State, qd: State, bristle: float, P: float, t: float) -> Rows:
        (xi, eta, alpha, beta, x), (dxi, deta, w1, dbeta, dx) = q, qd
        phi1, angle = m.phi10 + alpha, difference + beta
        c1, s1, cd, sd = cos(phi1), sin(phi1), cos(angle), sin(angle)
        c2, s2 = c1 * cd - s1 * sd, s1 * cd + c1 * sd
        w2, lever = w1 + dbeta, b - x
        A5, A6 = XA * cd + YA * sd, YA * cd - XA * sd
        Sx2 = m2s2 + m3 * lever
        R, M_C, N_x, N_y, N_d, N_f, recorded, drag = loads(
            xi, eta, beta, x, dxi, deta, w1, dbeta, dx, bristle, c1, s1, t
        )

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

        a13, a14, a15 = -(side1 + side2), -side2, -m3 * c2
        a23, a24, a25 = rise1 + rise2, rise2, -m3 * s2
        coupling = Sx2 * A5 + Sy2 * A6
        J23 = J_tip + m3 * lever * lever
        a33, a34, a35 = J_all + J23 + 2.0 * coupling, J23 + coupling, m3 * (d + A6)
        matrix = (a13, a14, a15, a23, a24, a25, a33, a34, a35, J23, m3 * d)
        return matrix, (r1, r2, r3, r4, r5), (c2, s2, A5, A6, lever), recorded, drag

    return rows


def rigid_equations(m: Mechanism, s: TwinSettings, friction_n: float, rest: Rest, unread: Unread | None) -> Equations:
    """Return the equations of motion of the rigid bodies; parameters as of `rigid_rows`.

    Oil that is carried along is an inertia of the travel alone.
    """
    rows = rigid_rows(m, s, friction_n, rest, unread)
    mass, along = m.m1 + m.m2 + m.m3, m.m3 + s.unread.carried_oil_kg

    def evaluate(y: State, P: float, t: float) -> tuple[State, State]:
        matrix, right, _, recorded, drag = rows(y[:5], y[5:10], y[10], P, t)
        a13, a14, a15, a23, a24, a25, a33, a34, a35, a44, a45 = matrix
        r1, r2, r3, r4, r5 = right
        # the two translations have a diagonal block: take them out, three equations remain
        k33 = a33 - (a13 * a13 + a23 * a23) / mass
        k34 = a34 - (a13 * a14 + a23 * a24) / mass
        k35 = a35 - (a13 * a15 + a23 * a25) / mass
        k44 = a44 - (a14 * a14 + a24 * a24) / mass
        k45 = a45 - (a14 * a15 + a24 * a25) / mass
        k55 = along - (a15 * a15 + a25 * a25) / mass
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
        return (ddxi, ddeta, ddalpha, ddbeta, ddx, drag), recorded

    return evaluate
