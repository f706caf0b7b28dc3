"""The stream of an OXYGEN recorder: every sample at its tick, whatever is cut, missing, unknown or hostile."""

from __future__ import annotations

import random
import struct
import time
import tracemalloc
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.streams.oxygen_stream import LARGEST_PACKET, OxygenDecoder, TickSpan
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault, TickChannel, TickItem, TickSamples

RATE_HZ = 1000.0
START_NS = 1_700_000_000_123_456_789


def part(kind: int, content: bytes, size: int | None = None) -> bytes:
    return struct.pack("<2I", 8 + len(content) if size is None else size, kind) + content


def packet(number: int, *parts: bytes, status: int = 0, seed: int = 7, size: int | None = None) -> bytes:
    info = part(1, struct.pack("<6I", 0x01050000, 1, number, status, seed, len(parts) + 2))
    body = info + b"".join(parts) + part(7, b">>OXYGEN" + bytes(4))
    return b"OXYGEN<<" + struct.pack("<I", 12 + len(body) if size is None else size) + body


def text(xml: str) -> bytes:
    return part(2, xml.encode())


def channels(*rows: tuple[str, str, float, float] | str) -> bytes:
    each = [
        f'<Channel name="{one}" unit="V"/>'
        if isinstance(one, str)
        else f'<Channel name="{one[0]}" unit="{one[1]}"><LinearScaling factor="{one[2]}" offset="{one[3]}"/></Channel>'
        for one in rows
    ]
    return text(f"<ChannelInfo>{''.join(each)}</ChannelInfo>")


START = text(
    '<AcquisitionInfo><AcquisitionStart><Timestamp format="ISO8601">2023-11-14T22:13:20</Timestamp>'
    f'<Timestamp format="nanoseconds" utc_offset_seconds="3600">{START_NS}</Timestamp></AcquisitionStart>'
    "</AcquisitionInfo>"
)


def sync(first: int, data: bytes, count: int, *, code: int = 10, dimension: int = 1, rate_hz: float = RATE_HZ) -> bytes:
    return part(3, struct.pack("<3IQd", code, dimension, count, first, rate_hz) + data)


def floats(first: int, values: Any, **more: Any) -> bytes:
    return sync(first, np.asarray(values, "<f4").tobytes(), len(values), **more)


HEAD = packet(0, START, channels(("p", "MPa", 2.0, 0.5), "a"), status=1)


def stream(packets: int = 6, per: int = 50) -> bytes:
    """Head and packets of two channels, each value of the first its own tick."""
    data = [b"OXYGEN Data Stream".ljust(64, b"\0"), HEAD]
    for number in range(packets):
        ticks = np.arange(number * per, (number + 1) * per)
        data.append(packet(number + 1, floats(ticks[0], ticks), floats(ticks[0], -ticks)))
    return b"".join(data)


def decoded(*pieces: bytes) -> list[TickItem]:
    decoder = OxygenDecoder()
    return [item for piece in pieces for item in decoder.feed(piece)]


def values(items: list[TickItem], channel: int) -> list[float]:
    return [v for one in items if isinstance(one, TickSamples) and one.channel == channel for v in one.raw.tolist()]


def faults(items: list[TickItem]) -> list[str]:
    return [one.problem for one in items if isinstance(one, StreamFault)]


def test_channels_come_as_they_are_described_and_samples_with_their_ticks() -> None:
    items = decoded(stream())
    description = items[0]
    assert isinstance(description, StreamDescription)
    assert [(c.name, c.unit, c.tick_rate, c.step, c.factor, c.offset) for c in description.channels] == [
        ("p", "MPa", Fraction(1000), 1, 2.0, 0.5), ("a", "V", Fraction(1000), 1, 1.0, 0.0),
    ]  # fmt: skip
    assert description.start_utc_ns == START_NS
    assert values(items, 0) == list(range(300))
    assert [one.first_tick for one in items if isinstance(one, TickSamples) and one.channel == 0] == [
        *range(0, 300, 50)
    ]
    assert faults(items) == []


WHOLE = stream()


@given(cuts=st.lists(st.integers(0, len(WHOLE)), max_size=60))
def test_wherever_the_bytes_are_cut_nothing_changes(cuts: list[int]) -> None:
    places = sorted({0, *cuts, len(WHOLE)})
    items = decoded(*(WHOLE[a:b] for a, b in pairwise(places)))
    assert values(items, 0) == list(range(300))
    assert faults(items) == []


def test_byte_by_byte_it_is_the_same() -> None:
    items = decoded(*(WHOLE[i : i + 1] for i in range(len(WHOLE))))
    assert values(items, 1) == [-v for v in range(300)]


@given(begins=st.integers(0, len(WHOLE) - 1))
def test_from_anywhere_on_whole_packets_are_found_and_their_ticks_with_them(begins: int) -> None:
    decoder = OxygenDecoder()
    known = decoded(WHOLE)[0]
    assert isinstance(known, StreamDescription)
    decoder.describe(known)
    items = decoder.feed(WHOLE[begins:])
    assert faults(items) == []
    ticks = values(items, 0)
    assert ticks == list(range(300 - len(ticks), 300))


@pytest.mark.parametrize(
    ("code", "form", "numbers"),
    [
        (0, "<i1", [-128, 0, 127]), (1, "<u1", [0, 255]), (2, "<i2", [-32768, 32767]), (3, "<u2", [0, 65535]),
        (6, "<i4", [-(2**31), 2**31 - 1]), (7, "<u4", [0, 2**32 - 1]), (8, "<i8", [-(2**63), 2**63 - 1]),
        (9, "<u8", [0, 2**64 - 1]), (10, "<f4", [-1.5, 3.25]), (11, "<f8", [-1e300, 1e-300]),
    ],
)  # fmt: skip
def test_every_type_of_number_is_read_as_it_was_sent(code: int, form: str, numbers: list[float]) -> None:
    data = np.array(numbers, form).tobytes()
    assert values(decoded(packet(0, channels("x"), sync(0, data, len(numbers), code=code))), 0) == numbers


@pytest.mark.parametrize(("code", "signed"), [(4, True), (5, False)])
def test_numbers_of_three_bytes_are_read_to_their_ends(code: int, signed: bool) -> None:
    low, high = (-(2**23), 2**23 - 1) if signed else (0, 2**24 - 1)
    numbers = [low, low + 1, 0, 1, 65_535, high - 1, high]
    data = b"".join(v.to_bytes(3, "little", signed=signed) for v in numbers)
    assert values(decoded(packet(0, channels("x"), sync(5, data, len(numbers), code=code))), 0) == numbers
    rows = b"".join(struct.pack("<Q", 10 * i) + data[3 * i : 3 * i + 3] for i in range(len(numbers)))
    asked = part(5, struct.pack("<3Id", code, 1, len(numbers), RATE_HZ) + rows)
    (_, samples) = decoded(packet(0, channels("x"), asked))
    assert isinstance(samples, TickSamples)
    assert samples.raw.tolist() == numbers
    assert samples.ticks.tolist() == [10 * i for i in range(len(numbers))]


def test_a_vector_is_as_many_channels_and_a_complex_one_two() -> None:
    vector = floats(0, [1, 2, 3, 4, 5, 6], dimension=3)
    vector = sync(0, np.arange(6, dtype="<f4").tobytes(), 2, dimension=3)
    twofold = sync(0, np.array([1 + 2j, 3 + 4j], "<c8").tobytes(), 2, code=12)
    items = decoded(
        packet(0, channels(("v", "V", 2.0, 1.0), ("z", "V", 2.0, 1.0), "b"), vector, twofold, floats(0, [9, 9]))
    )
    description = items[0]
    assert isinstance(description, StreamDescription)
    assert [one.name for one in description.channels] == ["v [0]", "v [1]", "v [2]", "z real", "z imaginary", "b"]
    assert [one.offset for one in description.channels] == [1.0, 1.0, 1.0, 1.0, 0.0, 0.0]
    assert [values(items, place) for place in range(6)] == [[0, 3], [1, 4], [2, 5], [1, 3], [2, 4], [9, 9]]


KINDS = [
    "alike", "longer", "other rate", "other type", "vector", "own ticks", "none", "part missing", "unknown part",
    "other part", "wrong", "last", "seed", "text", "other text", "late", "tick too large", "start",
]  # fmt: skip
ONE_AFTER_ANOTHER = [["alike", "alike", one, other, "alike", "alike"] for one, other in product(KINDS, repeat=2)]


def packets_of(kinds: list[str]) -> list[tuple[bytes, bytes]]:
    """Return a packet of each kind, and one without samples that may stand behind it and says nothing new."""
    data = [(HEAD, packet(0))]
    seed, per = 7, 4
    for number, kind in enumerate(kinds, start=1):
        first = 1 << 62 if kind == "tick too large" else number * 10
        per += kind == "longer"
        rate_hz = 2 * RATE_HZ if kind == "other rate" else RATE_HZ
        seed += kind == "seed"
        one = floats(first, np.arange(per) + number, rate_hz=rate_hz)
        other = {
            "other type": sync(first, np.arange(per, dtype="<i4").tobytes(), per, code=6),
            "vector": sync(first, np.arange(2 * per, dtype="<f4").tobytes(), per, dimension=2),
            "own ticks": own_ticks(np.arange(first, first + per)),
            "none": sync(first, b"", 0),
            "unknown part": one + part(99, b"12345678"),
            "other part": part(4, bytes(40)),
        }.get(kind, one)
        parts = [one] if kind == "part missing" else [other, one]
        parts += [channels(("p", "MPa", 3.0, 0.5), "a")] if kind == "other text" else []
        parts += [channels(("p", "MPa", 2.0, 0.5), "a")] if kind == "text" else []
        parts += [START] if kind == "start" else []
        status = {"wrong": 0x10000000, "last": 2}.get(kind, 0)
        at = max(number - 3, 0) if kind == "late" else number
        data.append((packet(at, *parts, status=status, seed=seed), packet(at, seed=seed)))
    return data


def own_ticks(ticks: Any) -> bytes:
    rows = b"".join(struct.pack("<Qf", tick, tick) for tick in ticks.tolist())
    return part(5, struct.pack("<3Id", 10, 1, len(ticks), RATE_HZ) + rows)


def told(items: list[Any]) -> list[Any]:
    """Return items so that they can be compared."""
    return [
        (one.channel, one.first_tick, one.raw.tolist(), None if one.ticks is None else one.ticks.tolist())
        if isinstance(one, TickSamples)
        else one
        for one in items
    ]


def test_a_packet_means_the_same_whether_or_not_it_is_laid_out_as_the_one_before() -> None:
    for kinds in ONE_AFTER_ANOTHER:
        packets = packets_of(kinds)
        one_by_one = OxygenDecoder()
        apart = [item for both in packets for each in both for item in one_by_one.feed(each)]
        assert told(decoded(*(one for one, _ in packets))) == told(apart), kinds


def test_a_stream_can_be_followed_without_its_numbers() -> None:
    for kinds in ONE_AFTER_ANOTHER:
        packets = [one for one, _ in packets_of(kinds)]
        decoder = OxygenDecoder()
        followed = [item for one in packets for item in decoder.follow(one)]
        expected = [
            TickSpan(one.channel, one.first_tick, one.raw.size, 4, one.ticks is not None)
            if isinstance(one, TickSamples)
            else one
            for one in decoded(*packets)
        ]
        assert followed == expected, kinds
        assert all(one.samples for one in followed if isinstance(one, TickSpan)), kinds


def test_what_a_device_says_of_a_stream_holds_for_packets_laid_out_as_those_before() -> None:
    decoder = OxygenDecoder()
    before = [item for number in range(2) for item in decoder.feed(packet(number, floats(0, [1]), floats(0, [2])))]
    assert values(before, 1) == [2, 2]
    decoder.describe(StreamDescription((TickChannel("p", "MPa", Fraction(500)), TickChannel("a", "V", Fraction(500)))))
    assert faults(decoder.feed(packet(2, floats(2, [1]), floats(2, [2])))) == [
        "a packet of other rates than are described"
    ]


@pytest.mark.parametrize("unread", [part(4, bytes(40)), part(6, bytes(40)), sync(0, b"abcd", 1, code=14)])
def test_what_nobody_decodes_keeps_its_place(unread: bytes) -> None:
    items = decoded(packet(0, channels("x", "text", ("b", "V", 10.0, 0.0)), floats(0, [1]), unread, floats(0, [2])))
    description = next(one for one in items if isinstance(one, StreamDescription))
    assert [(one.name, one.factor) for one in description.channels] == [("x", 1.0), ("b", 10.0)]
    assert values(items, 1) == [2]
    assert len(faults(items)) == 1


def test_a_packet_that_lacks_a_channel_gives_none_of_its_samples() -> None:
    items = decoded(stream(2), packet(3, floats(100, range(50))), packet(4, *(floats(150, range(50)),) * 2))
    assert len(values(items, 0)) == 150
    assert faults(items) == ["a packet of 1 channels, where 2 are described: none of them is taken for any"]


def test_a_new_text_is_a_new_description_and_the_same_one_again_is_none() -> None:
    again = packet(3, START, channels(("p", "MPa", 2.0, 0.5), "a"))
    other = packet(4, channels(("p", "MPa", 7.0, 0.5), "a"))
    more = packet(5, floats(100, [1]), floats(100, [1]))
    items = decoded(stream(2), again, more, other, more)
    described = [one for one in items if isinstance(one, StreamDescription)]
    assert [one.channels[0].factor for one in described] == [2.0, 7.0]
    faster = packet(6, floats(0, [1], rate_hz=2000.0), floats(0, [1], rate_hz=2000.0))
    (changed, *_) = [one for one in decoded(stream(2), faster) if isinstance(one, StreamDescription)][1:]
    assert changed.channels[0].tick_rate == 2000


def test_under_a_new_seed_nothing_is_scaled_by_what_was_said_under_the_old_one() -> None:
    decoder = OxygenDecoder()
    decoder.feed(stream(2))
    unsaid = packet(9, floats(100, [1]), floats(100, [1]), seed=8)
    items = [*decoder.feed(unsaid), *decoder.feed(unsaid)]
    assert (values(items, 0), decoder.description) == ([], None)
    assert faults(items) == 2 * ["another configuration (seed 8), of which nothing is said: left out"]
    said = packet(10, channels(("p", "MPa", 7.0, 0.5), "a"), seed=8)
    items = [*decoder.feed(said), *decoder.feed(packet(11, floats(101, [2]), floats(101, [3]), seed=8))]
    assert isinstance(items[0], StreamDescription)
    assert items[0].channels[0].factor == 7.0
    assert (values(items, 0), faults(items)) == ([2.0], [])


def test_the_same_said_again_under_a_new_seed_holds() -> None:
    again = packet(9, START, channels(("p", "MPa", 2.0, 0.5), "a"), seed=8)
    items = decoded(stream(2), again, packet(10, floats(100, [2]), floats(100, [3]), seed=8))
    assert (values(items, 0)[-1], faults(items)) == (2.0, [])


def test_samples_of_a_packet_that_is_wrong_by_the_recorders_own_word_are_none() -> None:
    wrong = packet(9, floats(100, [7]), floats(100, [7]), status=0x10000000)
    items = decoded(stream(2), wrong, packet(10, floats(101, [8]), floats(101, [8])))
    assert values(items, 0) == [*range(100), 8]
    assert faults(items) == ["the recorder says that packet 9 is wrong (status 0x10000000): left out"]


def test_data_before_the_text_are_not_taken_for_what_the_text_says() -> None:
    items = decoded(packet(0, floats(0, [1]), floats(0, [1])), HEAD, packet(1, floats(1, [2]), floats(1, [2])))
    assert [type(one).__name__ for one in items] == ["TickSamples", "TickSamples", "StreamDescription", "TickSamples",
                                                     "TickSamples"]  # fmt: skip


def test_lost_packets_are_counted_and_late_ones_are_none() -> None:
    decoder = OxygenDecoder()
    for number in (0, 1, 5, 4, 6):
        decoder.feed(packet(number, channels("x"), floats(number, [1])))
    assert decoder.lost_packets == 3
    decoder.feed(packet(0, channels("x"), floats(0, [1]), seed=8))
    assert decoder.lost_packets == 3


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (b"noise where a packet begins, and more of it than a head", "where a packet begins: the stream is damaged"),
        (packet(9, size=4)[:40], "a packet of 4 bytes: the stream is damaged"),
        (packet(9, size=LARGEST_PACKET + 1)[:60], "a packet of 67108865 bytes: the stream is damaged"),
        (packet(9, part(3, bytes(30), size=4)), "a part of 4 bytes"),
        (packet(9, part(99, b"")), "a part of an unknown type 99"),
        (packet(9, part(3, bytes(3)), part(3, bytes(3))), "too few for their head"),
        (packet(9, floats(0, [1, 2], rate_hz=0.0), floats(0, [1])), "0 ticks per second"),
        (packet(9, floats(0, [1], rate_hz=float("nan")), floats(0, [1])), "nan ticks per second"),
        (packet(9, floats(0, [1], rate_hz=1e-300), floats(0, [1])), "1e-300 ticks per second"),
        (packet(9, sync(0, bytes(7), 2), floats(0, [1])), "7 bytes, where 2 samples have 8"),
        (packet(9, sync(1 << 63, bytes(4), 1), floats(0, [1])), "tick 9223372036854775808"),
        (packet(9, sync(0, bytes(4), 1, dimension=0), floats(0, [1])), "0 numbers a sample"),
        (packet(9, status=0x10000002), "says that packet 9 is wrong"),
        (packet(3, status=0x10000000), "says that packet 3 is wrong"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_and_the_next_packet_is_read(damage: bytes, problem: str) -> None:
    items = decoded(stream(2), damage, packet(10, *(floats(100, [7]),) * 2), packet(11, *(floats(101, [8]),) * 2))
    assert any(problem in one for one in faults(items)), faults(items)
    assert all("\n" not in one for one in faults(items))
    assert values(items, 0)[-1] == 8


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (packet(9, text("<ChannelInfo>"),), "no XML"),
        (packet(9, text('<!DOCTYPE x [<!ENTITY a "b">]><ChannelInfo/>')), "entities"),
        (packet(9, part(2, b"\xff\xfe")), "utf-8"),
        (packet(9, channels(("p", "V", float("nan"), 0.0))), "a scaling of 'p'"),
    ],
)  # fmt: skip
def test_behind_a_text_that_cannot_be_read_nothing_is_scaled_by_the_one_before(damage: bytes, problem: str) -> None:
    more = packet(10, floats(100, [7]), floats(100, [7]))
    items = decoded(stream(2), damage, more, HEAD, packet(11, floats(101, [8]), floats(101, [8])))
    assert values(items, 0) == [*range(100), 8]
    said, then = faults(items)
    assert problem in said
    assert then.startswith("channels that cannot be read (")
    assert then.endswith("): left out")


def test_a_text_may_end_in_zeros_and_say_less() -> None:
    bare = packet(0, part(2, b"<ChannelInfo><Channel/></ChannelInfo>\0\0"), text("<Other/>"), floats(0, [1]))
    (description, samples) = decoded(bare)
    assert isinstance(description, StreamDescription)
    assert isinstance(samples, TickSamples)
    assert (description.channels[0].name, description.start_utc_ns) == ("", None)


def test_behind_missing_bytes_a_packet_is_read_as_soon_as_it_is_there() -> None:
    """What the packet that was cut off still lacked is waited for no longer."""
    large = packet(3, *(floats(100, range(5000)),) * 2)
    decoder = OxygenDecoder()
    decoder.feed(stream(2) + large[: len(large) // 2])
    decoder.skip()
    assert values(decoder.feed(packet(4, *(floats(5100, [7]),) * 2)), 0) == [7]


@pytest.mark.parametrize("at", range(1, 13))
def test_a_packet_behind_bytes_of_nothing_is_found_wherever_its_head_is_cut(at: int) -> None:
    whole = packet(1, *(floats(0, [7]),) * 2)
    assert values(decoded(bytes(100) + whole[:at], whole[at:]), 0) == [7]


def test_after_missing_bytes_what_is_half_there_is_dropped() -> None:
    decoder = OxygenDecoder()
    decoder.feed(WHOLE[:400])
    known = decoder.description
    decoder.skip()
    if known is not None:
        decoder.describe(known)
    items = decoder.feed(WHOLE[700:])
    assert faults(items) == []
    ticks = values(items, 0)
    assert ticks == list(range(300 - len(ticks), 300))
    assert decoder.lost_packets == 0


@pytest.mark.exhaustive
def test_a_thousand_damaged_and_hostile_streams_end_in_lines_and_need_no_memory() -> None:
    rng, source = random.Random(5), stream(20)  # noqa: S311 - damage is no secret
    tracemalloc.start()
    began_s = time.process_time()
    for number in range(1000):
        data = bytearray(source)
        for _ in range(rng.randrange(1, 12)):
            at = rng.randrange(len(data))
            how = rng.randrange(5)
            if how == 0:
                data[at] = rng.randrange(256)
            elif how == 1:
                del data[at : at + rng.randrange(1, 300)]
            elif how == 2:
                data[at:at] = rng.randbytes(rng.randrange(1, 300))
            elif how == 3:
                data[at : at + 4] = struct.pack(
                    "<I", rng.choice([0, 1, 7, 8, 12, 1 << 20, 1 << 26, 1 << 31, (1 << 32) - 1])
                )
            else:
                data[at:at] = data[max(at - rng.randrange(1, 500), 0) : at]
        decoder = OxygenDecoder()
        for begins in range(0, len(data), 997):
            for item in decoder.feed(bytes(data[begins : begins + 997])):
                if isinstance(item, StreamFault):
                    assert "\n" not in item.problem
                    assert len(item.problem) < 300
                elif isinstance(item, TickSamples):
                    assert item.raw.ndim == 1
        assert len(decoder._held) <= len(data), number
    assert time.process_time() - began_s < 60.0
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


@settings(max_examples=60)
@given(st.binary(max_size=400))
def test_bytes_of_anything_raise_nothing(data: bytes) -> None:
    decoder = OxygenDecoder()
    decoder.feed(HEAD)
    decoder.feed(data)
    decoder.feed(packet(1, part(3, data), part(5, data), part(2, data)))
