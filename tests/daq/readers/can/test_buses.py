"""One identifier on two buses: two signals in every format of a log, and the one that is asked for."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np
import pytest

from recoil_acquisition.capture.can_signals import CanSignals
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.devices.can_device import CanDevice, delivers_several_buses
from recoil_acquisition.devices.device import CAN, Block
from recoil_acquisition.errors import ReadError
from recoil_acquisition.frames.can_rows import ROW_SIZE, parse_rows
from recoil_acquisition.readers.can.buses import bus_number
from recoil_acquisition.readers.can.recording import CanRecording
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from tests.builders import can_captures
from tests.builders.can_rows import pack_row
from tests.builders.mdf_logs import bus_log, sourced_log
from tests.builders.shared_data import shared_file

IMU = 'VERSION ""\nBO_ 256 IMU: 8 X\n SG_ Accel : 0|16@1- (0.01,0) [0|0] "g" X\n'
TWICE = IMU + 'BO_ 512 IMU: 8 X\n SG_ Accel : 0|16@1- (0.01,0) [0|0] "g" X\n'
ZERO_S = 1_700_000_000.0
FIRST, SECOND = [0.01 * k for k in range(1, 9)], [-5.0] * 8


def messages(second_late_s: float = 3e-4) -> list[can.Message]:
    """Frames of two nodes with one identifier; those of the second bus come in the same instants if not late."""
    found = []
    for k in range(8):
        for channel, value in ((0, k + 1), (1, -500)):
            data = value.to_bytes(2, "little", signed=True) + bytes(6)
            at_s = ZERO_S + 0.01 * k + second_late_s * channel
            frame = can.Message(timestamp=at_s, arbitration_id=0x100, is_extended_id=False, data=data, channel=channel)
            found.append(frame)
    return found


def written(path: Path, second_late_s: float = 3e-4) -> Path:
    """A log of both buses; the format follows from the ending."""
    if path.suffix == ".mf4":
        frames = [(m.timestamp, m.channel + 1, m.arbitration_id, bytes(m.data)) for m in messages(second_late_s)]
        path.write_bytes(two_bus_mdf(frames))
        return path
    with can.Logger(path) as writer:
        for message in messages(second_late_s):
            message.channel = f"can{message.channel}" if path.suffix == ".log" else message.channel
            writer(message)
    return path


def two_bus_mdf(frames: list[tuple[float, int, int, bytes]]) -> bytes:
    entries = [(round((at_s - ZERO_S) * 1e9), key, data) for at_s, _, key, data in frames]
    return bus_log(entries, buses=[bus for _, bus, _, _ in frames])


def opened(path: Path, database: str = IMU, **declared: int | str) -> CanRecording:
    reader = surest_claim(Head.of(path))[1][0]
    recording = reader.open(path, Declarations("can", database=database, **declared))  # type: ignore[arg-type]
    assert isinstance(recording, CanRecording)
    return recording


NAMED = {".log": ("can0", "can1")}
NUMBERED = {".asc": ("1", "2"), ".blf": ("1", "2"), ".trc": ("1", "2"), ".mf4": ("1", "2")}
ALL = {**NAMED, **NUMBERED}


@pytest.mark.parametrize("late_s", [3e-4, 0.0])
@pytest.mark.parametrize("suffix", ALL)
def test_two_nodes_of_one_identifier_are_two_signals(suffix: str, late_s: float, tmp_path: Path) -> None:
    recording = opened(written(tmp_path / f"a{suffix}", late_s))
    one, other = (f"IMU.Accel@{bus}" for bus in ALL[suffix])
    assert [header.name for header in recording.signals] == [one, other]
    assert recording.read(one).tolist() == pytest.approx(FIRST)
    assert recording.read(other).tolist() == SECOND
    late = recording.time_base(other).times_s - recording.time_base(one).times_s
    assert late == pytest.approx(np.full(8, late_s), abs=1e-5)
    assert any("IMU: came on several buses" in note for note in recording.notes)
    assert recording.metadata["buses"] == dict.fromkeys(ALL[suffix], 8)
    with pytest.raises(ReadError, match=rf"'IMU.Accel' came on the buses .*{one}.*set `bus = .*`signal` in the rig"):
        recording.read("IMU.Accel")


@pytest.mark.parametrize("suffix", ALL)
def test_a_source_takes_the_bus_that_it_names(suffix: str, tmp_path: Path) -> None:
    path = written(tmp_path / f"a{suffix}", 0.0)
    first, second = ALL[suffix]
    for bus, expected in ((first, FIRST), (second, SECOND), (bus_number(first), FIRST), (bus_number(second), SECOND)):
        assert bus is not None
        recording = opened(path, bus=bus)
        assert recording.read("IMU.Accel").tolist() == pytest.approx(expected)
        assert recording.read(f"IMU.Accel@{first if expected is FIRST else second}").size == 8
        assert not any("several buses" in note for note in recording.notes)
        assert recording.metadata["buses"] == dict.fromkeys(ALL[suffix], 8)
    with pytest.raises(ReadError, match=rf"no bus 7; found {first} \(8 frames\), {second} \(8 frames\); correct `bus`"):
        opened(path, bus=7)
    with pytest.raises(ReadError, match=r"no bus 'motor', whose buses have (names|numbers)"):
        opened(path, bus="motor")


def test_a_number_that_fits_two_names_is_not_guessed(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("(1.000000) can0 100#0100\n(1.100000) vcan0 100#0200\n")
    with pytest.raises(ReadError, match="bus 0 may be any of can0, vcan0"):
        opened(path, bus=0)
    assert opened(path, bus="vcan0").read("IMU.Accel").tolist() == [0.02]


@pytest.mark.parametrize("suffix", [".csv", ".db"])
def test_a_format_without_buses_says_so_and_refuses_to_choose_one(suffix: str, tmp_path: Path) -> None:
    path = written(tmp_path / f"a{suffix}")
    assert any("does not store on which bus" in note for note in opened(path).notes)
    with pytest.raises(ReadError, match="does not store on which bus a frame came"):
        opened(path, bus=1)


@pytest.mark.parametrize("suffix", ALL)
def test_a_message_of_one_bus_keeps_its_name(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    other = [m for m in messages() if m.channel == 0]
    for message in messages():
        if message.channel == 1:
            message.arbitration_id = 0x300
            other.append(message)
    other.sort(key=lambda message: message.timestamp)
    if suffix == ".mf4":
        path.write_bytes(two_bus_mdf([(m.timestamp, m.channel + 1, m.arbitration_id, bytes(m.data)) for m in other]))
    else:
        with can.Logger(path) as writer:
            for message in other:
                message.channel = f"can{message.channel}" if suffix == ".log" else message.channel
                writer(message)
    recording = opened(path)
    assert [header.name for header in recording.signals] == ["IMU.Accel"]
    assert recording.read(f"IMU.Accel@{ALL[suffix][0]}").tolist() == pytest.approx(FIRST)


def test_the_log_of_two_nodes() -> None:
    path, database = shared_file("reports/two_bus.log"), shared_file("reports/two_bus.dbc").read_text()
    recording = opened(path, database)
    assert recording.read("IMU.Accel@can0").tolist() == list(range(1, 9))
    assert recording.read("IMU.Accel@can1").tolist() == SECOND
    assert recording.time_base("IMU.Accel@can1").times_s == pytest.approx(3e-4 + 0.01 * np.arange(8))


def test_the_log_of_two_messages_of_one_name() -> None:
    path, database = shared_file("reports/dup_msg.log"), shared_file("reports/dup_msg.dbc").read_text()
    recording = opened(path, database)
    assert recording.read("IMU#0x100.Accel").tolist() == list(range(1, 9))
    assert recording.read("IMU#0x200.Accel").tolist() == SECOND
    assert recording.time_base("IMU#0x200.Accel").times_s == pytest.approx(5e-3 + 0.01 * np.arange(8))
    assert any("messages of one name in the database" in note for note in recording.notes)
    with pytest.raises(ReadError, match=r"'IMU.Accel' is of several messages; found 'IMU#0x100.Accel', 'IMU#0x200"):
        recording.read("IMU.Accel")


def capture_rows(channels: tuple[int, ...]) -> bytes:
    return b"".join(
        pack_row(device_ns=0, host_ns=10_000_000 * (k + 1) + 1000 * i, identifier=0x100, flags=0, channel=channel,
                 data=(100 * (i + 1)).to_bytes(2, "little") + bytes(6))
        for k in range(4) for i, channel in enumerate(channels)
    )  # fmt: skip


def live(database: str = IMU, signal: str = "IMU.Accel", bus: int | str | None = None) -> CanSignals:
    channel = LiveChannel("a", signal, 1.0, 0.0, "m/s2")
    return CanSignals(LiveSource("can", "can", {}, (channel,), database=database, bus=bus), (channel,))


@pytest.mark.parametrize(("bus", "expected"), [(4, 1.0), ("can5", 2.0)])
def test_of_a_device_of_several_buses_one_is_watched(bus: int | str, expected: float) -> None:
    block = Block("can", 50_000_000, capture_rows((4, 5)), CAN)
    (samples,) = live(bus=bus).feed(block)
    assert samples.values.tolist() == [expected] * 4


def test_two_messages_of_one_name_are_not_mixed_live() -> None:
    with pytest.raises(ReadError, match=r"'IMU.Accel' is of several messages of the CAN database"):
        live(TWICE)
    (samples,) = live(TWICE, "IMU#0x100.Accel").feed(Block("can", 50_000_000, capture_rows((0,)), CAN))
    assert samples.values.tolist() == [1.0] * 4


@pytest.mark.parametrize(
    ("table", "several"),
    [
        ({"interface": "socketcan", "channel": "can0"}, False),
        ({"interface": "socketcan"}, True),
        ({"interface": "socketcan", "channel": ""}, True),
        ({"interface": "kvaser", "channel": 0}, False),
        ({"interface": "vector", "channel": [0]}, False),
        ({"interface": "vector", "channel": [0, 1]}, True),
        ({"interface": "vector", "channel": "0, 1"}, True),
        ({"interface": "virtual"}, False),
        ({"virtual": "virtual"}, False),
        (None, False),
    ],
)
def test_a_device_of_several_buses_is_known_by_its_channels(table: dict[str, object] | None, several: bool) -> None:
    assert delivers_several_buses(table) is several


class _TwoBuses(can.BusABC):
    """An interface that hands over the frames of two network devices, by their names."""

    def __init__(self, channel: object = None, **_: object) -> None:
        super().__init__(channel=channel)
        self.channel_info = "two buses"
        self._waiting = [
            can.Message(timestamp=1.0 + k, arbitration_id=0x100, is_extended_id=False, data=bytes([k]), channel=name)
            for k, name in enumerate(("can1", "can0", "vcan0", "can1"))
        ]

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        del timeout
        return (self._waiting.pop(0) if self._waiting else None), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError


@pytest.mark.parametrize(("channel", "numbers"), [("", [1, 0, 255, 1]), ("can1", [0, 0, 0, 0])])
def test_frames_of_several_network_devices_keep_their_bus(
    channel: str, numbers: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(can, "Bus", _TwoBuses)
    device = CanDevice("can", {"interface": "socketcan", "channel": channel}, bus="can0" if not channel else None)
    device.open()
    blocks = [device.read(0.01) for _ in range(3)]
    device.close()
    rows = parse_rows(b"".join(block.payload for block in blocks if block is not None and block.is_data))
    assert rows["channel"].tolist() == numbers


@pytest.mark.parametrize("late_ns", [0, 300_000])
def test_groups_of_an_mdf_file_that_number_no_bus_are_told_apart_by_their_source(tmp_path: Path, late_ns: int) -> None:
    frames = [(10_000_000 * k, 0x100, (k + 1).to_bytes(2, "little") + bytes(6)) for k in range(8)]
    others = [(at_ns + late_ns, 0x100, (-500).to_bytes(2, "little", signed=True) + bytes(6)) for at_ns, *_ in frames]
    path = tmp_path / "a.mf4"
    path.write_bytes(sourced_log([("CAN front", frames), ("CAN rear", others)]))
    recording = opened(path)
    assert recording.read("IMU.Accel@CAN front") == pytest.approx(FIRST)
    assert recording.read("IMU.Accel@CAN rear").tolist() == SECOND
    assert opened(path, bus="CAN rear").read("IMU.Accel").tolist() == SECOND
    later = [(at_ns + 80_000_000, key, data) for at_ns, key, data in frames]
    path.write_bytes(sourced_log([("CAN front", frames), ("CAN front", later)]))
    assert opened(path).read("IMU.Accel") == pytest.approx(FIRST * 2)


def capture_of(channels: tuple[int, ...], folder: Path) -> Path:
    records = [capture_rows((channel,))[k * ROW_SIZE : (k + 1) * ROW_SIZE] for k in range(4) for channel in channels]
    path = folder / "a.rdlog"
    path.write_bytes(can_captures.can_capture(records))
    return path


def test_a_capture_of_several_buses_is_read_like_a_log_of_them(tmp_path: Path) -> None:
    path = capture_of((1, 2), tmp_path)
    assert [header.name for header in opened(path).signals] == ["IMU.Accel@1", "IMU.Accel@2"]
    assert [h.name for h in opened(path, captured_bus="can2", bus=7).signals] == ["IMU.Accel"]
    assert opened(path, captured_bus=2).read("IMU.Accel@2").size == 4
    with pytest.raises(ReadError, match=r"no bus 3; found 1 .*, 2 "):
        opened(path, captured_bus=3)
    # a device of one channel is one bus, whatever the number of its channel and that in other logs
    assert opened(capture_of((0,), tmp_path), bus=7).read("IMU.Accel").size == 4
