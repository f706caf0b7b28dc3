"""Channels of live sources are decoded as they pass, in SI, dated by the host, and by the interface if it was late."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.can_signals import LONGEST_DELAY_S, HeldBack
from recoil_acquisition.capture.cut import write_everything
from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource, signals_of
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.devices.device import CAN, SERIAL, Block, event_block
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.frames.can_rows import DEVICE_TIME, ERROR, EXTENDED, REMOTE
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.trigger import Edge, Trigger
from tests.builders.can_rows import pack_row
from tests.builders.live_logs import append
from tests.builders.live_sources import ANCHOR, DBC, bus, can_block, can_record, port, serial_block, serial_frame


def test_a_signal_of_a_bus_comes_in_si_with_each_frames_own_time() -> None:
    source = bus()
    block = can_block(5.0, can_record(4.990, 10.0), can_record(4.995, -20.5))
    (samples,) = signals_of(source, source.channels).feed(block)
    assert samples.channel == "pressure"
    assert samples.values == pytest.approx([10e3, -20.5e3])
    assert samples.times_s == pytest.approx([4.990, 4.995])


def test_error_and_remote_frames_and_events_are_no_samples() -> None:
    source = bus()
    signals = signals_of(source, source.channels)
    assert signals.feed(can_block(1.0, can_record(1.0, 1.0, flags=ERROR), can_record(1.0, 1.0, flags=REMOTE))) == []
    assert signals.feed(event_block("bus", 10**9, "lost", "gone")) == []


@pytest.mark.parametrize("flags", [ERROR, REMOTE, EXTENDED])
def test_what_is_no_frame_of_that_identifier_is_no_sample(flags) -> None:
    source = bus()
    assert signals_of(source, source.channels).feed(can_block(1.0, can_record(1.0, 1.0, flags=flags))) == []


def test_another_message_a_short_one_and_one_that_multiplexes_something_else_are_no_samples() -> None:
    lines = DBC.replace("SG_ p : 0|16@1-", "SG_ p m1 : 0|16@1-").replace("SG_ n : 16|8", "SG_ n M : 16|8")
    multiplexed = replace(bus(), database=lines)
    signals = signals_of(multiplexed, multiplexed.channels)
    block = can_block(1.0, can_record(1.0, 1.0, count=1), can_record(1.1, 2.0, count=2))
    assert [s.values.tolist() for s in signals.feed(block)] == [[1e3]]

    source = bus()
    signals = signals_of(source, source.channels)
    other = pack_row(device_ns=0, host_ns=10**9, identifier=292, flags=0, data=bytes(4))
    short = pack_row(device_ns=0, host_ns=10**9, identifier=291, flags=0, data=bytes(1))
    assert signals.feed(can_block(1.0, other, short)) == []


def test_a_channel_takes_its_own_signal_with_its_own_factor_and_offset() -> None:
    (pressure,) = bus().channels
    channels = (replace(pressure, offset=7.0), replace(pressure, name="count", signal="NODE.n", factor=2.0))
    source = replace(bus(), channels=channels)
    found = signals_of(source, channels).feed(can_block(1.0, can_record(1.0, 10.0, count=5)))
    assert {one.channel: one.values.tolist() for one in found} == {"pressure": [10_007.0], "count": [10.0]}
    (rate,) = port().channels
    source = replace(port(), channels=(replace(rate, offset=7.0),))
    (samples,) = signals_of(source, source.channels).feed(serial_block(1.0, serial_frame(0, 3.0)))
    assert samples.values.tolist() == [4.0]


def test_frames_of_a_bus_are_never_dated_before_the_one_in_front() -> None:
    source = bus()
    block = can_block(5.0, can_record(4.995, 1.0), can_record(4.990, 2.0))
    (samples,) = signals_of(source, source.channels).feed(block)
    assert samples.times_s == pytest.approx([4.995, 4.995])


@pytest.mark.parametrize(("event", "values"), [("lost", [-4.0]), ("reopened", [-4.0]), ("unanswered", [-3.0, -4.0])])
def test_only_where_a_port_was_lost_a_half_frame_is_given_up(event, values) -> None:
    source = port()
    signals = signals_of(source, source.channels)
    frame = serial_frame(1, 3.0)
    signals.feed(serial_block(1.0, frame[:4]))
    assert signals.feed(event_block("port", 10**9, event, "")) == []
    found = signals.feed(serial_block(1.1, frame[4:] + serial_frame(2, 4.0)))
    assert [v for one in found for v in one.values] == values


def test_a_field_of_a_port_is_dated_back_to_its_place_on_the_line() -> None:
    source = port()
    stream = b"".join(serial_frame(i, 0.5 * i) for i in range(4))
    signals = signals_of(source, source.channels)
    assert signals.feed(serial_block(1.0, stream[:5])) == []
    (samples,) = signals.feed(serial_block(2.0, stream[5:]))
    assert samples.values == pytest.approx([0.0, -0.5, -1.0, -1.5])
    assert np.diff(samples.times_s) == pytest.approx(8 * 10 / 921600)
    assert samples.times_s[-1] == pytest.approx(2.0)


def test_times_never_run_backwards_however_reads_are_cut() -> None:
    source = port()
    signals = signals_of(source, source.channels)
    stream = b"".join(serial_frame(i, 0.0) for i in range(100))
    times = [
        s.times_s
        for at in range(0, len(stream), 50)
        for s in signals.feed(serial_block(1.0 + at * 1e-6, stream[at : at + 50]))
    ]
    assert (np.diff(np.concatenate(times)) >= 0).all()
    assert np.concatenate(times).size == 100


def test_a_half_frame_before_an_interruption_is_not_completed_by_what_follows() -> None:
    source = port()
    signals = signals_of(source, source.channels)
    frame = serial_frame(1, 3.0)
    signals.feed(serial_block(1.0, frame[:4]))
    signals.skip()
    found = signals.feed(serial_block(1.1, frame[4:] + serial_frame(2, 4.0)))
    assert [v for s in found for v in s.values] == [-4.0]


LINES = {"kind": "delimiter", "baudrate": 921600, "fields": [{"name": "a", "at": 0}, {"name": "b", "at": 1}]}
UNPLUGGED_WITHIN_A_LINE = [
    serial_block(1.0, b"1,10\n2,2"),
    event_block("port", int(1.1e9), "lost", "unplugged"),
    event_block("port", int(1.5e9), "reopened", "after 3 tries"),
    serial_block(1.6, b"0\n4,40\n"),
]


def test_lines_that_an_unplugged_cable_cut_are_no_samples_live_nor_in_the_capture(tmp_path: Path) -> None:
    framing = framing_from_table(LINES)
    channel = LiveChannel("a", "a", 1.0, 0.0, "1")
    source = LiveSource("port", SERIAL, {"port": "x", "baudrate": 921600}, (channel,), framing=framing)
    signals = signals_of(source, source.channels)
    live = [float(v) for block in UNPLUGGED_WITHIN_A_LINE for s in signals.feed(block) for v in s.values]
    record = LiveRecord("rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("port", SERIAL),))
    with LogWriter(tmp_path / "log", record.to_json(), 0, segment_bytes=1 << 16) as writer:
        append(writer, record, UNPLUGGED_WITHIN_A_LINE)
    write_everything(open_log(tmp_path / "log"), tmp_path / "all.rdlog", {})
    recording = CaptureReader().open(tmp_path / "all.rdlog", Declarations("port", framing=LINES))
    assert live == [1.0, 4.0]
    assert recording.read("a").tolist() == [1.0, 4.0]
    assert recording.read("b").tolist() == [10.0, 40.0]
    assert recording.metadata["skipped_bytes"] == len(b"2,2" + b"0\n")


@pytest.mark.parametrize("source", [bus(signal="NODE.q"), port(signal="v")])
def test_a_signal_that_is_not_there_is_refused_with_the_names_that_are(source) -> None:
    with pytest.raises(MissingChannelError, match=r"NODE\.p|w"):
        signals_of(source, source.channels)


STEP_S = 1e-3
DRIFT = 2e-4


def late_s(due_s: np.ndarray, held_s: np.ndarray, clock_s: np.ndarray | None = None, block: int = 10) -> np.ndarray:
    """Let frames pass that were due at some times of the host, held back by others."""
    device_ns = np.rint(1e9 * (50.0 + (due_s if clock_s is None else clock_s) * (1 + DRIFT))).astype(np.int64)
    host_ns = np.rint(1e9 * np.maximum.accumulate(due_s + held_s)).astype(np.int64)
    held = HeldBack()
    return np.concatenate(
        [held.late_s(host_ns[i : i + block], device_ns[i : i + block]) for i in range(0, due_s.size, block)]
    )


def test_frames_that_were_held_back_are_late_by_as_much() -> None:
    due_s = STEP_S * np.arange(4000)
    held_s = 3e-4 + np.where((due_s > 3.0) & (due_s < 3.4), 3.4 - due_s, 0.0)
    found = late_s(due_s, held_s)
    assert found[:3000] == pytest.approx(0.0, abs=1e-3)
    assert found[3001:3400] == pytest.approx(held_s[3001:3400] - 3e-4, abs=1e-3)
    assert found[3410:] == pytest.approx(0.0, abs=1e-3)


def test_a_delay_that_lasts_becomes_the_usual_way_after_half_of_five_seconds() -> None:
    due_s = STEP_S * np.arange(9000)
    found = late_s(due_s, np.where(due_s > 5.0, 0.3, 0.0))
    assert found[5100:7000] == pytest.approx(0.3, abs=2e-3)
    assert found[8200:] == pytest.approx(0.0, abs=2e-3)


def test_at_the_beginning_nothing_is_known() -> None:
    due_s = STEP_S * np.arange(600)
    assert not late_s(due_s, np.where(due_s > 0.5, 0.3, 0.0)).any()


def test_after_a_second_it_is_known_how_late_frames_usually_are() -> None:
    due_s = STEP_S * np.arange(1500)
    found = late_s(due_s, np.where(due_s >= 1.1, 0.3, 0.0))
    assert found[1100:1200] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize(("first_s", "known"), [(0.7, False), (0.8, True)])
def test_it_is_known_once_frames_of_four_quarters_of_a_second_are_there(first_s: float, known: bool) -> None:
    due_s = STEP_S * np.arange(round(first_s / STEP_S) + 10)
    held_s = np.zeros(due_s.size)
    held_s[-10:] = 0.3
    assert late_s(due_s, held_s)[-10:] == pytest.approx(0.3 if known else 0.0, abs=2e-3)


@pytest.mark.parametrize(
    ("quarters", "late"),
    [
        ((0, 0, 0.02, 0.02), True),
        ((0, 0, 0, 0.02, 0.02, 0.02), True),
        ((0.02, 0.02, 0.02, 0, 0, 0.02), False),
        ((0, 0, 0.02, 0.02, 0.02), False),
        # what was more than five seconds ago counts no more
        ((0.02,) * 21 + (0,) * 10 + (0.02,) * 10, True),
    ],
)
def test_a_delay_is_usual_once_more_than_half_of_the_quarters_had_it(quarters: tuple[float, ...], late: bool) -> None:
    held_s = np.repeat(quarters, 250)
    found = late_s(STEP_S * np.arange(held_s.size), held_s)
    # within the last quarter, without what comes so late in it that it is of the next
    assert found[-200:-30] == pytest.approx(0.02 if late else 0.0, abs=1e-3)


def test_what_holds_one_read_of_every_quarter_of_a_second_back_does_not_become_usual() -> None:
    number = np.arange(4000)
    held = number // 10 % 25 == 12
    found = late_s(STEP_S * number, np.where(held, 0.05, 0.0))
    known = held & (number > 1500)
    assert found[known] == pytest.approx(0.05, abs=1e-3)


def test_frames_that_are_read_one_by_one_are_dated_as_those_that_are_read_together() -> None:
    due_s = STEP_S * np.arange(3000)
    held_s = np.where(due_s > 2.5, 0.3, 0.0)
    assert late_s(due_s, held_s, block=1) == pytest.approx(late_s(due_s, held_s), abs=1e-4)


def test_frames_that_share_a_stamp_are_no_clock_that_was_set_back() -> None:
    due_s = np.repeat(2 * STEP_S * np.arange(1500), 2)
    found = late_s(due_s, np.where(due_s >= 2.5, 0.3, 0.0), block=9)
    assert found[due_s >= 2.5] == pytest.approx(0.3, abs=3e-3)


@pytest.mark.parametrize("wrong_s", [-40.0, -1e-2, 1e-2, 1e6])
def test_a_stamp_that_is_wrong_moves_no_other_frame(wrong_s) -> None:
    due_s = STEP_S * np.arange(6000)
    clock_s = due_s.copy()
    clock_s[3005] += wrong_s
    found = np.delete(late_s(due_s, np.zeros(due_s.size), clock_s), 3005)
    assert found == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("step_s", [-2000.0, -0.4, -0.01, 0.4, 2000.0])
@pytest.mark.parametrize("first", [8000, 8004])
def test_a_clock_that_is_set_between_two_reads_or_within_one_is_no_delay(step_s, first) -> None:
    due_s = STEP_S * np.arange(20_000)
    clock_s = due_s + np.where(np.arange(due_s.size) >= first, step_s, 0.0)
    assert late_s(due_s, np.zeros(due_s.size), clock_s) == pytest.approx(0.0, abs=2e-3)


def test_a_lasting_delay_of_more_than_a_second_is_not_believed() -> None:
    due_s = STEP_S * np.arange(6000)
    assert late_s(due_s, np.where(due_s > 3.0, 1.5, 0.0)) == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize(("more_ns", "believed"), [(-1, True), (0, True), (1, False)])
def test_a_delay_is_believed_up_to_a_second_and_no_further(more_ns: int, believed: bool) -> None:
    held, late_ns = HeldBack(), round(LONGEST_DELAY_S * 1e9) + more_ns
    at_ns = 10_000_000 * np.arange(300)
    for k in range(at_ns.size):
        held.late_s(at_ns[k : k + 1], at_ns[k : k + 1])
    (found,) = held.late_s(at_ns[-1:] + late_ns, at_ns[-1:]).tolist()
    assert round(found * 1e9) == (late_ns if believed else 0)


def test_frames_that_come_as_usual_are_not_late_by_a_nanosecond() -> None:
    held = HeldBack()
    at_ns = 10_000_000 * np.arange(300)
    assert not any(held.late_s(at_ns[k : k + 3], at_ns[k : k + 3]).any() for k in range(0, 300, 3))


def frames(due_s: np.ndarray, read_s: float, kpa: np.ndarray) -> Block:
    rows = [
        pack_row(
            device_ns=round(1e9 * (50.0 + at_s)), host_ns=round(1e9 * read_s), identifier=291, flags=DEVICE_TIME,
            data=int(2 * value).to_bytes(2, "little", signed=True) + bytes(2),
        )
        for at_s, value in zip(due_s.tolist(), kpa.tolist(), strict=True)
    ]  # fmt: skip
    return Block("bus", round(1e9 * read_s), b"".join(rows), CAN)


def test_without_stamps_of_the_interface_the_host_dates() -> None:
    source = bus()
    signals = signals_of(source, source.channels)
    for k in range(400):
        due_s = 0.01 * k + STEP_S * np.arange(10)
        read_s = 0.01 * (k + 1) + (0.5 if k == 399 else 0.0)
        block = frames(due_s, read_s, np.zeros(10))
        rows = bytearray(block.payload)
        for at in range(20, len(rows), len(rows) // 10):
            rows[at] = 0
        (samples,) = signals.feed(Block("bus", block.host_ns, bytes(rows), CAN))
    assert samples.times_s == pytest.approx(read_s)


def test_the_window_of_a_shot_whose_trigger_was_held_back_begins_as_long_before_as_was_asked_for() -> None:
    trigger = Trigger((Edge("pressure", 500e3),), pre_s=0.3, post_s=0.5)
    engine = CaptureEngine([bus(), port()], trigger, patience_s=0.1)
    engine.arm(0.0)
    windows = []
    for k in range(700):
        due_s = 0.01 * k + STEP_S * np.arange(10)
        end_s = 0.01 * (k + 1)
        engine.take(serial_block(end_s, serial_frame(k, 0.0)))
        # the bus is held back from 4.95 to 5.35 s; the shot fires at 5 s
        read_s = 5.35 if 4.95 < end_s < 5.35 else end_s
        if read_s == end_s or k == 534:
            held = STEP_S * np.arange(4950, 5350) if k == 534 else due_s
            engine.take(frames(held, 5.35 if k == 534 else end_s, np.where(held > 5.0, 1e3, 0.0)))
        windows += engine.ready(end_s)
    (window,) = windows
    assert window.trigger_s == pytest.approx(5.0, abs=0.02)
    assert window.start_s == pytest.approx(4.7, abs=0.02)
