"""Every clock of a shot related to the reference clock, in the order in which they need one another.

Fixed and trigger alignments come first, then redundant channels, then absolute time, then motion: the camera's
alignment uses the carriage's motion, which may have been recorded on another clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from recoil_acquisition.clocks.time_lock import TimeLock
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.absolute_alignment import ClockTime, align_absolute, beside_second, without_second
from recoil_processing.alignment.align import failed_alignment, judge_edges
from recoil_processing.alignment.alignment_budget import with_second_opinion
from recoil_processing.alignment.trigger_alignment import align_edges, rising_edges
from recoil_processing.shot.clocks.motion_clocks import align_by_comparison, align_by_motion, evenly
from recoil_processing.shot.instants import instants, with_chains
from recoil_processing.shot.thinned import thinned
from recoil_rigs.checks.rig_alignments import second_way
from recoil_rigs.rig import (
    AbsoluteAlignment,
    ExposureAlignment,
    FixedAlignment,
    MotionAlignment,
    RedundantAlignment,
    Source,
    TriggerAlignment,
)
from recoil_rigs.shots.fired_shot import FiredShot

_ORDER = (
    FixedAlignment, TriggerAlignment, RedundantAlignment, AbsoluteAlignment, MotionAlignment, ExposureAlignment,
)  # fmt: skip

EXPANDED = 3.0
"""Standard uncertainties of the motion's offset within which a pulse is looked for."""


def align_clocks(fired: FiredShot) -> tuple[ClockAlignment, ...]:
    """Align every clock of a shot, each by the method that the rig declares.

    Parameters
    ----------
    fired
        Shot as assembled, without alignments, and its rig.

    Returns
    -------
    tuple of ClockAlignment
        One per source other than the reference that the shot has channels of, in the rig's order. What
        cannot be aligned has status ``failed`` and says why. They map instants as `instants` gives
        them: of the physics, on the source's even beat. Details list the delays that were taken off. What is faster
        than a motion needs is thinned.
    """
    fired, _ = thinned(fired)
    recorded = {c.time_base.clock for c in fired.shot.channels.values()}
    sources = [s for s in fired.rig.sources if s.name != fired.rig.reference_clock and s.name in recorded]
    # what a second opinion on absolute time needs may be on another clock that has it
    found = {s.name: _by_absolute(fired, s, s.align) for s in sources if isinstance(s.align, AbsoluteAlignment)}
    for method in _ORDER:
        for source in sources:
            if isinstance(source.align, method):
                found[source.name] = _align(fired, source, found)
    return tuple(found[s.name] if s.name in found else _align(fired, s, found) for s in sources)


def _align(fired: FiredShot, source: Source, found: Mapping[str, ClockAlignment]) -> ClockAlignment:
    align = source.align
    if isinstance(align, FixedAlignment):
        return ClockAlignment(source.name, align.offset_s, align.u_offset_s, align.drift, align.u_drift, "ok", "fixed")
    if isinstance(align, TriggerAlignment):
        return _by_trigger(fired, source, align)
    if isinstance(align, ExposureAlignment):
        return _by_exposure(fired, source, align, found)
    if isinstance(align, RedundantAlignment):
        return _by_redundant_channel(fired, source, align)
    if isinstance(align, AbsoluteAlignment):
        return _beside_second(fired, source, found)
    if isinstance(align, MotionAlignment):
        return align_by_motion(fired, source, align.against, align.drift_allowance, found)
    return failed_alignment(source.name, "none", "the rig declares no alignment")


def _by_trigger(fired: FiredShot, source: Source, align: TriggerAlignment) -> ClockAlignment:
    own, other = fired.shot.channels.get(align.channel), fired.shot.by_role("trigger")
    if own is None or other is None:
        missing = align.channel if own is None else "a channel of role trigger on the reference clock"
        return failed_alignment(source.name, "trigger", f"{missing} is not in this shot")
    one, two = instants(own, fired), instants(other, fired)
    u_edge = math.hypot(1.0 / own.time_base.rate_hz, 1.0 / other.time_base.rate_hz) / math.sqrt(12.0)
    fit = align_edges(
        rising_edges(one.times_s, own.measured),
        rising_edges(two.times_s, other.measured),
        u_edge_s=u_edge,
        drift_allowance=align.drift_allowance,
    )
    found = judge_edges(source.name, fit, u_edge_s=u_edge)
    return with_chains(found, [(own, one), (other, two)], one.u_s, two.u_s)


def _by_exposure(
    fired: FiredShot, source: Source, align: ExposureAlignment, found: Mapping[str, ClockAlignment]
) -> ClockAlignment:
    own = next((c for c in fired.shot.channels.values() if c.time_base.clock == source.name), None)
    other = fired.shot.channels.get(align.channel)
    if own is None or other is None:
        missing = "a channel of this source" if own is None else f"channel {align.channel}"
        return failed_alignment(source.name, "exposure", f"{missing} is not in this shot")
    frames, pulses = instants(own, fired), instants(other, fired)
    # a pulse rises where the exposure starts; a moving mark's picture is where the mark was in the middle of it
    edges_s = rising_edges(pulses.times_s, other.measured) + 0.5 * (source.exposure_s or 0.0)
    middle_s = 0.5 * float(frames.times_s[0] + frames.times_s[-1])
    near, motion = None, None
    if align.against is not None:
        motion = align_by_motion(fired, source, align.against, align.drift_allowance, found)
        if motion.status != "failed":
            within = max(0.5 / own.time_base.rate_hz, EXPANDED * motion.u_offset_s)
            near = motion.to_reference(middle_s) - middle_s, within
    u_edge = 1.0 / other.time_base.rate_hz / math.sqrt(12.0)
    fit = align_edges(frames.times_s, edges_s, u_edge_s=u_edge, drift_allowance=align.drift_allowance, near_s=near)
    judged = judge_edges(source.name, fit, u_edge_s=u_edge, method="exposure")
    # what the camera's stamps mean is in the offset, whatever it is: its delays are none of the uncertainty
    judged = with_chains(judged, [(own, frames), (other, pulses)], pulses.u_s)
    return judged if motion is None else with_second_opinion(judged, motion, middle_s)


def _by_absolute(fired: FiredShot, source: Source, align: AbsoluteAlignment) -> ClockAlignment:
    """Align a source by absolute time alone."""
    own, reference = _time_of(fired, source), _time_of(fired, fired.rig.source(fired.rig.reference_clock))
    fit = fired.shot.clock_fits.get(source.name, {})
    drift, u_drift = float(fit.get("drift") or 0.0), 0.0
    if "drift" in fit:  # the host's clock is locked, not the device's, which dates the samples
        u_drift = align.drift_allowance if fit.get("u_drift") is None else float(fit["u_drift"])
    lines_s = [
        instants(c, fired).stamps.u_line_s
        for c in fired.shot.channels.values()
        if c.time_base.clock == source.name and c.time_base.stamps_s is not None
    ]
    u_stamps_s = math.hypot(float(fit.get("u_offset_s") or 0.0), max(lines_s, default=0.0))
    return align_absolute(own, reference, u_s=align.u_s, u_stamps_s=u_stamps_s, drift=drift, u_drift=u_drift)


def _time_of(fired: FiredShot, source: Source) -> ClockTime:
    of_source = [c.time_base for c in fired.shot.channels.values() if c.time_base.clock == source.name]
    bases = [base for base in of_source if base.count]
    start = next((base.absolute_start for base in bases if base.absolute_start is not None), None)
    declared = None if source.time is None else TimeLock(source.time.by)
    first_s = min((base.start_s for base in bases), default=0.0)
    return ClockTime(source.name, start, declared, first_s, max((base.end_s for base in bases), default=first_s))


def _beside_second(fired: FiredShot, source: Source, found: Mapping[str, ClockAlignment]) -> ClockAlignment:
    """Compare absolute time with what the rig's channels tell of the offset, if they tell any."""
    absolute, own = found[source.name], _time_of(fired, source)
    reference = _time_of(fired, fired.rig.source(fired.rig.reference_clock))
    other = second_way(source, fired.rig.reference_clock, fired.rig.channels)
    if other is None:
        return without_second(absolute, own, reference)
    by_other = source.model_copy(update={"align": other})
    sources = tuple(by_other if one.name == source.name else one for one in fired.rig.sources)
    second = _align(replace(fired, rig=replace(fired.rig, sources=sources)), by_other, found)
    if second.status == "failed":
        why = tuple(f"by {second.method}: {reason}" for reason in second.reasons)
        alone = without_second(absolute, own, reference)
        if alone.status == "failed":
            return replace(alone, reasons=(*alone.reasons, *why))
        return replace(alone, details={**(alone.details or {}), "second_method": second.method, "no_second": list(why)})
    return beside_second(absolute, second, 0.5 * (own.first_s + own.last_s))


def _by_redundant_channel(fired: FiredShot, source: Source, align: RedundantAlignment) -> ClockAlignment:
    own, other = fired.shot.channels.get(align.channel), fired.shot.channels.get(align.against)
    if own is None or other is None:
        missing = align.channel if own is None else align.against
        return failed_alignment(source.name, "redundant", f"channel {missing} is not in this shot")
    if other.time_base.clock != fired.shot.reference_clock:
        return failed_alignment(source.name, "redundant", f"channel {align.against} is not on the reference clock")
    reference = evenly(fired, other)
    return align_by_comparison(fired, own, other, reference, method="redundant", drift_allowance=align.drift_allowance)
