"""The shots of a session from what its journal holds: its decisions, and those that a crash outran."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from recoil_acquisition.capture.engine import LAG_S, SETTLE_S
from recoil_acquisition.capture.live_source import LiveSource, signals_of
from recoil_acquisition.devices.device import Block
from recoil_acquisition.trigger import Decision, ShotCutter, ShotWindow, Trigger, TriggerDetector
from recoil_acquisition.trigger.decision import MANUAL, Suppression

_AT_ONCE_S = 1e-9


def replayed(
    sources: Mapping[str, Sequence[tuple[float, float]]],
    trigger: Trigger,
    decisions: Sequence[Decision],
    stalls: Sequence[tuple[str, float, float]] = (),
    source_of: Mapping[str, str] = MappingProxyType({}),
) -> tuple[ShotWindow, ...]:
    """Return the windows of decisions that were made before, with what is held of each source.

    Parameters
    ----------
    sources
        Spans of the sources, one each, or none of a source of which nothing is held.
    decisions
        Decisions in the order in which they were made.
    stalls
        Sources and pairs of instants: what was read of it at the second may have arrived since the first.
    source_of
        Source of each channel of the trigger.
    """
    cutter = ShotCutter(trigger, list(sources), lag_s=LAG_S, source_of=source_of)
    for name, spans in sources.items():
        for oldest_s, latest_s in spans:
            cutter.advance(name, oldest_s, latest_s)
    for stall in stalls:
        cutter.stalled(*stall)
    cutter.note(decisions)
    return cutter.ready(float("inf"))


def outrun(
    sources: Sequence[LiveSource], trigger: Trigger, blocks: Iterable[Block | None], decided: Sequence[Decision]
) -> list[Decision]:
    """Return the decisions that a session would have made next, of what it had recorded when it was killed.

    Whether it was armed cannot be known: a crossing counts, for a shot too many costs nothing.

    Parameters
    ----------
    blocks
        Blocks that were recorded, in the order of the journal; None where something is missing.
    decided
        Decisions that were recorded. What one of them lies next to is not decided again: live, several blocks are dated
        as one.

    Returns
    -------
    list of Decision
        Decisions in the order of time.
    """
    names = [channel.name for source in sources for channel in source.channels]
    # so that none is lost: of two channels that cross at one instant the second is an extension, until it is ruled on
    every = replace(trigger, post_s=_AT_ONCE_S, holdoff_s=0.0, extend=True)
    detector = TriggerDetector(every, names, max_lag_s=LAG_S)
    detector.arm(-float("inf"))
    wanted = [(source, [c for c in source.channels if c.name in trigger.channels]) for source in sources]
    signals = {source.name: signals_of(source, channels) for source, channels in wanted if channels}
    crossings: list[Decision] = []
    for block in blocks:
        if block is None:
            for one in signals.values():
                one.skip()
        elif block.source in signals:
            for samples in signals[block.source].feed(block):
                crossings += detector.feed(samples.channel, samples.times_s, samples.values)
    crossings += detector.finish()
    found: list[Decision] = []
    for crossing in crossings:
        if crossing.outcome != "suppressed" and not any(_same(crossing, one) for one in decided):
            found.append(_ruled(crossing, trigger, [*decided, *found]))
    return found


def _same(crossing: Decision, decision: Decision) -> bool:
    return decision.channel == crossing.channel and abs(decision.time_s - crossing.time_s) <= SETTLE_S


def _ruled(crossing: Decision, trigger: Trigger, before: Sequence[Decision]) -> Decision:
    """Return what a crossing means after the triggers before it."""
    met = (d.time_s for d in before if d.outcome != "suppressed" and d.condition != MANUAL)
    last_s = max((time_s for time_s in met if time_s <= crossing.time_s), default=-float("inf"))
    if crossing.time_s < last_s + trigger.holdoff_s:
        return replace(crossing, outcome="suppressed", reason=Suppression.HOLDOFF)
    if crossing.time_s >= last_s + trigger.post_s:
        return replace(crossing, outcome="trigger")
    if trigger.extend:
        return replace(crossing, outcome="extension")
    return replace(crossing, outcome="suppressed", reason=Suppression.WITHIN_POST)
