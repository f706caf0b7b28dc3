"""A campaign whose run is killed, or shared with other machines of which one dies, gives the same bytes in the end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import ReadError, WorkerError
from recoil_acquisition.packages.extras import Extra
from recoil_daq import workers as cluster
from recoil_daq.campaigns.sources import CUTOFF_FILE, SharedCutoff
from recoil_identification.shot.identified import Options
from tests.builders.campaigns import RING_SHOTS, ring_campaign

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="kills processes by signals of POSIX")
NAMES = tuple(f"{number:04d}" for number in range(1, RING_SHOTS + 1))
LONG_S = 300.0


@pytest.fixture(scope="module")
def shots() -> Path:
    return ring_campaign().fired.shots


def started(shots: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "recoil_daq.cli", "campaign", str(shots), "--reports", str(out / "no"), "--out"]
    return subprocess.Popen(
        [*command, str(out), *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )  # fmt: skip


def finished(process: subprocess.Popen[str]) -> None:
    said, complained = process.communicate(timeout=LONG_S)
    assert process.returncode in (0, 1), complained
    assert complained == ""
    assert f"of {len(NAMES)} shots" in said


def wait_for(process: subprocess.Popen[Any], what: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONG_S
    while not what():
        assert process.poll() is None, f"it ended by itself: {process.communicate()}"
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


def written(out: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()
    }  # fmt: skip


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, bytes]:
    """What one process made of the shots without workers."""
    return written(ring_campaign().answer)


@pytest.mark.whole_way
def test_a_run_that_was_killed_is_taken_up_again(
    run, shots: Path, undisturbed: dict[str, bytes], tmp_path: Path
) -> None:
    out = tmp_path / "campaign"
    process = started(shots, out, "--workers", "2")
    wait_for(process, lambda: any(out.glob("reports/*/report.json")))
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kept = {path: path.stat().st_mtime_ns for path in out.glob("reports/*/report.json")}
    assert 0 < len(kept) < len(NAMES)
    assert not (out / "campaign.json").exists()
    assert (out / CUTOFF_FILE).exists()
    again = run("campaign", shots, "--reports", out / "no", "--out", out, "--workers", "1")
    assert again.exit_code in (0, 1), again.output
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert written(out) == undisturbed


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler with two workers, each a process of its own."""
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    file = tmp_path / "scheduler.json"
    # one thread for the linear algebra, as the workers of this machine
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    here = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
    with ExitStack() as stack:

        def start(*words: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(
                [sys.executable, "-m", *words, *here], env=environment, cwd=tmp_path,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        alone = start("distributed.cli.dask_scheduler", "--port", "0")
        wait_for(alone, lambda: file.exists() and file.read_text().endswith("}"))
        workers = [start("distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        address = json.loads(file.read_text())["address"]
        from distributed import Client

        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=LONG_S)
        yield address, workers


@pytest.mark.whole_way
def test_machines_of_a_cluster_give_the_same_bytes_though_one_is_lost(
    shots: Path, undisturbed: dict[str, bytes], tmp_path: Path, scheduler: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = scheduler
    out = tmp_path / "campaign"
    process = started(shots, out, "--cluster", address)
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        (lost,) = [place for place, pid in client.run(os.getpid).items() if pid == workers[0].pid]
        # in the middle: a report is there, and the worker is at another one
        wait_for(process, lambda: any(out.glob("reports/*/report.json")) and bool(client.processing()[lost]))
        workers[0].kill()
    assert not (out / "campaign.json").exists()
    finished(process)
    assert written(out) == undisturbed


def test_a_cluster_without_workers_or_without_a_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    monkeypatch.setattr(cluster, "CONNECT_S", 0.2)
    with (
        pytest.raises(WorkerError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9"),
        cluster.workers_at("tcp://127.0.0.1:9"),
    ):
        pass
    monkeypatch.undo()  # one that is there has its time to answer
    quiet = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": 50}
    with (
        distributed.LocalCluster(n_workers=0, **quiet) as empty,
        pytest.raises(WorkerError, match="has no workers"),
        cluster.workers_at(empty.scheduler_address),
    ):
        pass


def test_the_extra_is_named_where_it_is_missing(run, shots: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CLUSTER", Extra("cluster", "no_such_module", "distributed>=1"))
    for command in ("campaign", "identify"):
        result = run(command, shots, "--cluster", "tcp://127.0.0.1:9")
        assert result.exit_code == 3
        assert "--cluster needs, is not installed; pip install 'distributed>=1'" in result.stderr
        assert run(command, shots, "--cluster", "tcp://127.0.0.1:9", "--workers", "2").exit_code == 2


def test_a_cutoff_is_kept_to_the_last_digit_and_a_damaged_one_is_refused(shots: Path, tmp_path: Path) -> None:
    from recoil_daq.reports.identify_folder import shared_options

    options = shared_options(sorted(shots.glob("*.h5"))[:2], Options())
    kept = SharedCutoff.of(list(options.values()))
    assert kept is not None
    kept.write(tmp_path / "new")
    assert SharedCutoff.read(tmp_path / "new") == kept
    assert SharedCutoff.read(tmp_path) is None
    assert SharedCutoff.of([Options()]) is None
    nothing = replace(kept, choice=replace(kept.choice, cutoff_hz=None, valley_hz=float("nan")))
    nothing.write(tmp_path / "new")
    back = SharedCutoff.read(tmp_path / "new")
    assert repr(back) == repr(nothing)
    for content in ("{", "[]", '{"schema": "recoil-daq/cutoff/1", "choice": {}, "mass_cutoff_hz": 1}',
                    '{"schema": "recoil-daq/cutoff/1", "choice": null, "mass_cutoff_hz": -1}'):  # fmt: skip
        (tmp_path / "new" / CUTOFF_FILE).write_text(content)
        with pytest.raises(ReadError, match="no cut-off of a campaign"):
            SharedCutoff.read(tmp_path / "new")
