"""Checks of a channel's spectrum: gap, aliasing, hum, symmetry of the ringing.

Every check returns ``(verdict, detail)``; the limits and their sources stand in `recoil_processing.quality.limits`.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.quality.limits import LIMITS, Outcome
from recoil_processing.stress_waves.shock_response import octave_frequencies, shock_response

LEAST_SPECTRUM = 64
"""Samples of a part below which no spectrum is taken of it."""
ABOVE_NOISE_DB = 6.0
"""Level by which the last octave must rise over its own noise before the shot to be a signal at all."""
WHITE_PIECES, WHITE_DB = 6, 3.0
"""Pieces of the two last octaves, and the level by which they may differ, of a spectrum that is white."""
RINGING_OVER_PULSE = 5.0
"""Ratio below which a one-sided pulse decides which side of the shock response spectrum is higher."""
FASTEST_SRS = 0.1
"""Share of the sampling rate up to which peaks are not missed between samples."""


def check_gap(depth_db: float, valley_hz: float, shoulder_hz: float) -> Outcome:
    """Judge the gap between the rigid body's spectrum and the ringing.

    Parameters
    ----------
    depth_db
        Depth of the valley below the shoulder of the ringing.
    valley_hz, shoulder_hz
        Frequencies of valley and shoulder.
    """
    text = (
        f"the spectrum's gap at {valley_hz:.0f} Hz is {depth_db:.0f} dB deep below the ringing from {shoulder_hz:.0f} "
        "Hz"
    )
    remedy = (
        ": the ringing reaches into the pulse's band; choose the cut-off by hand, and mount the sensor more stiffly, "
        "or on a mechanical filter, before the next shot"
    )
    return LIMITS["gap_depth_db"].outcome(depth_db, text, remedy, unit=" dB")


def check_no_gap(reason: str, ringing: float, peak: float) -> Outcome:
    """Judge a record in whose spectrum no gap was found: one that does not ring needs none.

    Parameters
    ----------
    reason
        Sentence on why there is no gap.
    ringing
        Root mean square of what lies above the usual cut-off, during the shot.
    peak
        Peak of what lies below the ringing.
    """
    limit = LIMITS["ringing_share"]
    share = ringing / peak if peak > 0 else math.nan
    if limit.verdict(share) == "ok":
        return "ok", f"it hardly rings, {100 * share:.1f} % of the peak; {reason}"
    return "warn", (
        f"it rings by {100 * share:.0f} % of the pulse's peak (limit {100 * limit.warn:g} %), but {reason}; choose the "
        "cut-off by hand, and mount the sensor more stiffly, or on a mechanical filter, before the next shot"
    )


def last_octave_fall_db(
    samples: Array, in_baseline: Flags, pulse: Flags, rate_hz: float, above_hz: float
) -> float | None:
    """Find how far the spectrum falls from the ringing's peak to the last octave below half the rate.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples without missing ones.
    in_baseline, pulse : ndarray of bool, shape (n,)
        Samples before the shot, and in it, each in one piece.
    rate_hz
        Samples per second.
    above_hz
        Frequency at which ringing begins: the pulse's own band lies below.

    Returns
    -------
    float or None
        Fall in dB of power density; infinite where the last octave holds nothing but the noise that was there before
        the shot. None where there are too few samples, no octave is left for the ringing, or there was no noise before
        the shot, so that what is there in it cannot be told from ringing.
    """
    before, during = samples[in_baseline], samples[pulse]
    size = 1 << max(int(math.log2(max(min(before.size, during.size), 1) / 2)), 0)
    size = min(size, 1 << 12)
    if size < LEAST_SPECTRUM or above_hz >= 0.25 * rate_hz:
        return None
    frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
    power, noise = _density(during, size, rate_hz), _density(before, size, rate_hz)
    last = (frequency >= 0.25 * rate_hz) & (frequency < 0.49 * rate_hz)
    ringing = (frequency >= above_hz) & (frequency < 0.25 * rate_hz)
    if not ringing.any():
        return None
    level, floor, peak = float(np.mean(power[last])), float(np.mean(noise[last])), float(np.max(power[ringing]))
    if not floor > 0:
        return None
    if level <= 10 ** (ABOVE_NOISE_DB / 10) * floor or _is_white(power[frequency >= 0.125 * rate_hz][:-1]):
        return math.inf
    return 10 * math.log10(peak / level)


def _is_white(power: Array) -> bool:
    """Return whether a spectrum is flat: noise that comes with the motion, and nothing that a filter has let fall."""
    if power.size < LEAST_SPECTRUM:
        return False
    levels = [float(np.mean(piece)) for piece in np.array_split(power, WHITE_PIECES)]
    return max(levels) < 10 ** (WHITE_DB / 10) * min(levels)


def _density(samples: Array, size: int, rate_hz: float) -> Array:
    """Return the one-sided power density, square of the samples' unit per Hz, shape (size // 2 + 1,)."""
    from scipy.signal import welch  # only here: it takes a second to import

    return np.asarray(welch(samples, rate_hz, nperseg=size)[1])


def check_aliasing(fall_db: float, rate_hz: float) -> Outcome:
    """Judge whether the anti-alias filter kept the ringing off half the sampling rate.

    Parameters
    ----------
    fall_db
        Fall as `last_octave_fall_db` gives it.
    rate_hz
        Samples per second.
    """
    band = f"between {rate_hz / 4000:.3g} and {rate_hz / 2000:.3g} kHz"
    if math.isinf(fall_db) and fall_db > 0:
        return "ok", f"nothing but noise {band}"
    text = f"the spectrum {band} is {fall_db:.0f} dB below the ringing"
    remedy = (
        ": what rings above is folded back into the record; raise the sampling rate or lower the anti-alias filter "
        "before the next shot"
    )
    return LIMITS["aliasing_db"].outcome(fall_db, text, remedy, unit=" dB")


def check_hum(amplitude: float, frequency_hz: float, peak: float, *, unit: str) -> Outcome:
    """Judge the mains' hum on a channel.

    Parameters
    ----------
    amplitude
        Amplitude of all harmonics together; 0 where none stands out of the noise.
    frequency_hz
        Frequency of the mains.
    peak
        Peak of the pulse.
    """
    if not amplitude > 0:
        return "ok", "no hum above the noise"
    share = amplitude / peak if peak > 0 else math.nan
    size = measured(amplitude, unit, ".3g")
    text = worded(f"hum of {frequency_hz:.3g} Hz, ", size, f", {100 * share:.2f} % of the peak")
    remedy = (
        ": a ground loop; run the amplifier from a battery, or earth the cable's screen at one end only, before the "
        "next shot"
    )
    return LIMITS["hum_share"].outcome(share, text, remedy, share=True)


def check_srs_symmetry(acceleration: Array, rate_hz: float, lowest_hz: float, ringing_over_pulse: float) -> Outcome:
    """Compare the upward and the downward shock response spectrum by the mean of their ratio above the pulse's band.

    A one-sided pulse makes them lopsided rightly: by 5 to 11 dB in simulated recoils that ring by 1 to 2.8
    times the pulse; with the pulse filtered out they are alike whatever was clipped. So they are judged only
    where ringing is at least `RINGING_OVER_PULSE` times the pulse; there sound ringing was less than 3 dB off,
    rectified ringing more than 4 dB.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Acceleration around the shot, its level at rest taken off; without missing samples.
    rate_hz
        Samples per second.
    lowest_hz
        Frequency above the pulse's band, ``3 / T`` at the least. The spectra are compared from there to a tenth of the
        rate.
    ringing_over_pulse
        Largest magnitude above the pulse's band over the pulse's: by the force if it was measured, for clipped ringing
        adds to what the accelerometer shows as the pulse.
    """
    frequencies = octave_frequencies(lowest_hz, FASTEST_SRS * rate_hz)
    if frequencies.size == 0:
        return "ok", f"no band between {lowest_hz:.0f} Hz, where ringing begins, and a tenth of the sampling rate"
    if not ringing_over_pulse >= RINGING_OVER_PULSE:
        return "ok", f"not judged: it rings by {ringing_over_pulse:.2f} times the one-sided pulse only"
    response = shock_response(acceleration, rate_hz, frequencies)
    ratio_db = float(np.mean(response.ratio_db))
    text = f"upward over downward shock response above {lowest_hz:.0f} Hz {ratio_db:+.1f} dB"
    remedy = (
        ": clipped on one side, or its zero jumps; use a larger range, and check mounting and cable before the next "
        "shot"
    )
    return LIMITS["srs_ratio_db"].outcome(abs(ratio_db), text, remedy, unit=" dB")
