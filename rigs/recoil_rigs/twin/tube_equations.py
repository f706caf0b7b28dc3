"""The equations of `recoil_rigs.flexible_tube` for one state at a time, in plain floats."""

from __future__ import annotations

from recoil_rigs.flexible_tube import FlexibleTube
from recoil_rigs.mechanism import Mechanism
from recoil_rigs.twin.equations import Equations, rigid_rows
from recoil_rigs.twin.loads import Rest, State
from recoil_rigs.twin.settings import TwinSettings


def tube_equations(m: Mechanism, tube: FlexibleTube, s: TwinSettings, friction_n: float, rest: Rest) -> Equations:
    """Return the equations of motion of the rigid bodies and the tube's modes.

    Parameters
    ----------
    rest
        Of the mechanism before anything let go, the tube's sag included.

    Returns
    -------
    callable
        Of a state of ``5 + n`` coordinates, their rates, and the packing's bristle.
    """
    rows = rigid_rows(m, s, friction_n, rest)
    mass, m3, d, g = m.m1 + m.m2 + m.m3, m.m3, m.d, m.g
    n, modal_mass, off = tube.modes, tube.mass_kg, tube.offset_m
    modes = range(n)
    S, H, k, c = (v.tolist() for v in (tube.first, tube.moment, tube.stiffness_n_m, tube.damping_n_s_m))
    G, K = tube.shortening.tolist(), tube.shortening_moment.tolist()

    def evaluate(y: State, P: float) -> tuple[State, State]:
        p, v = y[5 : 5 + n], y[10 + n : 10 + 2 * n]
        rates = y[5 + n : 10 + n]
        matrix, right, (c2, s2, A5, A6, lever), recorded, drag = rows(y[:5], rates, y[-1], P)
        a13, a14, a15, a23, a24, a25, a33, a34, a35, a44, a45 = matrix
        w1, dx = rates[2], rates[4]
        w2 = w1 + rates[3]
        g_p = [sum(G[i][j] * p[j] for j in modes) for i in modes]
        g_v = [sum(G[i][j] * v[j] for j in modes) for i in modes]
        rest_p = [modal_mass * p[i] - sum(K[i][j] * p[j] for j in modes) for i in modes]
        s_p, s_v = sum(S[i] * p[i] for i in modes), sum(S[i] * v[i] for i in modes)
        half = 0.5 * sum(p[i] * g_p[i] for i in modes)
        v_g_v, p_g_v = sum(v[i] * g_v[i] for i in modes), sum(p[i] * g_v[i] for i in modes)
        a5 = -w1 * w1 * A5 - w2 * w2 * lever + g * s2
        a6 = -w1 * w1 * A6 - w2 * w2 * d - 2.0 * w2 * dx + g * c2
        f5 = -2.0 * w2 * s_v - v_g_v + w2 * w2 * half
        f6 = -w2 * w2 * s_p - 2.0 * w2 * p_g_v
        fw = -a5 * s_p - a6 * half + off * v_g_v + 2.0 * w2 * (off * s_v + sum(rest_p[i] * v[i] for i in modes))
        along = (c2, s2, -(A6 + d), -d, -1.0)
        across = (-s2, c2, A5 + lever, lever, 0.0)
        turning = (0.0, 0.0, 1.0, 1.0, 0.0)
        d22 = 2.0 * off * s_p + sum(p[i] * rest_p[i] for i in modes)
        arm = [H[i] + off * g_p[i] for i in modes]

        M = [
            [mass, 0.0, a13, a14, a15],
            [0.0, mass, a23, a24, a25],
            [a13, a23, a33, a34, a35],
            [a14, a24, a34, a44, a45],
            [a15, a25, a35, a45, m3],
        ]
        rhs = [r - (f5 * a + f6 * b + fw * t) for r, a, b, t in zip(right, along, across, turning, strict=True)]
        coupled = []
        for i in range(5):
            a, b, t = along[i], across[i], turning[i]
            pushed, lifted, turned = -s_p * t, -half * t, -s_p * a - half * b + d22 * t
            row = M[i]
            for j in range(5):
                row[j] += along[j] * pushed + across[j] * lifted + turning[j] * turned
            coupled.append([-g_p[q] * a + S[q] * b + arm[q] * t for q in modes])
        for q in modes:
            bent = S[q] * a6 - g_p[q] * a5 - w2 * w2 * (off * S[q] + rest_p[q]) + k[q] * p[q] + c[q] * v[q]
            # the modes have a diagonal block: take them out, five equations remain
            for i in range(5):
                share = coupled[i][q] / modal_mass
                rhs[i] += share * bent
                row = M[i]
                for j in range(5):
                    row[j] -= share * coupled[j][q]
        found = _solved(M, rhs)
        modal = []
        for q in modes:
            bent = S[q] * a6 - g_p[q] * a5 - w2 * w2 * (off * S[q] + rest_p[q]) + k[q] * p[q] + c[q] * v[q]
            modal.append(-(bent + sum(coupled[i][q] * found[i] for i in range(5))) / modal_mass)
        return (*found, *modal, drag), recorded

    return evaluate


def _solved(M: list[list[float]], rhs: list[float]) -> list[float]:
    """Solve a symmetric positive definite system of five equations; both arguments are used up."""
    for i in range(5):
        pivot, top = M[i][i], M[i]
        for j in range(i + 1, 5):
            factor = M[j][i] / pivot
            if factor:
                row = M[j]
                for column in range(i + 1, 5):
                    row[column] -= factor * top[column]
                rhs[j] -= factor * rhs[i]
    found = [0.0] * 5
    for i in range(4, -1, -1):
        row = M[i]
        found[i] = (rhs[i] - sum(row[j] * found[j] for j in range(i + 1, 5))) / row[i]
    return found
