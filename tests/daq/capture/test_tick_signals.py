"""Channels of a stream by tick as they pass: in SI, dated forwards, and nothing of two epochs on one clock."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from recoil_acquisition.capture.live_source import LiveSamples
from recoil_acquisition.capture.tick_signals import TickSignals
from recoil_acquisition.devices.device import Block, Counters, event_block
from tests.builders.tick_streams import CHANNELS, DESCRIPTION, RATE_HZ, PieceDecoder, data, live, piece, said

MS = 1_000_000


def signals() -> TickSignals:
    return TickSignals([live("pressure", "p", 1e6), live("acceleration", "a")], PieceDecoder())


def taken(signals: TickSignals, block: Block) -> list[LiveSamples]:
    return list(signals.feed(block))


def packet(number: int, host_ns: int, per: int = 50) -> Block:
    ticks = np.arange(number * per, (number + 1) * per)
    return data(host_ns, piece(0, int(ticks[0]), ticks), piece(1, 5 * int(ticks[0]), ticks))


def test_samples_come_in_si_half_a_second_after_the_first() -> None:
    one = signals()
    for event in said(0):
        assert taken(one, event) == []
    found = [samples for number in range(20) for samples in taken(one, packet(number, (number + 1) * 50 * MS))]
    pressure = [samples for samples in found if samples.channel == "pressure"]
    values = np.concatenate([samples.values for samples in pressure])
    np.testing.assert_array_equal(values, 1e6 * (0.5 * np.arange(500, 1000) - 1.0))
    times_s = np.concatenate([samples.times_s for samples in pressure])
    np.testing.assert_allclose(times_s, np.arange(501, 1001) / 1000, atol=2e-3)
    assert one.stamped_by([]) == "recorder"


@pytest.mark.parametrize("off", [200e-6, -200e-6])
def test_times_never_run_backwards_whatever_crystal_and_network_do(off: float) -> None:
    one, rng, at_s = signals(), np.random.default_rng(3), 0.0
    for event in said(0):
        taken(one, event)
    latest, spread = -np.inf, []
    for number in range(400):
        due_s = (number + 1) * 0.05 * (1 + off)
        at_s = max(at_s, due_s + rng.exponential(1e-3) + (0.3 if number % 90 == 89 else 0.0))
        for samples in taken(one, packet(number, round(1e9 * at_s))):
            assert samples.times_s[0] >= latest or samples.channel == "acceleration"
            assert (np.diff(samples.times_s) >= 0).all()
            if samples.channel == "pressure":
                latest = samples.times_s[-1]
                spread.append(latest - due_s)
    assert max(map(abs, spread[100:])) < 5e-3


def test_nothing_is_said_before_the_stream_is_described() -> None:
    one = signals()
    assert taken(one, packet(0, 50 * MS)) == []
    assert "has not said what it sends" in one.unheard(live("pressure", "p"), Counters(received=9))


def test_doubled_and_late_packets_give_no_sample_twice() -> None:
    one = signals()
    for event in said(0):
        taken(one, event)
    order = [*range(15), 14, 13, 15, 16, 15, 17]
    values = [
        samples.values
        for place, number in enumerate(order)
        for samples in taken(one, packet(number, (place + 1) * 50 * MS))
        if samples.channel == "acceleration"
    ]
    np.testing.assert_array_equal(np.concatenate(values), np.arange(500, 900))


def test_what_is_no_number_is_no_sample() -> None:
    one = signals()
    for event in said(0):
        taken(one, event)
    for number in range(15):
        taken(one, packet(number, (number + 1) * 50 * MS))
    holed, lost = [1.0, np.nan, 3.0, np.inf], [np.nan] * 4
    (found,) = taken(one, data(800 * MS, piece(0, 750, holed), piece(1, 3750, lost)))
    assert (found.channel, found.values.tolist()) == ("pressure", [-0.5e6, 0.5e6])
    assert np.diff(found.times_s) == pytest.approx(2 / RATE_HZ, rel=1e-3)


def test_with_another_description_a_new_epoch_begins() -> None:
    one = signals()
    changed = replace(DESCRIPTION, channels=(replace(CHANNELS[0], factor=2.0), replace(CHANNELS[1], step=10)))
    for event in said(0):
        taken(one, event)
    for number in range(20):
        taken(one, packet(number, (number + 1) * 50 * MS))
    for event in said(1000 * MS, changed):
        taken(one, event)
    assert taken(one, packet(20, 1050 * MS)) == []
    later = [samples for number in range(21, 40) for samples in taken(one, packet(number, (number + 1) * 50 * MS))]
    assert later[-2].values[-1] == 1e6 * (2.0 * 1999 - 1.0)


def test_ticks_that_begin_anew_begin_another_clock() -> None:
    one = signals()
    for event in said(0):
        taken(one, event)
    for number in range(100, 120):
        taken(one, packet(number, (number - 99) * 50 * MS))
    found = [
        samples for number in range(20) for samples in taken(one, packet(number, 1000 * MS + (number + 1) * 50 * MS))
    ]
    assert found[0].times_s[0] == pytest.approx(1.5, abs=0.06)


def test_bytes_that_are_missing_cost_the_piece_that_they_cut() -> None:
    one = signals()
    for event in said(0):
        taken(one, event)
    for number in range(20):
        taken(one, packet(number, (number + 1) * 50 * MS))
    whole = packet(20, 1050 * MS)
    taken(one, replace(whole, payload=whole.payload[:30]))
    taken(one, event_block("daq", 1060 * MS, "lost", "gone"))
    assert len(taken(one, packet(21, 1100 * MS))) == 2
    taken(one, replace(whole, payload=whole.payload[:30]))
    one.skip()
    assert len(taken(one, packet(22, 1150 * MS))) == 2


def test_a_channel_whose_rate_nobody_said_yet_has_no_samples() -> None:
    one = signals()
    for event in said(0, replace(DESCRIPTION, channels=tuple(replace(c, tick_rate=Fraction(0)) for c in CHANNELS))):
        taken(one, event)
    assert [taken(one, packet(number, (number + 1) * 50 * MS)) for number in range(20)] == [[]] * 20


def test_behind_a_lost_connection_ticks_that_go_back_by_a_hair_begin_another_clock() -> None:
    one = signals()
    for event in said(0):
        taken(one, event)
    for number in range(15):
        taken(one, packet(number, (number + 1) * 50 * MS))
    for name in ("lost", "reopened"):
        taken(one, event_block("daq", 750 * MS, name, "again"))
    found = [
        samples for number in range(20) for samples in taken(one, packet(number, 9000 * MS + (number + 1) * 50 * MS))
    ]
    assert found[0].times_s[0] == pytest.approx(9.5, abs=0.06)


def test_of_many_channels_one_is_held_at_a_time() -> None:
    """Sixteen of 200 kHz in packets of 100 ms would be 8 MB of times and values, for the few that the screen shows."""
    names = [f"a{i}" for i in range(16)]
    one = TickSignals([live(name, name) for name in names], PieceDecoder())
    for event in said(0, replace(DESCRIPTION, channels=tuple(replace(CHANNELS[1], name=name) for name in names))):
        taken(one, event)
    numbers = np.arange(20_000)
    blocks = [
        data((number + 1) * 4000 * MS, *(piece(i, 100_000 * number, numbers) for i in range(16))) for number in range(4)
    ]
    for block in blocks[:3]:
        assert len(taken(one, block)) in (0, 16)
    tracemalloc.start()
    try:
        shown = sum(samples.values.size for samples in one.feed(blocks[3]))
        held_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert shown == 16 * numbers.size
    assert held_bytes < 5 * len(blocks[3].payload)
