"""The shock response spectrum: the largest response of single-degree-of-freedom systems to a base acceleration.

By the ramp-invariant recursive filters of D. O. Smallwood, "An improved recursive formula for calculating shock
response spectra", Shock and Vibration Bulletin 51(2), 1981: exact for an acceleration that is straight between its
samples. They are those of ISO 18431-4 for the absolute acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_finite, require_positive

QUALITY_FACTOR = 10.0
"""Usual for shock, MIL-STD-810H: 5 % of critical damping."""
POINTS_PER_OCTAVE = 12
"""MIL-STD-810H, method 522.2, asks for as many."""


@dataclass(frozen=True, eq=False)
class ShockResponse(ReadOnlyArrays):
    """A shock response spectrum.

    Attributes
    ----------
    frequencies_hz : ndarray, shape (n,)
        Natural frequencies.
    positive, negative : ndarray, shape (n,)
        Largest response upwards and downwards during and after the shock, both as magnitudes, in the unit of
        the acceleration.
    """

    frequencies_hz: Array
    positive: Array
    negative: Array

    @property
    def ratio_db(self) -> Array:
        """Positive over negative spectrum, dB, shape (n,)."""
        tiny = 1e-300
        return np.asarray(20 * np.log10(np.maximum(self.positive, tiny) / np.maximum(self.negative, tiny)))


def octave_frequencies(low_hz: float, high_hz: float) -> Array:
    """Return frequencies from one to at most another in equal ratios; none if the band is empty."""
    if not (0 < low_hz <= high_hz and math.isfinite(high_hz)):
        return np.empty(0)
    count = math.floor(POINTS_PER_OCTAVE * math.log2(high_hz / low_hz) + 1e-9) + 1
    return np.asarray(low_hz * 2.0 ** (np.arange(count) / POINTS_PER_OCTAVE))


def absolute_acceleration_filter(
    frequency_hz: float, rate_hz: float, quality: float = QUALITY_FACTOR
) -> tuple[Array, Array]:
    """Return the ramp-invariant filter from base acceleration to the mass's absolute acceleration.

    Parameters
    ----------
    frequency_hz
        Natural frequency, positive.
    rate_hz
        Samples per second.
    quality
        ``1 / (2 zeta)``, above one half.

    Returns
    -------
    b, a : ndarray, shape (3,)
        Numerator and denominator, as `scipy.signal.lfilter` takes them.

    Raises
    ------
    ValueError
        If a parameter is not in its range.

    Notes
    -----
    With ``A = w T / 2Q``, ``B = w T sqrt(1 - 1/4Q^2)``, ``E = exp(-A)``, ``K = E cos B``, ``S = E sin B / B``:
    ``b = [1 - S, 2 (S - K), E^2 - S]``, ``a = [1, -2 K, E^2]``.
    """
    require_positive(frequency_hz=frequency_hz, rate_hz=rate_hz)
    if not (0.5 < quality < math.inf):
        raise ValueError(f"quality must be above 0.5, not {quality}")
    w = 2 * math.pi * frequency_hz / rate_hz
    decay = math.exp(-w / (2 * quality))
    turn = w * math.sqrt(1 - 1 / (4 * quality**2))
    K, S = decay * math.cos(turn), decay * math.sin(turn) / turn
    return np.array([1 - S, 2 * (S - K), decay**2 - S]), np.array([1.0, -2 * K, decay**2])


def shock_response(
    acceleration: Array, rate_hz: float, frequencies_hz: Array, quality: float = QUALITY_FACTOR
) -> ShockResponse:
    """Compute the absolute-acceleration shock response spectrum.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Acceleration of the base, from rest; without missing samples.
    rate_hz
        Samples per second.
    frequencies_hz : ndarray, shape (m,)
        Natural frequencies. Above a tenth of the rate the peaks between the samples are missed: at a
        tenth by up to 5 %.

    Returns
    -------
    ShockResponse
        Response during the record and for one period of the natural frequency after it.

    Raises
    ------
    ValueError
        If the acceleration is not finite, or as `absolute_acceleration_filter`.
    """
    from scipy.signal import lfilter  # only here: it takes a second to import

    require_finite(acceleration=acceleration)
    positive, negative = np.zeros(frequencies_hz.size), np.zeros(frequencies_hz.size)
    for i, frequency in enumerate(frequencies_hz):
        b, a = absolute_acceleration_filter(float(frequency), rate_hz, quality)
        rings_on = np.zeros(math.ceil(rate_hz / float(frequency)))
        response = lfilter(b, a, np.concatenate([acceleration, rings_on]))
        positive[i], negative[i] = max(float(response.max()), 0.0), max(-float(response.min()), 0.0)
    return ShockResponse(np.asarray(frequencies_hz, dtype=np.float64), positive, negative)
