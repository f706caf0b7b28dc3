"""The bytes of a virtual serial sensor over a whole play: shots as their captures hold them, and baseline between."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.field import Field
from recoil_acquisition.frames.framing import DeviceTime, Framing, PacketCounter
from recoil_acquisition.frames.scan import PortStream
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.record import Kind
from recoil_rigs.rig import Source
from recoil_rigs.twin import TwinShot
from recoil_rigs.twin.faults import ClockStep
from recoil_rigs.twin.timeline import DeviceClock, Timeline

_BASELINE_ENDS_S = 5e-3


@dataclass(frozen=True, slots=True)
class SerialItem:
    """Bytes that the sensor sends at once.

    Attributes
    ----------
    at_s
        Instant at which the last byte has come over the line, on the play's clock.
    whole
        Whether it is a good frame; else bytes between frames.
    """

    at_s: float
    data: bytes
    whole: bool


@dataclass(frozen=True)
class _Place:
    """A whole number in a frame, which wraps at a modulus."""

    field: Field
    modulo: int

    @property
    def order(self) -> Literal["big", "little"]:
        """Order of its bytes."""
        return "big" if self.field.big_endian else "little"


@dataclass(frozen=True)
class SensorFrame:
    """Frames of the virtual sensor: of the rig's framing, with the places of their counter and their clock."""

    framing: Framing

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> SensorFrame:
        """Take the frames from a framing that the twin could simulate."""
        return cls(framing_from_table(table))

    @cached_property
    def counter(self) -> _Place | None:
        """The place of the count; None if frames are not counted."""
        return self._place(self.framing.counter)

    @cached_property
    def clock(self) -> _Place | None:
        """The place of the sensor's own time; None if frames have none."""
        return self._place(self.framing.device_time)

    def _place(self, of: PacketCounter | DeviceTime | None) -> _Place | None:
        return None if of is None else _Place(next(f for f in self.framing.fields if f.name == of.field), of.modulo)

    @property
    def tick_s(self) -> float:
        """Tick of the sensor's clock."""
        return 1.0 if self.framing.device_time is None else self.framing.device_time.tick_s

    def is_whole(self, frame: bytes) -> bool:
        """Return whether bytes are a good frame."""
        if len(frame) != self.framing.length.fixed or not frame.startswith(self.framing.sync):
            return False
        return self.framing.checksum is None or self.framing.checksum.holds(frame)

    def get(self, frame: bytes, place: _Place) -> int:
        """Return a whole number of a frame."""
        return int.from_bytes(frame[place.field.at : place.field.at + place.field.size], place.order)

    def put(self, frame: bytes, place: _Place | None, value: int) -> bytes:
        """Return a frame with another number in it, its checksum not yet right."""
        if place is None:
            return frame
        at, size = place.field.at, place.field.size
        return frame[:at] + (value % place.modulo).to_bytes(size, place.order) + frame[at + size :]

    def stamped(self, frame: bytes, count: int, ticks: int) -> bytes:
        """Return a frame with another count and time, and the checksum of that."""
        return self.framing.closed(self.put(self.put(frame, self.counter, count), self.clock, ticks))

    def split(self, stream: bytes) -> list[tuple[int, bytes, bool]]:
        """Cut a stream into good frames and what lies between; each with the byte behind it."""
        pieces: list[tuple[int, bytes, bool]] = []
        done = at = 0
        length = self.framing.length.of(b"")
        while (at := stream.find(self.framing.sync, at)) >= 0:
            frame = stream[at : at + length]
            if not self.is_whole(frame):
                at += 1
                continue
            if at > done:
                pieces.append((at, stream[done:at], False))
            at = done = at + length
            pieces.append((at, frame, True))
        if done < len(stream):
            pieces.append((len(stream), stream[done:], False))
        return pieces


@dataclass(frozen=True)
class _Piece:
    """Bytes of a capture: when they arrived and were sampled, and their frame's number; -1 between frames."""

    arrived_s: float
    sampled_s: float
    data: bytes
    number: int


@dataclass(frozen=True)
class _Recorded:
    """One shot's capture on the play's clock."""

    pieces: list[_Piece]
    baseline: list[bytes]
    period_s: float
    drift: float
    latency_s: float

    @property
    def first_s(self) -> float:
        """The instant at which the first frame was sampled."""
        return next(piece.sampled_s for piece in self.pieces if piece.number >= 0)

    @property
    def last_s(self) -> float:
        """The instant at which the last frame was sampled."""
        return next(piece.sampled_s for piece in reversed(self.pieces) if piece.number >= 0)


def serial_items(
    source: Source, shots: Sequence[TwinShot], timeline: Timeline, steps: Sequence[ClockStep], seed: int
) -> Iterator[SerialItem]:
    """Yield what a serial sensor says, in the order of its times.

    Between shots it goes on at its own period with its baseline frames before the shot, drawn at random.
    Counter and clock run through; bytes that the twin damaged stay damaged, and their count is missing.

    Parameters
    ----------
    steps
        Steps of the sensor's clock.
    """
    layout = SensorFrame.of(source.framing or {})
    recorded = [
        _recorded(layout, source, shot, start_s) for shot, start_s in zip(shots, timeline.starts_s, strict=True)
    ]
    clock = DeviceClock(timeline.boundaries_s(), [r.drift for r in recorded], steps)
    rng = np.random.default_rng([seed, *source.name.encode()])
    power_up = int(rng.integers(2**31))

    def frame(data: bytes, number: int, sampled_s: float) -> bytes:
        return layout.stamped(data, number, power_up + round(clock.at(sampled_s) / layout.tick_s))

    def quiet_frame(part: _Recorded, number: int, sampled_s: float) -> SerialItem:
        drawn = part.baseline[int(rng.integers(len(part.baseline)))]
        return SerialItem(sampled_s + part.latency_s, frame(drawn, number, sampled_s), whole=True)

    count, last_s = 0, -math.inf
    for shot, part in enumerate(recorded):
        for sampled_s in timeline.quiet_before_s(shot, part.first_s, part.period_s, last_s):
            yield quiet_frame(part, count, sampled_s)
            count += 1
        base = count
        for piece in part.pieces:
            if piece.number < 0:
                yield SerialItem(piece.arrived_s, piece.data, whole=False)
                continue
            data = frame(piece.data, base + piece.number, piece.sampled_s)
            yield SerialItem(piece.arrived_s, data, whole=True)
            count = base + piece.number + 1
        last_s = part.last_s
        for sampled_s in timeline.quiet_behind_s(shot, last_s, part.period_s):
            yield quiet_frame(part, count, sampled_s)
            count += 1
            last_s = sampled_s


def _recorded(layout: SensorFrame, source: Source, shot: TwinShot, start_s: float) -> _Recorded:
    """Read a shot's capture and put its pieces on the play's clock."""
    truth = shot.truth["sources"][source.name]
    host = truth.get("host_clock", truth["clock"])
    records = read_capture(shot.folder / truth["file"]).records
    capture = PortStream.of_reads((one.host_ns, one.payload) for one in records if one.kind == Kind.SERIAL)
    cut = layout.split(capture.stream)
    reads = np.searchsorted(capture.ends, [end for end, _, _ in cut], side="left")
    read_s = capture.host_ns[np.minimum(reads, capture.host_ns.size - 1)] / 1e9
    arrived_s = (start_s + (1.0 + host["drift"]) * read_s + host["offset_s"]).tolist()
    latency_s = float(host.get("latency_s", 0.0))
    numbers = iter(_numbers(layout, [data for _, data, whole in cut if whole]))
    pieces = []
    for at_s, (_, data, whole) in zip(arrived_s, cut, strict=True):
        sampled_s = at_s - latency_s
        if whole and layout.clock is not None:
            ticks = (layout.get(data, layout.clock) - truth["ticks_at_zero"]) % layout.clock.modulo
            device_s = ticks * layout.tick_s
            sampled_s = start_s + (1.0 + truth["clock"]["drift"]) * device_s + truth["clock"]["offset_s"]
        pieces.append(_Piece(at_s, sampled_s, data, next(numbers) if whole else -1))
    frames = [piece for piece in pieces if piece.number >= 0]
    until_s = start_s + shot.truth["t_fire"] - _BASELINE_ENDS_S
    return _Recorded(
        pieces,
        [piece.data for piece in frames if piece.sampled_s < until_s] or [frames[0].data],
        (frames[-1].sampled_s - frames[0].sampled_s) / (frames[-1].number - frames[0].number),
        truth["clock"]["drift"],
        latency_s,
    )


def _numbers(layout: SensorFrame, frames: list[bytes]) -> list[int]:
    """Count the frames from 0 by their counter, so that a missing one leaves its number out."""
    if layout.counter is None:
        return list(range(len(frames)))
    counts = [layout.get(frame, layout.counter) for frame in frames]
    numbers = [0]
    for before, after in pairwise(counts):
        numbers.append(numbers[-1] + (after - before) % layout.counter.modulo)
    return numbers
