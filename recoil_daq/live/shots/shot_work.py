"""The shots of a session on their way from its journal to their shot files: cut, waited for, converted.

A conversion runs in another process, so that it never keeps the reading threads waiting.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.live_session import CapturedShot, LiveSession
from recoil_acquisition.errors import FileEnd, RecoilDaqError, quoted
from recoil_acquisition.trigger import ShotWindow
from recoil_daq.live.added_mass import BARE, AddedMass
from recoil_daq.live.display import Display
from recoil_daq.live.log_words import EXCLUDE, LogWords
from recoil_daq.live.shot import LiveOptions, LiveShot, ShotState, capture_path
from recoil_daq.live.shots.conversion import Conversion, rig_changed
from recoil_daq.live.shots.dropped_files import DroppedFiles
from recoil_daq.live.shots.file_match import doubt_of_files
from recoil_daq.live.shots.preview import compared_lines
from recoil_daq.terminal.verdict_line import VerdictLine
from recoil_daq.warm_worker import WarmWorker
from recoil_rigs.rig import Rig

_MAY_BE_MENDED = (FileEnd.MISSING.value, FileEnd.UNCLEAR.value)
"""Ends of a file that is perhaps still being copied: it ends where its reader does not expect it. A file that is
damaged for good is waited for as long, and then fails its shot."""


_TO_CONVERT = (ShotState.WAITING, ShotState.NOT_WHOLE, ShotState.FAILED, ShotState.INCOMPLETE)
"""States in which a shot may be converted; in all but the first only where it is to be done anew."""


NOTED_WITHIN_S = 1.0
"""Time within which the shot log is usually written; what takes longer is said."""
RETRY_CUT_S = 10.0
"""Time after which a shot that could not be cut is cut again, s: somebody may have made room on the disk."""


class ShotWork:
    """Cuts, waits for and converts the shots of one session.

    Parameters
    ----------
    shots
        Shots of the session so far; those that begin are added.
    files
        Files that are dropped into the watched folder.
    wanted
        Sources whose files may come; a shot waits for those that the rig requires.
    previewed
        Sources that are read live, and whose own files replace the preview.
    converted
        Function called with each shot that has its shot file, after its verdict.
    excluded
        Function called with each shot that somebody at the keys excluded, or took back.
    worker
        Worker that converts; a process a shot where there is none.
    journal_keeps
        Function that returns where the data of a shot without a capture is, in words.

    Attributes
    ----------
    added_mass
        Mass that the shots to come carry, where there is a weight that the next one carries; None if nobody stated any.
    """

    def __init__(
        self,
        rig: Rig,
        options: LiveOptions,
        display: Display,
        shots: list[LiveShot],
        files: DroppedFiles,
        wanted: Collection[str],
        journal_keeps: Callable[[], str],
        previewed: frozenset[str] = frozenset(),
        converted: Callable[[LiveShot], None] = lambda _: None,
        worker: WarmWorker | None = None,
        excluded: Callable[[LiveShot], None] = lambda _: None,
    ) -> None:
        self._rig, self._options, self._display = rig, options, display
        self._shots, self._files, self._wanted = shots, files, wanted
        self._journal_keeps, self._previewed, self._converted = journal_keeps, previewed, converted
        self._excluded = excluded
        self.added_mass = options.added_mass
        self._in_turn = BARE
        self._next = options.first or 1
        self._worker = worker
        self._cutting: dict[str, Future[CapturedShot]] = {}
        self._tried_s: dict[str, float] = {}
        self._conversion: tuple[LiveShot, Conversion] | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="cut")
        # apart: a shot log that others hold for a while keeps no shot from being cut
        self._notes = ThreadPoolExecutor(1, thread_name_prefix="added mass")
        self._noting: dict[str, Future[str]] = {}
        self._writing: list[tuple[LogWords, Future[str]]] = []
        self._rig_changed = False

    @property
    def next_name(self) -> str:
        """The name that the next shot will have."""
        number = self._next
        while self._is_taken(f"{number:04d}"):
            number += 1
        return f"{number:04d}"

    def begin(self, session: LiveSession, window: ShotWindow) -> None:
        """Name a shot and cut it out of the journal."""
        name = self.next_name
        self._next = int(name) + 1
        may_stay_away = {source.name for source in self._rig.sources if not source.required}
        self._shots.append(
            LiveShot(
                name, window, wanted=set(self._wanted), unawaited=may_stay_away & set(self._wanted),
                previewed=self._previewed,
            )
        )  # fmt: skip
        if self.added_mass is not None:
            self._noting[name] = self._notes.submit(self.added_mass.note, self._options.out, name)
        self._turn(name)
        self._begin_cut(session, name, window)

    @property
    def last(self) -> LiveShot | None:
        """The shot that was fired last; None before the first."""
        return max(self._shots, key=lambda shot: shot.window.trigger_s if shot.window else 0.0, default=None)

    def see(self) -> None:
        """Note that somebody has seen the verdicts so far."""
        for shot in self._shots:
            shot.seen = shot.judged_s is not None

    def write(self, words: LogWords) -> None:
        """Write words into the shot log, behind what is being written into it."""
        self._writing.append((words, self._notes.submit(words.write, self._options.out)))

    @property
    def in_turn(self) -> AddedMass | None:
        """Mass that the next shot is to carry, until somebody says what it does; None where no weight is at hand."""
        return None if self._options.weight is None or self.added_mass is not None else self._in_turn

    def _turn(self, name: str) -> None:
        """Have the next shot carry the weight if this one does not; nobody has said so yet."""
        if (weight := self._options.weight) is None:
            return
        if self.added_mass is None:
            told = f"nobody said whether it carries {weight}: write its `added_mass_kg` into the shot log"
            self._display.notice(f"shot {name}: {told}")
            return
        self._in_turn, self.added_mass = BARE if self.added_mass.kg else weight, None

    def _is_taken(self, name: str) -> bool:
        out = self._options.out
        return (out / f"{name}.h5").exists() or capture_path(out, name).exists()

    def look(self, session: LiveSession) -> None:
        """Look once at all that may have happened to them, and do what follows from it."""
        self._take_cuts()
        self._cut_again(session)
        self._take_notes()
        self._files.take(self._shots, recording=session.recording)
        self._convert_next()
        self._take_conversion(session)

    @property
    def dispensable(self) -> dict[LiveShot, list[str]]:
        """The shots that wait for files, the first one first, each with the sources that it can go on without."""
        waiting = [shot for shot in self._shots if shot.state is ShotState.WAITING]
        found = {shot: [name for name in shot.awaited if name != self._rig.reference_clock] for shot in waiting}
        return {shot: names for shot, names in found.items() if names}

    def go_on_without(self, shot: LiveShot, names: Sequence[str]) -> None:
        """Wait no longer for sources of a shot that did not fire; a file that comes all the same is taken."""
        shot.unawaited |= {*names} & {*shot.missing}
        self._display.notice(f"shot {shot.name} goes on without {', '.join(names)}; a file that comes is taken")

    def leave_the_rest(self) -> None:
        """End the conversion under way, and say of every shot that is not complete where it is kept."""
        if self._conversion is not None:
            self._conversion[1].end()
            self._conversion = None
        for shot in self._shots:
            if not shot.settled:
                self._give_up(shot)

    def _take_cuts(self) -> None:
        for shot in self._shots:
            future = self._cutting.get(shot.name)
            if future is None or not future.done():
                continue
            del self._cutting[shot.name]
            try:
                captured = future.result()
            except Exception as error:  # whatever it is, it ends this shot and not the session
                known = isinstance(error, RecoilDaqError)
                problem = str(error) if known else f"cannot be cut: {type(error).__name__}: {error}"
                if not shot.uncut:
                    self.fail(shot, f"{problem}; it is tried again every {RETRY_CUT_S:g} s")
                shot.uncut, self._tried_s[shot.name] = True, time.monotonic()
                continue
            shot.uncut = False
            self._captured(shot, captured)

    def _cut_again(self, session: LiveSession) -> None:
        """Cut what could not be cut a while ago: its data stays in the journal."""
        for shot in self._shots:
            if not shot.uncut or shot.window is None or shot.name in self._cutting:
                continue
            if time.monotonic() - self._tried_s[shot.name] >= RETRY_CUT_S:
                self._begin_cut(session, shot.name, shot.window)

    def _begin_cut(self, session: LiveSession, name: str, window: ShotWindow) -> None:
        self._cutting[name] = self._pool.submit(session.cut, name, window, capture_path(self._options.out, name))

    def _take_notes(self) -> None:
        """Say which added masses could not be written into the shot log."""
        for name, future in tuple(self._noting.items()):
            if not future.done():
                continue
            del self._noting[name]
            try:
                fault = future.result()
            except Exception as error:  # whatever it is, it costs this note and not the shot
                fault = f"the added mass of shot {name} is not in the shot log: {type(error).__name__}: {error}"
            if fault:
                self._display.notice(fault)
        for words, future in tuple(self._writing):
            if future.done():
                self._writing.remove((words, future))
                self._written(words, future)

    def _written(self, words: LogWords, future: Future[str]) -> None:
        """Say what came of words for the shot log; who is excluded counts no more in what the shots say together."""
        try:
            fault = future.result()
        except Exception as error:  # whatever it is, it costs these words and not the shot
            fault = f"{words} is NOT in the shot log: {type(error).__name__}: {error}"
        self._display.notice(fault or str(words))
        for shot in self._shots if words.column == EXCLUDE and not fault else ():
            if shot.name == words.shot:
                shot.excluded = words.text
                self._excluded(shot)

    def _captured(self, shot: LiveShot, captured: CapturedShot) -> None:
        acquisition = captured.acquisition
        shot.captured, shot.acquisition = captured.path, acquisition
        # an instrument's own file may have been there sooner
        shot.files = {s.name: captured.path for s in acquisition.sources if s.file} | shot.files
        shot.state, shot.problem, shot.complete_s = ShotState.WAITING, "", time.monotonic()
        text = f"shot {shot.name} captured: {acquisition.duration_s:.3f} s"
        text += f", {1e3 * acquisition.pre_actual_s:.0f} ms of them before the trigger"
        if shot.awaited and self._files.watched:
            text += f"; waiting for files of {', '.join(shot.awaited)}"
        self._display.notice(text)

    def _convert_next(self) -> None:
        """Convert the first shot that has its files, or has waited for them long enough."""
        if self._conversion is not None:
            return
        for shot in self._shots:
            if shot.state is ShotState.WAITING and shot.growing and self._waited_out(shot):
                self.fail(shot, shot.problem or f"{min(shot.growing)} still grows: it is converted when that ends")
            if shot.growing or shot.state not in _TO_CONVERT or shot.name in self._noting:
                continue
            if shot.state is not ShotState.WAITING and not shot.redo:
                continue
            if shot.awaited and not self._waited_out(shot):
                continue
            if self._rig.reference_clock not in shot.files:
                shot.redo = ""
                self._give_up(shot)
                continue
            files = list(dict.fromkeys([*shot.files.values(), *self._behind(shot)]))
            replaces = "" if shot.document is None else shot.redo
            shot.state, shot.redo, shot.problem = ShotState.CONVERTING, "", ""
            out, worker = self._options.out, self._worker
            self._look_at_rig()
            said = {source.name for source in self._rig.sources if source.required} & shot.unawaited & {*shot.missing}
            without = (*self._options.without, *sorted(said))
            conversion = Conversion(self._rig, files, shot.name, out, replaces=replaces, without=without, worker=worker)
            self._conversion = shot, conversion
            return

    @staticmethod
    def _behind(shot: LiveShot) -> list[Path]:
        """Return the capture of a shot whose preview was replaced: the file is compared with it."""
        replaced = shot.previewed - shot.previews
        return [shot.captured] if replaced and shot.captured is not None and shot.captured.is_file() else []

    def _look_at_rig(self) -> None:
        """Say once that the rig file was changed: a shot is converted with the rig that it was acquired with."""
        if not self._rig_changed and rig_changed(self._rig.path, self._rig.text):
            self._rig_changed = True
            text = f"{self._rig.path} was changed since it was armed: shots are converted as it was then"
            self._display.notice(f"{text}; end the session and arm again to take the new one")

    def _waited_out(self, shot: LiveShot) -> bool:
        """Return whether a shot has waited for files for as long as it should."""
        return not self._files.watched or time.monotonic() - shot.complete_s > self._options.files_within_s

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
            self._not_converted(shot, code, document)
            return
        shot.document = document
        shot.state, shot.judged_s = ShotState(VerdictLine.of(document).state.value), time.monotonic()
        shot.seen = False
        if shot.growing or shot.redo:
            shot.state = ShotState.NOT_WHOLE
            shot.problem = shot.redo or f"{min(shot.growing)} grew after it was taken"
        elif doubtful := doubt_of_files(shot, self._shots):
            shot.problem = f"perhaps the file of another shot: {doubtful}"
            self._display.notice(f"shot {shot.name}: {shot.problem}")
        for text in compared_lines(document) if shot.previewed - shot.previews else ():
            self._display.notice(f"shot {shot.name}: {text}")
        if shot.window is not None:
            session.release(shot.window)
        self._display.verdict(document)
        self._converted(shot)

    def _not_converted(self, shot: LiveShot, code: int, document: Mapping[str, Any]) -> None:
        problem = str(document.get("message", f"the conversion ended with code {code}"))
        cut = [path for path in self._files.of_shot(shot) if str(path) == document.get("path")]
        if shot.document is not None:
            shot.state, shot.problem = ShotState.NOT_WHOLE, f"its shot file is the one from before: {problem}"
            self._display.notice(f"shot {shot.name} stays NOT WHOLE: {problem}")
        elif cut and document.get("file_end") in _MAY_BE_MENDED and not shot.redo:
            shot.state, shot.problem = ShotState.WAITING, problem
            shot.growing.add(cut[0].name)
            self._display.notice(f"shot {shot.name} waits for the rest of {cut[0].name}: {problem}")
        else:
            self.fail(shot, problem)

    def _give_up(self, shot: LiveShot) -> None:
        if shot.document is not None:
            shot.state = ShotState.NOT_WHOLE
            self._display.notice(f"shot {shot.name} stays NOT WHOLE: {shot.problem}")
            return
        shot.state, shot.judged_s = ShotState.INCOMPLETE, time.monotonic()
        if shot.missing:
            shot.problem = f"no file of {', '.join(shot.missing)}"
        elif not shot.growing:
            shot.problem = "given up before it was converted"
        text = f"shot {shot.name}: {shot.problem}; {self._kept(shot)}"
        if shot.captured is not None and shot.captured.is_file():
            dropped = [str(path) for path in shot.files.values() if path != shot.captured]
            files = " ".join([*map(quoted, (shot.captured, *dropped)), *(["FILES"] if shot.missing else [])])
            rig, out = quoted(self._rig.path), quoted(self._options.out)
            text += f", finish it with `recoil-daq ingest {rig} {files} --out {out}`"
        self._display.notice(text)

    def fail(self, shot: LiveShot, problem: str) -> None:
        """End a shot, and say why and where its data is."""
        shot.state, shot.problem, shot.judged_s = ShotState.FAILED, problem, time.monotonic()
        self._display.notice(f"shot {shot.name}: {problem}; {self._kept(shot)}")

    def _kept(self, shot: LiveShot) -> str:
        """Say where the data of a shot is, after a look at whether it is."""
        if shot.captured is not None and shot.captured.is_file():
            return f"its capture is kept: {shot.captured}"
        return self._journal_keeps()

    def close(self) -> None:
        """Cut no more, give up every shot that is not complete, and wait for what is still to be in the shot log."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self.leave_the_rest()
        writing = [*self._noting.values(), *(future for _, future in self._writing)]
        if waiting := wait(writing, NOTED_WITHIN_S).not_done:
            late = [f"the added mass of {name}" for name, future in self._noting.items() if future in waiting]
            late += [str(words) for words, future in self._writing if future in waiting]
            self._display.notice(f"the shot log is in use: it is waited for, for {', '.join(late)}")
        self._notes.shutdown()
        self._take_notes()
