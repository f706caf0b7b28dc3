"""A shot whose bus was stamped by a host, packet by packet: dated by its counter, or the cause is named."""

from __future__ import annotations

import math
from pathlib import Path

import can
import pytest

from recoil_acquisition.shot.causes import shot_findings
from recoil_daq import ingest_files
from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.twin import TwinShot

PACKET_S, APART_S = 16e-3, 1.2e-4


@pytest.fixture
def in_packets(mixed_shot: TwinShot, tmp_path: Path) -> list[Path]:
    """The shot's files, the bus's with the stamps of a host that reads packets of its adapter."""
    log = next(file for file in mixed_shot.files if "_can." in file.name)
    with can.LogReader(log) as reader:
        messages = sorted(reader, key=lambda message: message.timestamp)
    zero_s, counts = messages[0].timestamp, dict[int, int]()
    path = tmp_path / "0001_can.asc"
    with can.Logger(path) as writer:
        for message in messages:
            packet = math.ceil((message.timestamp - zero_s) / PACKET_S + 1e-9)
            counts[packet] = counts.get(packet, 0) + 1
            message.timestamp = zero_s + PACKET_S * packet + APART_S * counts[packet]
            writer(message)
    return [*(file for file in mixed_shot.files if file != log), path]


@pytest.mark.whole_way
@pytest.mark.parametrize("counted", [True, False])
def test_a_bus_in_bursts_is_dated_by_its_counter_or_named_as_the_cause(
    counted: bool, in_packets: list[Path], tmp_path: Path
) -> None:
    text = find_rig("mixed").read_text(encoding="utf-8")
    text = text if counted else text.replace('counters = ["RecoilNode.counter"]', "")
    shot = ingest_files(parse_rig(text, find_rig("mixed")), in_packets, out=tmp_path).shot
    of_bus = {(check.check, check.verdict): check.detail for check in shot.quality if check.channel == "can"}
    assert shot.usable is counted
    if counted:
        assert ("alignment", "ok") in of_bus
        return
    assert "declare a signal that counts them in `counters`" in of_bus["late stamps", "warn"]
    assert "stamps come in bursts, 32 within" in of_bus["alignment", "fail"]
    # the cause is said once, with its own remedy, and what follows from it stays readable
    (reason,) = shot.reasons
    assert "declare a signal that counts them in `counters`; this explains 5 more" in reason
    notes = [one["code"] for one in shot_findings(shot.quality, shot.against_mass, shot.subjects)
             if one["severity"] == "note" and one["code"] != "reader"]  # fmt: skip
    # the stream is the imu's, and behind its missing frames
    assert sorted(notes) == ["alignment", "role", "role", "stream", "time steps", "time steps"]
    assert not any("overlap" in reason for reason in shot.reasons)
