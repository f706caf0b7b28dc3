"""The samples of a virtual recorder over a whole play: shots as its files hold them, and noise at rest between.

What is played is what the file holds, at the ticks that `recoil_rigs.twin.faults.PlayedRecorder` tells of: a stream may
be compared with the file sample by sample. As float32 it is the nearest; as whole numbers of three bytes, of which the
sensor's range takes all, it is the same where the twin's converter has at most 24 bits.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, get_args

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.readers.table import recognise
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.tables.channel_table import range_si
from recoil_rigs.twin import TwinShot, virtual_settings
from recoil_rigs.twin.faults import ClockStep
from recoil_rigs.twin.oxygen_packets import Raw, ValueForm, WireChannel, raw_of
from recoil_rigs.twin.oxygen_recorder import RecorderContent
from recoil_rigs.twin.sources import file_unit, to_file
from recoil_rigs.twin.timeline import Timeline

_BASELINE_ENDS_S = 5e-3
_POOL_S = 0.5
_STEPS_OF_24_BITS = 1 << 24


@dataclass(frozen=True)
class StreamForm:
    """Form of a virtual recorder's stream: ``device = { virtual = "oxygen", values = "i24", packet_ms = 100 }``.

    Attributes
    ----------
    values
        Form of the numbers: float32, or whole numbers of three bytes with factor and offset.
    packet_ms
        Time that a packet holds.
    own_ticks
        Signals whose samples are sent with a tick each.
    """

    values: ValueForm = "f32"
    packet_ms: float = 10.0
    own_ticks: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.values not in get_args(ValueForm):
            raise ValueError(f"values must be one of {', '.join(get_args(ValueForm))}, not {self.values!r}")
        if not 0.1 <= self.packet_ms <= 1000:
            raise ValueError(f"packet_ms must be from 0.1 to 1000, not {self.packet_ms!r}")

    @classmethod
    def from_table(cls, table: Mapping[str, Any], signals: Collection[str] = ()) -> StreamForm:
        """Read it from a ``device`` table.

        Parameters
        ----------
        signals
            Signals that the recorder has.

        Raises
        ------
        ValueError
            Where something makes no sense.
        """
        given = {one.name: table[one.name] for one in fields(cls) if one.name in table}
        if strangers := set(given.get("own_ticks", ())).difference(signals):
            raise ValueError(f"own_ticks: the recorder has no {', '.join(sorted(strangers))}")
        return cls(**given)


@dataclass(frozen=True, eq=False)
class SampleItem:
    """Samples of all channels that the recorder has at once.

    Attributes
    ----------
    at_s
        Instant at which the last of them is taken, on the play's clock.
    first
        Tick of the first, counted from the play's start.
    raw : ndarray of uint8, shape (n_channels, n_samples, n_bytes)
    begins
        Shots whose file begins here: number from 0, and tick of its first sample.
    """

    at_s: float
    first: int
    raw: Raw
    begins: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class _Part:
    """One shot's part of the play: its samples from a tick on, and what the recorder has before and behind them."""

    raw: Raw
    rest: Raw
    first: int
    first_s: float
    period_s: float

    def at_s(self, tick: int) -> float:
        return self.first_s + (tick - self.first) * self.period_s

    def tick_from(self, at_s: float) -> int:
        """Return the first tick that is not before an instant."""
        return self.first + math.ceil((at_s - self.first_s) / self.period_s - 1e-9)


class RecorderTape:
    """A recorder's samples over a whole play, tick by tick.

    Parameters
    ----------
    ppm
        Millionths by which its clock is slow, beside what each shot drew.
    """

    def __init__(
        self,
        rig: Rig,
        source: Source,
        shots: Sequence[TwinShot],
        timeline: Timeline,
        form: StreamForm,
        *,
        ppm: float = 0.0,
        seed: int = 0,
    ) -> None:
        self._rate_hz = float(virtual_settings(rig).sample_rate_hz)
        self._rng = np.random.default_rng([seed, *source.name.encode()])
        self._timeline = timeline
        specs = rig.channels_of(source.name)
        files = {shot.folder: _stored(rig, source, specs, shot) for shot in shots}
        channels = [_on_wire(spec, form, [stored[i] for stored in files.values()]) for i, spec in enumerate(specs)]
        self._parts: list[_Part] = []
        self._begins = list(timeline.boundaries_s())
        self._from = [0]
        for k, (shot, start_s) in enumerate(zip(shots, timeline.starts_s, strict=True)):
            clock = shot.truth["sources"][source.name]["clock"]
            raw = np.stack([
                raw_of(values if form.values == "f32" else np.rint((values - one.offset) / one.factor), form.values)
                for one, values in zip(channels, files[shot.folder], strict=True)
            ])  # fmt: skip
            period_s = (1.0 + clock["drift"]) * (1.0 + 1e-6 * ppm) / self._rate_hz
            first_s, begins_s = start_s + clock["offset_s"], self._begins[k]
            if k:
                self._from.append(self._parts[-1].tick_from(begins_s))
            first = self._from[k] + max(math.floor((first_s - begins_s) / period_s), 0)
            until = int((shot.truth["t_fire"] - clock["offset_s"] - _BASELINE_ENDS_S) * self._rate_hz)
            drawn = self._rng.integers(max(until, 1), size=round(_POOL_S * self._rate_hz))
            self._parts.append(_Part(raw, raw[:, drawn], first, first_s, period_s))
        said = tuple(_properties(spec, self._rate_hz) for spec in specs)
        self.content = RecorderContent(
            tuple(channels), said, self._rate_hz, form.values, self._parts[0].rest, 1e-3 * form.packet_ms
        )

    def items(self, steps: Sequence[ClockStep] = ()) -> Iterator[SampleItem]:
        """Yield packets in the order of their times; at each step of its clock its ticks jump.

        Packets begin where they begin: a step holds from the first one that begins at it or later.
        """
        ends = self._parts[-1].tick_from(self._timeline.end_s)
        count = self.content.packet_ticks
        for first in range(0, ends, count):
            behind = min(first + count, ends)
            began_s = self._part(first).at_s(first)
            jump = sum(round(step.step_s * self._rate_hz) for step in steps if step.at_s <= began_s)
            begins = tuple((k, p.first + jump) for k, p in enumerate(self._parts) if first <= p.first < behind)
            last = behind - 1
            yield SampleItem(self._part(last).at_s(last), first + jump, self._between(first, behind), begins)

    def _part(self, tick: int) -> _Part:
        return self._parts[int(np.searchsorted(self._from, tick, side="right")) - 1]

    def _between(self, first: int, behind: int) -> Raw:
        pieces, at = [], first
        while at < behind:
            part = self._part(at)
            k = self._parts.index(part)
            ends = min(behind, self._from[k + 1]) if k + 1 < len(self._from) else behind
            stored = part.first, part.first + part.raw.shape[1]
            if stored[0] <= at < stored[1]:
                to = min(ends, stored[1])
                pieces.append(part.raw[:, at - part.first : to - part.first])
            else:
                to = min(ends, stored[0]) if at < stored[0] else ends
                start = int(self._rng.integers(part.rest.shape[1] - min(to - at, part.rest.shape[1]) + 1))
                pieces.append(part.rest[:, (start + np.arange(to - at)) % part.rest.shape[1]])
            at = to
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)


def _stored(rig: Rig, source: Source, specs: Sequence[ChannelSpec], shot: TwinShot) -> list[Array]:
    """Read a shot's samples from the recorder's file, in its units."""
    path = shot.folder / shot.truth["sources"][source.name]["file"]
    recording = recognise(path, (source.kind,)).open(path, rig.declarations(source))
    return [recording.read(spec.signal) for spec in specs]


def _on_wire(spec: ChannelSpec, form: StreamForm, stored: Sequence[Array]) -> WireChannel:
    """Describe a channel as it is streamed; whole numbers share its range, or what its files hold."""
    own_ticks = spec.signal in form.own_ticks
    if form.values == "f32":
        return WireChannel(spec.signal, file_unit(spec), own_ticks=own_ticks)
    limits = range_si(spec)
    ends = np.concatenate(stored) if limits is None else to_file(np.array(limits), spec)
    low, high = float(ends.min()), float(ends.max())
    if limits is None:  # the highest one must be a whole number too
        high += (high - low or 1.0) / 1024
    factor = (high - low) / _STEPS_OF_24_BITS
    return WireChannel(spec.signal, file_unit(spec), factor, (low + high) / 2, own_ticks)


def _properties(spec: ChannelSpec, rate_hz: float) -> dict[str, str]:
    """Return what the recorder's commands say of a channel."""
    unit, limits = file_unit(spec), range_si(spec)
    low, high = (0.0, 0.0) if limits is None else sorted(to_file(np.array(limits), spec).tolist())
    return {
        "SampleRate": f'(SCALAR,{rate_hz!r},"Hz")',
        "Range": "NONE" if limits is None else f'(RANGE,{low!r},"{unit}",{high!r},"{unit}")',
        "Unit": f'(STRING,"{unit}")',
        "Used": '(STRING,"ON")',
        "LP_Filter_Freq": '(STRING,"Auto")',
        "Neon/Stored": '(STRING,"ON")',
        "Neon/Name": f'(STRING,"{spec.signal}")',
        "Neon/Active": '(STRING,"ON")',
    }
