"""Commands to an OXYGEN recorder: what is asked of it, and the little that is told it, before its samples stream.

Nothing of the recorder is changed but the one group of the data stream that the rig names; acquisition and storing are
started where the rig says so, and what was not started here is not stopped here. Commands: the SCPI manual of OXYGEN,
and DEWETRON's own client (pyOxygenSCPI, MIT).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from recoil_acquisition.devices.scpi import Heard, ScpiClient, ScpiError, Value, parse_reply, quoted_text
from recoil_acquisition.errors import nearest_first

PORT = 10001
STREAM_PORT = 10003
LEAST_VERSION = (1, 7)
"""RC_SCPI from which on there is a data stream (October 2018)."""
STATES_S = 5.0
"""Longest time in which a state is reached."""
_LOOK_S = 0.1
PROPERTIES = ("SampleRate", "Unit", "Range", "Used", "Neon/Stored", "LP_Filter_Freq", "Mode")
"""Properties of a channel that are asked for; one that a recorder does not have is left out."""
_OFF = ("false", "off", "0")


class RecorderError(ScpiError):
    """A recorder is not in a state in which it can stream what the rig wants, in one line with what to do."""


@dataclass(frozen=True)
class OxygenSettings:
    """Settings of a rig's ``device`` table of an OXYGEN recorder.

    Attributes
    ----------
    stream_port, group
        Port and number of the group of the data stream that are ours.
    acquisition, storing
        Whether acquisition, and storing into the recorder's own file, are started here and storing is stopped again.
    """

    host: str
    port: int = PORT
    stream_port: int = STREAM_PORT
    group: int = 1
    acquisition: bool = False
    storing: bool = False


class OxygenControl:
    """Commands to one recorder.

    Attributes
    ----------
    heard
        Function that is given each line that passes.
    identity
        Name that it gives itself.
    said
        Properties of each channel that is streamed, as it replied them.
    """

    def __init__(self, settings: OxygenSettings) -> None:
        self.settings = settings
        self.heard: Heard = lambda _who, _line: None
        self.identity = ""
        self.said: dict[str, dict[str, str]] = {}
        self._client: ScpiClient | None = None
        self._stores = self._owns = False

    def connect(self) -> None:
        """Connect, and make sure that it streams at all; OSError if it does not."""
        self._client = self._connected()
        self.identity = self._client.ask("*IDN?")
        versions = [str(one) for one in _parsed(self._client.ask("*VER?"), "*VER?")]
        stated = versions[versions.index("RC_SCPI") + 1] if "RC_SCPI" in versions[:-1] else ""
        numbers = tuple(int(part) for part in stated.split(".") if part.isdecimal())
        if numbers and numbers < LEAST_VERSION:
            raise RecorderError(f"its remote control, {stated}, has no data stream, which came with 1.7: update OXYGEN")

    def prepare(self, wanted: Sequence[str]) -> None:
        """Have the group ready for whoever connects to the stream's port; OSError if it cannot be."""
        client, s = self._there(), self.settings
        self._need_acquisition()
        ids = self._ids()
        missing = [name for name in wanted if name not in ids]
        if missing:
            near = [f"{name!r} (nearest {', '.join(nearest_first(name, list(ids))[:4])})" for name in missing[:8]]
            raise RecorderError(f"it has no channel {'; '.join(near)}: correct `signal` in the rig file")
        for name in wanted:
            if len(ids[name]) > 1:
                found = f"it has {len(ids[name])} channels that are called {name!r}"
                raise RecorderError(f"{found}: give them names of their own in OXYGEN")
        self.said = self._properties({name: ids[name][0] for name in wanted})
        unused = [name for name in wanted if self.said[name].get("Used", "").lower() in _OFF]
        if unused:
            raise RecorderError(f"its channel {', '.join(unused)} is switched off: switch it on in OXYGEN")
        items = ",".join(map(quoted_text, wanted))
        if self.state() == "RUNNING" and (streamed := self._items()) != ():
            if streamed == tuple(wanted):
                self._owns = True
                return  # left from before: it goes on
            if not self._owns:
                other = f"its group {s.group} streams {', '.join(streamed)} to somebody else"
                raise RecorderError(f"{other}: write `group = {s.group + 1}` in `device`, or delete it there")
        self._owns = True
        client.do(f":DST:PORT{s.group} {s.stream_port}")
        client.do(f":DST:ITEM{s.group} {items}")
        if (taken := self._items()) != tuple(wanted):
            raise RecorderError(f"it streams {', '.join(taken)} instead of {', '.join(wanted)}: look at its channels")
        client.do(f":DST:INIT {s.group}")
        self._reach(f":DST:STAT{s.group}?", ("INITIALIZED",), "the data stream")

    def start(self) -> None:
        """Start the stream, once its port is connected to; OSError if that fails."""
        if self.state() != "RUNNING":
            self._there().do(f":DST:START {self.settings.group}")

    def store(self) -> None:
        """Start the recorder's own storing, where the rig says so; OSError if it does not begin."""
        if self.settings.storing and self._there().ask(":STOR:STAT?") not in ("Started", "Armed"):
            self._there().do(":STOR:START")
            self._stores = True
            self._reach(":STOR:STAT?", ("Started", "Armed"), "storing")

    def state(self) -> str:
        """Return the state of the group, in the recorder's word."""
        return self._there().ask(f":DST:STAT{self.settings.group}?").strip('"')

    def finish(self) -> None:
        """Stop what was started here, and let go of the group; nothing is raised."""
        with suppress(OSError):
            if self._stores:
                self._there().do(":STOR:STOP")
        if self._owns:
            with suppress(OSError):
                self._there().do(f":DST:STOP {self.settings.group}")
            with suppress(OSError):
                self._there().do(f":DST:DEL {self.settings.group}")
        self._stores = self._owns = False

    def close(self) -> None:
        """Close the connection; nothing is raised."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _connected(self) -> ScpiClient:
        client = ScpiClient(self.settings.host, self.settings.port, heard=self.heard)
        client.say(":COMM:HEAD OFF")
        client.say("*CLS")  # what others left there is no fault of ours
        return client

    def _there(self) -> ScpiClient:
        if self._client is None:
            raise ScpiError("the connection is closed")
        return self._client

    def _need_acquisition(self) -> None:
        state = self._there().ask(":ACQU:STAT?").strip('"')
        if state == "Started":
            return
        if state == "Waiting_for_sync":
            raise RecorderError("its acquisition waits for the source of its time: connect that, or choose another one")
        if not self.settings.acquisition:
            remedy = "start it in OXYGEN, or let it be started: `acquisition = true` in `device`"
            raise RecorderError(f"its acquisition is {state}: {remedy}")
        self._there().do(":ACQU:START")
        self._reach(":ACQU:STAT?", ("Started",), "its acquisition")

    def _reach(self, query: str, wanted: Sequence[str], what: str) -> None:
        ends_s = time.monotonic() + STATES_S
        while (state := self._there().ask(query).strip('"')) not in wanted:
            if state == "Unlicensed":
                raise RecorderError("it has no licence for the data stream (DST): ask DEWETRON for one")
            if time.monotonic() > ends_s:
                want = " or ".join(wanted)
                raise RecorderError(f"{what} is {state} after {STATES_S:g} s, not {want}: look at OXYGEN")
            time.sleep(_LOOK_S)

    def _ids(self) -> Mapping[str, Sequence[str]]:
        """Return the numbers of each channel's name."""
        rows = _parsed(self._there().ask(":CHANNEL:NAMES?"), ":CHANNEL:NAMES?")
        ids: dict[str, list[str]] = {}
        for row in rows:
            if isinstance(row, tuple) and len(row) == 2:
                ids.setdefault(str(row[1]), []).append(str(row[0]))
        return ids

    def _properties(self, ids: Mapping[str, str]) -> dict[str, dict[str, str]]:
        """Return what the recorder says of some channels; nothing of any where it has no such answers."""
        found: dict[str, dict[str, str]] = {name: {} for name in ids}
        try:
            for name, number in ids.items():
                query = f":CHANNEL:ITEM{number}:ATTR:NAMES?"
                known = {str(one) for one in _parsed(self._there().ask(query), query)}
                for key in (one for one in PROPERTIES if one in known):
                    asked = f":CHANNEL:PROP? {quoted_text(number)},{quoted_text(key)}"
                    found[name][key] = worded(_parsed(self._there().ask(asked), asked))
        except ScpiError:
            # an older one has no such query, and answers nothing: what is asked further gets a connection of its own
            self.close()
            self._client = self._connected()
        return found

    def _items(self) -> tuple[str, ...]:
        rows = _parsed(self._there().ask(f":DST:ITEM{self.settings.group}?"), ":DST:ITEM?")
        return tuple(str(one) for one in rows if one != "NONE")


def worded(values: tuple[Value, ...]) -> str:
    """Word a property as people read it.

    >>> worded(parse_reply('(SCALAR,200000.0,"Hz")'))
    '200000.0 Hz'
    >>> worded(parse_reply('(RANGE,-25.0,"MPa",250.0,"MPa")'))
    '-25.0 MPa to 250.0 MPa'
    >>> worded(parse_reply('(STRING,"Auto")'))
    'Auto'
    """
    (one, *_) = values or ("",)
    if not isinstance(one, tuple):
        return one
    kind, *parts = (str(part) for part in one)
    if kind == "RANGE" and len(parts) == 4:
        return f"{parts[0]} {parts[1]} to {parts[2]} {parts[3]}"
    return " ".join(parts) if parts else kind


def _parsed(reply: str, query: str) -> tuple[Value, ...]:
    try:
        return parse_reply(reply)
    except ValueError as error:
        raise RecorderError(f"its answer to {query!r} cannot be read: {error}") from error
