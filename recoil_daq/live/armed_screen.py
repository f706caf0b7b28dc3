"""The armed screen: what an engineer at the range looks at between two shots."""

from __future__ import annotations

import contextlib
import io
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from recoil_acquisition.capture.status import SourceStatus
from recoil_acquisition.errors import visible
from recoil_daq.live.keyboard import Keyboard
from recoil_daq.live.plain_log import UNSYNCED_S, rate_of
from recoil_daq.live.range_state import RangeShot, RangeState, is_old
from recoil_daq.live.screen_cells import (
    METER_CELLS,
    age_of,
    disk_left,
    engineering,
    is_outside,
    losses_cell,
    meter,
    more_shots,
    shot_line,
    shots_in_order,
    span_of,
)
from recoil_daq.live.screen_table import Column, ScreenTable, line_of

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

DRAWS_PER_S = 5
METER_NEEDS = 16
LOSSES_NEED, LOSSES_LINES = 36, 2
NAME_WIDTH = 24
WIDE = 110
"""Columns of the terminal from which on both ends of a span have their unit."""

_SOURCE_COLUMNS = (
    Column("source", most=NAME_WIDTH), Column("kind", leaves=2), Column("rate", right=True),
    Column("last data", right=True), Column("queue max", leaves=1, right=True),
)  # fmt: skip
_CHANNEL_COLUMNS = (
    Column("channel", most=NAME_WIDTH), Column("source", leaves=3, most=NAME_WIDTH),
    Column("now", right=True), Column("within 1 s", leaves=1), Column("triggers at", leaves=2, right=True),
)  # fmt: skip
_NOTICES = 5
_GIVING_WAY = (
    ("notices", 2), ("shots", 3), ("channels", 6), ("gaps", 0), ("notices", 1), ("shots", 1), ("channels", 2),
    ("notices", 0), ("shots", 0),
)  # fmt: skip
"""Sections that lose rows where there are too few, in this order, and how many rows each keeps."""

_ASCII = str.maketrans("█▒·┃", "#=.|")
WARNING = "bold red on white not reverse"
STATE_STYLES = {
    "armed": "bold reverse green",
    "recording": "bold reverse red",
    "disarmed": "bold reverse yellow",
    "stopped": "bold reverse",
}


class ArmedScreen:
    """Shows a live session in a terminal, and reads its keys.

    Only the thread that made it writes. A notice of another thread is kept until that one draws: a terminal that is
    held up must not halt the watch for the trigger.

    Parameters
    ----------
    console
        Console to draw on; that of stdout if left out.
    watched
        Folder into which other instruments drop their files; None if none is watched.
    """

    def __init__(self, rig_name: str, console: Console | None = None, *, watched: Path | None = None) -> None:
        from rich.live import Live

        from recoil_daq.terminal.console import VisibleConsole

        self._rig = visible(rig_name)
        self._watched = "" if watched is None else visible(str(watched))
        self._console = console or VisibleConsole()
        self._live = Live(
            console=self._console, auto_refresh=False, transient=True, vertical_overflow="crop",
            redirect_stderr=sys.stderr.isatty(),
        )  # fmt: skip
        self._keyboard = Keyboard()
        self._writer = threading.get_ident()
        self._waiting: deque[str] = deque()
        self._notices: deque[str] = deque(maxlen=_NOTICES)
        self._width = 0
        self._source_table = ScreenTable(_SOURCE_COLUMNS, "losses")
        self._channel_table = ScreenTable(_CHANNEL_COLUMNS, "level")
        self._drawn_s = -math.inf
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
                self._print_waiting()
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
        now_s = time.monotonic()
        if now_s - self._drawn_s < 1 / DRAWS_PER_S:
            return
        self._drawn_s = now_s
        with contextlib.suppress(OSError):  # the terminal is gone: the session completes its shots without it
            self._print_waiting()
            self._live.update(self.picture(state), refresh=True)

    def notice(self, text: str) -> None:
        """Print what happened above the screen, where it stays; what the screen hides of it is listed in it."""
        self._waiting.append(f"{time.strftime('%H:%M:%SZ', time.gmtime())}  {visible(' '.join(text.split()))}")
        if threading.get_ident() == self._writer:
            with contextlib.suppress(OSError):
                self._print_waiting()

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Print the verdict above the screen, where it stays."""
        from recoil_daq.terminal.ingest import print_verdict

        with contextlib.suppress(OSError):
            self._print_waiting()
            with self._console:  # in one piece
                print_verdict(document, self._console)

    @property
    def has_keys(self) -> bool:
        """Whether there is a terminal whose keys are read."""
        return self._keyboard.available

    def key(self) -> str:
        """Return the key that was pressed."""
        return self._keyboard.key()

    def picture(self, state: RangeState) -> RenderableType:
        """Lay out the screen for a state: every line as wide as the terminal at most, and where it can be, as high."""
        from rich.console import Group

        width, height = self._console.size
        if width != self._width:
            self._width = width
            self._source_table.forget()
            self._channel_table.forget()
        height -= 1  # where the cursor goes at the end, so that all of the picture can be taken away
        lines = [*self._head(state, width), *self._sources(state.live, width)]
        of_shots = shots_in_order(state.shots)
        recent = [shot_line(shot) for shot in of_shots]
        notices = [line_of(text, "dim") for text in self._notices]
        wanted = {"channels": 1 + len(state.channels), "shots": len(recent), "notices": len(notices)}
        wanted["gaps"] = 1 + bool(recent) + bool(notices)
        room = height - len(lines) - 1
        above = room - sum(wanted.values()) + len(notices)
        if above >= sum(-(-text.cell_len // max(width, 1)) for text in notices):
            # they were printed above the picture and are still to be seen there
            notices, wanted["notices"], wanted["gaps"] = [], 0, 1 + bool(recent)
        rows = _shared(room, wanted)
        sections = (
            self._channels(state, width, rows["channels"]),
            _shots(of_shots, recent, rows["shots"]),
            notices[len(notices) - rows["notices"] :],
        )
        for section in sections:
            if section and rows["gaps"] > 0:
                lines.append(line_of(""))
                rows["gaps"] -= 1
            lines += section
        keys = "a arm  d disarm  t trigger  q quit" if self._keyboard.available else "no keys here: Ctrl-C quits"
        return Group(*lines, line_of(f" {keys} ", "reverse"))

    def _print_waiting(self) -> None:
        while self._waiting:
            self._notices.append(self._waiting.popleft())
            self._console.print(self._notices[-1], markup=False, soft_wrap=True)

    def _head(self, state: RangeState, width: int) -> list[Text]:
        """Return the state and what concerns the whole session, on as many lines as that takes."""
        minutes, seconds = divmod(int(state.armed_s), 60)
        disk, is_little = disk_left(state)
        parts = [
            (f"   {state.state.upper()} - {state.alert}", WARNING)
            if state.alert
            else (f"   {state.state.upper()}", ""),
            (f"rig {self._rig}", ""),
            (f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}", ""),
            (f"shots {state.triggered}", ""),
            (f"disk {disk}", WARNING if is_little else ""),
            (f"unsynced {state.unsynced_s:.1f} s", WARNING if state.unsynced_s > UNSYNCED_S else ""),
        ]
        if self._watched:
            parts.append((f"files from {self._watched}", ""))
        if state.unseen_bytes:
            parts.append((f"trigger behind by {state.unseen_bytes} bytes", WARNING))
        lines = [line_of("", STATE_STYLES[state.state])]
        for text, style in parts:
            if lines[-1].cell_len + 3 + len(text) > width:
                lines.append(line_of("", STATE_STYLES[state.state]))
            lines[-1].append("   " if lines[-1] or len(lines) > 1 else "").append(text, style)
        for line in lines:
            line.align("left", width)
        return lines

    def _sources(self, sources: Sequence[SourceStatus], width: int) -> list[Text]:
        rows = [
            [
                line_of(source.name), line_of(source.kind), line_of(rate_of(source)), age_of(source),
                line_of(str(source.counters.queue_high_water)),
            ]
            for source in sources
        ]  # fmt: skip

        cells = [losses_cell(source) for source in sources]
        needs = min(max((text.cell_len for text in cells), default=0), LOSSES_NEED)

        def losses(i: int, room: int) -> list[Text]:
            lines = list(cells[i].wrap(self._console, max(room, 1), no_wrap=False))
            if len(lines) > LOSSES_LINES:
                del lines[LOSSES_LINES:]
                lines[-1].rstrip()
                lines[-1].append(" …")
                lines[-1].truncate(room, overflow="ellipsis")
            return lines

        return self._source_table.lines(rows, width, needs, losses)

    def _channels(self, state: RangeState, width: int, most: int) -> list[Text]:
        """Return the table of channels in so many lines at most; those with a trigger level come first."""
        silent = {source.name for source in state.live if is_old(source)}
        ordered = sorted(state.channels, key=lambda channel: channel.triggers_at is None)
        shown = ordered if len(ordered) < most else ordered[: max(most - 2, 0)]
        rows = []
        for channel in shown:
            now, span = line_of("silent", "bold red"), ""
            if channel.level is not None and channel.source not in silent:
                now = line_of(engineering(channel.level.last, channel.unit))
                span = span_of(channel.level, channel.unit, whole=width >= WIDE)
            trigger = "" if channel.triggers_at is None else engineering(channel.triggers_at, channel.unit)
            rows.append([line_of(channel.name), line_of(channel.source), now, line_of(span), line_of(trigger)])

        def level(i: int, room: int) -> list[Text]:
            bar = "" if shown[i].source in silent else meter(shown[i], min(room, METER_CELLS))
            line = line_of(bar.translate(_ASCII) if self._console.options.ascii_only else bar)
            line.highlight_regex(r"[█#]", "bold red" if is_outside(shown[i]) else "bold cyan")
            line.highlight_regex(r"[┃|]", "bold yellow")
            return [line]

        lines = self._channel_table.lines(rows, width, METER_NEEDS, level)
        if hidden := ordered[len(shown) :]:
            mute = sum(channel.level is None or channel.source in silent for channel in hidden)
            lines.append(line_of(f"+{len(hidden)} more" + (f", {mute} of them silent" if mute else ""), "dim"))
        return lines[:most]


def _shots(shots: Sequence[RangeShot], lines: Sequence[Text], rows: int) -> list[Text]:
    """Return the lines of shots in so many rows; where not all have room, the first row counts those that have none."""
    if len(lines) <= rows:
        return list(lines)
    if rows < 2:
        return [more_shots(shots)] if rows else []
    shown = rows - 1
    return [more_shots(shots[: len(shots) - shown]), *lines[len(lines) - shown :]]


def _shared(room: int, wanted: Mapping[str, int]) -> dict[str, int]:
    """Share out rows to sections."""
    rows = dict(wanted)
    for section, least in _GIVING_WAY:
        excess = sum(rows.values()) - room
        if excess <= 0:
            break
        rows[section] = max(min(rows[section], least), rows[section] - excess)
    return rows
