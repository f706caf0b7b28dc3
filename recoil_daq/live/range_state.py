"""State of the armed range at one instant: what the screen, the plain log and ``OUT/live.json`` show.

It is made in one place, of the acquisition, the shots and the watched folder, and nothing in it changes afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from recoil_acquisition.capture.status import ChannelStatus, SourceStatus, State
from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.shot import LiveShot, ShotState, losses_of
from recoil_daq.terminal.verdict_line import VerdictLine

SCHEMA = "recoil-daq/live/1"
NOTICES_OF_FILE = 10
"""Number of notices that ``live.json`` has: each is written again some times a second."""

OLD_S = 1.0
"""Silence of a live source, s, from which on something is wrong with it."""
NOT_UNDERSTOOD_S = 0.8
"""Time without a level of a source whose bytes come, s, from which on its bytes are not what the rig declares: a level
is of the last second."""

SourceState = Literal["live", "not understood", "silent", "lost", "stopped", "for files", "not open"]


@dataclass(frozen=True)
class RangeSource:
    """Source that a shot waits for.

    Attributes
    ----------
    state
        State: ``live``; ``not understood``, where bytes come and none of them has been good for longer than
        `NOT_UNDERSTOOD_S`; ``silent`` for longer than `OLD_S`; ``lost``, opened again as soon as its device is back;
        ``stopped`` by an error, or since the session ends; ``for files``, which come into the watched folder;
        ``not open``, left out of the session, or away though it may be.
    live
        Status of its device; None of a source that is not read live.
    last_file
        Name of the last file that was given to a shot; empty if there was none.
    awaited
        Names of the shots that wait for its file.
    growing
        Names and sizes, in bytes, of its files that have not stopped growing.
    waited_s, left_s
        Time for which the shot that has waited longest waits for its file, and for how much longer it will, s; None if
        none waits.
    """

    name: str
    kind: str
    state: SourceState
    live: SourceStatus | None = None
    last_file: str = ""
    awaited: tuple[str, ...] = ()
    growing: tuple[tuple[str, int], ...] = ()
    waited_s: float | None = None
    left_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        live = self.live
        read = {} if live is None else {
            "rate_hz": live.rate_hz, "age_s": live.age_s, "losses": losses_of(live.counters),
            "counters": asdict(live.counters), "error": live.error,
        }  # fmt: skip
        return {
            "name": self.name, "kind": self.kind, "state": self.state, **read, "last_file": self.last_file,
            "awaited": list(self.awaited), "growing": [{"file": name, "bytes": size} for name, size in self.growing],
            "waited_s": self.waited_s, "left_s": self.left_s,
        }  # fmt: skip


class FigureCode(StrEnum):
    """Code of a figure; the values are the words over its column."""

    BREECH = "breech"
    DRIVE = "drive"
    STROKE = "stroke"
    SPEED = "v max"


@dataclass(frozen=True)
class RangeFigure:
    """Figure by which shots are compared at the range.

    Attributes
    ----------
    code
        Code of the figure.
    value, unit
        Value in its SI unit.
    """

    code: FigureCode
    value: float
    unit: str

    def times(self, factor: float, unit: str) -> RangeFigure:
        """Return it in another unit, of which one of its own has so many."""
        return replace(self, value=factor * self.value, unit=unit)


_ROLES = (
    ("breech_pressure", FigureCode.BREECH, "Pa"), ("driving_force", FigureCode.DRIVE, "N"),
    ("recoil_displacement", FigureCode.STROKE, "m"), ("recoil_velocity", FigureCode.SPEED, "m/s"),
)  # fmt: skip
"""Roles whose extreme is a figure, each with its code and its SI unit."""
_PEAKS = (
    (FigureCode.BREECH, "breech_pressure_pa"), (FigureCode.STROKE, "recoil_travel_m"),
    (FigureCode.SPEED, "recoil_velocity_m_s"),
)  # fmt: skip
"""Codes of the figures that a report has too, with the keys of its peaks."""


def _figures(shot: LiveShot) -> tuple[RangeFigure, ...]:
    """Return the figures of a shot: those of its report where it has one, else the extremes of its channels."""
    channels = () if shot.document is None else shot.document.get("channels", ())
    found: dict[FigureCode, RangeFigure] = {}
    for role, code, unit in _ROLES:
        ends = [(one["low"], one["high"]) for one in channels if one.get("role") == role and one.get("low") is not None]
        if ends:
            found[code] = RangeFigure(code, max(ends[0], key=abs), unit)
    units = {code: unit for _, code, unit in _ROLES}
    for code, key in _PEAKS:
        value = ((shot.mass or {}).get("peaks") or {}).get(key)
        if value is not None:
            found[code] = RangeFigure(code, value, units[code])
    return tuple(found[code] for code in FigureCode if code in found)


@dataclass(frozen=True)
class RangeShot:
    """Shot on its way from the trigger to its verdict.

    Attributes
    ----------
    missing
        Sources whose files have not come.
    growing
        Names of its files that are not whole yet.
    settled
        Whether nothing more will happen to it.
    why
        Sentence on what is wrong with it, or the first reason or warning of its verdict; empty if nothing is.
    verdict
        Verdict; None until it is converted.
    left_s
        Time for which its missing files are still waited for, s; None if it waits for none.
    peaks
        Lowest and highest sample of each channel, in its SI unit; empty until it is converted.
    mass
        Mass of `LiveShot`; None until it is identified.
    mass_to_come
        Whether it is being identified, or its turn is to come.
    figures
        Figures by which it is compared with the others; empty until it is converted.
    problem
        Line on why it failed, is incomplete or not whole; empty if it is none of these.
    provisional
        Whether what its mass rests on is to change: other files are to come, or the full rate.
    age_s
        Time since its verdict, s; None until there is one, and of a shot of before this session.
    overview
        SHA-256 of the shot file of which its overview is; empty until there is one.
    excluded
        Reason why it is left out of the mass, as somebody at the keys wrote it; empty if it is not.
    seen
        Whether somebody at the keys has seen its verdict.
    """

    name: str
    state: ShotState
    missing: tuple[str, ...] = ()
    settled: bool = False
    why: str = ""
    verdict: VerdictLine | None = None
    left_s: float | None = None
    peaks: Mapping[str, tuple[float, float]] | None = None
    mass: Mapping[str, Any] | None = None
    mass_to_come: bool = False
    figures: tuple[RangeFigure, ...] = ()
    problem: str = ""
    provisional: bool = False
    age_s: float | None = None
    growing: tuple[str, ...] = ()
    overview: str = ""
    excluded: str = ""
    seen: bool = False

    @classmethod
    def of(
        cls, shot: LiveShot, left_s: float | None = None, *, now_s: float | None = None, mass_to_come: bool = False
    ) -> RangeShot:
        """Take a shot as it stands.

        Parameters
        ----------
        left_s
            Time for which files are still waited for, s, if it waits for some.
        now_s
            Host time, s; None if how old its verdict is does not matter.
        mass_to_come
            Whether its mass is being identified.
        """
        channels = () if shot.document is None else shot.document.get("channels", ())
        peaks = {one["name"]: (one["low"], one["high"]) for one in channels if one.get("low") is not None}
        return cls(
            shot.name, shot.state, shot.awaited, shot.settled, shot.why, shot.verdict,
            left_s if shot.state is ShotState.WAITING and (shot.awaited or shot.growing) else None, peaks, shot.mass,
            mass_to_come=mass_to_come,
            figures=_figures(shot),
            problem=shot.problem,
            provisional=bool(shot.previews) or bool((shot.mass or {}).get("provisional")),
            age_s=None if now_s is None or shot.judged_s is None else now_s - shot.judged_s,
            growing=tuple(sorted(shot.growing)),
            excluded=shot.excluded,
            seen=shot.seen,
            overview=shot.overview,
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        return {
            "shot": self.name,
            "state": self.state.value,
            "settled": self.settled,
            "missing": list(self.missing),
            "growing": list(self.growing),
            "left_s": self.left_s,
            "why": self.why,
            "warnings": [] if self.verdict is None else list(self.verdict.warned),
            "reasons": [] if self.verdict is None else list(self.verdict.reasons),
            "mass": self.mass,
            "mass_to_come": self.mass_to_come,
            "provisional": self.provisional,
            "excluded": self.excluded or None,
            "figures": [asdict(figure) for figure in self.figures],
            "peaks": {name: list(ends) for name, ends in (self.peaks or {}).items()},
            "overview": self.overview or None,
        }


@dataclass(frozen=True)
class RangeDecision:
    """Decision of the trigger.

    Attributes
    ----------
    utc
        Time of what crossed, ISO 8601, UTC.
    text
        Text of one line, with the channel and the value.
    count
        Number of decisions of this kind one after the other.
    """

    utc: str
    text: str
    count: int = 1


@dataclass(frozen=True)
class RangeState:
    """The armed range at one instant.

    Attributes
    ----------
    utc
        Instant, ISO 8601, UTC.
    virtual
        Whether the devices are played by the program itself.
    since_s
        Time since `state` became what it is, s.
    alert
        Sentence that nobody may overlook; empty if there is none.
    next_shot
        Name of the next shot.
    sources
        Sources that a shot waits for, in the rig's order, those that are read live and those whose files are waited
        for.
    channels
        Channels of the live sources, each with its peak in the last shot that was converted.
    shots
        Shots of the session, in the order of their triggers.
    triggered
        Number of shots since the session was started.
    armed_s
        Time since the session was started, s.
    decision
        Last decision of the trigger; None if there was none.
    alarms
        Number of crossings while disarmed that nobody at the keys has seen; they stand in `alert` too.
    cautions
        Sentences on what is to be looked at before the next shot: calibrations that are overdue, zeros that moved,
        noise that grew.
    notices
        Newest notices, the oldest first.
    campaign
        Mass of the session's shots together, as `recoil_daq.campaigns.running.running_campaign` returns it; None until
        two of them have one.
    added_mass
        Added mass of the shots to come, as a text; empty if nobody stated any.
    asked
        Question that is being answered key by key, with what is typed so far; empty if there is none.
    out
        Folder of the shot files.
    watched
        Folder into which other instruments drop their files; None if none is watched.
    folder_made
        Whether that folder was missing, and made.
    journal_bytes
        Bytes written to the journal so far.
    unsynced_s
        Age of the oldest data that is not yet forced to the disk, s.
    unseen_bytes
        Bytes that are recorded and that the trigger has not looked at.
    units
        Units in which people read it: all else is in SI.
    """

    utc: str
    rig: str
    virtual: bool
    state: State
    since_s: float
    alert: str
    next_shot: str
    sources: tuple[RangeSource, ...]
    channels: tuple[ChannelStatus, ...]
    shots: tuple[RangeShot, ...]
    triggered: int
    armed_s: float
    decision: RangeDecision | None
    alarms: int
    cautions: tuple[str, ...]
    notices: tuple[Notice, ...]
    campaign: Mapping[str, Any] | None
    added_mass: str
    asked: str
    out: Path
    watched: Path | None
    folder_made: bool
    disk_free_bytes: int
    journal_bytes: int
    unsynced_s: float
    unseen_bytes: int
    units: UnitChoice = SI

    def as_read(self) -> RangeState:
        """Return it with channels and figures in the units in which people read them."""
        if not self.units.by_quantity:
            return self
        shots = tuple(
            replace(shot, figures=tuple(figure.times(*self.units.factor(figure.unit)) for figure in shot.figures))
            for shot in self.shots
        )
        channels = tuple(channel.times(*self.units.factor(channel.unit)) for channel in self.channels)
        return replace(self, channels=channels, shots=shots)

    @property
    def live(self) -> tuple[SourceStatus, ...]:
        """The devices that are read live."""
        return tuple(source.live for source in self.sources if source.live is not None)

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``live.json``; what is not finite in it is null."""
        document = {
            "schema": SCHEMA,
            "utc": self.utc,
            "rig": self.rig,
            "virtual": self.virtual,
            "state": self.state,
            "since_s": self.since_s,
            "alert": self.alert,
            "next_shot": self.next_shot,
            "armed_s": self.armed_s,
            "triggered": self.triggered,
            "decision": None if self.decision is None else asdict(self.decision),
            "alarms": self.alarms,
            "cautions": list(self.cautions),
            "notices": [asdict(notice) for notice in self.notices[-NOTICES_OF_FILE:]],
            "campaign": self.campaign,
            "added_mass": self.added_mass or None,
            "out": str(self.out),
            "watched": None if self.watched is None else str(self.watched),
            "folder_made": self.folder_made,
            "disk_free_bytes": self.disk_free_bytes,
            "journal_bytes": self.journal_bytes,
            "unsynced_s": self.unsynced_s,
            "unseen_bytes": self.unseen_bytes,
            "units": self.units.to_json(),
            "sources": [source.to_json() for source in self.sources],
            "channels": [asdict(channel) for channel in self.channels],
            "shots": [shot.to_json() for shot in self.shots],
        }
        return {key: _finite(value) for key, value in document.items()}


def source_state(live: SourceStatus, *, lost: bool, ended: bool = False, without_sample_s: float = 0.0) -> SourceState:
    """Return the state of a source that is read live.

    Parameters
    ----------
    lost
        Whether its device is lost at present.
    ended
        Whether the session reads no device any more: a source is not silent then.
    without_sample_s
        Time since the last sample of any of its channels, s.
    """
    if live.error or ended:
        return "stopped"
    if lost:
        return "lost"
    if is_old(live):
        return "silent"
    return "not understood" if without_sample_s > NOT_UNDERSTOOD_S else "live"


def is_old(source: SourceStatus) -> bool:
    """Return whether nothing came of a source for so long that something is wrong."""
    return source.age_s is None or source.age_s > OLD_S


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
