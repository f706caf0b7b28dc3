"""The CAN bus of the virtual rig: a node with a clock of its own, other nodes, an error frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.errors import Fault, FaultCode, ReadError, Row, did_you_mean, nearest_first
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.readers.can.messages import load_database
from recoil_rigs.rig import ChannelSpec, Source
from recoil_rigs.twin.files import CanFrame, can_log
from recoil_rigs.twin.instruments import generator
from recoil_rigs.twin.sources import Clock, Scene, SourceFile, clock_truth, file_name, in_unit

_LONGEST_WAIT_S = 2e-4
_FOREIGN = ((0x18FEF100, True, 0.01), (0x0C1, False, 0.02), (0x7DF, False, 0.1))
"""Frames of other nodes on the bus: identifier, whether extended, period in s."""


def can_files(scene: Scene, sources: Sequence[Source], faults: list[Fault]) -> list[SourceFile]:
    """Record CAN buses, those that share a file into one: of one ``match``, each with the number of its bus."""
    shared: dict[object, list[Source]] = {}
    for source in sources:
        shared.setdefault(source.name if source.bus is None else (source.match,), []).append(source)
    files: dict[str, SourceFile] = {}
    for together in shared.values():
        recorded = [can_frames(scene, source, faults) for source in together]
        name = file_name(scene, together[0], f".{scene.settings.can_format}", faults)
        content = can_log([frame for frames, _ in recorded for frame in frames], scene.settings.can_format)
        for source, (_, hidden) in zip(together, recorded, strict=True):
            files[source.name] = SourceFile(source.name, name, content, hidden)
    return [files[source.name] for source in sources]


def can_frames(scene: Scene, source: Source, faults: list[Fault]) -> tuple[list[CanFrame], dict[str, Any]]:
    """Return the frames of a CAN bus, and what they hide.

    One node sends its messages at its own rate; there are other nodes, and one error frame.

    The node samples by its own crystal; the interface stamps the end of each frame by its own clock, which
    is the source's clock. A frame waits for the bus for an exponential time of at most 0.2 ms.
    """
    s = scene.settings
    bus = 1 if source.bus is None else source.bus
    if not isinstance(bus, int) or bus < 1:
        problem = "a virtual log numbers its buses from 1"
        faults.append(Fault((Row("source", source.name), "bus"), problem, FaultCode.VALUE))
        bus = 1
    clock = scene.clock(source)
    rng = generator(scene.seed, "can", source.name)
    try:
        messages = load_database(scene.rig.databases[str(source.database)], Path(str(source.database))).messages
    except ReadError as error:
        faults.append(Fault((Row("source", source.name), "database"), str(error), FaultCode.FILE))
        messages = ()
    node = Clock(clock.offset_s + 1e-3 * float(rng.uniform(1.0, 2.0)), s.clock_drift * float(rng.uniform(-1.0, 1.0)))
    at = node.to_reference(scene.instants(node, s.can_rate_hz))
    by_message: dict[str, list[ChannelSpec]] = {}
    for spec in (c for c in scene.rig.channels if c.source == source.name):
        by_message.setdefault(spec.signal.partition(".")[0], []).append(spec)
    frames: list[CanFrame] = []
    latencies = [0.0]
    names = {m.name: m for m in messages}
    wait_s = 0.0
    for name, specs in by_message.items():
        message = names.get(name)
        if message is None:
            problem = f"no message {name!r}; the database has {', '.join(nearest_first(name, list(names))[:5])}"
            faults.append(Fault((Row("channel", specs[0].name), "signal"), problem, FaultCode.UNKNOWN))
            continue
        payloads = _payloads(scene, message, specs, at, faults)
        # 47 bits of frame around the payload, and a stuff bit in ten
        wait_s += (47 + 8 * message.length) * 1.1 / s.can_bitrate_hz
        waits = np.minimum(rng.exponential(1.0, len(at)) * s.can_jitter_s, _LONGEST_WAIT_S)
        stamps = clock.from_reference(at) + wait_s + waits
        latencies.append(float(wait_s + waits.mean()))
        frames += [
            CanFrame(round(stamp, 9), message.frame_id, message.is_extended_frame, data, bus)
            for stamp, data in zip(stamps.tolist(), payloads, strict=True)
        ]
    last = max((f.stamp_s for f in frames), default=0.1)
    for identifier, extended, period in _FOREIGN:
        stamps = np.arange(0.0, last, period) + rng.uniform(0.0, 0.1 * period)
        if identifier == _FOREIGN[0][0]:
            stamps[0] = 0.0  # the log begins with this frame
        frames += [CanFrame(round(t, 9), identifier, extended, rng.bytes(8), bus) for t in stamps.tolist()]
    frames.append(CanFrame(round(0.6 * last, 9), 0, False, None, bus))
    return frames, clock_truth(clock, latency_s=max(latencies))


def _payloads(scene: Scene, message: Any, specs: list[ChannelSpec], at: Array, faults: list[Fault]) -> list[bytes]:
    """Encode a message's samples; signals of no channel are 0, a counter counts."""
    signals = {signal.name: signal for signal in message.signals}
    columns: dict[str, Array] = {name: np.zeros(len(at)) for name in signals}
    for name, signal in signals.items():
        if name.casefold().endswith("counter"):
            columns[name] = np.arange(len(at)) % 2.0**signal.length
    for spec in specs:
        name = spec.signal.partition(".")[2]
        if name not in signals:
            problem = f"{message.name} has no {name!r}; {did_you_mean(name, list(signals))}"
            faults.append(Fault((Row("channel", spec.name), "signal"), problem, FaultCode.UNKNOWN))
            continue
        signal = signals[name]
        values = in_unit(scene.samples(spec, at), spec, signal.unit or "")
        highest = 2 ** (signal.length - signal.is_signed) - 1
        lowest = -(2 ** (signal.length - 1)) if signal.is_signed else 0
        raw = np.clip(np.round((values - signal.offset) / signal.scale), lowest, highest)
        columns[name] = raw
    rows = np.column_stack(list(columns.values())).astype(np.int64).tolist()
    # raw counts go in, so that no rounding but this one takes place
    return [message.encode(dict(zip(columns, row, strict=True)), scaling=False, strict=False) for row in rows]
