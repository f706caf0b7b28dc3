"""The mass as one over the gain at zero frequency of an ARX model from force to acceleration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_identification.targets.arx.model import ArxModel, ArxOrders, estimate_arx, robust_covariance
from recoil_identification.targets.arx.response import dc_gain, inverse


@dataclass(frozen=True)
class GainMass:
    """A mass by the gain at zero frequency.

    Attributes
    ----------
    u_random_kg
        Standard uncertainty by the residuals: the larger of what holds for white ones and of what holds for correlated
        ones.
    u_orders_kg
        Standard uncertainty by the choice of the orders.
    u_other_kg
        Standard uncertainty by all that is not seen in the residuals: scales, areas, friction, zeros, clocks.
    """

    mass_kg: float
    u_random_kg: float
    u_orders_kg: float
    u_other_kg: float

    @property
    def u_kg(self) -> float:
        """Combined standard uncertainty."""
        return math.hypot(self.u_random_kg, self.u_orders_kg, self.u_other_kg)


def mass_of_gain(
    record: DecimatedRecord, orders: ArxOrders, others: Sequence[ArxOrders] = (), u_other_rel: float = 0.0
) -> GainMass:
    """Estimate the mass by the gain of a model of given orders.

    Parameters
    ----------
    others
        Orders that might have been chosen instead. Their masses are the ends of a rectangular distribution: half its
        width over root 3 is the contribution.
    u_other_rel
        Relative standard uncertainty by what the residuals do not show.

    Raises
    ------
    IdentificationError
        As `recoil_identification.targets.arx.model.estimate_arx`, for the orders themselves; others that cannot be
        estimated say nothing.
    """
    model = fitted_model(record, orders)
    own = inverse(dc_gain(model, wider_covariance(model, record)))
    masses = [own.value]
    for other in others:
        try:
            masses.append(inverse(dc_gain(fitted_model(record, other))).value)
        except IdentificationError:
            continue
    spread = 0.5 * (max(masses) - min(masses)) / math.sqrt(3.0)
    return GainMass(own.value, own.u, spread, abs(own.value) * u_other_rel)


def fitted_model(record: DecimatedRecord, orders: ArxOrders) -> ArxModel:
    """Estimate a model of given orders from a record.

    Raises
    ------
    IdentificationError
        As `recoil_identification.targets.arx.model.estimate_arx`.
    """
    return estimate_arx(record.force_n, record.acceleration_m_s2, orders, step_s=record.step_s, rows=record.rows)


def wider_covariance(model: ArxModel, record: DecimatedRecord) -> Array:
    """Return of two covariances of the parameters the one by which the gain at zero frequency is known less well.

    Parameters
    ----------
    record
        Record that the model was estimated from.

    Returns
    -------
    ndarray, shape (n_parameters, n_parameters)
        Covariance for white residuals, or `recoil_identification.targets.arx.model.robust_covariance`.
    """
    robust = robust_covariance(model, record.force_n, record.acceleration_m_s2, rows=record.rows)
    return robust if dc_gain(model, robust).u > dc_gain(model).u else model.covariance


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
