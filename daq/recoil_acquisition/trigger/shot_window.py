"""Span of time of a shot, and when every source has delivered it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from recoil_acquisition.trigger.decision import Decision
from recoil_acquisition.trigger.detector import Trigger


@dataclass(frozen=True)
class ShotWindow:
    """The span of one shot, on the clock of the trigger.

    Attributes
    ----------
    start_s, trigger_s, stop_s
        Beginning, trigger and end of the shot, which is ``start_s <= t < stop_s``.
    pre_actual_s
        Pre-time that every source has; less than asked for where not so much was recorded. Negative if the oldest that
        a source still holds is after the trigger.
    pre_by_source
        Pre-time of each source that has delivered anything.
    decisions
        Decisions within the span, the suppressed ones among them, in the order of time.
    late_sources
        Sources that had not delivered the whole span when waiting for them ended.
    """

    start_s: float
    trigger_s: float
    stop_s: float
    pre_actual_s: float
    pre_by_source: Mapping[str, float]
    decisions: tuple[Decision, ...]
    late_sources: tuple[str, ...] = ()


@dataclass
class _OpenShot:
    trigger_s: float
    stop_s: float
    dated_by: frozenset[str]


@dataclass
class _HeldSpan:
    oldest_s: float
    latest_s: float


class ShotCutter:
    """Follows the decisions and the sources, and says when a shot is complete.

    Each block of data goes to the detector first, its decisions to `note`, then its time to `advance`; then `ready`
    is asked.

    Parameters
    ----------
    sources
        Names of the sources whose data a shot is made of.
    patience_s
        Time after a shot's end for which a source that lags or is gone is waited for, seconds.
    lag_s
        Time by which a decision may be behind the furthest source, seconds; the detector's ``max_lag_s``.
    source_of
        Source of each channel of the trigger.

    Raises
    ------
    ValueError
        If `patience_s` or `lag_s` is negative.
    """

    def __init__(
        self,
        trigger: Trigger,
        sources: Sequence[str],
        *,
        patience_s: float = 5.0,
        lag_s: float = 1.0,
        source_of: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        for name, time_s in (("patience_s", patience_s), ("lag_s", lag_s)):
            if not time_s >= 0:
                raise ValueError(f"{name} must not be negative, not {time_s!r}")
        self._trigger = trigger
        self._sources = tuple(sources)
        self._patience_s = patience_s
        self._lag_s = lag_s
        self._source_of = dict(source_of)
        self._held: dict[str, _HeldSpan] = {}
        self._shots: list[_OpenShot] = []
        self._decisions: list[Decision] = []
        self._stalls: list[tuple[str, float, float]] = []

    @property
    def open_shots(self) -> int:
        """Number of shots that have begun and are not complete."""
        return len(self._shots)

    def note(self, decisions: Iterable[Decision]) -> None:
        """Take decisions of a detector, in its order."""
        for decision in decisions:
            self._decisions.append(decision)
            stop_s = decision.time_s + self._trigger.post_s
            if decision.outcome == "trigger":
                self._shots.append(_OpenShot(decision.time_s, stop_s, self._dated_by(decision)))
            elif decision.outcome == "extension" and self._shots:
                self._shots[-1].stop_s = stop_s

    def advance(self, source: str, oldest_s: float, latest_s: float) -> None:
        """Say what is held of a source: everything between two instants.

        Raises
        ------
        ValueError
            If the source is unknown, or a time is not a number.
        """
        if source not in self._sources:
            raise ValueError(f"unknown source {source!r}; there are {', '.join(self._sources)}")
        if math.isnan(oldest_s) or math.isnan(latest_s):
            raise ValueError(f"times of source {source!r} must be numbers")
        self._held[source] = _HeldSpan(oldest_s, latest_s)

    def stalled(self, source: str, from_s: float, until_s: float) -> None:
        """Say that what was read of a source at an instant may have arrived since another.

        So early a trigger may be that the source dated so. Triggers of other sources are not concerned, and what is
        held of the source itself has its own span.
        """
        if not self._stalls or (source, from_s, until_s) != self._stalls[-1]:
            self._stalls.append((source, from_s, until_s))

    def _dated_by(self, decision: Decision) -> frozenset[str]:
        """Return the sources whose dates a trigger rests on; none of an operator's own key."""
        if not decision.channel:
            return frozenset()
        channels = self._trigger.channels if self._trigger.combination == "all" else (decision.channel,)
        return frozenset(self._source_of.get(channel, channel) for channel in channels)

    @property
    def needed_from_s(self) -> float:
        """The instant before which nothing is needed for a shot, now or later; minus infinity if nothing is held."""
        furthest_s = max((span.latest_s for span in self._held.values()), default=-math.inf)
        recent_s = [self._earliest_s(shot) for shot in self._shots]
        dating = {self._source_of.get(channel, channel) for channel in self._trigger.channels}
        recent_s += [
            from_s for name, from_s, until_s in self._stalls if name in dating and until_s >= furthest_s - self._lag_s
        ]
        return min([furthest_s - self._lag_s, *recent_s]) - self._trigger.pre_s

    def ready(self, now_s: float) -> tuple[ShotWindow, ...]:
        """Return the shots that are complete, each once.

        Parameters
        ----------
        now_s
            The present on the clock of the trigger; infinity closes every shot with what there is.
        """
        complete = []
        while self._shots:
            shot = self._shots[0]
            late = tuple(name for name in self._sources if self._latest_s(name) < shot.stop_s)
            if late and now_s < shot.stop_s + self._patience_s:
                break
            complete.append(self._window(self._shots.pop(0), late))
        from_s = self.needed_from_s
        self._stalls = [stall for stall in self._stalls if stall[2] >= from_s]
        self._decisions = [decision for decision in self._decisions if decision.time_s >= from_s]
        return tuple(complete)

    def _latest_s(self, source: str) -> float:
        return self._held[source].latest_s if source in self._held else -math.inf

    def _earliest_s(self, shot: _OpenShot) -> float:
        """Return when the trigger of a shot may have been, where what dated it was read late."""
        at_s = shot.trigger_s
        late = (f for name, f, until_s in self._stalls if name in shot.dated_by and f < at_s <= until_s)
        return min([at_s, *late])

    def _window(self, shot: _OpenShot, late: tuple[str, ...]) -> ShotWindow:
        pre_by_source = {
            name: min(self._trigger.pre_s, shot.trigger_s - span.oldest_s) for name, span in self._held.items()
        }
        start_s = self._earliest_s(shot) - max(pre_by_source.values(), default=0.0)
        return ShotWindow(
            start_s,
            shot.trigger_s,
            shot.stop_s,
            min(pre_by_source.values(), default=0.0),
            pre_by_source,
            tuple(decision for decision in self._decisions if start_s <= decision.time_s < shot.stop_s),
            late,
        )
