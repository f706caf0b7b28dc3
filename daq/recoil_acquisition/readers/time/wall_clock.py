"""Wall-clock stamps printed in a table, and the seconds from the first of them."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.remark import Note, NoteCode

MOST_KNOWN = 100_000
"""Stamps that are remembered: coarse ones repeat from row to row."""

_MONTHS, _HOURS = 12, 12
"""Of a year, and of half a day."""
LEAST_ALIKE = 8
"""Stamps to each whole second, at least, for it to be worth looking at their fractions alone."""

_HALF = r"\s*([ap]\.?m\.?)"
_TIME = r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?(?:" + _HALF + ")?"
_ZONE = r"\s*(Z|UTC|[+-]\d{2}:?\d{2})?"
_ISO = re.compile(r"(\d{4})[-/](\d{1,2})[-/](\d{1,2})[T ]\s*" + _TIME + _ZONE, re.IGNORECASE)
_DOTTED = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})[T ,]\s*" + _TIME + _ZONE, re.IGNORECASE)
_SLASHED = re.compile(r"(\d{1,2})([-/])(\d{1,2})\2(\d{4})[T ,]\s*" + _TIME + _ZONE, re.IGNORECASE)
_DATED = re.compile(r"(?<!\d)\d{1,4}[-/.](\d{1,2}|[^\W\d]{3,9})[-/.]\d{2,4}(?![\d.])")
_OF_DAY = re.compile(_TIME, re.IGNORECASE)
_FRACTION = re.compile(r".*:\d{2}[.,](?P<digits>[0-9]{1,9})(?:" + _HALF + ")?" + _ZONE, re.IGNORECASE)
STAMP_FORMS = "yyyy-mm-dd hh:mm:ss, dd.mm.yyyy hh:mm:ss or mm/dd/yyyy hh:mm:ss, with am or pm or without"


class DateOrder(StrEnum):
    """Sign that tells which number of a date is the day."""

    STATED = "stated"
    """How it is written."""
    DAY_FIRST = "day first"
    MONTH_FIRST = "month first"
    """One of the numbers, which is no month."""
    OPEN = "open"
    """Nothing: both may be months."""


@dataclass(frozen=True)
class Stamp:
    """A printed wall-clock time.

    Attributes
    ----------
    second
        Date and time in whole seconds, without a zone; with the month first, where that is open.
    decimals
        Number of decimals that were printed.
    zone
        Zone: ``UTC``, an offset such as ``+02:00``, or ``unknown``.
    order
        Sign that tells the order of day and month.
    """

    second: dt.datetime
    fraction_ns: int
    decimals: int
    zone: str = "unknown"
    order: DateOrder = DateOrder.STATED

    def ordered(self, order: DateOrder) -> Stamp:
        """Return it by the order that other stamps have told."""
        if self.order is not DateOrder.OPEN or order is DateOrder.OPEN:
            return self
        second = self.second
        if order is DateOrder.DAY_FIRST:
            second = second.replace(month=second.day, day=second.month)
        return replace(self, second=second, order=order)

    @property
    def text(self) -> str:
        """ISO 8601 with as many decimals as were printed."""
        whole = self.second.isoformat(timespec="seconds")
        return f"{whole}.{self.fraction_ns:09d}"[: len(whole) + 1 + self.decimals] if self.decimals else whole


def parse_wall_clock(cell: str) -> Stamp:
    """Read a date and time: year first, or day, month and year with dots, or either of the two first with slashes.

    Raises
    ------
    ValueError
        If it is none, or no day of the calendar.
    """
    text, order = cell.strip(), DateOrder.STATED
    if (match := _ISO.fullmatch(text)) is not None:
        year, month, day, *rest = match.groups()
    elif (match := _DOTTED.fullmatch(text)) is not None:
        day, month, year, *rest = match.groups()
    elif (match := _SLASHED.fullmatch(text)) is not None:
        month, _, day, year, *rest = match.groups()
        order = _order(int(month), int(day))
        if order is DateOrder.DAY_FIRST:
            day, month = month, day
    else:
        raise ValueError(f"{text[:40]!r} is not a stamp {STAMP_FORMS}")
    hour, minute, second, fraction, half, zone = rest
    if second == "60":
        raise ValueError(f"{text[:40]!r} is a leap second, behind which stamps cannot be counted: export relative time")
    instant = dt.datetime(int(year), int(month), int(day), hour_of_day(hour, half), int(minute), int(second))
    return Stamp(instant, nanoseconds(fraction), len(fraction or ""), _zone(zone), order)


def _order(first: int, second: int) -> DateOrder:
    """Return which of the first two numbers of a date is the month, where only one of them can be."""
    if first == second:
        return DateOrder.STATED
    if max(first, second) <= _MONTHS:
        return DateOrder.OPEN
    return DateOrder.MONTH_FIRST if second > _MONTHS else DateOrder.DAY_FIRST


def hour_of_day(hour: str, half: str | None) -> int:
    """Return the hour from midnight of one that may be counted from noon.

    Parameters
    ----------
    half
        ``am`` or ``pm``, with dots or without; None where hours are counted through.

    Raises
    ------
    ValueError
        If there is no such hour in half a day.
    """
    if half is None:
        return int(hour)
    if not 1 <= int(hour) <= _HOURS:
        raise ValueError(f"the hour {hour} {half} is none of half a day")
    return int(hour) % _HOURS + _HOURS * (half[0] in "pP")


def is_wall_clock(cell: str) -> bool:
    """Return whether a cell is a stamp that `parse_wall_clock` reads."""
    try:
        parse_wall_clock(cell)
    except ValueError:
        return False
    return True


def parse_time_of_day(cell: str) -> Stamp:
    """Read ``hh:mm:ss`` with or without a fraction and ``am`` or ``pm``, on the first day of the calendar.

    Raises
    ------
    ValueError
        If it is none.
    """
    match = _OF_DAY.fullmatch(cell.strip())
    if match is None:
        raise ValueError(f"{cell[:40]!r} is not a time hh:mm:ss")
    hour, minute, second, fraction, half = match.groups()
    instant = dt.datetime(1, 1, 1, hour_of_day(hour, half), int(minute), int(second))
    return Stamp(instant, nanoseconds(fraction), len(fraction or ""))


def is_dated(text: str) -> bool:
    """Return whether a text seems to hold a date, in whatever order."""
    return _DATED.search(text) is not None


def about_unread_start(name: str, text: str) -> Note:
    """Return the note on a date that a file states and that is not the recording's start, with the reason."""
    try:
        stamp = parse_wall_clock(text)
    except ValueError:
        why = "which is not understood"
    else:
        why = "which is not taken for it" if stamp.order is not DateOrder.OPEN else f"which is {two_dates(stamp)}"
    return Note(NoteCode.TIME, None, f"the file states {name} = {text[:60]!r}, {why}: the start is not known")


def two_dates(stamp: Stamp) -> str:
    """Return the two days that a date may be whose order is open."""
    return f"{stamp.second.date()} or {stamp.ordered(DateOrder.DAY_FIRST).second.date()}"


def is_time_of_day(cell: str) -> bool:
    """Return whether a cell is a time that `parse_time_of_day` reads."""
    try:
        parse_time_of_day(cell)
    except ValueError:
        return False
    return True


def nanoseconds(fraction: str | None) -> int:
    """Return the nanoseconds that the digits behind a decimal mark say."""
    return int((fraction or "").ljust(9, "0"))


def _zone(text: str | None) -> str:
    if text is None:
        return "unknown"
    if text.upper() in ("Z", "UTC"):
        return "UTC"
    return f"{text[:3]}:{text[-2:]}"


def _ahead_s(zone: str) -> int:
    """Return how much a zone as `Stamp` has it is ahead of UTC, s."""
    if zone == "UTC":
        return 0
    hours, minutes = zone[1:].split(":")
    return (3600 * int(hours) + 60 * int(minutes)) * (-1 if zone[0] == "-" else 1)


class Stamps:
    """Stamps of a table, turned into seconds from the first of them.

    Parameters
    ----------
    parse
        Function from a cell to a `Stamp`; ValueError if it is none.

    Attributes
    ----------
    resolution_s
        Last printed digit, s.
    """

    def __init__(self, parse: Callable[[str], Stamp]) -> None:
        self._parse = parse
        self._known: dict[str, float] = {}
        self.first: Stamp | None = None
        self._order = DateOrder.OPEN
        self.resolution_s = 1.0

    @property
    def start(self) -> Stamp | None:
        """The first stamp of all, once others have told the order of its date where it does not; else None."""
        return None if self.first is None or self.first.order is DateOrder.OPEN else self.first

    def seconds(self, cells: Sequence[str]) -> NDArray[np.float64]:
        """Return seconds from the first stamp of all, shape (n_cells,).

        Raises
        ------
        ValueError
            With the row as ``args[1]``, if a cell is no stamp, or of another zone than the first, or of another date
            while the order of day and month is open.
        """
        regular = self._regular(cells)
        if regular is not None:
            return regular
        seconds = np.empty(len(cells))
        for i, cell in enumerate(cells):
            value = self._known.get(cell)
            if value is None:
                try:
                    value = self._seconds(self._parse(cell))
                except (ValueError, OverflowError) as error:
                    raise ValueError(str(error), i) from error
                if len(self._known) >= MOST_KNOWN:
                    self._known.clear()
                self._known[cell] = value
            seconds[i] = value
        return seconds

    def _regular(self, cells: Sequence[str]) -> NDArray[np.float64] | None:
        """Return seconds of stamps that are alike but for the digits of their fraction; None if they are not.

        Of rows that follow one another few differ in anything else: each that does is parsed, and of the others the
        fraction is read as the number that its digits are.
        """
        if not cells:
            return None
        parts = _FRACTION.fullmatch(cells[0])
        if parts is None:
            return None
        low, high = parts.span("digits")
        table = np.array(cells)
        length = table.dtype.itemsize // table.dtype.alignment
        if length != len(cells[0]):
            return None
        codes = table.view(np.uint32).reshape(len(cells), length)
        # of what is no digit the difference is beyond 9: it has no sign
        digits = codes[:, low:high] - np.uint32(ord("0"))
        around = [*range(low - 1, low), *range(high, length)]
        if (digits > 9).any() or (codes[:, around] != codes[0, around]).any():
            return None
        new = np.flatnonzero((codes[1:, :low] != codes[:-1, :low]).any(axis=1)) + 1
        if new.size * LEAST_ALIKE > len(cells):
            return None
        places = 10 ** np.arange(8, 8 - (high - low), -1, dtype=np.int64)
        fractions_ns = digits.astype(np.int64) @ places
        starts = [0, *new.tolist()]
        seconds_ns = np.empty(len(starts), np.int64)
        for i, start in enumerate(starts):
            try:
                seconds_ns[i] = self._nanoseconds(self._parse(cells[start])) - fractions_ns[start]
            except (ValueError, OverflowError) as error:
                raise ValueError(str(error), start) from error
        return np.asarray((np.repeat(seconds_ns, np.diff([*starts, len(cells)])) + fractions_ns) / 1e9)

    def _seconds(self, stamp: Stamp) -> float:
        return self._nanoseconds(stamp) / 1e9

    def _nanoseconds(self, stamp: Stamp) -> int:
        if stamp.order in (DateOrder.DAY_FIRST, DateOrder.MONTH_FIRST) and stamp.order is not self._order:
            if self._order is not DateOrder.OPEN:
                raise ValueError("day and month change places")
            self._order = stamp.order
        stamp = stamp.ordered(self._order)
        self.first = (self.first or stamp).ordered(self._order)
        if stamp.order is DateOrder.OPEN and stamp.second.date() != self.first.second.date():
            raise ValueError("the date changes, and no day above 12 tells whether day or month is first")
        ahead_s = 0
        if stamp.zone != self.first.zone:
            if "unknown" in (stamp.zone, self.first.zone):
                raise ValueError(f"the zone changes from {self.first.zone} to {stamp.zone}")
            ahead_s = _ahead_s(stamp.zone) - _ahead_s(self.first.zone)
        self.resolution_s = min(self.resolution_s, 10.0**-stamp.decimals)
        whole = stamp.second - self.first.second
        return (
            (whole.days * 86400 + whole.seconds - ahead_s) * 1_000_000_000 + stamp.fraction_ns - self.first.fraction_ns
        )
