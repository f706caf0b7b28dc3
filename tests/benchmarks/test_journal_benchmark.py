"""How fast a journal takes records, and what fifty kills cost it."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

from recoil_acquisition.journal import JournalWriter, read_journal
from tests.builders.killed_journal import kill_a_writer, random_delays_s

BLOCK = 65_536
RUNS = 5

UNSYNCED_MB_S = 500.0
SYNCED_MB_S = 150.0
SMALL_RECORDS_PER_S = 50_000.0


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark: ask for it with --benchmark-enable")


def seconds_to_write(folder: Path, count: int, payload: bytes, sync_every: int) -> float:
    """Write records into space that is reserved, check that all are there, and return how long writing took."""
    with JournalWriter(folder, {}, (count + 1) * (len(payload) + 28)) as writer:
        started = time.perf_counter()
        for i in range(1, count + 1):
            writer.append(1, 2, i, payload)
            if sync_every and i % sync_every == 0:
                writer.sync()
        elapsed_s = time.perf_counter() - started
    journal = read_journal(folder)
    assert (journal.count, journal.cut_bytes, journal.lost_records) == (count, 0, 0)
    assert all(record.payload == payload for record in journal.records(stop_ns=100))
    journal.remove()
    return elapsed_s


@pytest.mark.parametrize(("sync_every", "count", "least_mb_s"), [(0, 8192, UNSYNCED_MB_S), (16, 2048, SYNCED_MB_S)])
def test_blocks_of_64_kb(tmp_path, capsys, sync_every, count, least_mb_s):
    payload = os.urandom(BLOCK)
    rates = sorted(
        count * BLOCK / 1e6 / seconds_to_write(tmp_path / str(run), count, payload, sync_every) for run in range(RUNS)
    )
    how = f"synced every {sync_every} blocks" if sync_every else "unsynced by the caller"
    figures = f"{rates[-1]:.0f} MB/s, median {rates[RUNS // 2]:.0f}, slowest {rates[0]:.0f}"
    with capsys.disabled():
        print(f"\njournal, 64 kB blocks, {how}: fastest of {RUNS} {figures}")
    # The fastest run: the others tell what else the machine and its disk did
    assert rates[-1] >= least_mb_s


def test_records_of_one_can_frame(tmp_path, capsys):
    count = 200_000
    rates = sorted(count / seconds_to_write(tmp_path / str(run), count, os.urandom(24), 0) for run in range(RUNS))
    with capsys.disabled():
        print(
            f"\njournal, 24-byte records: fastest of {RUNS} {rates[-1]:,.0f} records/s, median {rates[RUNS // 2]:,.0f}"
        )
    assert rates[-1] >= SMALL_RECORDS_PER_S


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and its promises are POSIX")
def test_fifty_kills_lose_nothing(tmp_path, capsys):
    acknowledged = found = 0
    for i, delay_s in enumerate(random_delays_s(50, seed=2)):
        told, there = kill_a_writer(tmp_path / str(i), delay_s)
        acknowledged, found = acknowledged + told, found + there
    with capsys.disabled():
        print(f"\n50 kills: {acknowledged:,} records acknowledged, {found:,} in the journals, none wrong, none twice")
    assert found >= acknowledged > 50_000
