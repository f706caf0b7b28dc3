"""A capture of an instrument that counts its samples: each at its tick, gaps as gaps, and no two clocks as one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.capture.captured_ticks import open_ticks
from recoil_acquisition.devices.device import Block, event_block
from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.errors import CorruptFileError
from recoil_acquisition.readers.recording import Recording
from tests.builders.tick_streams import CHANNELS, DESCRIPTION, PATH, PieceDecoder, captured, data, piece, said

MS = 1_000_000


def opened(*blocks: Block) -> Recording:
    return open_ticks(PATH, captured(blocks), "daq", PieceDecoder())


def packets(first: int, count: int, *, per: int = 100, host_ns: int = 0) -> list[Block]:
    """Packets of both channels, each value its own tick."""
    found = []
    for at in range(first, first + count, per):
        ticks = np.arange(at, at + per)
        both = piece(0, at, ticks, whole=True), piece(1, 5 * at, 5 * ticks)
        found.append(data(host_ns + (at + per) * MS, *both))
    return found


def test_every_sample_has_its_tick_and_the_value_that_was_sent() -> None:
    recording = opened(*said(0), *packets(4000, 1000))
    assert [one.name for one in recording.signals] == ["p", "a"]
    assert [one.unit for one in recording.signals] == ["MPa", "m/s2"]
    np.testing.assert_array_equal(recording.read("p"), 0.5 * np.arange(4000, 5000) - 1.0)
    np.testing.assert_array_equal(recording.read("a", 10, 20), 5.0 * np.arange(4010, 4020))
    counts = recording.raw("p", 0, 3)
    assert counts is not None
    assert (counts.counts.tolist(), counts.gain, counts.offset, counts.unit) == ([4000, 4001, 4002], 0.5, -1.0, "MPa")
    assert recording.raw("a") is None
    for name in ("p", "a"):
        base = recording.time_base(name)
        assert (base.start_s, base.step_s, base.count) == (0.0, 1e-3, 1000)
    assert recording.absolute_start is not None
    assert recording.absolute_start.text == "2023-11-14T22:13:24.123456789"
    assert (recording.absolute_start.zone, recording.absolute_start.locked_to) == ("UTC", "PTP")
    assert recording.metadata["ticks"]["a"] == {"rate": [5000, 1], "step": 5, "runs": [[20000, 1000]]}
    assert recording.notes == ()


@given(cuts=st.lists(st.integers(0, 25_000), max_size=40))
def test_wherever_the_bytes_are_cut_the_samples_are_the_same(cuts: list[int]) -> None:
    content = b"".join(one.payload for one in packets(0, 3000))
    places = sorted({0, len(content), *(min(cut, len(content)) for cut in cuts)})
    parts = [data(one * MS, content[one:other]) for one, other in pairwise(places)]
    recording = opened(*said(0), *parts)
    np.testing.assert_array_equal(recording.read("a"), 5.0 * np.arange(3000))


def test_what_is_missing_is_a_gap_of_so_many_ticks_and_nothing_stands_there() -> None:
    kept = [*packets(0, 500), *packets(700, 300)]
    recording = opened(*said(0), *kept)
    base = recording.time_base("a")
    assert base.step_s is None
    np.testing.assert_allclose(np.diff(base.times_s)[499], 0.201, rtol=1e-12)
    np.testing.assert_array_equal(recording.read("a"), 5.0 * np.r_[0:500, 700:1000])
    assert [str(note) for note in recording.notes] == [
        "p: samples are missing, 200 from tick 500 on",
        "a: samples are missing, 200 from tick 2500 on",
    ]


def test_another_beat_behind_a_gap_is_said_in_ticks() -> None:
    first, second = piece(1, 0, range(100)), piece(1, 5 * 100 + 52, range(100))
    recording = opened(*said(0), data(1, first, second))
    assert "52 ticks, another beat behind them, from tick 500 on" in str(recording.notes[0])
    np.testing.assert_allclose(recording.time_base("a").times_s[100], 552 / 5000, rtol=1e-12)


def test_what_comes_twice_counts_once() -> None:
    one, two, three = packets(0, 300)
    recording = opened(*said(0), one, two, two, one, three)
    np.testing.assert_array_equal(recording.read("a"), 5.0 * np.arange(300))
    assert recording.time_base("a").step_s == 1e-3
    assert [str(note) for note in recording.notes] == ["p, a: 200 samples came twice or too late: the first ones count"]


def test_a_connection_that_is_back_goes_on_where_the_ticks_went_on() -> None:
    gone = [
        event_block("daq", 500 * MS, "lost", "closed by the recorder"),
        event_block("daq", 650 * MS, "reopened", ""),
    ]
    half = data(500 * MS, piece(0, 500, range(100))[:50])
    recording = opened(*said(0), *packets(0, 500), half, *gone, *said(650 * MS), *packets(650, 300))
    np.testing.assert_array_equal(recording.read("a"), 5.0 * np.r_[0:500, 650:950])
    assert any("the connection was lost 1 times" in note for note in recording.notes)
    assert recording.metadata["epochs"] == 1


def test_of_two_clocks_the_longer_one_counts_and_the_other_is_said() -> None:
    changed = replace(DESCRIPTION, channels=(replace(CHANNELS[0], factor=0.25), CHANNELS[1]))
    recording = opened(*said(0), *packets(0, 300), *said(300 * MS, changed), *packets(300, 700))
    np.testing.assert_array_equal(recording.read("p"), 0.25 * np.arange(300, 1000) - 1.0)
    assert any("anew 1 times: 0.300 s of samples on other clocks are left out" in note for note in recording.notes)
    restarted = opened(*said(0), *packets(90_000, 300), *packets(0, 700))
    assert (restarted.metadata["epochs"], restarted.time_base("a").count) == (2, 700)


def test_samples_before_the_first_description_are_of_it() -> None:
    recording = opened(*packets(0, 200), *said(200 * MS), *packets(200, 100))
    np.testing.assert_array_equal(recording.read("a"), 5.0 * np.arange(300))


def test_ticks_since_1970_lose_no_nanosecond() -> None:
    first = 1_700_000_000 * 5000 + 7
    recording = opened(*said(0, replace(DESCRIPTION, start_utc_ns=0)), data(1, piece(1, first, range(10))))
    start = recording.absolute_start
    assert start is not None
    assert start.text == "2023-11-14T22:13:20.000000000"
    assert recording.time_base("a").start_s == 7 / 5000


def test_the_hosts_clock_is_anchored_at_the_ticks() -> None:
    recording = opened(*said(0), *packets(0, 3000, host_ns=7_000_000_000))
    anchors = recording.metadata["clock_fit"][TICK_ANCHORS]
    assert len(anchors) >= 2
    for one in anchors:
        assert abs(one["host_ns"] - 7_000_000_000 - (one["tick"] + 1) * MS) < 2 * MS


@pytest.mark.parametrize("blocks", [[], packets(0, 100), said(0), [event_block("daq", 0, "described", "1/2 x")]])
def test_without_samples_or_a_description_one_line_says_what_is_missing(blocks: list[Block]) -> None:
    with pytest.raises(CorruptFileError, match="no sample of 'daq'"):
        opened(*blocks)


def test_a_recorder_that_counts_anew_without_a_word_is_not_joined_to_what_it_counted_before() -> None:
    nothing_said = replace(DESCRIPTION, start_utc_ns=None)
    recording = opened(*said(0, nothing_said), *packets(0, 5000), *packets(0, 7000, host_ns=5000 * MS))
    assert recording.metadata["epochs"] == 2
    assert recording.metadata["ticks"]["p"]["runs"] == [[0, 7000]]
    assert any("5.000 s of samples on other clocks are left out" in note for note in recording.notes)


def test_behind_a_lost_connection_ticks_that_go_back_by_a_hair_are_counted_anew() -> None:
    lost = [event_block("daq", 500 * MS, name, "again") for name in ("lost", "reopened")]
    recording = opened(*said(0), *packets(0, 500), *lost, *packets(0, 900, host_ns=900 * MS))
    assert recording.metadata["epochs"] == 2
    assert recording.metadata["ticks"]["p"]["runs"] == [[0, 900]]


def test_packets_that_come_twice_leave_the_anchors_on_the_hosts_clock_as_they_are() -> None:
    once = packets(0, 3000, per=50)
    twice = [one for pair in zip(once, once, strict=True) for one in pair]
    found = [opened(*said(0), *each).metadata["clock_fit"] for each in (once, twice)]
    assert found[0] == found[1]


def test_what_came_late_is_left_out_and_said() -> None:
    first, late, last = packets(0, 300)
    recording = opened(*said(0), first, last, late)
    assert recording.metadata["ticks"]["p"]["runs"] == [[0, 100], [200, 100]]
    assert any("100 samples came twice or too late" in note for note in recording.notes)
