"""The virtual rig played in real time: what is played is known, and what is received is that."""

from __future__ import annotations

import dataclasses
import json
import os
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from recoil_acquisition.capture.cut import write_everything
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.clocks.host_clock import Anchor, anchor
from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import Block, Device, event_of
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.frames.can_rows import parse_rows
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import decode_fields, unwrap
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.readers.can.captured_bus import CanCaptureRecording
from recoil_acquisition.readers.can.decoding import bit_runs_of
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from recoil_rigs.twin.can_replay import can_items, with_bits
from recoil_rigs.twin.faults import ClockStep, Faults, Interval
from recoil_rigs.twin.player import TwinPlayer, is_virtual
from recoil_rigs.twin.serial_replay import SensorFrame, serial_items
from recoil_rigs.twin.timeline import DeviceClock, Timeline
from recoil_rigs.twin.transports import PseudoTerminal
from tests.builders.live_logs import append
from tests.builders.machine_stalls import MachineStalls

needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
COUNTER = "RecoilNode.counter"
NODE = 288
PORT_HOLDS_BYTES = 20_512
"""What the kernel takes for a pseudo-terminal that nobody reads; of that it counts 4,095 bytes as unread."""


@pytest.fixture(scope="module")
def rig() -> Rig:
    whole = load_rig("mixed")
    quick = whole.text.replace("sample_rate_hz = 50000.0", "sample_rate_hz = 20000.0")
    return parse_rig(quick, whole.path, whole.databases)


@pytest.fixture(scope="module")
def shots(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> list[TwinShot]:
    """Twice the same shot: a play does not mind."""
    return 2 * [simulate_shot(rig, tmp_path_factory.mktemp("shots") / "a", seed=3, shot="a")]


@dataclasses.dataclass
class Recorded:
    """What a play gave: blocks and devices by source, its truth, the host's clocks, and when it began on them."""

    blocks: Mapping[str, list[Block]]
    devices: Mapping[str, Device]
    truth: Mapping[str, Any]
    anchored: Anchor
    began_ns: int

    def events(self, source: str) -> list[str]:
        return [event_of(block).name for block in self.blocks[source] if block.kind == "event"]

    def node_counts(self) -> list[np.ndarray[Any, Any]]:
        """Return the counters of the node's frames, before the bus was lost and behind that."""
        parts: list[list[bytes]] = [[]]
        for block in self.blocks["can"]:
            if block.kind == "event" and event_of(block).name == "lost":
                parts.append([])
            elif block.kind == "can":
                parts[-1].append(block.payload)
        records = [parse_rows(b"".join(part)) for part in parts]
        return [one["data"][one["id"] == NODE, 6].astype(np.int64) for one in records]

    def capture(self, rig: Rig, source: str, folder: Path) -> Any:
        declared = rig.source(source)
        path = folder / f"{source}.rdlog"
        record = LiveRecord(rig.name, rig.text, "rig.toml", {}, self.anchored, (RecordedSource(source, declared.kind),))
        with LogWriter(folder / f"log of {source}", record.to_json(), 0) as writer:
            append(writer, record, self.blocks[source])
        write_everything(open_log(writer.folder), path, {})
        return CaptureReader().open(path, rig.declarations(declared))


def play(rig: Rig, shots: list[TwinShot], **options: Any) -> Recorded:
    anchored = anchor()
    blocks: dict[str, list[Block]] = {}
    devices, readers = {}, []
    with TwinPlayer(rig, shots, **options) as player:
        for name, table in player.devices.items():
            source = rig.source(name)
            blocks[name] = []
            framing = None if source.framing is None else framing_from_table(source.framing)
            database = rig.databases.get(str(source.database))
            declared = DeviceDeclarations(framing, database, source.counters or ())
            devices[name] = open_device(name, source.kind, table, declared)
            readers.append(DeviceReader(devices[name], blocks[name].append))
            readers[-1].start()
        player.start()
        assert player.wait(60)
        time.sleep(0.05)
        for reader in readers:
            reader.stop()
            assert reader.error is None
        assert not any(player.failures.values())
        truth = player.truth()
    json.dumps(truth)
    return Recorded(blocks, devices, truth["sources"], anchored, player.fired_ns[0] - round(1e9 * truth["fire_s"][0]))


@pytest.mark.real_time
def test_the_frames_of_a_bus_go_on_through_silence_and_shots(rig: Rig, shots: list[TwinShot]) -> None:
    timeline = Timeline.plan(2, 0.55, 0.3, 0.2)
    items = list(can_items(rig, rig.source("can"), shots, timeline, (), seed=1))
    times = np.array([item.at_s for item in items])
    assert (np.diff(times) >= 0).all()
    node = [item for item in items if item.identifier == NODE]
    assert [item.data[6] for item in node] == [n % 256 for n in range(len(node))]
    spacing = np.diff([item.at_s for item in node])
    assert spacing.min() > 2e-4
    assert spacing.max() < 1e-3
    sent = np.array([item.at_s for item in node])
    for part in np.split(sent, np.searchsorted(sent, timeline.boundaries_s()[1:])):
        # one beat through silence and shot: a frame is late by its wait for the bus, 0.2 ms at most
        assert np.ptp(part - 5e-4 * np.arange(part.size)) < 2.5e-4
    assert node[0].at_s < 1e-3
    assert node[-1].at_s > timeline.end_s - 1e-3
    with can.LogReader(shots[0].files[1]) as log:
        logged = [bytes(m.data)[:6] for m in log if m.arbitration_id == NODE]
    played = [item.data[:6] for item in node]
    assert sum(played[i : i + len(logged)] == logged for i in range(len(played))) == 2
    assert len({item.data[:6] for item in node[:200]}) > 50  # the quiet frames carry noise
    drift = shots[0].truth["clocks"]["can"]["drift"]
    stamps = np.array([item.stamp_s for item in node])
    own = np.array([item.at_s for item in node]) < timeline.boundaries_s()[1]
    np.testing.assert_allclose(stamps[own] * (1 + drift), np.array([i.at_s for i in node])[own], atol=1e-9)


def test_the_frames_of_a_sensor_are_good_and_count_through(rig: Rig, shots: list[TwinShot]) -> None:
    source = rig.source("imu")
    timeline = Timeline.plan(2, 0.55, 0.3, 0.2)
    items = list(serial_items(source, shots, timeline, (), seed=1))
    framing = framing_from_table(source.framing)
    frames = find_frames(framing, b"".join(item.data for item in items))
    whole = [item for item in items if item.whole]
    assert frames.begins.size == len(whole)
    series = decode_fields(framing, frames)
    counts = unwrap(series["counter"].raw.astype(np.int64), 65536)
    # two frames of each shot are damaged in its file and stay so
    assert counts[-1] + 1 == len(whole) + 4
    ticks = unwrap(series["device_time"].raw.astype(np.int64), 2**32) * 1e-6
    spacing = np.diff(ticks) / np.diff(counts)
    # between two shots the silence need not be a whole number of periods: in its middle the beat shifts
    (shifted,) = np.flatnonzero(np.abs(spacing - 1e-3) > 3e-6)
    assert abs(whole[shifted].at_s - timeline.boundaries_s()[1]) < 3e-3
    assert np.abs(spacing - 1e-3).max() <= 0.51e-3
    late = np.array([item.at_s for item in whole]) - ticks
    assert np.ptp(late) < 5e-3


def test_a_sensors_clock_steps_only_where_it_was_told_to(rig: Rig, shots: list[TwinShot]) -> None:
    source = rig.source("imu")
    timeline = Timeline.plan(1, 0.55, 0.3, 0.2)
    steps = (ClockStep(0.5, -0.25), ClockStep(0.8, 1.5))
    items = list(serial_items(source, shots[:1], timeline, steps, seed=1))
    layout = SensorFrame.of(source.framing or {})
    assert layout.clock is not None
    ticks = np.array([layout.get(item.data, layout.clock) for item in items if item.whole]) * 1e-6
    jumps = np.diff(ticks)[np.abs(np.diff(ticks) - 1e-3) > 0.01]
    np.testing.assert_allclose(jumps, [-0.249, 1.501], atol=1e-4)
    assert all(layout.is_whole(item.data) for item in items if item.whole)


@pytest.mark.real_time
@needs_pty
def test_everything_that_was_played_is_received(rig: Rig, shots: list[TwinShot], tmp_path: Path) -> None:
    got = play(rig, shots[:1], silence_before_s=0.2, silence_after_s=0.1)
    can_truth, imu_truth = got.truth["can"], got.truth["imu"]
    bus, port = got.devices["can"].counters, got.devices["imu"].counters
    assert bus.received == can_truth["sent"] == can_truth["frames"] > 1500
    assert (bus.bad, bus.counter_gaps, bus.error_frames) == (0, 0, 1)
    assert port.received == imu_truth["bytes_sent"]
    assert port.counter_gaps == 2  # of the two frames that are damaged in the shot's own file
    recording = got.capture(rig, "can", tmp_path)
    assert isinstance(recording, CanCaptureRecording)
    shot = shots[0]
    vendor = recorded_file(rig, shot, "can")
    for name in ("RecoilNode.p_brake", "RecoilNode.acc_recoil"):
        live, there = recording.read(name), vendor.read(name)
        first = next(i for i in range(live.size) if np.array_equal(live[i : i + there.size], there))
        step = np.diff(recording.time_base(name).times_s[first : first + there.size])
        np.testing.assert_allclose(step, np.diff(vendor.time_base(name).times_s), atol=2e-6)
    assert recording.clock_fit is not None
    assert recording.clock_fit.steps == ()
    assert abs(recording.clock_fit.drift) < 5e-3


def recorded_file(rig: Rig, shot: TwinShot, source: str) -> Any:
    from recoil_acquisition.readers.table import recognise

    path = shot.folder / shot.truth["sources"][source]["file"]
    return recognise(path).open(path, rig.declarations(rig.source(source)))


@pytest.mark.real_time
@needs_pty
def test_faults_are_counted_exactly_by_player_and_devices(rig: Rig, shots: list[TwinShot], tmp_path: Path) -> None:
    faults = {
        "can": Faults(
            lost_frames=0.02, error_frames=0.01, stalls=(Interval(0.35, 0.3),), clock_steps=(ClockStep(0.6, -0.2),)
        ),
        "imu": Faults(lost_frames=0.01, dropped_bytes=0.002, flipped_bytes=0.001, stalls=(Interval(0.4, 0.2),)),
    }
    with MachineStalls() as machine:
        got = play(rig, shots[:1], silence_before_s=0.2, silence_after_s=0.2, faults=faults, seed=5)
    can_truth, imu_truth = got.truth["can"], got.truth["imu"]
    bus, port = got.devices["can"].counters, got.devices["imu"].counters
    assert can_truth["lost"] > 5
    assert can_truth["error_frames"] > 5
    assert bus.received == can_truth["sent"] == can_truth["frames"] - can_truth["lost"]
    assert bus.error_frames == can_truth["error_frames"]
    recording = got.capture(rig, "can", tmp_path)
    assert recording.metadata["error_frames"] == can_truth["error_frames"]
    counts = recording.read(COUNTER).astype(np.int64)
    node_gaps = int(((np.diff(counts) % 256) - 1).sum())
    others = can_truth["lost"] - node_gaps
    assert 0 <= others < can_truth["lost"]
    assert 0 < (bus.counter_gaps or 0) <= node_gaps
    (step,) = recording.clock_fit.steps
    assert abs(step.step_s + 0.2) < max(6 * step.u_step_s, 5e-3, 2 * machine.largest_s)
    assert recording.clock_fit.largest_delay_s > 0.25
    assert np.diff(recording.time_base(COUNTER).times_s).max() < 0.02

    assert imu_truth["damaged"] > 5
    assert port.received == imu_truth["bytes_sent"]
    made = imu_truth["sent"] + imu_truth["damaged"] + imu_truth["lost"]
    assert made == imu_truth["frames"]
    port_check = got.capture(rig, "imu", tmp_path)
    # a damaged frame may still be whole if nothing but what lies between frames was hit: not so here
    assert port_check.metadata["received"] == imu_truth["sent"]
    missing = port_check.metadata["missing_frames"]
    assert missing == imu_truth["lost"] + imu_truth["damaged"] + 2


@pytest.mark.real_time
@needs_pty
def test_a_sensor_and_an_adapter_are_unplugged_in_the_shot_and_come_back(
    rig: Rig, shots: list[TwinShot], tmp_path: Path
) -> None:
    gone = Faults(unplugged=(Interval(0.4, 0.2),))
    got = play(
        rig,
        shots[:1],
        silence_before_s=0.2,
        silence_after_s=0.5,
        faults={"imu": gone, "can": gone},
        transports={"can": "slcan"},
    )
    for name in ("can", "imu"):
        # a machine that lets the reader wait says so besides
        assert [event for event in got.events(name) if event != "stalled"] == ["opened", "lost", "reopened", "closed"]
        assert got.devices[name].counters.reopened == 1
        truth = got.truth[name]
        assert truth["disconnects"] == 1
        assert truth["unplugged"] > 100
    # what the old port still held went with it, untold by the kernel: so there is one gap, and nothing else is missing
    lost = got.truth["can"]["sent"] - got.devices["can"].counters.received
    assert 0 <= lost <= PORT_HOLDS_BYTES / 22 + 1
    before, after = got.node_counts()
    for counts in (before, after):
        assert counts.size > 300
        assert (np.diff(counts) % 256 == 1).all()
    recording = got.capture(rig, "imu", tmp_path)
    read = recording.metadata["received"]
    # what the sensor said before the host had opened the new port is missing too, and the counter tells it
    truth = got.truth["imu"]
    assert recording.metadata["missing_frames"] == truth["frames"] + 2 - read
    reopened_ns = next(b.host_ns for b in got.blocks["imu"] if b.kind == "event" and event_of(b).name == "reopened")
    # nothing is played before its time, a thousand frames a second
    unheard = 1e3 * ((reopened_ns - got.began_ns) / 1e9 - gone.unplugged[0].end_s) + PORT_HOLDS_BYTES / 34
    assert truth["frames"] - truth["unplugged"] - unheard - 5 <= read <= truth["frames"] - truth["unplugged"]


@pytest.mark.real_time
@needs_pty
def test_nothing_is_left_behind(rig: Rig, shots: list[TwinShot]) -> None:
    threads = set(threading.enumerate())
    open_files = Path("/proc/self/fd")
    before = len(list(open_files.iterdir())) if open_files.exists() else 0
    player = TwinPlayer(rig, shots[:1], transports={"can": "slcan"})
    player.plug()
    links = [Path(player.devices["can"]["channel"]), Path(player.devices["imu"]["port"])]
    assert all(link.is_symlink() for link in links)
    device = open_device("can", "can", player.devices["can"])
    player.start()
    time.sleep(0.05)
    device.close()
    player.close()
    player.close()
    assert not player.playing
    assert set(threading.enumerate()) <= threads
    assert not any(link.parent.exists() for link in links)
    if open_files.exists():
        assert len(list(open_files.iterdir())) <= before


@needs_pty
def test_the_play_does_not_begin_before_the_adapter_is_opened(rig: Rig, shots: list[TwinShot]) -> None:
    with TwinPlayer(rig, shots[:1], transports={"can": "slcan"}) as player:
        assert player.fired_ns == ()
        with pytest.raises(TimeoutError, match="has not opened the device of 'can'"):
            player.start(ready_timeout_s=0.05)


@pytest.mark.real_time
@needs_pty
def test_the_play_says_when_each_shot_fires(rig: Rig, shots: list[TwinShot]) -> None:
    with TwinPlayer(rig, shots, silence_before_s=0.3, silence_after_s=0.1, speed=20.0) as player:
        readers = [
            DeviceReader(open_device(name, rig.source(name).kind, table), lambda _: None)
            for name, table in player.devices.items()
        ]
        for reader in readers:
            reader.start()
        now_ns = time.monotonic_ns()
        player.start()
        assert player.wait(10)
        for reader in readers:
            reader.stop()
        first, second = player.fired_ns
    lead_s = (first - now_ns) / 1e9 - 0.4 / 20
    assert 0 < lead_s < 0.5
    assert (second - first) / 1e9 == pytest.approx((0.3 + 0.55 + 0.1) / 20, abs=1e-3)


def test_what_makes_no_sense_is_refused(rig: Rig, shots: list[TwinShot]) -> None:
    with pytest.raises(ValueError, match="no source to play: nobody"):
        TwinPlayer(rig, shots, faults={"nobody": Faults()})
    with pytest.raises(ValueError, match="cannot be played over 'pigeon', only over virtual, slcan"):
        TwinPlayer(rig, shots, transports={"can": "pigeon"})
    with pytest.raises(ValueError, match="nothing to play"):
        TwinPlayer(rig, [])
    with pytest.raises(ValueError, match="speed must be positive"):
        TwinPlayer(rig, shots, speed=0.0)


def test_faults_are_read_from_a_table_and_checked() -> None:
    table = {"lost_frames": 0.01, "stalls": [[1.0, 0.5], [2, 1]], "clock_steps": [[1.5, -0.25]]}
    faults = Faults.from_table(table)
    assert faults.stalls == (Interval(1.0, 0.5), Interval(2.0, 1.0))
    assert faults.clock_steps == (ClockStep(1.5, -0.25),)
    for wrong, problem in (
        ({"lost": 0.1}, "no fault 'lost'"),
        ({"stalls": [[1.0]]}, "stalls"),
        ({"stalls": [[1.0, -1.0]]}, "stalls: an interval"),
        ({"lost_frames": 1.0}, "share from 0 to below 1"),
        ({"unplugged": [[1, 2], [2, 1]]}, "not overlap"),
        ({"clock_steps": [[float("nan"), 1]]}, "a step must be finite"),
    ):
        with pytest.raises(ValueError, match=problem):
            Faults.from_table(wrong)


def test_a_rig_says_which_sources_are_played_and_with_what_faults(rig: Rig, shots: list[TwinShot]) -> None:
    def with_device(table: str) -> Rig:
        text = rig.text.replace('device = { virtual = "virtual" }', f"device = {table}", 1)
        return parse_rig(text, rig.path, rig.databases)

    played = with_device('{ virtual = "slcan", faults = { lost_frames = 0.25 } }')
    assert is_virtual(played.source("can"))
    assert is_virtual(played.source("imu"))
    assert not is_virtual(with_device('{ interface = "socketcan", channel = "can0" }').source("can"))
    player = TwinPlayer(played, shots)
    assert player.devices["can"]["interface"] == "slcan"
    assert player.truth()["sources"]["can"]["faults"]["lost_frames"] == 0.25
    player.close()
    with pytest.raises(ValueError, match=r"source 'can'.device.faults: there is no fault 'lost'"):
        TwinPlayer(with_device('{ virtual = "virtual", faults = { lost = 1 } }'), shots)


def test_a_devices_clock_follows_each_shots_drift_without_a_jump() -> None:
    clock = DeviceClock((0.0, 2.0), (1e-3, -1e-3), (ClockStep(3.0, 0.5),))
    assert clock.at(0.0) == 0.0
    assert clock.at(2.0) - clock.at(2.0 - 1e-9) < 1e-8
    assert clock.at(1.0) == pytest.approx(1 / 1.001)
    assert clock.at(2.5) == pytest.approx(2 / 1.001 + 0.5 / 0.999)
    assert clock.at(3.0) - clock.at(3.0 - 1e-9) == pytest.approx(0.5)


def test_a_counter_is_put_into_its_bits_alone() -> None:
    for little_endian, start in ((True, 12), (False, 11)):
        pieces = bit_runs_of(start, 10, little_endian=little_endian)
        for value in (0, 1, 513, 1023):
            data = with_bits(b"\xff" * 8, pieces, value)
            assert sum(bin(byte).count("0") - 1 for byte in data) >= 0
            from recoil_acquisition.readers.can.decoding import gather

            rows = np.frombuffer(data, dtype=np.uint8).reshape(1, 8)
            assert int(gather(rows, pieces)[0]) == value
            assert sum(byte.bit_count() for byte in data) == 54 + value.bit_count()


def test_a_pseudo_terminal_gives_up_a_write_when_it_is_taken_away() -> None:
    if not hasattr(os, "openpty"):
        pytest.skip("this system has no pseudo-terminals")
    port = PseudoTerminal("imu")
    port.plug()
    results: list[bool] = []
    writer = threading.Thread(target=lambda: results.append(port.write(bytes(1_000_000))))
    writer.start()
    time.sleep(0.05)
    port.abort()
    writer.join(2.0)
    port.close()
    assert results == [False]
