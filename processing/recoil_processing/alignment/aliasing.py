"""Effect of ringing above half a slow source's sampling rate on its samples, by a fast record of the same motion.

Sampling folds a frequency f to its distance from the nearest multiple of the rate (C. E. Shannon, Proc. IRE 37(1),
1949). The two sensors do not feel the same mixture of ringing, so that no correction is made: what the fast record
would have left in the slow samples, each band of frequencies at a phase of its own, is the size of what may be there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.analog_filter import AnalogLowPass

Array = NDArray[np.float64]

BANDS_PER_RATE = 4
"""Into which the frequencies above half the source's rate are divided: a mode or two in each."""
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
    integral: bool = False,
) -> Iterator[Array]:
    """Give what a source's samples would hold of the reference's content above half the source's sampling rate.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        The source's instants on the reference clock, increasing; those beyond the record hold nothing.
    start_s, step_s
        Time base of the reference.
    reference : ndarray, shape (n_reference,)
        Without missing samples.
    anti_alias
        The source's.
    integral
        Whether the source samples the reference's integral.

    Yields
    ------
    ndarray, shape (n,)
        For each band its content twice, a quarter of a period apart, so that the mean of both squares is that over all
        phases; in the source's unit but for its gain. Nothing where the reference is no faster than the source.
    """
    from scipy.interpolate import CubicSpline

    rate_hz = 1.0 / float(np.median(np.diff(times_s)))
    size = 1 << (2 * reference.size - 1).bit_length()
    frequency = np.asarray(np.fft.rfftfreq(size, step_s), dtype=np.float64)
    above = frequency > 0.5 * rate_hz
    if not above.any():
        return
    spectrum = np.fft.rfft(reference - np.median(reference), size) * above * anti_alias.gain(frequency)
    if integral:
        spectrum[above] /= 2j * np.pi * frequency[above]
    instants = start_s + step_s * np.arange(reference.size)
    inside = (times_s >= instants[0]) & (times_s <= instants[-1])
    band = np.minimum(frequency * BANDS_PER_RATE / rate_hz, HIGHEST * BANDS_PER_RATE).astype(np.int64)
    power = np.bincount(band, weights=np.abs(spectrum) ** 2)
    for number in np.flatnonzero(power > LEAST_SHARE * power.sum()):
        for turned in (1.0, 1j):
            content = np.fft.irfft(spectrum * (band == number) * turned, size)[: reference.size]
            samples = np.zeros(times_s.size)
            samples[inside] = CubicSpline(instants, content)(times_s[inside])
            yield samples
