"""Captures of instruments that count their samples: each sample at its tick, and nothing between two that are missing.

The clock of such a recording is the instrument's own. Where a stream is described anew, or its ticks begin anew, an
epoch ends: samples of two epochs are not on one clock, so that the longest one counts, and what the others hold is
noted. A connection that was lost and opened again goes on in the same epoch where the instrument says the same of
itself and its ticks went on: what is missing is a gap of so many ticks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.devices.described import DESCRIBED, DescribedEvents
from recoil_acquisition.devices.tick_clock import tick_anchors
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.log.record import DATA
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.readers.captured import CapturedSource, event_of
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.remark import Note, NoteCode, Remark
from recoil_acquisition.streams.tick_stream import (
    StreamDescription,
    StreamFault,
    TickChannel,
    TickDecoder,
    TickItem,
    TickSamples,
)

NAME = "recoil-daq capture"
_SHOWN = 4
_NS = 1_000_000_000


@dataclass
class _Run:
    """Samples of one channel that follow each other without a gap."""

    first_tick: int
    parts: list[NDArray[Any]]
    count: int = 0


@dataclass
class _Series:
    """Samples of one channel in one epoch."""

    channel: TickChannel
    runs: list[_Run] = field(default_factory=list)
    ticks: list[NDArray[np.int64]] = field(default_factory=list)
    again: int = 0

    @property
    def count(self) -> int:
        return sum(run.count for run in self.runs)

    def add(self, item: TickSamples) -> None:
        """Take samples behind those that are there; of what comes twice the first counts."""
        step, raw, first = self.channel.step, item.raw, item.first_tick
        if item.ticks is not None:
            self._add_ticked(raw, np.asarray(item.ticks, dtype=np.int64))
            return
        expected = self.runs[-1].first_tick + step * self.runs[-1].count if self.runs else first
        if first < expected:
            twice = min(-((first - expected) // step), raw.size)
            self.again, raw, first = self.again + twice, raw[twice:], first + step * twice
        if not raw.size:
            return
        if not self.runs or first != expected:
            self.runs.append(_Run(first, []))
        self.runs[-1].parts.append(raw)
        self.runs[-1].count += raw.size

    def _add_ticked(self, raw: NDArray[Any], ticks: NDArray[np.int64]) -> None:
        before = self.ticks[-1][-1] if self.ticks else None
        new = np.ones(ticks.size, dtype=bool) if before is None else ticks > before
        new &= np.diff(ticks, prepend=ticks[0] - 1) > 0
        self.again += int(ticks.size - new.sum())
        if not new.any():
            return
        if not self.runs:
            self.runs.append(_Run(int(ticks[new][0]), []))
        self.ticks.append(ticks[new])
        self.runs[0].parts.append(raw[new])
        self.runs[0].count += int(new.sum())

    def precedes(self, item: TickSamples, *, anew: bool) -> bool:
        """Return whether some samples go on behind those that are there, or repeat some of the last second.

        Behind a connection that was lost nothing is repeated: ticks that go back are counted anew there.
        """
        if not self.runs:
            return True
        run = self.runs[-1]
        behind = int(self.ticks[-1][-1]) + 1 if self.ticks else run.first_tick + self.channel.step * run.count
        return item.first_tick >= behind - (0 if anew else self.channel.tick_rate)


@dataclass
class _Epoch:
    description: StreamDescription
    series: dict[int, _Series] = field(default_factory=dict)
    packets: list[tuple[int, int, int, int]] = field(default_factory=list)
    anew: set[int] = field(default_factory=set)
    """Channels of which nothing came since the connection was lost."""

    @property
    def lasts_s(self) -> float:
        return max((float(one.count * (one.channel.step or 1) / one.channel.tick_rate) for one in self.series.values()),
                   default=0.0)  # fmt: skip

    def goes_on_with(self, item: TickSamples) -> bool:
        series = self.series.get(item.channel)
        return series is None or series.precedes(item, anew=item.channel in self.anew)

    def add(self, item: TickSamples, host_ns: int) -> None:
        channel = self.description.channels[item.channel]
        self.series.setdefault(item.channel, _Series(channel)).add(item)
        self.anew.discard(item.channel)
        self.packets.append((item.channel, item.first_tick, item.raw.size, host_ns))


def open_ticks(path: Path, source: CapturedSource, clock: str, decoder: TickDecoder) -> Recording:
    """Open what a capture has of an instrument that counts its samples.

    Raises
    ------
    CorruptFileError
        If nothing in it says what the samples are.
    """
    faults: list[str] = []
    epochs = _epochs(_items(source, decoder), faults)
    held = [one for one in epochs if one.series]
    if not held:
        raise CorruptFileError(
            f"the capture has no sample of {source.name!r} that can be read", path=path,
            expected="a description of the stream, and samples behind it",
            found="; ".join(dict.fromkeys(faults[:_SHOWN])) or f"{sum(r.kind in DATA for r in source.records)} records",
            remedy="recover the shot from its journal, or use the recorder's own file",
        )  # fmt: skip
    chosen = max(held, key=lambda one: one.lasts_s)
    zero_s, start = _zero(chosen)
    said = chosen.description.channels
    channels = [_stored(one, said[number].said, clock, zero_s, start) for number, one in sorted(chosen.series.items())]
    notes: list[Remark] = [Note(NoteCode.CUT, None, source.incomplete)] if source.incomplete else []
    notes += [*_notes(source, held, chosen, faults), *_gaps(chosen)]
    return Recording(
        path, NAME, channels, metadata=_metadata(chosen, held), notes=notes, incomplete=source.incomplete,
        absolute_start=start,
    )  # fmt: skip


def _items(source: CapturedSource, decoder: TickDecoder) -> Iterator[tuple[int, TickItem | None, bool]]:
    """Yield host time, item, and whether an event said it, of what the records say; None for a lost connection."""
    events = DescribedEvents()
    for record in source.records:
        if record.kind in DATA:
            yield from ((record.host_ns, item, False) for item in decoder.feed(record.payload))
            continue
        event = event_of(record)
        if event is None:
            continue
        if event.name in ("lost", "reopened"):
            decoder.skip()
            yield record.host_ns, None, True
        elif event.name == DESCRIBED and (said := events.take(event.detail)) is not None:
            decoder.describe(said)
            yield record.host_ns, said, True


def _epochs(items: Iterator[tuple[int, TickItem | None, bool]], faults: list[str]) -> list[_Epoch]:
    """Part the samples by what was said of them; those before the first event are of what it says."""
    waiting: list[tuple[int, TickSamples]] = []
    epochs: list[_Epoch] = []
    for host_ns, item, by_event in items:
        if item is None:
            if epochs:
                epochs[-1].anew = set(epochs[-1].series)
            continue
        if isinstance(item, StreamFault):
            faults.append(item.problem)
            continue
        if isinstance(item, StreamDescription):
            if not epochs or epochs[-1].description != item:
                epochs.append(_Epoch(item))
            elif by_event:
                epochs[-1].description = item  # it says more
            # a stream that was described anew in between says so itself, before any event
            ahead, waiting = waiting if by_event and len(epochs) == 1 else [], []
            for at_ns, samples in ahead:
                _put(epochs, samples, at_ns)
            continue
        if epochs:
            _put(epochs, item, host_ns)
        else:
            waiting.append((host_ns, item))
    return epochs


def _put(epochs: list[_Epoch], item: TickSamples, host_ns: int) -> None:
    epoch = epochs[-1]
    if item.channel >= len(epoch.description.channels) or not item.raw.size:
        return
    if not epoch.description.channels[item.channel].tick_rate:
        return
    if not epoch.goes_on_with(item):
        epoch = _Epoch(epoch.description)
        epochs.append(epoch)
    epoch.add(item, host_ns)


def _zero(epoch: _Epoch) -> tuple[int, AbsoluteStart | None]:
    """Return the whole second of the ticks that is time zero, and what the instrument says of it.

    Ticks since 1970 are too large for instants of float64: whole seconds are taken off where their date is known.
    """
    start_ns = epoch.description.start_utc_ns
    if start_ns is None:
        return 0, None
    first = min(one.runs[0].first_tick / one.channel.tick_rate for one in epoch.series.values() if one.runs)
    zero_s = int(first // 1)
    second, nanoseconds = divmod(start_ns + zero_s * _NS, _NS)
    whole = AbsoluteStart.since_1970(second * _NS, "UTC", "the recorder's own clock at tick 0")
    if whole is None:
        return 0, None
    text = f"{whole.text.partition('.')[0]}.{nanoseconds:09d}"
    return zero_s, AbsoluteStart(text, "UTC", whole.origin, epoch.description.time_by)


def _stored(
    series: _Series, said: Mapping[str, str], clock: str, zero_s: int, start: AbsoluteStart | None
) -> StoredChannel:
    channel = series.channel
    raw = np.concatenate([part for run in series.runs for part in run.parts])
    header = SignalHeader(channel.name, channel.unit, raw.size, metadata=dict(said))
    base = _times(series, clock, zero_s, start)
    counts = partial(_counts, raw, channel) if raw.dtype.kind in "iu" else None
    return StoredChannel(header, base, partial(_values, raw, channel), counts)


def _times(series: _Series, clock: str, zero_s: int, start: AbsoluteStart | None) -> TimeBase:
    rate = series.channel.tick_rate
    step_s = float(series.channel.step / rate)

    def instants(first_tick: int, since: NDArray[np.int64]) -> Array:
        return np.asarray(float(first_tick / rate - zero_s) + since * float(1 / rate), dtype=np.float64)

    if series.ticks:
        ticks = np.concatenate(series.ticks)
        return TimeBase.stamped(clock, instants(int(ticks[0]), ticks - ticks[0]), start)
    if len(series.runs) == 1:
        run = series.runs[0]
        return TimeBase.uniform(clock, float(run.first_tick / rate - zero_s), step_s, run.count, start)
    steps = series.channel.step
    parts = [instants(run.first_tick, steps * np.arange(run.count, dtype=np.int64)) for run in series.runs]
    return TimeBase.stamped(clock, np.concatenate(parts), start)


def _values(raw: NDArray[Any], channel: TickChannel, start: int, stop: int) -> Array:
    return np.asarray(channel.factor * raw[start:stop].astype(np.float64) + channel.offset)


def _counts(raw: NDArray[Any], channel: TickChannel, start: int, stop: int) -> RawCounts:
    return RawCounts(raw[start:stop].copy(), channel.factor, channel.offset, channel.unit)


def _gaps(epoch: _Epoch) -> Iterator[Remark]:
    """Say what is missing, in ticks, and what came twice; what several channels lack alike is said once."""
    missing: dict[str, list[str]] = {}
    again: dict[int, list[str]] = {}
    for series in epoch.series.values():
        if series.again:
            again.setdefault(series.again, []).append(series.channel.name)
        step = series.channel.step
        holes = [
            (run.first_tick + step * run.count, later.first_tick)
            for run, later in zip(series.runs, series.runs[1:], strict=False)
        ]
        if holes:
            each = [f"{_sized(stop - tick, step)} from tick {tick} on" for tick, stop in holes[:_SHOWN]]
            more = f" and {len(holes) - _SHOWN} more" if len(holes) > _SHOWN else ""
            missing.setdefault(f"{', '.join(each)}{more}", []).append(series.channel.name)
    for text, names in missing.items():
        yield Note(NoteCode.LOST, _one(names), f"{_named(names)}: samples are missing, {text}")
    for count, names in again.items():
        text = f"{_named(names)}: {count} samples came twice or too late: the first ones count"
        yield Note(NoteCode.LEFT_OUT, _one(names), text)


def _sized(ticks: int, step: int) -> str:
    """Word a hole: so many samples, or so many ticks where the beat behind it is another one."""
    whole, rest = divmod(ticks, step)
    return f"{ticks} ticks, another beat behind them," if rest else f"{whole}"


def _named(names: list[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")


def _one(names: list[str]) -> str | None:
    return names[0] if len(names) == 1 else None


def _notes(source: CapturedSource, held: list[_Epoch], chosen: _Epoch, faults: list[str]) -> Iterator[Remark]:
    lost = [event for event in source.events if event.name == "lost"]
    if lost:
        text = f"the connection was lost {len(lost)} times while it was recorded ({lost[0].detail})"
        yield Note(NoteCode.LOST, None, text)
    if faults:
        shown = "; ".join(dict.fromkeys(faults[:_SHOWN]))
        yield Note(NoteCode.LEFT_OUT, None, f"{len(faults)} parts of the stream could not be read: {shown}")
    others = [one for one in held if one is not chosen]
    if others:
        left_s = sum(one.lasts_s for one in others)
        text = (
            f"the recorder described its stream, or counted, anew {len(others)} times: {left_s:.3f} s of samples on "
            "other clocks are left out"
        )
        yield Note(NoteCode.LEFT_OUT, None, text)


def _metadata(epoch: _Epoch, held: list[_Epoch]) -> dict[str, Any]:
    """Return what a shot file keeps of it beside the samples."""
    fastest = max(epoch.series, key=lambda number: _sample_rate(epoch.series[number].channel))
    channel = epoch.series[fastest].channel
    step = channel.step or 1
    packets, last = [], -1
    for number, first, count, at_ns in epoch.packets:
        if number == fastest and first // step > last:  # else it came twice, or late
            last = first // step + count - 1
            packets.append((first // step, count, at_ns))
    return {
        "dated_by": "recorder",
        "clock_fit": tick_anchors(float(_sample_rate(channel)), packets),
        "epochs": len(held),
        "start_utc_ns": epoch.description.start_utc_ns,
        "time_by": epoch.description.time_by,
        "ticks": {
            one.channel.name: {
                "rate": [one.channel.tick_rate.numerator, one.channel.tick_rate.denominator],
                "step": one.channel.step,
                "runs": [[run.first_tick, run.count] for run in one.runs],
            }
            for one in epoch.series.values()
        },
    }


def _sample_rate(channel: TickChannel) -> Fraction:
    return channel.tick_rate / (channel.step or 1)
