"""From a shot's window and what its devices counted to the record of its acquisition."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass

from recoil_acquisition.capture.session_record import LiveRecord
from recoil_acquisition.devices.device import Counters
from recoil_acquisition.shot.acquisition import AcquiredSource, Acquisition, TriggerDecision
from recoil_acquisition.trigger import ShotWindow, Trigger

NOTHING = Counters()


@dataclass(frozen=True)
class CounterSpan:
    """A device's counters before a shot and after it.

    Attributes
    ----------
    from_s
        Host time of the first.
    """

    from_s: float
    before: Counters
    after: Counters


def acquisition_of(
    shot: str,
    session: LiveRecord,
    trigger: Trigger,
    window: ShotWindow,
    counted: Mapping[str, CounterSpan],
    *,
    unseen_bytes: int = 0,
    lost_records: int = 0,
    recovered: bool = False,
) -> Acquisition:
    """Say how a shot was acquired, but for what the log has of its sources: see `recoil_acquisition.capture.cut`.

    Parameters
    ----------
    window
        Span of the shot, on the host's monotonic clock.
    counted
        Counts by source; any may be lacking.
    """
    trigger_ns = round(window.trigger_s * 1e9)
    utc = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=session.anchor.wall_of(trigger_ns) // 1000)
    sources = []
    for source in session.sources:
        span = counted.get(source.name, CounterSpan(window.start_s, NOTHING, NOTHING))
        before, after = span.before, span.after
        dropped = None if after.kernel_drops is None else after.kernel_drops - (before.kernel_drops or 0)
        sources.append(
            AcquiredSource(
                name=source.name,
                kind=source.kind,
                file="",
                blocks=0,
                bytes=0,
                pre_s=window.pre_by_source.get(source.name),
                late=source.name in window.late_sources,
                late_s=0.0,
                bad=after.bad - before.bad,
                reopened=after.reopened - before.reopened,
                error_frames=after.error_frames - before.error_frames,
                kernel_drops=dropped,
                queue_high_water=after.queue_high_water,
                counted_from_s=span.from_s - window.trigger_s,
                events=(),
            )
        )
    return Acquisition(
        shot=shot,
        rig=session.rig_name,
        trigger_ns=trigger_ns,
        trigger_utc=utc.isoformat(timespec="microseconds"),
        pre_s=trigger.pre_s,
        post_s=trigger.post_s,
        pre_actual_s=window.pre_actual_s,
        duration_s=window.stop_s - window.start_s,
        decisions=tuple(
            TriggerDecision(d.time_s - window.trigger_s, d.outcome, d.reason, d.channel, d.value)
            for d in window.decisions
        ),
        sources=tuple(sources),
        unseen_bytes=unseen_bytes,
        lost_records=lost_records,
        recovered=recovered,
    )
