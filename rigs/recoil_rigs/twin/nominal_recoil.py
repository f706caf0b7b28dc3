"""A shot by the virtual rig's settings alone, of a recoiling part on a line: what sizes of forces are shares of.

The carriage stands still and nothing is unread: ``m3 x'' = P - K - R - Q + m3 g sin(phi20)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_rigs.mechanism.model import Mechanism

_STEP_S = 1e-4
_LONGEST_S = 2.0


@dataclass(frozen=True, eq=False)
class NominalRecoil(ReadOnlyArrays):
    """Recoil from the first rise of the breech force to the end of the travel, shape (n,) each.

    Attributes
    ----------
    travel_m, speed_m_s
        Travel and its rate.
    brake_n, recuperator_n
        Forces of brake and recuperator.
    friction_n
        Packing friction.
    """

    times_s: Array
    travel_m: Array
    speed_m_s: Array
    brake_n: Array
    recuperator_n: Array
    friction_n: float

    @property
    def largest_force_n(self) -> float:
        """Largest resistance of brake, recuperator and packing together."""
        return float((self.brake_n + self.recuperator_n).max()) + self.friction_n

    def impulse_n_s(self, force_n: Array) -> float:
        """Return the integral of a force over the recoil."""
        return float(np.trapezoid(force_n, self.times_s))


def nominal_recoil(
    m: Mechanism,
    pressures_pa: Callable[[float, float], tuple[float, float]],
    breech_pa: Callable[[Array], Array],
) -> NominalRecoil:
    """Integrate the recoil of the nominal shot, by the classical Runge-Kutta method.

    Parameters
    ----------
    pressures_pa
        Function from travel and its rate to the pressures of brake and recuperator.
    breech_pa
        Function from times since its first rise to the breech pressure.
    """
    steps = math.ceil(_LONGEST_S / _STEP_S)
    drive = (m.force_areas[0] * breech_pa(np.arange(2 * steps + 1, dtype=np.float64) * (0.5 * _STEP_S))).tolist()
    weight = m.m3 * m.g * math.sin(m.phi20)

    def acceleration(x: float, v: float, force: float) -> float:
        brake, gas = pressures_pa(x, v)
        net = force - m.brake_area * brake - m.recuperator_area * gas - m.friction + weight
        return max(net, 0.0) / m.m3 if x <= 0.0 and v <= 0.0 else net / m.m3

    x, v, h = 0.0, 0.0, _STEP_S
    rows = []
    for i in range(steps):
        brake, gas = pressures_pa(x, v)
        rows.append((i * h, x, v, m.brake_area * brake, m.recuperator_area * gas))
        now, middle, then = drive[2 * i : 2 * i + 3]
        a1 = acceleration(x, v, now)
        v2 = v + 0.5 * h * a1
        a2 = acceleration(x + 0.5 * h * v, v2, middle)
        v3 = v + 0.5 * h * a2
        a3 = acceleration(x + 0.5 * h * v2, v3, middle)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4, then)
        x, v = x + h / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        if v <= 0.0 and x > 1e-3:
            break
    times_s, travel_m, speed_m_s, brake_n, recuperator_n = np.array(rows).T
    return NominalRecoil(times_s, travel_m, speed_m_s, brake_n, recuperator_n, m.friction)
