"""How fast a trigger passes over samples that change nothing, and over samples that do."""

from __future__ import annotations

import math
from time import process_time

import numpy as np
import pytest

from recoil_acquisition.trigger import Trigger, TriggerDetector
from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window

N_SAMPLES = 20_000_000
BLOCK = 16_384

PRE_CHECK_MS_S = 100.0
EXACT_MS_S = 10.0


@pytest.fixture(scope="module")
def noise() -> tuple[np.ndarray, np.ndarray]:
    """Noise of standard deviation 1 at 1 MS/s, far below one step of 100 at its end."""
    values = np.random.default_rng(5).standard_normal(N_SAMPLES)
    values[-1000:] += 100.0
    return np.arange(N_SAMPLES) * 1e-6, values


def million_samples_per_s(
    condition: Condition, times_s: np.ndarray, values: np.ndarray, block: int = BLOCK
) -> tuple[float, list[float]]:
    """Feed all samples three times; return the best rate in processor time, and the instants of the triggers."""
    rates = []
    for _ in range(3):
        detector = TriggerDetector(Trigger((condition,), post_s=1e-9), ["a"])
        decisions = detector.arm(-math.inf)
        started_s = process_time()
        for start in range(0, len(values), block):
            decisions += detector.feed("a", times_s[start : start + block], values[start : start + block])
        rates.append(len(values) / (process_time() - started_s) / 1e6)
    return max(rates), [decision.time_s for decision in decisions if decision.outcome == "trigger"]


@pytest.mark.parametrize(
    ("condition", "least_ms_s", "delay_s"),
    [
        (Edge("a", 50.0, 40.0), PRE_CHECK_MS_S, 0.0),
        (Window("a", 50.0, 150.0, hysteresis=10.0), PRE_CHECK_MS_S, 0.0),
        (PulseWidth("a", 50.0, 40.0, longer_than_s=5e-4), PRE_CHECK_MS_S, 5e-4),
        (RateOfChange("a", 5e7, 1e7), PRE_CHECK_MS_S, 0.0),
    ],
    ids=["edge", "window", "width", "slope"],
)
def test_quiet_blocks(noise, capsys, condition, least_ms_s, delay_s):
    times_s, values = noise
    rate, triggers_s = million_samples_per_s(condition, times_s, values)
    with capsys.disabled():
        print(f"\ntrigger, quiet blocks of {BLOCK}, {type(condition).__name__}: {rate:.0f} MS/s")
    assert triggers_s == [pytest.approx(times_s[-1000] + delay_s, abs=1.5e-6)]
    assert rate >= least_ms_s


def test_quiet_blocks_of_single_precision(noise, capsys):
    times_s, values = noise[0], noise[1].astype(np.float32)
    rate, triggers_s = million_samples_per_s(Edge("a", 50.0, 40.0), times_s, values)
    with capsys.disabled():
        print(f"\ntrigger, quiet blocks of {BLOCK}, Edge, float32: {rate:.0f} MS/s")
    assert triggers_s == [times_s[-1000]]
    assert rate >= PRE_CHECK_MS_S


def test_blocks_that_touch_the_level(noise, capsys):
    times_s, values = noise[0][:-1000], noise[1][:-1000]
    rate, triggers_s = million_samples_per_s(Edge("a", 4.0, 0.0), times_s, values)
    with capsys.disabled():
        print(f"\ntrigger, blocks of {BLOCK} that touch the level, {len(triggers_s)} triggers: {rate:.0f} MS/s")
    reaching = np.flatnonzero(values >= 4.0)
    below = np.flatnonzero(values < 0.0)
    first_after = np.searchsorted(below, reaching)
    # An event is the first sample at the level after one below the rearm level: each gap of `below` counts once
    events = reaching[np.concatenate(([True], np.diff(first_after) > 0))]
    assert triggers_s == times_s[events].tolist()
    assert rate >= EXACT_MS_S
