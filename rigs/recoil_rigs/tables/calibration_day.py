"""The day on which calibrations must be in force: that of the shot, as far as anything states it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum
from typing import Any, NamedTuple

from recoil_acquisition.remark import Severity
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot

DAY = "day"
"""Parameter in a shot's history: day that calibrations had to cover when it was checked."""
DAY_OF = "day_of"
"""Parameter in a shot's history: what happened on that day; an earlier version took the day of the ingest."""


class DayOf(StrEnum):
    """Event on a day by which calibrations are judged; its value is written into a shot's history."""

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


_MOST = 3
"""Number of calibrations that a sentence names."""


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

    @classmethod
    def of_shot(cls, shot: Shot) -> CalibrationDay:
        """Return the day by which the calibrations of a shot are judged, as they were when it was ingested."""
        checked = next((step.parameters for step in reversed(shot.history) if step.what == "ingest"), {})
        with suppress(KeyError, ValueError):
            return cls(dt.date.fromisoformat(checked[DAY]), DayOf(checked[DAY_OF]))
        on = dt.date.fromisoformat(checked[DAY]) if DAY in checked else None
        return cls.of_start(shot.started, DayOf.INGEST, on)

    @classmethod
    def of_report(cls, document: Mapping[str, Any]) -> CalibrationDay | None:
        """Return the day by which a report judged its calibrations; that of its start for one that does not say so.

        Raises
        ------
        ValueError
            If something else stands there; None is returned where the report states neither.
        """
        if said := document.get("calibration_day"):
            return cls(dt.date.fromisoformat(said["on"]), DayOf(said["of"]))
        return cls.of_start(document["started"], DayOf.START) if document.get("started") else None

    def to_json(self) -> dict[str, str]:
        """Return JSON types."""
        return {"on": self.on.isoformat(), "of": self.of.value}

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


def calibrations_in_short(document: Mapping[str, Any]) -> str:
    """Say how many calibrations do not cover the day of a document's shot; empty if all do."""
    count = len(_uncovered(document))
    does = "a calibration does" if count == 1 else f"{count} calibrations do"
    return f"{does} not cover the day of the {_what_day(document)}" if count else ""


def _what_day(document: Mapping[str, Any]) -> str:
    """Name the day that a report's calibrations, or those of a campaign's shots, are judged by."""
    said = [one["calibration_day"] for one in (document, *document.get("shots", ())) if one.get("calibration_day")]
    is_of_ingest = bool(said) and all(one["of"] == DayOf.INGEST for one in said)
    return "ingest" if is_of_ingest else "shot"


def calibrations_in_words(document: Mapping[str, Any]) -> str:
    """Say which calibrations do not cover the day of a document's shot, the first of them; empty if all do."""
    found = _uncovered(document)
    more = f"; and {len(found) - _MOST} more" if len(found) > _MOST else ""
    return f"{calibrations_in_short(document)}: {'; '.join(found[:_MOST])}{more}" if found else ""


def _uncovered(document: Mapping[str, Any]) -> list[str]:
    return [
        str(one["text"])
        for one in document.get("findings") or ()
        if one.get("code") == Check.CALIBRATION and one.get("severity") == Severity.WARN
    ]
