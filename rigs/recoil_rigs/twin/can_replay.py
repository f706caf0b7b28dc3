"""The frames of a virtual CAN bus over a whole play: shots as their logs hold them, baseline frames between them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recoil_acquisition.readers.can.decoding import BitRun, layout_of
from recoil_acquisition.readers.can.frames import EXTENDED
from recoil_acquisition.readers.can.messages import load_database
from recoil_rigs.rig import Rig, Source
from recoil_rigs.twin import TwinShot
from recoil_rigs.twin.faults import ClockStep
from recoil_rigs.twin.timeline import DeviceClock, Timeline

_BASELINE_ENDS_S = 2e-3
"""Frames up to here before the shot are its baseline; sensors' filters ring before an abrupt rise."""


@dataclass(frozen=True, slots=True)
class CanItem:
    """One frame of the play.

    Attributes
    ----------
    at_s
        Instant at which the interface has the frame, on the play's clock.
    stamp_s
        Time of the interface's clock then, counted from the play's start.
    error
        An error frame.
    """

    at_s: float
    stamp_s: float
    identifier: int
    extended: bool
    data: bytes
    error: bool = False


@dataclass(frozen=True)
class _Logged:
    """The frames of one identifier in one shot: times of the play, data, and those before the shot."""

    times_s: list[float]
    data: list[bytes]
    baseline: list[bytes]


_Key = tuple[int, bool, bool]


def can_items(
    rig: Rig, source: Source, shots: Sequence[TwinShot], timeline: Timeline, steps: Sequence[ClockStep], seed: int
) -> Iterator[CanItem]:
    """Yield the frames of a bus in the order of their times.

    Between shots every message goes on at its own period with data of its baseline frames before the shot,
    drawn at random, so that the noise is there. Signals whose name ends with ``counter`` count through.

    Parameters
    ----------
    steps
        Steps of the interface's clock.
    """
    clocks = [shot.truth["sources"][source.name]["clock"] for shot in shots]
    clock = DeviceClock(timeline.boundaries_s(), [c["drift"] for c in clocks], steps)
    logs = [
        _logged(shot, source, start_s, (c["drift"], c["offset_s"]))
        for shot, start_s, c in zip(shots, timeline.starts_s, clocks, strict=True)
    ]
    counters = _counters(rig, source)
    keys = sorted(set().union(*logs))
    streams = [
        _stream(key, [log.get(key) for log in logs], timeline, clock, counters.get(key, ()), seed + i)
        for i, key in enumerate(keys)
    ]
    return heapq.merge(*streams, key=lambda item: item.at_s)


def _logged(shot: TwinShot, source: Source, start_s: float, line: tuple[float, float]) -> dict[_Key, _Logged]:
    """Read a shot's log and sort its frames by identifier."""
    import can

    drift, offset_s = line
    path: Path = shot.folder / shot.truth["sources"][source.name]["file"]
    baseline_until_s = start_s + shot.truth["t_fire"] - _BASELINE_ENDS_S
    found: dict[_Key, _Logged] = {}
    with can.LogReader(path) as log:
        messages = [one for one in log if source.bus is None or one.channel == int(source.bus) - 1]
    # a log counts from its first frame, whose stamp on the interface's clock is 0
    zero_s = min(message.timestamp for message in messages)
    for message in messages:
        at_s = start_s + (1.0 + drift) * (message.timestamp - zero_s) + offset_s
        key = (message.arbitration_id, bool(message.is_extended_id), bool(message.is_error_frame))
        entry = found.setdefault(key, _Logged([], [], []))
        data = bytes(message.data)
        entry.times_s.append(at_s)
        entry.data.append(data)
        if at_s < baseline_until_s:
            entry.baseline.append(data)
    return found


def _counters(rig: Rig, source: Source) -> dict[_Key, tuple[tuple[BitRun, ...], ...]]:
    """Return where the counters of each message are."""
    database = load_database(rig.databases[str(source.database)], rig.path)
    places: dict[_Key, tuple[tuple[BitRun, ...], ...]] = {}
    for message in database.messages:
        layouts = [layout_of(s) for s in message.signals if s.name.casefold().endswith("counter")]
        pieces = tuple(layout.pieces for layout in layouts if layout is not None)
        if pieces:
            places[(message.frame_id & ~EXTENDED, bool(message.is_extended_frame), False)] = pieces
    return places


def _stream(
    key: _Key,
    logged: Sequence[_Logged | None],
    timeline: Timeline,
    clock: DeviceClock,
    counters: tuple[tuple[BitRun, ...], ...],
    seed: int,
) -> Iterator[CanItem]:
    """Yield one identifier's frames over the whole play."""
    rng = np.random.default_rng([seed, key[0]])
    count = 0

    def item(at_s: float, data: bytes) -> CanItem:
        nonlocal count
        for pieces in counters:
            data = with_bits(data, pieces, count)
        count += 1
        return CanItem(at_s, clock.at(at_s), *key[:2], data, key[2])

    def noise(baseline: list[bytes]) -> bytes:
        return baseline[int(rng.integers(len(baseline)))]

    last_s = -math.inf
    for shot, entry in enumerate(logged):
        if entry is None:
            continue
        first_s, steps = entry.times_s[0], len(entry.times_s) - 1
        # a log of the twin lacks no frame; error frames and a single one have no beat
        period_s = (entry.times_s[-1] - first_s) / steps if steps and not key[2] else math.inf
        baseline = entry.baseline or entry.data[:1]
        for at_s in timeline.quiet_before_s(shot, first_s, period_s, last_s):
            yield item(at_s, noise(baseline))
        for at_s, data in zip(entry.times_s, entry.data, strict=True):
            yield item(at_s, data)
        last_s = entry.times_s[-1]
        for at_s in timeline.quiet_behind_s(shot, last_s, period_s):
            yield item(at_s, noise(baseline))
            last_s = at_s


def with_bits(data: bytes, pieces: tuple[BitRun, ...], value: int) -> bytes:
    """Return data with a whole number put into a signal's bits; what does not fit is cut off."""
    octets = bytearray(data)
    for piece in pieces:
        mask = (1 << piece.count) - 1
        if piece.byte < len(octets):
            kept = octets[piece.byte] & ~(mask << piece.shift)
            octets[piece.byte] = kept | (value >> piece.place & mask) << piece.shift
    return bytes(octets)
