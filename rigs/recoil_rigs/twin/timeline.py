"""Times of the shots of a play, and of the devices' clocks meanwhile."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from recoil_rigs.twin.faults import ClockStep


@dataclass(frozen=True)
class Timeline:
    """A play: silence, a shot's record, silence, and so on. Times in s from its start.

    Attributes
    ----------
    starts_s
        Instant of each record's zero on the reference clock.
    record_s
        Length of a record.
    """

    starts_s: tuple[float, ...]
    record_s: float
    end_s: float

    @classmethod
    def plan(cls, shots: int, record_s: float, silence_before_s: float, silence_after_s: float) -> Timeline:
        """Lay out some shots, each with silence before and behind it."""
        each = silence_before_s + record_s + silence_after_s
        return cls(tuple(k * each + silence_before_s for k in range(shots)), record_s, shots * each)

    def boundaries_s(self) -> tuple[float, ...]:
        """Return when each shot's part of the play begins: the middle of the silence before it; the first at 0."""
        ends = [start + self.record_s for start in self.starts_s]
        middles = [(end + start) / 2 for end, start in zip(ends, self.starts_s[1:], strict=False)]
        return (0.0, *middles)

    def quiet_before_s(self, shot: int, first_s: float, period_s: float, last_s: float) -> list[float]:
        """Return when a source samples before a shot's record, in its beat, from its part of the play on.

        Between two shots the silence need not be a whole number of periods. What is over comes in the middle of the
        silence, where no shot's window reaches: a crystal does not shift its beat beside a shot.

        Parameters
        ----------
        shot
            Number of the shot, counted from 0.
        first_s, period_s
            First sample of the record, and the source's period; infinite if it has none.
        last_s
            Last sample of the part of the play before this one.
        """
        if math.isinf(period_s):
            return []
        since_s = max(self.boundaries_s()[shot], last_s + period_s / 2)
        count = math.floor((first_s - since_s) / period_s)
        return [first_s - k * period_s for k in range(count, 0, -1)]

    def quiet_behind_s(self, shot: int, last_s: float, period_s: float) -> list[float]:
        """Return when a source samples behind a shot's record, in its beat, to the end of its part of the play."""
        ends_s = (*self.boundaries_s(), self.end_s)[shot + 1]
        count = math.ceil((ends_s - last_s) / period_s) - 1
        return [last_s + k * period_s for k in range(1, count + 1)]


class DeviceClock:
    """The clock of a device over a whole play: each shot drew its drift, and it may step.

    Parameters
    ----------
    boundaries_s
        Instants at which each drift begins.
    drifts
        ``play = (1 + drift) * device + constant``, as in the truth of a shot.
    """

    def __init__(self, boundaries_s: Sequence[float], drifts: Sequence[float], steps: Sequence[ClockStep] = ()) -> None:
        self._begins = list(boundaries_s)
        self._drifts = list(drifts)
        self._steps = sorted(steps, key=lambda step: step.at_s)
        self._readings = [0.0]
        for k in range(1, len(self._begins)):
            part = (self._begins[k] - self._begins[k - 1]) / (1.0 + self._drifts[k - 1])
            self._readings.append(self._readings[-1] + part)

    def at(self, time_s: float) -> float:
        """Return what it says at a time of the play, 0 at its start."""
        k = max(bisect_right(self._begins, time_s) - 1, 0)
        stepped = sum(step.step_s for step in self._steps if step.at_s <= time_s)
        return self._readings[k] + (time_s - self._begins[k]) / (1.0 + self._drifts[k]) + stepped
