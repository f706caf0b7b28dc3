"""The armed screen in a terminal: draws the range's state, prints what leaves the picture above it, and reads keys."""

from __future__ import annotations

import contextlib
import io
import math
import sys
import threading
import time
from collections.abc import Hashable, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_daq.live.notice_board import Notice, NoticeBoard
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.screen.keyboard import Keyboard
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from recoil_daq.live.screen.screen_shots import LARGE_S, SHOT_STYLES
from recoil_daq.live.shot import ShotState
from recoil_daq.terminal.verdict_line import VerdictLine

if TYPE_CHECKING:
    from rich.console import Console

DRAWS_PER_S = 5
RING_EVERY_S = 0.4
"""Time between two sounds of the terminal, s: closer ones are one to the ear."""
WORDS_KEY = "w"
"""Key that the screen answers itself: it shows the warnings in words, or the channels again."""


class ArmedScreen:
    """Shows a live session in a terminal, and reads its keys.

    A notice is in the picture as long as it is among the newest there, and then printed above it, where it stays: each
    is to be seen once. Only the thread that made the screen writes. A notice of another thread is kept until that one
    draws: a terminal that is held up must not halt the watch for the trigger.

    Parameters
    ----------
    console
        Console to draw on; that of stdout if left out.
    """

    def __init__(self, console: Console | None = None) -> None:
        from rich.live import Live

        from recoil_daq.terminal.console import VisibleConsole

        self._console = console or VisibleConsole()
        self._live = Live(
            console=self._console, auto_refresh=False, transient=True, vertical_overflow="crop",
            redirect_stderr=sys.stderr.isatty(),
        )  # fmt: skip
        self._keyboard = Keyboard()
        self._writer = threading.get_ident()
        self._board = NoticeBoard()
        self._pictured = False  # while it is, what is new is seen in the next picture
        self._words = False
        self._alert = ""
        self._drawn_s = -math.inf
        self._rings, self._rung_s = 0, -math.inf
        self._sounded: dict[str, ShotState] = {}
        self._errors: str | None = None

    def __enter__(self) -> ArmedScreen:
        self._keyboard.__enter__()
        try:
            stream = self._console.file
            if isinstance(stream, io.TextIOWrapper):
                self._errors = stream.errors
                stream.reconfigure(errors="replace")  # a file's name may hold what the terminal cannot show
            self._live.start()
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            with contextlib.suppress(OSError):
                self._print_until(math.inf)
        finally:
            try:
                with contextlib.suppress(OSError):
                    self._live.stop()
            finally:
                self._keyboard.__exit__(kind, error, trace)
                stream = self._console.file
                if self._errors is not None and isinstance(stream, io.TextIOWrapper):
                    stream.reconfigure(errors=self._errors)

    def show(self, state: RangeState) -> None:
        """Draw, some times per second."""
        from rich.console import Group

        now_s = time.monotonic()
        if now_s - self._drawn_s < 1 / DRAWS_PER_S:
            return
        self._drawn_s = now_s
        drawn = picture(state, self.look)
        self._pictured = state.state != "stopped"
        with contextlib.suppress(OSError):  # the terminal is gone: the session completes its shots without it
            self._print_until(drawn.first_notice if self._pictured else math.inf)
            self._live.update(Group(*drawn.lines), refresh=True)
            self._sound(state, now_s)
        self._alert = state.alert

    def _sound(self, state: RangeState, now_s: float) -> None:
        """Ring for what is new: once for an alarm and for a usable shot, twice for one that is not."""
        self._rings += bool(state.alert and not self._alert)
        for shot in state.shots:
            told = shot.state in SHOT_STYLES and not shot.seen
            fresh = told and shot.age_s is not None and shot.age_s < LARGE_S
            if fresh and self._sounded.get(shot.name) != shot.state:
                self._sounded[shot.name] = shot.state
                self._rings += 1 if shot.state is ShotState.USABLE else 2
        if self._rings and now_s - self._rung_s >= RING_EVERY_S:
            self._rings, self._rung_s = self._rings - 1, now_s
            self._console.bell()

    @property
    def look(self) -> Look:
        """The terminal as it is now, and what somebody at its keys wants to see."""
        width, height = self._console.size
        return Look(
            width, height, has_keys=self._keyboard.available, ascii_only=self._console.options.ascii_only,
            words=self._words, printed=self._board.final,
        )  # fmt: skip

    def notice(self, text: str, same: Hashable = None) -> None:
        """Take what happened."""
        self._board.take(text, same)
        if threading.get_ident() == self._writer and not self._pictured:
            with contextlib.suppress(OSError):
                self._print_until(math.inf)

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Take the verdict on a shot, in one line: its warnings are counted, and read by key."""
        verdict = VerdictLine.of(document)
        reason = next(iter(verdict.reasons), "")
        keys = f" (key {WORDS_KEY})" if verdict.warned and self.has_keys else ""
        text = f"shot {document['shot']} {verdict.state}{verdict.without}{verdict.counted}{keys}"
        self.notice(f"{text}: {reason}" if reason else text)
        if fault := document.get("log_fault"):
            self.notice(f"shot log of {document['shot']}: {fault}")

    @property
    def noticed(self) -> tuple[Notice, ...]:
        """The newest notices."""
        return self._board.newest

    @property
    def has_keys(self) -> bool:
        """Whether there is a terminal whose keys are read."""
        return self._keyboard.available

    def key(self, *, typed: bool = False) -> str:
        """Return the key that was pressed; that for the words is answered here, unless it is of a text."""
        key = self._keyboard.key(typed=typed)
        if typed or key.lower() != WORDS_KEY:
            return key if typed else key.lower()
        self._words, self._drawn_s = not self._words, -math.inf
        return ""

    def _print_until(self, number: float) -> None:
        """Print the notices before one above the picture, in one piece each, so that a command can be copied."""
        for notice in self._board.finish(number):
            self._console.print(visible(notice.line), markup=False, soft_wrap=True)
