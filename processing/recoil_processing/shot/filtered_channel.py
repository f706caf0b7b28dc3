"""A recorded channel behind a filter, as reports that must be comparable show it."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.channel import Channel, Step
from recoil_processing.filters import ZeroPhaseFilter
from recoil_processing.repairs.short_gaps import bridge_short_gaps


def filtered_channel(channel: Channel, zero_phase: ZeroPhaseFilter, version: str) -> Channel:
    """Return a channel behind a filter, with one more line of history and without raw counts.

    Samples within the filter's reach of a lost one are lost too: what bridges a gap is no measurement. Gaps that no
    low-pass notices are bridged before.

    Parameters
    ----------
    channel
        Channel whose samples are evenly spaced.
    version
        Version of the program, for the history.

    Raises
    ------
    ValueError
        If the channel is not evenly spaced, its rate is too low for the filter, or too few samples are there.
    """
    step_s = channel.time_base.step_s
    if step_s is None:
        raise ValueError("the samples are not evenly spaced")
    rate_hz = 1.0 / step_s
    whole = bridge_short_gaps(channel.measured, step_s)
    samples, trusted = zero_phase.apply_with_gaps(whole.samples, rate_hz)
    if not trusted.any():
        there = int(np.count_nonzero(np.isfinite(channel.measured)))
        raise ValueError(f"{there} of {trusted.size} samples are there, and none of them is out of a lost one's reach")
    samples[~trusted] = np.nan
    bridged = {"bridged_samples": sum(one.count for one in whole.repairs)} if whole.repairs else {}
    step = Step("filter", version, {**zero_phase.describe(rate_hz).to_json(), **bridged})
    return channel.with_samples(samples, step)
