"""A process that writes a log from two threads until it is killed, and what must be in the log then."""

from __future__ import annotations

import random
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import OWN

SEGMENT_BYTES = 1 << 18

_WRITER = """
import os, sys, threading, time
from pathlib import Path
from recoil_acquisition.log.writer import LogWriter
from tests.builders.killed_log import SEGMENT_BYTES, payload_of

def write(source):
    counter = 0
    while True:
        writer.append(source, 7, time.monotonic_ns(), payload_of(source, counter))
        os.write(acknowledged[source], counter.to_bytes(8, "little"))
        counter += 1
        if counter % 50 == 0:
            time.sleep(0.001)

folder = Path(sys.argv[1])
acknowledged = [os.open(folder / f"acknowledged{source}", os.O_WRONLY | os.O_CREAT) for source in (0, 1)]
writer = LogWriter(folder / "log", {"rig": "test"}, 4 * SEGMENT_BYTES, segment_bytes=SEGMENT_BYTES)
threading.Thread(target=write, args=(1,), daemon=True).start()
write(0)
"""


def payload_of(source: int, counter: int) -> bytes:
    """Return the payload that a source writes at a count: its counter, then bytes that follow from it."""
    size = (counter * 7919 + source) % 1500
    return struct.pack("<Q", counter) + bytes([(counter * 31 + source) % 255 + 1]) * size


def kill_a_writer(folder: Path, delay_s: float) -> tuple[int, int]:
    """Start a writer in a folder, kill it with SIGKILL, and check its log against what it was told is written.

    Returns
    -------
    tuple of int
        Records that were acknowledged to the writer, and records in the log.
    """
    folder.mkdir()
    repository = Path(__file__).resolve().parents[2]
    process = subprocess.Popen([sys.executable, "-c", _WRITER, str(folder)], cwd=repository)
    try:
        started = time.monotonic()
        marks = [folder / "acknowledged0", folder / "acknowledged1"]
        while not all(mark.exists() and mark.stat().st_size for mark in marks):
            assert process.poll() is None, "the writer ended by itself"
            assert time.monotonic() - started < 30, "the writer does not start"
            time.sleep(0.001)
        time.sleep(delay_s)
        process.send_signal(signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
    acknowledged = [mark.stat().st_size // 8 for mark in marks]
    counters: list[list[int]] = [[], []]
    last_number = -1
    log = open_log(folder / "log")
    for record in log.records():
        assert record.number == last_number + 1
        last_number = record.number
        if record.source == OWN:
            continue
        counter = struct.unpack_from("<Q", record.payload)[0]
        assert record.payload == payload_of(record.source, counter)
        counters[record.source].append(counter)
    for found, written in zip(counters, acknowledged, strict=True):
        assert found == list(range(len(found)))
        # One record per source may be on the disk before the writer knows
        assert written <= len(found) <= written + 1
    survey = log.survey()
    assert (survey.lost_records, survey.closed) == (0, False)
    return sum(acknowledged), sum(map(len, counters))


def random_delays_s(count: int, seed: int) -> list[float]:
    """Return moments for a kill, most of them within the first segments."""
    choice = random.Random(seed)  # noqa: S311 - a test's choice of moments, no secret
    return [choice.uniform(0.0, 0.5) for _ in range(count)]
