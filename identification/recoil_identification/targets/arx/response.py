"""Gain, poles, zeros and frequency response of an ARX model, with their uncertainties by the parameters' covariance.

All uncertainties are of first order: the derivative of the result by the parameters, times their covariance
(JCGM 102:2011, 6.2). Those of magnitudes are of their logarithm, so that no band reaches below zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Complex
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.arx.model import ArxModel


@dataclass(frozen=True)
class Gain:
    """A number with its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True, eq=False)
class Poles(ReadOnlyArrays):
    """Poles of a model, the least damped first.

    Attributes
    ----------
    values : ndarray of complex, shape (na,)
        Poles in the z plane.
    frequency_hz, damping : ndarray, shape (na,)
        Natural frequency and damping ratio of ``ln(z) / T``; NaN at the origin.
    """

    values: Complex
    frequency_hz: Array
    damping: Array

    @property
    def stable(self) -> bool:
        """True if all poles lie within the unit circle."""
        return bool((np.abs(self.values) < 1.0).all())


@dataclass(frozen=True, eq=False)
class FrequencyResponse(ReadOnlyArrays):
    """Response to sines.

    Attributes
    ----------
    frequencies_hz : ndarray, shape (n,)
    values : ndarray of complex, shape (n,)
        Output per input.
    u_log_magnitude : ndarray, shape (n,)
        Standard uncertainty of ``ln |G|``.
    u_phase_rad : ndarray, shape (n,)
    """

    frequencies_hz: Array
    values: Complex
    u_log_magnitude: Array
    u_phase_rad: Array

    @property
    def magnitude(self) -> Array:
        """``|G|``, shape (n,)."""
        return np.asarray(np.abs(self.values))

    @property
    def phase_rad(self) -> Array:
        """Phase without jumps, shape (n,)."""
        return np.asarray(np.unwrap(np.angle(self.values)))

    def magnitude_band(self, factor: float) -> tuple[Array, Array]:
        """Return the limits of the magnitude's band, `factor` standard uncertainties wide on both sides."""
        with np.errstate(over="ignore"):  # where nothing is known of the magnitude its band has no upper end
            spread = np.exp(factor * self.u_log_magnitude)
        return self.magnitude / spread, self.magnitude * spread


def dc_gain(model: ArxModel, covariance: Array | None = None) -> Gain:
    """Return ``B(1) / A(1)``.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters), optional
        Covariance in the place of the model's own, for example
        `recoil_identification.targets.arx.model.robust_covariance`.

    Returns
    -------
    Gain
        Infinite with infinite uncertainty where a pole is exactly 1.
    """
    denominator, numerator = 1.0 + float(model.a.sum()), float(model.b.sum())
    if denominator == 0.0:
        return Gain(math.inf, math.inf)
    value = numerator / denominator
    slope = np.concatenate([np.full(model.orders.na, -value), np.ones(model.orders.nb + 1)]) / denominator
    return Gain(value, _deviation(slope, model.covariance if covariance is None else covariance))


def inverse(gain: Gain) -> Gain:
    """Return one over a gain: the mass, where the gain is acceleration per force."""
    if gain.value == 0.0:
        return Gain(math.inf, math.inf)
    return Gain(1.0 / gain.value, gain.u / gain.value**2)


def zeros(model: ArxModel) -> Complex:
    """Return the zeros in the z plane, those of the delay at infinity left out, shape (at most nb,)."""
    return np.asarray(np.roots(model.b), dtype=np.complex128)


def poles(model: ArxModel) -> Poles:
    """Return the poles in the z plane."""
    values = np.asarray(np.roots(model.denominator), dtype=np.complex128)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    with np.errstate(divide="ignore", invalid="ignore"):  # the origin decays at once, and has no frequency
        s = np.log(values) / model.step_s
        speed = np.where(values != 0.0, np.abs(s), np.nan)
        damping = np.where(speed > 0.0, -s.real / speed, 0.0 * speed)
    return Poles(values, speed / (2.0 * math.pi), damping)


def frequency_response(model: ArxModel, frequencies_hz: Array, covariance: Array | None = None) -> FrequencyResponse:
    """Return the response to sines with its uncertainty.

    Parameters
    ----------
    frequencies_hz : ndarray, shape (n,)
        Frequencies from 0 to half the sampling rate.
    covariance : ndarray, shape (n_parameters, n_parameters), optional
        Covariance in the place of the model's own.
    """
    late = np.exp(-2j * math.pi * frequencies_hz * model.step_s)
    powers_a = late[:, np.newaxis] ** np.arange(1, model.orders.na + 1)
    powers_b = late[:, np.newaxis] ** (model.orders.delay + np.arange(model.orders.nb + 1))
    denominator, numerator = 1.0 + powers_a @ model.a, powers_b @ model.b
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole on the circle has no response at its frequency
        values = numerator / denominator
        # derivative of ln G: its real part is that of the magnitude, its imaginary part that of the phase
        change = np.column_stack([-powers_a / denominator[:, np.newaxis], powers_b / numerator[:, np.newaxis]])
        used = model.covariance if covariance is None else covariance
        magnitude, phase = (_deviations(part, used) for part in (change.real, change.imag))
    return FrequencyResponse(frequencies_hz, values, magnitude, phase)


def _deviation(slope: Array, covariance: Array) -> float:
    return math.sqrt(max(float(slope @ covariance @ slope), 0.0))


def _deviations(slopes: Array, covariance: Array) -> Array:
    """Propagate the covariance to many results, shape (n,)."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, covariance, slopes), 0.0)))
