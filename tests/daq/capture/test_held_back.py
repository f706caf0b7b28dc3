"""What an interface held back is dated by its stamps, and nothing else is moved."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.capture.engine import CaptureEngine
from recoil_acquisition.capture.live_source import LONGEST_DELAY_S, HeldBack, signals_of
from recoil_acquisition.devices.device import CAN, Block
from recoil_acquisition.frames.can_rows import DEVICE_TIME
from recoil_acquisition.trigger import Edge, Trigger
from tests.builders.can_rows import pack_row
from tests.builders.live_sources import bus, port, serial_block, serial_frame

STEP_S = 1e-3
DRIFT = 2e-4


def late_s(due_s: np.ndarray, held_s: np.ndarray, clock_s: np.ndarray | None = None, block: int = 10) -> np.ndarray:
    """Let frames pass that were due at some times of the host, held back by others."""
    device_ns = np.rint(1e9 * (50.0 + (due_s if clock_s is None else clock_s) * (1 + DRIFT))).astype(np.int64)
    host_ns = np.rint(1e9 * np.maximum.accumulate(due_s + held_s)).astype(np.int64)
    held = HeldBack()
    return np.concatenate(
        [held.late_s(host_ns[i : i + block], device_ns[i : i + block]) for i in range(0, due_s.size, block)]
    )


def test_frames_that_were_held_back_are_late_by_as_much() -> None:
    due_s = STEP_S * np.arange(4000)
    held_s = 3e-4 + np.where((due_s > 3.0) & (due_s < 3.4), 3.4 - due_s, 0.0)
    found = late_s(due_s, held_s)
    assert found[:3000] == pytest.approx(0.0, abs=1e-3)
    assert found[3001:3400] == pytest.approx(held_s[3001:3400] - 3e-4, abs=1e-3)
    assert found[3410:] == pytest.approx(0.0, abs=1e-3)


def test_a_delay_that_lasts_becomes_the_usual_way_after_half_of_five_seconds() -> None:
    due_s = STEP_S * np.arange(9000)
    found = late_s(due_s, np.where(due_s > 5.0, 0.3, 0.0))
    assert found[5100:7000] == pytest.approx(0.3, abs=2e-3)
    assert found[8200:] == pytest.approx(0.0, abs=2e-3)


def test_at_the_beginning_nothing_is_known() -> None:
    due_s = STEP_S * np.arange(600)
    assert not late_s(due_s, np.where(due_s > 0.5, 0.3, 0.0)).any()


def test_after_a_second_it_is_known_how_late_frames_usually_are() -> None:
    due_s = STEP_S * np.arange(1500)
    found = late_s(due_s, np.where(due_s >= 1.1, 0.3, 0.0))
    assert found[1100:1200] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize(("first_s", "known"), [(0.7, False), (0.8, True)])
def test_it_is_known_once_frames_of_four_quarters_of_a_second_are_there(first_s: float, known: bool) -> None:
    due_s = STEP_S * np.arange(round(first_s / STEP_S) + 10)
    held_s = np.zeros(due_s.size)
    held_s[-10:] = 0.3
    assert late_s(due_s, held_s)[-10:] == pytest.approx(0.3 if known else 0.0, abs=2e-3)


@pytest.mark.parametrize(
    ("quarters", "late"),
    [
        ((0, 0, 0.02, 0.02), True),
        ((0, 0, 0, 0.02, 0.02, 0.02), True),
        ((0.02, 0.02, 0.02, 0, 0, 0.02), False),
        ((0, 0, 0.02, 0.02, 0.02), False),
        # what was more than five seconds ago counts no more
        ((0.02,) * 21 + (0,) * 10 + (0.02,) * 10, True),
    ],
)
def test_a_delay_is_usual_once_more_than_half_of_the_quarters_had_it(quarters: tuple[float, ...], late: bool) -> None:
    held_s = np.repeat(quarters, 250)
    found = late_s(STEP_S * np.arange(held_s.size), held_s)
    # within the last quarter, without what comes so late in it that it is of the next
    assert found[-200:-30] == pytest.approx(0.02 if late else 0.0, abs=1e-3)


def test_what_holds_one_read_of_every_quarter_of_a_second_back_does_not_become_usual() -> None:
    number = np.arange(4000)
    held = number // 10 % 25 == 12
    found = late_s(STEP_S * number, np.where(held, 0.05, 0.0))
    known = held & (number > 1500)
    assert found[known] == pytest.approx(0.05, abs=1e-3)


def test_frames_that_are_read_one_by_one_are_dated_as_those_that_are_read_together() -> None:
    due_s = STEP_S * np.arange(3000)
    held_s = np.where(due_s > 2.5, 0.3, 0.0)
    assert late_s(due_s, held_s, block=1) == pytest.approx(late_s(due_s, held_s), abs=1e-4)


def test_frames_that_share_a_stamp_are_no_clock_that_was_set_back() -> None:
    due_s = np.repeat(2 * STEP_S * np.arange(1500), 2)
    found = late_s(due_s, np.where(due_s >= 2.5, 0.3, 0.0), block=9)
    assert found[due_s >= 2.5] == pytest.approx(0.3, abs=3e-3)


@pytest.mark.parametrize("wrong_s", [-40.0, -1e-2, 1e-2, 1e6])
def test_a_stamp_that_is_wrong_moves_no_other_frame(wrong_s) -> None:
    due_s = STEP_S * np.arange(6000)
    clock_s = due_s.copy()
    clock_s[3005] += wrong_s
    found = np.delete(late_s(due_s, np.zeros(due_s.size), clock_s), 3005)
    assert found == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("step_s", [-2000.0, -0.4, -0.01, 0.4, 2000.0])
@pytest.mark.parametrize("first", [8000, 8004])
def test_a_clock_that_is_set_between_two_reads_or_within_one_is_no_delay(step_s, first) -> None:
    due_s = STEP_S * np.arange(20_000)
    clock_s = due_s + np.where(np.arange(due_s.size) >= first, step_s, 0.0)
    assert late_s(due_s, np.zeros(due_s.size), clock_s) == pytest.approx(0.0, abs=2e-3)


def test_a_lasting_delay_of_more_than_a_second_is_not_believed() -> None:
    due_s = STEP_S * np.arange(6000)
    assert late_s(due_s, np.where(due_s > 3.0, 1.5, 0.0)) == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize(("more_ns", "believed"), [(-1, True), (0, True), (1, False)])
def test_a_delay_is_believed_up_to_a_second_and_no_further(more_ns: int, believed: bool) -> None:
    held, late_ns = HeldBack(), round(LONGEST_DELAY_S * 1e9) + more_ns
    at_ns = 10_000_000 * np.arange(300)
    for k in range(at_ns.size):
        held.late_s(at_ns[k : k + 1], at_ns[k : k + 1])
    (found,) = held.late_s(at_ns[-1:] + late_ns, at_ns[-1:]).tolist()
    assert round(found * 1e9) == (late_ns if believed else 0)


def test_frames_that_come_as_usual_are_not_late_by_a_nanosecond() -> None:
    held = HeldBack()
    at_ns = 10_000_000 * np.arange(300)
    assert not any(held.late_s(at_ns[k : k + 3], at_ns[k : k + 3]).any() for k in range(0, 300, 3))


def frames(due_s: np.ndarray, read_s: float, kpa: np.ndarray) -> Block:
    rows = [
        pack_row(
            device_ns=round(1e9 * (50.0 + at_s)), host_ns=round(1e9 * read_s), identifier=291, flags=DEVICE_TIME,
            data=int(2 * value).to_bytes(2, "little", signed=True) + bytes(2),
        )
        for at_s, value in zip(due_s.tolist(), kpa.tolist(), strict=True)
    ]  # fmt: skip
    return Block("bus", round(1e9 * read_s), b"".join(rows), CAN)


def test_without_stamps_of_the_interface_the_host_dates() -> None:
    source = bus()
    signals = signals_of(source, source.channels)
    for k in range(400):
        due_s = 0.01 * k + STEP_S * np.arange(10)
        read_s = 0.01 * (k + 1) + (0.5 if k == 399 else 0.0)
        block = frames(due_s, read_s, np.zeros(10))
        rows = bytearray(block.payload)
        for at in range(20, len(rows), len(rows) // 10):
            rows[at] = 0
        (samples,) = signals.feed(Block("bus", block.host_ns, bytes(rows), CAN))
    assert samples.times_s == pytest.approx(read_s)


def test_the_window_of_a_shot_whose_trigger_was_held_back_begins_as_long_before_as_was_asked_for() -> None:
    trigger = Trigger((Edge("pressure", 500e3),), pre_s=0.3, post_s=0.5)
    engine = CaptureEngine([bus(), port()], trigger, patience_s=0.1)
    engine.arm(0.0)
    windows = []
    for k in range(700):
        due_s = 0.01 * k + STEP_S * np.arange(10)
        end_s = 0.01 * (k + 1)
        engine.take(serial_block(end_s, serial_frame(k, 0.0)))
        # the bus is held back from 4.95 to 5.35 s; the shot fires at 5 s
        read_s = 5.35 if 4.95 < end_s < 5.35 else end_s
        if read_s == end_s or k == 534:
            held = STEP_S * np.arange(4950, 5350) if k == 534 else due_s
            engine.take(frames(held, 5.35 if k == 534 else end_s, np.where(held > 5.0, 1e3, 0.0)))
        windows += engine.ready(end_s)
    (window,) = windows
    assert window.trigger_s == pytest.approx(5.0, abs=0.02)
    assert window.start_s == pytest.approx(4.7, abs=0.02)
