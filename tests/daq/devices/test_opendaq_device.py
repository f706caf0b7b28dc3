"""An openDAQ device: what it tells, and what it says and counts when its recorder, or its process, is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime

import pytest

from recoil_acquisition.devices import opendaq_device
from recoil_acquisition.devices.device import CHANGED, STREAM
from recoil_acquisition.devices.opendaq_device import OpendaqDevice
from recoil_acquisition.errors import DeviceError, ErrorCode
from recoil_acquisition.packages.extras import Extra
from tests.builders.opendaq_servers import TICK_RATE, free_port, needs_opendaq, reference_server, tick_server
from tests.builders.stream_books import StreamBook


def opened(address):
    device = OpendaqDevice("daq", {"opendaq": address})
    device.open()
    return device


def read_for(device, book, seconds, until=lambda: False):
    ends = time.monotonic() + seconds
    while time.monotonic() < ends and not until():
        book.take(device.read(0.1))


def closed(device, book):
    for block in device.close():
        book.take(block)
    return device.counters


def child_of(device):
    return device._child.pid


# ---- without the library


@pytest.mark.parametrize("address", ["", "daq.nd://", "192.0.2.20", "http://x", 7, None])
def test_an_address_that_is_none_is_refused_with_an_example(address):
    with pytest.raises(DeviceError, match="no address of an openDAQ device") as caught:
        OpendaqDevice("daq", {"opendaq": address})
    assert "daq.nd://192.0.2.20" in caught.value.remedy


def test_a_key_that_says_nothing_is_refused():
    with pytest.raises(DeviceError, match=r"device\.rate_hz is no key"):
        OpendaqDevice("daq", {"opendaq": "daq.nd://x", "rate_hz": 1})


def test_without_the_library_one_line_names_the_extra(monkeypatch):
    monkeypatch.setattr(opendaq_device, "OPENDAQ", Extra("opendaq", "no_such_opendaq", "opendaq>=3.40"))
    with pytest.raises(DeviceError, match="needs the extra `opendaq`, which is not installed") as caught:
        opened("daq.nd://127.0.0.1")
    assert caught.value.code == ErrorCode.NOT_INSTALLED
    assert "pip install 'opendaq>=3.40'" in caught.value.remedy
    assert "\n" not in str(caught.value)


# ---- with it


@needs_opendaq
@pytest.mark.real_time
def test_nothing_of_the_library_is_loaded_here_and_nothing_is_printed():
    script = """
import sys, time
from recoil_acquisition.devices.opendaq_device import OpendaqDevice
device = OpendaqDevice("daq", {"opendaq": "daqref://device0"})
device.open()
assert device.units == {"AI0": "V", "AI1": "V"}, device.units
ends = time.monotonic() + 1.0
while time.monotonic() < ends:
    device.read(0.1)
device.close()
assert device.counters.received > 500, device.counters
assert "opendaq" not in sys.modules
"""
    paths = os.pathsep.join(one for one in sys.path if one)
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@needs_opendaq
@pytest.mark.real_time
def test_it_tells_its_channels_and_each_sample_has_its_tick():
    start_ns = int(datetime(2026, 11, 28, 12, 0, 0, 500_000, tzinfo=UTC).timestamp() * 1e9)
    with tick_server(types=("f64", "i32", "f64"), own_ticks=("c2",), start_utc_ns=start_ns) as server:
        device, book = opened(server.address), StreamBook()
        assert device.units == {"c0": "MPa", "c1": "V", "c2": "MPa"}
        assert device.bytes_per_s > 8 * 3 * TICK_RATE / server.step / 2
        read_for(device, book, 2.0)
        counters = closed(device, book)
    (described,) = book.descriptions
    assert book.said > 5, "said again and again, for a capture may begin anywhere"
    assert described.start_utc_ns == start_ns
    assert [(one.tick_rate, one.step) for one in described.channels] == [
        (TICK_RATE, 50),
        (TICK_RATE, 50),
        (TICK_RATE, 0),
    ]
    assert described.channels[0].said["Range"] == "-10 MPa to 10 MPa"
    assert book.names == ["opened", "closed"]
    assert not book.faults
    assert not book.gaps
    assert not book.wrong
    assert book.samples["c0"] > 15_000
    assert book.samples["c2"] > 15_000
    assert counters.received == sum(book.samples.values())
    assert counters.counter_gaps == counters.bad == counters.reopened == 0


@needs_opendaq
@pytest.mark.real_time
@pytest.mark.parametrize(("wanted", "read"), [(("c1",), ["c1"]), (("c1", "c9"), ["c0", "c1", "c2"])])
def test_what_is_not_wanted_is_not_read_unless_something_wanted_is_not_there(wanted, read):
    with tick_server(types=("f64",) * 3) as server:
        device, book = OpendaqDevice("daq", {"opendaq": server.address}, wanted), StreamBook()
        device.open()
        read_for(device, book, 0.5)
        closed(device, book)
    assert [one.name for one in device.channels] == sorted(book.samples) == read
    assert not book.wrong


@needs_opendaq
@pytest.mark.real_time
def test_whole_numbers_come_as_they_are_with_their_factor():
    with tick_server(types=("i32",), line=(0.25, -3.0)) as server:
        device, book = opened(server.address), StreamBook()
        read_for(device, book, 1.0)
        closed(device, book)
    (channel,) = book.descriptions[0].channels
    assert (channel.factor, channel.offset) == (0.25, -3.0)
    assert channel.said["values"] == "Int32"
    assert book.samples["c0"] > 10_000
    assert not book.wrong


@needs_opendaq
@pytest.mark.real_time
def test_a_recorder_that_is_killed_and_comes_back_leaves_a_gap_that_is_exact_in_ticks():
    with tick_server() as server:
        device, book = opened(server.address), StreamBook()
        read_for(device, book, 1.5)
        server.kill()
        read_for(device, book, 2.0)
        assert book.names == ["opened", "lost"]
        server.off_grid = 7
        server.start()
        read_for(device, book, 10.0, until=lambda: "reopened" in book.names)
        read_for(device, book, 1.5)
        counters = closed(device, book)
    assert book.names == ["opened", "lost", "reopened", "closed"]
    assert not book.wrong, "each sample is the number of its tick, before and behind the gap"
    assert [len(gaps) for gaps in book.gaps.values()] == [1, 1]
    assert all(gap % 50 for gaps in book.gaps.values() for gap in gaps), "the grid of a new start is another one"
    assert 2 * TICK_RATE < book.gaps["c0"][0] < 8 * TICK_RATE
    assert len(book.descriptions) == 2, "a new start is a new epoch"
    assert (counters.reopened, counters.counter_gaps) == (1, 2)


@needs_opendaq
@pytest.mark.real_time
def test_a_recorder_that_comes_back_as_another_is_described_anew():
    with tick_server() as server:
        device, book = opened(server.address), StreamBook()
        read_for(device, book, 1.0)
        server.kill()
        server.state(unit="bar")
        server.start()
        read_for(device, book, 10.0, until=lambda: device.units["c0"] == "bar")
        read_for(device, book, 1.0)
        closed(device, book)
    assert [described.channels[0].unit for described in book.descriptions][-1] == "bar"
    said = "; ".join(event.detail for event in book.events if event.name == CHANGED)
    assert said == "unit of c0 is bar, was MPa; unit of c1 is bar, was V", "at once, or one after the other"
    assert device.units["c0"] == "bar"
    assert not book.wrong


@needs_opendaq
@pytest.mark.real_time
def test_a_recorder_that_stands_still_for_four_seconds_is_lost_and_found():
    with tick_server() as server:
        device, book = opened(server.address), StreamBook()
        read_for(device, book, 1.0)
        os.kill(server.child.pid, signal.SIGSTOP)
        read_for(device, book, 4.0)
        os.kill(server.child.pid, signal.SIGCONT)
        read_for(device, book, 10.0, until=lambda: "reopened" in book.names)
        read_for(device, book, 1.5)
        counters = closed(device, book)
    assert "lost" in book.names
    assert "reopened" in book.names
    assert not book.wrong
    assert not book.faults
    gaps = sum(map(len, book.gaps.values()))
    assert counters.counter_gaps == gaps
    assert all(gap % 50 == 0 and gap > 0 for these in book.gaps.values() for gap in these)


@needs_opendaq
@pytest.mark.real_time
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
def test_its_process_is_started_again_and_the_gap_is_exact(how):
    with tick_server() as server:
        device, book = opened(server.address), StreamBook()
        read_for(device, book, 1.0)
        first = child_of(device)
        os.kill(first, how)
        read_for(device, book, 15.0, until=lambda: "reopened" in book.names)
        read_for(device, book, 1.0)
        assert child_of(device) != first
        counters = closed(device, book)
    assert [name for name in book.names if name != "stalled"] == ["opened", "lost", "reopened", "closed"]
    assert not book.wrong
    assert all(len(gaps) == 1 and gaps[0] % 50 == 0 for gaps in book.gaps.values())
    assert len(book.gaps) == counters.counter_gaps == 2
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)


@needs_opendaq
@pytest.mark.real_time
def test_a_websocket_stream_that_never_comes_back_by_itself_is_connected_to_anew():
    with reference_server(channels=2, rate_hz=10_000) as server:
        device, book = opened(server.websocket_address), StreamBook()
        read_for(device, book, 1.0)
        server.kill()
        read_for(device, book, 3.0)
        server.start()
        read_for(device, book, 15.0, until=lambda: "reopened" in book.names)
        read_for(device, book, 1.0)
        closed(device, book)
    assert book.names == ["opened", "stalled", "lost", "reopened", "closed"]
    assert [one.name for one in book.descriptions[-1].channels] == ["AI0", "AI1"]
    assert [len(gaps) for gaps in book.gaps.values()] == [1, 1]
    assert 3_000_000 < book.gaps["AI0"][0] < 20_000_000


@needs_opendaq
@pytest.mark.real_time
def test_what_does_not_answer_is_said_in_one_line():
    with pytest.raises(DeviceError) as caught:
        opened(f"daq.nd://127.0.0.1:{free_port()}")
    said = str(caught.value)
    assert said.startswith("source 'daq': daq.nd://127.0.0.1:")
    assert "\n" not in said
    assert caught.value.found is not None


@needs_opendaq
@pytest.mark.real_time
def test_its_process_ends_with_this_one():
    script = """
import sys, os, signal
from recoil_acquisition.devices.opendaq_device import OpendaqDevice
device = OpendaqDevice("daq", {"opendaq": "daqref://device0"})
device.open()
print(device._child.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""
    paths = os.pathsep.join(one for one in sys.path if one)
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    pid = int(done.stdout)
    ends = time.monotonic() + 5.0
    while time.monotonic() < ends:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("it is there still")


@needs_opendaq
@pytest.mark.real_time
def test_a_device_is_opened_once_and_closed_twice():
    with tick_server() as server:
        device = opened(server.address)
        with pytest.raises(ValueError, match="open already"):
            device.open()
        assert any(block.kind == STREAM for block in device.close())
        assert device.close() == ()
        with pytest.raises(ValueError, match="is not open"):
            device.read(0.0)
