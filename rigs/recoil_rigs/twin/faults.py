"""Faults between a virtual sensor and the host: declared before, and reported afterwards as truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, Literal, Self, get_args


@dataclass(frozen=True)
class Interval:
    """A time on the play's clock, s from its start, and how long it lasts."""

    at_s: float
    for_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.at_s) and math.isfinite(self.for_s) and self.for_s > 0):
            raise ValueError(f"an interval must be finite and last, not {self!r}")

    @property
    def end_s(self) -> float:
        """The instant at which it is over."""
        return self.at_s + self.for_s

    def holds(self, time_s: float) -> bool:
        """Return whether an instant lies in it."""
        return self.at_s <= time_s < self.end_s


@dataclass(frozen=True)
class ClockStep:
    """A jump of the device's clock, positive forward, at a time of the play."""

    at_s: float
    step_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.at_s) and math.isfinite(self.step_s)):
            raise ValueError(f"a step must be finite, not {self!r}")


ChangeKind = Literal["channels", "unit", "factor"]
"""Kind of a change while a recorder streams: its last channel goes, or its first one gets another unit or factor."""


@dataclass(frozen=True)
class Change:
    """Something that a recorder's channels are from a time of the play on."""

    at_s: float
    what: ChangeKind

    def __post_init__(self) -> None:
        if not math.isfinite(self.at_s) or self.what not in get_args(ChangeKind):
            raise ValueError(f"a change has a time, and is one of {', '.join(get_args(ChangeKind))}, not {self!r}")


@dataclass(frozen=True)
class Faults:
    """Faults of one source. Shares are probabilities per frame or per byte; times are of the play.

    Attributes
    ----------
    lost_frames
        Share of the frames that never arrive.
    error_frames
        Share of the frames of a bus that an error frame follows.
    dropped_bytes, flipped_bytes
        Share of the bytes of a port that are lost, or arrive with one bit changed.
    stalls
        Times at which the device holds everything back, and then gives it at once.
    unplugged
        Times at which the device is gone; what it would have sent is lost.
    """

    lost_frames: float = 0.0
    error_frames: float = 0.0
    dropped_bytes: float = 0.0
    flipped_bytes: float = 0.0
    stalls: tuple[Interval, ...] = ()
    unplugged: tuple[Interval, ...] = ()
    clock_steps: tuple[ClockStep, ...] = ()

    def __post_init__(self) -> None:
        for name in self._shares:
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be a share from 0 to below 1, not {getattr(self, name)!r}")
        for name in self._intervals:
            rows: Sequence[Interval] = getattr(self, name)
            if any(later.at_s < earlier.end_s for earlier, later in pairwise(rows)):
                raise ValueError(f"{name} must follow each other, not overlap: {rows!r}")

    @property
    def gone(self) -> tuple[Interval, ...]:
        """The times at which the device is away, for whatever reason, in their order."""
        return self.unplugged

    @property
    def _shares(self) -> tuple[str, ...]:
        return ("lost_frames", "error_frames", "dropped_bytes", "flipped_bytes")

    @property
    def _intervals(self) -> tuple[str, ...]:
        return ("stalls", "unplugged")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Self:
        """Read faults from a table, such as ``{ lost_frames = 0.01, stalls = [[1.0, 0.5]] }``.

        Raises
        ------
        ValueError
            With the key that is at fault.
        """
        known = {one.name for one in fields(cls)}
        rows = dict.fromkeys(("stalls", "unplugged", "silences", "restarts"), Interval) | {"clock_steps": ClockStep}
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in known:
                raise ValueError(f"there is no fault {key!r}; there are {', '.join(sorted(known))}")
            try:
                if key == "changes":
                    values[key] = tuple(Change(float(at_s), what) for at_s, what in value)
                else:
                    values[key] = tuple(rows[key](*map(float, row)) for row in value) if key in rows else float(value)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{key}: {error}") from error
        return cls(**values)


@dataclass(frozen=True)
class RecorderFaults(Faults):
    """Faults of a recorder's stream, whose frames are packets; beside those that other sources have.

    Attributes
    ----------
    doubled_frames
        Share of the packets that are sent twice.
    lacking_frames
        Share of the packets that lack one channel.
    cut_frames
        Share of the packets whose bytes are written in pieces, cut anywhere.
    silences
        Times at which nothing is sent, over a connection that stays; what would have been sent is lost.
    restarts
        Times at which the recorder is switched off; behind each its ticks begin at 0, and nothing is configured.
    changes
        Changes of its channels.
    licence_s
        Time from which on it sends nothing for want of a licence; 0 if it has one.
    clock_ppm
        Millionths by which its clock is slow.
    """

    doubled_frames: float = 0.0
    lacking_frames: float = 0.0
    cut_frames: float = 0.0
    silences: tuple[Interval, ...] = ()
    restarts: tuple[Interval, ...] = ()
    changes: tuple[Change, ...] = ()
    licence_s: float = 0.0
    clock_ppm: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("error_frames", "dropped_bytes", "flipped_bytes"):
            if getattr(self, name):
                raise ValueError(f"{name} is no fault of a recorder's stream")
        if not abs(self.clock_ppm) < 1e5:
            raise ValueError(f"clock_ppm must be a number of millionths below 100,000, not {self.clock_ppm!r}")
        if any(later.at_s < earlier.end_s for earlier, later in pairwise(self.gone)):
            raise ValueError(f"unplugged and restarts must follow each other, not overlap: {self.gone!r}")

    @property
    def gone(self) -> tuple[Interval, ...]:
        """The times at which the recorder is away, for whatever reason, in their order."""
        return tuple(sorted((*self.unplugged, *self.restarts), key=lambda one: one.at_s))

    @property
    def _shares(self) -> tuple[str, ...]:
        return (*super()._shares, "doubled_frames", "lacking_frames", "cut_frames")

    @property
    def _intervals(self) -> tuple[str, ...]:
        return (*super()._intervals, "silences", "restarts")


@dataclass
class Played:
    """Events that truly happened to one source, counted while it is played.

    Attributes
    ----------
    frames
        Number of frames that the device made.
    sent
        Number of frames that were given to the host whole.
    lost
        Number of frames that never arrived, by `Faults.lost_frames`.
    unplugged
        Number of frames that were made while the device was gone.
    damaged
        Number of frames that lost bytes or got bits flipped.
    bytes_sent, bytes_dropped, bytes_flipped
        Numbers of a port's bytes that were sent, dropped and flipped.
    stray_bytes
        Bytes outside of frames that the port gave; part of `bytes_sent`.
    unread_bytes
        Number of bytes that were sent, and gone with the port before the host read them.
    not_open
        Frames made while the host had not opened the channel, or did not read the port.
    latest_s
        Longest time by which the player was behind its own time.
    """

    frames: int = 0
    sent: int = 0
    lost: int = 0
    unplugged: int = 0
    damaged: int = 0
    error_frames: int = 0
    bytes_sent: int = 0
    bytes_dropped: int = 0
    bytes_flipped: int = 0
    stray_bytes: int = 0
    unread_bytes: int = 0
    not_open: int = 0
    stalls: int = 0
    disconnects: int = 0
    latest_s: float = 0.0


@dataclass
class Ticks:
    """Stretches of a recorder's ticks, each as epoch, first tick and number; an epoch ends where it is restarted."""

    stretches: list[list[int]] = field(default_factory=list)

    def add(self, epoch: int, first: int, count: int) -> None:
        """Add some ticks; where they follow the last ones they make one stretch."""
        if self.stretches:
            last = self.stretches[-1]
            if last[0] == epoch and last[1] + last[2] == first:
                last[2] += count
                return
        self.stretches.append([epoch, first, count])

    @property
    def count(self) -> int:
        """Number of all of them."""
        return sum(count for _, _, count in self.stretches)


@dataclass
class PlayedRecorder(Played):
    """Events that truly happened to a recorder, whose frames are packets, with the ticks that they were about.

    Attributes
    ----------
    began_tick
        Tick with which the play began.
    sent_ticks, lost_ticks, doubled_ticks, silent_ticks, unplugged_ticks, not_open_ticks
        Ticks of packets that were sent, lost on the way, sent once more, not sent in a silence or for want of a
        licence, made while the recorder was away, made while nobody took them.
    lacking
        Channels that a sent packet lacked: name, epoch, first tick, number.
    shots
        First sample of each shot's file: number of the shot from 0, epoch, tick.
    changes
        Changes of its channels: what, epoch, first tick of which it holds.
    """

    began_tick: int = 0
    sent_ticks: Ticks = field(default_factory=Ticks)
    lost_ticks: Ticks = field(default_factory=Ticks)
    doubled_ticks: Ticks = field(default_factory=Ticks)
    silent_ticks: Ticks = field(default_factory=Ticks)
    unplugged_ticks: Ticks = field(default_factory=Ticks)
    not_open_ticks: Ticks = field(default_factory=Ticks)
    lacking: list[tuple[str, int, int, int]] = field(default_factory=list)
    shots: list[tuple[int, int, int]] = field(default_factory=list)
    changes: list[tuple[str, int, int]] = field(default_factory=list)
    doubled: int = 0
    silent: int = 0
