"""The mass after a live shot: what it costs from the last file on, what thinning changes, and kills of its worker."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import OWN, Kind
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.shot import LiveOptions, LiveShot, ShotState
from recoil_daq.live.shots.conversion import Conversion
from recoil_daq.live.shots.mass_work import MassWork
from recoil_daq.live.shots.preview import LARGE_DIFFERENCE
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.identify import identify_file
from recoil_daq.reports.stored_shot import read_stored
from recoil_daq.warm_worker import WarmWorker
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.shot.thinned import THINNED_TO_HZ
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.live_rigs import GRACE_NS, armed
from tests.builders.port_player import tally
from tests.builders.range_session import Told
from tests.builders.virtual_shots import settling_soon

MOST_CPU_S, MOST_WALL_S = 1.0, 3.0
"""From the last file of a `mixed` shot to its report, on idle cores."""
MOST_FAST_CPU_S = 2.5
"""As above, of four channels of 200 kHz for two seconds."""
SHOTS = int(os.environ.get("RECOIL_DAQ_MASS_SHOTS", "50"))
KILLED_SHOTS = int(os.environ.get("RECOIL_DAQ_KILLED_SHOTS", "30"))
PULSES = int(os.environ.get("RECOIL_DAQ_PULSES", "40"))

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc and SIGKILL")


def cpu_s(pid: int) -> float:
    """Processor time of a process, of those that it has, and of those that it had."""
    tick, total, tree = os.sysconf("SC_CLK_TCK"), 0.0, {pid}
    stats = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        stats[int(path.parent.name)] = int(fields[1]), sum(map(int, fields[11:15])) / tick
    while found := {one for one, (parent, _) in stats.items() if parent in tree} - tree:
        tree |= found
    for one in tree & stats.keys():
        total += stats[one][1]
    return total


@dataclass
class Warm:
    """A worker, warmed as an armed range does it."""

    worker: WarmWorker
    rig: Rig
    out: Path

    @property
    def pid(self) -> int:
        (number,) = self.worker._processes._pool._processes  # type: ignore[union-attr]
        return int(number)

    def shot(self, name: str, files: tuple[Path, ...]) -> tuple[float, float, LiveShot]:
        """Convert and identify a shot; return processor time and time from its files to its report."""
        masses = MassWork(self.worker, self.out, Told())
        before_s, began_s = cpu_s(self.pid), time.monotonic()
        conversion = Conversion(self.rig, files, name, self.out, worker=self.worker)
        (_, document), *_ = waited(lambda: [found] if (found := conversion.result()) is not None else [])
        shot = LiveShot(name, state=ShotState.USABLE, document=document)
        masses.begin(shot)

        def identified() -> list[bool]:
            masses.look()
            return [True] if shot.mass is not None else []

        waited(identified)
        took = cpu_s(self.pid) - before_s, time.monotonic() - began_s, shot
        masses.close()
        while self.worker._under_way is not None or self.worker._waiting:
            self.worker.look()
            time.sleep(0.01)
        return took


def waited(there: Callable[[], list[Any]]) -> list[Any]:
    ends_s = time.monotonic() + 300.0
    while not (found := there()):
        assert time.monotonic() < ends_s
        time.sleep(0.01)
    return found


@pytest.fixture
def warm(tmp_path: Path) -> Iterator[Warm]:
    worker, rig = WarmWorker(), load_rig("mixed")
    asked = worker.ask("recoil_daq.reports.shot_mass:warm", (rig.path, None, True))
    while not asked.done:
        worker.look()
        time.sleep(0.01)
    yield Warm(worker, rig, tmp_path / "out")
    worker.close()


def test_a_usual_shot_has_its_report_soon_the_first_one_too(warm: Warm, tmp_path: Path, capsys) -> None:
    shots = [simulate_shot(warm.rig, tmp_path / f"{k}", seed=50 + k, shot=f"{k + 1:04d}") for k in range(6)]
    found = [warm.shot(one.shot, tuple(one.files))[:2] for one in shots]
    with capsys.disabled():
        print("\nmixed, from its files to its report, first shot first: processor s, s")
        print("  " + ", ".join(f"{cpu:.2f} {wall:.2f}" for cpu, wall in found))
    assert max(cpu for cpu, _ in found) <= MOST_CPU_S
    assert max(wall for _, wall in found) <= MOST_WALL_S


def fast(rig: Rig, duration_s: float) -> Rig:
    return replace(rig, twin={**rig.twin, "sample_rate_hz": 200e3, "duration_s": duration_s})


def test_a_fast_long_shot_has_its_first_report_soon(warm: Warm, tmp_path: Path, capsys) -> None:
    one = simulate_shot(fast(warm.rig, 2.0), tmp_path / "files", seed=7, shot="0001")
    cpu, wall, shot = warm.shot("0001", tuple(one.files))
    with capsys.disabled():
        print(f"\n4 channels of 200 kHz for 2 s: {cpu:.2f} s of processor, {wall:.2f} s")
    assert shot.mass is not None
    assert shot.mass["thinned_hz"] == THINNED_TO_HZ
    assert cpu <= MOST_FAST_CPU_S


def test_thinned_channels_give_the_mass_of_the_full_rate(tmp_path: Path, capsys) -> None:
    rig, off = load_rig("mixed"), []
    for k in range(SHOTS):
        one = simulate_shot(fast(rig, 0.55), tmp_path / f"{k}", seed=300 + k, shot=f"{k + 1:04d}")
        stored = read_stored(ingest_files(rig, one.files, shot=one.shot, out=tmp_path / "out", doubles=True).path)
        thin, whole = (identify_shot(stored, Options(thin=thin)).chosen.estimate for thin in (True, False))
        off.append((thin.mass_kg - whole.mass_kg) / whole.u_kg)
    with capsys.disabled():
        print(
            f"\nthinned less full rate, {SHOTS} shots, in u: mean {np.mean(off):+.4f}, largest {max(map(abs, off)):.4f}"
        )
    assert max(map(abs, off)) < LARGE_DIFFERENCE


def test_kills_of_the_worker_lose_nothing_and_every_shot_is_identified(tmp_path: Path, capsys) -> None:
    display, choice = Told(), random.Random(5)  # noqa: S311 - no secret
    # in a file: a command that converts where the worker ends again and again reads it
    changed = settling_soon(load_rig("mixed"), 0.3)
    (tmp_path / "rig").mkdir()
    for name, text in {"rig.toml": changed.text, **changed.databases}.items():
        (tmp_path / "rig" / name).write_text(text, encoding="utf-8")
    rig = load_rig(tmp_path / "rig" / "rig.toml")
    display.until_s = float("inf")
    over, kills = threading.Event(), 0

    def kill() -> None:
        nonlocal kills
        # while shots come: what they left is done in the end
        while not over.wait(choice.uniform(0.5, 10.0)) and len(display.told("captured:")) < KILLED_SHOTS:
            for process in multiprocessing.active_children():
                if process.pid is not None:
                    os.kill(process.pid, signal.SIGKILL)
                    kills += 1

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        options = LiveOptions(out=tmp_path, shots=KILLED_SHOTS, identify=True)
        outcome = run_live(rig, options, display, play={"silence_before_s": 1.0, "silence_after_s": 0.5})
    finally:
        over.set()
        killer.join()
    found = {shot.name: shot.mass for shot in outcome.shots}
    with capsys.disabled():
        missing = [name for name, mass in found.items() if mass is None]
        print(f"\n{len(found)} shots, {kills} kills: {[s.state.value for s in outcome.shots].count('usable')} usable,")
        print(f"  {len(found) - len(missing)} identified in the session")
        print("  " + "\n  ".join(display.told("no mass")))
    assert len(outcome.shots) == KILLED_SHOTS
    assert {shot.state for shot in outcome.shots} == {ShotState.USABLE}
    assert not list(tmp_path.glob("*.partial*"))
    assert outcome.journal is None
    for name, mass in found.items():
        own = identify_file(tmp_path / f"{name}.h5", out=tmp_path / "own")
        assert mass is not None
        assert (mass["value"], mass["u"]) == (own.mass_kg, own.u_kg)
        report = json.loads((tmp_path / "reports" / name / "report.json").read_text())
        assert report["mass"] == own.document["mass"]


def test_the_trigger_is_as_soon_beside_a_worker_that_is_busy_and_no_frame_is_lost(tmp_path: Path, capsys) -> None:
    one = simulate_shot(load_rig("mixed"), tmp_path / "files", seed=9, shot="0001")
    late_ms: dict[bool, list[float]] = {False: [], True: []}
    worker, lost = WarmWorker(), 0
    for busy in (False, True, False, True):
        folder = tmp_path / f"{busy}{len(late_ms[busy])}"
        with armed(folder) as range_:
            time.sleep(12.0)  # the session's own worker is warm by then
            conversions = 0
            for _ in range(PULSES // 2):
                if busy and (not worker._waiting and worker._under_way is None):
                    Conversion(load_rig("mixed"), tuple(one.files), f"{conversions:04d}", folder, worker=worker)
                    conversions += 1
                range_.port.fire()
                until_s = time.monotonic() + 1.2
                while time.monotonic() < until_s:
                    worker.look()
                    time.sleep(0.02)
            due_ns = time.monotonic_ns() - GRACE_NS - range_.waits.longest_ns(GRACE_NS)
            records = [r for r in open_log(range_.journal).records(OWN) if r.kind == Kind.DECISION]
            pulses = [range_.port.returned_ns[pulse] for pulse in range_.port.pulses]
            decided = [r.logged_ns for r in records if json.loads(r.payload)["outcome"] == "trigger"]
            for at_ns in decided:
                sent_ns = max(one for one in pulses if one < at_ns)
                late_ms[busy].append((at_ns - sent_ns) / 1e6)
            assert len(decided) > 0.8 * len(pulses)
            journal = open_log(range_.journal)
            payloads = b"".join(r.payload for r in journal.records() if r.kind == Kind.SERIAL)
            numbers, wrong = range_.port.numbers_in(payloads)
            lost += tally(range_.port, numbers, wrong, due_ns).lost
    worker.close()
    with capsys.disabled():
        for busy, these in late_ms.items():
            words = "beside a busy worker" if busy else "alone"
            print(f"\ntrigger {words}: {np.median(these):.1f} ms, nine in ten {np.quantile(these, 0.9):.1f} ms")
        print(f"  frames lost: {lost}")
    assert lost == 0
    assert np.median(late_ms[True]) < 1.5 * np.median(late_ms[False]) + 5.0
