"""Logs of CAN buses built from bytes: traces of PEAK, python-can's tables, and MDF bus logging."""

from __future__ import annotations

import base64
import sqlite3
import struct
import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from tests.builders.vendor_files import CanEntry

START_DAYS = "45244.925928819444"
"""2023-11-14 22:13:20.250."""

COLUMNS = {"2.0": "N,O,T,I,d,l,D", "2.1": "N,O,T,B,I,d,R,L,D"}


def trc_log(entries: Sequence[CanEntry], *, version: str = "2.1", extra: Sequence[str] = ()) -> bytes:
    lines = [] if version == "1.0" else [f";$FILEVERSION={version}", f";$STARTTIME={START_DAYS}"]
    if version in COLUMNS:
        lines.append(f";$COLUMNS={COLUMNS[version]}")
    lines.append(";---+-- ------+------ +- +- --+----- +- +- +--- +- -- -- -- -- -- -- --")
    for number, (time_ns, key, data) in enumerate(entries, start=1):
        milliseconds = f"{time_ns / 1e6:.3f}"
        identifier = f"{key & 0x1FFFFFFF:08X}" if key >> 31 else f"{key:04X}"
        octets = data.hex(" ").upper()
        lines.append(
            {
                "1.0": f"{number:6d}) {milliseconds:>10} {identifier:>8} {len(data)} {octets} ",
                "1.1": f"{number:6d}) {milliseconds:>13}  Rx     {identifier:>8}  {len(data)}  {octets} ",
                "1.3": f"{number:6d}) {milliseconds:>13} 1  Rx    {identifier:>8} -  {len(data)}    {octets} ",
                "2.0": f"{number:7d} {milliseconds:>13} DT {identifier:>8} Rx {len(data):>2}  {octets} ",
                "2.1": f"{number:7d} {milliseconds:>13} DT  1 {identifier:>8} Rx -  {len(data):<4} {octets}",
            }[version]
        )
    return "".join(line + "\r\n" for line in [*lines, *extra]).encode()


def can_csv(entries: Sequence[CanEntry], *, zero_us: int = 1_700_000_000_250_000, extra: Sequence[str] = ()) -> bytes:
    lines = ["timestamp,arbitration_id,extended,remote,error,dlc,data"]
    for time_ns, key, data in entries:
        stamp_s = (zero_us + time_ns // 1000) / 1e6
        octets = base64.b64encode(data).decode()
        lines.append(f"{stamp_s!r},{key & 0x1FFFFFFF:#x},{key >> 31},0,0,{len(data)},{octets}")
    return "".join(line + "\n" for line in [*lines, *extra]).encode()


def can_sqlite(
    entries: Sequence[CanEntry], *, extra: Sequence[tuple[object, ...]] = (), schema: str | None = None
) -> bytes:
    """A database of small pages, as the library of the format itself writes it."""
    rows: list[tuple[object, ...]] = [
        (1_700_000_000.25 + time_ns / 1e9, key & 0x1FFFFFFF, key >> 31, 0, 0, len(data), data)
        for time_ns, key, data in entries
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.db"
        with closing(sqlite3.connect(path)) as base:
            base.execute("PRAGMA page_size = 512")
            base.execute(
                schema
                or "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER,"
                " error INTEGER, dlc INTEGER, data BLOB)"
            )
            if schema is None:
                base.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", [*rows, *extra])
            base.commit()
        return path.read_bytes()


class _Blocks:
    """Blocks of MDF 4, each with the address that it will have."""

    def __init__(self, head: bytes) -> None:
        self.content = bytearray(head)

    def add(self, kind: str, links: Sequence[int], body: bytes) -> int:
        at = len(self.content)
        size = 24 + 8 * len(links) + len(body)
        self.content += struct.pack(f"<4s4xQQ{len(links)}Q", kind.encode(), size, len(links), *links) + body
        self.content += bytes(-len(self.content) % 8)
        return at

    def text(self, text: str) -> int:
        return self.add("##TX", (), text.encode() + bytes(8 - len(text) % 8))


MDF_START_NS = 1_700_000_000_000_000_000


def mdf_bus_log(
    entries: Sequence[CanEntry], *, first_s: float = 0.25, errors: int = 0, identification: bytes = b"MDF     "
) -> bytes:
    """A sorted, finished file of one or two groups, whose texts stand before its samples."""
    head = identification + b"4.10    tests   ".ljust(20, b"\0") + struct.pack("<H", 410)
    blocks = _Blocks(head.ljust(64, b"\0") + bytes(104))
    groups = [("CAN_DataFrame", entries)]
    if errors:
        groups.append(("CAN_ErrorFrame", [(0, 0, bytes(8))] * errors))
    following = 0
    for name, frames in reversed(groups):
        following = _mdf_group(blocks, name, frames, first_s, following)
    header = struct.pack(
        "<4s4xQQ6QQhhBBBBdd", b"##HD", 104, 6, following, 0, 0, 0, 0, 0, MDF_START_NS, 0, 0, 0, 0, 0, 0, 0, 0
    )
    blocks.content[64 : 64 + len(header)] = header
    return bytes(blocks.content)


def _mdf_group(blocks: _Blocks, name: str, frames: Sequence[CanEntry], first_s: float, following: int) -> int:
    """Columns from the last to the first, because each links to the next."""

    def column(title: str, kind: int, data_type: int, at: int, bits: int, following: int, inside: int = 0) -> int:
        body = struct.pack("<BBBBLLLLBBHdddddd", kind, kind // 2, data_type, 0, at, bits, 0, 0, 0, 0, 0, *[0.0] * 6)
        return blocks.add("##CN", (following, inside, blocks.text(title), 0, 0, 0, 0, 0), body)

    parts = [("ID", 0, 8, 32), ("IDE", 0, 12, 8), ("BusChannel", 0, 13, 8), ("DataLength", 0, 14, 8)]
    inside = 0
    for title, data_type, at, bits in reversed([*parts, ("DataBytes", 10, 15, 64)]):
        inside = column(f"{name}.{title}", 0, data_type, at, bits, inside)
    link = column("t", 2, 4, 0, 64, column(name, 0, 10, 8, 120, 0, inside))
    source = blocks.add("##SI", (blocks.text("CAN"), 0, 0), struct.pack("<BBB5x", 2, 2, 0))
    rows = b"".join(
        struct.pack("<dIBBB8s", first_s + t / 1e9, key & 0x1FFFFFFF, key >> 31, 1, len(data), data)
        for t, key, data in frames
    )
    group = blocks.add("##CG", (0, link, 0, source, 0, 0), struct.pack("<QQHHLLL", 0, len(frames), 6, 0, 0, 23, 0))
    samples = blocks.add("##DT", (), rows)
    return blocks.add("##DG", (following, group, samples, 0), bytes(8))
