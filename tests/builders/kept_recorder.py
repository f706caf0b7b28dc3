"""A recorder that answers and streams as a file of a first contact says that a real one did.

`recoil-daq check RIG --devices --keep FILE` writes such a file: JSON Lines, the first of them what it is; then every
line of the commands, both ways, and every byte of the stream, with the time at which it came.
"""

from __future__ import annotations

import base64
import json
import re
import socket
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

SCHEMA = "recoil-daq/first-contact/1"
HOST = "127.0.0.1"
_LOOK_S = 0.05
_PORT = re.compile(r"(:DST:PORT\d*) (\d+)", re.IGNORECASE)
_GROUP = re.compile(r":DST:ITEM(\d+) ", re.IGNORECASE)
_START = re.compile(r":DST:START\b", re.IGNORECASE)
_ERRORS = re.compile(r":SYST:ERR(:ALL)?\?", re.IGNORECASE)


@dataclass(frozen=True)
class KeptLine:
    """One line of a file: when, on which connection, from whom, and its bytes without a line's end."""

    at_s: float
    link: str
    sender: str
    data: bytes

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> KeptLine:
        assert row["link"] in ("scpi", "stream")
        assert row["from"] in ("host", "recorder")
        data = row["text"].encode() if "text" in row else base64.b64decode(row["base64"], validate=True)
        return cls(float(row["at_s"]), row["link"], row["from"], data.rstrip(b"\r\n") if "text" in row else data)


@dataclass(frozen=True)
class FirstContact:
    """What a file holds."""

    head: Mapping[str, Any]
    lines: tuple[KeptLine, ...]

    @classmethod
    def read(cls, path: Path) -> FirstContact:
        head, *rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
        assert head["schema"] == SCHEMA
        return cls(head, tuple(KeptLine.of(row) for row in rows))

    @cached_property
    def exchanges(self) -> list[tuple[str, list[bytes]]]:
        """Commands in their order, each with what the recorder said to it."""
        found: list[tuple[str, list[bytes]]] = []
        for line in self.lines:
            if line.link == "scpi" and line.sender == "host":
                found.append((_key(line.data.decode()), []))
            elif line.link == "scpi" and found:
                found[-1][1].append(line.data)
        return found

    @cached_property
    def started_s(self) -> float:
        """The time at which the stream was started; that of the first byte where no command did it."""
        starts = [one.at_s for one in self.lines if one.sender == "host" and _START.match(one.data.decode())]
        return starts[0] if starts else min((one.at_s for one in self.stream), default=0.0)

    @cached_property
    def stream(self) -> list[KeptLine]:
        """The bytes of the stream, as they were read."""
        return [one for one in self.lines if one.link == "stream" and one.sender == "recorder"]

    @property
    def items(self) -> list[str]:
        """Channels that were asked for."""
        asked = [one.data.decode() for one in self.lines if one.link == "scpi" and one.sender == "host"]
        rows = [line for line in asked if re.match(r":DST:ITEM\d* ", line, re.IGNORECASE)]
        found = re.findall('"((?:[^"]|"")*)"', rows[-1]) if rows else []
        return [one.replace('""', '"') for one in found]

    @property
    def group(self) -> int:
        """Number of the group of streams that was used."""
        asked = [_GROUP.match(one.data.decode()) for one in self.lines if one.link == "scpi" and one.sender == "host"]
        return next((int(found[1]) for found in asked if found is not None), 1)


def _key(command: str) -> str:
    """Return a command by which it is found again: the port is another one each time."""
    return _PORT.sub(r"\1 *", command.strip()).upper()


class KeptRecorder:
    """Plays a file to one client, between entering and leaving.

    Parameters
    ----------
    speed
        Factor by which it is faster than it was.

    Attributes
    ----------
    unanswered
        Queries to which the file has no answer: the client asked the real recorder otherwise then.
    """

    def __init__(self, contact: FirstContact, speed: float = 1.0) -> None:
        self.contact = contact
        self.unanswered: list[str] = []
        self.sent = 0
        self._speed = speed
        self._left = list(contact.exchanges)
        self._stop = threading.Event()
        self._started = threading.Event()
        self._threads: list[threading.Thread] = []
        self._sockets = [socket.create_server((HOST, 0))]
        with socket.create_server((HOST, 0)) as probe:
            self._stream_port = int(probe.getsockname()[1])

    @property
    def device(self) -> dict[str, Any]:
        """Its ``device`` table."""
        group = {} if self.contact.group == 1 else {"group": self.contact.group}
        return {"oxygen": f"{HOST}:{self._sockets[0].getsockname()[1]}", "stream_port": self._stream_port, **group}

    def __enter__(self) -> KeptRecorder:
        self._begin(self._answer_all, self._sockets[0])
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for one in self._sockets:
            one.close()

    def _begin(self, work: Any, listener: socket.socket) -> None:
        listener.settimeout(_LOOK_S)
        self._threads.append(threading.Thread(target=work, args=(listener,), daemon=True))
        self._threads[-1].start()

    def _accepted(self, listener: socket.socket) -> socket.socket | None:
        while not self._stop.is_set():
            try:
                one = listener.accept()[0]
            except TimeoutError:
                continue
            self._sockets.append(one)
            one.settimeout(_LOOK_S)
            return one
        return None

    def _answer_all(self, listener: socket.socket) -> None:
        while (one := self._accepted(listener)) is not None:
            held = b""
            while not self._stop.is_set():
                try:
                    data = one.recv(4096)
                except TimeoutError:
                    continue
                except OSError:
                    break
                if not data:
                    break
                *commands, held = (held + data).split(b"\n")
                for command in commands:
                    for reply in self._replies(command.decode().strip()):
                        one.sendall(reply + b"\n")

    def _replies(self, command: str) -> list[bytes]:
        if port := _PORT.match(command):
            listener = socket.create_server((HOST, int(port[2])))
            self._sockets.append(listener)
            self._begin(self._stream_all, listener)
        if _START.match(command):
            self._started.set()
        key = _key(command)
        for i, (asked, replies) in enumerate(self._left):
            if asked == key:
                del self._left[: i + 1]
                return replies
        again = [replies for asked, replies in self.contact.exchanges if asked == key]
        if again:
            return again[-1]
        if _ERRORS.match(command):
            return [b'0,"No error"']
        if command.endswith("?"):
            self.unanswered.append(command)
        return []

    def _stream_all(self, listener: socket.socket) -> None:
        one = self._accepted(listener)
        if one is None:
            return
        one.settimeout(5.0)
        began_s: float | None = None
        for piece in self.contact.stream:
            if piece.at_s >= self.contact.started_s:
                while not self._started.wait(_LOOK_S):
                    if self._stop.is_set():
                        return
                began_s = began_s if began_s is not None else time.monotonic()
                due_s = began_s + (piece.at_s - self.contact.started_s) / self._speed
                if self._stop.wait(max(due_s - time.monotonic(), 0.0)):
                    return
            try:
                one.sendall(piece.data)
            except OSError:
                return
            self.sent += len(piece.data)
