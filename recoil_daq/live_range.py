"""One live session: what comes from the devices, the trigger and the watched folder, and what is done about it."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from daq.capture.live_session import CapturedShot, LiveSession
from daq.capture.live_source import LiveSource, open_source
from daq.capture.session_record import LiveRecord, RecordedSource, reserve_bytes, session_folder
from daq.devices.device import Device, anchor
from daq.errors import Fault, ReadError, RecoilDaqError, RigError
from daq.trigger import Decision, ShotWindow, Trigger
from recoil_daq.conversion import Conversion
from recoil_daq.file_match import shot_of, source_of
from recoil_daq.folder_watch import DroppedFile, FolderWatch
from recoil_daq.interruption import Interruption
from recoil_daq.live_shot import Display, LiveOptions, LiveOutcome, LiveShot
from rigs.live_sources import live_sources
from rigs.rig import Rig

RESERVE_S = 60.0
"""Space is reserved for so much recording beside a shot."""

LOOK_S = 0.1
SHOW_EVERY_S = 0.2
_UNMATCHED_S = 10.0


def trigger_of(rig: Rig) -> Trigger:
    """Return the trigger of a rig; RigError if it declares none."""
    if rig.trigger is None:
        problem = "is missing: a live shot begins by it; declare pre_s, post_s and [[trigger.any]]"
        raise RigError(rig.path, [Fault("trigger", problem)])
    return rig.trigger


@contextlib.contextmanager
def opened(sources: Sequence[LiveSource]) -> Iterator[dict[str, Device]]:
    """Open the devices of some sources; all are closed if one cannot be, and at the end."""
    devices: dict[str, Device] = {}
    try:
        for source in sources:
            devices[source.name] = open_source(source)
        yield devices
    finally:
        for device in devices.values():
            device.close()


class LiveRange:
    """One live session: call `run` once.

    Parameters
    ----------
    rig : Rig
    options : LiveOptions
    display : Display
    devices : mapping of str to mapping or None
        ``device`` tables in place of the rig's own.
    over : callable
        Tells that no further shot will come: a virtual rig has played all of its own.

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
        *,
        devices: Mapping[str, Mapping[str, Any]] | None = None,
        over: Callable[[], bool] = lambda: False,
    ) -> None:
        self._rig = rig
        self._options = options
        self._display = display
        self._over = over
        self._trigger = trigger_of(rig)
        self._sources = live_sources(rig, devices)
        self._watch = None if options.watch is None else FolderWatch(options.watch)
        live = {source.name for source in self._sources}
        self._elsewhere = {s.name for s in rig.sources if s.name not in live and rig.channels_of(s.name)}
        self._next = options.first or 1
        self._outcome = LiveOutcome(rig.name)
        self._cutting: dict[str, Future[CapturedShot]] = {}
        self._unmatched: list[tuple[DroppedFile, str]] = []
        self._conversion: tuple[LiveShot, Conversion] | None = None
        self._interruption = Interruption()
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="cut")

    @property
    def _shots(self) -> list[LiveShot]:
        return self._outcome.shots

    def run(self, started: Callable[[], None] = lambda: None) -> LiveOutcome:
        """Arm, and go on until the shots are done, a key or Ctrl-C ends it, or a device or the disk fails.

        Parameters
        ----------
        started : callable
            Called when the devices are open and the trigger is armed.

        Raises
        ------
        DeviceError
            If a device cannot be opened.
        StoreError
            If there is no room for the journal.
        """
        with opened(self._sources) as devices:
            session = self._session(devices)
            with self._interruption:
                try:
                    session.start()
                    session.arm()
                    started()
                    self._go_on(session)
                finally:
                    self._end(session)
            self._outcome.interrupted = self._interruption.asked
        return self._outcome

    def _session(self, devices: Mapping[str, Device]) -> LiveSession:
        now = anchor()
        self._outcome.armed_utc = dt.datetime.fromtimestamp(now.wall_ns / 1e9, dt.UTC).isoformat()
        record = LiveRecord(
            rig_name=self._rig.name,
            rig_text=self._rig.text,
            rig_path=str(self._rig.path),
            databases=dict(self._rig.databases),
            anchor=now,
            sources=tuple(RecordedSource(s.name, s.kind) for s in self._sources),
        )
        seconds = self._trigger.pre_s + self._trigger.post_s + RESERVE_S
        return LiveSession(
            record,
            self._sources,
            devices,
            self._trigger,
            session_folder(self._options.out, now.wall_ns),
            reserve_bytes=reserve_bytes([s.device for s in self._sources], seconds),
            notice=self._decided,
        )

    def _go_on(self, session: LiveSession) -> None:
        """Look after everything until it is time to end."""
        limit, done, shown_s = self._options.shots, False, 0.0
        while True:
            if time.monotonic() - shown_s >= SHOW_EVERY_S:
                shown_s = time.monotonic()
                self._display.show(session.status, self._shots)
            self._outcome.error = session.error
            if self._interruption.asked:
                self._display.notice("interrupted: completing what was captured; Ctrl-C again to leave at once")
                return
            if self._outcome.error is not None or self._pressed(session):
                return
            self._look(session, LOOK_S)
            if limit is not None and len(self._shots) >= limit and not done:
                session.disarm()
                done = True
            if (done or (self._over() and session.idle)) and all(shot.settled for shot in self._shots):
                return

    def _end(self, session: LiveSession) -> None:
        """Complete what was captured: the open shot, its captures, the conversion under way."""
        try:
            session.stop()
            while (window := session.next_window(0.0)) is not None:
                self._begin(session, window)
            while any(s.state in ("cutting", "converting") for s in self._shots) and not self._interruption.urged:
                self._look(session, 0.02)
                self._display.show(session.status, self._shots)
            for shot in self._shots:
                if shot.state == "waiting":
                    self._give_up(shot)
        finally:
            self._pool.shutdown(wait=False, cancel_futures=True)
            if self._conversion is not None:
                self._conversion[1].end()
            self._close(session)
            self._write_log(session.journal_folder.name)

    def _close(self, session: LiveSession) -> None:
        """Close the journal; it goes if all that was captured is in shot files."""
        try:
            session.close(complete=all(shot.document is not None for shot in self._shots))
        except RecoilDaqError as error:
            self._outcome.error = self._outcome.error or error
        self._outcome.error = self._outcome.error or session.error
        if session.journal_folder.exists():
            self._outcome.journal = session.journal_folder
            for stretch in session.kept:
                self._display.notice(f"kept in the journal, in no shot: {stretch.why}, {stretch.lasting}")

    def _write_log(self, name: str) -> None:
        """Keep what the session decided and made: the journal, which has it too, is removed."""
        path = self._options.out / "sessions" / f"{name}.json"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(self._outcome.to_json(), indent=1), encoding="utf-8")
        except OSError as error:
            self._display.notice(f"the session's log cannot be written to {path}: {error.strerror or error}")
        else:
            self._outcome.log = path

    def _pressed(self, session: LiveSession) -> bool:
        """Do what a key says; tell whether it is to end."""
        key = self._display.key()
        if key == "a":
            session.arm()
            self._display.notice("armed")
        elif key == "d":
            session.disarm()
            self._display.notice("disarmed: nothing will trigger")
        elif key == "t":
            session.fire()
        return key == "q"

    def _decided(self, decision: Decision) -> None:
        self._outcome.decisions.append(decision)
        what = decision.outcome if not decision.reason else f"{decision.outcome}: {decision.reason}"
        where = f"{decision.channel} at {decision.value:.4g}" if decision.value is not None else "by hand"
        self._display.notice(f"{what} ({where})")

    def _look(self, session: LiveSession, timeout_s: float) -> None:
        """Look once at everything that may have happened."""
        window = session.next_window(timeout_s)
        if window is not None:
            self._begin(session, window)
        self._take_cuts()
        self._take_files()
        self._convert_next()
        self._take_conversion(session)

    def _begin(self, session: LiveSession, window: ShotWindow) -> None:
        """Name a shot and cut it out of the journal."""
        name = self._free_name()
        self._shots.append(LiveShot(name, window, wanted=set(self._elsewhere)))
        self._cutting[name] = self._pool.submit(session.cut, name, window, self._options.out / "captures" / name)

    def _free_name(self) -> str:
        out = self._options.out
        while True:
            name = f"{self._next:04d}"
            self._next += 1
            if not (out / f"{name}.h5").exists() and not (out / "captures" / name).exists():
                return name

    def _take_cuts(self) -> None:
        for shot in self._shots:
            future = self._cutting.get(shot.name)
            if future is None or not future.done():
                continue
            del self._cutting[shot.name]
            try:
                captured = future.result()
            except RecoilDaqError as error:
                self._fail(shot, str(error))
                continue
            self._captured(shot, captured)

    def _captured(self, shot: LiveShot, captured: CapturedShot) -> None:
        acquisition = captured.acquisition
        shot.captured, shot.acquisition = captured.folder, acquisition
        shot.files |= {s.name: captured.folder / s.file for s in acquisition.sources if s.file}
        shot.state, shot.complete_s = "waiting", time.monotonic()
        text = f"shot {shot.name} captured: {acquisition.duration_s:.3f} s"
        text += f", {1e3 * acquisition.pre_actual_s:.0f} ms of them before the trigger"
        if shot.missing and self._watch is not None:
            text += f"; waiting for files of {', '.join(shot.missing)}"
        self._display.notice(text)

    def _take_files(self) -> None:
        if self._watch is None:
            return
        for file in self._watch.poll():
            try:
                self._unmatched.append((file, source_of(self._rig, file)))
            except RecoilDaqError as error:
                self._display.notice(f"left alone: {error}")
        for file, source in tuple(self._unmatched):
            try:
                shot = shot_of(file, source, self._shots)
            except ReadError as error:
                self._display.notice(f"left alone: {error}")
                self._unmatched.remove((file, source))
                continue
            if shot is not None:
                shot.files[source] = file.path
                self._unmatched.remove((file, source))
                self._display.notice(f"{file.path.name} is of shot {shot.name}, source {source}")
            elif time.monotonic() - file.seen_s > self._trigger.post_s + _UNMATCHED_S:
                self._display.notice(f"left alone: {file.path}: no shot waits for a file of {source}")
                self._unmatched.remove((file, source))

    def _convert_next(self) -> None:
        """Convert the first shot that has its files, or has waited for them long enough."""
        if self._conversion is not None:
            return
        for shot in self._shots:
            if shot.state != "waiting":
                continue
            waited = self._watch is None or time.monotonic() - shot.complete_s > self._options.files_within_s
            if shot.missing and not waited:
                continue
            if self._rig.reference_clock not in shot.files:
                self._give_up(shot)
                continue
            record = () if shot.captured is None else (shot.captured / f"{shot.name}_acquisition.json",)
            files = [*shot.files.values(), *record]
            shot.state = "converting"
            self._conversion = shot, Conversion(self._rig.path, files, shot.name, self._options.out)
            return

    def _take_conversion(self, session: LiveSession) -> None:
        if self._conversion is None:
            return
        shot, conversion = self._conversion
        result = conversion.result()
        if result is None:
            return
        self._conversion = None
        code, document = result
        if code not in (0, 1) or "file" not in document:
            self._fail(shot, str(document.get("message", f"the conversion ended with code {code}")))
            return
        shot.document = document
        shot.state = "usable" if document["usable"] else "not usable"
        if shot.window is not None:
            session.release(shot.window)
        self._display.verdict(document)

    def _give_up(self, shot: LiveShot) -> None:
        shot.state = "incomplete"
        shot.problem = f"no file of {', '.join(shot.missing)}"
        command = f"recoil-daq ingest {self._rig.path} {shot.captured}/* FILES --out {self._options.out}"
        self._display.notice(f"shot {shot.name}: {shot.problem}; its captures are kept, finish it with `{command}`")

    def _fail(self, shot: LiveShot, problem: str) -> None:
        shot.state, shot.problem = "failed", problem
        self._display.notice(f"shot {shot.name}: {problem}; its data is kept")
