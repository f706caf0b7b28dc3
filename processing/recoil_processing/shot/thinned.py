"""A shot whose fastest channels are thinned: enough for the alignment of its clocks, and for its mass at once.

The force of a recoiling mechanism fills some hundred Hz. What the thinned rate cannot hold is taken out by a symmetric
FIR filter (Kaiser's window; Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., 7.6), which moves nothing
in time, and only then samples are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.timebase import TimeBase
from recoil_processing.gaps import bridge
from recoil_rigs.fired_shot import FiredShot

Array = NDArray[np.float64]

THINNED_ABOVE_HZ = 100e3
"""Rate above which a channel is thinned."""
THINNED_TO_HZ = 50e3
"""Least rate of a thinned channel, but for the little by which a clock is off its nominal rate."""
_OFF_NOMINAL = 0.02
MOST_LOST = 0.5
"""Share of the filter's weight on lost samples beyond which a thinned one is lost: those of single ones are bridged."""
_REACH = 8
"""Thinned samples that the filter reaches to either side."""
_CUTOFF, _KAISER_BETA = 0.7, 7.0
"""-6 dB point over half the thinned rate, and shape of the window: above that half rate 70 dB are taken out."""
_EVEN = 0.5
"""Share of a step by which stamps may be off it: other stamps are no series that can be filtered."""
_OPERATION, _VERSION = "thin", "1"
"""Line of a thinned channel's history. Nothing stores one; the version is of the filter above."""


def thinned(fired: FiredShot) -> tuple[FiredShot, tuple[str, ...]]:
    """Thin the channels that are faster than `THINNED_ABOVE_HZ` by whole factors, to `THINNED_TO_HZ` or a little more.

    Returns
    -------
    thinned : FiredShot
        Shot with thinned channels; as it was given if there is none.
    names : tuple of str
        Names of the channels that were thinned.
    """
    factors = {name: _factor(channel.time_base) for name, channel in fired.shot.channels.items()}
    names = tuple(name for name, factor in factors.items() if factor > 1)
    if not names:
        return fired, ()
    channels = {
        name: _thinned(channel, factors[name]) if factors[name] > 1 else channel
        for name, channel in fired.shot.channels.items()
    }
    return replace(fired, shot=replace(fired.shot, channels=channels)), names


def _factor(time_base: TimeBase) -> int:
    """Return by which factor a channel is thinned, 1 if it is not."""
    if not time_base.rate_hz > THINNED_ABOVE_HZ:
        return 1
    if time_base.stamps_s is not None:
        steps_s = np.diff(time_base.stamps_s)
        if not np.all(np.abs(steps_s * time_base.rate_hz - 1.0) < _EVEN):
            return 1
    return int(time_base.rate_hz / THINNED_TO_HZ + _OFF_NOMINAL)


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
    weights = firwin(2 * reach + 1, _CUTOFF / factor, window=("kaiser", _KAISER_BETA))
    # before and behind the record its first and last sample stand
    padded = np.pad(bridge(samples), reach, mode="edge")
    kept: Array = upfirdn(weights, padded, 1, factor)[2 * _REACH :][: -(-samples.size // factor)]
    if lost.any():
        share = upfirdn(np.abs(weights), np.pad(lost.astype(np.float64), reach), 1, factor)[2 * _REACH :][: kept.size]
        kept[share > MOST_LOST * np.abs(weights).sum()] = np.nan
    return kept
