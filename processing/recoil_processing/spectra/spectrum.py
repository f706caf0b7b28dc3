"""Spectra of short transients: by several tapers, smoothed over a sixth of an octave.

A shot is one realisation. A single periodogram of it scatters by its own size; the mean over several
orthogonal tapers (D. J. Thomson, "Spectrum estimation and harmonic analysis", Proc. IEEE 70, 1982)
scatters less at the price of a known resolution, and the mean over bands of constant relative width
less again where there are many frequencies to a band.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_finite, require_positive

TIME_BANDWIDTH = 4.0
"""Half width of the tapers' main lobe times the length of the window."""
TAPERS = 6
"""Tapers, of the ``2 x 4 - 1`` that concentrate their energy inside the main lobe."""
BAND_OCTAVES = 1.0 / 6.0
"""Width of the bands over which a density is averaged."""
POINTS_PER_OCTAVE = 24
"""Points per octave of the smoothed spectrum: four to a band."""
_LONGEST_EXACT = 2048
"""Samples beyond which the tapers are interpolated: they have at most six zeros and are smooth."""


@dataclass(frozen=True, eq=False)
class Spectrum(ReadOnlyArrays):
    """A one-sided power spectral density.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n,)
        Frequencies, increasing.
    density : ndarray, shape (n,)
        Square of the signal's unit per hertz.
    resolution_hz
        Half width of the lobe that a line shows as: nothing narrower can be distinguished.
    """

    frequency_hz: Array
    density: Array
    resolution_hz: float


def multitaper(samples: Array, rate_hz: float) -> Spectrum:
    """Estimate the power spectral density of a window by Thomson's multitaper method, unweighted.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples, all finite. Its level at rest should have been taken off; nothing is taken off here.

    Returns
    -------
    Spectrum
        Spectrum at the multiples of ``rate_hz / n_samples`` from 0 to half the rate; its integral is the mean square of
        the samples, weighted by the tapers.

    Raises
    ------
    ValueError
        If there are fewer than 16 samples, one of them is not finite, or the rate is not positive.
    """
    require_positive(rate_hz=rate_hz)
    if samples.ndim != 1 or samples.size < 16:
        raise ValueError(f"a spectrum needs one row of at least 16 samples, not shape {samples.shape}")
    require_finite(samples=samples)
    from scipy.fft import next_fast_len, rfft

    # a length with small factors is a handful of zeros longer and up to ten times quicker
    length = next_fast_len(samples.size, real=True)
    spectra = rfft(slepian_tapers(samples.size) * samples, n=length, axis=1)
    density = np.mean(spectra.real**2 + spectra.imag**2, axis=0) * (2.0 / rate_hz)
    density[0] *= 0.5
    if length % 2 == 0:
        density[-1] *= 0.5
    return Spectrum(
        np.arange(density.size) * (rate_hz / length), np.asarray(density), TIME_BANDWIDTH * rate_hz / samples.size
    )


@lru_cache(maxsize=8)
def slepian_tapers(count: int) -> Array:
    """Return the discrete prolate spheroidal sequences of `TIME_BANDWIDTH`, of unit energy and of either sign.

    Parameters
    ----------
    count
        Number of samples.

    Returns
    -------
    ndarray, shape (TAPERS, count)
        Read-only, kept for the next window of this length. Beyond 2,048 samples they are cubic
        interpolations of those of 2,048, which are off by less than 1e-6 of the largest value.
    """
    from scipy.interpolate import CubicSpline
    from scipy.linalg import eigh_tridiagonal

    # eigenvectors of a tridiagonal matrix (D. Slepian, Bell System Technical Journal 57, 1978, 1371-1430)
    length = min(count, _LONGEST_EXACT)
    i = np.arange(length)
    diagonal = ((length - 1) / 2 - i) ** 2 * math.cos(2 * math.pi * TIME_BANDWIDTH / length)
    _, vectors = eigh_tridiagonal(
        diagonal, i[1:] * (length - i[1:]) / 2, select="i", select_range=(length - TAPERS, length - 1)
    )
    exact = vectors.T[::-1]
    if count > _LONGEST_EXACT:
        # sample centres of both grids lie at (i + 1/2) / n of the window
        known = (np.arange(_LONGEST_EXACT) + 0.5) / _LONGEST_EXACT
        exact = CubicSpline(known, exact, axis=1)((np.arange(count) + 0.5) / count)
    tapers = np.ascontiguousarray(exact / np.sqrt(np.sum(exact**2, axis=1, keepdims=True)), dtype=np.float64)
    tapers.flags.writeable = False
    return tapers


def smooth(spectrum: Spectrum) -> Spectrum:
    """Average a density over bands of a sixth of an octave, on a logarithmic grid.

    Parameters
    ----------
    spectrum
        Spectrum on an even grid that begins at 0.

    Returns
    -------
    Spectrum
        Spectrum at ``2^(k/24)`` Hz for whole k: grids of any two records share their points. From the second frequency
        of the even grid to the last whose band still lies below half the rate.
    """
    step = float(spectrum.frequency_hz[1])
    half_band = 2.0 ** (0.5 * BAND_OCTAVES)
    first = math.ceil(POINTS_PER_OCTAVE * math.log2(step * half_band))
    last = math.floor(POINTS_PER_OCTAVE * math.log2(float(spectrum.frequency_hz[-1]) / half_band))
    centres = 2.0 ** (np.arange(first, last + 1) / POINTS_PER_OCTAVE)
    # cell k reaches half a step to either side of its frequency
    edges = (np.arange(spectrum.density.size + 1) - 0.5) * step
    powers = np.concatenate([[0.0], np.cumsum(spectrum.density) * step])
    low, high = centres / half_band, centres * half_band
    density = (np.interp(high, edges, powers) - np.interp(low, edges, powers)) / (high - low)
    return Spectrum(centres, np.maximum(density, np.finfo(np.float64).tiny), spectrum.resolution_hz)


def average_normalised(spectra: Sequence[Spectrum]) -> Spectrum:
    """Average the smoothed spectra of several shots, each scaled to unit power.

    Parameters
    ----------
    spectra
        Spectra by `smooth`. A louder shot counts no more than a quieter one.

    Returns
    -------
    Spectrum
        Mean spectrum where all of them are defined.

    Raises
    ------
    ValueError
        If there is none, or they have no frequency in common.
    """
    if not spectra:
        raise ValueError("an average needs at least one spectrum")
    low = max(float(s.frequency_hz[0]) for s in spectra)
    high = min(float(s.frequency_hz[-1]) for s in spectra)
    if not low < high:
        raise ValueError("the spectra have no frequency in common")
    # half a grid step of tolerance: the grids' points agree but for rounding
    margin = 2.0 ** (0.5 / POINTS_PER_OCTAVE)
    rows = []
    for spectrum in spectra:
        inside = (spectrum.frequency_hz > low / margin) & (spectrum.frequency_hz < high * margin)
        row = spectrum.density[inside]
        rows.append(row / np.sum(row * spectrum.frequency_hz[inside]))
        frequency_hz = spectrum.frequency_hz[inside]
    return Spectrum(frequency_hz, np.mean(rows, axis=0), max(s.resolution_hz for s in spectra))
