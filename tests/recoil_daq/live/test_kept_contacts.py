"""Every first contact in ``tests/kept`` is played through the client: the virtual recorder's, and what users send.

`recoil-daq check RIG --devices --keep FILE` writes one. What is put into that folder is played by this test, and what
of it cannot be understood fails it.
"""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.streams.oxygen_stream import OxygenDecoder
from recoil_acquisition.streams.tick_stream import StreamFault, TickSamples
from tests.builders.kept_recorder import FirstContact, KeptRecorder

CONTACTS = sorted((Path(__file__).parents[2] / "kept").glob("*first-contact*.jsonl"))
SPEED = 10.0
LONGEST_S = 120.0


@pytest.mark.real_time
@pytest.mark.parametrize("path", CONTACTS, ids=lambda path: path.stem)
def test_a_first_contact_is_understood_to_its_last_byte(path: Path) -> None:
    contact = FirstContact.read(path)
    due = sum(len(one.data) for one in contact.stream)
    assert due > 0, "the recorder sent nothing"
    stream, decoder, ends_s = bytearray(), OxygenDecoder(), time.monotonic() + LONGEST_S
    with KeptRecorder(contact, SPEED) as kept:
        declared = DeviceDeclarations(signals=tuple(contact.items))
        device = open_device(contact.head["source"], "dewetron", kept.device, declared)
        try:
            while len(stream) < due and time.monotonic() < ends_s:
                block = device.read(0.1)
                stream += block.payload if block is not None and block.is_data else b""
        finally:
            device.close()
        assert kept.unanswered == []
    assert len(stream) == due
    assert bytes(stream) == b"".join(one.data for one in contact.stream)
    items = decoder.feed(bytes(stream))
    assert [one.problem for one in items if isinstance(one, StreamFault)] == []
    assert decoder.lost_packets == 0
    assert decoder.description is not None
    assert [one.name for one in decoder.description.channels] == contact.items
    following: dict[int, int] = {}
    for one in items:
        if isinstance(one, TickSamples) and one.ticks is None:
            assert one.first_tick == following.get(one.channel, one.first_tick), "its ticks go on"
            following[one.channel] = one.first_tick + one.raw.size
    assert len(following) == len(contact.items)


def test_there_is_one_of_the_virtual_recorder() -> None:
    assert "2026-11-28-first-contact-virtual" in [path.stem for path in CONTACTS]
