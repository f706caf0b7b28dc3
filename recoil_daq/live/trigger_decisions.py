"""Decisions of the trigger as people at the range learn them: the last one, alarms, and what it fires at at rest."""

from __future__ import annotations

import datetime as dt
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from recoil_acquisition.capture.live_source import LiveChannel
from recoil_acquisition.trigger import Decision, RateOfChange, Trigger
from recoil_acquisition.trigger.decision import Suppression
from recoil_daq.live.display import Display
from recoil_daq.live.range_state import RangeDecision
from recoil_daq.live.trigger_at_rest import level_of, times

PARTS_OF_REST = 5
"""Number of parts of the time for which a trigger is watched when it is armed: one that fires in each but the last
fires at rest."""


MOST_ALIKE = 1000
"""Most decisions of one kind in a row that are kept: noise may cross a level hundreds of times a second, all day."""


class TriggerDecisions:
    """Takes every decision of the trigger, in the thread that watches for shots, and gives notice of it.

    Parameters
    ----------
    channels
        Live channels by their names; its content may change until the first decision.
    kept
        List that gets the decisions; of more than `MOST_ALIKE` alike in a row the first ones and the last.
    moved
        Function called with the time of everything that crossed, s on the host's clock.

    Attributes
    ----------
    wall_of
        Function from the host's monotonic clock to its wall clock, ns.
    silent
        Whether decisions are neither kept nor told: the session ends since the trigger fires at rest.
    alarms
        Number of crossings while disarmed that nobody at the keys has seen.
    last
        Last decision; None if there was none.
    left_out
        Number of decisions that are not kept, since so many alike stand before them; the journal has each.
    """

    def __init__(
        self,
        trigger: Trigger,
        channels: Mapping[str, LiveChannel],
        display: Display,
        kept: list[Decision],
        moved: Callable[[float], None],
    ) -> None:
        self._trigger, self._channels, self._display = trigger, channels, display
        self._kept, self._moved = kept, moved
        self.wall_of: Callable[[int], int] = lambda monotonic_ns: monotonic_ns
        self.silent = False
        self.alarms = 0
        self.last: RangeDecision | None = None
        self.left_out = 0
        self._last_kind: object = None
        self._alarm = ""
        self._noisy: frozenset[int] = frozenset()  # conditions that are met at rest
        self._lock = threading.Lock()
        self._at_rest: list[Decision] | None = None  # what is decided while the trigger is watched, not armed

    @property
    def alarm(self) -> str:
        """Sentence on what crossed while disarmed; empty if nothing did that nobody has seen."""
        if not self._alarm:
            return ""
        repeated = f", {self.alarms} times" if self.alarms > 1 else ""
        return f"ALARM: {self._alarm}{repeated}: no shot is made; a arms, d takes this away"

    def heed(self, *, armed: bool = False) -> None:
        """Take the alarm away: somebody at the keys has seen it; where he armed, what is met at rest alarms again."""
        self._alarm, self.alarms = "", 0
        if armed:
            self._noisy = frozenset()

    def begin_rest(self) -> None:
        """Begin to note what the trigger fires at at rest."""
        with self._lock:
            self._at_rest = []

    def fired_at_rest(self, began_s: float, rest_s: float) -> str:
        """Return at what the trigger fired all the time since `begin_rest`; empty if it did not.

        A shot that is fired meanwhile is one: it crosses for a part of the time, noise does all the time.

        Parameters
        ----------
        began_s, rest_s
            Beginning on the host's clock and length of that time, s.
        """
        with self._lock:
            noted, self._at_rest = self._at_rest or [], None
        met = [decision for decision in noted if decision.time_s >= began_s]
        parts = {int((d.time_s - began_s) / rest_s * PARTS_OF_REST) for d in met}
        if not set(range(PARTS_OF_REST - 1)) <= parts:
            return ""  # the last part's samples may not have come yet
        counts = Counter(decision.condition for decision in met)
        found = []
        for number, count in counts.items():
            condition, last = self._trigger.conditions[number], [d for d in met if d.condition == number][-1]
            channel = self._channels[condition.channel]
            at = self._value_of(last)
            found.append(f"{channel.name} crossed {level_of(condition, channel)} {times(count)}, at {at}")
        self._noisy = frozenset(counts)
        return f"the trigger fires at rest, in {rest_s:g} s: {'; '.join(found)}"

    def take(self, decision: Decision) -> None:
        """Take a decision."""
        if self.silent:
            return
        with self._lock:
            if self._at_rest is not None and decision.channel and decision.reason != Suppression.BEYOND_AT_ARM:
                self._at_rest.append(decision)
        if decision.channel:
            self._moved(decision.time_s)
        what = decision.outcome if not decision.reason else f"{decision.outcome}: {decision.reason}"
        where = "by hand" if decision.value is None else f"{decision.channel} at {self._value_of(decision)}"
        same: Any = (decision.outcome, decision.reason, decision.condition)
        same = same if decision.outcome == "suppressed" else None
        text = f"{what} ({where})"
        wall = dt.datetime.fromtimestamp(self.wall_of(round(decision.time_s * 1e9)) / 1e9, dt.UTC)
        if decision.reason == Suppression.NOT_ARMED and decision.channel and decision.condition not in self._noisy:
            self.alarms += 1
            at = self._value_of(decision)
            self._alarm = f"{decision.channel} crossed while disarmed at {wall:%H:%M:%S}Z, at {at}"
            text = f"ALARM: {decision.channel} crossed while disarmed, at {at}: no shot is made"
        last = self.last
        count = last.count + 1 if last is not None and same is not None and same == self._last_kind else 1
        if count > MOST_ALIKE:
            self._kept[-1] = decision
            self.left_out += 1
        else:
            self._kept.append(decision)
        self._last_kind = same
        self.last = RangeDecision(wall.isoformat(timespec="milliseconds"), text, count)
        if same is None:
            self._display.notice(text)
        else:
            self._display.notice(text, same)

    def _value_of(self, decision: Decision) -> str:
        """Write what a condition was met with, in the unit in which people read its channel."""
        condition, channel = self._trigger.conditions[decision.condition], self._channels[decision.channel]
        return channel.shown(decision.value or 0.0, rate=isinstance(condition, RateOfChange))
