"""Instants on one clock."""

from __future__ import annotations

import datetime as dt
import math
import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.read_only import ReadOnlyArrays

WALL_CLOCK_NS = 10**18
"""Stamp of September 2001, beyond which a clock counts from 1970, since no other counts 31 years."""

_FRACTION = re.compile(r"[.,](\d+)")
"""Digits behind the second of a time of ISO 8601, of which a `datetime` keeps six."""

FIRST_YEAR, LAST_YEAR = 1981, 2100
"""Years of which a start may be."""
_NEAR_WHOLE, _NEARLY_ALL = 0.25, 0.75
"""Share of a step that a step is near a whole multiple of it, and share of the steps that must be."""
_SHORT = 2
"""Multiples of a step by which it is found."""
_MOST_ROUNDS, _SETTLED = 5, 1e-9
"""Rounds of the fit of a step, and the relative change at which it ends."""
_STRETCHES, _LEAST_STRETCH = 64, 16
"""Stretches of a record whose mean steps are compared, and the least steps of one."""
_LEAST_OF_EITHER = 8
"""Number of steps of either length of rounded stamps below which they may be as many lost samples."""
_COARSE, _WHOLE_TICKS = 0.02, 0.01
"""Share of a step that a tick is at the least, and of a tick that a step may be off a number of them."""
_MOST_LOST = 2.0
"""Mean step of a record over its beat: beyond, most of what the beat has room for was never there, as in bursts."""


@dataclass(frozen=True)
class AbsoluteStart:
    """The instant of a source's relative time zero, as far as the source says.

    Three facts that are kept apart because instruments mix them up: the relative time that the
    samples carry, the wall-clock time of its zero, and where that wall-clock time came from.

    Attributes
    ----------
    text
        Date and time, ISO 8601, without a zone unless the source states one.
    zone
        Zone: ``UTC``, an offset such as ``+02:00``, or ``unknown``.
    origin
        Place where it was read, for example ``first row of the time column``.
    locked_to
        Lock of the clock in the words of the instrument, such as ``PTP``; empty where it says nothing.
    """

    text: str
    zone: str
    origin: str
    locked_to: str = ""

    @classmethod
    def since_1970(cls, time_ns: int, zone: str, origin: str) -> AbsoluteStart | None:
        """Return the start so many nanoseconds after 1970, to the microsecond; None if no calendar has it."""
        try:
            instant = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=time_ns // 1000)
        except OverflowError:
            return None
        return cls(instant.isoformat(timespec="microseconds"), zone, origin)

    @classmethod
    def at(cls, instant: dt.datetime, origin: str, timespec: str = "auto") -> AbsoluteStart:
        """Return the start at an instant, with its zone if it has one; ``timespec`` as of ``isoformat``."""
        offset = instant.utcoffset()
        zone = "unknown" if offset is None else str(dt.timezone(offset)).removeprefix("UTC") or "UTC"
        return cls(instant.replace(tzinfo=None).isoformat(timespec=timespec), zone, origin)

    @property
    def is_doubtful(self) -> bool:
        """Whether no instrument can have started then: a clock that was never set, or a field that was never filled.

        Clocks count from 1601, 1904, 1970 or 1980 and fill what they cannot state with the year 9999.
        """
        moment = self.moment
        return moment is not None and not FIRST_YEAR <= moment.year <= LAST_YEAR

    @property
    def exact_ns(self) -> tuple[int, int] | None:
        """The start in ns since 1970, and the ns to which it is given; None if it is no ISO 8601.

        It counts in UTC; one whose zone is unknown counts in that zone.
        """
        moment, digits = self.moment, _FRACTION.search(self.text)
        if moment is None:
            return None
        since = moment.replace(tzinfo=moment.tzinfo or dt.UTC) - dt.datetime(1970, 1, 1, tzinfo=dt.UTC)
        fraction = "" if digits is None else digits.group(1)[:9]
        seconds = since.days * 86_400 + since.seconds
        return 10**9 * seconds + int(fraction.ljust(9, "0")), 10 ** (9 - len(fraction))

    @property
    def moment(self) -> dt.datetime | None:
        """The start with its zone, as far as that is known; None if it is no ISO 8601."""
        try:
            moment = dt.datetime.fromisoformat(self.text)
        except ValueError:
            return None
        if moment.tzinfo is not None:
            return moment
        if self.zone == "UTC":
            return moment.replace(tzinfo=dt.UTC)
        try:
            return moment.replace(tzinfo=dt.datetime.strptime(self.zone, "%z").tzinfo)
        except ValueError:
            return moment


@dataclass(frozen=True, eq=False)
class TimeBase(ReadOnlyArrays):
    """Instants on one clock, in seconds, uniform or stamped.

    Attributes
    ----------
    clock
        Name of the clock, which is the name of the source.
    start_s
        First instant on that clock.
    step_s
        Step of a uniform time base; None if it is stamped.
    count
        Number of instants.
    stamps_s : ndarray of float64, shape (count,), or None
        The instants of a stamped time base, strictly increasing.
    absolute_start
        Instant of the clock's zero; None if the source does not say.

    Raises
    ------
    ValueError
        If the instants are not finite and strictly increasing in float64, or contradict each other.
    """

    clock: str
    start_s: float
    step_s: float | None
    count: int
    stamps_s: NDArray[np.float64] | None = None
    absolute_start: AbsoluteStart | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.step_s is None) == (self.stamps_s is None):
            raise ValueError("a time base is either uniform (step_s) or stamped (stamps_s)")
        if self.count < 0:
            raise ValueError(f"count must not be negative, not {self.count!r}")
        if not math.isfinite(self.start_s):
            raise ValueError(f"start_s must be finite, not {self.start_s!r}")
        if self.step_s is not None:
            self._check_step(self.step_s)
        if self.stamps_s is not None:
            self._check_stamps(self.stamps_s)

    def _check_step(self, step_s: float) -> None:
        if not 0 < step_s < math.inf:
            raise ValueError(f"step_s must be positive and finite, not {step_s!r}")
        end_s = self.start_s + step_s * max(self.count - 1, 0)
        if self.count > 1 and not step_s > 2 * math.ulp(max(abs(self.start_s), abs(end_s))):
            raise ValueError(
                f"float64 cannot distinguish instants {step_s!r} s apart at {end_s!r} s; shift start_s towards zero"
            )

    def _check_stamps(self, stamps_s: NDArray[np.float64]) -> None:
        if stamps_s.dtype != np.float64:
            raise ValueError(f"stamps_s must be float64, not {stamps_s.dtype}")
        if stamps_s.shape != (self.count,):
            raise ValueError(f"stamps_s must have shape ({self.count},), not {stamps_s.shape}")
        if not np.all(np.isfinite(stamps_s)):
            raise ValueError("stamps_s must be finite")
        if not np.all(np.diff(stamps_s) > 0):
            raise ValueError("stamps_s must increase strictly")
        if stamps_s.size and stamps_s[0] != self.start_s:
            raise ValueError(f"start_s is {self.start_s!r}, but the first of stamps_s is {float(stamps_s[0])!r}")

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
        start_s = float(stamps.flat[0]) if stamps.size else 0.0
        return cls(clock, start_s, None, int(stamps.size), stamps, absolute_start)

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """All instants, shape (count,), seconds on this clock."""
        if self.stamps_s is not None:
            return self.stamps_s
        return self.start_s + float(self.step_s or 0.0) * np.arange(self.count, dtype=np.float64)

    @property
    def end_s(self) -> float:
        """Last instant, seconds on this clock."""
        if self.stamps_s is not None or self.step_s is None:
            return float(self.times_s[-1]) if self.count else self.start_s
        # as `times_s` has it, without making all of them
        return float(self.start_s + self.step_s * np.float64(max(self.count - 1, 0)))

    @cached_property
    def rate_hz(self) -> float:
        """Samples per second: exact if uniform, by `usual_step_s` if stamped, NaN below two samples."""
        if self.step_s is not None:
            return 1.0 / self.step_s
        if self.count < 2:
            return float("nan")
        return 1.0 / usual_step_s(self.times_s)

    def span(self, start_s: float, stop_s: float) -> tuple[int, int]:
        """Return the first instant's number from `start_s` on and the first from `stop_s` on."""
        if self.stamps_s is not None:
            first, stop = np.searchsorted(self.stamps_s, (start_s, stop_s), side="left")
            return int(first), int(max(first, stop))
        first, stop = (self._number_from(instant_s) for instant_s in (start_s, stop_s))
        return first, max(first, stop)

    def _number_from(self, instant_s: float) -> int:
        """Return the number of the first instant of a uniform time base that is not before another."""
        step_s = float(self.step_s or 0.0)
        near = (instant_s - self.start_s) / step_s
        if near > self.count:
            return self.count
        number = math.floor(near) - 1 if near > 1.0 else 0
        while number < self.count and self.start_s + step_s * number < instant_s:
            number += 1
        return number

    def part(self, first: int, stop: int) -> TimeBase:
        """Return the instants from one number to before another, ``0 <= first <= stop <= count``."""
        if self.stamps_s is not None:
            return TimeBase.stamped(self.clock, self.stamps_s[first:stop], self.absolute_start)
        step_s = float(self.step_s or 0.0)
        return TimeBase.uniform(self.clock, self.start_s + step_s * first, step_s, stop - first, self.absolute_start)

    def every(self, rows: slice) -> TimeBase:
        """Return the instants of every so many numbers, ``0 <= start < count`` and ``step`` above 0."""
        if self.stamps_s is not None:
            return TimeBase.stamped(self.clock, self.stamps_s[rows], self.absolute_start)
        first, stop, apart = rows.indices(self.count)
        step_s = float(self.step_s or 0.0)
        count = len(range(first, stop, apart))
        return TimeBase.uniform(self.clock, self.start_s + step_s * first, step_s * apart, count, self.absolute_start)

    def shifted(self, offset_s: float, absolute_start: AbsoluteStart | None) -> TimeBase:
        """Return the instants later by an offset, with another absolute start."""
        if self.step_s is None:
            return TimeBase.stamped(self.clock, self.times_s + offset_s, absolute_start)
        return TimeBase.uniform(self.clock, self.start_s + offset_s, self.step_s, self.count, absolute_start)

    def is_identical(self, other: TimeBase) -> bool:
        """Return whether two time bases say the same: clock, instants, how they are given, absolute start."""
        return (
            (self.clock, self.start_s, self.step_s, self.count, self.absolute_start)
            == (other.clock, other.start_s, other.step_s, other.count, other.absolute_start)
        ) and (
            self.stamps_s is other.stamps_s
            or (
                self.stamps_s is not None
                and other.stamps_s is not None
                and bool(np.array_equal(self.stamps_s, other.stamps_s))
            )
        )

    def same_instants(self, other: TimeBase) -> bool:
        """Return whether two time bases are the same instants on the same clock."""
        return (
            self.clock == other.clock
            and self.count == other.count
            and bool(np.array_equal(self.times_s, other.times_s))
        )


def usual_step_s(times_s: NDArray[np.float64]) -> float:
    """Return the step between neighbouring instants, by all of them: jitter of stamps leaves nothing on it.

    Where nearly all steps lie near whole multiples of one it is the mean of the short ones. Where they do not, or
    stamps come in bursts, it is the median over stretches of the record, which a few gaps do not move.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n,), n at least 2
        Instants, strictly increasing.
    """
    rounded_s = rounded_step_s(times_s)
    if rounded_s is not None:
        return rounded_s
    steps = np.diff(times_s)
    edges = np.linspace(0, steps.size, max(1, min(_STRETCHES, steps.size // _LEAST_STRETCH)) + 1).astype(np.int64)
    mean_s = float(np.median(np.diff(times_s[edges]) / np.diff(edges)))
    beat_s = _beat_s(steps)
    return mean_s if beat_s is None or mean_s > _MOST_LOST * beat_s else beat_s


def _beat_s(steps_s: NDArray[np.float64]) -> float | None:
    """Return the step that nearly all steps are whole multiples of; None without one."""
    step_s = float(np.median(steps_s))
    for _ in range(_MOST_ROUNDS):
        with np.errstate(over="ignore", invalid="ignore"):
            ratio = steps_s / step_s
            whole = np.round(ratio)
            near = (whole >= 1) & (np.abs(ratio - whole) <= _NEAR_WHOLE)
        if np.count_nonzero(near) < _NEARLY_ALL * steps_s.size:
            return None
        # longer ones say little of the step, and may be miscounted
        near &= whole <= _SHORT
        if not near.any():
            return None
        before, step_s = step_s, float(steps_s[near].sum() / whole[near].sum())
        if abs(step_s - before) <= _SETTLED * step_s:
            break
    return step_s


def rounded_step_s(times_s: NDArray[np.float64]) -> float | None:
    """Return the step of even instants whose coarse rounding the stamps are; None otherwise.

    Rounded, steps are two neighbouring numbers of ticks; one tick and two look like samples that were lost. But a count
    of the stamps then runs along them within a tick, which losses do not allow unless they are regular too.

    Parameters
    ----------
    times_s : ndarray of float64, shape (n,)
        Instants, strictly increasing.
    """
    steps = np.diff(times_s)
    if steps.size < 2 * _LEAST_OF_EITHER:
        return None
    short_s, long_s = float(steps.min()), float(steps.max())
    tick_s = long_s - short_s
    longer = int(np.count_nonzero(steps > short_s + 0.5 * tick_s))
    if not _LEAST_OF_EITHER <= longer <= steps.size - _LEAST_OF_EITHER or tick_s < _COARSE * short_s:
        return None
    ticks = np.array([short_s / tick_s, *np.unique((steps - short_s) / tick_s)])
    if np.any(np.abs(ticks - np.round(ticks)) > _WHOLE_TICKS):
        return None
    numbers = np.arange(times_s.size) - 0.5 * steps.size
    step_s = float(numbers @ (times_s - times_s.mean()) / (numbers @ numbers))
    beyond = times_s - times_s[0] - step_s * numbers
    return step_s if float(np.ptp(beyond)) <= (1.0 + 5 * _WHOLE_TICKS) * tick_s else None
