"""The absolute start of a shot, as far as a date with or without a zone can say it."""

from __future__ import annotations

import datetime as dt

from recoil_acquisition.timebase import AbsoluteStart


def stated_start(start: AbsoluteStart | None) -> dt.datetime | None:
    """Return the start, with its zone where it is known; None if there is none, or it is no ISO 8601."""
    if start is None:
        return None
    try:
        moment = dt.datetime.fromisoformat(start.text)
    except ValueError:
        return None
    if moment.tzinfo is not None:
        return moment
    if start.zone == "UTC":
        return moment.replace(tzinfo=dt.UTC)
    try:
        return moment.replace(tzinfo=dt.datetime.strptime(start.zone, "%z").tzinfo)
    except ValueError:
        return moment
