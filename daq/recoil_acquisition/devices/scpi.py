"""Commands of an instrument as lines of text (SCPI 1999.0, IEEE 488.2), over one TCP connection.

A reply is one line. One that does not come in time ends the connection, so that no later command gets it; a command is
done only when the instrument's queue of errors says so.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress

LONGEST_REPLY = 1 << 20
TIMEOUT_S = 3.0
_DEEPEST = 8
NO_ERROR = ("0", "+0")

Heard = Callable[[str, bytes], None]
"""Function that is given each line, and who said it: ``host`` or ``recorder``."""
Value = str | tuple["Value", ...]
"""A value of a reply: a word, a number or a text as it stands, or a group of some in brackets."""


class ScpiError(OSError):
    """An instrument does not answer, or says that a command was wrong, in one line."""


class ScpiClient:
    """One connection.

    Parameters
    ----------
    heard
        Function that is given each line that passes.

    Raises
    ------
    OSError
        If the instrument cannot be reached.
    """

    def __init__(
        self, host: str, port: int, *, timeout_s: float = TIMEOUT_S, heard: Heard = lambda _who, _line: None
    ) -> None:
        self._timeout_s, self._heard, self._held = timeout_s, heard, b""
        self._socket: socket.socket | None = socket.create_connection((host, port), timeout_s)

    def close(self) -> None:
        """Close the connection; nothing is raised."""
        if self._held:  # what came of a line that never ended
            self._heard("recorder", self._held)
            self._held = b""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.close()
            self._socket = None

    def ask(self, query: str) -> str:
        """Return the reply to a query; ScpiError if none comes."""
        self._leave_unasked()
        self.say(query)
        return self._line(query)

    def do(self, command: str) -> None:
        """Send a command; ScpiError if the instrument says that it was wrong."""
        self.say(command)
        self.refuse_errors(command)

    def refuse_errors(self, command: str) -> None:
        """Raise ScpiError if the queue of errors holds any."""
        told = self.ask(":SYST:ERR:ALL?")
        number = told.partition(",")[0].strip()
        if number not in NO_ERROR:
            raise ScpiError(f"it answers to {command!r}: {told[:200]}")

    def say(self, line: str) -> None:
        """Send a line, whatever the instrument makes of it; ScpiError if the connection has ended."""
        if "\n" in line or "\r" in line:
            raise ValueError(f"a command is one line, not {line!r}")
        data = line.encode() + b"\n"
        self._heard("host", line.encode())
        try:
            self._open().sendall(data)
        except OSError as error:
            self.close()
            raise ScpiError(f"the connection ended at {line!r}: {error.strerror or error}") from error

    def _line(self, query: str) -> str:
        ends_s = time.monotonic() + self._timeout_s
        while b"\n" not in self._held:
            left_s = ends_s - time.monotonic()
            try:
                one = self._open()
                one.settimeout(max(left_s, 1e-3))
                piece = one.recv(1 << 16)
            except TimeoutError:
                piece = None
            except OSError as error:
                self.close()
                raise ScpiError(f"the connection ended at {query!r}: {error.strerror or error}") from error
            if piece is None or left_s <= 0:
                self.close()
                raise ScpiError(f"no answer to {query!r} within {self._timeout_s:g} s")
            if not piece:
                self.close()
                raise ScpiError(f"it closed the connection instead of answering {query!r}")
            self._held += piece
            if len(self._held) > LONGEST_REPLY:
                self.close()
                raise ScpiError(f"its answer to {query!r} has more than {LONGEST_REPLY} bytes")
        line, _, self._held = self._held.partition(b"\n")
        self._heard("recorder", line)
        return line.decode("utf-8", errors="replace").strip()

    def _leave_unasked(self) -> None:
        """Leave out what came without being asked for, lest it be taken for the reply to what is asked now."""
        one = self._open()
        try:
            while len(self._held) <= LONGEST_REPLY and select.select([one], [], [], 0.0)[0]:
                if not (piece := one.recv(1 << 16)):
                    break  # the query says so
                self._held += piece
        except OSError as error:
            self.close()
            raise ScpiError(f"the connection ended: {error.strerror or error}") from error
        if self._held:
            self._heard("recorder", self._held)
            self._held = b""

    def _open(self) -> socket.socket:
        if self._socket is None:
            raise ScpiError("the connection is closed")
        return self._socket


def quoted_text(text: str) -> str:
    """Return a text in quotes, as a command takes it: a quote in it is doubled (IEEE 488.2, 7.7.5)."""
    return '"' + text.replace('"', '""') + '"'


def parse_reply(reply: str) -> tuple[Value, ...]:
    """Take a reply apart: values between commas, texts in quotes, groups in brackets.

    >>> parse_reply('("1","P (brl), muzzle"),(SCALAR,200000.0,"Hz"),NONE')
    (('1', 'P (brl), muzzle'), ('SCALAR', '200000.0', 'Hz'), 'NONE')

    Raises
    ------
    ValueError
        If quotes or brackets do not close.
    """
    values, at = _group(reply, 0, 0)
    if at != len(reply):
        raise ValueError(f"a bracket too many in {reply[:80]!r}")
    return values


def _group(reply: str, at: int, depth: int) -> tuple[tuple[Value, ...], int]:
    """Return the values from a place to the bracket that closes them, or the end, and the place behind."""
    if depth > _DEEPEST:
        raise ValueError(f"brackets within brackets in {reply[:80]!r}")
    values: list[Value] = []
    word, held = "", False
    while at < len(reply):
        sign = reply[at]
        if sign == '"':
            text, at = _quoted(reply, at + 1)
            values.append(text)
            held = True
            continue
        at += 1
        if sign == "(":
            inner, at = _group(reply, at, depth + 1)
            values.append(inner)
            held = True
        elif sign in ",)":
            if not held and (word.strip() or sign == ","):
                values.append(word.strip())
            word, held = "", False
            if sign == ")":
                if not depth:
                    raise ValueError(f"a bracket too many in {reply[:80]!r}")
                return tuple(values), at
        else:
            word += sign
    if depth:
        raise ValueError(f"a bracket that does not close in {reply[:80]!r}")
    if not held and (word.strip() or values):
        values.append(word.strip())
    return tuple(values), at


def _quoted(reply: str, at: int) -> tuple[str, int]:
    text = ""
    while True:
        end = reply.find('"', at)
        if end < 0:
            raise ValueError(f"a quote that does not close in {reply[:80]!r}")
        text += reply[at:end]
        if reply[end + 1 : end + 2] != '"':
            return text, end + 1
        text, at = text + '"', end + 2
