"""The mass as one over the gain at zero frequency of an ARX model from force to acceleration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_identification.arx.decimated_record import DecimatedRecord
from recoil_identification.arx.estimation import estimate_arx, residuals, robust_covariance
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.recursive import finite_history_arx, forgetting_arx
from recoil_identification.arx.response import dc_gain, inverse
from recoil_identification.budget import COVERAGE_FACTOR

Array = NDArray[np.float64]

LARGEST_RELATIVE_U = 0.05
"""Of a mass over time; where less is known of it, none is given."""
LEAST_SIGNAL = 0.02
"""Share of the record's largest value, as root mean square over the memory, below which nothing is forgotten."""


@dataclass(frozen=True)
class GainMass:
    """A mass by the gain at zero frequency.

    Attributes
    ----------
    u_random_kg
        By the residuals: the larger of what holds for white ones and of what holds for correlated ones.
    u_orders_kg
        By the choice of the orders.
    u_other_kg
        By all that is not seen in the residuals: scales, areas, friction, zeros, clocks.
    """

    mass_kg: float
    u_random_kg: float
    u_orders_kg: float
    u_other_kg: float

    @property
    def u_kg(self) -> float:
        """Combined standard uncertainty."""
        return math.hypot(self.u_random_kg, self.u_orders_kg, self.u_other_kg)

    @property
    def interval_kg(self) -> tuple[float, float]:
        """95 % coverage interval."""
        half = COVERAGE_FACTOR * self.u_kg
        return self.mass_kg - half, self.mass_kg + half


def mass_of_gain(model: ArxModel, record: DecimatedRecord, others: Sequence[ArxModel], u_other_rel: float) -> GainMass:
    """Evaluate the mass of a model with its uncertainty.

    Parameters
    ----------
    model
        From force to acceleration.
    record
        What it was estimated from.
    others
        That might have been chosen instead. Their masses are the ends of a rectangular distribution: half its
        width over root 3 is the contribution.
    u_other_rel
        Relative standard uncertainty by what the residuals do not show.
    """
    own = inverse(dc_gain(model, wider_covariance(model, record)))
    masses = [own.value, *(inverse(dc_gain(other)).value for other in others)]
    spread = 0.5 * (max(masses) - min(masses)) / math.sqrt(3.0)
    return GainMass(own.value, own.u, spread, abs(own.value) * u_other_rel)


def wider_covariance(model: ArxModel, record: DecimatedRecord) -> Array:
    """Return of two covariances of the parameters the one by which the gain at zero frequency is known less well.

    Parameters
    ----------
    record
        What it was estimated from.

    Returns
    -------
    ndarray, shape (n_parameters, n_parameters)
        For white residuals, or `recoil_identification.arx.estimation.robust_covariance`.
    """
    robust = robust_covariance(model, record.force_n, record.acceleration_m_s2, rows=record.rows)
    return robust if dc_gain(model, robust).u > dc_gain(model).u else model.covariance


def refitted(record: DecimatedRecord, orders: ArxOrders) -> ArxModel:
    """Estimate a model of given orders from a record.

    Raises
    ------
    IdentificationError
        As `recoil_identification.arx.estimation.estimate_arx`.
    """
    return estimate_arx(record.force_n, record.acceleration_m_s2, orders, step_s=record.step_s, rows=record.rows)


def one_step_errors(model: ArxModel, record: DecimatedRecord) -> Array:
    """Return the errors one sample ahead within the rows, NaN elsewhere, shape (n,)."""
    return np.where(record.rows, residuals(model, record.force_n, record.acceleration_m_s2), np.nan)


def noise_attenuation(record: DecimatedRecord, noise_n: float) -> float:
    """Return the share of the force's energy that is noise of the gauges: the gain comes out low by it.

    Least squares with noise in the regressor finds ``1/m`` times ``1 - noise / energy`` (W. A. Fuller,
    *Measurement Error Models*, 1987, 1.1); this bound is for na = nb = 0, where all of the gain hangs on
    one regressor.

    Parameters
    ----------
    noise_n
        Standard deviation of the noise in the force.
    """
    energy = float(np.mean(record.force_n[record.rows] ** 2))
    return noise_n**2 / energy if energy > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class GainMassTrace:
    """The mass over time by both memories.

    Attributes
    ----------
    forgetting_kg, u_forgetting_kg : ndarray, shape (n,)
        By fading memory; NaN where too little is known.
    finite_kg : ndarray, shape (n,)
        By the last `window` rows alone; NaN there too.
    window
        Rows of the finite history.
    forgetting
        Forgetting factor of the same memory.
    """

    forgetting_kg: Array
    u_forgetting_kg: Array
    finite_kg: Array
    window: int
    forgetting: float


def mass_over_time(record: DecimatedRecord, orders: ArxOrders, window_s: float) -> GainMassTrace:
    """Follow the mass over time with models of given orders.

    Parameters
    ----------
    window_s
        Memory; at least five rows per parameter are taken.
    """
    window = max(round(window_s * record.rate_hz), 5 * orders.n_parameters)
    forgetting = 1.0 - 1.0 / window
    force = np.where(record.rows, record.force_n, np.nan)
    acceleration = np.where(record.rows, record.acceleration_m_s2, np.nan)
    least_b = window * (LEAST_SIGNAL * float(np.nanmax(np.abs(force)))) ** 2
    least_a = window * (LEAST_SIGNAL * float(np.nanmax(np.abs(acceleration)))) ** 2
    least = np.concatenate([np.full(orders.na, least_a), np.full(orders.nb + 1, least_b)])
    faded = forgetting_arx(force, acceleration, orders, forgetting, min_excitation=least)
    finite = finite_history_arx(force, acceleration, orders, min(window, force.size), min_excitation=least)
    with np.errstate(divide="ignore", invalid="ignore"):  # a gain of zero is no mass; it is taken out below
        denominator = 1.0 + faded.parameters[:, : orders.na].sum(axis=1)
        numerator = faded.parameters[:, orders.na :].sum(axis=1)
        mass = denominator / numerator
        slopes = np.repeat((-mass / numerator)[:, np.newaxis], orders.n_parameters, axis=1)
        slopes[:, : orders.na] = (1.0 / numerator)[:, np.newaxis]
        u = np.sqrt(np.einsum("ki,kij,kj->k", slopes, faded.covariance, slopes))
        other = finite.parameters
        finite_mass = (1.0 + other[:, : orders.na].sum(axis=1)) / other[:, orders.na :].sum(axis=1)
    known = record.rows & np.isfinite(mass) & (u <= LARGEST_RELATIVE_U * np.abs(mass))
    return GainMassTrace(
        np.where(known, mass, np.nan),
        np.where(known, u, np.nan),
        np.where(known, finite_mass, np.nan),
        window,
        forgetting,
    )
