"""Counters of CAN messages, in logs and captures."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.can.log import CANDUMP
from recoil_acquisition.readers.rdlog import CaptureReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders import can_captures
from tests.builders import vendor_files as build

DBC = """VERSION ""

NS_ :

BS_:

BU_: RIG

BO_ 288 RecoilNode: 8 RIG
 SG_ p : 0|16@1+ (1,0) [0|0] "bar" RIG
 SG_ counter : 48|8@1+ (1,0) [0|255] "" RIG
 SG_ rate : 16|32@1+ (1,0) [0|0] "" RIG

BO_ 289 Mux: 8 RIG
 SG_ kind M : 0|8@1+ (1,0) [0|0] "" RIG
 SG_ count m1 : 8|4@1+ (1,0) [0|0] "" RIG
 SG_ other m2 : 8|8@1+ (1,0) [0|0] "" RIG

SIG_VALTYPE_ 288 rate : 1;
"""


def message(at: int, count: int) -> build.CanEntry:
    return at * 1_000_000, 288, struct.pack("<HfBx", at, 0.0, count % 256)


def candump(folder: Path, entries: list[build.CanEntry], *counters: str) -> Recording:
    path = folder / "bus.log"
    path.write_bytes(build.candump_log(entries))
    return CANDUMP.open(path, Declarations("can", database=DBC, counters=counters))


@pytest.mark.exhaustive
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=st.integers(0, 255), runs=st.lists(st.tuples(st.integers(1, 40), st.integers(1, 126)), max_size=8))
def test_every_missing_message_is_counted_over_the_wraps(
    tmp_path: Path, first: int, runs: list[tuple[int, int]]
) -> None:
    entries, at = [], 0
    for sent, lost in runs:
        entries += [message(at + i, first + at + i) for i in range(sent)]
        at += sent + lost
    entries.append(message(at, first + at))
    metadata = candump(tmp_path, entries, "RecoilNode.counter").metadata
    assert (metadata["counter_gaps"], metadata["missing_frames"]) == (len(runs), sum(lost for _, lost in runs))
    assert metadata["counted_frames"] == len(entries)
    assert metadata["longest_gap_frames"] == max((lost for _, lost in runs), default=0)
    assert metadata["longest_gap_s"] == pytest.approx(max((1e-3 * (lost + 1) for _, lost in runs), default=0.0))


def test_log_and_capture_say_the_same(tmp_path: Path) -> None:
    entries = [message(i, i) for i in range(600) if i not in (5, 255, 256, 300, 301)]
    path = tmp_path / "bus.rdlog"
    path.write_bytes(can_captures.can_capture(can_captures.can_records(entries)))
    declared = Declarations("can", database=DBC, counters=("RecoilNode.counter",))
    for recording in (candump(tmp_path, entries, "RecoilNode.counter"), CaptureReader().open(path, declared)):
        assert "RecoilNode.counter: 3 gaps, 5 messages are missing" in recording.notes
        assert (recording.metadata["counter_gaps"], recording.metadata["missing_frames"]) == (3, 5)
        assert recording.metadata["counters"]["RecoilNode.counter"]["missing_frames"] == 5


def test_frames_that_do_not_increase_in_time_are_not_missing(tmp_path: Path) -> None:
    entries = [message(i, i) for i in range(20)]
    entries[7] = (entries[6][0], *entries[7][1:])
    recording = candump(tmp_path, entries, "RecoilNode.counter")
    assert recording.read("RecoilNode.p").size == 19
    assert (recording.metadata["counter_gaps"], recording.metadata["missing_frames"]) == (0, 0)


def test_what_the_counter_cannot_size_is_a_gap_without_a_number(tmp_path: Path) -> None:
    recording = candump(tmp_path, [message(i, i) for i in range(400) if not 100 <= i < 300], "RecoilNode.counter")
    assert (recording.metadata["counter_gaps"], recording.metadata["missing_frames"]) == (1, 0)
    assert recording.metadata["unsized_gaps"] == 1
    assert recording.metadata["longest_gap_s"] == pytest.approx(0.201)


def test_only_messages_that_hold_a_multiplexed_counter_count(tmp_path: Path) -> None:
    entries, count = [], 0
    for i in range(90):
        if i % 3 == 0:
            if i != 45:
                entries.append((i * 1_000_000, 289, bytes([1, count % 16]) + bytes(6)))
            count += 1
        else:
            entries.append((i * 1_000_000, 289, bytes([2, i]) + bytes(6)))
    entries.append((90_000_000, 289, b"\x01"))  # too short to hold it
    metadata = candump(tmp_path, entries, "Mux.count").metadata
    assert (metadata["counted_frames"], metadata["counter_gaps"], metadata["missing_frames"]) == (29, 1, 1)


def test_counters_of_several_messages_are_summed(tmp_path: Path) -> None:
    entries = [message(i, i) for i in range(50) if i != 20]
    entries += [(i * 1_000_000 + 100, 289, bytes([1, i % 16]) + bytes(6)) for i in range(50) if i not in (30, 31)]
    metadata = candump(tmp_path, sorted(entries), "RecoilNode.counter", "Mux.count").metadata
    assert (metadata["counter_gaps"], metadata["missing_frames"], metadata["longest_gap_frames"]) == (2, 3, 2)


def test_without_declared_counters_nothing_is_claimed(tmp_path: Path) -> None:
    metadata = candump(tmp_path, [message(i, i) for i in range(9)]).metadata
    assert not {"missing_frames", "counter_gaps", "counters"} & set(metadata)


@pytest.mark.parametrize("name", ["RecoilNode.countr", "RecoilNode.rate"])
def test_a_counter_that_is_none_is_refused_with_the_nearest_names(tmp_path: Path, name: str) -> None:
    with pytest.raises(ReadError, match=f"{name}.*expected an integer signal") as caught:
        candump(tmp_path, [message(0, 0)], name)
    assert "'RecoilNode.counter'" in str(caught.value.found)
    assert "RecoilNode.rate" not in str(caught.value.found)
    assert "correct `counters`" in str(caught.value)


def test_a_counter_of_64_bits_needs_no_modulo(tmp_path: Path) -> None:
    wide = DBC.replace("SG_ p : 0|16@1+ (1,0)", "SG_ big : 0|64@1+ (1,0)").replace("SIG_VALTYPE_ 288 rate : 1;", "")
    wide = "\n".join(line for line in wide.splitlines() if "48|8" not in line and "16|32" not in line)
    path = tmp_path / "bus.log"
    numbers = np.delete(np.arange(2**40, 2**40 + 30), [4, 5])
    entries = [(i * 1_000_000, 288, struct.pack("<Q", int(n))) for i, n in enumerate(numbers)]
    path.write_bytes(build.candump_log(entries))
    declared = Declarations("can", database=wide, counters=("RecoilNode.big",))
    metadata = CANDUMP.open(path, declared).metadata
    assert (metadata["counter_gaps"], metadata["missing_frames"]) == (1, 2)


def test_messages_that_changed_places_are_not_missing(tmp_path: Path) -> None:
    entries = [message(i, i) for i in range(400) if i not in (200, 201)]
    entries[100], entries[101] = entries[101], entries[100]
    metadata = candump(tmp_path, entries, "RecoilNode.counter").metadata
    assert (metadata["counter_gaps"], metadata["missing_frames"], metadata["unsized_gaps"]) == (1, 2, 0)
