"""Packets of an openDAQ stream: cut anywhere, begun anywhere, damaged anywhere."""

from __future__ import annotations

import zlib
from fractions import Fraction

import numpy as np
import pytest

from recoil_acquisition.streams.opendaq_packets import (
    DESCRIPTION,
    FAULT,
    LARGEST_CONTENT,
    SAMPLES,
    VALUE_TYPES,
    OpendaqDecoder,
    description_packet,
    packet,
    samples_packet,
)
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickChannel, TickSamples

DESCRIBED = StreamDescription(
    (
        TickChannel("p", "MPa", Fraction(1_000_000), 5, 0.5, -1.0, {"range": "0 to 10"}),
        TickChannel("ü", "m/s²", Fraction(10**9, 3), 0),
    ),
    1_700_000_000_123_456_789,
    "PtpSyncInterface",
)
TICKS = np.arange(100, 150, 5)


def stream(epoch=7):
    own = np.array([3, 4, 9, 2**50])
    return [
        description_packet(epoch, DESCRIBED),
        samples_packet(epoch, 0, TICKS, np.arange(10, dtype="<i4"), own_ticks=False),
        samples_packet(epoch, 1, own, np.array([1.5, -2.5, 0.0, np.nan]), own_ticks=True),
        samples_packet(epoch, 0, TICKS + 50, np.arange(10, 20, dtype="<i4"), own_ticks=False),
    ]


def seen(items):
    """What items say, in a form that can be compared."""
    return [
        (one.channel, one.first_tick, one.raw.dtype.str, one.raw.tobytes(), None if one.ticks is None else [*one.ticks])
        if isinstance(one, TickSamples)
        else one
        for one in items
    ]


WHOLE = seen(OpendaqDecoder().feed(b"".join(stream())))


def test_a_stream_comes_out_as_it_went_in():
    described, first, own, second = OpendaqDecoder().feed(b"".join(stream()))
    assert described == DESCRIBED
    assert (first.channel, first.first_tick, first.raw.tolist(), first.ticks) == (0, 100, list(range(10)), None)
    assert (own.channel, own.ticks.tolist()) == (1, [3, 4, 9, 2**50])
    assert own.raw[:3].tolist() == [1.5, -2.5, 0.0]
    assert np.isnan(own.raw[3])
    assert (second.first_tick, second.raw.dtype) == (150, np.dtype("<i4"))


@pytest.mark.parametrize("kind", VALUE_TYPES, ids=str)
def test_each_type_of_values_keeps_its_bits(kind):
    values = np.array([0, 1, 100], dtype=kind)
    data = description_packet(1, DESCRIBED) + samples_packet(1, 0, np.arange(3), values, own_ticks=False)
    assert OpendaqDecoder().feed(data)[1].raw.dtype == kind
    assert OpendaqDecoder().feed(data)[1].raw.tobytes() == values.tobytes()


def test_bytes_may_be_cut_anywhere():
    data = b"".join(stream())
    for size in (1, 2, 3, 7, 19, 20, 21, 64):
        decoder = OpendaqDecoder()
        made = [item for at in range(0, len(data), size) for item in decoder.feed(data[at : at + size])]
        assert seen(made) == WHOLE


def test_a_record_may_begin_anywhere_in_it():
    parts = stream()
    data = b"".join(parts)
    for start in range(1, len(data)):
        decoder = OpendaqDecoder()
        made = decoder.feed(data[start:])
        assert not [one for one in made if isinstance(one, StreamFault)], start
        begun = np.searchsorted(np.cumsum([0, *map(len, parts)]), start)
        assert seen(made) == WHOLE[begun:], "what they are of is said by events of the device"


def test_samples_of_another_epoch_than_the_one_described_are_left_out():
    decoder, late = OpendaqDecoder(), stream(epoch=8)[1:]
    decoder.feed(b"".join(stream()))
    assert decoder.feed(b"".join(late)) == [
        StreamFault("the description of some samples is missing: they are left out")
    ]
    decoder.describe(DESCRIBED)
    assert seen(decoder.feed(b"".join(late))) == WHOLE[1:], "an event of the device says what they are"


def test_a_fault_is_handed_on_with_nothing_hidden():
    assert OpendaqDecoder().feed(packet(FAULT, "späte\x1b[2J".encode())) == [StreamFault(r"späte\x1b[2J")]


def test_what_is_half_there_is_not_completed_over_missing_bytes():
    decoder, parts = OpendaqDecoder(), stream()
    decoder.feed(parts[0] + parts[1][:30])
    decoder.skip()
    assert seen(decoder.feed(parts[1][40:] + parts[3])) == WHOLE[3:]


@pytest.mark.parametrize("seed", range(3))
def test_no_damaged_byte_gives_a_number_that_was_not_sent(seed):
    parts = stream()
    data = b"".join(parts)
    draw = np.random.default_rng(seed)
    for at in range(len(data)):
        spoilt = bytearray(data)
        spoilt[at] ^= int(draw.integers(1, 256))
        made = OpendaqDecoder().feed(bytes(spoilt) + b"".join(parts))
        assert any(isinstance(one, StreamFault) for one in made) or at < len(parts[0])  # as if begun behind it
        assert all(one in WHOLE for one in seen(made) if not isinstance(one, StreamFault))


def test_hostile_bytes_raise_nothing_and_hold_little():
    draw = np.random.default_rng(1)
    for _ in range(300):
        decoder = OpendaqDecoder()
        content = draw.bytes(int(draw.integers(0, 60)))
        kind = [DESCRIPTION, SAMPLES, FAULT, b"?"][draw.integers(4)]
        valid = packet(kind, content, epoch=7, channel=int(draw.integers(4)))
        made = decoder.feed(stream()[0] + valid + b"oDaq" * 5 + draw.bytes(40) + b"".join(stream()))
        assert all(isinstance(one, TickSamples | StreamFault | StreamDescription) for one in made)
        assert seen(made)[-3:] == WHOLE[1:]


@pytest.mark.parametrize(
    "stated",
    [b"{}", b"[]", b'{"channels": 1}', b'{"channels": [{}], "start_utc_ns": 1, "time_by": ""}', b"\xff", b"[" * 5000],
)
def test_a_description_that_is_none_is_a_fault(stated):
    for content in (stated, zlib.compress(stated), zlib.compress(stated)[:-1]):
        (fault,) = OpendaqDecoder().feed(packet(DESCRIPTION, content, epoch=1))
        assert fault.problem.startswith("a description cannot be read")


def test_bytes_that_are_no_packets_are_counted_once():
    parts = stream()
    made = OpendaqDecoder().feed(parts[0] + b"x" * 1000 + parts[1])
    assert made[1] == StreamFault("1000 bytes are no packet of an openDAQ stream")


def test_a_content_beyond_the_limit_is_not_made():
    with pytest.raises(ValueError, match="more than"):
        packet(FAULT, bytes(LARGEST_CONTENT + 1))


def test_samples_whose_ticks_run_backwards_are_a_fault():
    data = description_packet(1, DESCRIBED) + samples_packet(1, 1, np.array([5, 4]), np.zeros(2), own_ticks=True)
    _, fault = OpendaqDecoder().feed(data)
    assert fault.problem == "samples of channel 2 cannot be read: ticks that run backwards"


def test_samples_of_a_channel_that_is_not_described_are_a_fault():
    data = description_packet(1, DESCRIBED) + samples_packet(1, 2, TICKS, np.zeros(10), own_ticks=False)
    assert OpendaqDecoder().feed(data)[1] == StreamFault("samples of channel 3 of 2")
