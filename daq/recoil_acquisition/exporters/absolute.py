"""The absolute start of a shot, as far as a date with or without a zone can say it."""

from __future__ import annotations

import datetime as dt
import re

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
    offset = re.fullmatch(r"([+-])(\d\d):(\d\d)", start.zone)
    if start.zone == "UTC":
        return moment.replace(tzinfo=dt.UTC)
    if offset is None:
        return moment
    sign = -1 if offset[1] == "-" else 1
    try:
        zone = dt.timezone(sign * dt.timedelta(hours=int(offset[2]), minutes=int(offset[3])))
    except ValueError:
        return moment
    return moment.replace(tzinfo=zone)
