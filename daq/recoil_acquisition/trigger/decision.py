"""Decisions of a trigger, with the reason where something was none."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from recoil_acquisition.quantities.declaration import STRICT


class Suppression(StrEnum):
    """Why a trigger was none; the values stand in the records of sessions and shots, and so stay as they are."""

    HOLDOFF = "within the holdoff of the last trigger"
    WITHIN_POST = "within the post time of the last trigger"
    NOT_ARMED = "not armed"
    BEYOND_AT_ARM = "beyond the level without having been below the rearm level since arming"
    TOO_LATE = "its channel lagged: a later trigger was decided before"
    NO_MANUAL = "manual triggers are switched off"


MANUAL = -1
"""Place of a manual trigger, which belongs to no condition and no sample."""

Outcome = Literal["trigger", "extension", "suppressed"]


@dataclass(frozen=True)
class Decision:
    """A trigger, or why something was none.

    Attributes
    ----------
    time_s
        Instant of the sample that decided.
    outcome
        Outcome: ``trigger``, by which a shot begins, ``extension``, by which the post time starts anew, or
        ``suppressed``.
    reason
        `Suppression` of a suppressed trigger, else empty.
    channel
        Name of the channel; empty if manual.
    condition
        Place of the condition in its trigger; `MANUAL` if manual.
    index
        Number of the sample in its channel, from 0 with the first that was fed; `MANUAL` if manual.
    value
        Value that was compared with the level: the sample, or its rate of change per second; None if manual.
    crossing_s
        Instant at which the straight line from the sample before crosses the level or border of an edge or window; else
        `time_s`.
    """

    __pydantic_config__ = STRICT

    time_s: float
    outcome: Outcome
    reason: str
    channel: str
    condition: int
    index: int
    value: float | None
    crossing_s: float
