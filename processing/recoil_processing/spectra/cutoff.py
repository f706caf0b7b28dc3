"""Choose a low-pass filter's cut-off by the error that it will leave, and say how far to trust it.

The usual automatic rules (residual analysis, autocorrelation, cross-validation) take what is not motion
for white noise; ringing is not white, and they keep it. Here the spectrum is split at its gap into a
model of the motion and one of the ringing. The cut-off is where the motion lost and the ringing left
over are least together: the choice that a Wiener filter makes (N. Wiener, 1949), within the family of
zero-phase Butterworth filters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from recoil_acquisition.files.strict_json import as_floats
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.filters import LowPass
from recoil_processing.spectra.spectral_gap import (
    ENSEMBLE_SHOULDER_DB,
    SHOULDER_DB,
    ShotSpectrum,
    SpectralGap,
    gap_of,
    shot_spectrum,
)
from recoil_processing.spectra.spectrum import POINTS_PER_OCTAVE

Confidence = Literal["sure", "doubtful", "none"]

HALF_ORDER = 4
"""Order between too gentle a skirt and ripple at every break of slope."""
MOTION_BELOW = 0.85
"""Share of the valley's frequency up to which the measured density is taken for that of the motion."""
STEEPEST_GUESS = -2.0
"""Largest exponent of the motion's density above that; a signal with jumps falls as slowly."""
FALL_OCTAVES = 2.0
"""Least width below the valley over which the spectrum's fall is measured."""
LEAST_LEFT_OVER = 0.3
"""Share of the density above the valley that is ringing, however much motion the power law puts there."""
MUCH_ABOVE = 0.1
"""Share of a signal's energy above the rise's own frequencies that, without a gap, is motion and ringing mixed."""
WORTH = 0.5
"""Largest expected error over that without a filter: one that does not halve it is not worth a changed motion."""

_MAY_BE_NAN = ("valley_hz", "shoulder_hz", "depth_db", "predicted_error")


@dataclass(frozen=True)
class CutoffChoice:
    """A cut-off, or why there is none.

    Attributes
    ----------
    cutoff_hz
        -3 dB point of the two passes of a `LowPass`; None where nothing is to be taken off, or nothing can be.
    valley_hz, shoulder_hz, depth_db
        Valley, shoulder and depth of the gap, see `recoil_processing.spectra.spectral_gap.SpectralGap`; NaN where there
        is none.
    predicted_error
        Norm of the error that is left over that of the motion; NaN without a cut-off.
    confidence : {"sure", "doubtful", "none"}
        A gap of 10 dB or more (6 dB in the mean of several shots) below which the spectrum falls as that of a motion;
        one of 6 to 10 dB, or below which it does not fall so; none.
    reason
        Sentence on why.
    nothing_to_take_off
        True where there is no cut-off because the record needs none; False where it was refused.
    """

    cutoff_hz: float | None
    half_order: int
    valley_hz: float
    shoulder_hz: float
    depth_db: float
    predicted_error: float
    confidence: Confidence
    reason: str
    nothing_to_take_off: bool = False

    @property
    def low_pass(self) -> LowPass | None:
        """The filter, or None."""
        return None if self.cutoff_hz is None else LowPass(self.cutoff_hz, self.half_order)

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> CutoffChoice:
        """Return what `to_json` wrote; KeyError or TypeError if it is no such choice."""
        unknown = {name: math.nan for name in _MAY_BE_NAN if stated[name] is None}
        return cls(**{**as_floats(stated, cls), **unknown})

    def to_json(self) -> dict[str, Any]:
        """Return all of it in JSON types; what is not a number is None."""
        return {
            name: None if name in _MAY_BE_NAN and math.isnan(value) else value for name, value in asdict(self).items()
        }


def choose_cutoff(
    samples: Array,
    rate_hz: float,
    *,
    onset_index: int | None = None,
    quantity: str = "acceleration",
) -> CutoffChoice:
    """Choose the cut-off for one record of one shot.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; lost ones are NaN.
    onset_index
        First sample of the shot; None takes the whole record for its window.
    quantity
        See `recoil_processing.spectra.spectral_gap.ROLL_OFF`.

    Raises
    ------
    ValueError
        As in `recoil_processing.spectra.spectral_gap.shot_spectrum`.
    """
    shot = shot_spectrum(samples, rate_hz, onset_index=onset_index, quantity=quantity)
    return refusal(shot) if isinstance(shot, str) else cutoff_of(shot)


def cutoff_of(shot: ShotSpectrum, *, sure_from_db: float = SHOULDER_DB) -> CutoffChoice:
    """Choose the cut-off for a spectrum.

    Parameters
    ----------
    shot
        Spectrum of one shot, or the mean of several.
    sure_from_db
        Depth from which a gap is sure; down to 6 dB it is doubtful.
    """
    gap = gap_of(shot.spectrum, shot.lowest_hz, sure_from_db)
    if isinstance(gap, str) and sure_from_db > ENSEMBLE_SHOULDER_DB:
        gap = gap_of(shot.spectrum, shot.lowest_hz, ENSEMBLE_SHOULDER_DB)
    if isinstance(gap, str):
        share = share_above(shot)
        if share < MUCH_ABOVE:
            return refusal(
                f"there is nothing to take off: {100 * share:.2g} % of the signal's energy lie above "
                f"{shot.lowest_hz:.4g} Hz, and no ringing stands out there",
                nothing_to_take_off=True,
            )
        return refusal(
            f"{gap}; {100 * share:.0f} % of the signal's energy lie there: motion and ringing overlap, "
            "and no frequency parts them",
        )
    motion, ringing = split(shot, gap)
    weight = shot.spectrum.frequency_hz
    unfiltered = math.sqrt(float(np.sum(ringing * weight) / np.sum(motion * weight)))
    cutoff_hz, error = _least_risk(shot, motion, ringing, gap)
    if error > WORTH * unfiltered:
        little = unfiltered**2 < MUCH_ABOVE
        return refusal(
            f"{'there is nothing to take off' if little else 'a filter is not worth its price'}: above "
            f"{gap.valley_hz:.4g} Hz the signal rings by {100 * unfiltered:.2g} % of its motion, "
            f"and {100 * error:.2g} % of error would be left behind the best filter",
            nothing_to_take_off=little,
        )
    deep, exponent = gap.depth_db >= sure_from_db, fall(shot, gap)
    sure = deep and exponent <= STEEPEST_GUESS
    reason = (
        f"motion and ringing part at {gap.valley_hz:.4g} Hz, the ringing rises {gap.depth_db:.1f} dB from there: "
        f"{100 * unfiltered:.3g} % of the motion before the filter, {100 * error:.2g} % of error expected behind it"
    )
    if not deep:
        reason += f"; less than {sure_from_db:g} dB are doubtful: look at the spectrum, or average several shots"
    if exponent > STEEPEST_GUESS:
        reason += (
            f"; not sure: up to there the density goes with the frequency to the power of {exponent:.1f}, and that of "
            f"a motion falls with {STEEPEST_GUESS:g} or faster, so that ringing lies below that frequency as well"
        )
    return CutoffChoice(
        cutoff_hz,
        HALF_ORDER,
        gap.valley_hz,
        gap.shoulder_hz,
        gap.depth_db,
        error,
        "sure" if sure else "doubtful",
        reason,
    )


def split(shot: ShotSpectrum, gap: SpectralGap) -> tuple[Array, Array]:
    """Split a density at its gap into that of the motion and that of the ringing.

    The motion is what was measured below 0.85 of the valley and a power law above it, fitted over the
    decade below. The ringing is what was measured above the valley less the motion there; below the valley
    it falls by the power of the frequency that a mode's double (or single) zero at frequency zero brings,
    down to the white floor.

    Returns
    -------
    motion, ringing : ndarray, shape of the density
    """
    f, density = shot.spectrum.frequency_hz, shot.spectrum.density
    edge = MOTION_BELOW * gap.valley_hz
    fitted = (f >= 0.1 * edge) & (f <= edge)
    octaves = np.log(f[fitted] / edge)
    exponent, level = np.polyfit(octaves, np.log(density[fitted]), 1) if octaves.size > 2 else (STEEPEST_GUESS, 0.0)
    if exponent > STEEPEST_GUESS or octaves.size <= 2:
        exponent = STEEPEST_GUESS
        level = float(np.mean(np.log(density[fitted]) - exponent * octaves))
    motion = np.where(f <= edge, density, np.exp(level) * (f / edge) ** exponent)
    above = f >= gap.valley_hz
    floor = float(density[above].min())
    # the power law is a guess: it may not explain away most of what was measured
    left_over = np.maximum(density - motion, LEAST_LEFT_OVER * density)
    at_valley = float(left_over[above][0])
    ringing = np.where(above, left_over, np.maximum(at_valley * (f / gap.valley_hz) ** shot.roll_off, floor))
    return motion, ringing


def fall(shot: ShotSpectrum, gap: SpectralGap) -> float:
    """Return the exponent of the density from the motion's own frequencies to the valley, two octaves at least.

    Where a gap parts motion from ringing, what lies below it is the tail of the motion, which falls steeply. A
    spectrum that is flat there holds broadband ringing, and the gap is one between ringing and ringing.
    """
    f, density = shot.spectrum.frequency_hz, shot.spectrum.density
    fitted = (f >= min(shot.lowest_hz, gap.valley_hz / 2.0**FALL_OCTAVES)) & (f <= gap.valley_hz)
    if np.count_nonzero(fitted) < 3:
        return STEEPEST_GUESS
    return float(np.polyfit(np.log(f[fitted]), np.log(density[fitted]), 1)[0])


def share_above(shot: ShotSpectrum) -> float:
    """Share of a signal's energy above the frequencies of its own rise."""
    above = shot.spectrum.frequency_hz >= shot.lowest_hz
    weights = shot.spectrum.density * shot.spectrum.frequency_hz
    return float(np.sum(weights[above]) / np.sum(weights))


def _least_risk(shot: ShotSpectrum, motion: Array, ringing: Array, gap: SpectralGap) -> tuple[float, float]:
    """Return the cut-off of least predicted error, and that error over the motion."""
    f = shot.spectrum.frequency_hz
    # finer than the spectrum's own grid by two, from three octaves below the valley to the shoulder
    steps = 2 * POINTS_PER_OCTAVE
    count = math.ceil(steps * math.log2(gap.shoulder_hz / gap.valley_hz * 8.0))
    cutoffs = gap.shoulder_hz * 2.0 ** (-np.arange(count + 1) / steps)
    gain = LowPass(1.0, HALF_ORDER).gain(f / cutoffs[:, None])
    risk = ((1.0 - gain) ** 2) @ (motion * f) + (gain**2) @ (ringing * f)
    least = int(np.argmin(risk))
    return float(cutoffs[least]), math.sqrt(float(risk[least] / np.sum(motion * f)))


def refusal(reason: str, half_order: int = HALF_ORDER, *, nothing_to_take_off: bool = False) -> CutoffChoice:
    """Make the choice of no cut-off, for a reason in words."""
    nan = math.nan
    return CutoffChoice(None, half_order, nan, nan, nan, nan, "none", reason, nothing_to_take_off)
