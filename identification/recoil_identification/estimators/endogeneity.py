"""Test of Durbin, Wu and Hausman for a bias of plain least squares of force on acceleration.

An estimate with an instrument is right whether or not the acceleration's noise biases the plain one; if the two differ
by more than chance, it does (J. A. Hausman, Econometrica 46, 1978; for the identification of robots A. Janot, P.-O.
Vandanjon and M. Gautier, Control Eng. Pract. 48, 2016). It is done by the residual of the acceleration on the
instrument, added to the regression as a second column: its coefficient is zero if the acceleration carries no noise of
its own. The standard error is that of correlated residuals, by an autoregressive model of the scores.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import probability_text
from recoil_identification.estimate.rounding import plain
from recoil_identification.estimators.errors_in_variables import instrumental_mass
from recoil_processing.gaps import runs_of
from recoil_processing.shot.clocks.autoregressive_noise import long_run_variance

SIGNIFICANT = 0.05
"""Probability below which chance is not taken for the reason."""


@dataclass(frozen=True)
class Endogeneity:
    """Outcome of the test.

    Attributes
    ----------
    statistic
        Coefficient of the residual over its standard error: standard normal if there is no bias.
    p
        Probability of a statistic this far from zero by chance.
    plain_kg, instrumental_kg
        Masses by plain regression and by the instrument.
    """

    statistic: float
    p: float
    plain_kg: float
    instrumental_kg: float

    @property
    def biased(self) -> bool:
        """True if plain least squares is biased beyond chance."""
        return self.p < SIGNIFICANT

    @property
    def bias_percent(self) -> float:
        """By how much the plain estimate differs, percent of the other."""
        return 100.0 * (self.plain_kg / self.instrumental_kg - 1.0)

    def __str__(self) -> str:
        test = f"Durbin-Wu-Hausman {self.statistic:+.1f}, {probability_text(self.p)}"
        if self.biased:
            return (
                f"plain least squares of force on acceleration is biased by {self.bias_percent:+.2f} %: "
                f"{plain(self.plain_kg)} kg instead of {plain(self.instrumental_kg)} kg ({test})"
            )
        return f"no bias of plain least squares of force on acceleration is told from chance ({test})"


def durbin_wu_hausman(
    acceleration_m_s2: Array, force_n: Array, instrument: Array, *, used: NDArray[np.bool_] | None = None
) -> Endogeneity:
    """Test whether noise of the acceleration biases the mass by force on acceleration.

    Parameters
    ----------
    acceleration_m_s2, force_n : ndarray, shape (n,)
    instrument : ndarray, shape (n,)
        Goes with the motion, and with the noise of neither: see
        `recoil_identification.estimators.errors_in_variables.neighbouring_force`.
    used : ndarray of bool, shape (n,), optional

    Raises
    ------
    ValueError
        If shapes do not fit or a used sample is not finite.
    IdentificationError
        As of `recoil_identification.estimators.errors_in_variables.instrumental_mass`, or if the acceleration is the
        instrument.
    """
    found = instrumental_mass(acceleration_m_s2, force_n, instrument, used=used)
    used = np.ones(force_n.shape, dtype=bool) if used is None else used
    a, f, z = acceleration_m_s2[used], force_n[used], instrument[used]
    own = a - z * (z @ a) / (z @ z)
    power = float(own @ own)
    if not power > 1e-20 * float(a @ a):
        raise IdentificationError(
            "the acceleration is proportional to the instrument: there is nothing to compare",
            expected="an instrument of another source",
            remedy="take the neighbouring force, or another sensor",
        )
    # own is at right angles to the instrument, so that the two coefficients do not disturb each other
    residual = f - found.mass_kg * a
    coefficient = float(own @ residual) / power
    left = residual - coefficient * own
    scores = own * left
    lengths = [end - begin for begin, end in runs_of(used)]
    ends = np.cumsum(lengths).tolist()
    pieces = [scores[end - length : end] for end, length in zip(ends, lengths, strict=True)]
    u = math.hypot(math.sqrt(long_run_variance(pieces)) / power, found.u_kg)
    statistic = coefficient / u if u > 0 else math.inf * math.copysign(1.0, coefficient) if coefficient else 0.0
    return Endogeneity(
        statistic=statistic,
        p=math.erfc(abs(statistic) / math.sqrt(2.0)),
        plain_kg=float(a @ f / (a @ a)),
        instrumental_kg=found.mass_kg,
    )
