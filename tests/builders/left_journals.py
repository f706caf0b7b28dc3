"""Journals that a crash left over: the inertial sensor of the rig ``mixed`` sends its time, the bus is silent."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from recoil_acquisition.capture.session_record import CompleteShot, Kept, LiveRecord, RecordedSource
from recoil_acquisition.devices.device import SERIAL, Block, event_block
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.trigger import Decision
from recoil_rigs.rig import load_rig
from tests.builders.live_logs import append, stream_in
from tests.builders.live_sources import ANCHOR

RIG = load_rig("mixed")
RECORD = LiveRecord(
    RIG.name, RIG.text, str(RIG.path), dict(RIG.databases), ANCHOR,
    (RecordedSource("can", "can"), RecordedSource("imu", "serial")),
)  # fmt: skip
NAME = "20260504T101112.000000Z"


def imu(time_s: float) -> Block:
    return Block("imu", round(time_s * 1e9), f"{time_s:8.2f}".encode(), SERIAL)


def leave_journal(
    out: Path,
    *,
    triggers_s: tuple[float, ...] = (),
    disarmed_s: tuple[float, ...] = (),
    known: tuple[CompleteShot, ...] = (),
    kept: tuple[Kept, ...] = (),
    closed: bool = False,
) -> Path:
    """The inertial sensor sends its time every 10 ms from 10 s to 15 s; the bus is silent."""
    folder = out / "journal" / NAME
    writer = LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 20)
    append(writer, RECORD, [event_block("imu", int(10e9), "opened", "x"), *(imu(10.0 + 0.01 * k) for k in range(500))])
    for time_s in triggers_s:
        decision = Decision(time_s, "trigger", "", "p_brake", 0, 1, 2e6, time_s)
        writer.say(Kind.DECISION, round(time_s * 1e9), asdict(decision))
    for time_s in disarmed_s:
        decision = Decision(time_s, "suppressed", "not armed", "p_brake", 0, 1, 2e6, time_s)
        writer.say(Kind.DECISION, round(time_s * 1e9), asdict(decision))
    for stretch in kept:
        writer.say(Kind.KEPT, round(stretch.last_s * 1e9), asdict(stretch))
    for shot in known:
        writer.say(Kind.SHOT, round(shot.trigger_s * 1e9), asdict(shot))
    writer.close(in_order=closed)
    return folder


def times_in(path: Path) -> list[float]:
    stream = stream_in(path, "imu")
    return [float(stream[at : at + 8]) for at in range(0, len(stream), 8)]
