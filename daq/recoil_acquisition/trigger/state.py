"""One condition of a trigger on its way through the samples of its channel, block by block."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window

Floats = NDArray[np.float64]


class Transition(enum.Enum):
    """Change of a condition at a sample."""

    OVER = "it is no longer met"
    MET = "it is met from here on"
    MOMENT = "it is met at this instant only"
    BEYOND = "its level is reached, but it has not been below its rearm level since arming"


@dataclass(frozen=True, slots=True)
class Event:
    """A transition of one condition.

    Attributes
    ----------
    time_s
        Instant of the sample.
    condition
        Place of the condition in its trigger.
    index
        Number of the sample in its channel, from 0.
    value
        Sample, or rate of a rate of change; None of a trigger by hand.
    crossing_s
        Instant at which the straight line from the sample before crosses the level or border; `time_s` for a rate of
        change and a pulse width.
    """

    time_s: float
    condition: int
    index: int
    transition: Transition
    value: float | None
    crossing_s: float


class ConditionState:
    """A condition between two blocks. A block that cannot touch a threshold costs a look at its extremes.

    Parameters
    ----------
    number
        Place of the condition in the trigger.
    """

    def __init__(self, condition: Condition, number: int) -> None:
        self._condition = condition
        self._number = number
        self._level, self._rearm = condition.thresholds
        self._index = 0
        self._reset(-math.inf, report_beyond=False)

    def arm(self, time_s: float) -> None:
        """Forget what was; samples before this time do not count."""
        self._reset(time_s, report_beyond=True)

    def _reset(self, from_s: float, *, report_beyond: bool) -> None:
        self._from_s = from_s
        self._report_beyond = report_beyond
        self._met: bool | None = None  # None until the quantity has been below the rearm level
        self._before = (math.nan, math.nan)
        self._pulse = _Pulse(self._condition) if isinstance(self._condition, PulseWidth) else None
        self._rates = _Rates(self._condition.over_s) if isinstance(self._condition, RateOfChange) else None

    def feed(self, times_s: Floats, values: NDArray[np.floating[Any]]) -> list[Event]:
        """Take the next samples, shapes (n_samples,), and return what happened, in order."""
        first, self._index = self._index, self._index + len(values)
        if len(values) and times_s[0] < self._from_s:
            skipped = int(np.searchsorted(times_s, self._from_s))
            first, times_s, values = first + skipped, times_s[skipped:], values[skipped:]
        if not len(values):
            return []
        indices: NDArray[np.intp] | None = None
        highest = float(values.max())
        if math.isnan(highest):
            times_s, values, indices = _without_lost(times_s, values, None)
            highest = float(values.max(initial=-math.inf))
        if self._rates is not None:
            exact_values: Floats = values.astype(np.float64, copy=False)
            if len(values):
                bounds = self._condition.bounds(*self._rates.bounds(times_s, exact_values))
                if self._is_quiet(*bounds, float(times_s[-1])):
                    self._rates.keep(times_s, exact_values)
                    return []
            values = self._rates.feed(times_s, exact_values)
            highest = float(values.max(initial=-math.inf))
            if math.isnan(highest):
                times_s, values, indices = _without_lost(times_s, values, indices)
                highest = float(values.max(initial=-math.inf))
        if not len(values):
            return []
        lowest = float(values.min())
        last_s = float(times_s[-1])
        events: list[Event] = []
        if not self._is_quiet(*self._condition.bounds(lowest, highest), last_s):
            exact: Floats = values.astype(np.float64, copy=False)
            for at, transition in self._transitions(times_s, exact):
                index = first + (at if indices is None else int(indices[at]))
                crossing_s = self._crossing_s(at, transition, times_s, exact)
                events.append(Event(float(times_s[at]), self._number, index, transition, float(exact[at]), crossing_s))
        self._before = last_s, float(values[-1])
        return events

    def _is_quiet(self, lowest: float, highest: float, last_s: float) -> bool:
        """Return whether a block whose quantity has these bounds changes nothing."""
        if self._met is False:
            return highest < self._level
        if self._met is None:
            return lowest >= self._rearm and not (self._report_beyond and highest >= self._level)
        return lowest >= self._rearm and not (self._pulse is not None and last_s >= self._pulse.due_s)

    def _transitions(self, times_s: Floats, values: Floats) -> list[tuple[int, Transition]]:
        """Return the samples at which the state turns, by their place in the block."""
        quantity = self._condition.compared(values)
        reached = quantity >= self._level
        touching = np.flatnonzero(reached | (quantity < self._rearm))
        marks = reached[touching]
        transitions: list[tuple[int, Transition]] = []
        if self._met is None:
            n_beyond = len(marks) if marks.all() else int(marks.argmin())
            if n_beyond and self._report_beyond:
                self._report_beyond = False
                transitions.append((int(touching[0]), Transition.BEYOND))
            touching, marks = touching[n_beyond:], marks[n_beyond:]
            if not len(marks):
                return transitions
            self._met = False
        changed = marks != np.concatenate(([self._met], marks[:-1]))
        changes_to = [Transition.MET if met else Transition.OVER for met in marks[changed]]
        changes = list(zip(touching[changed].tolist(), changes_to, strict=True))
        if len(marks):
            self._met = bool(marks[-1])
        return transitions + (changes if self._pulse is None else self._pulse.transitions(changes, times_s))

    def _crossing_s(self, at: int, transition: Transition, times_s: Floats, values: Floats) -> float:
        time_s = float(times_s[at])
        if transition is not Transition.MET or not isinstance(self._condition, Edge | Window):
            return time_s
        before_s, before = (float(times_s[at - 1]), float(values[at - 1])) if at else self._before
        value = float(values[at])
        share = (self._condition.border(before, value) - before) / (value - before)
        return before_s + share * (time_s - before_s) if 0 <= share <= 1 else time_s


class _Pulse:
    """Measures the width of pulses, from where they begin and end."""

    def __init__(self, condition: PulseWidth) -> None:
        self._longer_s = condition.longer_than_s
        self._shorter_s = condition.shorter_than_s
        self._start_s = math.nan
        self.due_s = math.nan  # from when on the present pulse is long enough; NaN: its end decides, or it is met

    def transitions(self, changes: list[tuple[int, Transition]], times_s: Floats) -> list[tuple[int, Transition]]:
        """Turn the begins and ends of a block's pulses into what they mean for the condition."""
        transitions: list[tuple[int, Transition]] = []
        for at, change in changes:
            if change is Transition.MET:
                self._start_s = float(times_s[at])
                if self._longer_s is not None and self._shorter_s is None:
                    self.due_s = self._start_s + self._longer_s
                continue
            transitions += self._due_before(at, times_s)
            transitions += self._ended(at, float(times_s[at]))
            self._start_s = self.due_s = math.nan
        return transitions + self._due_before(len(times_s), times_s)

    def _due_before(self, stop: int, times_s: Floats) -> list[tuple[int, Transition]]:
        if math.isnan(self.due_s):
            return []
        at = int(np.searchsorted(times_s, self.due_s))
        if at >= stop:
            return []
        self.due_s = math.nan
        return [(at, Transition.MET)]

    def _ended(self, at: int, end_s: float) -> list[tuple[int, Transition]]:
        if self._shorter_s is None:
            if math.isnan(self.due_s):
                return [(at, Transition.OVER)]
            return [(at, Transition.MOMENT)] if end_s >= self.due_s else []
        long_enough = self._longer_s is None or end_s >= self._start_s + self._longer_s
        return [(at, Transition.MOMENT)] if long_enough and end_s - self._start_s < self._shorter_s else []


_ROUNDING = 1.0 + 1e-12
"""Factor by which bounds are wider than the rates that they bound: bounds and rates are rounded."""


class _Rates:
    """Takes the rate of change of a signal over a time."""

    def __init__(self, over_s: float) -> None:
        self._over_s = over_s
        self._times_s, self._values = np.zeros(0), np.zeros(0)

    def bounds(self, times_s: Floats, values: Floats) -> tuple[float, float]:
        """Return two numbers between which all rates of the next samples are; infinite where that is not clear at once.

        A rate over a time is taken over that time or more, so it cannot exceed the signal's span divided by it.
        """
        if not self._values.size or not self._values.size + len(values) > 1:
            return -math.inf, math.inf
        past = float(self._values[-1])
        if self._over_s:
            low = min(float(values.min()), float(self._values.min()))
            high = max(float(values.max()), float(self._values.max()))
            limit = _ROUNDING * (high - low) / self._over_s
            return -limit, limit
        shortest_s = min(float(times_s[0] - self._times_s[-1]), float(np.diff(times_s).min(initial=math.inf)))
        if not shortest_s > 0:
            return -math.inf, math.inf
        steps = np.diff(values)
        first = float(values[0]) - past
        low = min(first, float(steps.min(initial=0.0)), 0.0)
        high = max(first, float(steps.max(initial=0.0)), 0.0)
        return _ROUNDING * low / shortest_s, _ROUNDING * high / shortest_s

    def keep(self, times_s: Floats, values: Floats) -> None:
        """Take the next samples without their rates; there is at least one."""
        since_s = times_s[-1] - self._over_s
        at = int(np.searchsorted(times_s, since_s, side="right")) - 1
        if at >= 0:
            self._times_s, self._values = times_s[at:].copy(), values[at:].copy()
            return
        times = np.concatenate((self._times_s, times_s))
        first = max(int(np.searchsorted(times, since_s, side="right")) - 1, 0)
        self._values = np.concatenate((self._values, values))[first:]
        self._times_s = times[first:]

    def feed(self, times_s: Floats, values: Floats) -> Floats:
        """Return the rate at each of the next samples, shape (n_samples,); NaN where there is none yet."""
        n_past, new = len(self._times_s), (times_s, values)
        times_s = np.concatenate((self._times_s, times_s))
        values = np.concatenate((self._values, values))
        # Stamps that repeat have no rate between them, and infinite samples none at all
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            rates = self._over_time(times_s, values, n_past) if self._over_s else _to_the_next(times_s, values, n_past)
        rates[~np.isfinite(rates)] = np.nan
        if len(new[0]):
            self.keep(*new)
        return rates

    def _over_time(self, times_s: Floats, values: Floats, n_past: int) -> Floats:
        start = np.searchsorted(times_s, times_s[n_past:] - self._over_s, side="right") - 1
        rates: Floats = (values[n_past:] - values[start]) / (times_s[n_past:] - times_s[start])
        rates[start < 0] = np.nan
        return rates


def _to_the_next(times_s: Floats, values: Floats, n_past: int) -> Floats:
    """Return the rates from each sample to the next, without those within the past; NaN at the very first."""
    rates: Floats = np.diff(values) / np.diff(times_s)
    return rates[n_past - 1 :] if n_past else np.concatenate(([np.nan], rates))[: len(values)]


def _without_lost(
    times_s: Floats, values: NDArray[np.floating[Any]], indices: NDArray[np.intp] | None
) -> tuple[Floats, NDArray[np.floating[Any]], NDArray[np.intp]]:
    """Leave lost samples out; `indices` are the places in the block of those given, None if of all."""
    kept = np.flatnonzero(~np.isnan(values))
    return times_s[kept], values[kept], kept if indices is None else indices[kept]
