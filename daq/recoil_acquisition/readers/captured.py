"""Sources of a capture of live acquisition: see `recoil_acquisition.log.capture`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.live_kind import LiveKind, live_kind_of
from recoil_acquisition.log.capture import Capture
from recoil_acquisition.log.record import DATA, Kind, Record

_OF_DEVICE = (*DATA, Kind.EVENT, Kind.IDLE)

LIVE = "live"
"""Kind of a file that may hold several sources of other kinds."""


@dataclass(frozen=True)
class CapturedEvent:
    """Something that happened to a device: when on the host's monotonic clock, what, and in which words."""

    host_ns: int
    name: str
    detail: str


@dataclass(frozen=True, eq=False)
class CapturedSource:
    """Records of one source in a capture.

    Attributes
    ----------
    device
        Key of its `recoil_acquisition.live_kind.LiveKind`; empty of the one that is its kind's default.
    records
        Records of the source in their order.
    anchor
        Instant on both clocks of the host; None if the session states none.
    incomplete
        Sign by which it shows that something of the source is missing; empty if nothing shows that.
    """

    name: str
    kind: str
    device: str
    records: tuple[Record, ...]
    anchor: Anchor | None
    incomplete: str

    @property
    def events(self) -> tuple[CapturedEvent, ...]:
        """Events of its device."""
        return tuple(event for record in self.records if (event := event_of(record)) is not None)

    @property
    def live_kind(self) -> LiveKind | None:
        """The kind of its device; None if no package that is installed has it."""
        return live_kind_of(self.kind, {self.device: None} if self.device else None)

    @property
    def delivered(self) -> bool:
        """Whether it has any data."""
        return any(record.kind in DATA for record in self.records)


def event_of(record: Record) -> CapturedEvent | None:
    """Return the event that a record says; None of one that says none."""
    if record.kind != Kind.EVENT:
        return None
    try:
        said = record.said
        return CapturedEvent(record.host_ns, str(said["event"]), str(said["detail"]))
    except (ValueError, KeyError):
        return None


def sources_of(capture: Capture) -> tuple[CapturedSource, ...]:
    """Return the sources that a capture's session names, with what it holds of them."""
    stated = capture.session.get("sources")
    anchor = _anchor_of(capture.session)
    sources = []
    for number, one in enumerate(stated if isinstance(stated, list) else ()):
        if isinstance(one, dict) and {"name", "kind"} <= one.keys():
            records = tuple(r for r in capture.of(number) if r.kind in _OF_DEVICE)
            lost, device = _missing(capture, number), str(one.get("device", ""))
            sources.append(CapturedSource(str(one["name"]), str(one["kind"]), device, records, anchor, lost))
    return tuple(sources)


def _missing(capture: Capture, number: int) -> str:
    lost = sum(loss.records for loss in capture.losses if loss.source == number)
    if lost:
        return f"{lost} of its records are missing or damaged"
    if capture.damages or capture.unfinished_bytes:
        return "the file is damaged or ends inside a record: it may have been cut"
    return ""


def _anchor_of(session: Mapping[str, Any]) -> Anchor | None:
    try:
        return Anchor(**{key: int(value) for key, value in session["anchor"].items()})
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        return None
