"""Gap between the spectrum of rigid-body motion and that of the ringing."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.arguments import require_positive
from recoil_processing.gaps import bridge
from recoil_processing.spectra.spectrum import Spectrum, multitaper, smooth

BEFORE_S = 5e-3
"""Length of the window before the shot."""
AFTER_S = 0.12
"""Length of the window after the shot: pulse, brake and the knocks at its end."""
SEARCH_FROM = 1.5
"""Number that, over the rise time of the integrated signal, is the frequency from which on a gap is looked for: below
it lie the zeros of the pulse's own spectrum."""
FALLEN_BACK = 0.85
"""Share of its peak to which the integrated signal falls in a rebound; in a ripple on its rise it does not."""
SHOULDER_DB = 10.0
"""Rise over the valley that is ringing in a single shot."""
ENSEMBLE_SHOULDER_DB = 6.0
"""Rise above the valley in the mean over several shots, which scatters less; in a single shot it is a doubtful one."""
MOST_MISSING = 0.05
"""Share of lost samples of the window beyond which a spectrum is that of the bridges across them."""
ROLL_OFF = MappingProxyType(
    {
        "acceleration": 4.0,
        "angular_acceleration": 4.0,
        "angular_rate": 2.0,
        "force": 4.0,
        "pressure": 4.0,
        "strain": 4.0,
        "torque": 4.0,
        "velocity": 2.0,
    }
)
"""Quantity -> power of the frequency with which the density of its ringing falls below the lowest mode.

A mode's acceleration has a double zero at frequency zero, its rate a single one; gauges of pressure,
force and strain ring by the acceleration that they feel.
"""


@dataclass(frozen=True, eq=False)
class ShotSpectrum:
    """The smoothed spectrum of one shot, and where a gap may be looked for in it.

    Attributes
    ----------
    spectrum
        Spectrum by `recoil_processing.spectra.spectrum.smooth`.
    lowest_hz
        Frequency at which the search begins: `SEARCH_FROM` over the rise time.
    rise_time_s
        10 to 90 % of the integrated signal.
    roll_off
        See `ROLL_OFF`.
    """

    spectrum: Spectrum
    lowest_hz: float
    rise_time_s: float
    roll_off: float


@dataclass(frozen=True)
class SpectralGap:
    """The gap between rigid-body motion and ringing.

    Attributes
    ----------
    valley_hz
        Frequency of the deepest point below the ringing.
    shoulder_hz
        Frequency at which the ringing begins: the density has risen by the threshold over the valley.
    depth_db
        Depth from the valley to the highest density above it.
    """

    valley_hz: float
    shoulder_hz: float
    depth_db: float


def find_gap(
    samples: Array,
    rate_hz: float,
    *,
    onset_index: int | None = None,
) -> SpectralGap | str:
    """Find the gap between motion and ringing in one record of an acceleration, from 6 dB on.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; lost ones are NaN.
    onset_index
        First sample of the shot; the spectrum is that of 5 ms before to 120 ms after it, as far as the
        record goes. None takes the whole record.

    Returns
    -------
    SpectralGap or str
        A sentence where there is none.

    Raises
    ------
    ValueError
        As in `shot_spectrum`.
    """
    shot = shot_spectrum(samples, rate_hz, onset_index=onset_index)
    return shot if isinstance(shot, str) else gap_of(shot.spectrum, shot.lowest_hz, ENSEMBLE_SHOULDER_DB)


def shot_spectrum(
    samples: Array, rate_hz: float, *, onset_index: int | None = None, quantity: str = "acceleration"
) -> ShotSpectrum | str:
    """Compute the spectrum of the window around a shot, and where a gap may begin.

    Parameters
    ----------
    samples, rate_hz, onset_index
        Samples, rate and onset as in `find_gap`.
    quantity
        One of `ROLL_OFF`.

    Returns
    -------
    ShotSpectrum or str
        A sentence where the record does not allow one.

    Raises
    ------
    ValueError
        If the quantity is unknown, the onset outside the record, a sample infinite, or the rate not positive.
    """
    if quantity not in ROLL_OFF:
        raise ValueError(f"no rule for the ringing of a {quantity}; one of {', '.join(ROLL_OFF)}")
    require_positive(rate_hz=rate_hz)
    first, last = shot_window(samples.size, rate_hz, onset_index)
    window = samples[first:last]
    if np.any(np.isinf(window)):
        raise ValueError("samples must not be infinite")
    if window.size < 64:
        return f"the window around the shot has only {window.size} samples; a spectrum needs 64"
    missing = np.count_nonzero(np.isnan(window))
    if missing > MOST_MISSING * window.size:
        return f"{100 * missing / window.size:.0f} % of the window around the shot are lost samples"
    whole = bridge(window)
    motion = whole - rest_level(whole, None if onset_index is None else onset_index - first)
    if not np.any(motion):
        return "the signal is constant"
    rise_time = rise_time_s(motion, rate_hz)
    if isinstance(rise_time, str):
        return rise_time
    spectrum = smooth(multitaper(motion, rate_hz))
    lowest_hz = SEARCH_FROM / rise_time
    if not lowest_hz < 0.5 * spectrum.frequency_hz[-1]:
        return (
            f"the signal rises within {1e3 * rise_time:.3g} ms: at {rate_hz:g} samples/s nothing above its own "
            f"frequencies is recorded"
        )
    return ShotSpectrum(spectrum, lowest_hz, rise_time, ROLL_OFF[quantity])


def shot_window(count: int, rate_hz: float, onset_index: int | None) -> tuple[int, int]:
    """Return the first sample of the window around a shot and the one after its last.

    Parameters
    ----------
    count
        Samples of the record.
    onset_index
        Number of the sample at the onset; None takes the whole record.

    Raises
    ------
    ValueError
        If the onset is none of the record's samples.
    """
    if onset_index is None:
        return 0, count
    if not 0 <= onset_index < count:
        raise ValueError(f"onset_index {onset_index} is not one of the record's {count} samples")
    return max(0, onset_index - round(BEFORE_S * rate_hz)), min(count, onset_index + round(AFTER_S * rate_hz) + 1)


def rest_level(window: Array, onset: int | None) -> float:
    """Level of a signal before its shot: the mean of the samples before it, or the first fiftieth's median."""
    if onset is None:
        return float(np.median(window[: max(16, window.size // 50)]))
    return float(np.mean(window[:onset])) if onset >= 16 else 0.0


def rise_time_s(motion: Array, rate_hz: float) -> float | str:
    """Return the 10 to 90 % rise time of a signal's integral, seconds.

    The integral is free of most of the ringing: a mode at frequency f counts ``1 / (2 pi f)`` there.

    Parameters
    ----------
    motion : ndarray, shape (n,)
        Motion, its level at rest taken off.

    Returns
    -------
    float or str
        A sentence where the integral has no rise inside the window.
    """
    integral = np.cumsum(motion)
    peak = int(np.argmax(np.abs(integral)))
    rising = integral[: peak + 1] / integral[peak]
    begin = int(np.argmax(rising >= 0.1))
    if begin == 0:
        return "the signal has no rise inside the window: the shot is not in it, or began before it"
    # ripple crosses the level several times; what falls back further is a rebound, and the rise is over
    reached = 1 + np.flatnonzero((rising[:-1] < 0.9) & (rising[1:] >= 0.9))
    fallen = np.flatnonzero(rising[reached[0] :] < FALLEN_BACK)
    over = reached[0] + fallen[0] if fallen.size else peak
    return max(int(reached[reached <= over][-1]) - begin, 1) / rate_hz


def gap_of(spectrum: Spectrum, lowest_hz: float, threshold_db: float) -> SpectralGap | str:
    """Find the first place where a smoothed spectrum rises by a threshold over its lowest value so far.

    Parameters
    ----------
    spectrum
        Spectrum by `recoil_processing.spectra.spectrum.smooth`.
    lowest_hz
        Frequency at which the search begins.

    Returns
    -------
    SpectralGap or str
    """
    f, level_db = spectrum.frequency_hz, 10.0 * np.log10(spectrum.density)
    start = int(np.searchsorted(f, lowest_hz))
    if start >= f.size - 1:
        return f"the spectrum ends at {f[-1]:.4g} Hz, below the {lowest_hz:.4g} Hz from which a gap can be looked for"
    rise_db = level_db[start:] - np.minimum.accumulate(level_db[start:])
    risen = np.flatnonzero(rise_db >= threshold_db)
    if risen.size == 0:
        return (
            f"no gap: from {lowest_hz:.4g} Hz on the spectrum rises by {rise_db.max():.1f} dB at the most, "
            f"and {threshold_db:g} dB are ringing"
        )
    shoulder = start + int(risen[0])
    valley = start + int(np.argmin(level_db[start : shoulder + 1]))
    return SpectralGap(float(f[valley]), float(f[shoulder]), float(level_db[shoulder:].max() - level_db[valley]))
