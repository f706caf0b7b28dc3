"""The files that other instruments drop while a live session runs: which shot each is of, and whether it grows on."""

from __future__ import annotations

import contextlib
import datetime as dt
import re
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import ReadError, RecoilDaqError, quoted
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.log.segment import SUFFIX
from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveOptions, LiveShot, ShotState, capture_path
from recoil_daq.live.shots.file_match import CLOCKS_APART_S, shots_of, source_of, sources_of_file
from recoil_daq.live.shots.folder_watch import SETTLE_S, DroppedFile, FolderWatch
from recoil_rigs.rig import Rig
from recoil_rigs.tables.rig_tables import SHOT_PLACE

_UNMATCHED_S = 10.0
"""Time after the longest shot that may still come, s, for which a file that no shot waits for is left alone."""


_RECOGNISED_S = 0.1
"""Time for which files are recognised at one look, s: a folder full of them must not hold up keys and screen."""


@dataclass(eq=False)
class Unmatched:
    """A file that is of no shot yet, and the shots among which somebody was asked to choose."""

    file: DroppedFile
    source: str
    asked: tuple[LiveShot, ...] = ()


class DroppedFiles:
    """Gives each dropped file to the one shot that it belongs to, asks where several are possible, and says so.

    Parameters
    ----------
    elsewhere
        Sources that are not recorded live.
    previewed
        Sources that are recorded live and write a file of their own too, which replaces the preview.
    post_s
        Time that the trigger records after it fired, s.
    left
        Shots of a session that crashed, whose files may lie in the folder already.

    Raises
    ------
    ReadError
        If the watched folder cannot be watched.
    """

    def __init__(
        self,
        rig: Rig,
        options: LiveOptions,
        display: Display,
        elsewhere: set[str],
        post_s: float,
        previewed: frozenset[str] = frozenset(),
        left: Sequence[LiveShot] = (),
    ) -> None:
        self._rig = rig
        self._out = options.out
        self._display = display
        self._elsewhere = elsewhere
        self._previewed = previewed
        self._post_s = post_s
        self._left = tuple(left)
        self._watch: FolderWatch | None = None
        if options.watch is not None:
            self._watch = FolderWatch(options.watch, settle_s=self._settle_s, is_new=self._may_be_left)
        self._settled: deque[DroppedFile] = deque()
        self._unmatched: list[Unmatched] = []
        self._taken: dict[Path, LiveShot] = {}
        self._away = ""

    @property
    def watched(self) -> bool:
        """Whether there is a folder to watch."""
        return self._watch is not None

    @property
    def where(self) -> str:
        """Say where which files are waited for; empty if no file is to come."""
        named = ", ".join(sorted(self._elsewhere))
        made = ", which was missing and is made" if self.folder_made else ""
        if self._previewed and self._watch is not None:
            replaced = f"files of {', '.join(sorted(self._previewed))} replace what was read live"
            replaced += f" when they come into {self._watch.folder}"
            if not named:
                return f"{replaced}{made}"
            return f"files of {named} are waited for in {self._watch.folder}{made}; {replaced}"
        if not named:
            return ""
        if self._watch is None:
            return f"files of {named} are not waited for: --watch FOLDER does, or `recoil-daq ingest` takes them later"
        return f"files of {named} are waited for in {self._watch.folder}{made}"

    @property
    def growing(self) -> bool:
        """Whether a file is there that may not be complete."""
        return bool(self._settled) or (self._watch is not None and bool(self._watch.growing))

    @property
    def folder(self) -> Path | None:
        """The folder that is watched; None if there is none."""
        return None if self._watch is None else self._watch.folder

    @property
    def away(self) -> str:
        """Sentence on why no file can come: the folder has not been readable for a while; empty if it is."""
        if self._watch is None or not self._watch.away:
            return ""
        return f"the watched folder {self._watch.folder} CANNOT BE READ: {self._watch.away}"

    @property
    def folder_made(self) -> bool:
        """Whether that folder was missing, and made."""
        return self._watch is not None and self._watch.made

    def growing_of(self, source: str) -> tuple[tuple[str, int], ...]:
        """Return names and sizes, in bytes, of the files of a source that have not stopped growing."""
        sizes = {} if self._watch is None else self._watch.sizes
        return tuple((name, size) for name, size in sizes.items() if source in self._named(name))

    def last_of(self, source: str) -> str:
        """Return the name of the last file that was given to a shot as one of a source; empty if there is none."""
        given = [path.name for path, shot in self._taken.items() if shot.files.get(source) == path]
        return given[-1] if given else ""

    def of_shot(self, shot: LiveShot) -> list[Path]:
        """Return the files that were given to a shot."""
        return [path for path, one in self._taken.items() if one is shot]

    def take(self, shots: Sequence[LiveShot], *, recording: bool, at_once: bool = False) -> None:
        """Look at the folder.

        Parameters
        ----------
        shots
            All shots of the session.
        recording
            Whether a shot is being recorded: a file that has come may be of it, so nothing is given to another
            meanwhile.
        at_once
            Whether to look although the folder was looked at a moment ago.
        """
        if self._watch is None:
            return
        self._settled += self._watch.poll(at_once=at_once)
        until_s = time.monotonic() + _RECOGNISED_S
        while self._settled and (at_once or time.monotonic() <= until_s):
            self._recognise(self._settled.popleft())
        self._tell_away()
        for path, shot in tuple(self._taken.items()):
            if path.name in self._watch.growing:
                self._grows(shot, path)
            elif path.name in shot.growing and not self._watch.away and not path.exists():
                self._gone(shot, path)
        for one in () if recording else tuple(self._unmatched):
            self._match(one, shots)

    def _recognise(self, file: DroppedFile) -> None:
        """Find the source of a file that has settled; one of none is left alone, and that is said."""
        if file.path in self._taken:
            self._settled_again(self._taken[file.path], file.path)
            return
        if self._rig.is_own_file(file.path):
            return
        try:
            self._unmatched.append(Unmatched(file, source_of(self._rig, file)))
        except RecoilDaqError as error:
            self._display.notice(f"left alone: {error}")
        except Exception as error:  # whatever a reader meets in it, it ends this file and not the session
            text = f"cannot be recognised: {type(error).__name__}: {error}"
            self._display.notice(f"left alone: {file.path}: {text}")

    def _match(self, one: Unmatched, shots: Sequence[LiveShot]) -> None:
        """Give a file to the one shot that it belongs to; ask where several are possible."""
        file, source = one.file, one.source
        declared = self._rig.source(source)
        pattern = declared.pattern if SHOT_PLACE in (declared.match or "") else None
        try:
            found = shots_of(file, source, shots, pattern)
        except ReadError as error:
            self._display.notice(f"left alone: {error}")
            self._unmatched.remove(one)
            return
        if not file.path.exists():
            self._unmatched.remove(one)  # seen again under its new name
        elif len(found.shots) == 1:
            self._assign(one, found.shots[0], by_number=found.by_number)
        elif found.shots and found.shots != one.asked:
            one.asked = found.shots
            self._ask(one)
        elif not found.shots and time.monotonic() - file.seen_s > self._post_s + _UNMATCHED_S:
            why = f"{found.why_none}; write the shot's number into its name, or ingest by hand"
            self._display.notice(f"left alone: {file.path}: {self._of_before(file.path, pattern, shots) or why}")
            self._unmatched.remove(one)

    def _assign(self, one: Unmatched, shot: LiveShot, *, by_number: bool = False) -> None:
        path = one.file.path
        if not shot.takes(one.source):
            command = self._command(shot.name, path)
            self._display.notice(f"shot {shot.name} waits no longer: `{command}` with its other files")
            self._unmatched.remove(one)
            return
        sources = [s for s in sources_of_file(self._rig, one.source, path) if s == one.source or shot.takes(s)]
        begun = shot.state in (ShotState.CONVERTING, ShotState.INCOMPLETE) or shot.document is not None
        why = "replaces the preview" if shot.previews.intersection(sources) else "came late"
        shot.files |= dict.fromkeys(sources, path)
        self._taken[path] = shot
        self._unmatched.remove(one)
        if not by_number:
            shot.by_time |= set(sources)
        how = "" if by_number else ", by time alone"
        named = f"source{'' if len(sources) == 1 else 's'} {', '.join(sources)}"
        self._display.notice(f"{path.name} is of shot {shot.name}, {named}{how}")
        if begun:
            shot.redo = f"{path.name} {why}"
            if shot.document is not None:
                shot.state, shot.problem = ShotState.NOT_WHOLE, shot.redo

    def _ask(self, one: Unmatched) -> None:
        """Ask whose file it is; it stays where it is until somebody says so."""
        path, names = one.file.path, [shot.name for shot in one.asked]
        keys = " or ".join(str(i + 1) for i in range(len(names[:9])))
        press = f"press {keys}, " if self._display.has_keys else ""
        command = self._command(names[0], path)
        self._display.notice(
            f"whose is {path.name}? A file of {one.source} for shot {' or '.join(names)}: {press}"
            f"rename it to {path.stem}_{names[-1]}{path.suffix} or so, or ingest by hand, such as `{command}`"
        )

    def _of_before(self, path: Path, pattern: re.Pattern[str] | None, shots: Sequence[LiveShot]) -> str:
        """Say how a file comes into the shot of its number that a session before recorded; empty if there is none."""
        numbers = numbers_of(path, pattern) - {int(shot.name) for shot in shots if shot.name.isdecimal()}
        captured = sorted(one.stem for one in capture_path(self._out, "").parent.glob(f"*{SUFFIX}"))
        for shot in (name for name in captured if name.isdecimal() and int(name) in numbers):
            anew = " --overwrite" if (self._out / f"{shot}.h5").exists() else ""
            command = self._command(shot, path) + anew
            return f"shot {shot} is of a session before, `{command}` with its other files takes it into that"
        return ""

    def _command(self, shot: str, path: Path) -> str:
        """Return the command that takes a file into a shot by hand."""
        rig, capture, file, out = map(quoted, (self._rig.path, capture_path(self._out, shot), path, self._out))
        return f"recoil-daq ingest {rig} {capture} {file} --out {out}"

    @property
    def asked(self) -> str:
        """The question whose a file is, in short; empty if there is none."""
        for one in self._unmatched:
            if one.asked:
                keys = ", ".join(f"{i + 1} {shot.name}" for i, shot in enumerate(one.asked[:9]))
                return f"of which shot is {one.file.path.name}, a file of {one.source}? {keys}"
        return ""

    def answered(self, key: str) -> None:
        """Take the answer to the question whose a file is."""
        for one in self._unmatched if key.isdecimal() else ():
            if 1 <= int(key) <= len(one.asked):
                self._assign(one, one.asked[int(key) - 1], by_number=True)
                return

    def _grows(self, shot: LiveShot, path: Path) -> None:
        """Note that a file grows that was taken for complete."""
        if path.name in shot.growing:
            return
        shot.growing.add(path.name)
        text = "it is converted when the file has settled"
        if shot.document is not None:
            shot.state, shot.problem = ShotState.NOT_WHOLE, f"{path.name} grew after it was taken"
            text = "its shot file is made anew when the file has settled"
        self._display.notice(f"shot {shot.name} is NOT WHOLE: {path.name} grew after it was taken; {text}")

    def _gone(self, shot: LiveShot, path: Path) -> None:
        """Give back a file that grew after it was taken, and then was taken away: another one is waited for."""
        shot.growing.discard(path.name)
        if shot.document is not None:
            shot.state, shot.problem = ShotState.NOT_WHOLE, f"{path.name} grew after it was taken, and is gone"
            self._display.notice(f"shot {shot.name} stays NOT WHOLE: {shot.problem}; its shot file is the one before")
            return
        del self._taken[path]
        shot.files = {source: file for source, file in shot.files.items() if file != path}
        self._display.notice(f"{path.name} is gone again: shot {shot.name} waits for {', '.join(shot.missing)}")

    def _tell_away(self) -> None:
        """Say that the folder cannot be read, or can again, once each."""
        if self.away != self._away:
            back = f"the watched folder {self.folder} can be read again"
            self._display.notice(f"{self.away}; files that come meanwhile are seen when it can" if self.away else back)
            self._away = self.away

    def _settled_again(self, shot: LiveShot, path: Path) -> None:
        self._grows(shot, path)
        shot.growing.discard(path.name)
        shot.redo = f"{path.name} grew after it was taken"

    def _may_be_left(self, path: Path) -> bool:
        """Return whether a file that lies in the folder already bears the number of a shot that waits for it."""
        numbers = self._numbers_of(path)
        with contextlib.suppress(OSError):
            written_s = path.stat().st_mtime
            return any(
                shot.name.isdecimal() and int(shot.name) in numbers and written_s >= _fired_s(shot) - CLOCKS_APART_S
                for shot in self._left
            )
        return False

    def _numbers_of(self, path: Path) -> frozenset[int]:
        """Return the numbers in a file's name that may be a shot's, by any source that it may be of."""
        found: frozenset[int] = frozenset()
        for name in self._named(path.name):
            declared = self._rig.source(name)
            pattern = declared.pattern if SHOT_PLACE in (declared.match or "") else None
            found |= numbers_of(path, pattern)
        return found

    def _settle_s(self, name: str) -> float:
        """Return how long a file must have stayed the same: as its source says, or the longest of all."""
        sources = [self._rig.source(source) for source in self._named(name)]
        return max((source.settle_s for source in sources), default=SETTLE_S)

    def _named(self, name: str) -> list[str]:
        """Return the sources whose file one of a name may be; all that are waited for if the name says none."""
        matching = [source.name for source in self._rig.matching(name)]
        return matching or [s.name for s in self._rig.sources if s.name in self._elsewhere | self._previewed]


def _fired_s(shot: LiveShot) -> float:
    """Return the wall-clock time at which a shot was fired by its capture, seconds since 1970 UTC."""
    if shot.acquisition is None:
        return 0.0
    return dt.datetime.fromisoformat(shot.acquisition.trigger_utc).replace(tzinfo=dt.UTC).timestamp()
