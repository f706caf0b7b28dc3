"""Vendors' files built from bytes, small and with known content."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np

from recoil_acquisition.frames.checksum import CHECKSUMS
from tests.builders import rdlog_bytes


def dewesoft_text(
    rows: Sequence[Sequence[float]],
    header: Sequence[str] = ("Time (s)", "AI 1/acc (m/s2)", "AI 2/p (MPa)"),
    *,
    separator: str = ",",
    decimal: str = ".",
    decimals: int = 6,
    preamble: Sequence[str] = (),
    line_end: str = "\r\n",
    encoding: str = "utf-8",
) -> bytes:
    lines = [*preamble, separator.join(header)]
    for row in rows:
        first = f"{row[0]:.{decimals}f}"
        cells = [first, *("" if np.isnan(v) else f"{v:.15g}" for v in row[1:])]
        lines.append(separator.join(cell.replace(".", decimal) for cell in cells))
    return "".join(line + line_end for line in lines).encode(encoding)


def motion_rows(count: int = 60, rate_hz: float = 20000.0) -> list[tuple[float, float, float]]:
    t = np.arange(count) / rate_hz
    return list(zip(t.tolist(), (100 * np.sin(900 * t)).tolist(), (20 * t + 0.1).tolist(), strict=True))


def tracks_text(
    count: int = 40,
    rate_hz: float = 6000.0,
    *,
    header: str | None = "Frame,Time (s),Feature #1 - X (mm),Feature #1 - Y (mm)",
    skip: Sequence[int] = (),
    lost: Sequence[int] = (),
    line_end: str = "\r\n",
) -> bytes:
    lines = [] if header is None else [header]
    for frame in range(count):
        if frame not in skip:
            x, y = ("-1", "-1") if frame in lost else (f"{0.25 * frame + 0.5:.4f}", f"{-0.125 * frame:.4f}")
            lines.append(f"{frame},{frame / rate_hz:.6f},{x},{y}")
    return "".join(line + line_end for line in lines).encode()


DBC = """VERSION ""

NS_ :

BS_:

BU_: RIG

BO_ 256 ACC: 8 RIG
 SG_ ax : 0|16@1- (0.01,0) [0|0] "m/s^2" RIG
 SG_ p : 48|16@1+ (0.1,-5) [0|0] "bar" RIG

BO_ 257 GYR: 8 RIG
 SG_ gx : 7|16@0- (0.05,0) [0|0] "deg/s" RIG

BO_ 2566848768 EXT: 8 RIG
 SG_ kind M : 0|8@1+ (1,0) [0|0] "" RIG
 SG_ low m0 : 8|16@1+ (1,0) [0|0] "V" RIG
 SG_ high m1 : 8|16@1+ (2,0) [0|0] "V" RIG
"""
"""Two plain messages, and a multiplexed one with the 29-bit identifier 0x18FF0100."""

EXT = 0x98FF0100

CanEntry = tuple[int, int, bytes]
"""Time in ns, identifier with bit 31 for 29 bits, data."""


def can_entries(count: int = 30) -> list[CanEntry]:
    entries = []
    for i in range(count):
        ax, p, gx = 10 * i - 50, 100 + i, 3 * i
        entries.append((i * 1_000_000, 0x100, struct.pack("<hHHH", ax, 0, 0, p)))
        entries.append((i * 1_000_000 + 250_000, 0x101, struct.pack(">h6x", gx)))
        if i % 3 == 0:
            entries.append((i * 1_000_000 + 500_000, EXT, struct.pack("<BH5x", i % 2, i)))
    return entries


def asc_log(
    entries: Sequence[CanEntry], *, extra: Sequence[str] = (), relative: bool = False, base: str = "hex"
) -> bytes:
    lines = [
        "date Tue Nov 14 22:13:20.250 2023",
        f"base {base}  timestamps {'relative' if relative else 'absolute'}",
        "internal events logged",
        "Begin Triggerblock Tue Nov 14 22:13:20.250 2023",
        "   0.000000 Start of measurement",
    ]
    before = 0
    for time_ns, key, data in entries:
        stamp_s = (time_ns - (before if relative else 0)) / 1e9
        before = time_ns
        number = f"{key & 0x1FFFFFFF:{'X' if base == 'hex' else 'd'}}{'x' if key >> 31 else ''}"
        octets = " ".join(f"{b:02X}" if base == "hex" else str(b) for b in data)
        lines.append(
            f"{stamp_s:11.6f} 1  {number:<15} Rx   d {len(data)} {octets}  Length = 240015 BitCount = 124 ID = 1785"
        )
    return "".join(line + "\n" for line in [*lines, *extra, "End TriggerBlock"]).encode()


def candump_log(entries: Sequence[CanEntry], *, extra: Sequence[str] = ()) -> bytes:
    lines = []
    for time_ns, key, data in entries:
        stamp_us = 1_700_000_000_250_000 + time_ns // 1000
        number = f"{key & 0x1FFFFFFF:08X}" if key >> 31 else f"{key:03X}"
        lines.append(f"({stamp_us // 1_000_000}.{stamp_us % 1_000_000:06d}) can0 {number}#{data.hex().upper()}")
    return "".join(line + "\n" for line in [*lines, *extra]).encode()


def blf_object(kind: int, time_ns: int, body: bytes) -> bytes:
    head = struct.pack("<4sHHLLLHHq", b"LOBJ", 32, 1, 32 + len(body), kind, 2, 0, 0, time_ns)
    return head + body + bytes(len(body) % 4)


def blf_log(entries: Sequence[CanEntry], *, extra: bytes = b"", per_container: int = 700) -> bytes:
    """Objects run on from one container into the next."""
    objects = extra + b"".join(
        blf_object(1, t, struct.pack("<HBBL8s", 1, 0, len(data), key, data)) for t, key, data in entries
    )
    containers = b""
    for at in range(0, len(objects), per_container):
        part = objects[at : at + per_container]
        packed = zlib.compress(part)
        body = struct.pack("<H6xL4x", 2, len(part)) + packed
        containers += struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body + bytes((16 + len(body)) % 4)
    start, stop = (2023, 11, 2, 14, 22, 13, 20, 250), (2023, 11, 2, 14, 22, 13, 21, 0)
    header = struct.pack(
        "<4sL8BQQLL8H8H", b"LOGG", 144, *bytes(8), 144 + len(containers), len(objects), len(entries), 0, *start, *stop
    )
    return header.ljust(144, b"\0") + containers


FRAMING = {
    "kind": "sync",
    "sync": "AA 55",
    "length": {"fixed": 16},
    "max": 64,
    "checksum": {"algo": "crc16-ccitt-false", "from": 2, "size": 2, "order": "little"},
    "fields": [
        {"name": "counter", "at": 2, "type": "u16"},
        {"name": "device_time", "at": 4, "type": "u32"},
        {"name": "gyro", "at": 8, "type": "f32", "unit": "rad/s"},
        {"name": "temperature", "at": 12, "type": "i16", "scale": 0.01, "offset": 20.0, "unit": "degC"},
    ],
    "counter": {"field": "counter", "modulo": 65536},
    "device_time": {"field": "device_time", "tick_s": 1e-6, "modulo": 4294967296},
}


def serial_frame(counter: int, ticks: int, gyro: float, temperature: int = 150) -> bytes:
    body = struct.pack("<HIfh", counter % 65536, ticks % 2**32, gyro, temperature)
    return b"\xaa\x55" + body + struct.pack("<H", CHECKSUMS["crc16-ccitt-false"].of(body))


def serial_frames(count: int = 40, first: int = 65520, ticks: int = 2**32 - 5000) -> list[bytes]:
    """Frames whose packet counter and clock both wrap."""
    return [serial_frame(first + i, ticks + 1000 * i, 0.01 * i) for i in range(count)]


def serial_capture(frames: Sequence[bytes], *, per_read: int = 3, host_ns: int = 1_700_000_000_000_000_000) -> bytes:
    reads = [b"".join(frames[i : i + per_read]) for i in range(0, len(frames), per_read)]
    session = {"sources": [{"name": "imu", "kind": "serial"}]}
    return rdlog_bytes.rdlog(
        session,
        [(0, rdlog_bytes.SERIAL, host_ns + (i + 1) * per_read * 1_000_000, data) for i, data in enumerate(reads)],
    )
