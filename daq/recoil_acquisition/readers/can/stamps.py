"""Stamps of logs that do not say from when they count."""

from __future__ import annotations

from recoil_acquisition.readers.can.frames import CanFrames, FrameList
from recoil_acquisition.timebase import WALL_CLOCK_NS, AbsoluteStart


def start_of_stamps(found: FrameList) -> tuple[CanFrames, AbsoluteStart | None]:
    """Return a log's frames, and when their time zero was.

    Returns
    -------
    frames : CanFrames
        Their time counts from the first frame if its stamp is that of a clock, else it is as stored.
    start : AbsoluteStart or None
        The first frame's stamp if it is that of a clock.
    """
    frames, zero_ns = found.frames(from_first=True)
    if zero_ns < WALL_CLOCK_NS:
        return found.frames()[0], None
    return frames, AbsoluteStart.since_1970(zero_ns, "UTC", "stamp of the first frame, taken as seconds since 1970")
