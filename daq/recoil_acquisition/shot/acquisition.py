"""Record of a live acquisition: its window, the trigger's decisions, and what each device met meanwhile.

It stands in the declaration of a live shot's capture, so that a shot that is ingested again, or recovered after a
crash, says the same. It is JSON with the schema `SCHEMA`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from recoil_acquisition.files.shot_name import check_shot_name
from recoil_acquisition.quantities.declaration import STRICT, checked

SCHEMA = "recoil-daq/acquisition/1"
AT_TRIGGER = "host clock at the trigger"
"""Origin of the date of a live shot, see `recoil_acquisition.shot.shot.Shot`."""


@dataclass(frozen=True)
class TriggerDecision:
    """A trigger, an extension, or why something was none; see `recoil_acquisition.trigger.decision`.

    Attributes
    ----------
    time_s
        Instant of the decision, from the shot's trigger.
    value
        Value that was compared with the level, SI.
    """

    __pydantic_config__ = STRICT

    time_s: float
    outcome: str
    reason: str
    channel: str
    value: float | None


@dataclass(frozen=True)
class AcquiredEvent:
    """Something that happened to a device: at a time from the shot's trigger, what, and in which words."""

    __pydantic_config__ = STRICT

    time_s: float
    name: str
    detail: str


@dataclass(frozen=True)
class AcquiredSource:
    """Data and events that one live source delivered to a shot.

    Attributes
    ----------
    file
        Name of its capture; empty if it delivered nothing.
    blocks, bytes
        Numbers of blocks and of bytes of data within the shot.
    pre_s
        Pre-time that the source has; None if it delivered nothing.
    late
        Whether it had not delivered the whole span when waiting for it ended, or something of it was read late.
    late_s
        Longest time that data of the source may have waited before it was read.
    bad, reopened, error_frames
        Counts as in `recoil_acquisition.devices.device.Counters`, from `counted_from_s` on.
    queue_high_water
        Most frames, or bytes of a port, that waited at once since arming.
    counted_from_s
        Instant from which on the counts hold, up to the end of the shot; from the shot's trigger.
    """

    __pydantic_config__ = STRICT

    name: str
    kind: str
    file: str
    blocks: int
    bytes: int
    pre_s: float | None
    late: bool
    late_s: float
    bad: int
    reopened: int
    error_frames: int
    kernel_drops: int | None
    queue_high_water: int
    counted_from_s: float
    events: tuple[AcquiredEvent, ...]


@dataclass(frozen=True)
class Acquisition:
    """Acquisition of one shot.

    Attributes
    ----------
    trigger_ns
        Time of the host's monotonic clock at the trigger, ns.
    trigger_utc
        Time of the host's wall clock at the trigger, ISO 8601, UTC.
    pre_s, post_s
        Times that the trigger asks for; with post time extension the shot is longer.
    pre_actual_s
        Pre-time that every source has.
    duration_s
        Time from the first instant kept to the end.
    decisions
        Decisions of the trigger within the shot, the suppressed ones among them.
    unseen_bytes
        Bytes that were recorded and that the trigger did not look at because it fell behind.
    lost_records
        Records of the journal that are damaged or missing, known after a crash only.
    recovered
        Whether it was made from a journal that was left over.
    """

    __pydantic_config__ = STRICT

    shot: str
    rig: str
    trigger_ns: int
    trigger_utc: str
    pre_s: float
    post_s: float
    pre_actual_s: float
    duration_s: float
    decisions: tuple[TriggerDecision, ...]
    sources: tuple[AcquiredSource, ...]
    unseen_bytes: int = 0
    lost_records: int = 0
    recovered: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, with its schema."""
        return {"schema": SCHEMA, **asdict(self)}

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Acquisition:
        """Return what `to_json` was made from; ValueError if it is nothing of the kind."""
        if document.get("schema") != SCHEMA:
            raise ValueError(f"schema must be {SCHEMA!r}, not {document.get('schema')!r}")
        made = checked(cls, {key: value for key, value in document.items() if key != "schema"})
        check_shot_name(made.shot)
        for source in made.sources:
            if re.search(r"[/\\:\x00-\x1f]", source.file) or source.file in (".", ".."):
                raise ValueError(f"{source.file!r} is no name of a file beside it")
        return made
