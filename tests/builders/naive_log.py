"""A second reader of logs, written from the table of the layout alone: slow, and it shares no code with the first."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Found:
    """One record and where it lies."""

    file: str
    begin: int
    content: bytes
    source: int
    kind: int
    span_us: int
    wait_us: int
    source_number: int
    number: int
    position: int
    host_ns: int
    payload: bytes


def read_file(path: Path) -> list[Found]:
    """Return the records of an undamaged file; AssertionError if anything in it is not as the layout says."""
    content = path.read_bytes()
    found: list[Found] = []
    at = 0
    while at < len(content) and any(content[at : at + 64]):
        head = content[at : at + 64]
        assert head[0:4] == bytes.fromhex("8d52444c")
        seed = zlib.crc32(head[4:12])
        length = int.from_bytes(head[12:16], "little")
        payload = content[at + 64 : at + 64 + length]
        assert len(payload) == length
        assert int.from_bytes(head[56:60], "little") == zlib.crc32(payload, seed)
        assert int.from_bytes(head[60:64], "little") == zlib.crc32(head[0:60], seed)
        found.append(
            Found(
                file=path.name,
                begin=at,
                content=head + payload,
                source=int.from_bytes(head[16:18], "little"),
                kind=int.from_bytes(head[18:20], "little"),
                span_us=int.from_bytes(head[20:24], "little"),
                wait_us=int.from_bytes(head[24:28], "little"),
                source_number=int.from_bytes(head[28:32], "little"),
                number=int.from_bytes(head[32:40], "little"),
                position=int.from_bytes(head[40:48], "little"),
                host_ns=int.from_bytes(head[48:56], "little", signed=True),
                payload=payload,
            )
        )
        at += 64 + length
    assert not any(content[at:])
    return found


def read_folder(folder: Path) -> list[Found]:
    """Return the records of all segments of an undamaged log."""
    return [one for path in sorted(folder.glob("*.rdlog")) for one in read_file(path)]
