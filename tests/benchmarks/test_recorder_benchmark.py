"""A recorder of 16 channels at 200 kHz beside a bus and two ports, for as long as asked; and kills on both sides."""

from __future__ import annotations

import json
import random
import signal
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.log.folder import Log, open_log
from recoil_acquisition.log.record import Kind, Record
from recoil_acquisition.readers.captured import event_of
from recoil_rigs.rig import load_rig
from recoil_rigs.twin.oxygen_packets import ValueForm
from tests.benchmarks.test_live_benchmark import (
    MOST_GROWTH_MB,
    MOST_MB,
    PORT_BYTES_PER_S,
    SECONDS,
    Kept,
    cpu_s,
    watch,
)
from tests.builders.live_logs import source_in
from tests.builders.live_rigs import GRACE_NS, LiveProcess, multicast_device, run_recover, write_live_rig
from tests.builders.machine_waits import MachineWaits
from tests.builders.oxygen_client import Ended, exactly, read_packet
from tests.builders.port_player import FRAME_BYTES, BusPlayer, PortPlayer
from tests.builders.ramp_recorder import RampRecorder, Ramps, ramp_content

CHANNELS, RATE_HZ = 16, 200e3
FRAMES_PER_S = 4000.0
MOST_SHARE = 0.10
"""Share of a core that reading the recorder, and watching it beside what bus and ports take, may take together."""
ALONE_S = 20.0

KILLS = 20
NAMED_THREADS = """
import json, os, pathlib, threading, time
def _name_threads(path):
    while True:
        pathlib.Path(path + ".new").write_text(json.dumps({t.name: t.native_id for t in threading.enumerate()}))
        os.replace(path + ".new", path)
        time.sleep(1.0)
threading.Thread(target=_name_threads, args=(PATH,), daemon=True).start()
"""
"""For `LiveProcess`: it writes which of its threads has which number."""

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and /proc")


def ramps_of(channels: int, rate_hz: float, form: ValueForm, packet_s: float) -> RampRecorder:
    """Return a recorder with the channels of the bundled rig's, and more."""
    own = {spec.signal: str(spec.unit) for spec in load_rig("mixed").channels_of("dewetron")}
    more = {f"AI {i}": "m/s2" for i in range(len(own) + 1, channels + 1)}
    return RampRecorder("dewetron", ramp_content({**own, **more}, rate_hz, form, packet_s))


@pytest.fixture(scope="module")
def watched_without(tmp_path_factory: pytest.TempPathFactory) -> float:
    """Share of a core that the thread which watches for shots takes of the bus and the ports, without a recorder."""
    folder, device = tmp_path_factory.mktemp("without"), multicast_device()
    threads = folder / "threads.json"
    with ExitStack() as stack:
        bus = BusPlayer(device, FRAMES_PER_S)
        stack.callback(bus.stop)
        ports = [PortPlayer(f"port{i}", PORT_BYTES_PER_S / FRAME_BYTES, most=16) for i in range(2)]
        for port in ports:
            stack.callback(port.stop)
        rig = write_live_rig(folder, [port.path for port in ports], device, pre_s=0.5, post_s=1.5)
        named = NAMED_THREADS.replace("PATH", repr(str(threads)))
        process = stack.enter_context(LiveProcess(rig, folder / "out", folder / "log.txt", warms=True, before=named))
        journal = process.journal()
        for player in (bus, *ports):
            stack.enter_context(player)
        process.recording(journal)
        began_s, before = time.monotonic(), threads_cpu_s(process.process.pid, threads)
        watch(process, ports[0], ALONE_S, Kept(journal, folder / "kept"))
        after, lasted_s = threads_cpu_s(process.process.pid, threads), time.monotonic() - began_s
        for player in (bus, *ports):
            player.end()
        assert process.end(signal.SIGTERM, 60.0) == 130, process.said
    return (after["watch for shots"] - before.get("watch for shots", 0.0)) / lasted_s


@pytest.mark.parametrize("form", ["f32", "i24"])
@pytest.mark.parametrize("packet_ms", [10.0, 100.0])
def test_sixteen_channels_of_a_recorder_are_recorded_without_a_loss(tmp_path, capsys, form, packet_ms, watched_without):
    device = multicast_device()
    recorder = ramps_of(CHANNELS, RATE_HZ, form, packet_ms / 1e3)
    threads = tmp_path / "threads.json"
    with ExitStack() as stack:
        recorder.plug()
        stack.callback(recorder.unplug)
        bus = BusPlayer(device, FRAMES_PER_S)
        stack.callback(bus.stop)
        ports = [PortPlayer(f"port{i}", PORT_BYTES_PER_S / FRAME_BYTES, most=16) for i in range(2)]
        for port in ports:
            stack.callback(port.stop)
        rig = write_live_rig(
            tmp_path, [port.path for port in ports], device, pre_s=0.5, post_s=1.5,
            recorder=recorder.device, recorder_channels=CHANNELS,
        )  # fmt: skip
        named = NAMED_THREADS.replace("PATH", repr(str(threads)))
        process = stack.enter_context(
            LiveProcess(rig, tmp_path / "out", tmp_path / "log.txt", warms=True, before=named)
        )
        folder = process.journal()
        for player in (bus, *ports):
            stack.enter_context(player)
        process.recording(folder)
        began_s, before = time.monotonic(), threads_cpu_s(process.process.pid, threads)
        watched = watch(process, ports[0], SECONDS, Kept(folder, tmp_path / "kept"))
        after, lasted_s = threads_cpu_s(process.process.pid, threads), time.monotonic() - began_s
        for player in (bus, *ports):
            player.end()
        recorder.unplug()
        time.sleep(0.5)
        assert process.end(signal.SIGTERM, 60.0) == 130, process.said
    journal = open_log(tmp_path / "kept")
    ramps = checked(records_of(journal, "dewetron"))
    survey = journal.survey()
    shares = {name: (after[name] - before.get(name, 0.0)) / lasted_s for name in after}
    sent = (recorder.sent[0][0], sum(recorder.sent[-1][:2]))
    captures = sorted((tmp_path / "out" / "captures").glob("*.rdlog"))
    shots = [one for path in captures if (one := acquisition_in(path)) is not None]
    with capsys.disabled():
        print(f"\n{CHANNELS} channels, {form}, packets of {packet_ms:g} ms, {lasted_s:.0f} s")
        print(f"  ticks sent {sent[0]:,} to {sent[1]:,}, in the journal {ramps.stretches}, {ramps.wrong} wrong")
        print(f"  {watched.words}")
        print("  " + ", ".join(f"{name} {share:.3f}" for name, share in sorted(shares.items()) if share >= 0.0005))
        print(f"  watching without the recorder: {watched_without:.3f}")
        print(f"  sending: {recorder.cpu_s / lasted_s:.3f} of a core")
        print(f"  shots: {len(watched.fired_ns)} fired, {len(shots)} captured")
    assert (survey.lost_records, survey.damaged_bytes, ramps.wrong) == (0, 0, 0)
    assert len(ramps.stretches) == 1
    # what the kernel held when it was unplugged is read all the same
    assert ramps.stretches == [sent]
    assert len(shots) == len(watched.fired_ns)
    assert shares["read dewetron"] + shares["watch for shots"] - watched_without < MOST_SHARE
    assert max(watched.memory_mb) < MOST_MB
    assert watched.growth_mb < MOST_GROWTH_MB


def test_every_tick_is_accounted_for_when_the_session_or_the_recorder_is_killed(tmp_path, capsys):
    choice = random.Random()  # noqa: S311 - a test's choice of moments, no secret
    lines, unsound = [], []
    for i in range(KILLS):
        folder = tmp_path / str(i)
        folder.mkdir()
        recorder, port = ramps_of(4, 50e3, "f32", 0.01), PortPlayer("port")
        with ExitStack() as stack:
            recorder.plug()
            stack.callback(recorder.unplug)
            stack.callback(port.stop)
            rig = write_live_rig(folder, [port.path], recorder=recorder.device)
            process = stack.enter_context(LiveProcess(rig, folder / "out", folder / "log.txt"))
            journal = process.journal()
            waits = stack.enter_context(MachineWaits(process.process.pid))
            stack.enter_context(port)
            process.recording(journal)
            time.sleep(choice.uniform(0.5, 1.5))
            recorder.break_off()
            time.sleep(choice.uniform(0.05, 0.5))
            again = len(recorder.sent)
            recorder.plug()
            process.wait_for("stream again", lambda: len(recorder.sent) > again + 50)  # noqa: B023
            time.sleep(choice.uniform(0.0, 1.0))
            killed_ns, waited_ns = process.kill(), waits.longest_ns(GRACE_NS)
        document = run_recover(folder / "out")
        ramps = checked(source_in(Path(document["journals"][0]["everything"]), "dewetron").records)
        due = sum(1 for _, _, sent_ns in recorder.sent if sent_ns < killed_ns - GRACE_NS - waited_ns)
        ends = sum(recorder.sent[due - 1][:2])
        gap = recorder.sent[again - 1][0] + recorder.sent[again - 1][1], recorder.sent[again][0]
        found = [(one[1], other[0]) for one, other in pairwise(ramps.stretches)]
        lines.append(f"kill {i}: gap of {gap[1] - gap[0]:,} ticks, {ramps.stretches}, due to {ends:,}")
        begins = ramps.stretches[0][0] == recorder.sent[0][0]
        if ramps.wrong or found != [gap] or not begins or ramps.stretches[-1][1] < ends:
            unsound.append(f"{lines[-1]}; gap found {found}, {ramps.wrong} wrong")
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert not unsound, "\n".join(unsound)


def threads_cpu_s(number: int, names: Path) -> dict[str, float]:
    """Return the processor time of each thread of a process that says which is which."""
    found = {}
    for name, thread in json.loads(names.read_text(encoding="utf-8")).items():
        with suppress(OSError):
            found[name] = cpu_s(number, thread)
    return found


def records_of(journal: Log, source: str) -> Iterable[Record]:
    """Return what a journal holds of a source."""
    return journal.records(live_record_of(journal.session, journal.folder).number(source))


def checked(records: Iterable[Record]) -> Ramps:
    """Decode all that a journal or a capture holds of the recorder, and check every sample."""
    ramps: Ramps | None = None
    for pieces in connections_of(records):
        reader: Any = Pieces(pieces)
        with suppress(Ended, ConnectionError):  # a connection that is cut off ends in half a packet
            exactly(reader, 64)
            while True:
                packet = read_packet(reader)
                ramps = ramps or (Ramps(len(packet.data)) if packet.data else None)
                if ramps is not None:
                    ramps.take(packet)
    assert ramps is not None
    return ramps


class Pieces:
    """Bytes in pieces of some size, read as from a socket."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces = pieces
        self._held = memoryview(b"")

    def recv(self, count: int) -> memoryview:
        """Return some bytes; none at the end."""
        while not self._held:
            piece = next(self._pieces, None)
            if piece is None:
                return self._held
            self._held = memoryview(piece)
        taken, self._held = self._held[:count], self._held[count:]
        return taken


def connections_of(records: Iterable[Record]) -> Iterator[Iterator[bytes]]:
    """Yield the bytes of each connection of a source; each must be read to its end before the next."""
    left, over = iter(records), False

    def one_of() -> Iterator[bytes]:
        nonlocal over
        for record in left:
            event = event_of(record)
            if event is not None and event.name == "lost":
                return
            if record.kind == Kind.STREAM:
                yield record.payload
        over = True

    while not over:
        yield one_of()
