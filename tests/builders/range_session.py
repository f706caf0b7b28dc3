"""A live session without devices, whose shots, conversions, keys and signals a test decides on, step by step."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from recoil_acquisition.capture.live_session import CapturedShot
from recoil_acquisition.capture.session_record import session_folder
from recoil_acquisition.capture.status import LiveStatus
from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.devices.device import Block, event_block
from recoil_acquisition.shot.acquisition import AcquiredSource, Acquisition
from recoil_acquisition.trigger import ShotWindow
from recoil_daq.live import range as live_range
from recoil_daq.live import range_keys, range_states
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.range import LiveRange
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.shot import LiveOptions, LiveOutcome
from recoil_daq.live.shots import dropped_files, folder_watch, shot_work
from recoil_rigs.rig import Rig
from tests.builders.live_status import status
from tests.builders.played_clock import PlayedClock


class Told:
    """A display that keeps what it is told, and presses keys when something is told."""

    def __init__(self, *, keys: Mapping[str, str] | None = None, has_keys: bool = False) -> None:
        self.notices: list[str] = []
        self.alerts: list[str] = []
        self.until_s = time.monotonic() + 60.0
        self.verdicts: list[Mapping[str, Any]] = []
        self.has_keys = has_keys
        self.then: dict[str, Callable[[], None]] = {}
        self.quits: Callable[[], bool] = lambda: False
        self.states: list[tuple[str, ...]] = []
        self._keys = dict(keys or {})
        self._pressed: list[str] = []
        self._same: object = None

    def show(self, state: RangeState) -> None:
        if time.monotonic() > self.until_s:
            raise TimeoutError(f"the session does not end: {self.notices}")
        states = tuple(shot.state for shot in state.shots)
        if not self.states or self.states[-1] != states:
            self.states.append(states)
        if not self.alerts or self.alerts[-1] != state.alert:
            self.alerts.append(state.alert)

    def notice(self, text: str, same: object = None) -> None:
        if same is not None and same == self._same:
            return  # a display counts it
        self._same = same
        self.notices.append(text)
        for begin in [b for b in self._keys if b in text]:
            self._pressed += self._keys.pop(begin)
        for begin in [b for b in self.then if b in text]:
            self.then.pop(begin)()

    def verdict(self, document: Mapping[str, Any]) -> None:
        self.verdicts.append(document)
        if "verdict" in self.then:
            self.then.pop("verdict")()

    @property
    def noticed(self) -> tuple[Notice, ...]:
        return ()

    def key(self, *, typed: bool = False) -> str:  # noqa: ARG002 - a display has it
        if not self._pressed and self.quits():
            self.quits = lambda: False
            self._pressed += "y"  # it is armed, and asks
            return "q"
        return self._pressed.pop(0) if self._pressed else ""

    def told(self, words: str) -> list[str]:
        return [text for text in self.notices if words in text]


class PlayedSession:
    """Stands in for `LiveSession`: shots come when the test has them fired."""

    def __init__(self, folder: Path, clock: PlayedClock) -> None:
        self.journal_folder, self._clock = folder, clock
        folder.mkdir(parents=True)
        (folder / "000001.rdlog").write_bytes(b"journal")
        self.record = SimpleNamespace(anchor=Anchor(1_000_000_000_000_000_000, 0, 0))
        self.windows: list[ShotWindow] = []
        self.open: list[tuple[ShotWindow, Callable[[], bool]]] = []
        self.events: list[Block] = []
        self.armed = self.stopped = False
        self.error = None
        self.complete: bool | None = None
        self.kept = ()

    def start(self) -> None: ...

    def arm(self) -> None:
        self.armed = True

    def disarm(self) -> None:
        self.armed = False

    def fired(self, *triggers_s: float) -> None:
        """Have complete windows."""
        self.windows += [window_at(t) for t in triggers_s]

    def opened(self, trigger_s: float, closes: Callable[[], bool]) -> None:
        """Have a shot whose post time runs until something says that it is over."""
        self.open.append((window_at(trigger_s), closes))

    @property
    def recording(self) -> bool:
        self.windows += [window for window, closes in self.open if closes()]
        self.open = [one for one in self.open if one[0] not in self.windows]
        return bool(self.open or self.windows)

    @property
    def idle(self) -> bool:
        return not self.recording

    @property
    def status(self) -> LiveStatus:
        return status(state="armed" if self.armed else "disarmed")

    def next_window(self, timeout_s: float) -> ShotWindow | None:
        if self.windows:
            return self.windows.pop(0)
        self._clock.sleep(timeout_s)
        return None

    def cut(self, name: str, window: ShotWindow, path: Path) -> CapturedShot:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"imu")
        imu = AcquiredSource("imu", "serial", path.name, 1, 3, 0.1, False, 0.0, 0, 0, 0, None, 0, -1.0, ())
        acquisition = Acquisition(
            shot=name, rig="mixed", trigger_ns=round(window.trigger_s * 1e9), trigger_utc="2026-01-01T00:00:00",
            pre_s=0.1, post_s=1.0, pre_actual_s=0.1, duration_s=1.1, decisions=(),
            sources=(imu,),
        )  # fmt: skip
        return CapturedShot(name, path, acquisition)

    def release(self, window: ShotWindow) -> None: ...

    def device_events(self) -> tuple[Block, ...]:
        events, self.events = tuple(self.events), []
        return events

    def happened(self, source: str, at_s: float, name: str) -> None:
        self.events.append(event_block(source, round(at_s * 1e9), name, "/dev/ttyUSB0"))

    def rate_hz(self, _source: str) -> float:
        return 34_000.0

    def stop(self) -> None:
        self.windows += [window for window, _ in self.open]
        self.open = []
        self.stopped = True

    def close(self, *, complete: bool) -> None:
        self.complete = complete
        if complete:
            (self.journal_folder / "000001.rdlog").unlink()
            self.journal_folder.rmdir()


class PlayedConversion:
    """Stands in for `Conversion`: ends when the test says so, and writes the shot file."""

    may_end: Callable[[], bool] = staticmethod(lambda: True)
    answer: Mapping[str, Any] | None = None
    started: ClassVar[list[tuple[str, list[str], str]]] = []
    ended: ClassVar[list[str]] = []
    rigs: ClassVar[list[Rig]] = []
    without: ClassVar[list[tuple[str, ...]]] = []

    def __init__(self, rig: Rig, files: Sequence[Path], shot: str, out: Path, **options: Any) -> None:
        self._shot, self._out = shot, out
        type(self).rigs.append(rig)
        type(self).without.append(tuple(options.get("without", ())))
        type(self).started.append((shot, sorted(f.name for f in files), str(options.get("replaces", ""))))

    def result(self) -> tuple[int, dict[str, Any]] | None:
        if not type(self).may_end():
            return None
        answer, type(self).answer = self.answer, None
        if answer is not None and "message" in answer:
            return 3, dict(answer)
        path = self._out / f"{self._shot}.h5"
        path.write_bytes(b"shot")
        made = {"file": str(path), "usable": True, "reasons": [], "quality": []}
        return 0, {**made, **(answer or {})}

    def end(self) -> None:
        type(self).ended.append(self._shot)


class Range:
    """A range with one played session.

    Parameters
    ----------
    monkeypatch : pytest.MonkeyPatch
    rig : Rig
    out : Path
    display : Told
    **options
        Of `LiveOptions`; and ``left``, shots of a session that crashed.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, rig: Rig, out: Path, display: Told, **options: Any) -> None:
        PlayedConversion.started, PlayedConversion.ended, PlayedConversion.answer = [], [], None
        PlayedConversion.rigs, PlayedConversion.without = [], []
        left = options.pop("left", ())
        PlayedConversion.may_end = staticmethod(lambda: True)
        self.out, self.display = out, display
        self._folder = OutputFolder(out)
        asked = LiveOptions(out, **options)
        worker: Any = None if asked.identify else PlayedWorker()  # the process that stays warm takes a second to start
        self.live = LiveRange(rig, asked, display, self._folder, devices={}, left=left, worker=worker)
        self.clock = PlayedClock()
        self.session = PlayedSession(session_folder(out, 0), self.clock)

        @contextmanager
        def opened(sources: Any, *_: object) -> Any:
            yield {source.name: object() for source in sources}

        def session(_devices: object) -> PlayedSession:
            self.live._journal = self.session.journal_folder
            return self.session

        for module in (live_range, range_keys, range_states, shot_work, dropped_files, folder_watch):
            monkeypatch.setattr(module, "time", self.clock)
        # each state is seen, however short, and every wait has several looks
        monkeypatch.setattr(live_range, "SHOW_EVERY_S", 0.0)
        monkeypatch.setattr(live_range, "LOOK_S", 0.02)
        monkeypatch.setattr(live_range, "opened", opened)
        monkeypatch.setattr(shot_work, "Conversion", PlayedConversion)
        monkeypatch.setattr(self.live, "_session", session)

    def run(self, started: Callable[[], None] = lambda: None) -> LiveOutcome:
        with self._folder:
            return self.live.run(started)

    @property
    def log(self) -> dict[str, Any]:
        (path,) = (self.out / "sessions").glob("*.json")
        document: dict[str, Any] = json.loads(path.read_text())
        return document


class PlayedWorker:
    """Stands in for the process that stays warm: overviews are written at once."""

    def ask(self, work: str, _item: Path, **_: Any) -> SimpleNamespace:
        found = ([], {}) if work.endswith(":refresh") else "digest"
        return SimpleNamespace(done=True, result=lambda: found)

    def look(self) -> None: ...

    def drop(self, _asked: object) -> None: ...

    def close(self) -> None: ...


def window_at(trigger_s: float) -> ShotWindow:
    return ShotWindow(trigger_s - 0.1, trigger_s, trigger_s + 1.0, 0.1, {}, ())
