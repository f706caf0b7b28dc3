"""States of an armed range, one after the other: joined of its parts, and kept for other programs."""

from __future__ import annotations

import datetime as dt
import time
from collections.abc import Sequence

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.status import LiveStatus
from recoil_acquisition.clocks.host_clock import Anchor, anchor
from recoil_daq.live.device_losses import DeviceLosses
from recoil_daq.live.display import Display
from recoil_daq.live.range_state import OLD_S, RangeShot, RangeSource, RangeState, SourceState, source_state
from recoil_daq.live.rest_watch import RestWatch
from recoil_daq.live.shot import LiveOptions, LiveShot
from recoil_daq.live.shots.dropped_files import DroppedFiles
from recoil_daq.live.shots.earlier_shots import EarlierShots
from recoil_daq.live.shots.mass_work import MassWork
from recoil_daq.live.shots.shot_work import ShotWork
from recoil_daq.live.source_alarms import SourceAlarms
from recoil_daq.live.state_file import StateFile
from recoil_daq.live.trigger_decisions import TriggerDecisions
from recoil_rigs.rig import Rig
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.tables.rig_tables import Source
from recoil_rigs.twin.range_day import is_virtual_rig

CLOCK_SET_S = 2.0
"""Step of the host's wall clock from which on it is named, s: times of day are not better known."""

DISK_FULL_BYTES = 1 << 24
"""Room on the disk below which no capture of a shot may fit."""
FULL = "DISK FULL: shots stay in the journal, make room"


class RangeStates:
    """Joins what the parts of a session are to its state, and keeps it in the output folder.

    Parameters
    ----------
    sources
        Sources that a shot waits for.
    shots
        Shots of the session, as it stands.
    masses
        Masses of the shots; None if none is identified.
    earlier
        Shots of before this session.

    Attributes
    ----------
    armed
        Host's two clocks when it was armed; None until then.
    """

    def __init__(
        self,
        rig: Rig,
        options: LiveOptions,
        display: Display,
        sources: Sequence[Source],
        shots: Sequence[LiveShot],
        *,
        files: DroppedFiles,
        work: ShotWork,
        masses: MassWork | None,
        decisions: TriggerDecisions,
        losses: DeviceLosses,
        rest: RestWatch,
        earlier: EarlierShots,
    ) -> None:
        self._rig, self._options, self._display = rig, options, display
        self._sources, self._shots = sources, shots
        self._files, self._work, self._masses = files, work, masses
        self._decisions, self._losses, self._rest = decisions, losses, rest
        self._earlier = earlier
        triggering = () if rig.trigger is None else rig.trigger.channels
        self._alarms = SourceAlarms(
            {c.source for c in rig.channels if c.name in triggering}, {c.source for c in rig.channels if c.role}
        )
        self._virtual = is_virtual_rig(rig)
        self._file = StateFile(options.out)
        self._unwritten = ""
        self._since: tuple[str, float] = "", 0.0
        self._good_s: dict[str, float] = {}
        self.armed: Anchor | None = None

    def keep(self, state: RangeState) -> None:
        """Keep a state where other programs see it; say once why it cannot be."""
        fault = self._file.write(state)
        if fault and not self._unwritten:
            self._display.notice(f"{self._file.path} cannot be written, what it says is old: {fault}")
        self._unwritten = fault

    def state(self, session: LiveSession, alerts: Sequence[str], asked: str) -> RangeState:
        """Return how everything is at this moment.

        Parameters
        ----------
        alerts
            Sentences on the whole session that nobody may overlook.
        asked
            Question that is to be answered; empty if there is none.
        """
        status, now_s = session.status, time.monotonic()
        sources = tuple(self._source(source, status, now_s) for source in self._sources)
        # a virtual rig is silent when it has played, and disarmed then
        heard = status.armed_s > OLD_S and not (self._virtual and status.state == "disarmed")
        alarms = self._alarms.look(sources, now_s) if heard else ()
        full = FULL if status.disk_free_bytes < DISK_FULL_BYTES and status.state != "stopped" else ""
        alerts = [*alerts, *alarms, *(text for text in (status.alert, self._files.away, full) if text)]
        if self._since[0] != status.state:
            self._since = status.state, now_s
        within_s = self._options.files_within_s
        awaited = frozenset[str]() if self._masses is None else self._masses.awaited
        shots = [RangeShot.of(shot) for shot in self._earlier.shots]
        shots += [
            RangeShot.of(
                shot, max(shot.complete_s + within_s - now_s, 0.0), now_s=now_s, mass_to_come=shot.name in awaited
            )
            for shot in self._shots
        ]
        peaks = next((shot.peaks for shot in reversed(shots) if shot.peaks), {})
        return RangeState(
            utc=dt.datetime.now(dt.UTC).isoformat(timespec="milliseconds"),
            rig=self._rig.name,
            virtual=self._virtual,
            state=status.state,
            since_s=now_s - self._since[1],
            alert=", ".join(alerts),
            next_shot=self._work.next_name,
            sources=sources,
            channels=tuple(channel.with_peak(peaks.get(channel.name)) for channel in status.channels),
            shots=tuple(shots),
            triggered=status.shots,
            armed_s=status.armed_s,
            decision=self._decisions.last,
            alarms=self._decisions.alarms,
            cautions=(*_not_calibrated(self._rig), *self._clock_set(), *self._rest.look(status.channels)),
            notices=self._display.noticed,
            campaign=None if self._masses is None else self._masses.campaign,
            added_mass="" if self._work.added_mass is None else str(self._work.added_mass),
            asked=asked,
            out=self._options.out,
            watched=self._files.folder,
            folder_made=self._files.folder_made and not self._virtual,
            disk_free_bytes=status.disk_free_bytes,
            journal_bytes=status.journal_bytes,
            unsynced_s=status.unsynced_s,
            unseen_bytes=status.unseen_bytes,
            units=self._rig.read_in,
        )

    def _source(self, source: Source, status: LiveStatus, now_s: float) -> RangeSource:
        """Return how a source is, and since when and for how long yet its files are waited for."""
        live = next((one for one in status.sources if one.name == source.name), None)
        ended, lost = status.state == "stopped", source.name in self._losses.lost
        absent: SourceState = "for files" if source.device is None else "not open"
        good = any(c.level is not None for c in status.channels if c.source == source.name)
        good_s = self._good_s[source.name] = now_s if good else self._good_s.get(source.name, now_s)
        without_s = now_s - good_s
        state = absent if live is None else source_state(live, lost=lost, ended=ended, without_sample_s=without_s)
        wait = [s for s in self._shots if source.name in s.awaited and not s.settled]
        waited_s = max((now_s - s.complete_s for s in wait if s.captured is not None), default=None)
        waits = waited_s is not None and self._files.watched and not ended
        return RangeSource(
            source.name, source.kind, state, live, self._files.last_of(source.name), tuple(s.name for s in wait),
            self._files.growing_of(source.name), waited_s,
            max(self._options.files_within_s - (waited_s or 0.0), 0.0) if waits else None,
        )  # fmt: skip

    def _clock_set(self) -> tuple[str, ...]:
        """Say by how much the computer's clock was set since it was armed: shots are dated by it as it was then."""
        now = anchor()
        step_s = 0.0 if self.armed is None else (now.wall_ns - self.armed.wall_of(now.monotonic_ns)) / 1e9
        if abs(step_s) < CLOCK_SET_S:
            return ()
        return (f"this computer's clock was set by {step_s:+.0f} s, or it slept: arm anew to date shots by it",)


def _not_calibrated(rig: Rig) -> tuple[str, ...]:
    """Name the calibrations that do not cover today: past their due dates, or made later."""
    today = CalibrationDay(dt.date.today(), DayOf.TODAY)
    late, early = [], []
    for c in rig.channels:
        overdue, later = today.faults(c.sensor.calibrated, c.sensor.due)
        late += [f"{c.name} (was due {c.sensor.due})"] if overdue else []
        early += [f"{c.name} ({c.sensor.calibrated})"] if later else []
    found = (("calibration overdue", late), ("calibrated later than today", early))
    return tuple(f"{what}: {', '.join(names)}" for what, names in found if names)
