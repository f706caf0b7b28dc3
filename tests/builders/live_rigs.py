"""Rig files with real transports (pseudo-terminals, a multicast bus), and the process that acquires from them.

The test that plays and the process that acquires are two: one can be killed while the other knows what it sent.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from typer.testing import CliRunner

from recoil_acquisition.capture.cut import acquisition_in
from recoil_daq.cli import app
from recoil_rigs.twin.transports import MulticastBus
from tests.builders.machine_waits import MachineWaits
from tests.builders.port_player import BusPlayer, Player, PortPlayer, Tally, tally

REPOSITORY = Path(__file__).resolve().parents[2]

LEVEL_M_S2 = 50.0
"""The trigger's level, on the acceleration that the first port delivers."""

SEGMENTS_OF_256_KIB = """
import recoil_acquisition.capture.live_session
recoil_acquisition.capture.live_session.SEGMENT_BYTES = 1 << 18
"""
"""For `LiveProcess`: the journal's segments fill up in seconds."""

RECORDER_CHANNELS = 4
"""Channels that the bundled rig's recorder has."""

_MORE = """[[channel]]
name = "more_{number}"
source = "dewetron"
signal = "AI {number}"
quantity = "acceleration"
unit = "m/s2"
polarity = 1

"""

UNDECIDED = """
import recoil_acquisition.capture.live_session
recoil_acquisition.capture.live_session.LiveSession._look = lambda session, now_s: None
"""
"""For `LiveProcess`: its watching thread is so far behind that no decision of the trigger is recorded."""

COLD = """
import recoil_daq.live.acquisition
recoil_daq.live.acquisition._WARM = "builtins:repr"
"""
"""For `LiveProcess`: nothing is converted beforehand, which takes as long as a test does."""

HELD_BACK = """
import collections, time
from recoil_acquisition.devices.reader_thread import DeviceReader
hand_on, held = DeviceReader._hand_on, collections.defaultdict(collections.deque)
def late(reader, block):
    held[reader].append((time.monotonic() + 0.35, block))
    while held[reader][0][0] <= time.monotonic():
        hand_on(reader, held[reader].popleft()[1])
DeviceReader._hand_on = late
"""
"""For `LiveProcess`: a program with a fault, which writes down every block 0.35 s late."""


def multicast_device() -> dict[str, Any]:
    """Return a ``device`` table of a bus that two processes of this computer share, on a port that is free."""
    return dict(MulticastBus().device)


def write_live_rig(
    folder: Path,
    ports: Sequence[Path],
    bus: Mapping[str, Any] | None = None,
    *,
    pre_s: float = 0.1,
    post_s: float = 0.4,
    holdoff_s: float = 0.0,
    baudrate: int = 921600,
    recorder: Mapping[str, Any] | None = None,
    recorder_channels: int = RECORDER_CHANNELS,
) -> Path:
    """Write the bundled rig `mixed` and its database into a folder, its devices replaced.

    The recorder and the camera stay declared, and have no device: captures of a shot are kept for their files. A
    recorder that is given one streams as many channels as are asked for; those beyond its own are ``AI 5`` and so on.

    Parameters
    ----------
    folder : Path
    ports : sequence of Path
        Of the sources ``imu``, ``imu2``, ``imu3``, ...; the trigger is on ``imu_acc_x`` of the first.
    bus : mapping, optional
        ``device`` table of the source ``can``; without it that source is not read live.
    pre_s, post_s, holdoff_s : float
        Of the trigger.
    baudrate : int
        A pseudo-terminal takes every rate; the space that is reserved depends on it.
    recorder : mapping, optional
        ``device`` table of the source ``dewetron``.
    recorder_channels : int

    Returns
    -------
    Path
        The rig file.
    """
    text = (files("recoil_rigs") / "mixed.toml").read_text(encoding="utf-8")
    (folder / "mixed.dbc").write_text(
        (files("recoil_rigs") / "mixed.dbc").read_text(encoding="utf-8"), encoding="utf-8"
    )
    text = _replaced(text, 'device = { virtual = "virtual" }', "" if bus is None else f"device = {inline(bus)}")
    text = _replaced(text, 'device = { virtual = "pty" }', f"device = {inline(_port(ports[0], baudrate))}")
    start, stop = text.index('[[source]]\nname = "imu"'), text.index('[[source]]\nname = "camera"')
    source = text[start:stop]
    start = text.index('[[channel]]\nname = "imu_acc_x"')
    channel = text[start : text.index("\n\n", start)]
    head, rest = text.split("# ---- channels ----", 1)
    channels, rest = rest.split("# ---- when a live shot begins", 1)
    _, twin = rest.split("# ---- the virtual rig", 1)
    for i, port in enumerate(ports[1:], 2):
        head += _replaced(source, '"imu"', f'"imu{i}"').replace('"*_imu.*"', f'"*_imu{i}.*"').replace(
            'channel = "imu_acc_x"', f'channel = "imu{i}_acc_x"'
        ).replace(str(ports[0]), str(port))  # fmt: skip
        channels += _replaced(channel, '"imu_acc_x"', f'"imu{i}_acc_x"').replace('"imu"', f'"imu{i}"') + "\n\n"
    if recorder is not None:
        head = _replaced(head, 'match = "*_dewetron.csv"', f'device = {inline(recorder)}\nmatch = "*_dewetron.csv"')
        channels += "".join(_MORE.format(number=i) for i in range(RECORDER_CHANNELS + 1, recorder_channels + 1))
    trigger = (
        f"[trigger]\npre_s = {pre_s}\npost_s = {post_s}\nholdoff_s = {holdoff_s}\n\n[[trigger.any]]\n"
        f'channel = "imu_acc_x"\nkind = "edge"\nlevel = {LEVEL_M_S2}\nrearm = {LEVEL_M_S2 / 2}\nslope = "rising"\n\n'
    )
    path = folder / "rig.toml"
    path.write_text(f"{head}# ---- channels ----{channels}{trigger}# ---- the virtual rig{twin}", encoding="utf-8")
    return path


def _replaced(text: str, old: str, new: str) -> str:
    if old not in text:
        raise ValueError(f"the bundled rig has no {old!r} any more")
    return text.replace(old, new)


def inline(table: Mapping[str, Any]) -> str:
    return "{ " + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + " }"


def _port(path: Path, baudrate: int) -> dict[str, Any]:
    return {"port": str(path), "baudrate": baudrate}


class LiveProcess:
    """`recoil-daq ingest RIG --live` in a process of its own, with plain lines.

    Parameters
    ----------
    rig, out : Path
    log : Path
        Gets what it prints.
    before : str
        Python statements that it runs first: `SEGMENTS_OF_256_KIB`, `UNDECIDED`, `HELD_BACK`.
    warms : bool
        Whether the process beside it converts a virtual shot while it is armed.
    cwd : Path
        Its working folder.
    watch : Path, optional
        Folder into which other instruments drop their files.
    """

    def __init__(
        self,
        rig: Path,
        out: Path,
        log: Path,
        *,
        before: str = "",
        warms: bool = False,
        cwd: Path = REPOSITORY,
        watch: Path | None = None,
    ) -> None:
        program = f"{'' if warms else COLD}{before}\nfrom recoil_daq.cli import main\nmain()"
        command = [sys.executable, "-P", "-c", program, "ingest", str(rig), "--live", "--no-screen", "--out", str(out)]
        command += [] if watch is None else ["--watch", str(watch)]
        self.out = out
        self._log = log
        self._before = set(self._journals())
        with log.open("wb") as stream:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT, cwd=cwd
            )

    def __enter__(self) -> LiveProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()

    @property
    def said(self) -> str:
        """What it has printed so far."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, what: str, there: Callable[[], Any], within_s: float = 120.0) -> Any:
        """Wait until something is there, and return it; AssertionError if it never is, or the process ends first."""
        ends = time.monotonic() + within_s
        while True:
            if found := there():
                return found
            assert self.process.poll() is None, f"ended with {self.process.returncode} before {what}:\n{self.said}"
            assert time.monotonic() < ends, f"no {what} within {within_s:g} s:\n{self.said}"
            time.sleep(0.0005)

    def journal(self) -> Path:
        """Wait until its devices are open and its journal is there; return the folder."""
        made = self.wait_for("journal", lambda: [p for p in self._journals() if p not in self._before])
        assert len(made) == 1
        folder: Path = made[0]
        return folder

    def recording(self, folder: Path) -> None:
        """Wait until its journal grows after this call."""
        segment = folder / "000001.rdlog"
        first = segment.stat().st_mtime_ns
        self.wait_for("growing journal", lambda: segment.stat().st_mtime_ns > first)

    def kill(self) -> int:
        """Kill it at once; return the host's monotonic time of the moment before, ns."""
        before_ns = time.monotonic_ns()
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        return before_ns

    def end(self, number: int, within_s: float = 60.0) -> int:
        """Send it a signal, wait for its end and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(within_s)

    def _journals(self) -> list[Path]:
        return [path.parent for path in (self.out / "journal").glob("*/000001.rdlog")]


def run_recover(*words: object) -> dict[str, Any]:
    """Run `recoil-daq recover ... --json` in this process and return its document."""
    done = CliRunner().invoke(app, ["recover", *map(str, words), "--json"])
    assert done.exit_code == 0, done.output
    document: dict[str, Any] = json.loads(done.stdout)
    return document


PRE_S, POST_S = 0.1, 0.6
GRACE_NS = 250_000_000
"""What was sent so long before a kill must be there; earlier by as long as the machine has let the acquisition, or what
was sent to it, wait within that time."""

LEAST_DUE = 300
"""Frames of each source that must be due for a kill to say anything."""

SHOT_END_NS = 250_000_000
"""So long before the end of a shot what was sent must be in its captures."""

AT_THE_TRIGGER_NS = 20_000_000
"""By so much the trigger's instant may lie before the return of the write of its frame."""


@dataclass(frozen=True, eq=False)
class Armed:
    """An acquisition that records what is played to it.

    Attributes
    ----------
    process : LiveProcess
    rig, out : Path
    journal : Path
    port : PortPlayer
    bus : BusPlayer
    post_s : float
    waits : MachineWaits
        Of the acquiring process.
    """

    process: LiveProcess
    rig: Path
    out: Path
    journal: Path
    port: PortPlayer
    bus: BusPlayer
    post_s: float
    waits: MachineWaits

    @property
    def due(self) -> int:
        """How many frames of each source must be there if it were killed now."""
        deadline_ns = time.monotonic_ns() - GRACE_NS - self.waits.longest_ns(GRACE_NS)
        return min(self.port.sent_before(deadline_ns), self.bus.sent_before(deadline_ns))

    @property
    def pulses_due(self) -> bool:
        """Whether every pulse must be in a shot if it were killed within a twentieth of a second."""
        deadline_ns = time.monotonic_ns() - SHOT_END_NS - 50_000_000 - self.waits.longest_ns(GRACE_NS)
        sent_ns = self.port.returned_ns
        return all(pulse < len(sent_ns) and sent_ns[pulse] < deadline_ns for pulse in self.port.pulses)

    def cutting(self) -> bool:
        """Return whether a capture is being written."""
        return any((self.out / "captures").glob(".*.partial"))


@contextmanager
def armed(
    folder: Path, *, out: Path | None = None, post_s: float = POST_S, before: str = "", warms: bool = False
) -> Iterator[Armed]:
    """Start an acquisition of a port and a bus with 1,000 frames/s each, and play to it from the moment it is open."""
    folder.mkdir(exist_ok=True)
    out = folder / "out" if out is None else out
    bus, port = BusPlayer(device := multicast_device()), PortPlayer("port")
    rig = write_live_rig(folder, [port.path], device, pre_s=PRE_S, post_s=post_s)
    try:
        with LiveProcess(rig, out, folder / "log.txt", before=before, warms=warms) as process:
            journal = process.journal()
            with bus, port, MachineWaits(process.process.pid) as waits:
                process.recording(journal)
                time.sleep(0.3)  # the first pulse has its pre-time, and the trigger is armed
                yield Armed(process, rig, out, journal, port, bus, post_s, waits)
    finally:
        port.stop()
        bus.stop()


@dataclass(frozen=True)
class Killed:
    """What a recovery found after a kill.

    Attributes
    ----------
    port, bus : Tally
    tail_s : float
        How long before the kill the first of the last frames was sent that were not found.
    waited_s : float
        By how much the acquiring process was late at the kill without a fault of its own, see `GRACE_NS`.
    shots_due, shots_found, shots_wrong : int
        Triggered early enough before the kill; of these, recovered; recovered without a pulse or with data missing.
    shots_told, shots : int
        Triggers that the session had told of; shots recovered.
    document : mapping
        Of `recoil-daq recover --json`.
    """

    port: Tally
    bus: Tally
    tail_s: float
    waited_s: float
    shots_due: int
    shots_found: int
    shots_wrong: int
    shots_told: int
    shots: int
    document: Mapping[str, Any]

    @property
    def sound(self) -> bool:
        """Whether nothing is lost, wrong or doubled."""
        shots = self.shots_found == self.shots_due and not self.shots_wrong and self.shots >= self.shots_told
        return self.port.sound and self.bus.sound and shots


def kill(one: Armed) -> tuple[int, int]:
    """Kill an acquisition once enough is due; return the time before it, and for how long it was let wait, ns."""
    one.process.wait_for("frames and pulses that are due", lambda: one.due > 1.1 * LEAST_DUE and one.pulses_due)
    waited_ns = one.waits.longest_ns(GRACE_NS)
    return one.process.kill(), waited_ns


def kill_and_recover(one: Armed) -> Killed:
    """Kill an acquisition, recover its journal, and compare what comes back with what was sent."""
    killed_ns, waited_ns = kill(one)
    one.port.stop()
    one.bus.stop()
    return recovered(one, killed_ns, run_recover(one.out), waited_ns=waited_ns)


def recovered(one: Armed, killed_ns: int, document: Mapping[str, Any], *, waited_ns: int) -> Killed:
    """Compare what was recovered, in the document's first journal, with what was sent."""
    journal = document["journals"][0]
    deadline_ns = killed_ns - GRACE_NS - waited_ns
    everything = Path(journal["everything"])
    numbers, wrong = one.port.numbers(everything, "imu")
    port, port_tail_s = tally(one.port, numbers, wrong, deadline_ns), _tail_s(one.port, numbers, killed_ns)
    numbers, wrong = one.bus.numbers(everything, "can")
    bus, bus_tail_s = tally(one.bus, numbers, wrong, deadline_ns), _tail_s(one.bus, numbers, killed_ns)
    pulses = {pulse: one.port.returned_ns[pulse] for pulse in one.port.pulses if pulse < len(one.port.returned_ns)}
    found, wrong, within = set(), 0, set()
    for shot in journal["shots"]:
        capture = Path(shot["capture"])
        record = acquisition_in(capture)
        assert record is not None
        own = [p for p, ns in pulses.items() if ns - AT_THE_TRIGGER_NS <= record.trigger_ns][-1:]
        # read late, and dated so, a trigger has the next pulse in its post time: that one is in its shot
        stop_ns = record.trigger_ns + round(one.post_s * 1e9)
        within |= {p for p, ns in pulses.items() if record.trigger_ns + AT_THE_TRIGGER_NS < ns < stop_ns}
        if len(own) != 1 or own[0] in found or not _holds(one, record.trigger_ns, capture, deadline_ns):
            wrong += 1
        found |= set(own)
    due = {pulse for pulse, ns in pulses.items() if ns < killed_ns - SHOT_END_NS - waited_ns} - within
    told = len(re.findall(r"  trigger \(imu_acc_x at ", one.process.said))
    return Killed(
        port, bus, max(port_tail_s, bus_tail_s), waited_ns / 1e9,
        len(due), len(due & found), wrong, told, len(journal["shots"]), document,
    )  # fmt: skip


def _tail_s(player: Player, numbers: NDArray[np.int64], killed_ns: int) -> float:
    """Return how long before the kill the first frame behind all that were found was sent."""
    first = int(numbers.max(initial=-1)) + 1
    return max(killed_ns - player.returned_ns[first], 0) / 1e9 if first < len(player.returned_ns) else 0.0


def _holds(one: Armed, trigger_ns: int, capture: Path, deadline_ns: int) -> bool:
    """Return whether a shot's capture has what was sent from its trigger to just before its end, in order.

    The host dates what it reads when it reads it, on a busy machine late: both ends of a shot are off by that.
    """
    stop_ns = min(trigger_ns + round(one.post_s * 1e9) - SHOT_END_NS, deadline_ns)
    for player, source in ((one.port, "imu"), (one.bus, "can")):
        numbers, _ = player.numbers(capture, source)
        first, last = player.sent_before(trigger_ns), player.sent_before(stop_ns) - 1
        if not numbers.size or (numbers[1:] - numbers[:-1] != 1).any() or numbers[0] > first or numbers[-1] < last:
            return False
    return True
