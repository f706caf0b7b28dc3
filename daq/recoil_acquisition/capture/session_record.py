"""Declarations in the log of a live acquisition: its session, and the meaning of its records.

Records of a source carry its number, from 0 in the session's order. Those of the log itself say what the trigger
decided, and which shot became of it, so that a crash loses neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.devices.device import CAN, EVENT, IDLE, SERIAL, STREAM, Block, Device
from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.shot_name import check_shot_name
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.log.folder import Log
from recoil_acquisition.log.record import OWN, Kind, Record
from recoil_acquisition.quantities.declaration import STRICT, checked
from recoil_acquisition.trigger import Decision, Trigger

SCHEMA = "recoil-daq/live/1"

_OF_THE_LOG = ("schema", "spare")
"""Keys of a session that are not of `LiveRecord`."""

KINDS = {CAN: Kind.CAN, SERIAL: Kind.SERIAL, STREAM: Kind.STREAM, EVENT: Kind.EVENT, IDLE: Kind.IDLE}
"""Kind of a record, by that of the block in it."""

_BLOCKS = {number: kind for kind, number in KINDS.items()}


@dataclass(frozen=True)
class RecordedSource:
    """A source of a session.

    Attributes
    ----------
    name, kind
        Name and kind of the source.
    device
        Key of its `recoil_acquisition.live_kind.LiveKind`; empty of the one that is its kind's default.
    """

    __pydantic_config__ = STRICT

    name: str
    kind: str
    device: str = ""

    @classmethod
    def of(cls, name: str, kind: str, device: Mapping[str, Any] | None) -> RecordedSource:
        """Return what is recorded of a source with a ``device`` table."""
        live = live_kind_of(kind, device)
        return cls(name, kind, "" if live is None or live.is_default else live.key)


@dataclass(frozen=True)
class LiveRecord:
    """First record of a session's log.

    Attributes
    ----------
    rig_path
        Path of the rig file.
    databases
        Texts of the rig's CAN databases, by file name.
    anchor
        The host's two clocks when it was armed.
    """

    __pydantic_config__ = STRICT

    rig_name: str
    rig_text: str
    rig_path: str
    databases: Mapping[str, str]
    anchor: Anchor
    sources: tuple[RecordedSource, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, with its schema."""
        document = {"schema": SCHEMA, **asdict(self)}
        # a session of buses and ports is as earlier versions read it
        document["sources"] = [{k: v for k, v in asdict(one).items() if v or k != "device"} for one in self.sources]
        return document

    def number(self, source: str) -> int:
        """Return the number of a source; KeyError if there is none of this name."""
        for i, one in enumerate(self.sources):
            if one.name == source:
                return i
        raise KeyError(source)

    def block(self, record: Record) -> Block:
        """Return the block that a record of a source holds; StoreError if it is none of this session."""
        kind = _BLOCKS.get(record.kind)  # type: ignore[call-overload]
        if record.source >= len(self.sources) or kind is None:
            raise StoreError(f"record {record.number} of the journal is of source {record.source}, which is unknown")
        empty_ns = None if record.span_us is None else record.from_ns
        return Block(self.sources[record.source].name, record.host_ns, record.payload, kind, empty_ns)


def live_record_of(session: Mapping[str, Any], path: Path) -> LiveRecord:
    """Return what a log, or a capture of one, says of its session.

    Parameters
    ----------
    path
        File or folder to name in messages.

    Raises
    ------
    StoreError
        If it is of no live acquisition.
    """
    try:
        if session["schema"] != SCHEMA:
            raise ValueError(f"schema {session['schema']!r}")
        return checked(LiveRecord, {key: value for key, value in session.items() if key not in _OF_THE_LOG})
    except (KeyError, ValueError) as error:
        raise StoreError(f"is of no live acquisition: {error}", path=path, expected=f"a session {SCHEMA}") from error


@dataclass(frozen=True)
class CompleteShot:
    """A shot that the session knew to be complete, by its identifier and its trigger's time."""

    __pydantic_config__ = STRICT

    shot: str
    trigger_s: float

    def __post_init__(self) -> None:
        check_shot_name(self.shot)


@dataclass(frozen=True)
class Kept:
    """A stretch of a log that a person may want, and why.

    Attributes
    ----------
    first_s, last_s
        Instants of the first and the last event, on the host's monotonic clock.
    start_s, stop_s
        Span of the log that is kept.
    why
        Reason, such as ``p_brake crossed: not armed``.
    """

    __pydantic_config__ = STRICT

    first_s: float
    last_s: float
    start_s: float
    stop_s: float
    why: str

    @property
    def lasting(self) -> str:
        """The duration, in words."""
        return "once" if self.last_s == self.first_s else f"over {self.last_s - self.first_s:.3f} s"

    def within(self, spans: Iterable[tuple[float, float]]) -> bool:
        """Return whether all that happened lies within one of some spans (start_s, stop_s)."""
        return any(start <= self.first_s and self.last_s < stop for start, stop in spans)


def kept_of(decision: Decision, trigger: Trigger) -> Kept | None:
    """Return what is kept where something crossed and no shot began; None of an operator's own key."""
    if decision.outcome != "suppressed" or decision.value is None:
        return None
    at_s = decision.time_s
    return Kept(
        at_s, at_s, at_s - trigger.pre_s, at_s + trigger.post_s, f"{decision.channel} crossed: {decision.reason}"
    )


def longer(kept: Sequence[Kept], one: Kept) -> list[Kept]:
    """Return stretches with one more, which makes the last one longer if it follows on it for the same reason."""
    if kept and kept[-1].why == one.why and one.start_s <= kept[-1].stop_s:
        last = kept[-1]
        return [*kept[:-1], replace(last, last_s=one.last_s, stop_s=max(last.stop_s, one.stop_s))]
    return [*kept, one]


@dataclass(frozen=True)
class OperatorRecords:
    """Records of a log that no device gave.

    Attributes
    ----------
    kept
        Stretches that are kept for another reason than a decision.
    in_order
        Whether the session was closed in order.
    """

    decisions: tuple[Decision, ...]
    shots: tuple[CompleteShot, ...]
    kept: tuple[Kept, ...]
    in_order: bool


def operator_records(log: Log) -> OperatorRecords:
    """Return what a log holds that no device gave.

    Raises
    ------
    StoreError
        If one of these records is not what it should be.
    """
    decisions: list[Decision] = []
    shots: list[CompleteShot] = []
    kept: list[Kept] = []
    closed = False
    for record in log.records(OWN):
        try:
            if record.kind == Kind.DECISION:
                decisions.append(checked(Decision, record.said))
            elif record.kind == Kind.SHOT:
                shots.append(checked(CompleteShot, record.said))
            elif record.kind == Kind.KEPT:
                kept = longer(kept, checked(Kept, record.said))
            elif record.kind == Kind.CLOSED:
                closed = True
        except ValueError as error:
            raise StoreError(f"record {record.number} cannot be understood: {error}", path=log.folder) from error
    return OperatorRecords(tuple(decisions), tuple(shots), tuple(kept), closed)


def journal_name(wall_ns: int) -> str:
    """Return the name of a session's folder: its beginning in UTC."""
    import datetime as dt

    start = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=wall_ns // 1000)
    return start.strftime("%Y%m%dT%H%M%S.%fZ")


def wall_of_name(name: str) -> int | None:
    """Return the beginning that a session's folder is named after, ns since 1970; None if it is named otherwise."""
    import datetime as dt

    try:
        begun = dt.datetime.strptime(name, "%Y%m%dT%H%M%S.%fZ")
    except ValueError:
        return None
    return (begun - dt.datetime(1970, 1, 1)) // dt.timedelta(microseconds=1) * 1000


def reserve_bytes(devices: Iterable[Device], seconds: float) -> int:
    """Return the space that open devices need at most in a time."""
    return int(sum(device.bytes_per_s for device in devices) * seconds)


def session_folder(out: Path, wall_ns: int) -> Path:
    """Return where a session's journal stands: ``OUT/journal/<UTC time>``."""
    return out / "journal" / journal_name(wall_ns)
