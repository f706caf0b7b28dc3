"""The day on which calibrations must be in force: that of the shot, as far as anything states it."""

from __future__ import annotations

import datetime as dt
from contextlib import suppress
from enum import StrEnum
from typing import NamedTuple


class DayOf(StrEnum):
    """What happened on a day by which calibrations are judged; its value is written into a shot's history."""

    START = "start"
    """The shot was fired: its files or its trigger say so."""
    GIVEN = "given"
    """The shot was fired: a person says so."""
    INGEST = "ingest"
    """The shot was ingested, and nothing states when it was fired."""
    TODAY = "today"
    """Somebody looks, before the shot."""


_WHAT = {
    DayOf.START: "the shot of {on}",
    DayOf.GIVEN: "the shot of {on}",
    DayOf.INGEST: "the ingest of {on} (nothing states when the shot was fired)",
    DayOf.TODAY: "today, {on}",
}


class CalibrationDay(NamedTuple):
    """A day on which calibrations must be in force, and what happened on it."""

    on: dt.date
    of: DayOf

    @classmethod
    def of_start(cls, started: str | None, otherwise: DayOf, on: dt.date | None = None) -> CalibrationDay:
        """Return the day on which a shot began, where a start is stated.

        Parameters
        ----------
        started
            Start, ISO 8601; empty or None if nothing states it. The day is that of its own zone.
        otherwise, on
            Day that is taken if nothing does: what it is of, and the day, today if left out.
        """
        with suppress(ValueError):
            return cls(dt.date.fromisoformat((started or "")[:10]), DayOf.START)
        return cls(dt.date.today() if on is None else on, otherwise)

    def faults(self, calibrated: dt.date | None, due: dt.date | None) -> tuple[str, str]:
        """Say why a calibration does not cover the day.

        Returns
        -------
        due, calibrated : str
            Sentences on the day until which it holds, and on that from which it does; empty if nothing is wrong.
        """
        late = early = ""
        if due is not None and due < self.on:
            late = f"calibration was due {due}, {_days(self.on - due)} before {self}"
        if calibrated is not None and calibrated > self.on:
            early = f"calibrated {calibrated}, {_days(calibrated - self.on)} after {self}"
        return late, early

    def __str__(self) -> str:
        return _WHAT[self.of].format(on=self.on)


def _days(apart: dt.timedelta) -> str:
    return f"{apart.days} day{'' if apart.days == 1 else 's'}"
