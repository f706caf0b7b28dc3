"""Every clock of a shot related to the reference clock, in the order in which they need one another.

Fixed and trigger alignments come first, then redundant channels, then motion: the camera's alignment
uses the carriage's motion, which may have been recorded on another clock.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.shot import ClockAlignment, Shot
from identification.kinematics import travel_acceleration, turning
from identification.signals import Signals, collect_signals
from processing.align import failed_alignment, judge_edges, judge_motion, judge_redundant
from processing.gaps import bridge
from processing.motion_alignment import align_motion
from processing.noise import noise_sigma
from processing.redundant_alignment import align_redundant
from processing.trigger_alignment import align_edges, rising_edges
from rigs.rig import FixedAlignment, MotionAlignment, RedundantAlignment, Rig, Source, TriggerAlignment

Array = NDArray[np.float64]

_ORDER = (FixedAlignment, TriggerAlignment, RedundantAlignment, MotionAlignment)


def align_clocks(shot: Shot, rig: Rig) -> tuple[ClockAlignment, ...]:
    """Align every clock of a shot, each by the method that the rig declares.

    Parameters
    ----------
    shot : Shot
        Assembled, without alignments.
    rig : Rig

    Returns
    -------
    tuple of ClockAlignment
        One per source other than the reference that the shot has channels of, in the rig's order. What
        cannot be aligned has status ``failed`` and says why.
    """
    recorded = {c.time_base.clock for c in shot.channels.values()}
    sources = [s for s in rig.sources if s.name != rig.reference_clock and s.name in recorded]
    found: dict[str, ClockAlignment] = {}
    for method in _ORDER:
        for source in sources:
            if isinstance(source.align, method):
                found[source.name] = _align(shot, rig, source, found)
    return tuple(found[s.name] if s.name in found else _align(shot, rig, s, found) for s in sources)


def _align(shot: Shot, rig: Rig, source: Source, found: dict[str, ClockAlignment]) -> ClockAlignment:
    align = source.align
    if isinstance(align, FixedAlignment):
        return ClockAlignment(source.name, align.offset_s, align.u_offset_s, align.drift, align.u_drift, "ok", "fixed")
    if isinstance(align, TriggerAlignment):
        return _by_trigger(shot, rig, source, align)
    if isinstance(align, RedundantAlignment):
        return _by_redundant_channel(shot, rig, source, align)
    if isinstance(align, MotionAlignment):
        return _by_motion(shot, rig, source, align, found)
    return failed_alignment(source.name, "none", "the rig declares no alignment")


def _by_trigger(shot: Shot, rig: Rig, source: Source, align: TriggerAlignment) -> ClockAlignment:
    own, other = shot.channels.get(align.channel), shot.by_role("trigger")
    if own is None or other is None:
        missing = align.channel if own is None else "a channel of role trigger on the reference clock"
        return failed_alignment(source.name, "trigger", f"{missing} is not in this shot")
    u_edge = math.hypot(_step(own), _step(other)) / math.sqrt(12.0)
    edges = [rising_edges(c.time_base.times_s - rig.channel(c.name).sensor.delay_s, _samples(c)) for c in (own, other)]
    fit = align_edges(edges[0], edges[1], u_edge_s=u_edge, drift_allowance=align.drift_allowance)
    return judge_edges(source.name, fit, u_edge_s=u_edge)


def _by_redundant_channel(shot: Shot, rig: Rig, source: Source, align: RedundantAlignment) -> ClockAlignment:
    own, other = shot.channels.get(align.channel), shot.channels.get(align.against)
    if own is None or other is None:
        missing = align.channel if own is None else align.against
        return failed_alignment(source.name, "redundant", f"channel {missing} is not in this shot")
    if other.time_base.clock != shot.reference_clock:
        return failed_alignment(source.name, "redundant", f"channel {align.against} is not on the reference clock")
    base = other.time_base
    step = _step(other)
    reference = bridge(_samples(other), otherwise=0.0)
    if base.step_s is None:
        grid = base.start_s + step * np.arange(int((base.end_s - base.start_s) / step) + 1)
        reference = np.interp(grid, base.times_s, reference)
    fit = align_redundant(
        own.time_base.times_s - rig.channel(own.name).sensor.delay_s,
        _samples(own),
        base.start_s - rig.channel(other.name).sensor.delay_s,
        step,
        reference,
        drift_allowance=align.drift_allowance,
    )
    return judge_redundant(source.name, fit)


def _by_motion(
    shot: Shot, rig: Rig, source: Source, align: MotionAlignment, found: dict[str, ClockAlignment]
) -> ClockAlignment:
    own = next(
        (c for c in shot.channels.values() if c.time_base.clock == source.name and c.quantity == "displacement"), None
    )
    other = shot.channels.get(align.against)
    if own is None or other is None:
        missing = "a displacement channel of this source" if own is None else f"channel {align.against}"
        return failed_alignment(source.name, "motion", f"{missing} is not in this shot")
    if other.role != "recoil_acceleration":
        return failed_alignment(
            source.name, "motion", f"channel {align.against} must have the role recoil_acceleration"
        )
    try:
        signals = collect_signals(shot, rig, found)
    except IdentificationError as error:
        return failed_alignment(source.name, "motion", str(error))
    acceleration = travel_acceleration(signals, rig, turning(signals, rig))
    sigma = _silent_noise(signals, acceleration)
    # the pulse's silence fixes the zero; what is left of it is the fit's own unknown
    fit = align_motion(
        own.time_base.times_s - rig.channel(own.name).sensor.delay_s,
        _samples(own),
        signals.start_s,
        signals.step_s,
        acceleration,
        acceleration_sigma_m_s2=sigma,
        drift_allowance=align.drift_allowance,
    )
    return judge_motion(
        source.name,
        fit,
        u_gain=math.hypot(own.u_rel, other.u_rel),
        noise_density=sigma**2 * signals.step_s,
        frame_period_s=_step(own),
    )


def _silent_noise(signals: Signals, acceleration: Array) -> float:
    times = signals.times_s
    silent = acceleration[(times >= signals.quiet_s[0]) & (times < signals.quiet_s[1])]
    if silent.size >= 50:
        return max(float(np.std(silent)), 1e-6)
    return max(noise_sigma(acceleration), 1e-6)


def _step(channel: Channel) -> float:
    return 1.0 / channel.time_base.rate_hz


def _samples(channel: Channel) -> Array:
    return np.asarray(channel.samples, dtype=np.float64)
