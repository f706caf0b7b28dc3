"""The armed screen: what an engineer at the range looks at between two shots."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from daq.capture.status import ChannelStatus, LiveStatus, SourceStatus
from recoil_daq.engineering import engineering
from recoil_daq.keyboard import Keyboard
from recoil_daq.live_shot import LiveShot
from recoil_daq.losses import NONE, losses_of
from recoil_daq.plain_log import rate_of

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

DRAWS_PER_S = 5
OLD_S = 1.0
"""A source of which nothing came for so long is shown in red."""

NARROW = 100
"""Below so many columns a table leaves out what matters least."""

METER_CELLS = 20
_NOTICES, _SHOTS = 4, 4
_FIXED_ROWS = 9
STATE_STYLES = {
    "armed": "bold white on green",
    "recording": "bold white on red",
    "disarmed": "bold black on yellow",
    "stopped": "bold white on red",
}
SHOT_STYLES = {"usable": "green", "not usable": "bold red", "failed": "bold red", "incomplete": "yellow"}


class ArmedScreen:
    """Shows a live session in a terminal, and reads its keys.

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
        self._live = Live(console=self._console, auto_refresh=False, transient=True, redirect_stderr=False)
        self._keyboard = Keyboard()
        self._lock = threading.Lock()
        self._notices: deque[str] = deque(maxlen=_NOTICES)
        self._drawn_s = 0.0

    def __enter__(self) -> ArmedScreen:
        self._keyboard.__enter__()
        try:
            self._live.start()
        except BaseException:
            self._keyboard.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._live.stop()
        finally:
            self._keyboard.__exit__(kind, error, trace)

    def show(self, status: LiveStatus, shots: Sequence[LiveShot]) -> None:
        """Draw, some times per second."""
        now_s = time.monotonic()
        if now_s - self._drawn_s < 1 / DRAWS_PER_S:
            return
        self._drawn_s = now_s
        picture = self.picture(status, shots)
        with self._lock:
            self._live.update(picture, refresh=True)

    def notice(self, text: str) -> None:
        """Put what happened into the list of the last notices."""
        line = f"{time.strftime('%H:%M:%S', time.gmtime())}  {' '.join(text.split())}"
        self._notices.append(line)
        if not self._drawn_s:  # there is no picture yet that would show it
            with self._lock:
                self._live.console.print(line, markup=False)

    def verdict(self, document: Mapping[str, Any]) -> None:
        """Print the verdict above the screen, where it stays."""
        from recoil_daq.tables import print_verdict

        with self._lock:
            print_verdict(document, self._live.console)

    def key(self) -> str:
        """Return the key that was pressed."""
        return self._keyboard.key()

    def picture(self, status: LiveStatus, shots: Sequence[LiveShot]) -> RenderableType:
        """Lay out the screen for a status."""
        from rich.console import Group
        from rich.text import Text

        narrow = self._console.width < NARROW
        recent = list(shots)[-_SHOTS:]
        notices = list(self._notices)
        room = self._console.height - _FIXED_ROWS - len(status.sources) - len(recent) - len(notices)
        parts: list[RenderableType] = [
            self._head(status),
            _sources(status.sources, narrow),
            Text(""),
            _channels(status.channels, narrow, max(room, 2)),
        ]
        if recent:
            parts += [Text(""), *(_shot(shot) for shot in recent)]
        if notices:
            parts += [Text(""), *(_line(text, "dim") for text in notices)]
        parts.append(_line(" a arm   d disarm   t trigger   q quit ", "reverse"))
        return Group(*parts)

    def _head(self, status: LiveStatus) -> RenderableType:
        from rich.text import Text

        head = Text(no_wrap=True, overflow="ellipsis")
        head.append(f" {status.state.upper()} ", style=STATE_STYLES[status.state])
        minutes, seconds = divmod(int(status.armed_s), 60)
        head.append(f"  rig {self._rig}   {minutes // 60}:{minutes % 60:02d}:{seconds:02d}")
        head.append(f"   shots {status.shots}   disk {_disk_left(status)}")
        if status.unsynced_s > 0.5:
            head.append(f"   unsynced {status.unsynced_s:.1f} s", style="bold red")
        if status.unseen_bytes:
            head.append(f"   trigger behind by {status.unseen_bytes} bytes", style="bold red")
        return head


def _disk_left(status: LiveStatus) -> str:
    text = f"{status.disk_free_bytes / 1e9:.1f} GB"
    rate = status.journal_bytes / status.armed_s if status.armed_s > 5 else 0.0
    if rate > 0 and status.disk_free_bytes / rate < 86_400:
        text += f" ({status.disk_free_bytes / rate / 3600:.1f} h)"
    return text


def _line(text: str, style: str) -> RenderableType:
    from rich.text import Text

    return Text(text, style=style, no_wrap=True, overflow="ellipsis")


def _table(*columns: tuple[str, str]) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold", expand=False)
    for name, justify in columns:
        table.add_column(name, justify="right" if justify == "right" else "left", no_wrap=True, overflow="ellipsis")
    return table


def _sources(sources: Sequence[SourceStatus], narrow: bool) -> Table:
    columns = [("source", "left"), ("rate", "right"), ("last data", "right"), ("losses", "left")]
    if not narrow:
        columns[1:1] = [("kind", "left")]
        columns += [("queue", "right")]
    table = _table(*columns)
    for source in sources:
        old = source.age_s is None or source.age_s > OLD_S
        age = "never" if source.age_s is None else f"{source.age_s:.2f} s"
        losses = losses_of(source.counters)
        told = f"[bold red]{_plain(source.error)}[/]" if source.error else (
            f"[green]{losses}[/]" if losses == NONE else f"[yellow]{losses}[/]"
        )  # fmt: skip
        cells = [source.name, rate_of(source), f"[bold red]{age}[/]" if old else age, told]
        if not narrow:
            cells[1:1] = [source.kind]
            cells += [str(source.counters.queue_high_water)]
        table.add_row(*cells)
    return table


def _channels(channels: Sequence[ChannelStatus], narrow: bool, room: int) -> RenderableType:
    columns = [("channel", "left"), ("now", "right"), ("seen within 1 s", "left"), ("level", "left")]
    if not narrow:
        columns[1:1] = [("source", "left")]
        columns += [("triggers at", "right")]
    table = _table(*columns)
    ordered = sorted(channels, key=lambda channel: channel.triggers_at is None)
    shown = ordered if len(ordered) < room else ordered[: max(room - 2, 1)]
    for channel in shown:
        level = channel.level
        now = "[bold red]silent[/]" if level is None else engineering(level.last, channel.unit)
        span = "" if level is None else f"{_bare(level.low, channel)} .. {_bare(level.high, channel)}"
        cells = [channel.name, now, span, meter(channel)]
        if not narrow:
            cells[1:1] = [channel.source]
            at = channel.triggers_at
            cells += ["" if at is None else engineering(at, channel.unit)]
        table.add_row(*cells)
    if len(shown) == len(ordered):
        return table
    from rich.console import Group

    return Group(table, _line(f"+{len(ordered) - len(shown)} more", "dim"))


def meter(channel: ChannelStatus) -> str:
    """Draw the span of the last second over the sensor's range, with the trigger's level in it."""
    if channel.range is None or channel.level is None:
        return ""
    low, high = channel.range

    def cell(value: float) -> int:
        return min(max(int((value - low) / (high - low) * METER_CELLS), 0), METER_CELLS - 1)

    first, last, now = cell(channel.level.low), cell(channel.level.high), cell(channel.level.last)
    cells = ["█" if i == now else "▒" if first <= i <= last else "·" for i in range(METER_CELLS)]
    if channel.triggers_at is not None and (at := cell(channel.triggers_at)) != now:
        cells[at] = "┃"
    return "".join(cells)


def _bare(value: float, channel: ChannelStatus) -> str:
    return engineering(value, channel.unit)


def _shot(shot: LiveShot) -> RenderableType:
    from rich.text import Text

    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(f"shot {shot.name}  ")
    text.append(shot.state, style=SHOT_STYLES.get(shot.state, "cyan"))
    if shot.state == "waiting" and shot.missing:
        text.append(f" for files of {', '.join(shot.missing)}")
    reasons = shot.problem or ("; ".join(shot.document["reasons"]) if shot.document else "")
    if reasons:
        text.append(f": {reasons}")
    return text


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(" ".join(text.split()))
