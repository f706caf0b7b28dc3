"""`check --devices` says of each channel what is heard, and of each device what is wrong."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.live_source import LiveChannel, signals_of
from recoil_acquisition.devices.device import Counters
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.quantities.quantity import find_unit
from recoil_daq.live.device_check import _judge, check_devices
from recoil_rigs.rig import load_rig, parse_rig
from tests.builders.live_sources import bus, port
from tests.builders.virtual_shots import with_twin

NOISE = np.random.default_rng(1).normal(0.0, 0.01, 2000)
CHANNEL = LiveChannel("rate", "w", 1.0, 0.0, "rad/s", (-1.0, 1.0))


@pytest.mark.real_time
@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port")
def test_a_sound_rig_is_heard_at_its_rates() -> None:
    heard = {one.channel: one for one in check_devices(with_twin("mixed"), listen_s=1.0)}
    assert {one.verdict for one in heard.values()} == {"ok"}
    assert heard["p_brake"].rate_hz == pytest.approx(2000, rel=0.3)  # on a busy machine frames come in heaps
    assert heard["gyro_carriage"].rate_hz == pytest.approx(1000, rel=0.3)
    assert heard["p_recuperator"].mean == pytest.approx(1.65e6, rel=0.05)
    assert heard["gyro_carriage"].noise == pytest.approx(1e-3, rel=0.5)


@pytest.mark.real_time
def test_a_device_that_is_not_there_is_said_and_the_others_are_heard(tmp_path: Path) -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('device = { virtual = "pty" }', f'device = {{ port = "{tmp_path}/none", baudrate = 9600 }}')
    text = text.replace('device = { virtual = "virtual" }', 'device = { interface = "virtual", channel = "quiet" }')
    heard = check_devices(parse_rig(text, rig.path, rig.databases), listen_s=0.3)
    imu = next(one for one in heard if one.source == "imu")
    assert imu.verdict == "fail"
    assert "none" in imu.finding
    silent = [one for one in heard if one.source == "can"]
    assert {one.channel for one in silent} == {"p_brake", "p_recuperator", "acc_recoil_can"}
    assert all(one.verdict == "fail" and "the device is silent" in one.finding for one in silent)


@pytest.mark.real_time
def test_a_device_that_hangs_is_said_and_the_others_are_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('device = { virtual = "pty" }', f'device = {{ port = "{tmp_path}/none", baudrate = 9600 }}')
    text = text.replace('device = { virtual = "virtual" }', 'device = { interface = "virtual", channel = "quiet" }')

    def hangs(reader: DeviceReader) -> None:
        stop(reader)
        raise DeviceError(f"source '{reader.device.name}': its device hangs")

    stop = DeviceReader.stop
    monkeypatch.setattr(DeviceReader, "stop", hangs)
    heard = check_devices(parse_rig(text, rig.path, rig.databases), listen_s=0.2)
    assert [(one.channel, one.verdict) for one in heard if one.finding == "source 'can': its device hangs"] == [
        ("", "fail")
    ]
    assert {one.channel for one in heard if one.source == "can"} > {"", "p_brake"}


@pytest.mark.parametrize(
    ("values", "verdict", "says"),
    [
        (NOISE, "ok", "noise is 0.5"),
        (NOISE + 3.0, "fail", "outside of its range"),
        (NOISE + 0.97, "warn", "at the end of its range"),
        (np.zeros(100), "warn", "always 0 rad/s"),
        (np.full(100, np.nan), "fail", "no numbers"),
        (NOISE[:3], "fail", "check the framing and the baud rate; 7 bytes belong to no frame"),
    ],
)
def test_each_finding_says_what_to_do(values, verdict, says) -> None:
    counters = Counters(skipped_bytes=7)
    unheard = signals_of(port(), port().channels).unheard(CHANNEL, counters)
    found = _judge(CHANNEL, values, True, counters, unheard)
    assert found[0] == verdict
    assert says in found[1]


def test_a_finding_is_in_the_unit_in_which_people_read_the_channel() -> None:
    gauge = LiveChannel("p", "p", 1.0, 0.0, "Pa", (0.0, 250e5), shown_in="bar", shown_unit=find_unit("bar"))
    assert "always -0.01 bar" in _judge(gauge, np.full(100, -1000.0), True, Counters(), "")[1]
    assert "rests at 400 bar, outside of its range" in _judge(gauge, 400e5 + NOISE, True, Counters(), "")[1]


def test_a_bus_without_the_message_and_losses_are_said() -> None:
    unheard = signals_of(bus(), bus().channels).unheard(CHANNEL, Counters())
    assert "no message holds w" in _judge(CHANNEL, NOISE[:0], True, Counters(), unheard)[1]
    found = _judge(CHANNEL, NOISE, True, Counters(counter_gaps=2, error_frames=1), "")
    assert found == ("warn", "2 gaps, 1 error frame: check the cable and the bus load")


@pytest.mark.parametrize(
    ("rest", "ends", "verdict"),
    [
        (0.0, (0.0, 250.0), "ok"),
        (-0.4, (0.0, 250.0), "ok"),
        (0.4, (-250.0, 0.0), "ok"),
        (-4.0, (0.0, 250.0), "fail"),
        (247.0, (0.0, 250.0), "warn"),
        (-0.97, (-1.0, 1.0), "warn"),
    ],
)
def test_a_one_sided_gauge_rests_at_the_zero_of_its_range(rest, ends, verdict) -> None:
    channel = LiveChannel("p", "p", 1.0, 0.0, "Pa", ends)
    assert _judge(channel, rest + NOISE, True, Counters(), "")[0] == verdict
