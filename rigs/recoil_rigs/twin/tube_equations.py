"""The equations of `recoil_rigs.mechanism.flexible_tube` for one state at a time, in plain floats.

Bending acts on the recoiling part through three velocities only: v5 and v6 of its centre of mass along and across the
bore, and its angular rate w2. The modes, whose mass matrix is diagonal, are taken out there; what remains of them, a
symmetric matrix and a force of three, joins the rigid bodies' rows, their two translations turned into the bore's axes.
"""

from __future__ import annotations

import numpy as np

from recoil_rigs.mechanism.flexible_tube import FlexibleTube
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.equations import Equations, rigid_rows
from recoil_rigs.twin.loads import Rest, State
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import Unread


def tube_equations(
    m: Mechanism, tube: FlexibleTube, s: TwinSettings, friction_n: float, rest: Rest, unread: Unread | None
) -> Equations:
    """Return the equations of motion of the rigid bodies and the tube's modes.

    A tube of one mode has a second one here that is never moved: loops over the modes would take four times as long.
    Oil that is carried along is an inertia of the travel alone.

    Parameters
    ----------
    rest
        State of the mechanism at rest before anything let go, the tube's sag included.
    unread
        Force that no gauge reads; None if there is none.

    Returns
    -------
    callable
        Function of a state of ``5 + n`` coordinates, their rates, and the packing's bristle, of breech force and time.

    Raises
    ------
    ValueError
        If the tube has more than two modes.
    """
    if tube.modes > 2:
        raise ValueError(f"the tube must have one mode or two, found {tube.modes}")
    rows = rigid_rows(m, s, friction_n, rest, unread)
    mass, along_m3, d, g = m.m1 + m.m2 + m.m3, m.m3 + s.unread.carried_oil_kg, m.d, m.g
    two, off = tube.modes == 2, tube.offset_m
    per_mass = 1.0 / tube.mass_kg
    spare = (0, 2 - tube.modes)
    (S1, S2), (H1, H2) = (np.pad(v, spare).tolist() for v in (tube.first, tube.moment))
    (k1, k2), (c1, c2) = (np.pad(v, spare).tolist() for v in (tube.stiffness_n_m, tube.damping_n_s_m))
    rest_of_mass = tube.mass_kg * np.eye(tube.modes) - tube.shortening_moment
    (G11, G12), (_, G22) = np.pad(tube.shortening, spare).tolist()
    (R11, R12), (_, R22) = np.pad(rest_of_mass, spare).tolist()

    def evaluate(y: State, P: float, t: float) -> tuple[State, State]:
        if two:
            q, p1, p2, qd, v1, v2 = y[:5], y[5], y[6], y[7:12], y[12], y[13]
        else:
            q, p1, p2, qd, v1, v2 = y[:5], y[5], 0.0, y[6:11], y[11], 0.0
        matrix, right, (cos, sin, A5, A6, lever), recorded, drag = rows(q, qd, y[-1], P, t)
        a13, a14, a15, a23, a24, a25, a33, a34, a35, a44, a45 = matrix
        r1, r2, r3, r4, r5 = right
        w1, dx = qd[2], qd[4]
        w2 = w1 + qd[3]
        turn, far, up = w2 * w2, A5 + lever, -(A6 + d)

        g1, g2 = G11 * p1 + G12 * p2, G12 * p1 + G22 * p2
        gv1, gv2 = G11 * v1 + G12 * v2, G12 * v1 + G22 * v2
        z1, z2 = R11 * p1 + R12 * p2, R12 * p1 + R22 * p2
        s_p, s_v, half = S1 * p1 + S2 * p2, S1 * v1 + S2 * v2, 0.5 * (p1 * g1 + p2 * g2)
        v_g_v, p_g_v = v1 * gv1 + v2 * gv2, p1 * gv1 + p2 * gv2
        a5 = -w1 * w1 * A5 - turn * lever + g * sin
        a6 = -w1 * w1 * A6 - turn * d - 2.0 * w2 * dx + g * cos
        arm1, arm2 = H1 + off * g1, H2 + off * g2
        bent1 = S1 * a6 - g1 * a5 - turn * (off * S1 + z1) + k1 * p1 + c1 * v1
        bent2 = S2 * a6 - g2 * a5 - turn * (off * S2 + z2) + k2 * p2 + c2 * v2
        # forces along v5, v6 and w2, and the matrix there, both without the modes
        e1, e2 = bent1 * per_mass, bent2 * per_mass
        f5 = 2.0 * w2 * s_v + v_g_v - turn * half - g1 * e1 - g2 * e2
        f6 = turn * s_p + 2.0 * w2 * p_g_v + S1 * e1 + S2 * e2
        fw = a5 * s_p + a6 * half - off * v_g_v - 2.0 * w2 * (off * s_v + z1 * v1 + z2 * v2) + arm1 * e1 + arm2 * e2
        D55, D56 = -(g1 * g1 + g2 * g2) * per_mass, (g1 * S1 + g2 * S2) * per_mass
        D66, D6w = -(S1 * S1 + S2 * S2) * per_mass, -half - (S1 * arm1 + S2 * arm2) * per_mass
        D5w = -s_p + (g1 * arm1 + g2 * arm2) * per_mass
        Dww = 2.0 * off * s_p + p1 * z1 + p2 * z2 - (arm1 * arm1 + arm2 * arm2) * per_mass

        # what turning the carriage (3) and the tipping part (4) calls forth along v5, v6 and w2
        t35, t36, t3w = up * D55 + far * D56 + D5w, up * D56 + far * D66 + D6w, up * D5w + far * D6w + Dww
        t45, t46, t4w = -d * D55 + lever * D56 + D5w, -d * D56 + lever * D66 + D6w, -d * D5w + lever * D6w + Dww
        m11, m22 = mass + D55, mass + D66
        m13, m23 = cos * a13 + sin * a23 + t35, cos * a23 - sin * a13 + t36
        m14, m24 = cos * a14 + sin * a24 + t45, cos * a24 - sin * a14 + t46
        m15, m25 = cos * a15 + sin * a25 - D55, cos * a25 - sin * a15 - D56
        m33, m34, m35 = a33 + up * t35 + far * t36 + t3w, a34 - d * t35 + lever * t36 + t3w, a35 - t35
        m44, m45, m55 = a44 - d * t45 + lever * t46 + t4w, a45 - t45, along_m3 + D55
        b1, b2 = cos * r1 + sin * r2 + f5, cos * r2 - sin * r1 + f6
        b3, b4, b5 = r3 + up * f5 + far * f6 + fw, r4 - d * f5 + lever * f6 + fw, r5 - f5

        # symmetric elimination, from the first row to the last
        l2, l3, l4, l5 = D56 / m11, m13 / m11, m14 / m11, m15 / m11
        m22, m23, m24, m25, b2 = m22 - l2 * D56, m23 - l2 * m13, m24 - l2 * m14, m25 - l2 * m15, b2 - l2 * b1
        m33, m34, m35, b3 = m33 - l3 * m13, m34 - l3 * m14, m35 - l3 * m15, b3 - l3 * b1
        m44, m45, b4 = m44 - l4 * m14, m45 - l4 * m15, b4 - l4 * b1
        m55, b5 = m55 - l5 * m15, b5 - l5 * b1
        l3, l4, l5 = m23 / m22, m24 / m22, m25 / m22
        m33, m34, m35, b3 = m33 - l3 * m23, m34 - l3 * m24, m35 - l3 * m25, b3 - l3 * b2
        m44, m45, b4 = m44 - l4 * m24, m45 - l4 * m25, b4 - l4 * b2
        m55, b5 = m55 - l5 * m25, b5 - l5 * b2
        l4, l5 = m34 / m33, m35 / m33
        m44, m45, b4 = m44 - l4 * m34, m45 - l4 * m35, b4 - l4 * b3
        m55, b5 = m55 - l5 * m35, b5 - l5 * b3
        l5 = m45 / m44
        ddx = (b5 - l5 * b4) / (m55 - l5 * m45)
        ddbeta = (b4 - m45 * ddx) / m44
        ddalpha = (b3 - m34 * ddbeta - m35 * ddx) / m33
        across = (b2 - m23 * ddalpha - m24 * ddbeta - m25 * ddx) / m22
        along = (b1 - D56 * across - m13 * ddalpha - m14 * ddbeta - m15 * ddx) / m11

        u5 = along + up * ddalpha - d * ddbeta - ddx
        u6, uw = across + far * ddalpha + lever * ddbeta, ddalpha + ddbeta
        rigid = (cos * along - sin * across, sin * along + cos * across, ddalpha, ddbeta, ddx)
        first = -e1 + per_mass * (g1 * u5 - S1 * u6 - arm1 * uw)
        if two:
            return (*rigid, first, -e2 + per_mass * (g2 * u5 - S2 * u6 - arm2 * uw), drag), recorded
        return (*rigid, first, drag), recorded

    return evaluate
