"""The packing friction as an unknown of the equation of motion, and whether the shot or the declaration told it.

The declaration and the shot are two sources of one number. In the calibrated estimate they are combined
(`calibration`); the variance that is left, over that of the declaration alone, tells what the shot
added. The gain of information is half the logarithm of their ratio, in bits (D. V. Lindley, Ann. Math. Stat. 27,
1956). Without the declaration the same estimate gives the shot's own word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.estimate.mass import FRICTION
from recoil_identification.rows import equation_of_motion as motion

SHOT_DECIDES_BITS = 0.5
"""Gain from which on the shot tells more than the declaration: half of the variance is gone."""


@dataclass(frozen=True)
class Friction:
    """The packing friction, N.

    Attributes
    ----------
    value_n, u_n
        Friction and its standard uncertainty by declaration and shot together.
    by_shot_n, u_by_shot_n
        Friction and its standard uncertainty by the shot alone, with the calibrations of the other sensors; infinite
        uncertainty where it tells nothing.
    gain_bits
        Information that the shot added to the declaration; infinite where nothing was declared of its uncertainty.
    """

    declared_n: float
    u_declared_n: float
    value_n: float
    u_n: float
    by_shot_n: float
    u_by_shot_n: float
    gain_bits: float

    @property
    def basis(self) -> str:
        """Who told it."""
        if not self.u_declared_n > 0:
            return "by the declaration, which states no uncertainty and so is taken as exact"
        if self.gain_bits >= SHOT_DECIDES_BITS:
            return f"mainly by the shot, {self.gain_bits:.2f} bits beyond the declaration"
        return f"mainly by the declaration, to which the shot adds {self.gain_bits:.2f} bits"


def packing_friction(
    calibration: Calibration, *, declared_n: float, u_declared_n: float, u_further_n: float = 0.0
) -> Friction:
    """Separate what declaration and shot say of the packing friction.

    Parameters
    ----------
    calibration
        Calibration with the declaration.
    u_further_n
        Standard uncertainty of a force that acts like friction and that the calibration does not know.
    """
    alone = calibration.without_prior(FRICTION)
    by_shot, u_by_shot = declared_n - alone.friction_error_n, alone.inferred.u(motion.FRICTION.name)
    value, u = declared_n - calibration.friction_error_n, calibration.inferred.u(motion.FRICTION.name)
    if math.isfinite(u_by_shot):
        u_by_shot = math.hypot(u_by_shot, u_further_n)
    gain = math.inf
    if u_declared_n > 0:
        if math.isfinite(u_by_shot) and u_further_n > 0:
            # the further force spoils the shot's word and not the declaration's
            u = max(u, 1.0 / math.hypot(1.0 / u_declared_n, 1.0 / u_by_shot))
        gain = math.log2(u_declared_n / u) if u > 0 else math.inf
    return Friction(declared_n, u_declared_n, value, u, by_shot, u_by_shot, gain)
