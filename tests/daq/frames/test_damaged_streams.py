from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.frame_set import FrameCounters
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.scan import find_frames
from tests.builders.serial_packets import cobs, decoded, slip, summed, taken

FIELDS = [{"name": "a", "at": 4, "type": "u16"}]
CHECKSUM = {"algo": "crc16-ccitt-false", "order": "big"}
HEADED = {"kind": "sync", "sync": "75 65", "length": {"at": 3, "type": "u8", "add": 6}, "max": 64}
KINDS: dict[str, dict[str, Any]] = {
    "cobs": {"kind": "cobs", "max": 64},
    "slip": {"kind": "slip", "max": 64},
    "lengths": HEADED,
    "lengths with look-ahead": {**HEADED, "look_ahead": True},
}
FRAMES = 150


def framing_of(kind: str, **keys: Any) -> Framing:
    return framing_from_table({**KINDS[kind], "checksum": CHECKSUM, "fields": FIELDS, **keys})


def sound_frames(kind: str, payloads: list[int], seed: int, rich: bool) -> list[bytes]:
    """Frames whose payloads have given sizes by turns; rich ones are full of what is stuffed."""
    rng = np.random.default_rng(seed)
    frames = []
    for i in range(FRAMES):
        size = payloads[i % len(payloads)]
        content = rng.choice([0, 0x75, 0x65, 0xC0, 0xDB, 0xDC], size).astype(np.uint8).tobytes() if rich else None
        body = b"\x75\x65\x80" + bytes([size]) + (rng.bytes(size) if content is None else content)
        frame = summed(body, CHECKSUM["algo"], "big")
        frames.append({"cobs": cobs, "slip": slip}.get(kind, bytes)(frame))
    return frames


def damaged(stream: bytes, damages: list[tuple[int, str, int]]) -> bytes:
    changed = bytearray(stream)
    for place, what, byte in damages:
        at = place % len(changed)
        if what == "lost":
            del changed[at]
        elif what == "added":
            changed.insert(at, byte)
        else:
            changed[at] = byte
    return bytes(changed)


DAMAGES = st.lists(
    st.tuples(
        st.integers(0, 10_000),
        st.sampled_from(["lost", "added", "changed"]),
        st.one_of(st.integers(0, 255), st.sampled_from([0, 0xC0, 0xDB, 0x75])),
    ),
    max_size=12,
)


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None)
@given(
    payloads=st.sampled_from([[34], [34, 36], [34, 34, 36], [20, 34, 50], list(range(20, 40)), [2, 58]]),
    seed=st.integers(0, 1000),
    rich=st.booleans(),
    damages=DAMAGES,
    cuts=st.lists(st.tuples(st.integers(0, 10_000), st.sampled_from([0.001, 0.2])), max_size=5),
)
def test_a_whole_stream_gives_what_going_from_frame_to_frame_after_each_read_gives(
    kind: str,
    payloads: list[int],
    seed: int,
    rich: bool,
    damages: list[tuple[int, str, int]],
    cuts: list[tuple[int, float]],
) -> None:
    framing = framing_of(kind, timeout_s=0.05)
    stream = damaged(b"".join(sound_frames(kind, payloads, seed, rich)), damages)
    cuts = sorted((place % len(stream), gap_s) for place, gap_s in cuts)
    times_s = np.cumsum([0.0, *(gap_s for _, gap_s in cuts)]).tolist()
    places = [0, *(place for place, _ in cuts), len(stream)]
    reads = [(now_s, stream[a:b]) for now_s, (a, b) in zip(times_s, pairwise(places), strict=True)]
    frames, counters = decoded(framing, reads)
    assert taken(framing, reads) == ([(frame.end, frame.data) for frame in frames], counters)
    whole, whole_counters = decoded(framing, [(None, stream)])
    found = find_frames(framing, stream)
    assert [found.frame(i) for i in range(found.ends.size)] == [frame.data for frame in whole]
    assert found.ends.tolist() == [frame.end for frame in whole]
    assert found.counters == whole_counters


def test_several_delimiters_before_a_packet_are_skipped_but_for_the_last() -> None:
    packet = slip(summed(b"\x01\x02\x03\x04\x05\x06", CHECKSUM["algo"], "big"))
    framing = framing_of("slip")
    stream = (packet + b"\xc0" + packet + b"\xc0\xc0\xc0") * 20
    frames, counters = taken(framing, [(None, stream)])
    assert (len(frames), counters) == (40, FrameCounters(received=40, skipped_bytes=19 * 2 + 3))
    assert [end for end, _ in frames[:3]] == [9, 19, 31]


def test_damage_of_every_kind_is_counted() -> None:
    good, wrong = cobs(summed(b"\x01" * 6, CHECKSUM["algo"], "big")), cobs(b"\x01" * 8)
    framing = framing_of("cobs")
    pieces = [good, wrong, good, b"\x09\x01\0", good, cobs(b"\x01" * 70), good] * 10
    frames, counters = taken(framing, [(None, b"".join(pieces))])
    assert len(frames) == 40
    skipped = 10 * (len(wrong) + 3 + 72)
    assert counters == FrameCounters(received=40, bad_checksum=10, bad_length=20, skipped_bytes=skipped)


def test_what_ends_a_packet_that_was_given_up_is_no_packet() -> None:
    packet = sound_frames("slip", [34], 1, rich=False)[0]
    frames, counters = taken(framing_of("slip"), [(None, b"\x01" * 200), (None, packet * 30)])
    assert len(frames) == 29
    assert counters == FrameCounters(received=29, bad_length=1, skipped_bytes=200 + len(packet))


def test_a_frame_across_an_interruption_is_none() -> None:
    frames = sound_frames("lengths", [34, 36], 1, rich=False)
    before, after = b"".join(frames[:50]), b"".join(frames[50:])
    reads = [(0.0, before[:-1]), (1.0, before[-1:] + after)]
    decoder = FrameDecoder(framing_of("lengths", timeout_s=0.05))
    for now_s, data in reads:
        decoder.feed(data, now_s)
    assert decoder.take().begins.size == FRAMES - 1
    assert decoder.counters == FrameCounters(received=FRAMES - 1, timed_out=1, skipped_bytes=len(frames[49]))


def test_a_frame_beyond_the_maximum_is_none() -> None:
    frames = sound_frames("lengths", [34, 100], 1, rich=False)
    found, counters = taken(framing_of("lengths"), [(None, b"".join(frames))])
    assert [data for _, data in found] == frames[::2]
    assert counters.bad_length >= FRAMES // 2
