"""A live session as plain lines, for a pipe or a log: what happened at once, how it is doing now and then."""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import sys
import threading
import time
from collections import deque
from collections.abc import Hashable, Mapping
from types import TracebackType
from typing import Any, TextIO

from recoil_acquisition.capture.status import SourceStatus
from recoil_acquisition.errors import visible
from recoil_daq.live.notice_board import Notice, NoticeBoard
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.screen.repeated_notices import RepeatedNotices
from recoil_daq.live.shot import ShotState, losses_of

_ON_THE_WAY = (ShotState.CUTTING, ShotState.WAITING, ShotState.CONVERTING)

STATUS_EVERY_S = 60.0
"""Time between two lines on how the session is doing, s, where nothing changes: more often they would hide what
happens."""
CHANGE_AFTER_S = 1.0
"""Least time between two such lines, s, where the trigger's state or the losses change."""

SILENT_AFTER_S = 3.0
"""Silence of a source, s, after which that is written at once, as a loss is."""

UNSYNCED_S = 0.5
"""Age by which data should be on the disk, s: twice the time between two syncs of the journal."""


class PlainLog:
    """Writes lines, each with its time in UTC, and flushes every one.

    Only the thread that made it writes. A notice of another thread is kept, with its time, until that one comes by:
    a reader of the log that does not read must not halt the watch for the trigger. A log that cannot be written ends
    no session either; stderr says so, once.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._writer = threading.get_ident()
        self._waiting: deque[str] = deque()
        self._failed = False
        self._board = NoticeBoard()
        self._shown_s = -STATUS_EVERY_S
        self._shown: tuple[object, ...] = ()
        self._repeated = RepeatedNotices(lambda text: self._write(_stamped(text)))

    def __enter__(self) -> PlainLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._repeated.end()
        self._write("")

    def show(self, state: RangeState) -> None:
        """Write how it is doing, every minute and when the state or the losses change."""
        self._repeated.look()
        self._write("")
        now_s = time.monotonic()
        sources = ((losses_of(s.counters), s.error, _silent(s)) for s in state.live)
        alert = state.alert if not state.alarms else ""  # each of them is in a line of its own
        telling = (state.state, alert, state.alarms > 0, bool(state.cautions), *sources)
        due = STATUS_EVERY_S if telling == self._shown else CHANGE_AFTER_S
        if now_s - self._shown_s < due:
            return
        self._shown_s, self._shown = now_s, telling
        waiting = sum(shot.state in _ON_THE_WAY for shot in state.shots)
        parts = [
            f"{state.state} - {state.alert}" if state.alert else state.state,
            *(_source(s) for s in state.live),
        ]
        parts.append(f"shots {state.triggered}" + (f", {waiting} not finished" if waiting else ""))
        parts.append(f"disk {state.disk_free_bytes / 1e9:.1f} GB free")
        parts += [f"look at: {'; '.join(state.cautions)}"] if state.cautions else []
        if state.unsynced_s > UNSYNCED_S:
            parts.append(f"unsynced {state.unsynced_s:.1f} s")
        if state.unseen_bytes:
            parts.append(f"the trigger fell behind by {state.unseen_bytes} bytes")
        self._write(_stamped(" | ".join(parts)))

    def notice(self, text: str, same: Hashable = None) -> None:
        """Write what happened; the same again and again is a count."""
        self._board.take(text, same)
        self._repeated.notice(text, same)

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Write the verdict on a shot, every line with its time."""
        from recoil_daq.terminal.console import PIPED_WIDTH, VisibleConsole
        from recoil_daq.terminal.ingest import print_verdict

        on_terminal = self._stream.isatty() or None
        width = None if on_terminal else PIPED_WIDTH
        table = io.StringIO()  # written on a broken pipe, rich would end the program
        print_verdict(document, VisibleConsole(file=table, force_terminal=on_terminal, width=width))
        stamp = _stamp()
        self._write("".join(f"{stamp}{line}\n" for line in table.getvalue().splitlines()))

    @property
    def noticed(self) -> tuple[Notice, ...]:
        """The newest notices."""
        return self._board.newest

    @property
    def has_keys(self) -> bool:
        """Never: a log has no keys."""
        return False

    def key(self, *, typed: bool = False) -> str:  # noqa: ARG002 - a display has it
        """Return nothing: a log has no keys."""
        return ""

    def _write(self, text: str) -> None:
        """Write whole lines, after those that wait; or let them wait."""
        if text:
            self._waiting.append(text)
        if threading.get_ident() != self._writer:
            return
        encoding = getattr(self._stream, "encoding", None) or "utf-8"
        try:
            while self._waiting:
                # a file's name may hold what the stream cannot write
                self._stream.write(self._waiting.popleft().encode(encoding, "backslashreplace").decode(encoding))
                self._stream.flush()
        except OSError as error:
            if not self._failed and self._stream is not sys.stderr:
                with contextlib.suppress(OSError):
                    print(f"the log cannot be written: {error.strerror or error}; the session goes on", file=sys.stderr)
            self._failed = True


def _stamped(text: str) -> str:
    return f"{_stamp()}{visible(' '.join(text.split()))}\n"


def _stamp() -> str:
    now = dt.datetime.now(dt.UTC).isoformat(sep=" ", timespec="milliseconds").removesuffix("+00:00")
    return f"{now}Z  "


def _silent(source: SourceStatus) -> bool:
    return source.age_s is None or source.age_s > SILENT_AFTER_S


def _source(source: SourceStatus) -> str:
    age = "never heard" if source.age_s is None else f"age {source.age_s:.2f} s"
    text = f"{source.name} {rate_of(source)}, {age}, losses {losses_of(source.counters)}"
    return text + (f", STOPPED: {source.error}" if source.error else "")


def rate_of(source: SourceStatus) -> str:
    """Write how much a source delivers: bytes in thousands, what else is counted one by one."""
    if source.counted == "bytes":
        return f"{source.rate_hz / 1e3:.1f} kB/s"
    return f"{source.rate_hz:.0f} {source.counted}/s"
