"""A live session as it is shown: its shots from trigger to verdict, what its devices lost, and the display."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from recoil_acquisition.devices.device import Counters
from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.log.segment import SUFFIX
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.shot.usability import Usability
from recoil_acquisition.trigger import Decision, ShotWindow
from recoil_daq.live.added_mass import AddedMass
from recoil_daq.terminal.verdict_line import VerdictLine

FILES_WITHIN_S = 120.0
"""Time after a shot for which files of other instruments are waited for, s, before it is converted without them."""
_LOSSES = (
    ("counter_gaps", "gap", "gaps"),
    ("kernel_drops", "dropped by the kernel", "dropped by the kernel"),
    ("bad", "damaged", "damaged"),
    ("skipped_bytes", "byte skipped", "bytes skipped"),
    ("reopened", "reconnect", "reconnects"),
    ("error_frames", "error frame", "error frames"),
)
"""Counters of losses, the worst first, each with its words for one and for several."""


def lost_anything(counters: Counters) -> bool:
    """Return whether any of the counters of losses is not zero."""
    return any(getattr(counters, name) for name, _, _ in _LOSSES)


def losses_of(counters: Counters) -> str:
    """Name every loss of a device, the worst first.

    Without any it is "none", or "none seen" of a source that counts no frames: what is missing between two leaves no
    trace there.
    """
    found = []
    for name, one, many in _LOSSES:
        count = getattr(counters, name)
        if count:
            found.append(f"{count} {one if count == 1 else many}")
    return ", ".join(found) or ("none seen" if counters.counter_gaps is None else "none")


class ShotState(StrEnum):
    """State of a live shot, from its trigger on; those of `Usability` are its verdict's."""

    CUTTING = "cutting"
    WAITING = "waiting"
    """Its turn, or the files of other instruments, are to come."""
    CONVERTING = "converting"
    USABLE = Usability.USABLE.value
    RECORD_ONLY = Usability.RECORD_ONLY.value
    NOT_USABLE = Usability.NOT_USABLE.value
    NOT_WHOLE = "not whole"
    """A file grew after it was taken, and the shot file was made without the rest."""
    FAILED = "failed"
    """No shot file was made."""
    INCOMPLETE = "incomplete"
    """The files of other instruments never came."""


_SETTLED = (
    ShotState.USABLE, ShotState.RECORD_ONLY, ShotState.NOT_USABLE, ShotState.FAILED, ShotState.INCOMPLETE,
)  # fmt: skip


@dataclass(eq=False)
class LiveShot:
    """One shot as it stands.

    Attributes
    ----------
    window
        Window of the shot in the journal; None if it comes from a journal that was left over.
    captured
        Capture of the shot; None until it is written.
    files
        Files of the shot, its capture and those dropped into the watched folder; keys are the sources' names.
    wanted
        Sources whose files may come.
    unawaited
        Sources among them that it does not wait for: they may stay away, or somebody said that they did not fire.
    previewed
        Sources that are read live and write a file of their own too, for which nothing waits.
    complete_s
        Host time at which its capture was complete, s.
    document
        Document of ``ingest --json`` of the shot; None until it is converted.
    problem
        Line on why it failed or is incomplete; empty if it is neither.
    by_time
        Sources whose files were matched by time alone.
    growing
        Names of its files that have not settled since they grew, or are cut off so far.
    redo
        Line on why it is to be converted anew; empty if it is not.
    mass
        Mass, as `recoil_daq.reports.shot_mass.shot_mass` returns it, with ``provisional``, the reasons why it is not
        the last word; None until it is identified.
    judged_s
        Host time of its verdict, s; None until there is one.
    overview
        SHA-256 of the shot file that its overview was made of; empty until there is one.
    excluded
        Reason why it is left out of the mass, as somebody at the keys wrote it; empty if it is not.
    seen
        Whether somebody at the keys has seen its verdict.
    uncut
        Whether it failed since it could not be cut out of the journal, which is tried again.
    """

    name: str
    window: ShotWindow | None = None
    state: ShotState = ShotState.CUTTING
    captured: Path | None = None
    acquisition: Acquisition | None = None
    files: dict[str, Path] = field(default_factory=dict)
    wanted: set[str] = field(default_factory=set)
    unawaited: set[str] = field(default_factory=set)
    previewed: frozenset[str] = frozenset()
    complete_s: float = 0.0
    document: Mapping[str, Any] | None = None
    problem: str = ""
    by_time: set[str] = field(default_factory=set)
    growing: set[str] = field(default_factory=set)
    redo: str = ""
    mass: Mapping[str, Any] | None = None
    judged_s: float | None = None
    overview: str = ""
    excluded: str = ""
    seen: bool = False
    uncut: bool = False

    @property
    def missing(self) -> tuple[str, ...]:
        """Sources whose files have not come."""
        return tuple(sorted(self.wanted - set(self.files)))

    @property
    def awaited(self) -> tuple[str, ...]:
        """Sources whose files it waits for."""
        return tuple(name for name in self.missing if name not in self.unawaited)

    @property
    def previews(self) -> frozenset[str]:
        """Sources whose own files have not come: what was read live of them is all there is."""
        return frozenset(s for s in self.previewed if self.files.get(s, self.captured) == self.captured)

    def takes(self, source: str) -> bool:
        """Return whether it waits for a file of a source, or would be made anew with it."""
        return source in self.previews or (
            source in self.missing and (self.uncut or self.state is not ShotState.FAILED)
        )

    @property
    def settled(self) -> bool:
        """Whether nothing more will happen to it."""
        return self.state in _SETTLED and not self.redo

    @property
    def at_rest(self) -> bool:
        """Whether nothing more will happen to it unless another file comes: it is settled, or stays not whole."""
        stays = self.state is ShotState.NOT_WHOLE and not self.redo and not self.growing
        return self.settled or stays

    @property
    def verdict(self) -> VerdictLine | None:
        """The verdict of its conversion; None until there is one."""
        return None if self.document is None else VerdictLine.of(self.document)

    @property
    def why(self) -> str:
        """The fault of it: its problem, else the first reason or warning of its verdict; empty if nothing is."""
        return self.problem or ("" if self.verdict is None else self.verdict.first)

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        return {
            "shot": self.name,
            "state": self.state.value,
            "problem": self.problem,
            "capture": None if self.captured is None else str(self.captured),
            "files": {source: str(path) for source, path in self.files.items()},
            "missing": list(self.missing),
            "acquisition": None if self.acquisition is None else self.acquisition.to_json(),
            "ingest": self.document,
            "mass": self.mass,
        }


@dataclass(frozen=True)
class LiveOptions:
    """Options of a live session.

    Attributes
    ----------
    out
        Folder of the shot files; captures and journals stand in it, in ``captures`` and ``journal``.
    shots
        Number of shots after which the session ends; None for no end.
    first
        Number of the first shot; the next free one if None.
    watch
        Folder into which other instruments drop their files.
    files_within_s
        Time after a shot for which other instruments' files are waited for, s.
    spare
        Folder on another disk, where the journal goes on if the first one fails.
    identify
        Whether every usable shot is identified while the session goes on.
    added_mass
        Mass that the shots to come carry, until somebody at the keys states another; None if nobody stated any.
    asks_mass
        Whether that is asked for at the keys, once it is armed, until somebody answers.
    weight
        Mass that every second shot is to carry: from shot to shot it is asked whether the next one does. None if there
        is none.
    without
        Sources that are left out of the session: no device of theirs is opened, and no file waited for.
    """

    out: Path = Path("shots")
    shots: int | None = None
    first: int | None = None
    watch: Path | None = None
    files_within_s: float = FILES_WITHIN_S
    spare: Path | None = None
    identify: bool = False
    added_mass: AddedMass | None = None
    asks_mass: bool = False
    weight: AddedMass | None = None
    without: tuple[str, ...] = ()


@dataclass
class LiveOutcome:
    """Outcome of a live session.

    Attributes
    ----------
    journal
        Journal that was kept, since something of it is in no shot file; None if it was not.
    interrupted
        Whether the session was ended by Ctrl-C, or a request of the system.
    error
        Error that ended the session; None if none did.
    decisions
        Decisions of the trigger, those that belong to no shot among them.
    decisions_left_out
        Number of decisions that are not among them, since many alike stand before them.
    armed_utc
        Time at which it was armed, ISO 8601, UTC.
    log
        File into which all this was written; None if it could not be.
    """

    rig: str
    shots: list[LiveShot] = field(default_factory=list)
    journal: Path | None = None
    interrupted: bool = False
    error: RecoilDaqError | None = None
    decisions: list[Decision] = field(default_factory=list)
    armed_utc: str = ""
    decisions_left_out: int = 0
    log: Path | None = None

    @property
    def usable(self) -> bool:
        """Whether every shot is; one of a session before, whose files did not come now either, does not count."""
        left = [shot for shot in self.shots if shot.window is None and shot.state is ShotState.INCOMPLETE]
        return all(shot.state is ShotState.USABLE for shot in self.shots if shot not in left)

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, with its schema."""
        return {
            "schema": "recoil-daq/live-session/1",
            "rig": self.rig,
            "armed_utc": self.armed_utc,
            "shots": [shot.to_json() for shot in self.shots],
            "journal": None if self.journal is None else str(self.journal),
            "interrupted": self.interrupted,
            "error": None if self.error is None else str(self.error),
            "decisions": [asdict(decision) for decision in self.decisions],
            "decisions_left_out": self.decisions_left_out,
        }


def capture_path(out: Path, shot: str) -> Path:
    """Return where the capture of a shot stands in a folder of shots."""
    return out / "captures" / f"{shot}{SUFFIX}"


def free_number(out: Path) -> int:
    """Return the lowest number from which on no shot in a folder is numbered."""
    names = [path.stem for path in (*out.glob("*.h5"), *(out / "captures").glob(f"*{SUFFIX}"))]
    return 1 + max((int(name) for name in names if name.isdecimal()), default=0)
