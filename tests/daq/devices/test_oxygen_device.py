"""An OXYGEN recorder as a device, against a virtual one: what is asked, told, lost, changed and never touched."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.capture.oxygen_signals import open_oxygen
from recoil_acquisition.devices import oxygen_device
from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.described import DESCRIBED
from recoil_acquisition.devices.device import EVENT, STREAM, Block, event_of
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.devices.oxygen_device import OxygenDevice
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.readers.reader import Declarations
from recoil_rigs.twin.oxygen_packets import Raw, WireChannel, raw_of
from recoil_rigs.twin.oxygen_recorder import GOOD, Handling, OxygenRecorder, RecorderContent
from tests.builders.oxygen_client import Listener, OxygenClient
from tests.builders.tick_streams import PATH, captured

RATE_HZ = 10_000.0
NAMES = ("AI 1/a", "AI 2/p", "AI 3/x")
DECLARED = DeviceDeclarations(signals=("AI 1/a", "AI 2/p"))


def content(**said: str) -> RecorderContent:
    wire = tuple(WireChannel(name, unit) for name, unit in zip(NAMES, ("m/s2", "MPa", "m"), strict=True))
    rest = np.stack([raw_of(np.full(1000, k, dtype=np.float64), "f32") for k in range(3)])
    properties = [{"SampleRate": f'(SCALAR,{RATE_HZ},"Hz")', "Used": '(STRING,"ON")', **said} for _ in wire]
    return RecorderContent(wire, tuple(properties), RATE_HZ, "f32", rest, 0.01)


@pytest.fixture
def recorder() -> Iterator[OxygenRecorder]:
    one = OxygenRecorder("daq", content())
    one.plug()
    yield one
    one.unplug()


def opened(recorder: OxygenRecorder, declared: DeviceDeclarations = DECLARED, **table: Any) -> OxygenDevice:
    device = open_device("daq", "dewetron", {**recorder.device, **table}, declared)
    assert isinstance(device, OxygenDevice)
    return device


def read_until(device: OxygenDevice, over: Callable[[list[Block]], bool], limit_s: float = 8.0) -> list[Block]:
    blocks: list[Block] = []
    ends_s = time.monotonic() + limit_s
    while not over(blocks) and time.monotonic() < ends_s:
        block = device.read(0.05)
        blocks += [] if block is None else [block]
    assert over(blocks), [event_of(one) for one in blocks if one.kind == EVENT]
    return blocks


def events(blocks: list[Block]) -> list[str]:
    found = [event_of(one) for one in blocks if one.kind == EVENT]
    return [f"{one.name}: {one.detail}" for one in found if one.name != DESCRIBED]


def has(name: str) -> Callable[[list[Block]], bool]:
    return lambda blocks: any(one.kind == EVENT and event_of(one).name == name for one in blocks)


def for_s(time_s: float) -> Callable[[list[Block]], bool]:
    ends_s = time.monotonic() + time_s
    return lambda _: time.monotonic() > ends_s


def said_by(recorder: OxygenRecorder) -> list[str]:
    """Lines that are sent to a recorder from now on."""
    lines: list[str] = []
    answer = recorder.scpi.answer

    def noted(line: str) -> str | None:
        lines.append(line.strip())
        return answer(line)

    recorder.scpi.answer = noted  # type: ignore[method-assign]
    return lines


@pytest.mark.real_time
def test_it_streams_what_the_rig_declares_and_says_what_that_is(recorder: OxygenRecorder) -> None:
    device = opened(recorder)
    assert dict(device.units) == {"AI 1/a": "m/s2", "AI 2/p": "MPa"}
    assert device.bytes_per_s > 2 * 4 * RATE_HZ
    blocks = [*read_until(device, for_s(0.6)), *device.close()]
    recording = open_oxygen(PATH, captured(blocks), Declarations("daq"))
    assert [one.name for one in recording.signals] == ["AI 1/a", "AI 2/p"]
    assert set(recording.read("AI 2/p")) == {1.0}
    base = recording.time_base("AI 1/a")
    assert base.step_s == 1 / RATE_HZ
    assert base.count > 0.5 * RATE_HZ
    assert recording.notes == ()
    assert device.counters.received == sum(len(one.payload) for one in blocks if one.kind == STREAM)
    assert [one.partition(":")[0] for one in events(blocks)] == ["opened", "closed"]


@pytest.mark.real_time
def test_nothing_of_the_recorder_is_told_but_its_own_group(recorder: OxygenRecorder) -> None:
    lines = said_by(recorder)
    device = opened(recorder)
    device.close()
    changing = [line for line in lines if not line.partition(" ")[0].endswith("?")]
    allowed = r"\*CLS|:COMM:HEAD OFF|:DST:(PORT1|ITEM1|INIT|START|STOP|DEL) .*"
    assert [line for line in changing if re.fullmatch(allowed, line) is None] == []
    assert not any("ALL" in line for line in changing)
    assert recorder.scpi.acquisition == "Started"
    assert recorder.scpi.storing == "Stopped"


@pytest.mark.real_time
def test_acquisition_and_storing_are_started_where_the_rig_says_so_and_storing_is_stopped(
    recorder: OxygenRecorder,
) -> None:
    recorder.scpi.acquisition = "Stopped"
    with pytest.raises(DeviceError, match="its acquisition is Stopped: start it in OXYGEN"):
        opened(recorder)
    device = opened(recorder, acquisition=True, storing=True)
    assert (recorder.scpi.acquisition, recorder.scpi.storing) == ("Started", "Started")
    device.close()
    assert (recorder.scpi.acquisition, recorder.scpi.storing) == ("Started", "Stopped")


@pytest.mark.real_time
def test_storing_that_somebody_else_started_is_left_alone(recorder: OxygenRecorder) -> None:
    recorder.scpi.storing = "Started"
    opened(recorder, storing=True).close()
    assert recorder.scpi.storing == "Started"


@pytest.mark.parametrize(
    ("signals", "acquisition", "said"),
    [
        (("AI 1/a", "AI 9/b"), "Started", "it has no channel 'AI 9/b' .nearest AI"),
        (("AI 1/a",), "Waiting_for_sync", "waits for the source of its time"),
        ((), "Started", "no channel of the recorder is declared"),
    ],
)
def test_what_it_lacks_is_one_line(
    recorder: OxygenRecorder, signals: tuple[str, ...], acquisition: str, said: str
) -> None:
    recorder.scpi.acquisition = acquisition
    with pytest.raises(DeviceError, match=said) as caught:
        opened(recorder, DeviceDeclarations(signals=signals))
    assert "\n" not in str(caught.value)


@pytest.mark.real_time
def test_a_channel_that_is_switched_off_is_named() -> None:
    one = OxygenRecorder("daq", content(Used='(STRING,"OFF")'))
    one.plug()
    try:
        with pytest.raises(DeviceError, match="its channel AI 1/a, AI 2/p is switched off"):
            opened(one)
    finally:
        one.unplug()


@pytest.mark.parametrize(
    "table", [{"oxygen": ":1"}, {"oxygen": "h:x"}, {"oxygen": "h", "group": 0}, {"oxygen": "h", "storing": "yes"},
              {"oxygen": "h", "prot": 1}],
)  # fmt: skip
def test_a_table_that_is_wrong_says_what_it_takes(table: Mapping[str, Any]) -> None:
    with pytest.raises(DeviceError, match="`device` of an OXYGEN recorder"):
        open_device("daq", "dewetron", table, DECLARED)


@pytest.mark.real_time
def test_nobody_there_is_one_line() -> None:
    with pytest.raises(DeviceError, match="check address and network"):
        open_device("daq", "dewetron", {"oxygen": "127.0.0.1:9"}, DECLARED)


@pytest.mark.real_time
def test_a_lost_connection_is_made_again_and_the_gap_is_known_to_the_tick(recorder: OxygenRecorder) -> None:
    device = opened(recorder)
    blocks = read_until(device, for_s(0.3))
    recorder.unplug()
    blocks += read_until(device, has("lost"))
    time.sleep(0.2)
    recorder.plug()
    back = read_until(device, has("reopened"))
    assert not any(one.is_data for one in back), "what came of the new connection stands behind the word of it"
    blocks += back
    blocks += [*read_until(device, for_s(0.3)), *device.close()]
    recording = open_oxygen(PATH, captured(blocks), Declarations("daq"))
    runs = recording.metadata["ticks"]["AI 1/a"]["runs"]
    assert recording.metadata["epochs"] == 1
    assert len(runs) == 2
    missing = runs[1][0] - runs[0][0] - runs[0][1]
    assert 0.15 * RATE_HZ < missing < 3.0 * RATE_HZ
    assert any(f"samples are missing, {missing} from tick" in note for note in recording.notes)
    assert device.counters.reopened == 1


@pytest.mark.real_time
def test_a_packet_that_is_lost_is_counted_once_however_many_channels_it_has(recorder: OxygenRecorder) -> None:
    device, send, sent = opened(recorder), recorder.send, count()

    def lossy(first: int, raw: Raw, handling: Handling = GOOD) -> bool:
        del handling
        return send(first, raw, Handling(lost=next(sent) in (5, 11, 12)))

    recorder.send = lossy  # type: ignore[method-assign]
    read_until(device, for_s(0.4))
    device.close()
    assert next(sent) > 14
    assert device.counters.counter_gaps == 3


@pytest.mark.real_time
def test_storing_that_was_stopped_meanwhile_is_not_started_again_behind_a_lost_connection(
    recorder: OxygenRecorder,
) -> None:
    device = opened(recorder, storing=True)
    read_until(device, for_s(0.1))
    recorder.unplug()
    read_until(device, has("lost"))
    recorder.scpi.storing = "Stopped"
    recorder.plug()
    read_until(device, has("reopened"))
    assert recorder.scpi.storing == "Stopped"
    device.close()


@pytest.mark.real_time
def test_a_device_that_was_closed_can_be_opened_again_and_says_when_it_is_lost(recorder: OxygenRecorder) -> None:
    device = opened(recorder)
    device.close()
    device.open()
    read_until(device, for_s(0.1))
    recorder.unplug()
    read_until(device, has("lost"))
    device.close()
    recorder.plug()


@pytest.mark.real_time
def test_a_recorder_that_was_restarted_counts_anew_and_is_asked_anew(recorder: OxygenRecorder) -> None:
    device = opened(recorder)
    blocks = read_until(device, for_s(0.3))
    recorder.unplug()
    recorder.restart()
    recorder._rests_to = None  # nobody plays: it rests on
    recorder.plug()
    blocks += [*read_until(device, has("reopened")), *read_until(device, for_s(0.6)), *device.close()]
    recording = open_oxygen(PATH, captured(blocks), Declarations("daq"))
    assert recording.metadata["epochs"] == 2
    assert any("other clocks are left out" in note for note in recording.notes)


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("what", "said"),
    [("unit", "unit of AI 1/a is V, was m/s2"), ("scaling", "factor of AI 1/a is 2"), ("channels", "AI 2/p is gone")],
)
def test_what_changes_while_it_streams_is_said(recorder: OxygenRecorder, what: Any, said: str) -> None:
    device = opened(recorder)
    read_until(device, for_s(0.1))
    recorder.change(what)
    blocks = read_until(device, has("changed"))
    assert any(f"changed: {said}" in one for one in events(blocks)), events(blocks)
    device.close()


@pytest.mark.real_time
def test_a_licence_that_ends_the_stream_is_said(recorder: OxygenRecorder) -> None:
    device = opened(recorder)
    read_until(device, for_s(0.1))
    recorder.end_licence()
    blocks = read_until(device, has("lost"))
    assert "it has no licence for it (DST)" in events(blocks)[-1]
    device.close()


@pytest.mark.real_time
def test_all_that_is_said_can_be_kept(recorder: OxygenRecorder) -> None:
    kept: list[tuple[str, str, bytes]] = []
    lock = threading.Lock()

    def keep(link: str, who: str, said: bytes) -> None:
        with lock:
            kept.append((link, who, said))

    device = opened(recorder, DeviceDeclarations(signals=DECLARED.signals, heard=keep))
    blocks = [*read_until(device, for_s(0.2)), *device.close()]
    assert b"".join(said for link, _, said in kept if link == "stream") == b"".join(
        one.payload for one in blocks if one.kind == STREAM
    )
    assert ("scpi", "host", b"*IDN?") in kept
    assert {who for link, who, _ in kept if link == "scpi"} == {"host", "recorder"}


@pytest.mark.real_time
def test_a_group_in_which_somebody_else_streams_is_left_alone(recorder: OxygenRecorder) -> None:
    with OxygenClient(recorder.device) as other, Listener(other.begin(["AI 3/x"])) as heard:
        lines = said_by(recorder)
        with pytest.raises(DeviceError, match=r"its group 1 streams AI 3/x to somebody else: write `group = 2`"):
            opened(recorder)
        before = len(heard.packets)
        time.sleep(0.2)
        assert len(heard.packets) > before
    assert heard.failure is None
    assert [line for line in lines if re.match(r":DST:\w+ ?\d? ", line)] == []


@pytest.mark.real_time
def test_what_this_program_left_behind_is_taken_over(recorder: OxygenRecorder) -> None:
    with OxygenClient(recorder.device) as left:
        left.begin([*DECLARED.signals])
    device = opened(recorder)
    read_until(device, lambda blocks: sum(len(one.payload) for one in blocks if one.kind == STREAM) > 1000)
    device.close()


def test_a_name_that_two_channels_bear_is_refused() -> None:
    same = content()
    channels = tuple(replace(one, name="AI 1/a") if one.name == "AI 3/x" else one for one in same.channels)
    one = OxygenRecorder("daq", replace(same, channels=channels))
    one.plug()
    try:
        with pytest.raises(DeviceError, match="has 2 channels that are called 'AI 1/a': give them names of their own"):
            opened(one)
    finally:
        one.unplug()


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("state", "said"), [("Unlicensed", r"no licence for it \(DST\)"), ("CONFIG", "which is CONFIG")]
)
def test_a_stream_that_falls_silent_is_asked_why(
    recorder: OxygenRecorder, monkeypatch: pytest.MonkeyPatch, state: str, said: str
) -> None:
    monkeypatch.setattr(oxygen_device, "SILENT_S", 0.3)
    device = opened(recorder)
    read_until(device, for_s(0.1))
    recorder.scpi.state = state  # it sends no more, and leaves the connection open
    blocks = read_until(device, has("lost"))
    assert re.search(said, events(blocks)[-1])
    device.close()


@pytest.mark.real_time
def test_a_stream_that_waits_for_a_trigger_of_its_own_is_not_lost(
    recorder: OxygenRecorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(oxygen_device, "SILENT_S", 0.1)
    device = opened(recorder)
    recorder.begin_play(time.monotonic())  # it rests no longer, and nothing is played
    time.sleep(0.1)
    assert not has("lost")(read_until(device, for_s(0.6)))
    device.close()


@pytest.mark.parametrize(("most", "is_set"), [("212992\n", False), ("4194304\n", True), (None, True)])
def test_the_queue_of_a_stream_is_never_made_smaller_than_the_system_makes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: str | None, is_set: bool
) -> None:
    limit = tmp_path / "rmem_max"
    if most is not None:
        limit.write_text(most)
    monkeypatch.setattr(oxygen_device, "_LARGEST_BUFFER", limit)
    with socket.socket() as one:
        before = one.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        oxygen_device._widen(one)
        assert (one.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) != before) is is_set
