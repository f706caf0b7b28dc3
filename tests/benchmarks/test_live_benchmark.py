"""The armed acquisition in its own process: fifty kills, and a full bus with two fast ports for as long as asked."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.session_record import live_record_of
from recoil_acquisition.devices.device import EVENT
from recoil_acquisition.frames.can_rows import parse_rows
from recoil_acquisition.log.folder import Log, open_log
from recoil_acquisition.shot.acquisition import Acquisition
from tests.builders.live_rigs import LiveProcess, armed, kill_and_recover, multicast_device, write_live_rig
from tests.builders.page_viewers import PageViewers
from tests.builders.port_player import FRAME_BYTES, NOTHING, BusPlayer, Player, PortPlayer, Tally, tally

KILLS, IDLE_READERS = 50, 200

SECONDS = float(os.environ.get("RECOIL_DAQ_SOAK_S", "60"))
"""How long the soak plays."""

FRAMES_PER_S = 8000.0
PORT_BYTES_PER_S = 92_160.0
SHOT_EVERY_S = 20.0
MOST_MB = 300.0
MOST_GROWTH_MB = 10.0

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and /proc")


def test_fifty_kills_lose_nothing_that_was_sent_a_quarter_of_a_second_before(tmp_path, capsys):
    choice = random.Random()  # noqa: S311 - a test's choice of moments, no secret
    port, bus, cuts = NOTHING, NOTHING, 0
    due = found = wrong = 0
    tails_ms, waits_ms, unsound = [], [], []
    for i in range(KILLS):
        with armed(tmp_path / str(i)) as one:
            ends = time.monotonic() + choice.uniform(0.7, 3.0)
            while (left_s := ends - time.monotonic()) > 0:
                one.port.fire()
                time.sleep(min(left_s, one.post_s + choice.uniform(0.1, 0.4)))
            cuts += one.cutting()
            done = kill_and_recover(one)
        port, bus = port + done.port, bus + done.bus
        tails_ms.append(1e3 * done.tail_s)
        waits_ms.append(1e3 * done.waited_s)
        due, found, wrong = due + done.shots_due, found + done.shots_found, wrong + done.shots_wrong
        if not done.sound:
            unsound.append(f"kill {i}: {done.port}, {done.bus}, {done.shots_found} of {done.shots_due} shots")
    with capsys.disabled():
        print(f"\n{KILLS} kills, {cuts} of them during a cut; what was sent 250 ms before the kill is due:")
        for name, one_tally in (("port", port), ("bus", bus)):
            print(f"  {name}: {_words(one_tally)}")
        print(f"  shots: {due} due, {found} recovered, {wrong} wrong")
        print(
            f"  lost before a kill: the last {np.median(tails_ms):.0f} ms as a rule, {max(tails_ms):.0f} ms at worst;"
        )
        print(f"    waiting for the machine, which is added to the 250 ms: {max(waits_ms):.0f} ms at worst")
    assert not unsound, "\n".join(unsound)


def _words(one: Tally) -> str:
    return (
        f"{one.sent:,} frames sent, {one.due:,} due, {one.found:,} recovered, {one.lost} lost, {one.wrong} wrong,"
        f" {one.doubled} doubled, {one.disordered} out of order"
    )


@pytest.mark.parametrize("viewers", [0, 5])
def test_a_full_bus_and_two_fast_ports_are_recorded_without_a_loss(tmp_path, capsys, viewers: int):
    device = multicast_device()
    with ExitStack() as stack:
        bus = BusPlayer(device, FRAMES_PER_S)
        stack.callback(bus.stop)
        ports = [PortPlayer(f"port{i}", PORT_BYTES_PER_S / FRAME_BYTES, most=16) for i in range(2)]
        for port in ports:
            stack.callback(port.stop)
        rig = write_live_rig(tmp_path, [port.path for port in ports], device, pre_s=0.5, post_s=1.5)
        process = stack.enter_context(LiveProcess(rig, tmp_path / "out", tmp_path / "log.txt", warms=True))
        folder = process.journal()
        began = time.monotonic()
        for player in (bus, *ports):
            stack.enter_context(player)
        process.recording(folder)
        seen = None if not viewers else stack.enter_context(PageViewers(tmp_path / "out", viewers, IDLE_READERS))
        watched = watch(process, ports[0], SECONDS, Kept(folder, tmp_path / "kept"))
        for player in (bus, *ports):
            player.end()
        played_s = time.monotonic() - began
        served = (
            "" if seen is None else f"{seen.answers} states read, {seen.failures} not, {seen.cpu_s:.1f} s of processor"
        )
        time.sleep(0.5)
        drops = dropped_datagrams(device["port"], but_of=os.getpid())
        assert process.end(signal.SIGTERM, 60.0) == 130, process.said
    journal = open_log(tmp_path / "kept")
    found = {"can": (bus, *bus_numbers(journal, bus))} | {
        name: (port, *port.numbers_in(b"".join(payloads_of(journal, name))))
        for name, port in zip(("imu", "imu2"), ports, strict=True)
    }
    tallies = {name: tally(*one, time.monotonic_ns()) for name, one in found.items()}
    captures = sorted((tmp_path / "out" / "captures").glob("*.rdlog"))
    shots = [one for path in captures if (one := acquisition_in(path)) is not None]
    survey = journal.survey()
    with capsys.disabled():
        print(f"\nplayed for {played_s:.0f} s; datagrams that the kernel dropped: {drops}")
        for name, one in tallies.items():
            print(f"  {name}: {one.sent / played_s:,.0f}/s; {_words(one)}")
            if one.lost:
                print(f"    {gaps(*found[name][:2], watched)}")
        if served:
            print(f"  {viewers} viewers beside {IDLE_READERS} idle readers: {served}")
        lag = lags_ms(journal, bus)
        print(
            f"  can: read {np.median(lag):.1f} ms after sending, one in a thousand {np.quantile(lag, 0.999):.0f} ms or"
        )
        print(f"    more, {lag.max():.0f} ms at most")
        print(f"  journal: {survey.records:,} records, {survey.lost_records} lost,")
        print(f"    {survey.damaged_bytes} bytes damaged")
        left = sum(1 for path in folder.glob("*.rdlog"))
        print(f"    in {len(journal.segments)} segments, {left} of them still with the session")
        print(f"  {watched.words}; players' processor share {sum(p.cpu_s for p in (bus, *ports)) / played_s:.2f}")
        print(f"  shots: {len(watched.fired_ns)} fired, {len(shots)} captured, {_losses(shots)} losses told of")
    for name, one in tallies.items():
        assert one.sound, f"{name}: {one}"
        assert one.found == one.sent
    assert seen is None or (seen.failures == 0 and seen.answers > 0)
    assert drops == 0
    assert (survey.lost_records, survey.damaged_bytes) == (0, 0)
    assert len(shots) == len(watched.fired_ns)
    assert watched.cpu_share < 1.0
    assert max(watched.memory_mb) < MOST_MB
    assert watched.growth_mb < MOST_GROWTH_MB


@dataclass
class Watched:
    """What a process cost while it was watched.

    Attributes
    ----------
    memory_mb : list of float
        Resident memory, once a second.
    cpu_share : float
        Processor time per time, of all its threads.
    fired_ns : list of int
        When each pulse was sent.
    """

    memory_mb: list[float] = field(default_factory=list)
    cpu_share: float = 0.0
    fired_ns: list[int] = field(default_factory=list)

    @property
    def growth_mb(self) -> float:
        """By how much the memory went up over the last three quarters, at most."""
        late = self.memory_mb[len(self.memory_mb) // 4 :]
        return max(late) - late[0]

    @property
    def words(self) -> str:
        """All of it in one line."""
        memory = self.memory_mb
        return (
            f"acquiring process: memory {memory[0]:.0f} MB at first, {memory[len(memory) // 4]:.0f} after a quarter,"
            f" {memory[-1]:.0f} at the end, {max(memory):.0f} at most; processor share {self.cpu_share:.2f}"
        )


class Kept:
    """A second name of every segment of a journal, so that one that its writer removes can be read all the same.

    Parameters
    ----------
    journal, folder : Path
    """

    def __init__(self, journal: Path, folder: Path) -> None:
        self._journal, self._folder = journal, folder
        folder.mkdir()
        self.look()

    def look(self) -> None:
        """Name the segments that are new; they are made before they are needed."""
        for segment in self._journal.glob("*.rdlog"):
            name = self._folder / segment.name
            if not name.exists():
                name.hardlink_to(segment)


def watch(process: LiveProcess, port: PortPlayer, seconds: float, kept: Kept) -> Watched:
    """Let a shot fire every now and then, and look at the acquiring process meanwhile."""
    watched, number = Watched(), process.process.pid
    began, began_cpu_s = time.monotonic(), cpu_s(number)
    while (passed_s := time.monotonic() - began) < seconds:
        assert process.process.poll() is None, process.said
        if passed_s >= 1.0 + SHOT_EVERY_S * len(watched.fired_ns) and seconds - passed_s > 3.0:
            watched.fired_ns.append(port.returned_ns[port.fire()])
        watched.memory_mb.append(resident_mb(number))
        kept.look()
        time.sleep(1.0)
    watched.cpu_share = (cpu_s(number) - began_cpu_s) / (time.monotonic() - began)
    return watched


def resident_mb(number: int) -> float:
    """Return the resident memory of a process."""
    return int(Path(f"/proc/{number}/statm").read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def cpu_s(number: int, thread: int | None = None) -> float:
    """Return the processor time of a process, its threads together, or of one of them."""
    of = Path(f"/proc/{number}") if thread is None else Path(f"/proc/{number}/task/{thread}")
    columns = (of / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(columns[11]) + int(columns[12])) / os.sysconf("SC_CLK_TCK")


def dropped_datagrams(port: int, but_of: int) -> int:
    """Return what the sockets on a port lost, those of one process left out: the player never reads its own."""
    links = [str(path.readlink()) for path in Path(f"/proc/{but_of}/fd").iterdir() if path.is_symlink()]
    own = {link[8:-1] for link in links if link.startswith("socket:[")}
    rows = [row.split() for row in Path("/proc/net/udp").read_text(encoding="utf-8").splitlines()[1:]]
    others = [row for row in rows if int(row[1].rpartition(":")[2], 16) == port and row[9] not in own]
    assert len(others) == 1, f"{len(others)} sockets listen to the bus"
    return int(others[0][12])


def payloads_of(journal: Log, source: str) -> Iterator[bytes]:
    """Yield what a journal holds of a source's data, in pieces of some size."""
    record = live_record_of(journal.session, journal.folder)
    held: list[bytes] = []
    for one in journal.records(record.number(source)):
        if record.block(one).kind != EVENT:
            held.append(one.payload)
        if len(held) >= 1000:
            yield b"".join(held)
            held = []
    yield b"".join(held)


def bus_numbers(journal: Log, bus: BusPlayer) -> tuple[NDArray[np.int64], int]:
    found = [bus.numbers_in(parse_rows(payload)) for payload in payloads_of(journal, "can")]
    return np.concatenate([numbers for numbers, _ in found]), sum(wrong for _, wrong in found)


def lags_ms(journal: Log, bus: BusPlayer) -> NDArray[np.float64]:
    """Return the time from the sending of each message of a bus to its reading, shape (n_messages,)."""
    sent_ns = np.array(bus.returned_ns, dtype=np.int64)
    lags = []
    for payload in payloads_of(journal, "can"):
        records = parse_rows(payload)
        numbers = records["data"][:, :4].copy().view("<u4").ravel()
        known = numbers < sent_ns.size
        lags.append((records["host_ns"][known] - sent_ns[numbers[known]]) / 1e6)
    return np.concatenate(lags)


def gaps(player: Player, numbers: NDArray[np.int64], watched: Watched) -> str:
    """Say where frames are missing: how many, and when they were sent after a shot was fired."""
    there = np.zeros(len(player.returned_ns), dtype=bool)
    there[numbers[numbers < there.size]] = True
    edges = np.flatnonzero(np.diff(there.astype(np.int8), prepend=1, append=1))
    places = []
    for first, behind in edges.reshape(-1, 2)[:10].tolist():
        sent_ns = player.returned_ns[first]
        since = [(sent_ns - ns) / 1e9 for ns in watched.fired_ns if ns <= sent_ns]
        places.append(
            f"{behind - first} sent {since[-1]:.2f} s after a shot" if since else f"{behind - first} at first"
        )
    return f"{edges.size // 2} gaps: " + "; ".join(places)


def _losses(shots: list[Acquisition]) -> int:
    """Return what the records of the shots tell of losses, over all their sources."""
    return sum(s.bad + s.reopened + (s.kernel_drops or 0) for shot in shots for s in shot.sources)
