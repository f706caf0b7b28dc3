"""A bus and a port as the acquisition sees them, and blocks of them."""

from __future__ import annotations

import struct
from pathlib import Path

from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.devices.device import CAN, SERIAL, Block
from recoil_acquisition.frames.declaration import framing_from_table
from tests.builders.can_rows import pack_row

DBC = """VERSION ""
BU_: N
BO_ 291 NODE: 4 N
 SG_ p : 0|16@1- (0.5,0) [0|0] "kPa" N
 SG_ n : 16|8@1+ (1,0) [0|0] "" N
"""

FRAMING = {
    "kind": "sync",
    "sync": "AA 55",
    "length": {"fixed": 8},
    "baudrate": 921600,
    "checksum": {"algo": "sum8", "from": 2, "size": 1},
    "counter": {"field": "n", "modulo": 256},
    "fields": [
        {"name": "n", "at": 2, "type": "u8"},
        {"name": "w", "at": 3, "type": "f32", "unit": "rad/s"},
    ],
}

ANCHOR = Anchor(1_700_000_000_000_000_000, 1_000_000_000, 100)


def bus(*, signal: str = "NODE.p") -> LiveSource:
    channel = LiveChannel("pressure", signal, 1e3, 0.0, "Pa", (-1e6, 1e6))
    return LiveSource(
        "bus", CAN, {"interface": "virtual", "channel": "x"}, (channel,), database=DBC, path=Path("rig.toml")
    )


def port(*, signal: str = "w") -> LiveSource:
    channel = LiveChannel("rate", signal, -1.0, 0.0, "rad/s", (-10.0, 10.0))
    return LiveSource(
        "port", SERIAL, {"port": "x", "baudrate": 921600}, (channel,), framing=framing_from_table(FRAMING)
    )


def can_record(time_s: float, pressure_kpa: float, count: int = 0, flags: int = 0) -> bytes:
    data = struct.pack("<hBB", round(2 * pressure_kpa), count % 256, 0)
    return pack_row(device_ns=0, host_ns=round(1e9 * time_s), identifier=291, flags=flags, data=data)


def can_block(time_s: float, *records: bytes) -> Block:
    return Block("bus", round(1e9 * time_s), b"".join(records), CAN)


def serial_frame(count: int, rate: float) -> bytes:
    body = struct.pack("<Bf", count % 256, rate)
    return b"\xaa\x55" + body + bytes([sum(body) & 0xFF])


def serial_block(time_s: float, data: bytes) -> Block:
    return Block("port", round(1e9 * time_s), data, SERIAL)
