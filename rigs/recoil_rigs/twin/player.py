"""Plays the shots of a virtual rig in real time: its CAN buses, serial ports and recorders, as live devices.

The player gives each source a transport (`recoil_rigs.twin.transports`) and the ``device`` table under which the host
opens it. Open the devices, then `TwinPlayer.start`: silence with baseline frames and their noise, a shot as its
files hold it, silence again, and so on. What goes wrong on the way is declared by `Faults` and counted in
`TwinPlayer.truth`.
"""

from __future__ import annotations

import itertools
import math
import os
import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from recoil_rigs.rig import Rig, Source
from recoil_rigs.twin import TwinShot, virtual_settings
from recoil_rigs.twin.can_replay import CanItem, can_items
from recoil_rigs.twin.faults import Faults, RecorderFaults
from recoil_rigs.twin.opendaq_recorder import OpendaqRecorder
from recoil_rigs.twin.oxygen_recorder import OxygenRecorder
from recoil_rigs.twin.recorder_play import RecorderPlay
from recoil_rigs.twin.recorder_replay import RecorderTape, StreamForm
from recoil_rigs.twin.serial_replay import SerialItem, serial_items
from recoil_rigs.twin.source_play import SourcePlay
from recoil_rigs.twin.timeline import Timeline
from recoil_rigs.twin.transports import MulticastBus, PseudoTerminal, SlcanAdapter, VirtualBus

TRANSPORTS = {"can": ("virtual", "slcan", "udp_multicast"), "serial": ("pty",), "dewetron": ("oxygen", "opendaq")}
"""Transports by kind of source; the first is the default."""

_ONLY_WHERE_SAID = ("dewetron",)
"""Kinds of source that are played only where the rig, or who plays it, says so: a recorder's file is there anyway."""

_RECORDERS = {"oxygen": OxygenRecorder, "opendaq": OpendaqRecorder}

_LEAD_S = 0.05
_NUMBERS = itertools.count()


class TwinPlayer:
    """One play of some shots of a virtual rig.

    Parameters
    ----------
    shots
        Shots to play, at least one.
    silence_before_s, silence_after_s
        Silence before and after each shot.
    speed
        Factor by which the play is faster than real time; the devices' own clocks are not sped up.
    transports
        Transports by source; else the rig's ``device = { virtual = "..." }``, else the first of `TRANSPORTS`.
    faults
        Faults by source; else the rig's ``device = { virtual = "...", faults = { ... } }``, see `Faults.from_table`.
    seed
        Seed of the baseline frames and of the faults.

    Raises
    ------
    ValueError
        If there is no shot, no source to play, or a source, transport or number that makes no sense.
    """

    def __init__(
        self,
        rig: Rig,
        shots: Sequence[TwinShot],
        *,
        silence_before_s: float = 1.0,
        silence_after_s: float = 0.5,
        speed: float = 1.0,
        transports: Mapping[str, str] | None = None,
        faults: Mapping[str, Faults] | None = None,
        seed: int = 0,
    ) -> None:
        sources = playable_sources(rig, transports or {})
        names = {source.name for source in sources}
        for given in (transports or {}, faults or {}):
            if strangers := set(given) - names:
                raise ValueError(f"no source to play: {', '.join(sorted(strangers))}; there are {sorted(names)}")
        if not shots or not sources:
            raise ValueError("there is nothing to play: give at least one shot of a rig with a bus or a port")
        if not speed > 0 or silence_before_s < 0 or silence_after_s < 0:
            raise ValueError("speed must be positive, and silence not negative")
        record_s = virtual_settings(rig).duration_s
        self.timeline = Timeline.plan(len(shots), record_s, silence_before_s, silence_after_s)
        self._speed = speed
        self._began_ns = 0
        self._fire_s = [
            start_s + shot.truth["t_fire"] for shot, start_s in zip(shots, self.timeline.starts_s, strict=True)
        ]
        self._stop = threading.Event()
        self._plays: dict[str, SourcePlay] = {}
        for i, source in enumerate(sources):
            chosen = (transports or {}).get(source.name) or _declared(source)
            fault = (faults or {}).get(source.name) or _declared_faults(source)
            if source.kind in _ONLY_WHERE_SAID:
                self._plays[source.name] = self._recorder(rig, source, shots, chosen, fault, [seed, i])
                continue
            steps = fault.clock_steps
            transport = _transport(source, chosen)
            items: Iterator[CanItem] | Iterator[SerialItem]
            if source.kind == "can":
                items = can_items(rig, source, shots, self.timeline, steps, seed)
            else:
                items = serial_items(source, shots, self.timeline, steps, seed)
            self._plays[source.name] = SourcePlay(source.name, items, transport, fault, self._stop, [seed, i])

    def _recorder(
        self, rig: Rig, source: Source, shots: Sequence[TwinShot], chosen: str, faults: Faults, seed: Sequence[int]
    ) -> RecorderPlay:
        _check_transport(source, chosen)
        if not isinstance(faults, RecorderFaults):
            raise ValueError(f"source '{source.name}': its faults must be those of a recorder")
        table = source.device or {}
        try:
            form = StreamForm.from_table(table, [spec.signal for spec in rig.channels_of(source.name)])
        except ValueError as error:
            raise ValueError(f"source '{source.name}'.device.{error}") from error
        tape = RecorderTape(rig, source, shots, self.timeline, form, ppm=faults.clock_ppm, seed=seed[0])
        # what is not the play's is the client's, such as whether it starts the recording
        asked = {key: value for key, value in table.items() if key not in ("virtual", "faults", *asdict(form))}
        recorder = _RECORDERS[chosen](source.name, tape.content, seed[0], asked)
        return RecorderPlay(source.name, tape.items(faults.clock_steps), recorder, faults, self._stop, seed)

    @property
    def devices(self) -> Mapping[str, Mapping[str, Any]]:
        """The ``device`` table of each source."""
        return {name: play.transport.device for name, play in self._plays.items()}

    @property
    def playing(self) -> bool:
        """Whether any source has something left to say."""
        return any(play.thread.is_alive() for play in self._plays.values())

    @property
    def played_s(self) -> float:
        """Time on the timeline up to which every source was played, s: behind the host's where that is busy."""
        return min((play.at_s for play in self._plays.values() if play.thread.is_alive()), default=math.inf)

    @property
    def fired_ns(self) -> tuple[int, ...]:
        """The instants at which the shots fire, on the host's monotonic clock; empty before `start`."""
        if not self._began_ns:
            return ()
        return tuple(self._began_ns + round(t / self._speed * 1e9) for t in self._fire_s)

    def plug(self) -> None:
        """Make all devices be there, silent until `start`; DeviceError if this computer cannot."""
        try:
            for play in self._plays.values():
                play.transport.plug()
        except BaseException:
            self.close()
            raise

    def start(self, ready_timeout_s: float = 5.0) -> None:
        """Begin to play, once the host has opened what can be seen to be opened.

        Raises
        ------
        TimeoutError
            If it has not in time.
        """
        for name, play in self._plays.items():
            if not play.transport.ready(ready_timeout_s):
                raise TimeoutError(f"the host has not opened the device of '{name}'")
        began_s = time.monotonic() + _LEAD_S
        self._began_ns = round(began_s * 1e9)
        for play in self._plays.values():
            play.begin(began_s, self._speed)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the play; return whether it is over."""
        ends = None if timeout_s is None else time.monotonic() + timeout_s
        for play in self._plays.values():
            if play.thread.ident is not None:
                play.thread.join(None if ends is None else max(ends - time.monotonic(), 0.0))
        return not self.playing

    def close(self) -> None:
        """Stop the play and take the devices away; further calls do nothing."""
        self._stop.set()
        for play in self._plays.values():
            play.close()

    def __enter__(self) -> TwinPlayer:
        self.plug()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def truth(self) -> dict[str, Any]:
        """Return what was played, JSON types only: times of the shots, and per source its counts and its faults."""
        return {
            "fire_s": list(self._fire_s),
            "end_s": self.timeline.end_s,
            "speed": self._speed,
            "sources": {
                name: {**asdict(play.played), "faults": asdict(play.faults)} for name, play in self._plays.items()
            },
        }

    @property
    def failures(self) -> Mapping[str, BaseException | None]:
        """Error that ended the play of each source before its time; None where none did."""
        return {name: play.failure for name, play in self._plays.items()}


def playable_sources(rig: Rig, transports: Collection[str] = ()) -> tuple[Source, ...]:
    """Return the buses and ports of a rig that have channels, and the recorders that are declared to be played.

    Parameters
    ----------
    transports
        Sources for which a transport is chosen, whatever the rig declares.
    """
    return tuple(
        s
        for s in rig.sources
        if s.kind in TRANSPORTS
        and rig.channels_of(s.name)
        and (s.kind not in _ONLY_WHERE_SAID or is_virtual(s) or s.name in transports)
    )


def is_virtual(source: Source) -> bool:
    """Return whether a rig declares that a source is played: ``device = { virtual = "..." }``."""
    return bool(source.device) and "virtual" in (source.device or {})


def _declared(source: Source) -> str:
    return str((source.device or {}).get("virtual", TRANSPORTS[source.kind][0]))


def _declared_faults(source: Source) -> Faults:
    kind = RecorderFaults if source.kind in _ONLY_WHERE_SAID else Faults
    try:
        return kind.from_table((source.device or {}).get("faults", {}))
    except ValueError as error:
        raise ValueError(f"source '{source.name}'.device.faults: {error}") from error


def _check_transport(source: Source, chosen: str) -> None:
    if chosen not in TRANSPORTS[source.kind]:
        known = ", ".join(TRANSPORTS[source.kind])
        raise ValueError(f"source '{source.name}' cannot be played over {chosen!r}, only over {known}")


def _transport(source: Source, chosen: str) -> VirtualBus | PseudoTerminal:
    _check_transport(source, chosen)
    if chosen == "slcan":
        return SlcanAdapter(source.name)
    if chosen == "udp_multicast":
        return MulticastBus()
    if chosen == "pty":
        return PseudoTerminal(source.name)
    return VirtualBus(f"recoil-daq-{os.getpid()}-{next(_NUMBERS)}-{source.name}")
