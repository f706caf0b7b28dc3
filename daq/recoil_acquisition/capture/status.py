"""State of an armed acquisition, as the armed screen and the log show it."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
        Rate at which its device receives, over the last second or two, per second in the unit `counted`.
    age_s
        Time since the last data; None if there was none.
    error
        Reason why the source is no longer read; empty if it is.
    counted
        Unit of what is counted, such as ``frames``.
    """

    name: str
    kind: str
    rate_hz: float
    age_s: float | None
    counters: Counters
    error: str
    counted: str = "bytes"


@dataclass(frozen=True)
class ChannelStatus:
    """One channel.

    Attributes
    ----------
    name, source, unit
        Name of the channel, name of its source, and its SI unit.
    level
        Level of the last second; None if nothing came in it.
    range
        Range of the channel's sensor.
    triggers_at
        Level of the trigger's condition on it, where it has one on the signal itself.
    peak
        Lowest and highest sample in the last shot; None until there is one.
    """

    name: str
    source: str
    unit: str
    level: Level | None
    range: tuple[float, float] | None
    triggers_at: float | None
    peak: tuple[float, float] | None = None

    def with_peak(self, peak: tuple[float, float] | None) -> ChannelStatus:
        """Return it with the extremes of the last shot."""
        return replace(self, peak=peak)

    def times(self, factor: float, unit: str) -> ChannelStatus:
        """Return it in another unit, of which one of its own has so many."""
        level, triggers_at = self.level, self.triggers_at
        return replace(
            self,
            unit=unit,
            level=None if level is None else Level(factor * level.last, factor * level.low, factor * level.high),
            range=None if self.range is None else (factor * self.range[0], factor * self.range[1]),
            triggers_at=None if triggers_at is None else factor * triggers_at,
            peak=None if self.peak is None else (factor * self.peak[0], factor * self.peak[1]),
        )


@dataclass(frozen=True)
class LiveStatus:
    """The whole acquisition.

    Attributes
    ----------
    shots
        Number of shots since the acquisition was started.
    armed_s
        Time since it was started.
    disk_free_bytes
        Room for captures and shot files: what the journal has reserved is not free any more.
    journal_bytes
        Bytes written to the journal so far.
    unsynced_s
        Age of the oldest data that is not yet forced to the disk.
    unseen_bytes
        Bytes that are recorded and that the trigger has not looked at.
    released_records
        Records of the journal that were given back: they were watched, and nothing happened in them.
    alert
        Sentence that nobody may overlook: a device that is lost, an output folder that is gone. Empty if there is none.
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
