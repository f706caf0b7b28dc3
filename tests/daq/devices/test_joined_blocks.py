"""Blocks that wait are taken together: nothing is lost, and no event changes its place among its source's data."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.devices.device import EVENT, SERIAL, Block, event_block, joined

BLOCKS = st.lists(st.tuples(st.sampled_from("ab"), st.booleans()), max_size=30)


@given(BLOCKS)
def test_each_sources_bytes_and_events_stay_in_order(rows) -> None:
    blocks = [
        event_block(source, i, "lost", str(i)) if event else Block(source, i, bytes([i]), SERIAL)
        for i, (source, event) in enumerate(rows)
    ]
    made = joined(blocks)
    for source in "ab":
        before = [block for block in blocks if block.source == source]
        after = [block for block in made if block.source == source]

        def flat(some: list[Block]) -> list[object]:
            return [
                part
                for block in some
                for part in ([block.payload] if block.kind == EVENT else [bytes([octet]) for octet in block.payload])
            ]

        assert flat(after) == flat(before)
        assert [block.host_ns for block in after] == sorted(block.host_ns for block in after)
        assert not before or after[-1].host_ns == before[-1].host_ns


def test_blocks_between_two_events_become_one_with_the_time_of_the_last() -> None:
    made = joined([Block("a", 1, b"x", SERIAL), Block("b", 2, b"1", SERIAL), Block("a", 3, b"y", SERIAL)])
    assert [(block.source, block.host_ns, block.payload) for block in made] == [("a", 3, b"xy"), ("b", 2, b"1")]
