"""What filtering long tables takes, against one thread of scipy in the same run; each checks its answer.

Machines share their processors and their memory with others: every figure is a ratio of runs that took turns,
the best of each. What runs on one thread is also compared by the processor time that it took, in which waiting
for a processor does not count.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import sosfiltfilt

from recoil_processing.filters import LowPass, interleaved_kernel
from recoil_processing.filters.filter_engine import filter_channels, usable_processors

RATE_HZ = 50_000.0
CHANNELS = 16
LOW_PASS = LowPass(500.0)


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark: ask for it with --benchmark-enable")


def free_bytes() -> int:
    return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def taking_turns(rounds: int, **runs: Callable[[], object]) -> dict[str, list[tuple[float, float]]]:
    """Run each in turn, round after round, and return the seconds of each: by the clock, and of processors."""
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            began, cpu = time.perf_counter(), time.process_time()
            run()
            seconds[name].append((time.perf_counter() - began, time.process_time() - cpu))
    return seconds


def best_of(seconds: dict[str, list[tuple[float, float]]]) -> tuple[dict[str, float], dict[str, float]]:
    """Return the least seconds of each: by the clock, and of processors."""
    clock, cpu = ({name: min(run[i] for run in runs) for name, runs in seconds.items()} for i in (0, 1))
    return clock, cpu


def spare_processor() -> float:
    """Threads' worth of processors that two threads get here now: 2 if both are free."""

    def spin(done: list[float]) -> None:
        began, cpu = time.perf_counter(), time.thread_time()
        block = np.ones((400, 400))
        while time.perf_counter() - began < 0.5:
            block @ block
        done.append((time.thread_time() - cpu) / (time.perf_counter() - began))

    shares: list[float] = []
    threads = [threading.Thread(target=spin, args=(shares,)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sum(shares)


@pytest.mark.parametrize("count", [1_000_000, 10_000_000])
def test_two_threads_against_one_over_sixteen_channels(capsys, count):
    if usable_processors() < 2:
        pytest.skip("this process may use one processor only")
    if free_bytes() < 2.5 * 8 * CHANNELS * count:
        pytest.skip(f"less than {20e-9 * CHANNELS * count:.1f} GB of memory are free")
    design = LOW_PASS.two_pass(RATE_HZ)
    rows = np.random.default_rng(1).standard_normal((CHANNELS, count))
    expected = [LOW_PASS.apply(rows[i, :200_000], RATE_HZ)[:100_000] for i in range(2)]

    def one_thread() -> None:
        for row in rows:
            row[:] = sosfiltfilt(design.sections, row, padtype="odd", padlen=design.padding_samples)

    def two_threads() -> None:
        filter_channels(LOW_PASS, rows.T, RATE_HZ, engine="scipy", threads=2, out=rows.T)

    two_threads()
    for i in range(2):
        assert np.allclose(rows[i, :100_000], expected[i], rtol=0, atol=1e-9)
    spare = spare_processor()
    seconds = taking_turns(3 if count > 5e6 else 7, one=one_thread, two=two_threads)
    clock, cpu = best_of(seconds)
    ratios = [one[0] / two[0] for one, two in zip(seconds["one"], seconds["two"], strict=True)]
    best = clock["one"] / clock["two"]
    with capsys.disabled():
        print(f"\n16 channels x {count:.0e} samples in place: scipy, one thread {clock['one']:.2f} s, ", end="")
        print(f"two threads {clock['two']:.2f} s; ratio of the best {best:.2f}, of pairs ", end="")
        print(" ".join(f"{ratio:.2f}" for ratio in ratios), f"(of two processors {spare:.2f} were free); ", end="")
        print(f"processor time {cpu['one']:.2f} and {cpu['two']:.2f} s: at most {2 * cpu['one'] / cpu['two']:.2f}")
    if spare > 1.9:
        assert max(best, *ratios) > 1.7
    else:
        assert 2 * cpu["one"] / cpu["two"] > 1.6


@pytest.mark.parametrize("count", [1_000_000, 10_000_000])
def test_the_kernel_against_one_thread_of_scipy(capsys, count):
    pytest.importorskip("numba", reason="needs numba, the extra `fast`")
    if free_bytes() < 7 * 8 * CHANNELS * count:
        pytest.skip(f"less than {56e-9 * CHANNELS * count:.1f} GB of memory are free")
    design = LOW_PASS.two_pass(RATE_HZ)
    table = np.random.default_rng(2).standard_normal((count, CHANNELS))
    rows = np.ascontiguousarray(table.T)
    found = filter_channels(LOW_PASS, table, RATE_HZ, engine="kernel")
    target = np.zeros_like(table)
    for i in (0, 15):
        alone = sosfiltfilt(design.sections, rows[i], padtype="odd", padlen=design.padding_samples)
        assert np.abs(found[:, i] - alone).max() <= 1e-12 * np.abs(rows[i]).max()
    seconds = taking_turns(
        5,
        scipy=lambda: sosfiltfilt(design.sections, rows, axis=1, padtype="odd", padlen=design.padding_samples),
        columns=lambda: [
            sosfiltfilt(design.sections, row, padtype="odd", padlen=design.padding_samples) for row in rows
        ],
        kernel=lambda: filter_channels(LOW_PASS, table, RATE_HZ, engine="kernel"),
        into=lambda: filter_channels(LOW_PASS, table, RATE_HZ, engine="kernel", out=target),
        in_place=lambda: filter_channels(LOW_PASS, found, RATE_HZ, engine="kernel", out=found),
    )
    for kind, best in zip(("by the clock", "of processor time"), best_of(seconds), strict=True):
        with capsys.disabled():
            print(f"\n16 interleaved channels x {count:.0e} samples, one thread, Msamples/s {kind}:", end="")
            print("".join(f" {name} {1e-6 * table.size / best[name]:.0f}" for name in best), end="; ")
            print("over scipy: into a table that is there", end="")
            for name, where in (("into", ""), ("in_place", ", in place"), ("kernel", ", into a new table")):
                print(f"{where} {best['scipy'] / best[name]:.1f}", end="")
                print(f" (channel by channel {best['columns'] / best[name]:.1f})", end="")
        assert best["scipy"] / best["into"] > 6.0


@pytest.mark.parametrize("engine", ["scipy", "kernel"])
def test_a_shot_of_sixteen_channels_of_a_second_at_200_khz(benchmark, engine):
    if engine == "kernel":
        pytest.importorskip("numba", reason="needs numba, the extra `fast`")
        interleaved_kernel.load_kernel(2)
    rate_hz, frequency_hz = 200_000.0, 50.0
    phase = 2 * np.pi * frequency_hz / rate_hz * np.arange(200_000)
    table = np.sin(phase)[:, None] * np.arange(1.0, 17.0)
    filtered = benchmark(filter_channels, LOW_PASS, table, rate_hz, engine=engine)
    gain = float(LOW_PASS.gain(np.array(frequency_hz), rate_hz))
    assert np.allclose(filtered[2000:-2000], gain * table[2000:-2000], rtol=0, atol=1e-4)
