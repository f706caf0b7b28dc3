"""The devices' counts at past moments: rates for the screen, and what was lost within one shot."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

from recoil_acquisition.capture.shot_record import CounterSpan
from recoil_acquisition.devices.device import Counters, Device

EVERY_S = 0.25
RATE_OVER_S = 2.0
_LEAST_S = 0.1


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
        if snapshots and now_s - snapshots[-1][0] < EVERY_S:
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
