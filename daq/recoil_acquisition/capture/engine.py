"""From blocks, in the order in which they were journalled, to the trigger's decisions and the windows of shots.

`CaptureEngine` knows no thread, device or file: what comes out depends on what goes in alone. Beside it
`CounterHistory` keeps the devices' counts at past moments: rates for the screen, and what was lost within one shot.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from recoil_acquisition.capture.late_reads import LateReads
from recoil_acquisition.capture.live_source import LiveSamples, LiveSource, signals_of
from recoil_acquisition.capture.shot_record import CounterSpan
from recoil_acquisition.devices.device import CHANGED, EVENT, IDLE, Block, Counters, Device, event_of
from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.trigger import Decision, ShotCutter, ShotWindow, Trigger, TriggerDetector

COUNT_EVERY_S = 0.25
"""Least time between two snapshots of the counters."""
RATE_OVER_S = 2.0
"""Time over which rates are taken."""
_LEAST_S = 0.1
"""Time between two snapshots below which they give no rate."""


class CounterHistory:
    """Snapshots of the counters of some devices."""

    def __init__(self, devices: Mapping[str, Device]) -> None:
        self._devices = dict(devices)
        self._snapshots: deque[tuple[float, dict[str, Counters]]] = deque()

    def count(self, needed_from_s: float) -> None:
        """Take a snapshot if the last one is old enough, and drop those that nobody needs.

        Parameters
        ----------
        needed_from_s
            Host time from which on shots may still ask; the snapshot before it is kept too.
        """
        now_s = time.monotonic()
        snapshots = self._snapshots
        if snapshots and now_s - snapshots[-1][0] < COUNT_EVERY_S:
            return
        snapshots.append((now_s, self._now()))
        from_s = min(needed_from_s, now_s - RATE_OVER_S)
        while len(snapshots) > 2 and snapshots[1][0] < from_s:
            snapshots.popleft()

    def rate_hz(self, name: str) -> float:
        """Return what a device received per second over the last two seconds; 0 where it is too early to say."""
        now_s = time.monotonic()
        recent = [one for one in list(self._snapshots) if now_s - one[0] <= RATE_OVER_S]
        if not recent or now_s - recent[0][0] < _LEAST_S:
            return 0.0
        time_s, counted = recent[0]
        return (self._devices[name].counters.received - counted[name].received) / (now_s - time_s)

    def spans(self, start_s: float, stop_s: float) -> dict[str, CounterSpan]:
        """Return the counters around a span of host time: the last before it, the first after it or those of now."""
        snapshots = list(self._snapshots) or [(start_s, self._now())]
        before = max([one for one in snapshots if one[0] <= start_s] or snapshots[:1], key=lambda one: one[0])
        later = [one for one in snapshots if one[0] >= stop_s]
        after = min(later, key=lambda one: one[0])[1] if later else self._now()
        return {name: CounterSpan(before[0], before[1][name], after[name]) for name in self._devices}

    def _now(self) -> dict[str, Counters]:
        return {name: device.counters for name, device in self._devices.items()}


LAG_S = 1.0
"""Time that a channel of the trigger may lag behind another before it is no longer waited for."""

PATIENCE_S = 2.0
"""Time after a shot's end for which a source that is silent or gone is waited for."""

SETTLE_S = 0.25
"""Time for which an adapter or a driver may hold back what was sent: what arrives so long after a shot belongs to
it."""

LEVEL_SPAN_S = 1.0
"""Time over which the screen shows where a channel was."""

LOOK_EVERY_S = 0.1
"""Time between two looks at what no trigger needs."""


@dataclass(frozen=True)
class Level:
    """Level of a channel.

    Attributes
    ----------
    low, high
        Extremes of the samples looked at within the last second.
    """

    last: float
    low: float
    high: float


class CaptureEngine:
    """Watches the sources of a rig for shots.

    Parameters
    ----------
    patience_s
        Time in place of `PATIENCE_S`.

    Raises
    ------
    MissingChannelError, ReadError
        If a channel's signal is not in its source, or a database is at fault.
    """

    def __init__(self, sources: Sequence[LiveSource], trigger: Trigger, *, patience_s: float = PATIENCE_S) -> None:
        self.trigger = trigger
        names = [channel.name for source in sources for channel in source.channels]
        self._detector = TriggerDetector(trigger, names, max_lag_s=LAG_S)
        self._cutter = ShotCutter(
            trigger, [s.name for s in sources], patience_s=patience_s, lag_s=LAG_S,
            source_of={c.name: s.name for s in sources for c in s.channels},
        )  # fmt: skip
        self._late = LateReads()
        self._looks = {s.name: _Look(s, trigger.channels) for s in sources}
        self._oldest_s: dict[str, float] = {}
        self._levels: dict[str, deque[tuple[float, Level]]] = {name: deque() for name in names}
        self._news: list[Decision] = []
        self._triggering = {s.name for s in sources for c in s.channels if c.name in trigger.channels}
        self._faults: dict[str, str] = {}
        self._new_faults: list[str] = []

    @property
    def armed(self) -> bool:
        """Whether triggers count."""
        return self._detector.armed

    @property
    def recording(self) -> bool:
        """Whether a shot has begun and is not complete."""
        return self._cutter.open_shots > 0

    @property
    def needed_from_s(self) -> float:
        """The instant of the host's clock before which nothing is needed any more."""
        return self._cutter.needed_from_s

    def level(self, channel: str, now_s: float) -> Level | None:
        """Return where a channel was within the last second; None if nothing of it came."""
        spans = [span for span in tuple(self._levels[channel]) if now_s - span[0] <= LEVEL_SPAN_S]
        if not spans:
            return None
        lows, highs = [level.low for _, level in spans], [level.high for _, level in spans]
        return Level(spans[-1][1].last, min(lows), max(highs))

    def arm(self, time_s: float) -> None:
        """Let triggers count from a time of the host's clock on."""
        self._note(self._detector.arm(time_s))

    def disarm(self) -> None:
        """Let nothing count until armed again."""
        self._note(self._detector.disarm())

    def fire(self, time_s: float) -> None:
        """Trigger by hand."""
        self._note(self._detector.fire_manually(time_s))

    def arrived(self, block: Block) -> None:
        """Note whether a block was read late, before it is taken, alone or joined with others."""
        since_s = self._late.since_s(block)
        if since_s is not None:
            self._cutter.stalled(block.source, since_s, block.host_ns / 1e9)

    def take(self, block: Block) -> None:
        """Take the next block of a source; blocks of one source come in order."""
        if block.kind == IDLE:
            return  # a source that falls silent within a shot is waited for, and named
        self._look_at(block, block.host_ns / 1e9)
        if block.kind == EVENT:
            self._heed(block)
            return
        self._delivered(block)

    def take_unseen(self, block: Block) -> None:
        """Note that a block was recorded without a look at its samples."""
        self._looks[block.source].skip()
        if block.is_data:
            self._delivered(block)

    def ready(self, now_s: float) -> tuple[ShotWindow, ...]:
        """Return the shots that are complete at a time of the host's clock, each once; infinity closes all."""
        return self._cutter.ready(now_s)

    @property
    def faults(self) -> Mapping[str, str]:
        """Why sources are no longer decoded, by their names; they are recorded, and cut by their times of arrival."""
        return dict(self._faults)

    def new_faults(self) -> tuple[str, ...]:
        """Return the sources that are no longer decoded since the last call."""
        news, self._new_faults = tuple(self._new_faults), []
        return news

    def finish(self) -> None:
        """Decide on what still waits for a channel that lags: nothing more comes."""
        self._note(self._detector.finish())

    def news(self) -> tuple[Decision, ...]:
        """Return the decisions since the last call."""
        news, self._news = tuple(self._news), []
        return news

    def _heed(self, block: Block) -> None:
        """Disarm where a source that the trigger looks at says that its channels are others than when it was armed."""
        if block.source in self._triggering and self.armed and event_of(block).name == CHANGED:
            self.disarm()

    def _look_at(self, block: Block, at_s: float) -> None:
        """Decode a block for the trigger and the screen; nothing more of a source once that failed."""
        if block.source in self._faults:
            return
        try:
            for one in self._looks[block.source].at(block, at_s):
                self._note(self._detector.feed(one.channel, one.times_s, one.values))
                self._show(one, at_s)
        except Exception as error:  # whatever it is, the others go on, and this one is recorded
            known = isinstance(error, RecoilDaqError)
            text = " ".join(str(error).split()) if known else f"{type(error).__name__}: {error}"
            if block.source in self._triggering and self.armed:
                self.disarm()
                text += "; the trigger looks at it: disarmed"
            self._faults[block.source] = text
            self._new_faults.append(block.source)

    def _delivered(self, block: Block) -> None:
        """Note that a source has delivered all that arrived before it was found empty."""
        oldest_s = self._oldest_s.setdefault(block.source, block.host_ns / 1e9)
        until_ns = block.host_ns if block.empty_ns is None else block.empty_ns
        self._cutter.advance(block.source, oldest_s, until_ns / 1e9 - SETTLE_S)

    def _note(self, decisions: Sequence[Decision]) -> None:
        self._cutter.note(decisions)
        self._news += decisions

    def _show(self, one: LiveSamples, now_s: float) -> None:
        """Keep low, high and last of a channel, for as long as the screen shows them."""
        spans = self._levels[one.channel]
        low, high, last = float(one.values.min()), float(one.values.max()), float(one.values[-1])
        if spans and now_s - spans[-1][0] < LOOK_EVERY_S:
            time_s, span = spans.pop()
            spans.append((time_s, Level(last, min(span.low, low), max(span.high, high))))
        else:
            spans.append((now_s, Level(last, low, high)))
        while now_s - spans[0][0] > LEVEL_SPAN_S:
            spans.popleft()


class _Look:
    """Decodes of a source what the trigger needs, always, and what only the screen shows, now and then."""

    def __init__(self, source: LiveSource, triggering: Sequence[str]) -> None:
        needed = [c for c in source.channels if c.name in triggering]
        if needed and source.live_kind.decodes_all:
            needed = list(source.channels)
        rest = [c for c in source.channels if c not in needed]
        self._needed = signals_of(source, needed) if needed else None
        self._rest = signals_of(source, rest) if rest else None
        self._looked_s = -math.inf
        self._looking = False

    def at(self, block: Block, now_s: float) -> Iterator[LiveSamples]:
        if self._needed is not None:
            yield from self._needed.feed(block)
        if self._rest is None:
            return
        if block.kind == EVENT:  # what a device says of itself holds for what is looked at later, too
            yield from self._rest.feed(block)
        elif self._looking or now_s - self._looked_s >= LOOK_EVERY_S:
            if not self._looking:
                self._rest.skip()
            self._looking = True
            for one in self._rest.feed(block):
                self._looking, self._looked_s = False, now_s
                yield one

    def skip(self) -> None:
        for signals in (self._needed, self._rest):
            if signals is not None:
                signals.skip()
