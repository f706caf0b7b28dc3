"""The commands of a virtual OXYGEN recorder: one line in, one line out or none, and the state that they lead to.

Commands and forms of replies: the SCPI manual of OXYGEN and DEWETRON's own client (pyOxygenSCPI, MIT). A command that
is wrong has no reply; it stands in the queue of errors.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

IDENTITY = "DEWETRON,OXYGEN,VIRTUAL,7.1.0"
VERSIONS = 'SCPI,"1999.0",RC_SCPI,"1.21",OXYGEN,"7.1.0"'
NO_ERROR = '0,"No error"'
GROUP = 1
"""The one group of streams that a virtual recorder has."""

_QUOTED = re.compile(r'"((?:[^"]|"")*)"')
_NUMBER = re.compile(r"[0-9]{1,5}")
_ERRORS = {-108: "Parameter not allowed", -113: "Undefined header", -221: "Settings conflict"}


class Stream(Protocol):
    """Stream that commands act on."""

    def listen(self, port: int) -> bool:
        """Open the stream's port; whether that worked."""

    def begin(self) -> None:
        """Begin to send to whoever is connected."""

    def end(self) -> None:
        """Say that the last packet is the last, and send nothing more."""

    def shut(self) -> None:
        """Close the stream's port, and the connection."""


@dataclass(frozen=True)
class ScpiChannel:
    """A channel as the commands know it, with its properties in the form in which they are replied."""

    number: str
    name: str
    properties: Mapping[str, str]


class _Wrong(Exception):  # noqa: N818 - it is what a command is
    """A command that goes to the queue of errors, by its number."""


class OxygenScpi:
    """State of a recorder as its commands change it.

    Parameters
    ----------
    channels
        All channels of the recorder.
    stream
        Stream that the commands act on.
    heads
        Whether replies repeat their commands, until that is switched off.

    Attributes
    ----------
    state
        State of the group: ``INVALID``, ``CONFIG``, ``INITIALIZED``, ``RUNNING``, ``ERROR`` or ``Unlicensed``.
    acquisition, storing
        State of either: ``Started``, ``Stopped``, ``Waiting_for_sync``, ``Paused``.
    markers, headers
        Additions to its file, as they were sent.
    """

    def __init__(self, channels: Sequence[ScpiChannel], stream: Stream, *, heads: bool = True) -> None:
        self.channels, self.stream, self.heads = channels, stream, heads
        self.state, self.acquisition, self.storing = "INVALID", "Started", "Stopped"
        self.file_name = ""
        self.items: tuple[str, ...] = ()
        self.port = self.interval_ms = 0
        self.markers: list[str] = []
        self.headers: list[str] = []
        self.errors: deque[str] = deque()

    def answer(self, line: str) -> str | None:
        """Do what a line says; return the reply, None where there is none."""
        head, _, rest = line.strip().partition(" ")
        if not head:
            return None
        command = head.upper().lstrip(":")
        try:
            if not head.endswith("?"):
                self._do(command, rest.strip())
                return None
            reply = self._query(command, rest.strip())
        except _Wrong as wrong:
            number = int(str(wrong))
            self.errors.append(f'{number},"{_ERRORS[number]}"')
            return None
        if not self.heads or command.startswith("*"):
            return reply
        return f":{command.removesuffix('?') if 'ITEM' in command else re.sub('[0-9]*[?]$', '', command)} {reply}"

    def _query(self, command: str, rest: str) -> str:
        plain = {
            "*IDN?": IDENTITY,
            "*VER?": VERSIONS,
            "*OPC?": "1",
            "COMM:HEAD?": "ON" if self.heads else "OFF",
            "ACQU:STAT?": self.acquisition,
            "STOR:STAT?": self.storing,
            "STOR:FILE:NAME?": _quoted(self.file_name),
            f"DST:STAT{GROUP}?": self.state,
            f"DST:PORT{GROUP}?": str(self.port),
            f"DST:INTERVAL{GROUP}?": str(self.interval_ms),
            f"DST:ITEM{GROUP}?": ",".join(map(_quoted, self.items)) or "NONE",
            "SYST:ERR:COUNT?": str(len(self.errors)),
            "CHANNEL:NAMES?": ",".join(f'("{one.number}",{_quoted(one.name)})' for one in self.channels),
            "CHANNEL:IDS?": ",".join(f'"{one.number}"' for one in self.channels),
        }
        if command in plain:
            return plain[command]
        if command == "SYST:ERR?":
            return self.errors.popleft() if self.errors else NO_ERROR
        if command == "SYST:ERR:ALL?":
            told = ",".join(self.errors) or NO_ERROR
            self.errors.clear()
            return told
        if command == "CHANNEL:PROP?":
            number, key = self._quoted(rest, 2)
            return self._channel(number).properties.get(key, "NONE")
        if found := re.fullmatch(r"CHANNEL:ITEM(.+):ATTR:NAMES\?", command):
            return ",".join(f'"{key}"' for key in self._channel(found[1]).properties)
        raise _Wrong(-113)

    def _do(self, command: str, rest: str) -> None:
        if command in ("*CLS", "*RST"):
            self.errors.clear()
        elif command == "COMM:HEAD":
            self.heads = self._one_of(rest, "ON", "OFF") == "ON"
        elif command in ("ACQU:START", "ACQU:RESTART", "ACQU:STOP"):
            self.acquisition = "Stopped" if command == "ACQU:STOP" else "Started"
        elif command in ("STOR:START", "STOR:PAUSE", "STOR:STOP"):
            self.storing = {"START": "Started", "PAUSE": "Paused", "STOP": "Stopped"}[command[5:]]
        elif command == "STOR:FILE:NAME":
            (self.file_name,) = self._quoted(rest, 1)
        elif command in ("MARK:ADD", "HEAD:SET", "HEAD:ADD"):
            (self.markers if command == "MARK:ADD" else self.headers).append(rest)
        elif command == "SYST:KLOCK":
            self._one_of(rest, "ON", "OFF")
        elif command.startswith("DST:"):
            self._do_stream(command.removeprefix("DST:"), rest)
        else:
            raise _Wrong(-113)

    def _do_stream(self, command: str, rest: str) -> None:
        if command == f"ITEM{GROUP}":
            self._leave("CONFIG")
            names = tuple(_texts(rest))
            known = {one.name for one in self.channels}
            # one channel that is not there, or not used, discards the whole list
            self.items = names if names and known.issuperset(names) else ()
            if not self.items:
                raise _Wrong(-108)
        elif command == f"PORT{GROUP}":
            self._leave("CONFIG")
            if _NUMBER.fullmatch(rest) is None or not 0 < int(rest) < 1 << 16:
                raise _Wrong(-108)
            self.port = int(rest)
        elif command == f"INTERVAL{GROUP}":
            if _NUMBER.fullmatch(rest) is None or not int(rest):
                raise _Wrong(-108)
            self.interval_ms = int(rest)
        elif command in (f"TRIG{GROUP}", f"REPLAY{GROUP}"):
            # it streams all the time, and what is now: nothing else can be asked of it
            self._one_of(rest, "OFF" if command.startswith("TRIG") else "LIVE")
        elif command == "RESET" or (command == "DEL" and self._is_group(rest)):
            self._leave("INVALID")
            self.items, self.port = (), 0
        elif command == "INIT" and self._is_group(rest):
            self._need(self.state == "CONFIG" and bool(self.items) and self.port > 0)
            self.state = "INITIALIZED" if self.stream.listen(self.port) else "ERROR"
            self._need(self.state == "INITIALIZED")
        elif command == "START" and self._is_group(rest):
            self._need(self.state == "INITIALIZED")
            self.state = "RUNNING"
            self.stream.begin()
        elif command == "STOP" and self._is_group(rest):
            if self.state in ("RUNNING", "Unlicensed"):
                self.state = "INITIALIZED"
                self.stream.end()
        else:
            raise _Wrong(-113)

    def _leave(self, state: str) -> None:
        """Go back to a state in which nothing is sent."""
        if self.state in ("INITIALIZED", "RUNNING", "Unlicensed"):
            self.stream.shut()
        self.state = state

    @staticmethod
    def _need(holds: bool) -> None:
        if not holds:
            raise _Wrong(-221)

    @staticmethod
    def _is_group(rest: str) -> bool:
        if rest.upper() not in (str(GROUP), "ALL"):
            raise _Wrong(-108)
        return True

    @staticmethod
    def _one_of(rest: str, *known: str) -> str:
        if rest.upper() not in known:
            raise _Wrong(-108)
        return rest.upper()

    @staticmethod
    def _quoted(rest: str, count: int) -> list[str]:
        found = _texts(rest)
        if len(found) != count:
            raise _Wrong(-108)
        return found

    def _channel(self, number: str) -> ScpiChannel:
        for one in self.channels:
            if one.number == number:
                return one
        raise _Wrong(-108)


def _texts(rest: str) -> list[str]:
    """Return the texts between quotes; a quote in one of them is doubled."""
    return [one.replace('""', '"') for one in _QUOTED.findall(rest)]


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'
