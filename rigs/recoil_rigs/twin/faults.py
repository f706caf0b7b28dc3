"""Faults between a virtual sensor and the host: declared before, and reported afterwards as truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any


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
        for name in ("lost_frames", "error_frames", "dropped_bytes", "flipped_bytes"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be a share from 0 to below 1, not {getattr(self, name)!r}")
        for name in ("stalls", "unplugged"):
            rows: Sequence[Interval] = getattr(self, name)
            if any(later.at_s < earlier.end_s for earlier, later in pairwise(rows)):
                raise ValueError(f"{name} must follow each other, not overlap: {rows!r}")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Faults:
        """Read faults from a table, such as ``{ lost_frames = 0.01, stalls = [[1.0, 0.5]] }``.

        Raises
        ------
        ValueError
            With the key that is at fault.
        """
        known = {one.name for one in fields(cls)}
        rows = {"stalls": Interval, "unplugged": Interval, "clock_steps": ClockStep}
        values: dict[str, Any] = {}
        for key, value in table.items():
            if key not in known:
                raise ValueError(f"there is no fault {key!r}; there are {', '.join(sorted(known))}")
            try:
                values[key] = tuple(rows[key](*map(float, row)) for row in value) if key in rows else float(value)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{key}: {error}") from error
        return cls(**values)


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
