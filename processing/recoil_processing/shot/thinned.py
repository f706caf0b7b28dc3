"""A shot whose fastest channels are thinned: enough for the alignment of its clocks, and for its mass at once.

The force of a recoiling mechanism fills some hundred Hz. What the thinned rate cannot hold is taken out by a symmetric
FIR filter (Kaiser's window; Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., 7.6), which moves nothing
in time, and only then samples are left out. Its -6 dB point is half the thinned rate, so that noise of all frequencies
keeps its density, to 3 % of its standard deviation: what is counted beside it means the same at any rate. Nothing folds
below 0.73 of that half rate, where 70 dB are taken out; what folds above it passes no filter of a mass.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.gaps import bridge
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import ExposureAlignment, TriggerAlignment

THINNED_ABOVE_HZ = 100e3
"""Rate above which a channel is thinned."""
THINNED_TO_HZ = Gun.force_rate_hz
"""Least rate of a thinned channel, but for the little by which a clock is off its nominal rate."""
_OFF_NOMINAL = 0.02
MOST_LOST = 0.5
"""Share of the filter's weight on lost samples beyond which a thinned one is lost: those of single ones are bridged."""
_REACH = 8
"""Thinned samples that the filter reaches to either side."""
_KAISER_BETA = 7.0
"""Shape of the window: its transition band of 0.54 of half the thinned rate lies about that half rate."""
_EVEN = 0.5
"""Share of a step by which stamps may be off it: other stamps are no series that can be filtered."""
_OPERATION, _VERSION = "thin", "1"
"""Line of a thinned channel's history. Nothing stores one; the version is of the filter above."""


def thinned(fired: FiredShot) -> tuple[FiredShot, tuple[str, ...]]:
    """Thin the channels that are faster than `THINNED_ABOVE_HZ` by whole factors, to what the force needs.

    Lines whose edges align clocks stay as they are: an edge is told to a sample.

    Returns
    -------
    thinned : FiredShot
        Shot with thinned channels; as it was given if there is none.
    names : tuple of str
        Names of the channels that were thinned.
    """
    to_hz = fired.rig.mechanism.force_rate_hz
    lines = {
        one.align.channel for one in fired.rig.sources if isinstance(one.align, TriggerAlignment | ExposureAlignment)
    }
    factors = {
        name: 1 if name in lines or channel.role == "trigger" else _factor(channel.time_base, to_hz)
        for name, channel in fired.shot.channels.items()
    }
    names = tuple(name for name, factor in factors.items() if factor > 1)
    if not names:
        return fired, ()
    channels = {
        name: _thinned(channel, factors[name]) if factors[name] > 1 else channel
        for name, channel in fired.shot.channels.items()
    }
    return replace(fired, shot=replace(fired.shot, channels=channels)), names


def thinning_factor(rate_hz: float, to_hz: float = THINNED_TO_HZ) -> int:
    """Return by which factor samples of a rate are thinned, 1 if they are not."""
    return max(int(rate_hz / to_hz + _OFF_NOMINAL), 1) if rate_hz > THINNED_ABOVE_HZ else 1


def factor_of(times_s: Array, to_hz: float = THINNED_TO_HZ) -> int:
    """Return by which factor samples at some instants are thinned, 1 if they are not."""
    lasts_s = float(times_s[-1] - times_s[0]) if times_s.size > 1 else 0.0
    return thinning_factor((times_s.size - 1) / lasts_s, to_hz) if lasts_s > 0.0 else 1


def _factor(time_base: TimeBase, to_hz: float) -> int:
    """Return by which factor a channel is thinned, 1 if it is not."""
    factor = thinning_factor(time_base.rate_hz, to_hz)
    if factor > 1 and time_base.stamps_s is not None:
        steps_s = np.diff(time_base.stamps_s)
        if not np.all(np.abs(steps_s * time_base.rate_hz - 1.0) < _EVEN):
            return 1
    return factor


def _thinned(channel: Channel, factor: int) -> Channel:
    base = channel.time_base
    count = -(-base.count // factor)
    if base.stamps_s is not None:
        time_base = replace(base, count=count, stamps_s=base.stamps_s[::factor])
    else:
        time_base = replace(base, count=count, step_s=factor * (base.step_s or 0.0))
    step = Step(_OPERATION, _VERSION, {"factor": factor, "rate_hz": base.rate_hz / factor})
    return replace(
        channel, samples=thinned_samples(channel.measured, factor), time_base=time_base, raw=None,
        history=(*channel.history, step),
    )  # fmt: skip


def thinned_beside(times_s: Array, samples: Array, to_hz: float = THINNED_TO_HZ) -> tuple[Array, Array]:
    """Thin samples as channels are, with their times; as they are given where they are slow enough.

    Parameters
    ----------
    times_s, samples : ndarray of float64, shape (n_samples,)
        Samples in order; their rate is that of the whole, since stamps of a bus come in bursts.
    to_hz
        Rate that they need at most.

    Returns
    -------
    times_s, samples : ndarray of float64, shape (n_thinned,)
    """
    factor = factor_of(times_s, to_hz)
    return (times_s, samples) if factor == 1 else (times_s[::factor], thinned_samples(samples, factor))


def thinned_samples(samples: Array, factor: int) -> Array:
    """Take out what a lower rate cannot hold, and leave out all but every so many samples.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_samples,)
        Samples; lost ones are NaN.
    factor
        Number of samples of which one is kept, the first among them.

    Returns
    -------
    ndarray of float64, shape (ceil(n_samples / factor),)
        Samples at the times of those that are kept; NaN where most of the filter's weight lies on lost ones. All are
        NaN where all were.
    """
    from scipy.signal import firwin, upfirdn  # only here: it takes a second to import

    lost = np.isnan(samples)
    if lost.all():
        return samples[::factor].copy()
    reach = _REACH * factor
    weights = firwin(2 * reach + 1, 1.0 / factor, window=("kaiser", _KAISER_BETA))
    # before and behind the record its first and last sample stand
    padded = np.pad(bridge(samples), reach, mode="edge")
    kept: Array = upfirdn(weights, padded, 1, factor)[2 * _REACH :][: -(-samples.size // factor)]
    if lost.any():
        share = upfirdn(np.abs(weights), np.pad(lost.astype(np.float64), reach), 1, factor)[2 * _REACH :][: kept.size]
        kept[share > MOST_LOST * np.abs(weights).sum()] = np.nan
    return kept
