from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import FrameCounters
from recoil_acquisition.frames.framing import Framing
from tests.builders.serial_packets import cobs, decoded, slip, summed, taken

BYTE = [{"name": "a", "at": 1, "type": "u8"}]


def declared(**keys: Any) -> Framing:
    return framing_from_table({"fields": BYTE, **keys})


def line(text: str) -> bytes:
    return text.encode() + b"*" + f"{sum(text.encode()[1:]) & 0xFF:02x}".encode() + b"\r\n"


SYNC = {"kind": "sync", "sync": "01 02", "checksum": {"algo": "sum8"}}
LENGTH = {**SYNC, "length": {"at": 2, "type": "u8", "add": 4}, "max": 12}
FRAME_TYPES = [
    {"when": {"at": 2, "equals": 1}, "fields": [{"name": "a", "at": 3, "type": "i8", "plausible": [-1, 2]}]},
    {"when": {"at": 2, "text": "\x02"}},
]
# the second selector fits frames of the first type as well, which is the one that counts
OVERLAPPING = [
    {"when": {"at": 2, "equals": 1}, "fields": [{"name": "a", "at": 3, "type": "u8"}]},
    {"when": {"at": 3, "equals": 9}, "fields": [{"name": "b", "at": 2, "type": "u8", "plausible": [2, 3]}]},
]
FRAME_TYPES_OF_PACKETS = [
    {"when": {"at": 0, "equals": 1}, "fields": [{"name": "a", "at": 1, "type": "u8", "plausible": [0, 2]}]},
    {"when": {"at": 0, "equals": 2}},
]
TYPES_BEHIND_LENGTH = [
    {"when": {"at": 3, "equals": 1}, "fields": [{"name": "a", "at": 4, "type": "u8", "plausible": [0, 2]}]},
    {"when": {"at": 3, "equals": 2}},
]
ELEMENT = {"name": "a", "id": 1, "type": "u8", "plausible": [0, 2]}

# a framing, and bytes that it takes for frames or nearly so
EXAMPLES: dict[str, tuple[Framing, list[bytes]]] = {
    "fixed length": (
        declared(**SYNC, length={"fixed": 5}),
        [summed(b"\1\2\1\1"), summed(b"\1\2\1\2"), b"\1\2\3\4\5"],
    ),
    "look-ahead": (
        declared(**SYNC, length={"fixed": 5}, look_ahead=True),
        [summed(b"\1\2\1\1"), summed(b"\1\2\1\2"), b"\1"],
    ),
    "known types and plausible values": (
        framing_from_table({**SYNC, "length": {"fixed": 5}, "only_known": True, "frames": FRAME_TYPES}),
        [summed(b"\1\2\1\1"), summed(b"\1\2\2\1"), summed(b"\1\2\3\1"), summed(b"\1\2\1\x09"), summed(b"\1\2\1\xff")],
    ),
    "any types": (
        framing_from_table({**SYNC, "length": {"fixed": 5}, "frames": OVERLAPPING}),
        [summed(b"\1\2\1\x09"), summed(b"\1\2\2\x09"), summed(b"\1\2\4\x09"), summed(b"\1\2\5\5")],
    ),
    "length field": (
        declared(**LENGTH),
        [summed(b"\1\2\1\1"), summed(b"\1\2\2\1\1"), summed(b"\1\2\2\1\2"), b"\1\2\x09", b"\1\2\xff"],
    ),
    "length by type": (
        declared(**SYNC, length={"at": 2, "of": {"01": 5, "02": 6}}),
        [summed(b"\1\2\1\1"), summed(b"\1\2\2\1\1"), summed(b"\1\2\3\1")],
    ),
    "length field with look-ahead": (
        declared(**LENGTH, look_ahead=True),
        [summed(b"\1\2\1\1"), summed(b"\1\2\2\1\1"), summed(b"\1\2\2\1\2")],
    ),
    "plausible elements": (
        framing_from_table({**LENGTH, "tlv": {"from": 3, "len": "u8", "id": "u8"}, "fields": [ELEMENT]}),
        [summed(b"\1\2\3\1\1\2"), summed(b"\1\2\3\1\1\3"), summed(b"\1\2\1\1")],
    ),
    "hexadecimal checksum": (
        declared(**{**SYNC, "checksum": {"algo": "sum8", "format": "hex", "mark": "*"}}, length={"fixed": 6}),
        [b"\1\2\1*04", b"\1\2\2*05", b"\1\2\2*06"],
    ),
    "no sync": (
        declared(kind="fixed", length={"fixed": 3}, checksum={"algo": "sum8"}),
        [summed(b"\1\1"), summed(b"\1\2"), summed(b"\3\4")],
    ),
    "no sync and no checksum": (declared(kind="fixed", length={"fixed": 3}), [b"\1\2\3"]),
    "length field of two bytes": (
        declared(**SYNC, length={"at": 2, "type": "u16", "endian": "big", "add": 5}, max=12),
        [summed(b"\1\2\0\1\1"), summed(b"\1\2\0\2\1\1"), summed(b"\1\2\0\0"), b"\1\2\0\1\1\xff"],
    ),
    "known types of any length": (
        framing_from_table({**LENGTH, "only_known": True, "frames": TYPES_BEHIND_LENGTH}),
        [summed(b"\1\2\2\1\1"), summed(b"\1\2\3\1\2\x09"), summed(b"\1\2\2\1\x09"), summed(b"\1\2\1\5"), b"\1\2"],
    ),
    "any types of any length": (
        framing_from_table({**LENGTH, "frames": TYPES_BEHIND_LENGTH}),
        [summed(b"\1\2\2\1\1"), summed(b"\1\2\1\2"), summed(b"\1\2\1\3"), summed(b"\1\2\2\1\x09")],
    ),
    "lines": (
        declared(
            kind="delimiter",
            delimiter="\r\n",
            start="$",
            comment="$#",
            max=14,
            checksum={"algo": "sum8", "from": 1},
            fields=[{"name": "a", "at": 1, "plausible": [0, 5]}],
        ),
        [line("$x,5"), line("$x,6"), line("$x,1_0"), line("$x"), b"$#\r\n", b"$x,123456789012\r\n", b"$x,5\r\n"],
    ),
    "cobs": (
        declared(kind="cobs", max=6, checksum={"algo": "sum8"}),
        [cobs(summed(b"\0\1\2")), cobs(summed(b"\1\0")), cobs(b"\1\2\3\4\5\6\7"), b"\x09\1\0", b"\0\0", b"\0"],
    ),
    "slip": (
        declared(kind="slip", max=4, checksum={"algo": "sum8"}),
        [slip(summed(b"\xc0\xdb")), slip(summed(b"\1\2"), both_ends=True), b"\xc0", b"\xdb\1\xc0", b"\xdb\xdc" * 5],
    ),
    "cobs without a checksum": (
        framing_from_table({"kind": "cobs", "max": 4, "frames": FRAME_TYPES_OF_PACKETS}),
        [cobs(b"\1\2"), cobs(b"\2"), cobs(b"\3\0"), cobs(b"\1\5"), cobs(b""), b"\0", b"\2\0"],
    ),
    "slip of known types": (
        framing_from_table({"kind": "slip", "max": 4, "only_known": True, "frames": FRAME_TYPES_OF_PACKETS}),
        [slip(b"\1\2"), slip(b"\2\xdb"), slip(b"\3\xc0", both_ends=True), slip(b"\1\5"), b"\xc0", b"\2\xdb\xc0"],
    ),
}
PARTS = st.sampled_from(["frame", "run", "mixed run", "noise", "cut"])


@st.composite
def streams(draw: st.DrawFn, frames: list[bytes]) -> bytes:
    """Frames, long runs of them, noise of bytes that occur in frames, and frames with a byte gone or added."""
    alphabet = st.sampled_from(sorted(set(b"".join(frames))))
    parts = []
    for kind in draw(st.lists(PARTS, max_size=8)):
        frame = draw(st.sampled_from(frames))
        if kind == "run":
            parts.append(frame * draw(st.integers(8, 90)))
        elif kind == "mixed run":
            parts.append(b"".join(draw(st.lists(st.sampled_from(frames), min_size=1, max_size=3))) * 30)
        elif kind == "noise":
            parts.append(bytes(draw(st.lists(alphabet, max_size=12))))
        elif kind == "cut":
            place = draw(st.integers(0, len(frame)))
            parts.append(frame[:place] + frame[place + draw(st.integers(0, 2)) :])
        else:
            parts.append(frame)
    return b"".join(parts)


def reads_of(stream: bytes, cuts: list[int]) -> list[tuple[None, bytes]]:
    places = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    return [(None, stream[a:b]) for a, b in pairwise(places)]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", EXAMPLES)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_each_byte_is_in_one_frame_or_skipped_and_the_same_one_however_a_stream_is_cut_and_taken(
    name: str, data: st.DataObject
) -> None:
    framing, frames = EXAMPLES[name]
    stream = data.draw(streams(frames))
    reads = reads_of(stream, data.draw(st.lists(st.integers(0, 4000), max_size=6)))
    whole, counters = decoded(framing, [(None, stream)])
    assert all(before.end <= after.start for before, after in pairwise(whole))
    assert sum(frame.end - frame.start for frame in whole) + counters.skipped_bytes == len(stream)
    assert counters.received == len(whole)
    assert decoded(framing, reads) == (whole, counters)
    by_blocks = [(frame.end, frame.data) for frame in whole]
    assert taken(framing, reads) == (by_blocks, counters)
    assert taken(framing, [(None, stream)]) == (by_blocks, counters)
    if len(stream) < 300:
        assert decoded(framing, [(None, stream[i : i + 1]) for i in range(len(stream))]) == (whole, counters)


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_sound_stream_is_framed_completely_whatever_the_block(name: str) -> None:
    framing, frames = EXAMPLES[name]
    stream = frames[0] * 200
    for size in (1, 7, 64, 4096):
        reads = [(None, stream[at : at + size]) for at in range(0, len(stream), size)]
        found, counters = taken(framing, reads)
        assert counters == FrameCounters(received=200)
        assert [end for end, _ in found] == [(i + 1) * len(frames[0]) for i in range(200)]


def test_good_frames_of_an_unknown_type_are_counted() -> None:
    framing, (first, second, implausible, unknown) = EXAMPLES["any types"]
    stream = first * 30 + second * 30 + unknown * 30 + implausible
    assert taken(framing, [(None, stream)])[1] == FrameCounters(90, unknown_types=30, implausible=1, skipped_bytes=5)


def test_a_frame_that_no_sync_follows_is_refused_if_look_ahead_is_declared() -> None:
    framing, (good, *_) = EXAMPLES["look-ahead"]
    found, counters = decoded(framing, [(None, good + b"\3" + good + good)])
    assert [frame.start for frame in found] == [6, 11]
    assert (counters.not_followed, counters.skipped_bytes) == (1, 6)


def test_a_value_beyond_what_is_plausible_is_a_counted_fault_not_a_frame() -> None:
    framing, (good, ignored, unknown, implausible, negative) = EXAMPLES["known types and plausible values"]
    found, counters = decoded(framing, [(None, good + implausible + ignored + unknown + negative)])
    assert [frame.data for frame in found] == [good, ignored, negative]
    assert counters == FrameCounters(received=3, implausible=1, unknown_types=1, skipped_bytes=10)


@pytest.mark.parametrize("plausible", [None, [-(10**9), 10**9]])
def test_an_unsigned_number_of_64_bits_beyond_63_is_no_good_frame(plausible: list[int] | None) -> None:
    field = {"name": "t", "at": 1, "type": "u64", **({} if plausible is None else {"plausible": plausible})}
    framing = framing_from_table({"kind": "sync", "sync": "AA", "length": {"fixed": 9}, "fields": [field]})
    good, bad = b"\xaa" + (7).to_bytes(8, "little"), b"\xaa" + (2**63).to_bytes(8, "little")
    stream = good * 20 + bad + good * 20
    found, counters = taken(framing, [(None, stream)])
    assert (len(found), counters.implausible, counters.skipped_bytes) == (40, 1, 9)


def test_without_a_boundary_a_long_idle_line_holds_no_memory() -> None:
    for name, filler in (("slip", b"\xc0"), ("cobs", b"\0"), ("lines", b"x"), ("fixed length", b"\7")):
        decoder = FrameDecoder(EXAMPLES[name][0])
        for _ in range(50):
            decoder.feed(filler * 100)
            decoder.take()
        decoder.feed(b"")
        assert len(decoder._buffer) < 40, name
