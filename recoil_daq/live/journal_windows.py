"""Windows of the shots in a journal that was left over, and what happened outside of them."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.late_reads import LateReads
from recoil_acquisition.capture.replay import outrun, replayed
from recoil_acquisition.capture.session_record import Kept, LiveRecord, OperatorRecords, kept_of, longer
from recoil_acquisition.devices.device import Block
from recoil_acquisition.log.folder import Log
from recoil_acquisition.log.record import OWN
from recoil_acquisition.log.segment import SUFFIX
from recoil_acquisition.trigger import Decision, ShotWindow, Trigger
from recoil_acquisition.trigger.decision import MANUAL
from recoil_rigs.rig import Rig
from recoil_rigs.shots.live_sources import live_sources


def extent_s(held: Mapping[str, Sequence[tuple[float, float]]]) -> tuple[float, float]:
    """Return the first and the last instant of all sources together; 0 and 0 if there is none."""
    spans = [span for spans in held.values() for span in spans]
    return min((begin for begin, _ in spans), default=0.0), max((end for _, end in spans), default=0.0)


def delivered(
    journal: Log, record: LiveRecord
) -> tuple[dict[str, list[tuple[float, float]]], list[tuple[str, float, float]]]:
    """Return from when to when each source is in a journal, and what was read late: since when it may have arrived."""
    held: dict[str, list[tuple[float, float]]] = {source.name: [] for source in record.sources}
    late, stalls = LateReads(), []
    for one in journal.records():
        if one.source == OWN:
            continue
        block = record.block(one)
        since_s = late.since_s(block)
        if block.is_data:
            spans = held[block.source]
            spans[:] = [(spans[0][0] if spans else one.host_ns / 1e9, one.host_ns / 1e9)]
        if since_s is not None:
            stalls.append((block.source, since_s, one.host_ns / 1e9))
    return held, stalls


def with_outrun(
    journal: Log, record: LiveRecord, rig: Rig, trigger: Trigger, known: OperatorRecords
) -> OperatorRecords:
    """Return what the session knew with the triggers that it had recorded and not yet decided on."""
    # a rig that was corrected since may have lost a device
    lost: dict[str, dict[str, Any]] = {
        source.name: {} for source in record.sources if rig.source(source.name).device is None
    }
    sources = live_sources(rig, lost)
    named = [source for source in sources if source.name in {one.name for one in record.sources}]
    found = outrun(named, trigger, _blocks(journal, record), known.decisions)
    return replace(known, decisions=(*known.decisions, *found))


def _blocks(journal: Log, record: LiveRecord) -> Iterator[Block | None]:
    """Yield every block of a journal in its order, and None where a record is missing."""
    following = 0
    for one in journal.records():
        if one.number != following:
            yield None
        following = one.number + 1
        if one.source != OWN:
            yield record.block(one)


def window_at(
    trigger_s: float, held: Mapping[str, Sequence[tuple[float, float]]], trigger: Trigger
) -> tuple[ShotWindow, ...]:
    """Return the window of a shot that a person asks for."""
    decision = Decision(trigger_s, "trigger", "", "", MANUAL, MANUAL, None, trigger_s)
    return replayed(held, trigger, [decision])


def windows_by_hand(
    record: LiveRecord, out: Path, held: Mapping[str, Sequence[tuple[float, float]]], rig: Rig
) -> tuple[ShotWindow, ...]:
    """Return the windows of shots that a person had cut out of this journal before."""
    begin_s, end_s = extent_s(held)
    windows: list[ShotWindow] = []
    for path in sorted((out / "captures").glob(f"*{SUFFIX}")):
        made = acquisition_in(path)
        if made is None or rig.trigger is None or not begin_s <= made.trigger_ns / 1e9 <= end_s:
            continue
        by_hand = made.recovered and any(d.outcome == "trigger" and not d.channel for d in made.decisions)
        if by_hand and made.trigger_utc == utc_of(record, made.trigger_ns / 1e9):
            windows += window_at(made.trigger_ns / 1e9, held, rig.trigger)
    return tuple(windows)


def outside_of(known: OperatorRecords, windows: Sequence[ShotWindow], trigger: Trigger) -> list[Kept]:
    """Return what happened outside of all shots, in the order of time."""
    kept: list[Kept] = []
    for decision in known.decisions:
        one = kept_of(decision, trigger)
        kept = kept if one is None else longer(kept, one)
    spans = [(window.start_s, window.stop_s) for window in windows]
    return sorted((one for one in (*kept, *known.kept) if not one.within(spans)), key=lambda one: one.first_s)


def utc_of(record: LiveRecord, host_s: float) -> str:
    """Return the time of day of an instant of the host's clock, ISO 8601, UTC."""
    wall_ns = record.anchor.wall_of(round(host_s * 1e9))
    utc = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=wall_ns // 1000)
    return utc.isoformat(timespec="microseconds")
