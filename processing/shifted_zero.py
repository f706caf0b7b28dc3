"""The shift of an accelerometer's zero: its value, its uncertainty, and a record without it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.repair import Repair, changed

Array = NDArray[np.float64]

LEVEL, STEP, DECAYING, TAU = 1, 2, 3, 4
PARAMETERS = ("inverse mass, 1/kg", "level, m/s^2", "step, m/s^2", "decaying, m/s^2", "time constant, s")
"""Order of `ZeroShift.covariance`."""


@dataclass(frozen=True, eq=False)
class ZeroShift:
    """The shift of a zero at the shot; none where it was not earned.

    Attributes
    ----------
    onset_s : float
    inverse_mass_per_kg : float
        Of the fit; a by-product.
    level_m_s2 : float
        Of the zero before the shot.
    step_m_s2, decaying_m_s2 : float
        What stays, and what decays; 0 where there is no such part.
    time_constant_s : float
        Of the decay; infinite where there is none.
    covariance : ndarray, shape (5, 5)
        In the order of `PARAMETERS`; zero for those that are not part of it.
    earned : bool
        Whether the record demands a shift.
    f_statistic, p_value : float
        Of the best shape against none; the probability is that over all shapes tried.
    bic_difference : float
        By which the information criterion falls with the best shape; 0 if none lowers it.
    rows : int
    effective_rows : float
        What the residual's autocorrelation leaves of them.
    residual_m_s2 : float
        Standard deviation per row.
    reason : str
        In words.
    """

    onset_s: float
    inverse_mass_per_kg: float
    level_m_s2: float
    step_m_s2: float
    decaying_m_s2: float
    time_constant_s: float
    covariance: Array
    earned: bool
    f_statistic: float
    p_value: float
    bic_difference: float
    rows: int
    effective_rows: float
    residual_m_s2: float
    reason: str

    @property
    def u_level_m_s2(self) -> float:
        """Standard uncertainty of the level."""
        return math.sqrt(self.covariance[LEVEL, LEVEL])

    @property
    def u_step_m_s2(self) -> float:
        """Standard uncertainty of what stays."""
        return math.sqrt(self.covariance[STEP, STEP])

    @property
    def u_decaying_m_s2(self) -> float:
        """Standard uncertainty of what decays."""
        return math.sqrt(self.covariance[DECAYING, DECAYING])

    @property
    def u_time_constant_s(self) -> float:
        """Standard uncertainty of the decay's time constant."""
        return math.sqrt(self.covariance[TAU, TAU])

    def shift_m_s2(self, times_s: Array) -> Array:
        """Return the shift, without the level before the shot, shape of `times_s`."""
        since = times_s - self.onset_s
        behind = since >= 0
        decay = np.exp(-np.maximum(since, 0.0) / self.time_constant_s)
        return np.asarray(np.where(behind, self.step_m_s2 + self.decaying_m_s2 * decay, 0.0))

    def u_velocity_m_s(self, times_s: Array) -> Array:
        """Return the standard uncertainty that the zero leaves in a velocity integrated from the onset, any shape.

        The velocity takes up ``level t + step t + decaying tau (1 - exp(-t / tau))``; the covariance is carried
        through its derivatives.
        """
        t = np.maximum(times_s - self.onset_s, 0.0)
        slopes = np.zeros((*t.shape, len(PARAMETERS)))
        slopes[..., LEVEL] = slopes[..., STEP] = t
        if math.isfinite(self.time_constant_s):
            tau = self.time_constant_s
            gone = -np.expm1(-t / tau)
            slopes[..., DECAYING] = tau * gone
            slopes[..., TAU] = self.decaying_m_s2 * (gone - t / tau * np.exp(-t / tau))
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)))

    def repair(self, acceleration_m_s2: Array, times_s: Array) -> tuple[Array, tuple[Repair, ...]]:
        """Take the shift off a record, where it was earned.

        Parameters
        ----------
        acceleration_m_s2, times_s : ndarray, shape (n,)

        Returns
        -------
        samples : ndarray, shape (n,)
            The level before the shot is still in them.
        repairs : tuple of Repair
            One, or none.
        """
        if not self.earned:
            return acceleration_m_s2.copy(), ()
        corrected = acceleration_m_s2 - self.shift_m_s2(times_s)
        figures = {
            "step_m_s2": self.step_m_s2,
            "u_step_m_s2": self.u_step_m_s2,
            "decaying_m_s2": self.decaying_m_s2,
            "u_decaying_m_s2": self.u_decaying_m_s2,
            "time_constant_s": self.time_constant_s,
            "u_time_constant_s": self.u_time_constant_s,
            "f_statistic": self.f_statistic,
            "bic_difference": self.bic_difference,
        }
        repair = Repair("zero shift fitted", changed(acceleration_m_s2, corrected), self.reason, figures)
        return corrected, (repair,)
