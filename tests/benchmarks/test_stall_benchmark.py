"""Stops of the acquiring process at random moments of a shot: what was delivered for it is in it, however late read."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from dataclasses import dataclass

import pytest

from recoil_acquisition.capture.cut import acquisition_in
from tests.builders.live_rigs import POST_S, PRE_S, Armed, armed

STALLS = int(os.environ.get("RECOIL_DAQ_STALLS", "50"))
SHORTEST_S, LONGEST_S = 0.1, 3.0
A_SESSION = 10
"""Shots of one process."""

ORDINARY_S = 0.25
"""A trigger that is dated later than this after its pulse was read late, and its pre-time counts from the pulse."""

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and SIGSTOP")


@dataclass
class Found:
    """What one shot has of what was sent for it."""

    stop_s: float
    after_s: float
    due: int
    missing: tuple[int, ...]
    late: bool
    trigger_late_s: float


def test_no_delivered_frame_is_missing_after_a_stop_at_any_moment_of_a_shot(tmp_path, capsys):
    choice = random.Random(20261122)  # noqa: S311 - a test's choice of moments, no secret
    found: list[Found] = []
    while len(found) < STALLS:
        with armed(tmp_path / str(len(found))) as one:
            for number in range(1, min(A_SESSION, STALLS - len(found)) + 1):
                found.append(stopped_shot(one, number, choice))
                time.sleep(0.3)
            assert one.process.end(signal.SIGTERM) == 130, one.process.said
    with capsys.disabled():
        print(
            f"\n{STALLS} stops of {SHORTEST_S} to {LONGEST_S} s, from {PRE_S} s before a pulse to {POST_S} s behind it:"
        )
        print(f"  {sum(f.due for f in found):,} frames due, {sum(len(f.missing) for f in found)} missing")
        print(f"  {sum(f.late for f in found)} shots say that they were read late")
        print(f"  triggers dated up to {max(f.trigger_late_s for f in found):.3f} s behind their pulse")
    assert not [f for f in found if f.missing]
    assert all(f.late for f in found if f.stop_s > 2 * ORDINARY_S and f.after_s < POST_S - ORDINARY_S)


def stopped_shot(one: Armed, number: int, choice: random.Random) -> Found:
    """Fire a pulse, stop the process for a while somewhere within the shot, and look at what the shot has."""
    stop_s, after_s = choice.uniform(SHORTEST_S, LONGEST_S), choice.uniform(-PRE_S, POST_S)
    process = one.process.process
    if after_s < 0:
        process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
        time.sleep(-after_s)
        pulse = one.port.fire()
    else:
        pulse = one.port.fire()
        time.sleep(after_s)
        process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
    time.sleep(max(stopped + stop_s - time.monotonic(), 0.0))
    process.send_signal(signal.SIGCONT)
    capture = one.out / "captures" / f"{number:04d}.rdlog"
    one.process.wait_for(f"capture of shot {number}", capture.exists, 60.0)
    acquisition = acquisition_in(capture)
    assert acquisition is not None
    sent_ns = one.port.returned_ns[pulse]
    late_ns = acquisition.trigger_ns - sent_ns
    start_ns = (acquisition.trigger_ns if late_ns < ORDINARY_S * 1e9 else sent_ns) - round(PRE_S * 1e9)
    stop_ns = sent_ns + round(POST_S * 1e9)
    due, missing = 0, []
    for source, player in (("imu", one.port), ("can", one.bus)):
        # the first whose write had returned by then may have been written, and read, before
        first, behind = player.sent_before(start_ns) + 1, player.sent_before(stop_ns)
        there = set(player.numbers(capture, source)[0].tolist())
        due += behind - first
        missing += [n - first for n in range(first, behind) if n not in there]
    late = any(source.late for source in acquisition.sources)
    return Found(stop_s, after_s, due, tuple(missing), late, late_ns / 1e9)
