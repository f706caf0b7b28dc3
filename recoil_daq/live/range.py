"""One live session: what comes from the devices, the trigger and the watched folder, and what is done about it."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.live_source import LiveSource, open_source
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource, reserve_bytes, session_folder
from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.devices.device import Device
from recoil_acquisition.errors import DeviceError, Fault, FaultCode, RecoilDaqError, RigError, quoted
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.trigger import ShotWindow, Trigger
from recoil_daq.live.device_losses import DeviceLosses
from recoil_daq.live.display import Display
from recoil_daq.live.interruption import Interruption
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.range_keys import RangeKeys
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.range_states import RangeStates
from recoil_daq.live.rest_watch import RestWatch
from recoil_daq.live.shot import LiveOptions, LiveOutcome, LiveShot, ShotState
from recoil_daq.live.shots.dropped_files import DroppedFiles
from recoil_daq.live.shots.earlier_shots import EarlierShots
from recoil_daq.live.shots.mass_work import MassWork
from recoil_daq.live.shots.overview_work import OverviewWork
from recoil_daq.live.shots.shot_work import ShotWork
from recoil_daq.live.trigger_at_rest import WITH_ITS_UNIT
from recoil_daq.live.trigger_decisions import PARTS_OF_REST, TriggerDecisions
from recoil_daq.warm_worker import WarmWork, WarmWorker
from recoil_rigs.rig import Rig
from recoil_rigs.shots.left_out import left_out
from recoil_rigs.shots.live_sources import found_by, live_sources, told_by

RESERVE_S = 60.0
"""Time of recording beside a shot, s, for which space is reserved."""

REST_S = 1.0
"""Time for which the trigger is watched from when it is armed, s."""
CLOSE_WITHIN_S = 5.0
"""Time for which the closing of a device is waited for, s: one whose driver hangs must not keep the session."""

LOOK_S = 0.1
SHOW_EVERY_S = 0.2


def trigger_of(rig: Rig) -> Trigger:
    """Return the trigger of a rig; RigError if it declares none."""
    if rig.trigger is None:
        problem = "is missing: a live shot begins by it; declare pre_s, post_s and [[trigger.any]]"
        raise RigError(rig.path, [Fault(("trigger",), problem, FaultCode.MISSING)])
    return rig.trigger


@contextlib.contextmanager
def opened(
    sources: Sequence[LiveSource],
    may_stay_away: Collection[str] = (),
    notice: Callable[[str], None] = lambda _: None,
) -> Iterator[dict[str, Device]]:
    """Open the devices of some sources; all are closed if one cannot be, and at the end.

    Parameters
    ----------
    may_stay_away
        Sources whose devices need not open; a notice says which did not.
    """
    devices: dict[str, Device] = {}
    try:
        for source in sources:
            try:
                devices[source.name] = open_source(source)
            except DeviceError as error:
                if source.name not in may_stay_away:
                    raise
                notice(f"armed without {source.name}, which may stay away: {error}")
        yield devices
    finally:
        for device in devices.values():
            closing = threading.Thread(target=device.close, name=f"close {device.name}", daemon=True)
            closing.start()
            closing.join(CLOSE_WITHIN_S)


class LiveRange:
    """One live session: call `run` once.

    Parameters
    ----------
    folder
        Folder of the shot files, locked for this session.
    devices
        ``device`` tables in place of the rig's own.
    over
        Function that returns whether no further shot will come: a virtual rig has played all of its own.
    rest_s
        Time for which the trigger is watched when it is armed, s: one that fires at rest is disarmed, until somebody at
        the keys arms it all the same. 0 for not at all.
    worker
        Worker that converts and identifies; one of its own if left out. It is closed with the session.
    left
        Shots of a session that crashed, which wait for files of other instruments: they are given those that bear their
        number, and finished as the session's own are.

    earlier
        Work that reads the shots that are in the folder, see `recoil_daq.live.shots.earlier_shots`.
    recovered
        Names of shots that were recovered from a session that crashed.

    Attributes
    ----------
    last
        State in which it ended; None until it has.

    Raises
    ------
    RigError, DeviceError, ReadError
        If the rig or the folder does not allow it.
    """

    def __init__(
        self,
        rig: Rig,
        options: LiveOptions,
        display: Display,
        folder: OutputFolder,
        *,
        devices: Mapping[str, Mapping[str, Any]] | None = None,
        over: Callable[[], bool] = lambda: False,
        rest_s: float = 0.0,
        worker: WarmWorker | None = None,
        left: Sequence[LiveShot] = (),
        earlier: WarmWork | None = None,
        recovered: Sequence[str] = (),
    ) -> None:
        self._rig = rig
        self._options = options
        self._display = display
        self._folder = folder
        self._over = over
        self._rest_s = rest_s
        self._trigger = trigger_of(rig)
        self._devices = devices
        self._without = left_out(rig, options.without, armed=True)
        self._sources = self._taken(live_sources(rig, devices))
        self._live = {source.name: source for source in self._sources}
        self._channels = {channel.name: channel for source in self._sources for channel in source.channels}
        live = set(self._live)
        elsewhere = {s.name for s in rig.sources if s.name not in live | self._without and rig.channels_of(s.name)}
        previewed = frozenset(s.name for s in self._sources if s.live_kind.is_preview)
        self._files = DroppedFiles(rig, options, display, elsewhere, self._trigger.post_s, previewed, left)
        rest = self._rest = RestWatch(rig.read_in)
        self._not_armed = ""  # why not, where the trigger fires at rest
        self._outcome = LiveOutcome(rig.name)
        self._decisions = TriggerDecisions(
            self._trigger, self._channels, display, self._outcome.decisions, self._rest.moved
        )
        self._losses = DeviceLosses(self._live, display)
        self._worker = WarmWorker() if worker is None else worker
        self._work = ShotWork(
            rig, options, display, self._shots, self._files, elsewhere, self._journal_keeps, previewed, self._follow,
            self._worker, excluded=lambda _: self._masses.combine() if self._masses is not None else None,
        )  # fmt: skip
        for shot in left:
            shot.complete_s, shot.previewed = time.monotonic(), previewed
            self._shots.append(shot)
            display.notice(f"shot {shot.name}, recovered, waits for files of {', '.join(shot.missing)} with its number")
        self._keys = RangeKeys(display, self._files, self._work, self._heed, asks_mass=options.asks_mass)
        self._overviews = OverviewWork(self._worker, options.out, display, self._shots)
        self._masses = MassWork(self._worker, options.out, display) if options.identify else None
        self._earlier, self._recovered = EarlierShots(earlier), recovered
        self._states = RangeStates(
            rig, options, display, [s for s in rig.sources if s.name in live | elsewhere], self._shots,
            files=self._files, work=self._work, masses=self._masses, decisions=self._decisions, losses=self._losses,
            rest=rest, earlier=self._earlier,
        )  # fmt: skip
        self.last: RangeState | None = None
        self._interruption = Interruption()
        self._asking = self._left = self._refused = False
        self._dropped_until_s = -math.inf  # what fired at rest until then is no shot
        self._heeded = 1  # so many signals ask for an orderly end
        self._gone = ""
        self._journal: Path | None = None
        self._shown_s = self._ending_s = 0.0

    @property
    def _shots(self) -> list[LiveShot]:
        return self._outcome.shots

    @property
    def _own(self) -> list[LiveShot]:
        """The shots that this session's trigger began."""
        return [shot for shot in self._shots if shot.window is not None]

    def run(self, started: Callable[[], None] = lambda: None) -> LiveOutcome:
        """Arm, and go on until the shots are done, a key or Ctrl-C ends it, or a device or the disk fails.

        Parameters
        ----------
        started
            Function called when the devices are open and the trigger is armed.

        Raises
        ------
        DeviceError
            If a device cannot be opened.
        RigError
            If what an open device tells of its signals contradicts the rig.
        StoreError
            If there is no room for the journal.
        """
        if self._files.where:
            self._display.notice(self._files.where)
        watched = {channel.source for channel in self._rig.channels if channel.name in self._trigger.channels}
        optional = {s.name for s in self._rig.sources if not s.required} - watched
        with opened(self._sources, optional, self._display.notice) as devices:
            self._without |= {source.name for source in self._sources if source.name not in devices}
            self._sources = self._taken(self._sources)
            self._meet(devices)
            session = self._session(devices)
            with self._interruption:
                try:
                    session.start()
                    session.arm()
                    started()
                    if self._rests(session):
                        self._say_recovered()
                        self._go_on(session)
                finally:
                    self._end(session)
        return self._outcome

    def _say_recovered(self) -> None:
        """Say that it is armed, and what is there of the session that crashed."""
        if self._recovered and not self._not_armed:
            self._display.notice(f"armed again after a crash; recovered: {', '.join(self._recovered)}")

    def _taken(self, sources: Sequence[LiveSource]) -> tuple[LiveSource, ...]:
        """Return the sources of a session: all but those that are left out of it."""
        return tuple(source for source in sources if source.name not in self._without)

    def _meet(self, devices: Mapping[str, Device]) -> None:
        """Take what the open devices tell of their signals; RigError if that contradicts the rig, with every case."""
        if told := told_by(self._sources, devices):
            found = found_by(self._sources, devices)
            self._sources = self._taken(live_sources(self._rig, self._devices, told, found))
            self._live.update((source.name, source) for source in self._sources)
            self._channels.update((channel.name, channel) for source in self._sources for channel in source.channels)

    def _rests(self, session: LiveSession) -> bool:
        """Watch the trigger when it is armed; one that fires at rest is disarmed, which ends a session without keys."""
        if not self._rest_s or not self._trigger.conditions:
            return True
        self._decisions.begin_rest()
        began_s = time.monotonic()
        while not self._interruption.asked and session.error is None and time.monotonic() - began_s < self._rest_s:
            self._show(session)
            time.sleep(min(LOOK_S, self._rest_s / PARTS_OF_REST))
        text = self._decisions.fired_at_rest(began_s, self._rest_s)
        if not text:
            return True
        session.disarm()
        self._dropped_until_s = time.monotonic()
        shows = f"`recoil-daq check {quoted(self._rig.path)} --devices` shows both"
        remedy = f"correct the level, {WITH_ITS_UNIT}, or declare `rearm`; {shows}"
        if self._display.has_keys:
            self._display.notice(f"NOT ARMED: {text}; {remedy}; or press a to arm all the same")
            self._not_armed = f"NOT ARMED: {text}: a arms all the same"
            return True
        self._refused = self._decisions.silent = True
        fault = Fault(("trigger",), f"{text}; {remedy}; it is not armed", FaultCode.AT_REST)
        self._outcome.error = RigError(self._rig.path, [fault])
        return False

    def _session(self, devices: Mapping[str, Device]) -> LiveSession:
        self._states.armed = now = anchor()
        self._decisions.wall_of = now.wall_of
        self._outcome.armed_utc = dt.datetime.fromtimestamp(now.wall_ns / 1e9, dt.UTC).isoformat()
        record = LiveRecord(
            rig_name=self._rig.name,
            rig_text=self._rig.text,
            rig_path=str(self._rig.path),
            databases=dict(self._rig.databases),
            anchor=now,
            sources=tuple(RecordedSource.of(s.name, s.kind, s.device) for s in self._sources),
        )
        seconds = self._trigger.pre_s + self._trigger.post_s + RESERVE_S
        self._journal = session_folder(self._options.out, now.wall_ns)
        return LiveSession(
            record,
            self._sources,
            devices,
            self._trigger,
            self._journal,
            reserve_bytes=reserve_bytes(devices.values(), seconds),
            spare=None if self._options.spare is None else self._options.spare / self._journal.name,
            notice=self._decisions.take,
        )

    def _go_on(self, session: LiveSession) -> None:
        """Look after everything until it is time to end."""
        limit, done = self._options.shots, False
        while not self._failed(session):
            self._show(session)
            if self._interruption.asked or self._keys.look(session):
                self._heeded = min(self._interruption.count, 1)
                self._display.notice("ending: what was captured is completed; q or Ctrl-C again to give it up")
                return
            self._look(session, LOOK_S)
            if limit is not None and len(self._own) >= limit and not done:
                session.disarm()
                done = True
            if (done or (self._over() and session.idle)) and all(shot.at_rest for shot in self._shots):
                return

    def _failed(self, session: LiveSession) -> bool:
        """Return whether it cannot go on; if the folder that it writes to is gone, nothing more is written there."""
        if not self._gone and (fault := self._folder.fault(session.journal_folder)) is not None:
            self._gone = "OUTPUT FOLDER GONE"
            session.disarm()
            self._outcome.error = fault
            self._display.notice(f"DISARMED: {fault}")
            self._shown_s = 0.0
            self._show(session)
        self._outcome.error = self._outcome.error or session.error
        return self._outcome.error is not None

    def _show(self, session: LiveSession) -> None:
        """Show how it is doing, some times per second; what nobody may overlook stands beside the state."""
        self._losses.look(session)
        now_s = time.monotonic()
        if now_s - self._shown_s >= SHOW_EVERY_S:
            self._shown_s = now_s
            state = self._states.state(session, self._alerts, self._asked)
            self._display.show(state)
            self._keep(state)

    def _keep(self, state: RangeState) -> None:
        """Keep the state where other programs see it, as long as the output folder is this session's."""
        if not self._gone:
            self._states.keep(state)

    @property
    def _alerts(self) -> list[str]:
        """Sentences that nobody may overlook, of what concerns the whole session."""
        return [text for text in (self._gone, self._decisions.alarm, self._not_armed) if text]

    def _end(self, session: LiveSession) -> None:
        """Complete what was captured: the open shot, its captures, every shot that has its files."""
        self._ending_s = time.monotonic()
        try:
            self._complete(session)
        finally:
            self._work.close()
            if self._masses is not None:
                self._masses.close()
            self._overviews.close()
            self._worker.close()
            self._close(session)
            self._outcome.interrupted = self._interruption.asked
            self._write_log(session.journal_folder.name)
            self.last = self._states.state(session, self._alerts, "")
            self._keep(self.last)

    def _complete(self, session: LiveSession) -> None:
        if not self._failed(session):
            session.disarm()
            while session.recording and not self._failed(session) and not self._given_up():
                self._show(session)
                self._look(session, LOOK_S)
        try:
            session.stop()
        except RecoilDaqError as error:
            self._outcome.error = self._outcome.error or error
        while not self._gone and (window := session.next_window(0.0)) is not None:
            self._begin(session, window)
        if not self._gone:
            self._files.take(self._shots, recording=session.recording, at_once=True)
        while (self._work_to_come or any(map(self._to_come, self._shots))) and not self._given_up():
            if self._failed(session) and self._gone:
                break
            self._look(session, 0.02)
            self._show(session)
        for shot in self._shots if self._gone and self._folder.moved_to is None else ():
            if shot.document is not None and not Path(shot.document["file"]).exists():
                self._work.fail(shot, "its shot file went with the output folder")
        if self._gone:
            self._work.leave_the_rest()
        while self._gone and self._display.has_keys and not self._interruption.asked and self._display.key() != "q":
            self._show(session)  # somebody has yet to see it
            time.sleep(LOOK_S)

    def _to_come(self, shot: LiveShot) -> bool:
        """Return whether a shot is still on its way to its shot file while the session ends."""
        if not shot.growing and (shot.state not in (ShotState.WAITING, ShotState.NOT_WHOLE) or not shot.awaited):
            return not shot.at_rest
        growing = self._files.growing
        return growing and time.monotonic() - self._ending_s < self._options.files_within_s

    def _given_up(self) -> bool:
        """Return whether what is not complete is to be given up: somebody at the keys is asked first."""
        key = self._display.key()
        urged = self._interruption.count > self._heeded
        if self._left or (urged and not (self._interruption.by_key and self._display.has_keys)):
            return True
        if (urged or key == "q") and not self._asking:
            self._asking = True
            text = f"give up the shots that are not complete ({self._incomplete})? y: give up; n: complete them"
            self._display.notice(text)
        elif not self._asking:
            self._files.answered(key)
        elif key == "n":
            self._asking = False
            self._heeded = self._interruption.count
            self._display.notice("completing them")
        self._left = self._asking and key == "y"
        return self._left

    def _close(self, session: LiveSession) -> None:
        """Close the journal; it goes if all that was captured is in shot files."""
        if self._refused:
            session.forget_kept()
        try:
            session.close(complete=not self._gone and all(shot.document is not None for shot in self._own))
        except RecoilDaqError as error:
            self._outcome.error = self._outcome.error or error
        self._outcome.error = self._outcome.error or session.error
        if session.journal_folder.exists():
            self._outcome.journal = session.journal_folder
            for stretch in session.kept:
                self._display.notice(f"kept in the journal, in no shot: {stretch.why}, {stretch.lasting}")

    def _write_log(self, name: str) -> None:
        """Keep what the session decided and made: the journal, which has it too, is removed."""
        out = self._options.out if self._options.out.is_dir() else self._folder.moved_to
        if out is None:
            return
        path = out / "sessions" / f"{name}.json"
        self._outcome.decisions_left_out = self._decisions.left_out
        partial = partial_path(path)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.write_text(json.dumps(self._outcome.to_json(), indent=1), encoding="utf-8", newline="\n")
            give_name(partial, path, overwrite=True)
        except OSError as error:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            self._display.notice(f"the session's log cannot be written to {path}: {error.strerror or error}")
        else:
            self._outcome.log = path

    @property
    def _asked(self) -> str:
        """The question that is to be answered; empty if there is none."""
        if self._keys.asked:
            return self._keys.asked
        if self._asking:
            return f"give up the shots that are not complete ({self._incomplete})? y give up, n complete them"
        return (self._files.asked or self._keys.asked_in_turn) if self._display.has_keys else ""

    @property
    def _incomplete(self) -> str:
        return ", ".join(shot.name for shot in self._shots if not shot.settled) or "the one that is recorded"

    def _heed(self, armed: bool) -> None:
        """Take away what stands beside the state: somebody at the keys has seen it, and perhaps armed all the same."""
        self._decisions.heed(armed=armed)
        if armed:
            self._not_armed = ""

    def _look(self, session: LiveSession, timeout_s: float) -> None:
        """Look once at everything that may have happened."""
        window = session.next_window(timeout_s)
        if window is not None:
            self._begin(session, window)
        self._work.look(session)
        if earlier := self._earlier.look(self._shots):
            self._overviews.know(earlier)
            if self._masses is not None:
                self._masses.know(earlier)
        self._overviews.look()
        if self._masses is not None:
            self._masses.look()

    def _follow(self, shot: LiveShot) -> None:
        """Have the curves of a shot kept, and its mass identified where it is usable; one made anew loses the old."""
        self._overviews.begin(shot)
        if self._masses is None:
            return
        if shot.state in (ShotState.USABLE, ShotState.RECORD_ONLY, ShotState.NOT_USABLE):
            self._masses.begin(shot)
        else:
            self._masses.forget(shot)

    @property
    def _work_to_come(self) -> bool:
        return self._overviews.pending or (self._masses is not None and self._masses.pending)

    def _begin(self, session: LiveSession, window: ShotWindow) -> None:
        """Make a shot of a window, unless it is what a trigger at rest fired at."""
        if window.trigger_s <= self._dropped_until_s:
            session.release(window)
        else:
            self._rest.fired(self._work.next_name, window.trigger_s)
            self._work.begin(session, window)

    def _journal_keeps(self) -> str:
        """Say where the data of a shot without a capture is, after a look at whether it is."""
        if self._journal is not None and self._journal.is_dir():
            return f"the journal keeps its data: `recoil-daq recover {quoted(self._options.out)}`"
        if self._folder.moved_to is not None:
            return f"its data is with the folder in {self._folder.moved_to}"
        return "its data is NOT kept: captures and journal are gone"
