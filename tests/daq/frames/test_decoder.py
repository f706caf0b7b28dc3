from __future__ import annotations

import struct
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import Frame, FrameCounters
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.search import NEED_DATA
from tests.builders.vendor_files import FRAMING, serial_frame, serial_frames

FIXED = framing_from_table(FRAMING)
WEAK = framing_from_table(
    {
        "kind": "sync",
        "sync": "01 01",
        "length": {"fixed": 5},
        "checksum": {"algo": "xor8"},
        "frames": [{"when": {"at": 2, "equals": 1}, "fields": [{"name": "a", "at": 2, "type": "u8"}]}],
    }
)
BARE = framing_from_table(
    {"kind": "sync", "sync": "01", "length": {"fixed": 3}, "fields": [{"name": "a", "at": 1, "type": "u8"}]}
)
VARIABLE = framing_from_table(
    {
        "kind": "sync",
        "sync": "01",
        "length": {"at": 1, "type": "u8", "add": 3},
        "max": 9,
        "checksum": {"algo": "sum8"},
        "fields": [{"name": "a", "at": 2, "type": "u8"}],
    }
)
LINES = framing_from_table(
    {
        "kind": "delimiter",
        "delimiter": "\r\n",
        "start": "$",
        "comment": "$#",
        "max": 12,
        "checksum": {"algo": "xor8", "from": 1},
        "fields": [{"name": "a", "at": 1}],
    }
)
PLAIN_LINES = framing_from_table({"kind": "delimiter", "max": 6, "fields": [{"name": "a", "at": 0}]})


def decoded(framing: Any, pieces: list[bytes]) -> tuple[list[Frame], FrameCounters]:
    decoder = FrameDecoder(framing)
    frames = []
    for piece in pieces:
        decoder.feed(piece)
        while (frame := decoder.next_frame()) is not NEED_DATA:
            frames.append(frame)
    decoder.close()
    while (frame := decoder.next_frame()) is not NEED_DATA:
        frames.append(frame)
    return frames, decoder.counters


def pieces_of(stream: bytes, cuts: list[int]) -> list[bytes]:
    places = [0, *sorted(c % (len(stream) + 1) for c in cuts), len(stream)]
    return [stream[a:b] for a, b in pairwise(places)]


SHORT_ALPHABET = st.lists(st.sampled_from([0, 1, 1, 1, 2, 3, 4]), max_size=80).map(bytes)
LINE_ALPHABET = st.lists(st.sampled_from(list(b"$1,2*3\r\n\n#")), max_size=80).map(bytes)


@pytest.mark.exhaustive
@pytest.mark.parametrize("framing", [WEAK, BARE, VARIABLE])
@settings(max_examples=250, deadline=None)
@given(stream=SHORT_ALPHABET, cuts=st.lists(st.integers(0, 200), max_size=6))
def test_splitting_a_stream_anywhere_changes_nothing(framing: Any, stream: bytes, cuts: list[int]) -> None:
    whole = decoded(framing, [stream])
    assert decoded(framing, pieces_of(stream, cuts)) == whole
    assert decoded(framing, [stream[i : i + 1] for i in range(len(stream))]) == whole


@pytest.mark.exhaustive
@pytest.mark.parametrize("framing", [LINES, PLAIN_LINES])
@settings(max_examples=250, deadline=None)
@given(
    stream=st.lists(
        st.one_of(LINE_ALPHABET, st.sampled_from([b"$x,5*61\r\n", b"$x,5*60\r\n", b"1.5\n"])), max_size=8
    ).map(b"".join),
    cuts=st.lists(st.integers(0, 200), max_size=6),
)
def test_splitting_lines_anywhere_changes_nothing(framing: Any, stream: bytes, cuts: list[int]) -> None:
    whole = decoded(framing, [stream])
    assert decoded(framing, pieces_of(stream, cuts)) == whole
    assert decoded(framing, [stream[i : i + 1] for i in range(len(stream))]) == whole


@pytest.mark.exhaustive
@pytest.mark.parametrize("framing", [WEAK, BARE])
@settings(max_examples=300, deadline=None)
@given(stream=SHORT_ALPHABET)
def test_the_whole_capture_scan_equals_the_stream_decoder(framing: Any, stream: bytes) -> None:
    found = find_frames(framing, stream)
    frames, counters = decoded(framing, [stream])
    assert found.counters == counters
    assert found.ends.tolist() == [frame.end for frame in frames]
    assert [found.frame(i) for i in range(found.ends.size)] == [frame.data for frame in frames]


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(st.data())
def test_every_byte_is_in_a_good_frame_or_counted_as_skipped(data: st.DataObject) -> None:
    parts = data.draw(st.lists(st.one_of(st.binary(max_size=9), st.sampled_from(serial_frames(6))), max_size=12))
    stream = b"".join(parts)
    frames, counters = decoded(FIXED, [stream])
    assert sum(frame.end - frame.start for frame in frames) + counters.skipped_bytes == len(stream)
    assert counters.received == len(frames)
    for frame in frames:
        assert stream[frame.start : frame.end] == frame.data


def test_after_a_bad_checksum_the_search_goes_on_one_byte_further() -> None:
    good = serial_frame(1, 1000, 0.5)
    truncated = serial_frame(0, 0, 0.5)[:7]
    frames, counters = decoded(FIXED, [truncated + good])
    assert [frame.data for frame in frames] == [good]
    assert (counters.bad_checksum, counters.skipped_bytes) == (1, 7)


def test_a_length_beyond_the_maximum_holds_nothing_back() -> None:
    stream = bytes([1, 250]) + bytes([1, 1, 7, 9])
    frames, counters = decoded(VARIABLE, [stream])
    assert [frame.data for frame in frames] == [bytes([1, 1, 7, 9])]
    assert counters.bad_length == 1


def test_what_is_left_at_the_end_is_searched_once_more() -> None:
    stream = bytes([1, 6]) + bytes([1, 1, 7, 9])
    decoder = FrameDecoder(VARIABLE)
    decoder.feed(stream)
    assert decoder.next_frame() is NEED_DATA
    decoder.close()
    frame = decoder.next_frame()
    assert isinstance(frame, Frame)
    assert frame.data == bytes([1, 1, 7, 9])
    assert decoder.next_frame() is NEED_DATA
    assert decoder.counters.skipped_bytes == 2
    with pytest.raises(ValueError, match="closed"):
        decoder.feed(b"x")


def test_lines_are_checked_for_start_checksum_numbers_and_length() -> None:
    stream = (
        b"junk$x,5*61\r\n"  # a good line behind junk
        b"$x,5*60\r\n"  # a wrong checksum
        b"$x,5\r\n"  # none
        b"$x,y*2d\r\n"  # no number
        b"$x*5c\r\n"  # too few cells
        b"$#,5*3a\r\n"  # a comment
        b"$x,123456789012*00\r\n"  # too long
        b"no start\r\n\r\n"
        b"$x,6*62"  # cut
    )
    stream = stream.replace(b"*61", f"*{xor(b'x,5'):02X}".encode()).replace(b"*2d", f"*{xor(b'x,y'):02x}".encode())
    stream = stream.replace(b"*5c", f"*{xor(b'x'):02x}".encode())
    frames, counters = decoded(LINES, [stream])
    assert [frame.data for frame in frames] == [b"$x,5"]
    assert (frames[0].start, frames[0].end) == (4, 13)
    assert (counters.received, counters.bad_checksum, counters.bad_length) == (1, 2, 3)
    assert counters.skipped_bytes == len(stream) - 9


@pytest.mark.parametrize("cell", [b"1_0", b"nan", b"inf", b"1e999", b"", b"0x1", b"1,2"])
def test_a_cell_that_is_no_finite_decimal_number_is_none(cell: bytes) -> None:
    frames, counters = decoded(PLAIN_LINES, [cell + b"\n7\n"])
    good = [b"1,2"] if cell == b"1,2" else []
    assert [frame.data for frame in frames] == [*good, b"7"]
    assert counters.bad_length == (cell not in (b"", b"1,2"))


def xor(data: bytes) -> int:
    return int(np.bitwise_xor.reduce(np.frombuffer(data, dtype=np.uint8)))


def test_frames_of_unknown_type_are_received_and_counted() -> None:
    def framed(kind: int) -> bytes:
        body = bytes([1, 1, kind, 9])
        return body + struct.pack("B", xor(body))

    stream = framed(1) + framed(7)
    assert decoded(WEAK, [stream])[1] == FrameCounters(received=2, unknown_types=1)
    assert find_frames(WEAK, stream).counters == FrameCounters(received=2, unknown_types=1)


def test_a_length_too_small_for_the_checksum_is_no_length_and_not_a_wrong_checksum() -> None:
    """The checksum reaches from byte 3 to the end: no frame has fewer than four bytes."""
    framing = framing_from_table(
        {
            "kind": "sync",
            "sync": "AA",
            "length": {"at": 1, "type": "u8"},
            "max": 9,
            "checksum": {"algo": "sum8", "from": 3},
            "fields": [{"name": "a", "at": 2, "type": "u8"}],
        }
    )
    good, shortest = bytes([0xAA, 5, 7, 9, 9]), bytes([0xAA, 4, 7, 0])
    for stated in (2, 3):
        frames, counters = decoded(framing, [bytes([0xAA, stated, 7]) + good + shortest])
        assert [frame.data for frame in frames] == [good, shortest]
        assert (counters.bad_length, counters.bad_checksum, counters.skipped_bytes) == (1, 0, 3)
