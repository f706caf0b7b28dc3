"""Instants on one clock."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class AbsoluteStart:
    """When the relative time zero of a source was, as far as the source says.

    Three facts that are kept apart because instruments mix them up: the relative time that the
    samples carry, the wall-clock time of its zero, and where that wall-clock time came from.

    Attributes
    ----------
    text : str
        ISO 8601 without a zone unless the source states one.
    zone : str
        ``UTC``, an offset such as ``+02:00``, or ``unknown``.
    origin : str
        Where it was read, for example ``first row of the time column``.
    """

    text: str
    zone: str
    origin: str


@dataclass(frozen=True, eq=False)
class TimeBase:
    """Instants on one clock, in seconds, uniform or stamped.

    Attributes
    ----------
    clock : str
        Name of the clock, which is the name of the source.
    start_s : float
        First instant on that clock.
    step_s : float or None
        Step of a uniform time base; None if it is stamped.
    count : int
        Number of instants.
    stamps_s : ndarray of float64, shape (count,), or None
        The instants of a stamped time base, strictly increasing.
    absolute_start : AbsoluteStart or None
        When the clock's zero was; None if the source does not say.
    """

    clock: str
    start_s: float
    step_s: float | None
    count: int
    stamps_s: NDArray[np.float64] | None = None
    absolute_start: AbsoluteStart | None = None

    def __post_init__(self) -> None:
        if (self.step_s is None) == (self.stamps_s is None):
            raise ValueError("a time base is either uniform (step_s) or stamped (stamps_s)")
        if self.step_s is not None and not self.step_s > 0:
            raise ValueError(f"step_s must be positive, not {self.step_s!r}")
        if self.stamps_s is not None:
            if self.stamps_s.shape != (self.count,):
                raise ValueError(f"stamps_s must have shape ({self.count},), not {self.stamps_s.shape}")
            if np.any(~(np.diff(self.stamps_s) > 0)):
                raise ValueError("stamps_s must increase strictly")

    @classmethod
    def uniform(
        cls, clock: str, start_s: float, step_s: float, count: int, absolute_start: AbsoluteStart | None = None
    ) -> TimeBase:
        """Make a uniform time base."""
        return cls(clock, start_s, step_s, count, None, absolute_start)

    @classmethod
    def stamped(
        cls, clock: str, stamps_s: NDArray[np.float64], absolute_start: AbsoluteStart | None = None
    ) -> TimeBase:
        """Make a stamped time base from strictly increasing instants, shape (count,)."""
        stamps = np.ascontiguousarray(stamps_s, dtype=np.float64)
        start_s = float(stamps[0]) if stamps.size else 0.0
        return cls(clock, start_s, None, int(stamps.size), stamps, absolute_start)

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """All instants, shape (count,), seconds on this clock."""
        if self.stamps_s is not None:
            return self.stamps_s
        return self.start_s + float(self.step_s or 0.0) * np.arange(self.count)

    @property
    def end_s(self) -> float:
        """Last instant, seconds on this clock."""
        return float(self.times_s[-1]) if self.count else self.start_s

    @cached_property
    def rate_hz(self) -> float:
        """Samples per second: exact if uniform, from the median step if stamped, NaN below two samples."""
        if self.step_s is not None:
            return 1.0 / self.step_s
        if self.count < 2:
            return float("nan")
        return float(1.0 / np.median(np.diff(self.times_s)))

    def same_instants(self, other: TimeBase) -> bool:
        """Tell whether two time bases are the same instants on the same clock."""
        return (
            self.clock == other.clock
            and self.count == other.count
            and bool(np.array_equal(self.times_s, other.times_s))
        )
