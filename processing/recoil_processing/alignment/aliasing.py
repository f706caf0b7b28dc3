"""Effect of ringing above half a slow source's sampling rate on its samples, by a fast record of the same motion.

Sampling folds a frequency f to its distance from the nearest multiple of the rate (C. E. Shannon, Proc. IRE 37(1),
1949). The two sensors do not feel the same mixture of ringing, so that no correction is made: what the fast record
would have left in the slow samples, each band of frequencies at a phase of its own, is the size of what may be there.
"""

from __future__ import annotations

import numpy as np

from recoil_acquisition.clocks.timebase import usual_step_s
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.filters.analog_filter import AnalogLowPass

BANDS_PER_RATE = 4
"""Number of bands into which the frequencies above half the source's rate are divided: a mode or two in each."""
HIGHEST = 5
"""Sampling rates above which all is one band."""
LEAST_SHARE = 3e-4
"""Share of the power behind the source's filter that a band must have to be looked at."""
USUAL_CORNER, USUAL_ORDER = 0.4, 2
"""Share of a source's sampling rate, and order, of an anti-alias filter of which nothing is declared: a gentle one."""


def usual_filter(rate_hz: float) -> AnalogLowPass:
    """Return the anti-alias filter that a source has at least."""
    return AnalogLowPass(USUAL_CORNER * rate_hz, "butterworth", USUAL_ORDER)


def folded_samples(
    times_s: Array,
    start_s: float,
    step_s: float,
    reference: Array,
    anti_alias: AnalogLowPass,
    *,
    integral: int = 0,
) -> Array:
    """Return what a source's samples would hold of the reference's content above half the source's sampling rate.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        The source's instants on the reference clock, increasing; those beyond the record hold nothing.
    start_s, step_s
        Time base of the reference.
    reference : ndarray, shape (n_reference,)
        Samples of the reference channel, none missing.
    anti_alias
        Anti-alias filter of the source.
    integral
        Number of times that the reference is integrated to what the source samples.

    Returns
    -------
    ndarray, shape (n, 2 * n_bands)
        Content of each band in two columns, a quarter of a period apart, so that the mean of both squares is that over
        all phases; in the source's unit but for its gain. No column where the reference is no faster than the source.
    """
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

    rate_hz = 1.0 / usual_step_s(times_s)
    size = next_fast_len(2 * reference.size - 1, real=True)
    frequency = np.asarray(rfftfreq(size, step_s), dtype=np.float64)
    above = frequency > 0.5 * rate_hz
    if not above.any():
        return np.zeros((times_s.size, 0))
    spectrum = rfft(reference - np.median(reference), size) * above * anti_alias.gain(frequency)
    spectrum[above] /= (2j * np.pi * frequency[above]) ** integral
    band = np.minimum(frequency * BANDS_PER_RATE / rate_hz, HIGHEST * BANDS_PER_RATE).astype(np.int64)
    power = np.bincount(band, weights=np.abs(spectrum) ** 2)
    bands = np.flatnonzero(power > LEAST_SHARE * power.sum())
    # between its samples the content is a cubic spline, whose coefficients are at hand as long as it is a spectrum
    spectrum /= (2.0 + np.cos(2 * np.pi * frequency * step_s)) / 3.0
    place = (times_s - start_s) / step_s
    inside = (place >= 0) & (place <= reference.size - 1)
    first = np.floor(place[inside]).astype(np.int64)
    weights = _spline_weights(place[inside] - first)
    near = (first[:, None] + np.arange(-1, 3)) % size
    folded = np.zeros((times_s.size, 2 * bands.size))
    for column, (number, turned) in enumerate((number, turned) for number in bands for turned in (1.0, 1j)):
        coefficients = irfft(spectrum * (band == number) * turned, size)
        folded[inside, column] = np.einsum("ij,ij->i", weights, coefficients[near])
    return folded


def _spline_weights(behind: Array) -> Array:
    """Shares of four coefficients in a cubic spline between the middle two, shape (n, 4), by the step's share behind.

    The cubic B-spline of I. J. Schoenberg, Quart. Appl. Math. 4 (1946).
    """
    ahead = 1.0 - behind
    return np.column_stack([
        ahead**3, 4.0 - 6.0 * behind**2 + 3.0 * behind**3, 4.0 - 6.0 * ahead**2 + 3.0 * ahead**3, behind**3
    ]) / 6.0  # fmt: skip
