"""A recorder whose stream is damaged, cut or hostile costs one line each time: nothing hangs, raises or is guessed."""

from __future__ import annotations

import os
import random
import struct
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.oxygen_signals import open_oxygen
from recoil_acquisition.devices import oxygen_device
from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import Block
from recoil_acquisition.devices.opening import open_device
from recoil_acquisition.errors import CorruptFileError, DeviceError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders.kept_recorder import FirstContact, KeptLine, KeptRecorder
from tests.builders.tick_streams import PATH, captured

KEPT = Path(__file__).parents[2] / "kept" / "2026-11-28-first-contact-virtual.jsonl"
STREAMS = int(os.environ.get("RECOIL_DAQ_HOSTILE_STREAMS", "30"))
BYTES = 60_000


def damaged(stream: bytes, rng: random.Random) -> bytes:
    data = bytearray(stream[:BYTES])
    for _ in range(rng.randrange(1, 8)):
        at, how = rng.randrange(len(data)), rng.randrange(6)
        if how == 0:
            data[at : at + 4] = struct.pack("<I", rng.choice([0, 7, 11, 1 << 20, 1 << 26, 1 << 31, (1 << 32) - 1]))
        elif how == 1:
            del data[at : at + rng.randrange(1, 4000)]
        elif how == 2:
            data[at:at] = rng.randbytes(rng.randrange(1, 4000))
        elif how == 3:
            place = data.find(b"OXYGEN<<", at)
            data[max(place, 0) : max(place, 0) + 12] = b"OXYGEN<<" + struct.pack("<I", rng.choice([0, 12, 1 << 30]))
        elif how == 4:
            data[at:at] = data[max(at - rng.randrange(1, 4000), 0) : at]
        else:
            data = data[: max(at, 1)]
    return bytes(data)


def read_all(contact: FirstContact, speed: float) -> tuple[list[Block], str]:
    """Open a device, read until its recorder has sent all, and close it; return its blocks, and why it is not open."""
    with KeptRecorder(contact, speed) as kept:
        try:
            device = open_device("daq", "dewetron", kept.device, DeviceDeclarations(signals=tuple(contact.items)))
        except DeviceError as error:
            return [], str(error)
        blocks: list[Block] = []
        ends_s = time.monotonic() + 0.3
        while time.monotonic() < ends_s:
            block = device.read(0.02)
            blocks += [] if block is None else [block]
        return [*blocks, *device.close()], ""


def recorded(blocks: list[Block]) -> Recording | None:
    """Open what was recorded; None if that says in one line that it is nothing."""
    try:
        return open_oxygen(PATH, captured(blocks), Declarations("daq"))
    except CorruptFileError:
        return None


@pytest.mark.real_time
def test_whatever_a_recorder_sends_ends_in_samples_or_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(oxygen_device, "FIRST_SAMPLES_S", 0.5)
    contact, rng = FirstContact.read(KEPT), random.Random(11)  # noqa: S311 - damage is no secret
    stream, first = b"".join(one.data for one in contact.stream), contact.stream[0]
    others = tuple(one for one in contact.lines if one.link == "scpi")
    opened = refused = 0
    for number in range(STREAMS):
        sent = rng.randbytes(20_000) if number % 10 == 9 else damaged(stream, rng)
        line = KeptLine(first.at_s, "stream", "recorder", sent)
        began_s = time.monotonic()
        blocks, why = read_all(replace(contact, lines=(*others, line)), 100.0)
        assert time.monotonic() - began_s < 12.0, number
        if why:
            assert "\n" not in why
            assert why.startswith("source 'daq': OXYGEN 127.0.0.1:"), why
            refused += 1
            continue
        opened += 1
        recording = recorded(blocks)
        if recording is None:
            continue
        for one in recording.signals:
            times = recording.time_base(one.name)
            assert recording.read(one.name).size == times.count
            assert (np.diff(times.times_s) > 0).all()
        assert all("\n" not in note for note in recording.notes)
    assert opened
    assert refused
