"""Channels of live sources are decoded as they pass, in SI, dated by the host, and by the interface if it was late."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.cut import write_everything
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource, signals_of
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.devices.device import SERIAL, event_block
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.frames.can_rows import ERROR, EXTENDED, REMOTE
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_acquisition.readers.reader import Declarations
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
