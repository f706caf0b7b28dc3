"""Single cells of the armed screen: a level, an age, losses, a time."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

from recoil_acquisition.capture.status import ChannelStatus, SourceStatus
from recoil_daq.live.range_state import RangeState, is_old
from recoil_daq.live.screen.screen_table import line_of
from recoil_daq.live.sensor_range import allowed
from recoil_daq.live.shot import losses_of, lost_anything
from recoil_daq.terminal.engineering import PREFIXES, engineering, spelled, takes_prefix

if TYPE_CHECKING:
    from rich.text import Text


_LEAST_FULL_SCALE, _LEAST_OF_QUOTIENT = 2.0, 7.0
"""Full scale, in the unit that a channel's level is written in, from which on the prefix is large enough, of a unit
such as Pa and of one such as m/s2, which is written without a prefix rather than with a large one."""
LITTLE_DISK_S, LITTLE_DISK_BYTES = 600.0, 1e9
METER_CELLS, METER_CELLS_AT_LEAST = 20, 8
NOW, SPAN, TRIGGER, PEAK, EMPTY = "█", "▒", "┃", "▲", "·"


def now_text(channel: ChannelStatus) -> str:
    """Write the last value of a channel; one with a range keeps prefix and decimals, so that only digits move."""
    value = None if channel.level is None else channel.level.last
    full_scale = 0.0 if channel.range is None else max(map(abs, channel.range))
    unit = spelled(channel.unit)
    if value is None or not math.isfinite(value) or not 0.0 < full_scale < math.inf:
        return engineering(value, unit)
    exponent = 0
    if takes_prefix(unit):
        quotient = "/" in unit
        least = _LEAST_OF_QUOTIENT if quotient else _LEAST_FULL_SCALE
        exponent = min(max(math.floor(math.log10(full_scale / least) / 3), -3), 0 if quotient else 3)
    scale = 10.0 ** (3 * exponent)
    decimals = min(max(4 - math.floor(math.log10(full_scale / scale)), 1), 3)
    # a value far beyond the range must not push the column away
    if abs(value) >= 1e3 * full_scale:
        return engineering(value, unit)
    number = f"{value / scale:.{decimals}f}"
    zero = f"{0.0:.{decimals}f}"
    return f"{zero if number == f'-{zero}' else number} {PREFIXES[exponent]}{unit}".rstrip()


def peak_value(ends: tuple[float, float] | None) -> float | None:
    """Return the extreme that lies further from zero; None of none."""
    return None if ends is None else max(ends, key=abs)


def peak_text(channel: ChannelStatus) -> str:
    """Write the extreme of the last shot, to four digits where they are three before the point."""
    value = peak_value(channel.peak)
    if value is None:
        return ""
    text = engineering(value, spelled(channel.unit))
    if len(re.sub(r"\D", "", text.split(" ")[0])) == 3 and "." not in text:
        return engineering(value, spelled(channel.unit), digits=4)
    return text


def meter(channel: ChannelStatus, cells: int = METER_CELLS) -> str:
    """Draw the last second over the sensor's range, with the trigger's level and the last shot's peak in it."""
    level = channel.level
    if channel.range is None or level is None or cells < METER_CELLS_AT_LEAST:
        return ""
    low, high = channel.range
    if not (low < high and all(map(math.isfinite, (low, high, level.low, level.high, level.last)))):
        return ""

    def cell(value: float) -> int:
        return int(min(max((value - low) / (high - low), 0.0) * cells, cells - 1))

    first, last, now = cell(level.low), cell(level.high), cell(level.last)
    drawn = [SPAN if first <= i <= last else EMPTY for i in range(cells)]
    peak = peak_value(channel.peak)
    if peak is not None and math.isfinite(peak):
        drawn[cell(peak)] = PEAK
    if channel.triggers_at is not None and math.isfinite(channel.triggers_at):
        drawn[cell(channel.triggers_at)] = TRIGGER
    drawn[now] = NOW
    return "".join(drawn)


def is_outside(channel: ChannelStatus) -> bool:
    """Return whether a channel left its sensor's range within the last second."""
    if channel.range is None or channel.level is None:
        return False
    low, high = allowed(channel.range)
    return channel.level.low < low or channel.level.high > high


def age_text(source: SourceStatus) -> str:
    """Write how old the last data of a source is."""
    if source.age_s is None:
        return "never"
    return f"{source.age_s:.2f} s" if source.age_s < 60 else f"{source.age_s / 60:.0f} min"


def age_of(source: SourceStatus) -> Text:
    """Write how old the last data of a source is, in red where it is too old."""
    return line_of(age_text(source), "bold red" if is_old(source) else "")


def rate_text(source: SourceStatus) -> str:
    """Write how much a source delivers: bytes with a prefix, what else is counted one by one."""
    if source.counted == "bytes":
        return engineering(source.rate_hz, "B/s")
    return f"{source.rate_hz:.0f} {source.counted}/s"


def size_text(size_bytes: float) -> str:
    """Write the size of a file."""
    return engineering(size_bytes, "B")


def losses_cell(source: SourceStatus) -> Text:
    """Write what a source lost, after the error that ended it."""
    losses, lost = losses_of(source.counters), lost_anything(source.counters)
    if source.error:
        text = line_of(" ".join(source.error.split()), "bold red")
        return text.append(f"; {losses}", "yellow not bold") if lost else text
    if lost:
        return line_of(losses, "bold yellow")
    counted = source.counters.counter_gaps is not None
    return line_of(losses, "green" if counted and source.age_s is not None else "")


def disk_left(state: RangeState) -> tuple[str, bool]:
    """Return the room on the disk, the time until it is full where that is near, and whether it is little."""
    free = state.disk_free_bytes
    text = f"{free / 1e9:.0f} GB" if free >= 1e10 else f"{free / 1e9:.1f} GB"
    rate = state.journal_bytes / state.armed_s if state.armed_s > 5 else 0.0
    left_s = free / rate if rate > 0 else math.inf if free else 0.0
    if left_s < 5 * 86_400:
        text += f", {left_s / 3600:.0f} h" if left_s >= 36_000 else ""
        text += f", {left_s / 3600:.1f} h" if 3600 <= left_s < 36_000 else ""
        text += f", {left_s / 60:.0f} min" if left_s < 3600 else ""
    return text, left_s < LITTLE_DISK_S or free < LITTLE_DISK_BYTES


def clock_text(seconds: float) -> str:
    """Write a time as hours, minutes and seconds."""
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def folder_text(folder: Path, *, most: int = 1000) -> str:
    """Write a folder: as it was given, or with its end alone where that is too long."""
    text = folder.as_posix()
    if len(text) > most and len(folder.parts) > 1:
        text = f".../{folder.name}"
    return f"{text}/"
