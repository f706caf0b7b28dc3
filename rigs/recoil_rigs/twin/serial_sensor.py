"""The serial port of the virtual rig: a sensor with a clock of its own, and a host that stamps what it reads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import Fault, FaultCode, Row, did_you_mean
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.rig import Source
from recoil_rigs.twin.files import serial_capture
from recoil_rigs.twin.instruments import generator
from recoil_rigs.twin.sources import Clock, Scene, SourceFile, clock_truth, file_name, in_unit

SPOKEN = ("u8", "i8", "u16", "i16", "u24", "i24", "u32", "i32", "f32", "f64")
"""Types of the fields that a virtual sensor sends."""


def _unspoken(framing: Framing) -> Iterator[str]:
    """Name what of a framing a virtual sensor does not send."""
    if framing.kind != "sync":
        yield f"frames of kind {framing.kind!r}"
    if framing.length.fixed is None or len(framing.types) > 1:
        yield "frames of several lengths or types"
    if framing.checksum is not None and (framing.checksum.hexadecimal or framing.checksum.mark):
        yield "a checksum in text"
    odd = [field for field in framing.fields if field.type not in SPOKEN or field.bits is not None]
    yield from (f"field {field.name!r}, {'a slice' if field.bits else field.type}" for field in odd)
    if any(one is not None and one.modulo < 2 for one in (framing.counter, framing.device_time)):
        yield "a counter or a clock that never wraps"


def serial_file(scene: Scene, source: Source, faults: list[Fault]) -> SourceFile:
    """Record a serial sensor: binary frames with counter and device time, read in pieces, some damaged.

    The sensor samples by its own crystal; if its frames carry a device time, that is the source's clock,
    counted from the first frame. The host stamps what each read of the port returned by a clock of its
    own, which is the source's clock otherwise. The capture begins at host time 0 with the end of an older
    frame.
    """
    s = scene.settings
    framing = framing_from_table(source.framing or {})
    if unspoken := ", ".join(_unspoken(framing)):
        problem = f"a virtual sensor speaks `sync` frames of one fixed length only, no {unspoken}"
        faults.append(Fault((Row("source", source.name), "framing"), problem, FaultCode.VALUE))
        return SourceFile(source.name, "", b"", {})
    clock = scene.clock(source)
    rng = generator(scene.seed, "serial", source.name)
    device = Clock(clock.offset_s + 1e-3 * float(rng.uniform(2.0, 3.0)), s.clock_drift * float(rng.uniform(-1.0, 1.0)))
    device_times = scene.instants(device, s.serial_rate_hz)
    at = device.to_reference(device_times)
    if len(at) < 5 + s.serial_corrupted_frames:
        problem = f"{len(at)} frames in the record are too few to damage some"
        faults.append(Fault(("twin", "serial_rate_hz"), problem, FaultCode.CONTRADICTION))
        return SourceFile(source.name, "", b"", {})
    columns: dict[str, NDArray[Any]] = {}
    known = {f.name: f for f in framing.fields}
    for spec in (c for c in scene.rig.channels if c.source == source.name):
        if spec.signal not in known:
            problem = f"the framing has no field {spec.signal!r}; {did_you_mean(spec.signal, list(known))}"
            faults.append(Fault((Row("channel", spec.name), "signal"), problem, FaultCode.UNKNOWN))
            continue
        columns[spec.signal] = in_unit(scene.samples(spec, at), spec, known[spec.signal].unit)
    power_up = 0
    if framing.counter is not None:
        columns[framing.counter.field] = (
            int(rng.integers(framing.counter.modulo)) + np.arange(len(at))
        ) % framing.counter.modulo
    if framing.device_time is not None:
        power_up = int(rng.integers(framing.device_time.modulo))
        ticks = np.round(device_times / framing.device_time.tick_s).astype(np.int64)
        columns[framing.device_time.field] = (power_up + ticks) % framing.device_time.modulo
    frames = _frames(framing, columns, len(at))
    damaged = _damage(frames, scene, rng)
    wire_s = len(frames[0]) * 10 / s.serial_baudrate
    arrivals = clock.from_reference(at) + wire_s + rng.exponential(1.0, len(at)) * s.serial_jitter_s
    records = [(0, frames[0][-7:]), *_reads(frames, np.maximum.accumulate(arrivals), wire_s, rng)]
    host = {"offset_s": clock.offset_s, "drift": clock.drift, "latency_s": wire_s + s.serial_jitter_s}
    hidden: dict[str, Any] = {"clock": host}
    if framing.device_time is not None:
        hidden = {**clock_truth(device), "host_clock": host, "ticks_at_zero": power_up}
    hidden["damaged_frames"] = damaged
    return SourceFile(
        source.name, file_name(scene, source, ".rdlog", faults), serial_capture(source.name, records), hidden
    )


def _frames(framing: Framing, columns: dict[str, NDArray[Any]], count: int) -> list[bytes]:
    """Lay fields out into frames and close each with its checksum; fields without values are 0."""
    table = np.zeros((count, framing.length.fixed or 0), dtype=np.uint8)
    table[:, : len(framing.sync)] = np.frombuffer(framing.sync, np.uint8)
    for item in framing.fields:
        if item.name not in columns:
            continue
        kind, size, raw = item.type[0], item.size, columns[item.name]
        if (item.scale, item.offset) != (1.0, 0.0):
            raw = (raw - item.offset) / item.scale
        if kind != "f":
            # counters stay integers; measured values are rounded and kept within the field
            low, high = (0, 2 ** (8 * size) - 1) if kind == "u" else (-(2 ** (8 * size - 1)), 2 ** (8 * size - 1) - 1)
            raw = np.clip(np.round(raw), low, high).astype(np.int64)
        wide = raw.astype("<i8" if kind != "f" else f"<f{size}")
        octets = wide.view(np.uint8).reshape(count, -1)[:, :size]
        table[:, item.at : item.at + size] = octets[:, ::-1] if item.big_endian else octets
    return [framing.closed(row.tobytes()) for row in table]


def _damage(frames: list[bytes], scene: Scene, rng: np.random.Generator) -> list[int]:
    """Drop bytes from one frame and flip a bit in others; return which frames are damaged."""
    s = scene.settings
    chosen = rng.choice(np.arange(2, len(frames) - 2), 1 + s.serial_corrupted_frames, replace=False).tolist()
    damaged = []
    if s.serial_dropped_bytes:
        cut = frames[chosen[0]]
        start = int(rng.integers(2, max(3, len(cut) - s.serial_dropped_bytes)))
        frames[chosen[0]] = cut[:start] + cut[start + s.serial_dropped_bytes :]
        damaged.append(chosen[0])
    for i in chosen[1:]:
        place = int(rng.integers(8, len(frames[i])))
        frames[i] = frames[i][:place] + bytes([frames[i][place] ^ 0x10]) + frames[i][place + 1 :]
        damaged.append(i)
    return sorted(damaged)


def _reads(frames: list[bytes], arrivals: Array, wire_s: float, rng: np.random.Generator) -> list[tuple[int, bytes]]:
    """Return what the reads of the port returned and when, ns: mostly one frame, at times a part or more."""
    records: list[tuple[int, bytes]] = []
    held = b""
    for frame, arrival, chance in zip(frames, arrivals.tolist(), rng.random(len(frames)).tolist(), strict=True):
        if chance < 0.1:
            held += frame
            continue
        if chance > 0.9:
            cut = len(frame) // 3
            records.append((round((arrival - wire_s * (1 - cut / len(frame))) * 1e9), held + frame[:cut]))
            held, frame = b"", frame[cut:]  # noqa: PLW2901 - the rest of this frame is what the next read returns
        records.append((round(arrival * 1e9), held + frame))
        held = b""
    if held:
        records.append((round(float(arrivals[-1]) * 1e9), held))
    ordered: list[tuple[int, bytes]] = []
    for host_ns, data in records:
        earliest = ordered[-1][0] + 1 if ordered else 1
        ordered.append((max(host_ns, earliest), data))
    return ordered
