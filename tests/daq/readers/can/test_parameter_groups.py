"""J1939: a message is known by its parameter group, whoever sent it; what several sent is not one signal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.can_signals import CanSignals
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.devices.device import CAN, Block
from recoil_acquisition.devices.stream_check import can_counter_check
from recoil_acquisition.errors import ReadError
from recoil_acquisition.frames.can_rows import EXTENDED
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.can.recording import CanRecording
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.can_rows import pack_row

ENGINE, ANY, TORQUE, PLAIN = 0x0CF00400, 0x18FEF1FE, 0x0C000003, 0x18FF0100


def database(*more: str, engine: int = ENGINE) -> str:
    """Engine speed of one address, a vehicle's speed of any, torque to one address, and a message of no group."""
    return "\n".join([
        'VERSION ""', "BU_: X",
        f"BO_ {engine | 1 << 31} EEC1: 8 X", ' SG_ rpm : 24|16@1+ (0.125,0) [0|8031.875] "rpm" X',
        ' SG_ count : 56|8@1+ (1,0) [0|0] "" X',
        f"BO_ {ANY | 1 << 31} CCVS1: 8 X", ' SG_ speed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" X',
        f"BO_ {TORQUE | 1 << 31} TSC1: 8 X", ' SG_ torque : 24|8@1+ (1,-125) [-125|125] "%" X',
        f"BO_ {PLAIN | 1 << 31} OWN: 8 X", ' SG_ v : 0|8@1+ (1,0) [0|0] "V" X', *more,
        'BA_DEF_ BO_  "VFrameFormat" ENUM  "StandardCAN","ExtendedCAN","reserved","J1939PG";',
        'BA_DEF_DEF_  "VFrameFormat" "J1939PG";', f'BA_ "VFrameFormat" BO_ {PLAIN | 1 << 31} 1;', "",
    ])  # fmt: skip


def engine(rpm: float, count: int = 0) -> str:
    raw = round(rpm / 0.125)
    return f"F1FFFF{raw & 255:02X}{raw >> 8:02X}FFFF{count:02X}"


def opened(folder: Path, frames: list[tuple[int, str]], text: str = "", counters: tuple[str, ...] = ()) -> CanRecording:
    path = folder / "a.log"
    path.write_text("".join(f"(1.{i:06d}) can0 {one:08X}#{data}\n" for i, (one, data) in enumerate(frames)))
    recording = recognise(path).open(path, Declarations("c", database=text or database(), counters=counters))
    assert isinstance(recording, CanRecording)
    return recording


def test_a_message_from_another_address_and_of_another_priority_is_the_one_of_its_group(tmp_path: Path) -> None:
    frames = [(0x0CF00403, engine(800.0)), (0x18F00403, engine(900.0)), (0x18FEF117, "FF0080FFFFFFFFFF")]
    recording = opened(tmp_path, frames)
    assert [one.name for one in recording.signals] == ["EEC1.rpm", "EEC1.count", "CCVS1.speed"]
    np.testing.assert_array_equal(recording.read("EEC1.rpm"), [800.0, 900.0])
    np.testing.assert_array_equal(recording.read("CCVS1.speed"), [128.0])
    assert (
        "messages known by their parameter group (J1939), from another address than the database has: "
        "EEC1 from 0x03, CCVS1 from 0x17"
    ) in recording.notes
    assert not recording.metadata["unknown_identifiers"]


def test_what_other_addresses_send_stands_beside_the_message_of_the_database(tmp_path: Path) -> None:
    frames = [(ENGINE, engine(800.0)), (0x0CF00403, engine(10.0)), (ENGINE, engine(801.0)), (0x18F00403, engine(11.0))]
    recording = opened(tmp_path, frames)
    np.testing.assert_array_equal(recording.read("EEC1.rpm"), [800.0, 801.0])
    np.testing.assert_array_equal(recording.read("EEC1#0x0CF00403.rpm"), [10.0, 11.0])
    assert any("EEC1#0x0CF00403 from 0x03" in note for note in recording.notes)


def test_of_several_addresses_none_of_which_is_the_databases_one_must_be_named(tmp_path: Path) -> None:
    frames = [(0x18FEF117, "FF0080FFFFFFFFFF"), (0x18FEF121, "FF0040FFFFFFFFFF")] * 2
    recording = opened(tmp_path, frames, counters=("EEC1.count",))
    np.testing.assert_array_equal(recording.read("CCVS1#0x18FEF121.speed"), [64.0, 64.0])
    with pytest.raises(ReadError, match=r"'CCVS1.speed' is of several messages; found 'CCVS1#0x18FEF117.speed', "):
        recording.read("CCVS1.speed")


def test_one_to_one_messages_are_told_apart_by_both_addresses(tmp_path: Path) -> None:
    recording = opened(tmp_path, [(0x0C000B03, "FFFFFF80FFFFFFFF"), (0x0C000C03, "FFFFFF90FFFFFFFF")])
    assert [one.name for one in recording.signals] == ["TSC1#0x0C000B03.torque", "TSC1#0x0C000C03.torque"]
    assert any("TSC1#0x0C000B03 from 0x03 to 0x0B" in note for note in recording.notes)


def test_a_message_of_no_group_and_a_group_of_several_messages_are_matched_by_identifiers(tmp_path: Path) -> None:
    frames = [(PLAIN | 7, "01"), (0x0CF00403, engine(800.0))]
    again = [f"BO_ {0x8CF00411} RETARDER: 8 X", ' SG_ rpm : 24|16@1+ (0.125,0) [0|8031.875] "rpm" X']
    recording = opened(tmp_path, [*frames, (0x0CF00411, engine(5.0))], database(*again))
    assert recording.metadata["unknown_identifiers"] == {"0xcf00403 (29 bit)": 1, "0x18ff0107 (29 bit)": 1}
    assert [one.name for one in recording.signals] == ["RETARDER.rpm"]


def test_of_a_group_of_several_messages_that_of_anybody_has_what_others_send(tmp_path: Path) -> None:
    again = [f"BO_ {0x8CF004FE} ANY: 8 X", ' SG_ rpm : 24|16@1+ (0.125,0) [0|8031.875] "rpm" X']
    recording = opened(tmp_path, [(0x0CF00403, engine(8.0)), (ENGINE, engine(9.0))], database(*again))
    np.testing.assert_array_equal(recording.read("ANY.rpm"), [8.0])
    np.testing.assert_array_equal(recording.read("EEC1.rpm"), [9.0])


def test_a_counter_counts_the_frames_of_its_group(tmp_path: Path) -> None:
    frames = [(0x0CF00403, engine(800.0, count)) for count in (0, 1, 2, 4, 5)]
    recording = opened(tmp_path, frames, counters=("EEC1.count",))
    assert any("1 of 6 messages" in note or "missing" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (engine(0.0)[:6] + "12FE" + "FFFF00", "error, 0xFE00 and above x1"),
        (engine(0.0)[:6] + "FFFF" + "FFFF00", "not available, 0xFF00 and above x1"),
        (engine(0.0)[:6] + "00FB" + "FFFF00", "reserved, 0xFB00 and above x1"),
    ],
)
def test_a_number_that_is_none_of_j1939_is_lost_by_its_name(data: str, named: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, [(ENGINE, engine(700.0)), (ENGINE, data)])
    np.testing.assert_array_equal(recording.read("EEC1.rpm"), [700.0, np.nan])
    assert any(f"({named}): lost samples" in note for note in recording.notes if note.startswith("EEC1.rpm"))


def test_numbers_of_j1939_without_a_range_have_that_of_the_standard(tmp_path: Path) -> None:
    data = [engine(1.0, count) for count in (0xFA, 0xFB, 0xFE, 0xFF)]
    recording = opened(tmp_path, [(ENGINE, one) for one in data])
    np.testing.assert_array_equal(recording.read("EEC1.count"), [250.0, np.nan, np.nan, np.nan])


def test_a_rig_may_name_the_address_of_a_group() -> None:
    found = load_database(database(), Path("a.dbc"))
    (one,) = found.named("EEC1#0x18F00403.rpm")
    assert (one.name, one.key) == ("EEC1#0x18F00403.rpm", 0x98F00403)
    for wrong in ("EEC1#0x18F00503.rpm", "OWN#0x18FF0107.v", "EEC1#0x18F00403.none", "EEC1#x.rpm"):
        assert found.named(wrong) == ()


@pytest.mark.parametrize(
    ("signal", "own", "values"),
    [
        ("EEC1.rpm", 0x0CF00433, [800.0, 801.0]),
        ("EEC1#0x0CF00411.rpm", ENGINE, [10.0]),
        ("EEC1.rpm", ENGINE, [801.5]),
    ],
)
def test_an_armed_channel_hears_one_address_of_its_group(signal: str, own: int, values: list[float]) -> None:
    channel = LiveChannel("rpm", signal, 1.0, 0.0, "rpm")
    live = CanSignals(LiveSource("bus", "can", {}, (channel,), database=database()), (channel,))
    sent = [(0x0CF00403, engine(800.0)), (0x0CF00411, engine(10.0)), (0x18F00403, engine(801.0)), (own, engine(801.5))]
    sent = [one for one in sent if one[0] != 0x0CF00433]
    rows = b"".join(
        pack_row(device_ns=0, host_ns=i, identifier=one, flags=EXTENDED, data=bytes.fromhex(data))
        for i, (one, data) in enumerate(sent)
    )
    assert [float(one) for part in live.feed(Block("bus", 50, rows, CAN)) for one in part.values] == values


@pytest.mark.parametrize("counter", ["EEC1.count", "EEC1#0x0CF00403.count"])
def test_a_stream_counts_the_messages_of_one_address_of_a_group(counter: str) -> None:
    check = can_counter_check("bus", [counter], database(), Path("rig.toml"))
    sent = [(0x0CF00403, 0), (0x0CF00411, 77), (0x18F00403, 1), (0x0CF00411, 99), (0x0CF00403, 3)]
    rows = b"".join(
        pack_row(device_ns=0, host_ns=i, identifier=one, flags=EXTENDED, data=bytes.fromhex(engine(8.0, count)))
        for i, (one, count) in enumerate(sent)
    )
    check.feed(Block("bus", 50, rows, CAN))
    assert check.counter_gaps == 1
