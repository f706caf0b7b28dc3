"""Channels on the armed screen: where each is and was, and its trigger, with those that trigger first."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from recoil_acquisition.capture.status import ChannelStatus
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.screen.screen_cells import (
    METER_CELLS,
    NOW,
    PEAK,
    TRIGGER,
    is_outside,
    meter,
    now_text,
    peak_text,
)
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_table import NAME_WIDTH, Column, line_of, table_lines
from recoil_daq.terminal.engineering import engineering, spelled

if TYPE_CHECKING:
    from rich.text import Text

METER_NEEDS = 12
_CHANNEL_COLUMNS = (
    Column("channel", most=NAME_WIDTH), Column("now", right=True, least=11), Column("peak", right=True, least=11),
    Column("trigger", right=True, leaves=1, least=8),
)  # fmt: skip


def channel_lines(state: RangeState, look: Look, most: int) -> list[Text]:
    """Return the table of channels in so many lines at most; those with a trigger level come first."""
    if most < 2:
        return []
    bad = {source.name: source.state for source in state.sources if source.state in ("silent", "lost", "stopped")}
    ordered = sorted(state.channels, key=lambda channel: channel.triggers_at is None)
    # where there is little room, the title counts those that have no row
    fit = most - 1 if look.narrow else max(most - 2, 0)
    shown = ordered if len(ordered) < most else ordered[:fit]
    hidden = ordered[len(shown) :]
    ended = state.state == "stopped"
    mute = 0 if ended else sum(channel.level is None or channel.source in bad for channel in hidden)
    more = f"+{len(hidden)} more, " + (f"{mute} of them silent" if mute else str(state.state) if ended else "live")
    rows, bars = [], []
    for channel in shown:
        silent = channel.source in bad or channel.level is None
        now = line_of("" if ended else "silent", "bold red") if silent else line_of(now_text(channel))
        trigger = "" if channel.triggers_at is None else engineering(channel.triggers_at, spelled(channel.unit))
        rows.append([line_of(channel.name), now, line_of(peak_text(channel)), line_of(trigger)])
        bars.append(partial(_bar, channel, silent))
    last = next((shot.name for shot in reversed(state.shots) if shot.peaks), "")
    titles = {"peak": f"peak {last}".rstrip()}
    if look.narrow and hidden:
        titles["channel"] = f"channel +{len(hidden)}" + (f", {mute} silent" if mute else "")
    columns = [replace(one, title=titles.get(one.title, one.title)) for one in _CHANNEL_COLUMNS]
    if look.narrow:
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    title = "level" if look.narrow else "level in range"
    lines = table_lines(columns, rows, (title, bars), look.width, least=METER_NEEDS)
    if hidden and not look.narrow:
        lines.append(line_of(more, "bold red" if mute else "dim"))
    return lines[:most]


def _bar(channel: ChannelStatus, silent: bool, room: int) -> list[Text]:
    line = line_of("" if silent else meter(channel, min(room, METER_CELLS)))
    line.highlight_regex(NOW, "bold red" if is_outside(channel) else "bold cyan")
    line.highlight_regex(TRIGGER, "bold yellow")
    line.highlight_regex(PEAK, "bold magenta")
    return [line]
