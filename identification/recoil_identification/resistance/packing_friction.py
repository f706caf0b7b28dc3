"""The packing friction as an unknown of the equation of motion, and whether the shot or the declaration told it.

The declaration and the shot are two sources of one number. In the calibrated estimate they are combined
(`calibration`); the variance that is left, over that of the declaration alone, tells what the shot
added. The gain of information is half the logarithm of their ratio, in bits (D. V. Lindley, Ann. Math. Stat. 27,
1956). With a declaration so wide that it tells nothing, the same estimate gives the shot's own word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from recoil_identification.calibration import Calibration, calibrated_mass
from recoil_identification.mass import FRICTION
from recoil_identification.sensor_priors import CameraScale
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty

WIDE = 10.0
"""Standard uncertainty of a declaration that tells nothing, over the largest force that may be friction."""
SHOT_DECIDES_BITS = 0.5
"""Gain from which on the shot tells more than the declaration: half of the variance is gone."""
LARGEST_SHARE = 0.05
"""Of the peak force, that friction may be."""


@dataclass(frozen=True)
class Friction:
    """The packing friction, N.

    Attributes
    ----------
    value_n, u_n
        By declaration and shot together.
    by_shot_n, u_by_shot_n
        By the shot alone, with the calibrations of the other sensors; infinite uncertainty where it tells nothing.
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
    regression: Regression,
    calibration: Calibration,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    camera: CameraScale | None,
    *,
    declared_n: float,
    u_further_n: float = 0.0,
) -> Friction:
    """Separate what declaration and shot say of the packing friction.

    Parameters
    ----------
    regression
        Filtered.
    calibration
        Of it, with the declaration.
    scales, u_bias_m_s2, camera
        As the calibration was made with.
    u_further_n
        Standard uncertainty of a force that acts like friction and that the calibration does not know.

    Raises
    ------
    IdentificationError
        As of `recoil_identification.calibration.calibrated_mass`.
    """
    u_declared = scales.friction_n
    largest = LARGEST_SHARE * float(abs(regression.forces_n[regression.used, 0]).max())
    wide = WIDE * max(largest, declared_n, u_declared)
    alone = calibrated_mass(regression, replace(scales, friction_n=wide), u_bias_m_s2, camera)
    by_shot, u_by_shot = declared_n - alone.friction_error_n, posterior_u(alone, wide)
    value = declared_n - calibration.friction_error_n
    u = posterior_u(calibration, u_declared)
    if math.isfinite(u_by_shot):
        u_by_shot = math.hypot(u_by_shot, u_further_n)
    gain = math.inf
    if u_declared > 0:
        if math.isfinite(u_by_shot) and u_further_n > 0:
            # the further force spoils the shot's word and not the declaration's
            u = max(u, 1.0 / math.hypot(1.0 / u_declared, 1.0 / u_by_shot))
        gain = math.log2(u_declared / u) if u > 0 else math.inf
    return Friction(declared_n, u_declared, value, u, by_shot, u_by_shot, gain)


def posterior_u(calibration: Calibration, u_declared_n: float) -> float:
    """Return the standard uncertainty of the friction that a calibration has left.

    Of a departure d, in standard uncertainties of the declaration, and its significance w the ratio is
    ``d / w = sqrt(1 - u^2 / u_declared^2)``: the root of the redundancy.

    Parameters
    ----------
    u_declared_n
        With which it was made.
    """
    pull, normalised = calibration.pulls.get(FRICTION, 0.0), calibration.normalised_residuals.get(FRICTION, 0.0)
    if not u_declared_n > 0 or normalised == 0:
        return u_declared_n
    return u_declared_n * math.sqrt(max(1.0 - (pull / normalised) ** 2, 0.0))
