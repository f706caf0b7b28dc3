from __future__ import annotations

from typing import Any

import pytest

from recoil_acquisition.errors import FramingError
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.framing import Command, Framing, Poll

FIELDS = {"kind": "fixed", "length": {"fixed": 2}, "fields": [{"name": "a", "at": 0, "type": "u8"}]}


def declared(**keys: Any) -> Framing:
    return framing_from_table({**FIELDS, **keys})


def test_a_poll_request_gets_its_checksum() -> None:
    poll = {
        "hex": "01 49 01",
        "checksum": {"algo": "crc16-modbus", "order": "big"},
        "every_s": 0.02,
        "timeout_s": 0.2,
    }
    assert declared(poll=poll).poll == (Poll(bytes.fromhex("01 49 01 50 d6"), 0.02, 0.2),)
    assert [p.request[:3].hex() for p in declared(poll=[poll, {**poll, "hex": "02 49 01"}]).poll] == [
        "014901",
        "024901",
    ]


def test_commands_are_bytes_or_text_with_or_without_checksum() -> None:
    framing = declared(
        start_commands=[
            "FA FF 10 00 F1",
            {"text": "$VNRRG,11", "checksum": {"algo": "xor8", "from": 1}, "end": "\r\n", "wait_s": 0.5},
            {"text": "go"},
        ],
        stop_commands=[{"hex": "FA FF 30 00", "checksum": {"algo": "neg-sum8", "from": 1}}],
    )
    assert framing.start_commands == (
        Command(bytes.fromhex("FAFF1000F1")),
        Command(b"$VNRRG,11*73\r\n", 0.5),
        Command(b"go"),
    )
    assert framing.stop_commands == (Command(bytes.fromhex("FAFF3000D1")),)


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"poll": {"hex": "01", "timeout_s": 1.0}}, "framing.poll[0].every_s: is missing"),
        ({"poll": {"hex": "01", "every_s": 0, "timeout_s": 1.0}}, "framing.poll[0].every_s: must be greater than 0"),
        ({"poll": {"every_s": 1.0, "timeout_s": 1.0}}, "framing.poll[0].hex: or `text` is needed"),
        ({"poll": "01"}, "framing.poll[0].every_s: is missing"),
        ({"start_commands": ["0G"]}, "framing.start_commands[0].hex: must be bytes in hexadecimal"),
        ({"start_commands": [5]}, "framing.start_commands[0]: must be a table, found 5"),
        ({"stop_commands": [{"hex": "01", "text": "a"}]}, "framing.stop_commands[0].hex: or `text` is needed"),
        ({"stop_commands": [{"hex": "01", "wait": 1}]}, "did you mean `wait_s`?"),
        (
            {"stop_commands": [{"hex": "01", "checksum": {"algo": "sum8", "from": 1}}]},
            "framing.stop_commands[0].checksum.from: byte 1 lies behind the request",
        ),
    ],
)
def test_each_fault_of_a_command_is_named_by_its_key(keys: dict[str, Any], fault: str) -> None:
    with pytest.raises(FramingError) as caught:
        declared(**keys)
    assert fault in str(caught.value)
