"""A session with an openDAQ recorder: it triggers, is cut and read back, each sample at its tick, gaps too."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.live_source import open_source
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.errors import RigError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.remark import NoteCode
from recoil_acquisition.trigger import Edge, Trigger
from recoil_daq.live.device_check import check_devices
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.live_sources import live_sources, told_by
from tests.builders.opendaq_servers import TickServer, free_port, needs_opendaq, tick_server

pytestmark = [needs_opendaq, pytest.mark.real_time]

DECLARED = """
[[source]]
name = "fast"
kind = "recorder"
device = { opendaq = "ADDRESS" }
align = { method = "fixed", offset_s = 0.0 }

[[channel]]
name = "p_fast"
source = "fast"
signal = "c0"
quantity = "pressure"
"""


def rig_of(address: str) -> Rig:
    mixed = load_rig("mixed")
    return parse_rig(mixed.text + DECLARED.replace("ADDRESS", address), mixed.path, mixed.databases)


def captured(
    server: TickServer, folder: Path, after_s: float, meanwhile: Callable[[], None] = lambda: None
) -> tuple[Recording, list[str]]:
    """Arm on the tick that comes after a time, and return what the shot's capture holds, and what was decided."""
    rig = rig_of(server.address)
    (declared,) = (one for one in live_sources(rig) if one.name == "fast")
    device = open_source(declared)
    told = told_by(live_sources(rig), {"fast": device})
    (source,) = (one for one in live_sources(rig, None, told) if one.name == "fast")
    assert source.channels[0].factor == pytest.approx(1e6), "MPa, as the recorder says"
    tick = time.time_ns() / 1000 + after_s * 1e6
    trigger = Trigger((Edge("p_fast", 1e6 * tick, rearm=1e6 * (tick - 0.1e6)),), "any", pre_s=after_s, post_s=0.5)
    record = LiveRecord(
        "mixed", rig.text, "rig.toml", {}, anchor(), (RecordedSource.of(source.name, source.kind, source.device),)
    )
    session = LiveSession(record, [source], {"fast": device}, trigger, folder / "journal", reserve_bytes=0)
    session.start()
    session.arm()
    other = threading.Thread(target=meanwhile)
    other.start()
    window = session.next_window(60.0)
    other.join()
    assert window is not None
    cut = session.cut("0001", window, folder / "0001.rdlog")
    session.release(window)
    session.close(complete=False)
    recording = recognise(cut.path).open(cut.path, Declarations("fast"))
    return recording, [f"{one.channel} {one.outcome}" for one in window.decisions]


def require_ticks(recording: Recording, step: int) -> list[list[int]]:
    """Hold each sample to be the number of its tick; return first tick and count of each run."""
    ticks = recording.metadata["ticks"]["c0"]
    assert (ticks["rate"], ticks["step"]) == ([1_000_000, 1], step)
    runs = [np.arange(first, first + step * count, step) for first, count in ticks["runs"]]
    np.testing.assert_array_equal(recording.read("c0"), np.concatenate(runs))
    return list(ticks["runs"])


def test_a_shot_is_triggered_cut_and_read_back_tick_by_tick(tmp_path: Path) -> None:
    with tick_server() as server:
        recording, decided = captured(server, tmp_path, 3.0)
    assert decided == ["p_fast trigger"]
    ((_, count),) = require_ticks(recording, server.step)
    assert count * server.step > 3e6
    assert [one.code for one in recording.notes] == []
    assert recording.metadata["clock_fit"][TICK_ANCHORS]
    assert {one.name: one.unit for one in recording.signals} == {"c0": "MPa"}
    start = recording.absolute_start
    assert start is not None
    assert start.zone == "UTC"
    assert abs(time.time() - np.datetime64(start.text).astype("datetime64[ns]").astype(float) / 1e9) < 60.0


def test_a_recorder_that_is_killed_before_the_shot_leaves_a_hole_of_so_many_ticks(tmp_path: Path) -> None:
    with tick_server() as server:

        def kill_and_start() -> None:
            time.sleep(1.0)
            server.kill()
            server.off_grid = 13
            server.start()

        recording, _ = captured(server, tmp_path, 8.0, kill_and_start)
    first, second = require_ticks(recording, server.step)
    hole = second[0] - first[0] - server.step * first[1]
    assert hole > 0
    assert hole % server.step, "the server's new start has another grid"
    lost = [str(one) for one in recording.notes if one.code == NoteCode.LOST]
    assert any(f"{hole} ticks, another beat behind them, from tick {second[0] - hole} on" in one for one in lost)


def test_what_the_recorder_has_not_is_refused_with_what_it_has() -> None:
    with tick_server() as server:
        rig = rig_of(server.address)
        text = rig.text.replace('signal = "c0"', 'signal = "c7"')
        wrong = parse_rig(text, rig.path, rig.databases)
        (declared,) = (one for one in live_sources(wrong) if one.name == "fast")
        device = open_source(declared)
        told = told_by(live_sources(wrong), {"fast": device})
        device.close()
        with pytest.raises(RigError, match="the device has no 'c7'; nearest: c1, c0"):
            live_sources(wrong, None, told)


def test_the_check_of_devices_says_in_one_line_that_nobody_is_there() -> None:
    mixed = load_rig("mixed")
    text = rig_of(f"daq.nd://127.0.0.1:{free_port()}").text
    text = re.sub(r"device = \{ virtual[^}]*\}", "", text).replace('channel = "p_brake"  ', 'channel = "p_fast"  ')
    found = list(check_devices(parse_rig(text, mixed.path, mixed.databases), listen_s=0.1))
    (said,) = (one for one in found if one.source == "fast")
    assert said.verdict == "fail"
    assert "cannot be read" in said.finding
