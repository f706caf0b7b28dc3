"""Ringing on a record, and the record without it: the stage put together.

A shot's motion is filtered without smearing its beginning into the time before it. Before the first instant of the shot
the mass is at rest. A symmetric filter does not know that: it puts a ripple before the shot and rounds the break of
slope at it. Where the instant is known, the motion is continued backward by odd reflection about it, the one
continuation that keeps value and slope, and only then filtered. Where it is known badly, this does harm, and the plain
filter is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_not_negative
from recoil_processing.filters import LowPassFilter
from recoil_processing.gaps import bridge, near
from recoil_processing.spectra.cutoff import CutoffChoice, choose_cutoff
from recoil_processing.spectra.spectral_gap import rest_level, shot_window
from recoil_processing.stress_waves.ringing import Mode, ringing_modes

MOST_PERIODS_OFF = 0.03
"""Largest standard uncertainty of the onset, in periods of the cut-off."""
LEAST_BEFORE = 8
"""Samples before the onset by which the level at rest is estimated."""


@dataclass(frozen=True, eq=False)
class StressWaveReport(ReadOnlyArrays):
    """One channel without its stress waves, and what was taken off.

    Attributes
    ----------
    choice
        Choice of the cut-off, with its confidence and reason; the valley for a figure.
    filtered : ndarray, shape (n_samples,)
        Filtered record; the record itself, lost samples NaN, where there is no cut-off.
    trusted : ndarray of bool, shape (n_samples,)
        Flags, false where a sample was lost, or the filter reaches one.
    modes
        Modes that ring, by falling share of energy; empty without a cut-off.
    ringing_share
        Energy of what was taken off over that of the record, in the window around the shot; 0 without a cut-off.
    """

    choice: CutoffChoice
    filtered: Array
    trusted: Flags
    modes: tuple[Mode, ...]
    ringing_share: float


def strip_stress_waves(
    samples: Array,
    rate_hz: float,
    *,
    onset_s: float | None = None,
    u_onset_s: float = math.inf,
    quantity: str = "acceleration",
    choice: CutoffChoice | None = None,
    low_pass: LowPassFilter | None = None,
    find_modes: bool = True,
) -> StressWaveReport:
    """Take the stress waves off one channel of one shot.

    Every channel of one regression must be given the same `choice`, `onset_s` and `u_onset_s`: then all of
    them pass the same linear map, which commutes with ``F = m a``.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples; lost ones are NaN.
    onset_s
        First instant of the motion, after the first sample; None where it is not known at all.
    u_onset_s
        Standard uncertainty of the onset; the record is reflected about the onset where that is small enough.
    quantity
        See `recoil_processing.spectra.spectral_gap.ROLL_OFF`.
    choice
        A cut-off chosen before, for the campaign or for all channels; None chooses one for this record.
    low_pass
        Filter of that cut-off; None for the one that the choice names.
    find_modes
        Whether to look for the modes, which takes longer than all the rest.

    Raises
    ------
    ValueError
        If the onset lies outside the record, the cut-off is not below the Nyquist frequency, or as in
        `recoil_processing.spectra.cutoff.choose_cutoff`.
    """
    onset_index = None if onset_s is None else math.ceil(round(onset_s * rate_hz, 6))
    begin, end = shot_window(samples.size, rate_hz, onset_index)
    if choice is None:
        choice = choose_cutoff(samples, rate_hz, onset_index=onset_index, quantity=quantity)
    lost = np.isnan(samples)
    low_pass = low_pass or choice.low_pass
    if low_pass is None or np.count_nonzero(~lost) < 2:
        return StressWaveReport(choice, samples.copy(), ~lost, (), 0.0)
    whole = bridge(samples)
    if onset_s is None:
        filtered = low_pass.apply(whole, rate_hz)
    else:
        filtered, _ = filter_about_onset(whole, rate_hz, low_pass, onset_s=onset_s, u_onset_s=u_onset_s)
    motion = whole - rest_level(whole[begin:end], None if onset_index is None else onset_index - begin)
    residual = whole - filtered
    modes: tuple[Mode, ...] = ()
    if find_modes:
        lowest_hz = choice.valley_hz if math.isfinite(choice.valley_hz) else low_pass.cutoff_hz
        modes = ringing_modes(residual, rate_hz, lowest_hz=lowest_hz, recorded=motion, first=onset_index or 0)
    energy = float(np.sum(motion[begin:end] ** 2))
    return StressWaveReport(
        choice=choice,
        filtered=filtered,
        trusted=~near(lost, low_pass.reach_samples(rate_hz)),
        modes=modes,
        ringing_share=float(np.sum(residual[begin:end] ** 2)) / energy if energy > 0 else 0.0,
    )


def filter_about_onset(
    samples: Array, rate_hz: float, low_pass: LowPassFilter, *, onset_s: float, u_onset_s: float
) -> tuple[Array, bool]:
    """Low-pass filter a record, reflected about its onset where that is known well enough.

    For one rate, one onset and one filter this is a linear map, and the same for every channel: all its
    weights, those of the level at rest among them, depend on these three alone. It therefore commutes
    with ``F = m a`` as the plain filter does, **if every channel of a regression passes it with the same
    onset and uncertainty**. Channels that are skewed against each other must be aligned first.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,) or (n_samples, n_channels)
        Samples, all finite.
    onset_s
        First instant of the motion, after the first sample; it is rounded to half a sample.
    u_onset_s
        Standard uncertainty of the onset.

    Returns
    -------
    filtered : ndarray, same shape
        Filtered samples; before the onset those there are reflected likewise, and the two parts meet at the level at
        rest.
    used : bool
        Whether the samples were reflected about the onset: not where it is known too badly, or lies outside the record
        or within its first eight samples; the plain filter was taken then.

    Raises
    ------
    ValueError
        As in `onset_known_well_enough` and `LowPassFilter.apply`, or if the onset is not finite.
    """
    if not math.isfinite(onset_s):
        raise ValueError(f"onset_s must be finite, not {onset_s}")
    half_samples = round(2 * onset_s * rate_hz)
    begin, at_sample = (half_samples + 1) // 2, half_samples % 2 == 0
    after = begin + 1 if at_sample else begin
    if not (onset_known_well_enough(low_pass, u_onset_s) and begin >= LEAST_BEFORE and after < samples.shape[0]):
        return low_pass.apply(samples, rate_hz), False
    # as far as the filter's own ends are continued
    reach = math.ceil(3 * rate_hz / low_pass.cutoff_hz)
    rest = np.mean(samples[max(0, begin - reach) : begin], axis=0, keepdims=True)
    middle = rest if at_sample else rest[:0]
    earlier, later = samples[:begin], samples[after:]
    mirrored_later = (2 * rest - later[:reach])[::-1]
    mirrored_earlier = (2 * rest - earlier[-reach:])[::-1]
    motion = low_pass.apply(np.concatenate([mirrored_later, middle, later]), rate_hz)[mirrored_later.shape[0] :]
    at_rest = low_pass.apply(np.concatenate([earlier, middle, mirrored_earlier]), rate_hz)[:begin]
    return np.concatenate([at_rest, motion]), True


def onset_known_well_enough(low_pass: LowPassFilter, u_onset_s: float) -> bool:
    """Return whether the onset is known well enough for the reflection to help.

    Parameters
    ----------
    u_onset_s
        Standard uncertainty of the onset.

    Raises
    ------
    ValueError
        If the uncertainty is negative or NaN.
    """
    require_not_negative(u_onset_s=u_onset_s)
    return u_onset_s * low_pass.cutoff_hz <= MOST_PERIODS_OFF
