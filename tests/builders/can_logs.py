"""Logs of CAN buses built from bytes: traces of PEAK and python-can's tables."""

from __future__ import annotations

import base64
import sqlite3
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


CANEDGE = "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes"


def canedge_csv(entries: Sequence[CanEntry], *, channel: int = 1, extra: Sequence[str] = ()) -> bytes:
    """Return what the converter of CSS Electronics writes of the same frames, with its line ends."""
    codes = {12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}
    lines = [CANEDGE]
    for time_ns, key, data in entries:
        stamp_us = 1_700_000_000_250_000 + time_ns // 1000
        length = len(data)
        lines.append(
            f"{stamp_us // 1_000_000}.{stamp_us % 1_000_000:06d};{channel};{key & 0x1FFFFFFF:X};{key >> 31};"
            f"{length if length <= 8 else codes[length]};{length};0;{int(length > 8)};0;{data.hex().upper()}"
        )
    return "".join(line + "\r\n" for line in [*lines, *extra]).encode()


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
