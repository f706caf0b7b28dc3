"""A day at the range: each report soon after its shot file, and thirty shots with recorder and worker killed at random.

The recorder and its worker are the real command in processes of their own; buses, port and files of the other
instruments are played from here, so that they go on whatever is killed.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from recoil_rigs.rig import Rig
from recoil_rigs.twin.range_day import RangeDay
from tests.builders.live_rigs import LiveProcess, inline
from tests.builders.machine_stalls import MachineStalls
from tests.builders.virtual_shots import SHORTER, settling_soon, with_twin

SHOTS = int(os.environ.get("RECOIL_DAQ_RANGE_SHOTS", "30"))
LONGEST_ROW = 5
"""Most shots between two kills of the recorder."""
SILENCE_S = 4.0
REPORT_WITHIN_S = 6.0
MOST_STALL_S = 0.25
"""Longest time for which the machine may have stood still where a time of a report is to say anything."""
SYNCED_S = 0.3
"""Time after a shot for which the recorder is left alive: what was sent is on the disk then."""
ENDS_WITHIN_S = 240.0

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and /proc")


def command(*words: object, allowed: tuple[int, ...] = (0, 1)) -> dict[str, Any]:
    """Run a command with --json, and return its document; a verdict against a shot is no fault."""
    arguments = [sys.executable, "-P", "-m", "recoil_daq.cli", *map(str, words), "--json"]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode in allowed, (words, done.stderr)
    document: dict[str, Any] = json.loads(done.stdout or "{}")
    return document


def read(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def written_s(path: Path) -> float:
    return path.stat().st_mtime


def test_each_report_is_there_soon_after_its_shot_file_and_before_the_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with MachineStalls() as machine:
        document = command("demo", "--live", "--out", tmp_path)
    names = [shot["shot"] for shot in document["session"]["shots"]]
    files = [written_s(tmp_path / "live" / f"{name}.h5") for name in names]
    reports = [written_s(tmp_path / "live" / "reports" / name / "report.html") for name in names]
    waits_s = [report - file for file, report in zip(files, reports, strict=True)]
    with capsys.disabled():
        print(f"\nreports after their shot files, s: {', '.join(f'{one:.1f}' for one in waits_s)}")
        print(f"  the machine stood still for {1e3 * machine.largest_s:.0f} ms at most")
    assert names == ["0001", "0002", "0003"]
    if machine.largest_s > MOST_STALL_S:
        pytest.skip("others had the processor: the worker gives way to all of them")
    assert max(waits_s) <= REPORT_WITHIN_S
    assert all(report < file for report, file in zip(reports, files[1:], strict=False))


@dataclass
class Kills:
    """What was killed, and when after the last shot's end, s."""

    recorder_s: list[float] = field(default_factory=list)
    worker: int = 0


def workers_of(pid: int) -> Iterator[int]:
    """Yield the processes that a recorder started for the work on its shots."""
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((path / "stat").read_text().rpartition(")")[2].split()[1])
            said = (path / "cmdline").read_bytes()
        except OSError:
            continue
        if parent == pid and b"multiprocessing" in said and b"resource_tracker" not in said:
            yield int(path.name)


def with_devices(rig: Rig, day: RangeDay, folder: Path) -> Path:
    """Write a rig whose devices are those that a day plays."""
    text = rig.text
    for declared, name in (('{ virtual = "virtual" }', "can"), ('{ virtual = "pty" }', "imu")):
        assert text.count(f"device = {declared}") == 1
        text = text.replace(f"device = {declared}", f"device = {inline(day.devices[name])}")
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    (folder / "mixed.dbc").write_text(rig.databases["mixed.dbc"], encoding="utf-8")
    return path


def row(rig: Rig, first: int, shots: int, folder: Path, choice: random.Random, kills: Kills, *, last: bool) -> None:
    """Fire some shots; the worker is killed at random meanwhile, the recorder at the end, unless they are the last."""
    out, incoming = folder / "shots", folder / "incoming"
    play = {"silence_before_s": SILENCE_S, "transports": {"can": "udp_multicast"}, "seed": first}
    with RangeDay(rig, shots, incoming, first=first, **play) as day:
        path = with_devices(rig, day, folder)
        with LiveProcess(path, out, folder / f"log-{first:04d}.txt", watch=incoming, warms=True) as recorder:
            recorder.wait_for("armed", lambda: armed_in(out))
            day.start()
            for number in range(1, shots + 1):
                # on a busy machine the player is late
                recorder.wait_for(f"shot {number} of {shots}", partial(fired_in, out, number), ENDS_WITHIN_S)
                time.sleep(SYNCED_S)
                if choice.random() < 0.4:
                    time.sleep(choice.uniform(0.0, SILENCE_S - 1.0))
                    for pid in workers_of(recorder.process.pid):
                        os.kill(pid, signal.SIGKILL)
                        kills.worker += 1
            if last:
                recorder.wait_for("all masses", lambda: all_done(out, shots), ENDS_WITHIN_S)
                assert recorder.end(signal.SIGTERM) == 130
            else:
                after_s = choice.uniform(0.0, 12.0)
                time.sleep(after_s)
                assert recorder.process.poll() is None, recorder.said
                recorder.kill()
                kills.recorder_s.append(SYNCED_S + after_s)
        while not day.over:
            time.sleep(0.1)  # camera and recorder drop their files, whoever is there
        day.raise_failure()


def state_in(out: Path) -> dict[str, Any]:
    """Return the state of the session that writes into a folder; empty if none is to be had."""
    try:
        state: dict[str, Any] = json.loads((out / "live.json").read_text())
    except (OSError, ValueError):
        return {}
    return state


def fired_in(out: Path, shots: int) -> bool:
    """Return whether so many shots have triggered, and the last one is over."""
    state = state_in(out)
    return bool(state) and state["triggered"] >= shots and state["state"] == "armed"


def armed_in(out: Path) -> bool:
    """Return whether a session has been armed for longer than it watches its trigger at rest."""
    state = state_in(out)
    return bool(state) and state["state"] == "armed" and state["since_s"] > 1.5


def all_done(out: Path, shots: int) -> bool:
    """Return whether so many shots have their verdicts, and the usable ones their masses."""
    there = state_in(out).get("shots", [])
    done = [one["settled"] and (one["state"] != "usable" or one["mass"] is not None) for one in there]
    return len(done) == shots and all(done)


def test_thirty_shots_in_a_row_lose_nothing_whatever_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    choice, kills = random.Random(), Kills()  # noqa: S311 - a test's choice of moments, no secret
    rig = settling_soon(with_twin("mixed", **SHORTER))
    out, incoming = tmp_path / "shots", tmp_path / "incoming"
    incoming.mkdir()
    began_s, fired = time.monotonic(), 0
    with MachineStalls() as machine:
        while fired < SHOTS:
            shots = min(choice.randint(1, LONGEST_ROW), SHOTS - fired)
            (out / "live.json").unlink(missing_ok=True)
            row(rig, fired + 1, shots, tmp_path, choice, kills, last=fired + shots == SHOTS)
            fired += shots
    names = [f"{n:04d}" for n in range(1, SHOTS + 1)]
    at_once = sum((out / f"{name}.h5").exists() for name in names)
    identified = sum((out / "reports" / name / "report.json").exists() for name in names)
    # what a crash left over is in captures, by the numbers of its shots; the rest is done by hand, as it is said
    assert sorted(path.stem for path in (out / "captures").glob("*.rdlog")) == names
    without = []
    for name in names:
        if not (out / f"{name}.h5").exists():
            files = sorted(incoming.glob(f"{name}_*"))
            assert len(files) == 2
            command("ingest", tmp_path / "rig.toml", out / "captures" / f"{name}.rdlog", *files, "--out", out)
        if not (out / "reports" / name / "report.json").exists():
            words = ("identify", out / f"{name}.h5", "--out", out / "reports", "--overwrite")
            if "error" in command(*words, allowed=(0, 1, 3)):
                without.append(name)
    reports = {name: read(out / "reports" / name / "report.json") for name in names if name not in without}
    summaries = [command("show", out / f"{name}.h5") for name in names]
    lost = {name: one for name, one in zip(names, map(losses, summaries), strict=True) if one}
    with capsys.disabled():
        print(f"\n{SHOTS} shots in {time.monotonic() - began_s:.0f} s; the recorder was killed")
        print(f"  {', '.join(f'{one:.1f}' for one in kills.recorder_s)} s after a shot's end,")
        print(f"  and the worker {kills.worker} times; the machine stood still for {machine.largest_s:.2f} s at most")
        print(f"  {at_once} had their shot file, {identified} their mass before anybody did anything by hand")
        usable, valid = sum(one["usable"] for one in summaries), sum(one["valid"] for one in reports.values())
        print(f"  usable {usable}, masses valid {valid}, without a mass {len(without)}")
    assert not lost
    assert not list(out.rglob("*.partial*"))
    for name, report in reports.items():
        assert report["shot"] == name
        assert report["mass"]["value"] == pytest.approx(782.0, rel=0.1)
    # what the player sent late, because the machine did nothing for so long, no clock can be aligned by
    assert not without or machine.largest_s > MOST_STALL_S


def losses(summary: dict[str, Any]) -> list[str]:
    """Name the frames of the bus that a shot lacks: its messages are counted, and the player left none out."""
    return [
        one["detail"]
        for one in summary["quality"]
        if one["channel"] == "can" and one["check"] == "missing frames" and one["verdict"] != "ok"
    ]
