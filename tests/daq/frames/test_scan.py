from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.frames import scan
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.frame_set import FrameCounters, FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.scan import PortStream, find_frames, find_frames_of_port
from tests.builders.serial_packets import stamped_port, summed

TABLE = {
    "kind": "sync",
    "sync": "AA",
    "length": {"fixed": 8},
    "checksum": {"algo": "sum8"},
    "fields": [{"name": "a", "at": 1, "type": "u8"}],
}
PLAIN = framing_from_table(TABLE)
TIMED = framing_from_table({**TABLE, "timeout_s": 0.05})
IDLE = framing_from_table({"kind": "idle", "baudrate": 9600, "max": 9, "fields": TABLE["fields"]})
FRAME = summed(b"\xaa\x01\x02\x03\x04\x05\x06")
WALL_NS = 1_780_000_000 * 10**9


def contents(frames: FrameSet) -> list[bytes]:
    return [frames.frame(i) for i in range(frames.begins.size)]


def test_nothing_without_bytes_is_no_frame() -> None:
    assert contents(find_frames(PLAIN, b"")) == []
    assert contents(find_frames_of_port(TIMED, PortStream.plain(b""))) == []


@pytest.mark.parametrize("framing", [PLAIN, TIMED])
def test_a_port_that_was_lost_before_it_delivered_anything_has_no_frames(framing: Framing) -> None:
    port = PortStream.of_reads([(10**18, None), (10**18 + 5, None)])
    assert find_frames_of_port(framing, port).counters == FrameCounters()


@pytest.mark.parametrize("framing", [PLAIN, TIMED])
def test_nothing_is_joined_over_a_place_where_the_device_was_lost(framing: Framing) -> None:
    """The halves of one frame make a sound one if they are put together, and are none: bytes are missing there."""
    reads = [(0, FRAME), (1, FRAME[:3]), (2, None), (3, FRAME[3:]), (4, FRAME), (5, None), (6, FRAME)]
    frames = find_frames_of_port(framing, PortStream.of_reads(reads))
    assert frames.ends.tolist() == [8, 24, 32]
    assert frames.counters.received == 3
    assert frames.counters.skipped_bytes == len(FRAME)


def test_a_device_that_was_lost_twice_in_a_row_was_lost_there() -> None:
    reads = [(0, None), (1, FRAME[:3]), (2, None), (3, None), (4, FRAME[3:]), (5, FRAME), (6, None)]
    assert find_frames_of_port(PLAIN, PortStream.of_reads(reads)).ends.tolist() == [16]


def test_bytes_without_host_times_are_searched_as_one_stream_even_where_silence_would_end_frames() -> None:
    stream = FRAME[:5] + FRAME * 2
    frames = find_frames_of_port(TIMED, PortStream.plain(stream))
    assert frames.ends.tolist() == find_frames(TIMED, stream).ends.tolist() == [13, 21]


def test_a_silence_is_as_long_by_a_wall_clock_as_by_any_other() -> None:
    """Fractions of a microsecond count, more than fifty years after the clock's zero."""
    framing = framing_from_table({"kind": "idle", "baudrate": 115200, "max": 9, "fields": TABLE["fields"]})
    silence_ns, byte_ns = round(framing.silence_s * 1e9), round(framing.byte_s * 1e9)
    for start in (0, *range(WALL_NS, WALL_NS + 1000, 137)):
        reads, now = [], start
        for pause_ns in (0, silence_ns + 200, silence_ns - 200, silence_ns + 200):
            now += pause_ns + 2 * byte_ns
            reads.append((now, b"ab"))
        assert contents(find_frames_of_port(framing, PortStream.of_reads(reads))) == [b"ab", b"abab", b"ab"]


def test_bytes_behind_the_last_read_belong_to_it() -> None:
    """What came with a read whose time is lost is searched like the rest, and no silence lies before it."""
    whole = stamped_port([(0.0, FRAME), (1.0, FRAME[:3]), (1.01, FRAME[3:] + FRAME)])
    port = replace(whole, host_ns=whole.host_ns[:2], ends=whole.ends[:2])
    assert find_frames_of_port(TIMED, port).ends.tolist() == [8, 16, 24]
    idle = replace(stamped_port([(0.0, b"abc"), (5.0, b"def")]), host_ns=np.array([0]), ends=np.array([3]))
    assert contents(find_frames_of_port(IDLE, idle)) == [b"abcdef"]


@pytest.mark.parametrize("read_bytes", [1 << 12, 3 << 16])
def test_a_long_stream_gives_each_frame_once(read_bytes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However the stream is gone through, frames that lie across the pieces are whole."""
    monkeypatch.setattr(scan, "_CHUNK", 1 << 16)
    count = (5 << 15) // len(FRAME)
    stream = b"\x55" * 3 + FRAME * count
    ends = (np.arange(count) + 1) * len(FRAME) + 3
    expected = FrameCounters(received=count, skipped_bytes=3)
    ready = find_frames(PLAIN, stream)
    pieces = [stream[at : at + read_bytes] for at in range(0, len(stream), read_bytes)]
    by_reads = find_frames_of_port(TIMED, stamped_port([(0.001 * i, piece) for i, piece in enumerate(pieces)]))
    for frames in (ready, by_reads):
        np.testing.assert_array_equal(frames.ends, ends)
        assert frames.counters == expected
