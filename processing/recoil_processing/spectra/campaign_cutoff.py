"""One cut-off for several shots, and for every channel that enters one regression.

The spectrum of a single shot scatters, and a cut-off chosen from it with it; shots of one set-up share
their motion and their ringing, and the mean of their spectra shows the gap more surely. A linear filter
commutes with ``F = m a`` only where it is the same on both sides: hence one cut-off for all channels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from recoil_processing.spectra.cutoff import Confidence, CutoffChoice, cutoff_of, refusal
from recoil_processing.spectra.spectral_gap import ENSEMBLE_SHOULDER_DB, SHOULDER_DB, ShotSpectrum
from recoil_processing.spectra.spectrum import average_normalised

LEAST_ENSEMBLE = 3
"""Shots whose mean scatters so much less that 6 dB are sure."""


def campaign_cutoff(channels: Mapping[str, Sequence[ShotSpectrum]]) -> CutoffChoice:
    """Choose one cut-off for several shots and all channels of one regression.

    Each channel's shots are averaged, each scaled to unit power, and the gap is looked for in the mean, from
    6 dB on. Where the mean has none, the median of the single shots' sure cut-offs stands in, if most of the
    shots have one. The lowest of the channels' cut-offs is taken.

    Parameters
    ----------
    channels
        Name of the channel -> one spectrum for each shot, from `recoil_processing.spectra.spectral_gap.shot_spectrum`.

    Returns
    -------
    CutoffChoice
        Choice to take. A channel that was refused one makes it doubtful, by name. Without any cut-off there is nothing
        to take off only if that is true of every channel.

    Raises
    ------
    ValueError
        If there is no channel, or one has no shot.
    """
    if not channels or not all(channels.values()):
        raise ValueError("a campaign needs at least one channel, and a shot for each")
    own = {name: channel_cutoff(shots) for name, shots in channels.items()}
    filtered = {name: choice for name, choice in own.items() if choice.cutoff_hz is not None}
    refused = [name for name, choice in own.items() if choice.cutoff_hz is None and not choice.nothing_to_take_off]
    refusals = "".join(f"; {name}: {own[name].reason}" for name in refused)
    if not filtered:
        if refused:
            return refusal(f"no channel has a cut-off{refusals}")
        reason = "there is nothing to take off from any channel"
        return refusal(reason, nothing_to_take_off=True)
    name, lowest = min(filtered.items(), key=lambda item: (item[1].cutoff_hz or 0.0, item[0]))
    confidence: Confidence = "doubtful" if refused or lowest.confidence != "sure" else "sure"
    reason = f"{name} needs the lowest of {len(filtered)} cut-offs: {lowest.reason}{refusals}"
    return replace(lowest, confidence=confidence, reason=reason)


def channel_cutoff(shots: Sequence[ShotSpectrum]) -> CutoffChoice:
    """Choose the cut-off of one channel by the mean over its shots, or the median of those that are sure.

    Parameters
    ----------
    shots
        One for each shot, at least one.
    """
    mean = ShotSpectrum(
        average_normalised([shot.spectrum for shot in shots]),
        float(np.median([shot.lowest_hz for shot in shots])),
        float(np.median([shot.rise_time_s for shot in shots])),
        max(shot.roll_off for shot in shots),
    )
    # one or two spectra scatter nearly as much as a single one
    together = cutoff_of(
        mean,
        sure_from_db=ENSEMBLE_SHOULDER_DB if len(shots) >= LEAST_ENSEMBLE else SHOULDER_DB,
    )
    if together.cutoff_hz is not None or together.nothing_to_take_off or len(shots) < LEAST_ENSEMBLE:
        return together
    single = [cutoff_of(shot) for shot in shots]
    sure = sorted((c for c in single if c.confidence == "sure"), key=lambda c: c.cutoff_hz or 0.0)
    if 2 * len(sure) <= len(shots):
        return together
    middle = sure[(len(sure) - 1) // 2]
    return replace(
        middle,
        confidence="doubtful",
        reason=f"median of {len(sure)} of {len(shots)} shots, whose mean has no gap: {middle.reason}",
    )
