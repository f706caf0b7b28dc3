"""A trigger at rest: how often each of its conditions is met, and where its channel stands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples
from recoil_acquisition.trigger import Condition, RateOfChange, Trigger, Window, find_triggers
from recoil_acquisition.trigger.decision import Suppression

WITH_ITS_UNIT = 'with its unit such as "1.5 MPa"'


@dataclass(frozen=True)
class ConditionAtRest:
    """One condition of the trigger while nothing is fired.

    Attributes
    ----------
    level
        Level of the condition, in the unit in which people read the channel.
    value
        Last sample of the channel, in that unit.
    crossed
        Number of times that the condition was met.
    fired
        Number of times that it triggered: where all conditions must be met, it was the last that was missing.
    beyond
        Whether the channel stood beyond the level from the begin, so that the condition cannot be met.
    listened_s
        Time for which the channel was listened to, s.
    """

    channel: str
    level: str
    value: str
    crossed: int
    fired: int
    beyond: bool
    listened_s: float

    @property
    def finding(self) -> str:
        """Sentence that says what speaks against it, and what to do; empty if nothing does."""
        if self.fired:
            crossed = f"crossed {self.level} {times(self.crossed)} in {self.listened_s:g} s, is at {self.value}"
            return f"the trigger fires at rest: {crossed}: raise the level, {WITH_ITS_UNIT}, or declare `rearm`"
        if self.beyond:
            beyond = f"stands at {self.value}, beyond the trigger's {self.level}"
            return f"{beyond}: it cannot fire before it was on the other side; correct the level, {WITH_ITS_UNIT}"
        return ""


def times(count: int) -> str:
    """Write how often something was."""
    return "once" if count == 1 else f"{count} times"


def level_of(condition: Condition, channel: LiveChannel) -> str:
    """Write the level of a condition, or the borders of its window, as people read the channel."""
    if isinstance(condition, Window):
        return f"{channel.shown(condition.low)} .. {channel.shown(condition.high)}"
    return channel.shown(condition.level, rate=isinstance(condition, RateOfChange))


def conditions_at_rest(
    trigger: Trigger,
    channels: Mapping[str, LiveChannel],
    heard: Mapping[str, Iterable[LiveSamples]],
    listened_s: float,
) -> tuple[ConditionAtRest, ...]:
    """Run a trigger over what was heard at rest.

    Parameters
    ----------
    channels
        Channels of the rig; keys are their names.
    heard
        Samples of each channel as they came; a channel of which nothing came may be missing.
    listened_s
        Time for which they were listened to, s.

    Returns
    -------
    tuple of ConditionAtRest
        Conditions whose channel was heard, in their order.
    """
    series = {}
    for name in trigger.channels:
        blocks = list(heard.get(name, ()))
        if any(block.values.size for block in blocks):
            times_s = np.maximum.accumulate(np.concatenate([block.times_s for block in blocks]))
            series[name] = times_s, np.concatenate([block.values for block in blocks])
    whole = find_triggers(trigger, series) if len(series) == len(trigger.channels) else ()
    found = []
    for number, condition in enumerate(trigger.conditions):
        if condition.channel not in series:
            continue
        channel, values = channels[condition.channel], series[condition.channel][1]
        alone = find_triggers(Trigger((condition,)), {condition.channel: series[condition.channel]})
        finite = values[np.isfinite(values)]
        crossed = sum(decision.reason != Suppression.BEYOND_AT_ARM for decision in alone)
        found.append(
            ConditionAtRest(
                channel=condition.channel,
                level=level_of(condition, channel),
                value=channel.shown(float(finite[-1])) if finite.size else "no number",
                crossed=crossed,
                fired=sum(one.condition == number and one.reason != Suppression.BEYOND_AT_ARM for one in whole),
                beyond=bool(alone) and not crossed,
                listened_s=listened_s,
            )
        )
    return tuple(found)
