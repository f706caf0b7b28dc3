"""Captures built byte by byte from the layout of a log's records, without the code that writes logs."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

LOG_ID = b"testtest"
OWN, CAN, SERIAL, EVENT, SESSION, SHOT = 0xFFFF, 1, 2, 16, 32, 36
UNNUMBERED = (1 << 64) - 1
HEAD = 64


def event(name: str, detail: str) -> bytes:
    return json.dumps({"event": name, "detail": detail}).encode()


def rdlog(
    session: Mapping[str, Any],
    records: Sequence[tuple[int, int, int, bytes]],
    declaration: Mapping[str, Any] | None = None,
) -> bytes:
    """Return a capture of records (source, kind, host_ns, payload), each behind its session."""
    stated = {"schema": "recoil-daq/log/1", "longest_us": None, "part": 0, "of": 1, "text": json.dumps(session)}
    pieces = []
    counted: dict[int, list[int]] = {}
    for number, (source, kind, host_ns, payload) in enumerate(
        [(OWN, SESSION, 0, json.dumps(stated).encode()), *records]
    ):
        own = counted.setdefault(source, [0, 0])
        pieces.append(record(number, source, kind, host_ns, payload, own[0], own[1]))
        own[0] += 1
        own[1] += len(payload)
    if declaration is not None:
        shot = record(UNNUMBERED, OWN, SHOT, 0, json.dumps(declaration).encode(), 0, 0)
        pieces[1:1] = [shot]
    return b"".join(pieces)


def record(number: int, source: int, kind: int, host_ns: int, payload: bytes, own: int, position: int) -> bytes:
    """Return one record of unknown span and wait."""
    seed, unknown = zlib.crc32(LOG_ID), 0xFFFFFFFF
    head = struct.pack(
        "<4s8sIHHIIIQQqI", bytes.fromhex("8d52444c"), LOG_ID, len(payload), source, kind, unknown, unknown, own, number,
        position, host_ns, zlib.crc32(payload, seed),
    )  # fmt: skip
    return head + struct.pack("<I", zlib.crc32(head, seed)) + payload


def at_record_end(cut: bytes) -> bool:
    """Whether the beginning of a capture ends between two records, behind at least one."""
    at = 0
    while at + HEAD <= len(cut):
        at += HEAD + int.from_bytes(cut[at + 12 : at + 16], "little")
    return at == len(cut) and at > 0
