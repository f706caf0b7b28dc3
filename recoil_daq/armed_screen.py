"""The armed screen: what an engineer at the range looks at between two shots."""

from __future__ import annotations

import io
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any

from daq.capture.engine import Level
from daq.capture.status import ChannelStatus, LiveStatus, SourceStatus
from recoil_daq.engineering import engineering
from recoil_daq.keyboard import Keyboard
from recoil_daq.live_shot import LiveShot
from recoil_daq.losses import NONE, losses_of
from recoil_daq.plain_log import UNSYNCED_S, rate_of

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

DRAWS_PER_S = 5
OLD_S = 1.0
"""A source of which nothing came for so long is shown in red, and its channels as silent."""

LITTLE_DISK_S, LITTLE_DISK_BYTES = 600.0, 1e9
METER_CELLS, METER_NEEDS, METER_CELLS_AT_LEAST = 20, 16, 8
LOSSES_NEED, LOSSES_LINES = 36, 2
NAME_WIDTH = 24
WIDE = 110
"""From so many columns on both ends of a span have their unit."""

_NOTICES, _SHOTS = 5, 6
_GIVING_WAY = (
    ("notices", 2), ("shots", 3), ("channels", 6), ("gaps", 0), ("notices", 1), ("shots", 1), ("channels", 2),
    ("notices", 0), ("shots", 0),
)  # fmt: skip
"""Which section loses rows first where there are too few, and how many it keeps."""

_ASCII = str.maketrans("█▒·┃", "#=.|")
WARNING = "bold red on white not reverse"
STATE_STYLES = {
    "armed": "bold reverse green",
    "recording": "bold reverse red",
    "disarmed": "bold reverse yellow",
    "stopped": "bold reverse",
}
SHOT_STYLES = {"usable": "green", "not usable": "bold red", "failed": "bold red", "incomplete": "yellow"}


@dataclass(frozen=True)
class _Column:
    """A column of a table: the one with the largest `leaves` is the first to go where it is narrow, 0 never goes."""

    title: str
    leaves: int = 0
    right: bool = False
    most: int = 1000


class ArmedScreen:
    """Shows a live session in a terminal, and reads its keys.

    Only the thread that made it writes. A notice of another thread is kept until that one draws: a terminal that is
    held up must not halt the watch for the trigger.

    Parameters
    ----------
    rig_name : str
    console : Console, optional
        That of stdout if left out.
    """

    def __init__(self, rig_name: str, console: Console | None = None) -> None:
        from rich.console import Console
        from rich.live import Live

        self._rig = rig_name
        self._console = console or Console(highlight=False, emoji=False)
        self._live = Live(
            console=self._console, auto_refresh=False, transient=True, vertical_overflow="crop",
            redirect_stderr=sys.stderr.isatty(),
        )  # fmt: skip
        self._keyboard = Keyboard()
        self._writer = threading.get_ident()
        self._waiting: deque[str] = deque()
        self._notices: deque[str] = deque(maxlen=_NOTICES)
        self._width = 0
        self._widths: dict[tuple[str, str], int] = {}
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
            self._print_waiting()
        finally:
            try:
                self._live.stop()
            finally:
                self._keyboard.__exit__(kind, error, trace)
                stream = self._console.file
                if self._errors is not None and isinstance(stream, io.TextIOWrapper):
                    stream.reconfigure(errors=self._errors)

    def show(self, status: LiveStatus, shots: Sequence[LiveShot]) -> None:
        """Draw, some times per second."""
        now_s = time.monotonic()
        if now_s - self._drawn_s < 1 / DRAWS_PER_S:
            return
        self._drawn_s = now_s
        self._print_waiting()
        self._live.update(self.picture(status, shots), refresh=True)

    def notice(self, text: str) -> None:
        """Print what happened above the screen, where it stays, and put it into the list of the last notices."""
        self._waiting.append(f"{time.strftime('%H:%M:%SZ', time.gmtime())}  {' '.join(text.split())}")
        if threading.get_ident() == self._writer:
            self._print_waiting()

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Print the verdict above the screen, where it stays."""
        from recoil_daq.tables import print_verdict

        self._print_waiting()
        with self._console:  # in one piece
            print_verdict(document, self._console)

    def key(self) -> str:
        """Return the key that was pressed."""
        return self._keyboard.key()

    def picture(self, status: LiveStatus, shots: Sequence[LiveShot]) -> RenderableType:
        """Lay out the screen for a status: every line as wide as the terminal at most, and where it can be, as high."""
        from rich.console import Group

        width, height = self._console.size
        if width != self._width:
            self._width = width
            self._widths.clear()
        height -= 1  # where the cursor goes at the end, so that all of the picture can be taken away
        lines = [*self._head(status, width), *self._sources(status.sources, width)]
        recent = [_shot(shot) for shot in shots[-_SHOTS:]]
        notices = [_line(text, "dim") for text in self._notices]
        wanted = {"channels": 1 + len(status.channels), "shots": len(recent), "notices": len(notices)}
        wanted["gaps"] = 1 + bool(recent) + bool(notices)
        rows = _shared(height - len(lines) - 1, wanted)
        sections = (
            self._channels(status, width, rows["channels"]),
            recent[len(recent) - rows["shots"] :],
            notices[len(notices) - rows["notices"] :],
        )
        for section in sections:
            if section and rows["gaps"] > 0:
                lines.append(_line(""))
                rows["gaps"] -= 1
            lines += section
        keys = "a arm  d disarm  t trigger  q quit" if self._keyboard.available else "no keys here: Ctrl-C quits"
        return Group(*lines, _line(f" {keys} ", "reverse"))

    def _print_waiting(self) -> None:
        while self._waiting:
            self._notices.append(self._waiting.popleft())
            self._console.print(self._notices[-1], markup=False, soft_wrap=True)

    def _head(self, status: LiveStatus, width: int) -> list[Text]:
        """Return the state and what concerns the whole session, on as many lines as that takes."""
        minutes, seconds = divmod(int(status.armed_s), 60)
        disk, is_little = _disk_left(status)
        parts = [
            (f"   {status.state.upper()}", ""),
            (f"rig {self._rig}", ""),
            (f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}", ""),
            (f"shots {status.shots}", ""),
            (f"disk {disk}", WARNING if is_little else ""),
            (f"unsynced {status.unsynced_s:.1f} s", WARNING if status.unsynced_s > UNSYNCED_S else ""),
        ]
        if status.unseen_bytes:
            parts.append((f"trigger behind by {status.unseen_bytes} bytes", WARNING))
        lines = [_line("", STATE_STYLES[status.state])]
        for text, style in parts:
            if lines[-1].cell_len + 3 + len(text) > width:
                lines.append(_line("", STATE_STYLES[status.state]))
            lines[-1].append("   " if lines[-1] or len(lines) > 1 else "").append(text, style)
        for line in lines:
            line.align("left", width)
        return lines

    def _sources(self, sources: Sequence[SourceStatus], width: int) -> list[Text]:
        columns = (
            _Column("source", most=NAME_WIDTH), _Column("kind", leaves=2), _Column("rate", right=True),
            _Column("last data", right=True), _Column("queue max", leaves=1, right=True),
        )  # fmt: skip
        rows = [
            [
                _line(source.name), _line(source.kind), _line(rate_of(source)), _age(source),
                _line(str(source.counters.queue_high_water)),
            ]
            for source in sources
        ]  # fmt: skip

        told = [_losses(source) for source in sources]
        needs = min(max((text.cell_len for text in told), default=0), LOSSES_NEED)

        def losses(i: int, room: int) -> list[Text]:
            lines = list(told[i].wrap(self._console, max(room, 1), no_wrap=False))
            if len(lines) > LOSSES_LINES:
                del lines[LOSSES_LINES:]
                lines[-1].rstrip()
                lines[-1].append(" …")
                lines[-1].truncate(room, overflow="ellipsis")
            return lines

        return self._table(columns, rows, width, ("losses", needs, losses))

    def _channels(self, status: LiveStatus, width: int, most: int) -> list[Text]:
        """Return the table of channels in so many lines at most; those with a trigger level come first."""
        silent = {source.name for source in status.sources if _is_old(source)}
        ordered = sorted(status.channels, key=lambda channel: channel.triggers_at is None)
        shown = ordered if len(ordered) < most else ordered[: max(most - 2, 0)]
        columns = (
            _Column("channel", most=NAME_WIDTH), _Column("source", leaves=3, most=NAME_WIDTH),
            _Column("now", right=True), _Column("within 1 s", leaves=1), _Column("triggers at", leaves=2, right=True),
        )  # fmt: skip
        rows = []
        for channel in shown:
            now, span = _line("silent", "bold red"), ""
            if channel.level is not None and channel.source not in silent:
                now = _line(engineering(channel.level.last, channel.unit))
                span = _span(channel.level, channel.unit, whole=width >= WIDE)
            trigger = "" if channel.triggers_at is None else engineering(channel.triggers_at, channel.unit)
            rows.append([_line(channel.name), _line(channel.source), now, _line(span), _line(trigger)])

        def level(i: int, room: int) -> list[Text]:
            bar = "" if shown[i].source in silent else meter(shown[i], min(room, METER_CELLS))
            line = _line(bar.translate(_ASCII) if self._console.options.ascii_only else bar)
            line.highlight_regex(r"[█#]", "bold red" if _is_outside(shown[i]) else "bold cyan")
            line.highlight_regex(r"[┃|]", "bold yellow")
            return [line]

        lines = self._table(columns, rows, width, ("level", METER_NEEDS, level))
        if hidden := ordered[len(shown) :]:
            mute = sum(channel.level is None or channel.source in silent for channel in hidden)
            lines.append(_line(f"+{len(hidden)} more" + (f", {mute} of them silent" if mute else ""), "dim"))
        return lines[:most]

    def _table(
        self,
        columns: Sequence[_Column],
        rows: Sequence[Sequence[Text]],
        width: int,
        last: tuple[str, int, Callable[[int, int], list[Text]]],
    ) -> list[Text]:
        """Join cells to lines. The last column takes what room the others leave, of which it needs some."""
        title, least, draw = last
        widths = []
        for i, column in enumerate(columns):
            cells = max((row[i].cell_len for row in rows), default=0)
            known = self._widths.get((title, column.title), len(column.title))  # never less, or the table would jump
            self._widths[title, column.title] = max(min(cells, column.most), known)
            widths.append(self._widths[title, column.title])
        kept = list(range(len(columns)))
        while (room := width - sum(widths[i] + 2 for i in kept)) < least:
            first = max(kept, key=lambda i: columns[i].leaves)
            if not columns[first].leaves:
                break
            kept.remove(first)

        def joined(cells: Sequence[Text], end: Text) -> Text:
            line = _line("")
            for i in kept:
                cells[i].align("right" if columns[i].right else "left", widths[i])
                line.append_text(cells[i]).append("  ")
            line.append_text(end).rstrip()
            return line

        lines = [joined([_line(column.title, "bold") for column in columns], _line(title, "bold"))]
        for i, row in enumerate(rows):
            first_line, *more = draw(i, room)
            lines.append(joined(row, first_line))
            lines += [joined([_line("") for _ in columns], end) for end in more]
        return lines


def meter(channel: ChannelStatus, cells: int = METER_CELLS) -> str:
    """Draw the span of the last second over the sensor's range, with the trigger's level in it."""
    level = channel.level
    if channel.range is None or level is None or cells < METER_CELLS_AT_LEAST:
        return ""
    low, high = channel.range
    if not (low < high and all(map(math.isfinite, (low, high, level.low, level.high, level.last)))):
        return ""

    def cell(value: float) -> int:
        return int(min(max((value - low) / (high - low), 0.0) * cells, cells - 1))

    first, last, now = cell(level.low), cell(level.high), cell(level.last)
    drawn = ["█" if i == now else "▒" if first <= i <= last else "·" for i in range(cells)]
    if channel.triggers_at is not None and (at := cell(channel.triggers_at)) != now:
        drawn[at] = "┃"
    return "".join(drawn)


def _is_outside(channel: ChannelStatus) -> bool:
    if channel.range is None or channel.level is None:
        return False
    return channel.level.low < channel.range[0] or channel.level.high > channel.range[1]


def _span(level: Level, unit: str, *, whole: bool) -> str:
    low, high = engineering(level.low, unit), engineering(level.high, unit)
    if not whole and low.partition(" ")[2] == high.partition(" ")[2]:
        low = low.partition(" ")[0]
    return f"{low} .. {high}"


def _is_old(source: SourceStatus) -> bool:
    return source.age_s is None or source.age_s > OLD_S


def _age(source: SourceStatus) -> Text:
    if source.age_s is None:
        return _line("never", "bold red")
    text = f"{source.age_s:.2f} s" if source.age_s < 60 else f"{source.age_s / 60:.0f} min"
    return _line(text, "bold red" if _is_old(source) else "")


def _losses(source: SourceStatus) -> Text:
    losses = losses_of(source.counters)
    if source.error:
        text = _line(" ".join(source.error.split()), "bold red")
        return text if losses == NONE else text.append(f"; {losses}", "yellow not bold")
    if losses == NONE:
        return _line(losses, "" if source.age_s is None else "green")
    return _line(losses, "bold yellow")


def _disk_left(status: LiveStatus) -> tuple[str, bool]:
    """Return the room on the disk, the time until it is full where that is near, and whether it is little."""
    text = f"{status.disk_free_bytes / 1e9:.1f} GB"
    rate = status.journal_bytes / status.armed_s if status.armed_s > 5 else 0.0
    left_s = status.disk_free_bytes / rate if rate > 0 else math.inf
    if left_s < 86_400:
        text += f" ({left_s / 3600:.1f} h)" if left_s >= 3600 else f" ({left_s / 60:.0f} min)"
    return text, left_s < LITTLE_DISK_S or status.disk_free_bytes < LITTLE_DISK_BYTES


def _shot(shot: LiveShot) -> Text:
    text = _line(f"shot {shot.name}  ").append(shot.state, SHOT_STYLES.get(shot.state, "cyan"))
    if shot.state == "waiting" and shot.missing:
        text.append(f" for files of {', '.join(shot.missing)}")
    reasons = shot.problem or ("; ".join(shot.document["reasons"]) if shot.document else "")
    return text.append(f": {' '.join(reasons.split())}") if reasons else text


def _line(text: str, style: str = "") -> Text:
    from rich.text import Text

    return Text(text, style=style, no_wrap=True, overflow="ellipsis")


def _shared(room: int, wanted: Mapping[str, int]) -> dict[str, int]:
    """Share out rows to sections."""
    rows = dict(wanted)
    for section, least in _GIVING_WAY:
        excess = sum(rows.values()) - room
        if excess <= 0:
            break
        rows[section] = max(min(rows[section], least), rows[section] - excess)
    return rows
