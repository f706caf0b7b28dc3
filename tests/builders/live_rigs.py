"""Rig files with real transports (pseudo-terminals, a multicast bus), and the process that acquires from them.

The playing test and the acquiring process are two processes, so that one can be killed and the other knows what it sent.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from rigs.twin.transports import MulticastBus

REPOSITORY = Path(__file__).resolve().parents[2]

LEVEL_M_S2 = 50.0
"""The trigger's level, on the acceleration that the first port delivers."""

_SMALL_SEGMENTS = (
    "import daq.capture.live_session as session; session.SEGMENT_BYTES = {size}; import recoil_daq.cli as cli; cli.main()"
)


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
) -> Path:
    """Write the bundled rig `mixed` and its database into a folder, its devices replaced.

    The recorder and the camera stay declared, and have no device: captures of a shot are kept for their files.

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

    Returns
    -------
    Path
        The rig file.
    """
    text = (files("rigs") / "mixed.toml").read_text(encoding="utf-8")
    (folder / "mixed.dbc").write_text((files("rigs") / "mixed.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    text = _replaced(text, 'device = { virtual = "virtual" }', "" if bus is None else f"device = {_inline(bus)}")
    text = _replaced(text, 'device = { virtual = "pty" }', f"device = {_inline(_port(ports[0], baudrate))}")
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


def _inline(table: Mapping[str, Any]) -> str:
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
    segment_bytes : int, optional
        Size of the journal's segments, where a test must fill them in seconds.
    """

    def __init__(self, rig: Path, out: Path, log: Path, *, segment_bytes: int | None = None) -> None:
        program = ["-m", "recoil_daq.cli"]
        if segment_bytes is not None:
            program = ["-c", _SMALL_SEGMENTS.format(size=segment_bytes)]
        command = [sys.executable, *program, "ingest", str(rig), "--live", "--no-screen", "--out", str(out)]
        self.out = out
        self._log = log
        self._before = set(self._journals())
        with log.open("wb") as stream:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT, cwd=REPOSITORY
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

    def wait_for(self, what: str, there: Callable[[], Any], within_s: float = 30.0) -> Any:
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
        segment = folder / "000001.journal"
        first = segment.stat().st_mtime_ns
        self.wait_for("growing journal", lambda: segment.stat().st_mtime_ns > first)

    def captured(self) -> list[str]:
        """Return the shots whose captures are written."""
        return sorted(p.name for p in (self.out / "captures").glob("*") if not p.name.startswith("."))

    def kill(self) -> int:
        """Kill it at once; return the host's monotonic time of the moment before, ns."""
        before_ns = time.monotonic_ns()
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        return before_ns

    def end(self, number: int, within_s: float = 20.0) -> int:
        """Send it a signal, wait for its end and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(within_s)

    def _journals(self) -> list[Path]:
        return [path.parent for path in (self.out / "journal").glob("*/000001.journal")]


def run_recover(*words: object) -> dict[str, Any]:
    """Run `recoil-daq recover ... --json` and return its document."""
    command = [sys.executable, "-m", "recoil_daq.cli", "recover", *map(str, words), "--json"]
    done = subprocess.run(command, capture_output=True, cwd=REPOSITORY, check=False)
    assert done.returncode == 0, f"recover ended with {done.returncode}: {os.fsdecode(done.stderr)}"
    document: dict[str, Any] = json.loads(done.stdout)
    return document
