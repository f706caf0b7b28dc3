"""What an ARX model does: its gain, poles, zeros and responses with bands, from the parameters' covariance.

All uncertainties are of first order: the derivative of the result by the parameters, times their covariance
(JCGM 102:2011, 6.2). Those of magnitudes are of their logarithm, so that no band reaches below zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.arx.model import ArxModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Gain:
    """A number with its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True, eq=False)
class Poles:
    """Poles of a model, the least damped first.

    Attributes
    ----------
    values : ndarray of complex, shape (na,)
        In the z plane.
    u_modulus : ndarray, shape (na,)
        Standard uncertainty of their distance from the origin.
    frequency_hz, damping : ndarray, shape (na,)
        Natural frequency and damping ratio of ``ln(z) / T``; NaN at the origin.
    """

    values: Complex
    u_modulus: Array
    frequency_hz: Array
    damping: Array

    @property
    def stable(self) -> bool:
        """Whether all lie within the unit circle."""
        return bool((np.abs(self.values) < 1.0).all())


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
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


@dataclass(frozen=True, eq=False)
class TimeResponse:
    """Response to an impulse or a step of one unit at the first sample.

    Attributes
    ----------
    times_s, values, u : ndarray, shape (n,)
    """

    times_s: Array
    values: Array
    u: Array


def dc_gain(model: ArxModel, covariance: Array | None = None) -> Gain:
    """Return ``B(1) / A(1)``.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters), optional
        In the place of the model's own, for example `recoil_identification.arx.estimation.robust_covariance`.

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
    """Return the poles in the z plane.

    Returns
    -------
    Poles
        Where a pole is repeated its uncertainty is infinite: to first order it moves without bound.
    """
    denominator = model.denominator
    values = np.asarray(np.roots(denominator), dtype=np.complex128)
    values = values[np.argsort(-np.abs(values), kind="stable")]
    u = np.zeros(values.size)
    frequency, damping = np.full(values.size, np.nan), np.full(values.size, np.nan)
    for k, pole in enumerate(values):
        slope = np.polyval(np.polyder(denominator), pole)
        # implicit derivative of z^na + a_1 z^(na-1) + .. = 0
        change = -(pole ** np.arange(model.orders.na - 1, -1, -1)) / slope if slope != 0 else None
        modulus = abs(pole)
        if change is None:
            u[k] = math.inf
        else:
            along = np.real(np.conj(pole) * change) / modulus if modulus > 0 else np.abs(change)
            u[k] = _deviation(np.append(along, np.zeros(model.orders.nb + 1)), model.covariance)
        if modulus > 0:
            s = np.log(pole) / model.step_s
            frequency[k] = abs(s) / (2.0 * math.pi)
            damping[k] = -s.real / abs(s) if s != 0 else 0.0
    return Poles(values, u, frequency, damping)


def frequency_response(
    model: ArxModel, frequencies_hz: ArrayLike, covariance: Array | None = None
) -> FrequencyResponse:
    """Return the response to sines with its uncertainty.

    Parameters
    ----------
    frequencies_hz : array_like, shape (n,)
        From 0 to half the sampling rate.
    covariance : ndarray, shape (n_parameters, n_parameters), optional
        In the place of the model's own.

    Raises
    ------
    ValueError
        For frequencies out of range.
    """
    f = np.asarray(frequencies_hz, dtype=np.float64)
    half_rate = 0.5 / model.step_s
    if f.ndim != 1 or not ((f >= 0.0) & (f <= half_rate * (1.0 + 1e-12))).all():
        raise ValueError(f"frequencies must lie between 0 and half the sampling rate, {half_rate:g} Hz")
    late = np.exp(-2j * math.pi * f * model.step_s)
    powers_a = late[:, np.newaxis] ** np.arange(1, model.orders.na + 1)
    powers_b = late[:, np.newaxis] ** (model.orders.delay + np.arange(model.orders.nb + 1))
    denominator, numerator = 1.0 + powers_a @ model.a, powers_b @ model.b
    with np.errstate(divide="ignore", invalid="ignore"):  # a pole on the circle has no response at its frequency
        values = numerator / denominator
        # derivative of ln G: its real part is that of the magnitude, its imaginary part that of the phase
        change = np.column_stack([-powers_a / denominator[:, np.newaxis], powers_b / numerator[:, np.newaxis]])
        used = model.covariance if covariance is None else covariance
        magnitude, phase = (_deviations(part, used) for part in (change.real, change.imag))
    return FrequencyResponse(f, values, magnitude, phase)


def impulse_response(model: ArxModel, count: int, covariance: Array | None = None) -> TimeResponse:
    """Return the response to 1 at the first sample and 0 after it.

    Parameters
    ----------
    count
        Samples of the response.
    covariance : ndarray, shape (n_parameters, n_parameters), optional
        In the place of the model's own.

    Raises
    ------
    ValueError
        If the count is below 1.
    """
    return _time_response(model, count, covariance, np.eye(1, max(count, 1))[0])


def step_response(model: ArxModel, count: int, covariance: Array | None = None) -> TimeResponse:
    """Return the response to 1 from the first sample on; parameters and errors as `impulse_response`."""
    return _time_response(model, count, covariance, np.ones(max(count, 1)))


def _time_response(model: ArxModel, count: int, covariance: Array | None, stimulus: Array) -> TimeResponse:
    """Drive the model, and its derivatives by the parameters, which are filters of the same A."""
    from scipy.signal import lfilter

    if count < 1:
        raise ValueError(f"count must be 1 or more, found {count}")
    denominator = model.denominator
    values = lfilter(model.numerator, denominator, stimulus)
    by_b = lfilter([1.0], denominator, stimulus)
    by_a = -lfilter([1.0], denominator, values)
    lags = [*((by_a, i) for i in range(1, model.orders.na + 1))]
    lags += [(by_b, model.orders.delay + j) for j in range(model.orders.nb + 1)]
    change = np.zeros((count, len(lags)))
    for column, (series, lag) in enumerate(lags):
        change[lag:, column] = series[: max(count - lag, 0)]
    u = _deviations(change, model.covariance if covariance is None else covariance)
    times = np.asarray(model.step_s * np.arange(count), dtype=np.float64)
    return TimeResponse(times, np.asarray(values), u)


def _deviation(slope: Array, covariance: Array) -> float:
    return math.sqrt(max(float(slope @ covariance @ slope), 0.0))


def _deviations(slopes: Array, covariance: Array) -> Array:
    """Propagate the covariance to many results, shape (n,)."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, covariance, slopes), 0.0)))
