"""From the ticks of an instrument that counts its samples to the host's clock, for what happens live.

A packet comes after its last sample was taken, by a delay that is never negative and mostly small: the least
differences of arrival and tick follow both clocks, what is above them is delay. The relation begins after half a
second, and then turns slowly towards what it should be. So time never steps, and never runs backwards, whatever the
network does.

It dates triggers, cuts and ages. A shot file has the ticks themselves, and anchors on the host's clock
(`tick_anchors`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array

START_S = 0.5
"""Time of an epoch after which its first sample is dated."""
SLEW = 5e-4
"""Most by which host time and ticks run apart from the nominal rate, as a share: five times what a bad crystal is off.
"""
_BUCKET_S = 0.25
_BUCKETS = 20
"""Number of quarters of a second of each of which the least difference is kept."""
_FEWEST_FOR_SLOPE = 8
ANCHOR_EVERY_S = 1.0
"""Time between two anchors that are kept of a recording."""
TICK_ANCHORS = "tick_anchors"
"""Key of the anchors in what a shot file has of a source's clock."""


@dataclass(frozen=True)
class TickAnchor:
    """Tick and instant that belong together.

    Attributes
    ----------
    host_ns
        Instant of the host's monotonic clock, ns.
    u_ns
        Standard uncertainty of it, ns.
    """

    tick: int
    host_ns: int
    u_ns: int


class TickClock:
    """Relation of one instrument's ticks to the host's monotonic clock, from packet to packet.

    Parameters
    ----------
    rate_hz
        Nominal ticks per second.

    Raises
    ------
    ValueError
        If the rate is not positive and finite.
    """

    def __init__(self, rate_hz: float) -> None:
        if not 0 < rate_hz < math.inf:
            raise ValueError(f"rate_hz must be positive and finite, not {rate_hz!r}")
        self._rate_hz = rate_hz
        self._latest_s = -math.inf
        self.restart()

    def restart(self) -> None:
        """Begin a new epoch: the instrument was lost, or counts anew."""
        self._origin: int | None = None
        self._last = 0
        self._began_s = 0.0
        self._least: deque[tuple[int, float]] = deque(maxlen=_BUCKETS)
        self._found = (math.nan, math.inf)
        self._offset_s = self._at_s = math.nan
        self._u_s = math.inf

    @property
    def anchor(self) -> TickAnchor | None:
        """The last tick and its instant; None where the epoch has no relation yet."""
        if self._origin is None or math.isnan(self._offset_s):
            return None
        return TickAnchor(self._last, round(1e9 * (self._at_s + self._offset_s)), round(1e9 * self._u_s))

    def feed(self, first: int, count: int, arrival_ns: int) -> Array | None:
        """Take the next packet; return when its samples were taken.

        Parameters
        ----------
        first
            Tick of its first sample; each of the others is one tick later.
        count
            Number of its samples, at least 1.
        arrival_ns
            Host time at which it was read, ns.

        Returns
        -------
        ndarray of float64, shape (count,), or None
            Instants of the host's monotonic clock, s, none before one that was returned before; None in the first half
            second of an epoch.

        Raises
        ------
        ValueError
            If there is no sample, or the ticks run backwards: that is a new epoch, see `restart`.
        """
        if count < 1:
            raise ValueError(f"a packet has at least one sample, not {count}")
        arrival_s = arrival_ns / 1e9
        if self._origin is None:
            self._origin, self._began_s = first, arrival_s
        elif first <= self._last:
            raise ValueError(f"tick {first} comes after tick {self._last}: ticks run backwards")
        self._last = first + count - 1
        ends_s = (self._last - self._origin) / self._rate_hz
        self._note(arrival_s, arrival_s - ends_s)
        target_s, spread_s = self._found
        if math.isnan(self._offset_s):
            if arrival_s - self._began_s < START_S:
                return None
            self._offset_s, self._at_s = target_s, (first - 1 - self._origin) / self._rate_hz
        passed_s = ends_s - self._at_s
        turned_s = min(max(target_s - self._offset_s, -SLEW * passed_s), SLEW * passed_s)
        # the instants are a line, in place: of many fast channels each pass over them counts
        first_s, turns = (first - self._origin) / self._rate_hz, 1.0 + turned_s / passed_s
        times_s = np.arange(count, dtype=np.float64)
        times_s *= turns / self._rate_hz
        times_s += self._offset_s + turns * first_s - (turns - 1.0) * self._at_s
        self._offset_s, self._at_s = self._offset_s + turned_s, ends_s
        self._u_s = abs(target_s - self._offset_s) + spread_s / math.sqrt(12.0)
        if times_s[0] < self._latest_s:
            np.maximum(times_s, self._latest_s, out=times_s)
        self._latest_s = float(times_s[-1])
        return times_s

    def _note(self, arrival_s: float, difference_s: float) -> None:
        bucket = int(arrival_s / _BUCKET_S)
        if self._least and self._least[-1][0] == bucket:
            if difference_s >= self._least[-1][1]:
                return  # as most packets of a quarter of a second: nothing follows from it
            self._least.pop()
        self._least.append((bucket, difference_s))
        self._found = self._envelope()

    def _envelope(self) -> tuple[float, float]:
        """Return the least difference of now, and by how much the least ones of the last seconds spread about it."""
        at = np.array([bucket for bucket, _ in self._least]) * _BUCKET_S
        least = np.array([least for _, least in self._least])
        if least.size < _FEWEST_FOR_SLOPE:
            return float(least.min()), float(np.ptp(least))
        half = least.size // 2
        older, newer = int(least[:half].argmin()), half + int(least[half:].argmin())
        slope = min(max((least[newer] - least[older]) / (at[newer] - at[older]), -SLEW), SLEW)
        line = least[newer] + slope * (at - at[newer])
        below = min(float((least - line).min()), 0.0)
        return float(line[-1]) + below, _upper_quartile((least - line).tolist()) - below


def _upper_quartile(values: list[float]) -> float:
    """Return what `numpy.quantile` does, in a tenth of its time for so few values."""
    ordered, at = sorted(values), 0.75 * (len(values) - 1)
    low = ordered[int(at)]
    return low + (ordered[min(int(at) + 1, len(values) - 1)] - low) * (at % 1.0)


def tick_anchors(rate_hz: float, packets: Iterable[tuple[int, int, int]]) -> dict[str, Any]:
    """Relate the ticks of a recording to the host's clock, for the ``clock_fit`` of a recording whose clock they are.

    Parameters
    ----------
    rate_hz
        Nominal ticks per second.
    packets
        First tick, number of samples and arrival, host ns, of each packet, as `TickClock.feed` takes them. Ticks that
        run backwards begin a new epoch.

    Returns
    -------
    dict
        ``rate_hz``, and in `TICK_ANCHORS` a list of ``tick``, ``host_ns`` and ``u_ns``: one for each `ANCHOR_EVERY_S`,
        and the last of each epoch.
    """
    clock, last = TickClock(rate_hz), -math.inf
    kept: list[TickAnchor] = []
    latest: TickAnchor | None = None
    for first, count, arrival_ns in packets:
        if first <= last:
            kept += [] if latest is None else [latest]
            clock.restart()
        clock.feed(first, count, arrival_ns)
        last, latest = first + count - 1, clock.anchor
        if latest is not None and (not kept or abs(latest.host_ns - kept[-1].host_ns) >= 1e9 * ANCHOR_EVERY_S):
            kept.append(latest)
            latest = None
    kept += [] if latest is None else [latest]
    return {"rate_hz": rate_hz, TICK_ANCHORS: [asdict(one) for one in kept]}
