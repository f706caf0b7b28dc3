"""Ringing on a record, and the record without it: the stage put together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_processing.gaps import bridge, near
from recoil_processing.spectra.cutoff import CutoffChoice, choose_cutoff
from recoil_processing.spectra.spectral_gap import rest_level, shot_window
from recoil_processing.stress_waves.onset_reflection import filter_about_onset
from recoil_processing.stress_waves.ringing import Mode, ringing_modes

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class StressWaveReport(ReadOnlyArrays):
    """One channel without its stress waves, and what was taken off.

    Attributes
    ----------
    choice
        The cut-off, its confidence and reason; the valley for a figure.
    filtered : ndarray, shape (n_samples,)
        The record itself, lost samples NaN, where there is no cut-off.
    trusted : ndarray of bool, shape (n_samples,)
        False where a sample was lost, or the filter reaches one.
    modes
        What rings, by falling share of energy; empty without a cut-off.
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
    find_modes: bool = True,
) -> StressWaveReport:
    """Take the stress waves off one channel of one shot.

    Every channel of one regression must be given the same `choice`, `onset_s` and `u_onset_s`: then all of
    them pass the same linear map, which commutes with ``F = m a``.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Lost ones NaN.
    onset_s
        First instant of the motion, after the first sample; None where it is not known at all.
    u_onset_s
        Its standard uncertainty; the record is reflected about the onset where that is small enough.
    quantity
        See `recoil_processing.spectra.spectral_gap.ROLL_OFF`.
    choice
        A cut-off chosen before, for the campaign or for all channels; None chooses one for this record.
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
    low_pass = choice.low_pass
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
