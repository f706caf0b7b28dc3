"""A client of an OXYGEN recorder for tests, of nothing but the table of its bytes: no code of what it reads is in it.

Token and size; then parts of size and type: 1 is version, stream, sequence, status, seed, count; 2 is text; 3 is type,
dimension, count, first tick, rate, samples; 5 is type, dimension, count, rate, and with each sample its tick; 7 ends.
"""

from __future__ import annotations

import re
import socket
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

PATIENCE_S = 5.0


@dataclass
class Packet:
    """One packet: what it says of itself, its texts, and by place of the channel first tick, rate, type and bytes."""

    sequence: int
    status: int
    seed: int
    texts: list[str] = field(default_factory=list)
    data: list[tuple[NDArray[np.uint64], float, int, bytes]] = field(default_factory=list)


class Ended(Exception):  # noqa: N818 - the end of a stream is no error
    """The other side has closed the connection, between two packets."""


def exactly(one: socket.socket, count: int, *, may_end: bool = False) -> bytes:
    held = bytearray()
    while len(held) < count:
        piece = one.recv(count - len(held))
        if not piece:
            if may_end and not held:
                raise Ended
            raise ConnectionError(f"ended after {len(held)} of {count} bytes")
        held += piece
    return bytes(held)


def read_packet(one: socket.socket) -> Packet:
    token, size = struct.unpack("<8sI", exactly(one, 12, may_end=True))
    assert token == b"OXYGEN<<"
    body = exactly(one, size - 12)
    found, at, kinds = Packet(-1, -1, -1), 0, []
    while at < len(body):
        length, kind = struct.unpack_from("<2I", body, at)
        part = body[at + 8 : at + length]
        assert len(part) == length - 8
        kinds.append(kind)
        if kind == 1:
            version, _, found.sequence, found.status, found.seed, count = struct.unpack("<6I", part)
            assert version == 0x01050000
        elif kind == 2:
            found.texts.append(part.decode())
        elif kind == 3:
            code, dimension, count_of, first, rate = struct.unpack_from("<3IQd", part)
            assert dimension == 1
            found.data.append((first + np.arange(count_of, dtype=np.uint64), rate, code, part[28:]))
        elif kind == 5:
            code, dimension, count_of, rate = struct.unpack_from("<3Id", part)
            assert dimension == 1
            rows = np.frombuffer(part[20:], [("tick", "<u8"), ("raw", "V4" if code == 10 else "V3")])
            assert rows.size == count_of
            found.data.append((rows["tick"].copy(), rate, code, rows["raw"].tobytes()))
        else:
            assert kind == 7
            assert part.startswith(b">>OXYGEN")
        at += length
    assert (kinds[0], kinds[-1], len(kinds)) == (1, 7, count)
    return found


def numbers(code: int, data: bytes) -> NDArray[Any]:
    """Return float32 of type 10, whole numbers of type 4."""
    if code == 10:
        return np.frombuffer(data, "<f4")
    assert code == 4
    return np.array([int.from_bytes(data[i : i + 3], "little", signed=True) for i in range(0, len(data), 3)])


def scalings(text: str) -> list[tuple[str, str, float, float]]:
    """Return name, unit, factor and offset of each channel of a text."""
    assert text.startswith("<ChannelInfo>")
    rows = re.findall(r'<Channel name="([^"]*)" unit="([^"]*)">(.*?)</Channel>', text)
    scaled = [re.search(r'factor="([^"]*)" offset="([^"]*)"', inner) for _, _, inner in rows]
    return [
        (name, unit, 1.0, 0.0) if found is None else (name, unit, float(found[1]), float(found[2]))
        for (name, unit, _), found in zip(rows, scaled, strict=True)
    ]


class OxygenClient:
    """Commands and the stream of one recorder, between entering and leaving."""

    def __init__(self, device: Mapping[str, Any]) -> None:
        host, port = device["oxygen"].split(":")
        self._address = (host, int(port))
        self._stream_port = int(device["stream_port"])
        self._asking: socket.socket | None = None
        self._stream: socket.socket | None = None
        self._held = b""

    def __enter__(self) -> Self:
        self._asking = socket.create_connection(self._address, PATIENCE_S)
        self.say(":COMM:HEAD OFF")
        return self

    def __exit__(self, *_: object) -> None:
        for one in (self._asking, self._stream):
            if one is not None:
                one.close()

    def say(self, line: str) -> None:
        assert self._asking is not None
        self._asking.sendall(line.encode() + b"\n")

    def ask(self, line: str) -> str:
        self.say(line)
        assert self._asking is not None
        while b"\n" not in self._held:
            piece = self._asking.recv(4096)
            assert piece
            self._held += piece
        reply, _, self._held = self._held.partition(b"\n")
        return reply.decode()

    def connect(self) -> socket.socket:
        """Connect to the stream; return its socket behind the welcome."""
        self._stream = socket.create_connection((self._address[0], self._stream_port), PATIENCE_S)
        welcome = exactly(self._stream, 64)
        assert b"OXYGEN" in welcome
        return self._stream

    def begin(self, items: Sequence[str]) -> socket.socket:
        """Configure the stream as a host does, and start it."""
        self.say(f":DST:PORT1 {self._stream_port}")
        self.say(":DST:ITEM1 " + ",".join(f'"{one}"' for one in items))
        assert self.ask(":DST:ITEM1?") == ",".join(f'"{one}"' for one in items)
        self.say(":DST:INIT 1")
        assert self.ask(":DST:STAT1?") == "INITIALIZED"
        stream = self.connect()
        self.say(":DST:START 1")
        assert self.ask(":SYST:ERR:ALL?") == '0,"No error"'
        return stream


class Listener:
    """Reads a stream in a thread until it ends; between entering and leaving."""

    def __init__(self, stream: socket.socket, take: Callable[[Packet], None] | None = None) -> None:
        self._stream = stream
        self.packets: list[Packet] = []
        self._take = take or self.packets.append
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.join()

    def join(self) -> None:
        """Let go of the stream."""
        if self._thread.is_alive():
            self._stream.shutdown(socket.SHUT_RDWR)
        self._thread.join(PATIENCE_S)

    def _read(self) -> None:
        try:
            while True:
                self._take(read_packet(self._stream))
        except Ended:
            pass
        except BaseException as error:
            self.failure = error
