"""A virtual openDAQ recorder, a real server: what is read of it is what the files hold, tick by tick."""

from __future__ import annotations

import json
import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.devices.device import EVENT
from recoil_acquisition.devices.opendaq_device import OpendaqDevice
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.packages.extras import Extra
from recoil_acquisition.streams.opendaq_packets import OpendaqDecoder
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickSamples
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import TwinShot, opendaq_recorder, simulate_shot
from recoil_rigs.twin.faults import Change, Interval, RecorderFaults
from recoil_rigs.twin.opendaq_recorder import OpendaqRecorder
from recoil_rigs.twin.oxygen_packets import WireChannel
from recoil_rigs.twin.oxygen_recorder import RecorderContent
from recoil_rigs.twin.player import TwinPlayer
from tests.builders.opendaq_servers import needs_opendaq

RATE_HZ = 20_000.0
SIGNALS = ("AI 1/acc_recoil", "AI 2/acc_carriage_x", "AI 3/acc_carriage_y", "AI 4/p_breech")


@pytest.fixture(scope="module")
def rig() -> Rig:
    whole = load_rig("mixed")
    quick = whole.text.replace("sample_rate_hz = 50000.0", f"sample_rate_hz = {RATE_HZ}")
    return parse_rig(quick, whole.path, whole.databases)


@pytest.fixture(scope="module")
def shots(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> list[TwinShot]:
    return [simulate_shot(rig, tmp_path_factory.mktemp("shots"), seed=3, shot="3")]


def of_recorder(rig: Rig, device: dict[str, Any]) -> Rig:
    kept = rig.source("dewetron").model_copy(update={"device": device})
    return replace(rig, sources=(kept,), channels=rig.channels_of("dewetron"), trigger=None)


class Heard:
    """What a device read of a play, and what the player says of it."""

    def __init__(
        self, rig: Rig, shots: Sequence[TwinShot], faults: RecorderFaults | None = None, silence_after_s: float = 0.3
    ) -> None:
        self.descriptions: list[StreamDescription] = []
        self.faults: list[StreamFault] = []
        self.parts: dict[str, list[tuple[int, np.ndarray]]] = {}
        decoder = OpendaqDecoder()
        given = {} if faults is None else {"dewetron": faults}
        silence = {"silence_before_s": 0.3, "silence_after_s": silence_after_s}
        with TwinPlayer(rig, shots, faults=given, **silence) as player:
            device = OpendaqDevice("dewetron", player.devices["dewetron"])
            device.open()
            over = threading.Event()

            def read() -> None:
                while not over.is_set():
                    self.take(decoder, device.read(0.1))

            reading = threading.Thread(target=read)
            reading.start()
            player.start()
            assert player.wait(60)
            over.wait(1.0)
            over.set()
            reading.join()
            for block in device.close():
                self.take(decoder, block)
            assert not any(player.failures.values())
            self.truth = player.truth()["sources"]["dewetron"]
        self.counters = device.counters
        json.dumps(self.truth, allow_nan=False)

    def take(self, decoder, block) -> None:
        for item in decoder.feed(block.payload) if block is not None and block.kind != EVENT else []:
            if isinstance(item, StreamDescription):
                self.descriptions.append(item)
            elif isinstance(item, StreamFault):
                self.faults.append(item)
            else:
                self.note(item)

    def note(self, item: TickSamples) -> None:
        channel = self.descriptions[-1].channels[item.channel]
        ticks = item.first_tick + np.arange(len(item.raw)) if item.ticks is None else item.ticks
        self.parts.setdefault(channel.name, []).append((ticks, item.raw))

    def rows(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        ticks, raw = zip(*self.parts[name], strict=True)
        return np.concatenate(ticks), np.concatenate(raw)


def values_of(shot: TwinShot) -> np.ndarray:
    (file,) = (one for one in shot.files if "dewetron" in one.name)
    return np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:]


@needs_opendaq
@pytest.mark.real_time
@pytest.mark.parametrize("values", ["f32", "i24"])
def test_what_is_read_is_what_the_file_holds_at_the_ticks_that_are_told(rig, shots, values) -> None:
    device = {"virtual": "opendaq", "values": values, "own_ticks": [SIGNALS[1]]}
    said = Heard(of_recorder(rig, device), shots)
    (described,) = said.descriptions
    assert [(one.name, one.unit) for one in described.channels] == [
        (SIGNALS[0], "m/s2"), (SIGNALS[1], "m/s2"), (SIGNALS[2], "m/s2"), (SIGNALS[3], "MPa")
    ]  # fmt: skip
    assert [one.step for one in described.channels] == [1, 0, 1, 1]
    assert described.start_utc_ns is not None
    assert not said.faults
    assert said.counters.counter_gaps == 0
    ((_, _, begins),) = said.truth["shots"]
    for place, channel in enumerate(described.channels):
        ticks, raw = said.rows(channel.name)
        np.testing.assert_array_equal(np.diff(ticks), 1)
        stored = values_of(shots[0])[:, place]
        mine = raw[begins - ticks[0] :][: stored.size]
        assert mine.size == stored.size
        if values == "f32":
            np.testing.assert_array_equal(mine, stored.astype(np.float32))
        else:
            np.testing.assert_array_equal(mine, np.rint((stored - channel.offset) / channel.factor))


@needs_opendaq
@pytest.mark.real_time
def test_packets_that_it_loses_are_gaps_of_so_many_ticks(rig, shots) -> None:
    said = Heard(of_recorder(rig, {"virtual": "opendaq"}), shots, RecorderFaults(lost_frames=0.2))
    ticks, _ = said.rows(SIGNALS[0])
    lost = {t for _, first, n in said.truth["lost_ticks"]["stretches"] for t in range(first, first + n)}
    assert lost
    began, ends = said.truth["began_tick"], ticks[-1]
    assert set(range(began, ends + 1)) - set(ticks.tolist()) == {one for one in lost if one < ends}


@needs_opendaq
@pytest.mark.real_time
def test_a_recorder_that_is_away_is_found_again_and_every_tick_is_known(rig, shots) -> None:
    faults = RecorderFaults(unplugged=(Interval(0.4, 0.2),))
    said = Heard(of_recorder(rig, {"virtual": "opendaq"}), shots, faults, silence_after_s=10.0)
    ticks, raw = said.rows(SIGNALS[3])
    assert said.counters.reopened == 1
    assert sorted(set(np.diff(ticks)))[0] == 1
    assert len(set(np.diff(ticks))) == 2, "one hole"
    ((_, _, begins),) = said.truth["shots"]
    stored = values_of(shots[0])[:, 3].astype(np.float32)
    within = (ticks >= begins) & (ticks < begins + stored.size)
    assert within.any()
    np.testing.assert_array_equal(raw[within], stored[ticks[within] - begins])


@needs_opendaq
@pytest.mark.real_time
def test_a_change_of_unit_or_of_the_channels_is_another_description(rig, shots) -> None:
    changes = (Change(0.2, "unit"), Change(0.5, "channels"))
    faults = RecorderFaults(changes=changes)
    said = Heard(of_recorder(rig, {"virtual": "opendaq"}), shots, faults, silence_after_s=8.0)
    told = [(one.channels[0].unit, len(one.channels)) for one in said.descriptions]
    assert told[:2] == [("m/s2", 4), ("V", 4)]
    assert told[-1] == ("V", 3)


def test_without_the_library_one_line_names_the_extra(monkeypatch) -> None:
    monkeypatch.setattr(opendaq_recorder, "OPENDAQ", Extra("opendaq", "no_such_opendaq", "opendaq>=3.40"))
    rest = np.zeros((1, 10, 4), dtype=np.uint8)
    content = RecorderContent((WireChannel("p", "V"),), ({},), 1000.0, "f32", rest, 0.01)
    with pytest.raises(DeviceError, match="needs the extra `opendaq`, which is not installed"):
        OpendaqRecorder("fast", content, 0, {}).plug()
    with pytest.raises(ValueError, match=r"a whole number of ticks per second, not 0\.5"):
        OpendaqRecorder("fast", replace(content, rate_hz=0.5), 0, {})
