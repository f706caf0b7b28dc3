"""A file of a first contact is played back as it was: the same answers, and every byte of the stream."""

from __future__ import annotations

import base64
import json
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from recoil_rigs.twin.oxygen_recorder import OxygenRecorder
from tests.builders.kept_recorder import SCHEMA, FirstContact, KeptRecorder
from tests.builders.oxygen_client import Listener, OxygenClient, exactly
from tests.builders.ramp_recorder import RampRecorder, Ramps, ramp_content

SIGNALS = {"AI 1/p (brl), muzzle": "MPa", "AI 2": "m/s2"}


class KeepingClient(OxygenClient):
    """Writes down what is said, and what of the stream is read at once."""

    def __init__(self, device: dict[str, Any]) -> None:
        super().__init__(device)
        self.rows: list[dict[str, Any]] = []
        self._began_s = time.monotonic()

    def note(self, link: str, sender: str, **what: str) -> None:
        self.rows.append({"at_s": time.monotonic() - self._began_s, "link": link, "from": sender, **what})

    def say(self, line: str) -> None:
        self.note("scpi", "host", text=line)
        super().say(line)

    def ask(self, line: str) -> str:
        reply = super().ask(line)
        self.note("scpi", "recorder", text=reply)
        return reply

    def connect(self) -> socket.socket:
        self._stream = socket.create_connection((self._address[0], self._stream_port), 5.0)
        self.note("stream", "recorder", base64=base64.b64encode(exactly(self._stream, 64)).decode())
        return self._stream


def keep(recorder: OxygenRecorder, items: Sequence[str], path: Path, for_s: float) -> bytes:
    """Talk to a recorder and listen to it for a while; return the stream's bytes behind the welcome."""
    stream = b""
    with KeepingClient(dict(recorder.device)) as client:
        client.ask(":CHANNEL:NAMES?")
        taken = client.begin(items)
        ends_s = time.monotonic() + for_s
        while time.monotonic() < ends_s:
            data = taken.recv(1500)
            client.note("stream", "recorder", base64=base64.b64encode(data).decode())
            stream += data
    head = {"schema": SCHEMA, "rig": "ramps", "source": "dewetron", "utc": "2026-11-28T20:00:00Z"}
    path.write_text("".join(json.dumps(row) + "\n" for row in (head, *client.rows)), encoding="utf-8")
    return stream


@pytest.mark.real_time
def test_a_kept_contact_answers_and_streams_as_the_recorder_did(tmp_path: Path) -> None:
    recorder = RampRecorder("dewetron", ramp_content(SIGNALS, 2000.0, "i24", 0.01))
    recorder.plug()
    try:
        stream = keep(recorder, [*SIGNALS], tmp_path / "contact.jsonl", 0.5)
    finally:
        recorder.unplug()
    contact = FirstContact.read(tmp_path / "contact.jsonl")
    assert contact.items == [*SIGNALS]
    began_s, ramps = time.monotonic(), Ramps(len(SIGNALS))
    with KeptRecorder(contact, speed=2.0) as kept, OxygenClient(kept.device) as client:
        assert client.ask(":CHANNEL:NAMES?") == '("1","AI 1/p (brl), muzzle"),("2","AI 2")'
        with Listener(client.begin([*SIGNALS]), ramps.take) as listener:
            while kept.sent < len(stream) + 64 and time.monotonic() < began_s + 20:
                time.sleep(0.02)
            time.sleep(0.05)
        assert kept.sent == len(stream) + 64
        client.say(":NUM:VAL?")
        time.sleep(0.1)
        assert kept.unanswered == [":NUM:VAL?"]
    assert time.monotonic() - began_s > 0.2
    # half a packet at the end is where the host stopped listening
    assert listener.failure is None or "ended after" in str(listener.failure)
    assert ramps.wrong == 0
    assert [behind - first > 500 for first, behind in ramps.stretches] == [True]
