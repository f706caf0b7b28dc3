from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import FrameCounters
from recoil_acquisition.frames.scan import PortStream, find_frames, find_frames_of_port
from recoil_acquisition.frames.search import NEED_DATA
from tests.builders.serial_packets import decoded, stamped_port, summed, taken

MODBUS = {
    "kind": "idle",
    "baudrate": 9600,
    "bits_per_byte": 11,
    "max": 40,
    "checksum": {"algo": "crc16-modbus"},
    "fields": [{"name": "a", "at": 3, "type": "u16", "endian": "big"}],
}
IDLE = framing_from_table(MODBUS)
SYNC = framing_from_table(
    {
        "kind": "sync",
        "sync": "AA",
        "length": {"at": 1, "type": "u8"},
        "max": 200,
        "checksum": {"algo": "sum8"},
        "timeout_s": 0.05,
        "fields": [{"name": "a", "at": 2, "type": "u8"}],
    }
)
REPLY = summed(b"\x01\x03\x02\x12\x34", "crc16-modbus")
SHORT = summed(b"\xaa\x04\x07")


def reads_of(frames: list[bytes], gaps_s: list[float], cuts: list[int]) -> list[tuple[float, bytes]]:
    """Send frames without a pause within each, read them in pieces, each stamped when its last byte is there."""
    reads, now_s = [], 0.0
    for frame, gap_s in zip(frames, gaps_s, strict=True):
        now_s += gap_s
        places = [0, *sorted({cut % len(frame) for cut in cuts} - {0}), len(frame)]
        for a, b in pairwise(places):
            now_s += (b - a) * IDLE.byte_s
            reads.append((now_s, frame[a:b]))
    return reads


def test_modbus_silences_are_the_default() -> None:
    assert IDLE.silence_s == pytest.approx(3.5 * 11 / 9600)
    assert framing_from_table({**MODBUS, "baudrate": 115200}).silence_s == 1.75e-3
    assert framing_from_table({**MODBUS, "gap_s": 0.01}).silence_s == 0.01


@pytest.mark.exhaustive
@settings(max_examples=80, deadline=None)
@given(
    frames=st.lists(st.binary(min_size=0, max_size=30), min_size=1, max_size=8),
    gaps_s=st.lists(st.floats(5e-3, 1.0), min_size=8, max_size=8),
    cuts=st.lists(st.integers(0, 100), max_size=5),
)
def test_silence_tells_frames_apart_however_each_is_read(
    frames: list[bytes], gaps_s: list[float], cuts: list[int]
) -> None:
    frames = [summed(frame, "crc16-modbus") for frame in frames]
    reads = reads_of(frames, gaps_s[: len(frames)], cuts)
    found, counters = decoded(IDLE, reads)
    assert [frame.data for frame in found] == frames
    assert counters == FrameCounters(received=len(frames))
    assert taken(IDLE, reads) == ([(frame.end, frame.data) for frame in found], counters)
    capture = find_frames_of_port(IDLE, stamped_port(reads))
    assert [capture.frame(i) for i in range(len(frames))] == frames
    assert capture.counters == counters


def test_what_a_silence_bounds_is_one_frame_or_none() -> None:
    pieces = [REPLY, REPLY[:4], REPLY + REPLY, b"\0" + REPLY, bytes(60), REPLY]
    found, counters = decoded(IDLE, reads_of(pieces, [0.1] * 6, [3]))
    assert [frame.data for frame in found] == [REPLY, REPLY]
    assert (counters.bad_checksum, counters.bad_length, counters.timed_out) == (3, 1, 0)
    assert counters.skipped_bytes == sum(map(len, pieces)) - 2 * len(REPLY)


def test_time_that_passes_without_bytes_ends_a_frame() -> None:
    decoder = FrameDecoder(IDLE)
    decoder.feed(REPLY, 1.0)
    assert decoder.next_frame() is NEED_DATA
    decoder.feed(b"", 1.001)
    assert decoder.next_frame() is NEED_DATA
    decoder.feed(b"", 1.01)
    frame = decoder.next_frame()
    assert frame is not NEED_DATA
    assert frame.data == REPLY
    decoder.feed(b"", 1.02)
    assert decoder.next_frame() is NEED_DATA
    assert decoder.counters == FrameCounters(received=1)


def test_silence_cannot_be_told_without_host_times() -> None:
    with pytest.raises(ValueError, match="need the host time"):
        FrameDecoder(IDLE).feed(REPLY)
    with pytest.raises(ValueError, match="need the host time"):
        find_frames(IDLE, REPLY)
    with pytest.raises(ValueError, match="need the host time"):
        find_frames_of_port(IDLE, PortStream.plain(REPLY))


def test_a_half_frame_times_out_and_holds_nothing_back() -> None:
    corrupted = b"\xaa\xc0\x07"  # its length of 192 would swallow what comes
    reads = [(0.0, SHORT), (0.1, corrupted), (0.2, SHORT), (0.21, SHORT[:2]), (0.22, SHORT[2:]), (0.3, SHORT)]
    found, counters = decoded(SYNC, reads)
    assert [frame.start for frame in found] == [0, 7, 11, 15]
    assert counters == FrameCounters(received=4, timed_out=1, skipped_bytes=3)
    assert find_frames_of_port(SYNC, stamped_port(reads)).counters == counters
    without_times = [(None, data) for _, data in reads]
    assert decoded(SYNC, without_times)[1] == FrameCounters(
        received=4, skipped_bytes=3
    )  # only once the stream has ended


def test_good_frames_within_a_half_frame_that_timed_out_are_found() -> None:
    found, counters = decoded(SYNC, [(0.0, b"\xaa\xc0" + SHORT + SHORT[:3]), (1.0, SHORT)])
    assert [frame.start for frame in found] == [2, 9]
    assert counters == FrameCounters(received=2, timed_out=1, skipped_bytes=5)


def test_the_time_of_bytes_on_the_line_is_no_silence() -> None:
    slow = framing_from_table(
        {"kind": "fixed", "length": {"fixed": 100}, "timeout_s": 0.05, "baudrate": 1000, "fields": MODBUS["fields"]}
    )
    assert decoded(slow, [(0.0, bytes(1)), (0.99, bytes(99))])[1] == FrameCounters(received=1)
    assert decoded(slow, [(0.0, bytes(1)), (1.05, bytes(99))])[1] == FrameCounters(timed_out=1, skipped_bytes=100)


def test_an_interruption_ends_what_waits_like_a_silence() -> None:
    decoder = FrameDecoder(SYNC)
    decoder.feed(SHORT + SHORT[:3])
    decoder.interrupt()
    decoder.feed(SHORT[3:] + SHORT)
    assert decoder.take().ends.tolist() == [4, 12]
    assert decoder.counters == FrameCounters(received=2, timed_out=1, skipped_bytes=4)


@pytest.mark.exhaustive
@settings(max_examples=120, deadline=None)
@given(
    pieces=st.lists(
        st.tuples(
            st.sampled_from([SHORT, SHORT * 20, SHORT[:2], SHORT[2:], b"\xaa\xc0", b"\xaa\xff", b"\x01"]),
            st.sampled_from([0.0, 0.01, 0.2]),
        ),
        max_size=12,
    ),
    asked=st.lists(st.booleans(), min_size=12, max_size=12),
)
def test_when_frames_are_asked_for_changes_nothing_between_silences(
    pieces: list[tuple[bytes, float]], asked: list[bool]
) -> None:
    now_s, reads = 0.0, []
    for data, gap_s in pieces:
        now_s += gap_s
        reads.append((now_s, data))
    whole, counters = decoded(SYNC, reads)
    by_blocks = [(frame.end, frame.data) for frame in whole]
    assert taken(SYNC, reads) == (by_blocks, counters)
    decoder = FrameDecoder(SYNC)
    ends = []
    for (host_s, data), ask in zip(reads, asked, strict=False):
        decoder.feed(data, host_s)
        ends += decoder.take().ends.tolist() if ask else []
    decoder.close()
    assert ends + decoder.take().ends.tolist() == [end for end, _ in by_blocks]
    assert decoder.counters == counters


@pytest.mark.parametrize(("length", "good"), [(9, 1), (10, 0)])
def test_a_frame_between_silences_may_be_as_long_as_the_longest(length: int, good: int) -> None:
    framing = framing_from_table({"kind": "idle", "baudrate": 9600, "max": 9, "fields": MODBUS["fields"]})
    frames = find_frames_of_port(framing, stamped_port([(0.0, bytes(length))]))
    assert (frames.begins.size, frames.counters.bad_length) == (good, 1 - good)
