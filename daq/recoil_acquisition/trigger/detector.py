"""The trigger: when a shot begins, decided from samples, live or recorded, by the same rules.

`TriggerDetector` takes blocks of samples and gives decisions; it knows no device, thread or file. How the samples
are cut into blocks changes no decision. What the conditions are is in `trigger.condition`, which part of the
data a shot is in `trigger.shot_window`, and how a rig file declares a trigger in `trigger.table`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_acquisition.trigger.condition import Condition
from recoil_acquisition.trigger.decision import MANUAL, Decision, Outcome, Suppression
from recoil_acquisition.trigger.state import ConditionState, Event, Transition

__all__ = ["Trigger", "TriggerDetector", "find_triggers"]


@dataclass(frozen=True)
class Trigger:
    """Condition at which a shot begins, and how much is kept around it.

    Attributes
    ----------
    conditions
        Conditions; empty if there are only manual triggers.
    combination
        Combination of the conditions: with ``any`` each that becomes met triggers, with ``all`` the last that is
        missing.
    pre_s, post_s
        Time that is kept before the trigger and after it, seconds.
    holdoff_s
        Time after the last trigger in which no other counts; after a manual one only no other manual one.
    extend
        Whether a further trigger within the post time lets that start anew.
    manual
        Whether manual triggers count.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    conditions: tuple[Condition, ...]
    combination: Literal["any", "all"] = "any"
    pre_s: float = 0.0
    post_s: float = 1.0
    holdoff_s: float = 0.0
    extend: bool = False
    manual: bool = True

    def __post_init__(self) -> None:
        if self.combination not in ("any", "all"):
            raise ValueError(f"combination must be 'any' or 'all', not {self.combination!r}")
        for name, time_s in (("pre_s", self.pre_s), ("holdoff_s", self.holdoff_s)):
            if not 0 <= time_s < math.inf:
                raise ValueError(f"{name} must be finite and not negative, not {time_s!r}")
        if not 0 < self.post_s < math.inf:
            raise ValueError(f"post_s must be positive and finite, not {self.post_s!r}")
        if not self.conditions and not self.manual:
            raise ValueError("a trigger without conditions must allow manual triggers")

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that it looks at, each once."""
        return tuple(dict.fromkeys(condition.channel for condition in self.conditions))


class TriggerDetector:
    """Finds triggers in samples that arrive in blocks, channel by channel. Not for several threads at once.

    Decisions are made in the order of time over all channels, so an event waits until every channel of the trigger
    has come as far. With ``any`` a channel that lags by more than `max_lag_s` is not waited for; what it brings
    later is decided then, unless a later trigger was. With ``all`` every channel is waited for: what a
    channel that is silent would say cannot be known.

    Parameters
    ----------
    channel_names
        Channels that may be fed; those of the trigger among them.
    max_lag_s
        Longest time that a channel may lag behind another, s.

    Raises
    ------
    ValueError
        If a channel of the trigger is not among the names, or `max_lag_s` is negative.
    """

    def __init__(self, trigger: Trigger, channel_names: Sequence[str], *, max_lag_s: float = 1.0) -> None:
        if missing := [name for name in trigger.channels if name not in channel_names]:
            raise ValueError(f"the trigger needs {', '.join(missing)}, which is not among the channels")
        if not max_lag_s >= 0:
            raise ValueError(f"max_lag_s must not be negative, not {max_lag_s!r}")
        self.trigger = trigger
        self._max_lag_s = math.inf if trigger.combination == "all" else max_lag_s
        self._states = [ConditionState(condition, i) for i, condition in enumerate(trigger.conditions)]
        self._of_channel: dict[str, list[ConditionState]] = {name: [] for name in channel_names}
        for condition, state in zip(trigger.conditions, self._states, strict=True):
            self._of_channel[condition.channel].append(state)
        self._latest_s = dict.fromkeys(trigger.channels, -math.inf)
        self._pending: list[Event] = []
        self._met = [False] * len(self._states)
        self._armed = False
        self._last_s = self._last_met_s = -math.inf
        self._stop_s = self._stop_met_s = -math.inf

    @property
    def armed(self) -> bool:
        """Whether triggers count."""
        return self._armed

    def arm(self, time_s: float) -> list[Decision]:
        """Arm from a time on, afresh: every condition must be below its rearm level once before it can be met.

        Parameters
        ----------
        time_s
            Samples before it do not count. Minus infinity for all that follow.

        Returns
        -------
        list of Decision
            Decisions on what was still waiting for a channel that lags.
        """
        decisions = self._decide_until(math.inf)
        for state in self._states:
            state.arm(time_s)
        self._met = [False] * len(self._states)
        self._armed = True
        return decisions

    def disarm(self) -> list[Decision]:
        """Let nothing count until armed again; return the decisions on what was still waiting."""
        decisions = self._decide_until(math.inf)
        self._armed = False
        return decisions

    def feed(self, channel: str, times_s: ArrayLike, values: ArrayLike) -> list[Decision]:
        """Take the next samples of one channel.

        Parameters
        ----------
        times_s : array_like of float, shape (n_samples,)
            Instants on the one clock of all channels, none before the one in front of it.
        values : array_like of float, shape (n_samples,)
            Samples; a lost one is NaN, which neither triggers nor rearms.

        Returns
        -------
        list of Decision
            Decisions in the order of time.

        Raises
        ------
        ValueError
            If the channel is unknown, the shapes differ, or time is not finite or runs backwards.
        """
        if channel not in self._of_channel:
            raise ValueError(f"unknown channel {channel!r}; there are {', '.join(self._of_channel)}")
        states = self._of_channel[channel]
        if not states:
            return []
        times, samples = _as_samples(times_s, values)
        if not len(times):
            return []
        _check_times(channel, times, self._latest_s[channel])
        for state in states:
            self._pending += state.feed(times, samples)
        self._latest_s[channel] = float(times[-1])
        if not self._pending:
            return []
        slowest_s, furthest_s = min(self._latest_s.values()), max(self._latest_s.values())
        return self._decide_until(max(slowest_s, furthest_s - self._max_lag_s))

    def fire_manually(self, time_s: float) -> list[Decision]:
        """Trigger by hand.

        Returns
        -------
        list of Decision
            Decisions on what was waiting up to this time, and last the one on the manual trigger.

        Raises
        ------
        ValueError
            If the time is not finite.
        """
        if not math.isfinite(time_s):
            raise ValueError(f"time_s must be finite, not {time_s!r}")
        decisions = self._decide_until(time_s)
        reason = "" if self.trigger.manual else Suppression.NO_MANUAL
        by_hand = Event(time_s, MANUAL, MANUAL, Transition.MOMENT, None, time_s)
        return [*decisions, self._decide(by_hand, "", reason)]

    def finish(self) -> list[Decision]:
        """Decide on everything that is still waiting; nothing more will be fed before what was."""
        return self._decide_until(math.inf)

    def _decide_until(self, time_s: float) -> list[Decision]:
        if not self._pending:
            return []
        self._pending.sort(key=lambda event: (event.time_s, event.condition, event.index))
        due = [event for event in self._pending if event.time_s <= time_s]
        del self._pending[: len(due)]
        if self.trigger.combination == "any":
            return [self._decide_event(event) for event in due if event.transition is not Transition.OVER]
        return [d for _, group in groupby(due, lambda event: event.time_s) for d in self._decide_together(group)]

    def _decide_together(self, events: Iterable[Event]) -> list[Decision]:
        """Decide on what happens at one instant where all conditions must be met."""
        decisions: list[Decision] = []
        news: dict[int, Event] = {}
        momentary = set()
        for event in events:
            if event.transition is Transition.BEYOND:
                decisions.append(self._decide_event(event))
            elif event.transition is Transition.OVER:
                self._met[event.condition] = False
            else:
                self._met[event.condition] = True
                news[event.condition] = event
                if event.transition is Transition.MOMENT:
                    momentary.add(event.condition)
        if news and all(self._met):
            decisions.append(self._decide_event(news[max(news)]))
        for number in momentary:
            self._met[number] = False
        return decisions

    def _decide_event(self, event: Event) -> Decision:
        channel = self.trigger.conditions[event.condition].channel
        reason = Suppression.BEYOND_AT_ARM if event.transition is Transition.BEYOND else ""
        return self._decide(event, channel, reason)

    def _decide(self, event: Event, channel: str, reason: str) -> Decision:
        outcome: Outcome = "suppressed"
        time_s = event.time_s
        # whoever triggers by hand does not know what comes: a condition that is met then gets a shot of its own
        by_hand = event.condition == MANUAL
        last_s, stop_s = (self._last_s, self._stop_s) if by_hand else (self._last_met_s, self._stop_met_s)
        if reason:
            pass
        elif not self._armed:
            reason = Suppression.NOT_ARMED
        elif time_s < last_s:
            reason = Suppression.TOO_LATE
        elif time_s < last_s + self.trigger.holdoff_s:
            reason = Suppression.HOLDOFF
        elif time_s < stop_s and not self.trigger.extend:
            reason = Suppression.WITHIN_POST
        else:
            outcome = "extension" if time_s < stop_s else "trigger"
            until_s = time_s + self.trigger.post_s
            self._last_s, self._stop_s = max(self._last_s, time_s), max(self._stop_s, until_s)
            if not by_hand:
                self._last_met_s, self._stop_met_s = time_s, until_s
        return Decision(time_s, outcome, reason, channel, event.condition, event.index, event.value, event.crossing_s)


def find_triggers(trigger: Trigger, channels: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> tuple[Decision, ...]:
    """Find the triggers in recorded samples: the decisions that a detector armed from the start would have made.

    Parameters
    ----------
    channels
        Instants on one clock and samples of each channel by its name, each of shape (n_samples,).

    Returns
    -------
    tuple of Decision
        Decisions in the order of time, the suppressed ones among them.

    Raises
    ------
    ValueError
        As `TriggerDetector` and `TriggerDetector.feed`.
    """
    detector = TriggerDetector(trigger, tuple(channels), max_lag_s=math.inf)
    detector.arm(-math.inf)
    decisions: list[Decision] = []
    for name, (times_s, values) in channels.items():
        decisions += detector.feed(name, times_s, values)
    return (*decisions, *detector.finish())


def _as_samples(times_s: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.floating[Any]]]:
    times, samples = np.asarray(times_s, dtype=np.float64), np.asarray(values)
    if samples.dtype.kind != "f":
        samples = samples.astype(np.float64)
    if times.ndim != 1 or times.shape != samples.shape:
        raise ValueError(f"times and values must be of one length, not {times.shape} and {samples.shape}")
    return times, samples


def _check_times(channel: str, times_s: NDArray[np.float64], latest_s: float) -> None:
    # Written so that a NaN anywhere fails
    if not (times_s[0] >= latest_s and (times_s[1:] >= times_s[:-1]).all()):
        raise ValueError(f"times of channel {channel!r} must be finite and must not run backwards from {latest_s!r} s")
    if not (math.isfinite(times_s[0]) and math.isfinite(times_s[-1])):
        raise ValueError(f"times of channel {channel!r} must be finite")
