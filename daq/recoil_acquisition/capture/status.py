"""State of an armed acquisition, as the armed screen and the log show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.devices.device import Counters

State = Literal["disarmed", "armed", "recording", "stopped"]


@dataclass(frozen=True)
class SourceStatus:
    """One source.

    Attributes
    ----------
    rate_hz
        Frames of a bus, or bytes of a port, per second, over the last second or two.
    age_s
        Time since the last data; None if there was none.
    error
        Why it is no longer read; empty if it is.
    """

    name: str
    kind: str
    rate_hz: float
    age_s: float | None
    counters: Counters
    error: str


@dataclass(frozen=True)
class ChannelStatus:
    """One channel.

    Attributes
    ----------
    name, source, unit
        The unit is that of SI.
    level
        None if nothing came within the last second.
    range
        Of its sensor.
    triggers_at
        Level of the trigger's condition on it, where it has one on the signal itself.
    """

    name: str
    source: str
    unit: str
    level: Level | None
    range: tuple[float, float] | None
    triggers_at: float | None


@dataclass(frozen=True)
class LiveStatus:
    """The whole acquisition.

    Attributes
    ----------
    shots
        Triggered since it was started.
    armed_s
        Time since it was started.
    journal_bytes
        Written so far.
    unsynced_s
        Age of the oldest data that is not yet forced to the disk.
    unseen_bytes
        Recorded, and not looked at by the trigger.
    released_records
        Of the journal: watched, nothing happened in them, and given back.
    alert
        What nobody may overlook: a device that is lost, an output folder that is gone. Empty if nothing.
    """

    state: State
    sources: tuple[SourceStatus, ...]
    channels: tuple[ChannelStatus, ...]
    shots: int
    armed_s: float
    disk_free_bytes: int
    journal_bytes: int
    unsynced_s: float
    unseen_bytes: int
    released_records: int = 0
    alert: str = ""
