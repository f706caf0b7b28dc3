"""A stream's description as events: whole again from its parts, and from nothing else."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.devices.described import DESCRIBED, DescribedEvents, changes, described_events
from recoil_acquisition.devices.device import LONGEST_DETAIL, event_of
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel
from tests.builders.tick_streams import DESCRIPTION

TEXTS = st.text(max_size=12)
CHANNELS = st.builds(
    TickChannel, TEXTS, TEXTS, st.fractions(0, 10**7), st.integers(0, 100), st.floats(-1e9, 1e9), st.floats(-1e9, 1e9),
    st.dictionaries(TEXTS, TEXTS, max_size=3),
)  # fmt: skip
DESCRIPTIONS = st.builds(
    StreamDescription, st.lists(CHANNELS, max_size=5).map(tuple), st.none() | st.integers(0, 2**62), TEXTS
)


@given(DESCRIPTIONS)
def test_it_comes_back_as_it_was(description: StreamDescription) -> None:
    events = [event_of(one) for one in described_events("daq", 0, description)]
    assert {one.name for one in events} == {DESCRIBED}
    reader = DescribedEvents()
    assert [reader.take(one.detail) for one in events][-1] == description


def test_of_very_many_channels_it_has_parts_and_none_of_them_is_taken_for_the_whole() -> None:
    names = [f"{number * 7919 % 104729:x}{number * 104729 % 7919:x}" for number in range(9000)]
    large = replace(DESCRIPTION, channels=tuple(TickChannel(name, "V", Fraction(1000)) for name in names))
    details = [event_of(one).detail for one in described_events("daq", 0, large)]
    assert len(details) > 1
    assert max(map(len, details)) <= LONGEST_DETAIL
    reader = DescribedEvents()
    assert [reader.take(one) for one in details] == [None] * (len(details) - 1) + [large]
    assert [reader.take(one) for one in details[1:]] == [None] * (len(details) - 1)
    assert reader.take(details[0]) is None
    assert reader.take(details[0]) is None
    assert [reader.take(one) for one in details[1:]][-1] == large


@given(st.text(max_size=60))
def test_what_is_none_is_none(detail: str) -> None:
    assert DescribedEvents().take(detail) is None
    assert DescribedEvents().take(f"1/1 {detail}") is None


def test_what_is_described_otherwise_is_said_and_nothing_else() -> None:
    p, a = both = DESCRIPTION.channels
    assert changes(DESCRIPTION, replace(DESCRIPTION, start_utc_ns=1, time_by="free")) == ""
    assert changes(DESCRIPTION, replace(DESCRIPTION, channels=tuple(replace(c, said={"x": "y"}) for c in (p, a)))) == ""
    other = replace(p, unit="bar", step=2), replace(a, name="b")
    assert changes(DESCRIPTION, replace(DESCRIPTION, channels=other)) == (
        "a is gone; b is new; unit of p is bar, was MPa; step of p is 2, was 1"
    )
    assert changes(DESCRIPTION, replace(DESCRIPTION, channels=both[::-1])) == "the order of its channels"
