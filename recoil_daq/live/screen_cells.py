"""Single cells of the armed screen: a number with its unit, such as 1.52 MPa, a level, an age, losses, a shot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.capture.status import ChannelStatus, SourceStatus
from recoil_acquisition.errors import visible
from recoil_daq.live.range_state import RangeShot, RangeState, is_old
from recoil_daq.live.screen_table import line_of
from recoil_daq.live.sensor_range import allowed
from recoil_daq.live.shot import ShotState, losses_of, lost_anything

if TYPE_CHECKING:
    from rich.text import Text


_PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}
LITTLE_DISK_S, LITTLE_DISK_BYTES = 600.0, 1e9
METER_CELLS, METER_CELLS_AT_LEAST = 20, 8
SETTLED_SHOWN = 6
SHOT_STYLES = {
    ShotState.USABLE: "green",
    ShotState.RECORD_ONLY: "bold yellow",
    ShotState.NOT_USABLE: "bold red",
    ShotState.NOT_WHOLE: "bold red",
    ShotState.FAILED: "bold red",
    ShotState.INCOMPLETE: "yellow",
}


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a number with some significant digits and the prefix that fits it.

    Parameters
    ----------
    value
        Number to write; None, and what is not finite, gives a dash.
    unit
        SI unit; one with a power in it takes no prefix, nor does none at all.
    """
    return " ".join(part for part in _scaled(value, unit, digits) if part)


def _scaled(value: float | None, unit: str, digits: int = 3) -> tuple[str, str]:
    """Write a number, and the unit with the prefix that fits it."""
    if value is None or not math.isfinite(value):
        return "-", ""
    if value == 0:
        return "0", unit
    exponent = math.floor(math.log10(abs(value)) / 3)
    if not unit[:1].isalpha() or "2" in unit or "^" in unit:
        return _plain(value, digits), unit
    exponent = min(max(exponent, -3), 3)
    scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    if abs(scaled) >= 1000 and exponent < 3:
        exponent += 1
        scaled = float(f"{value / 10.0 ** (3 * exponent):.{digits}g}")
    decimals = max(digits - 1 - math.floor(math.log10(abs(scaled))), 0)
    return f"{scaled:.{decimals}f}", f"{_PREFIXES[exponent]}{unit}"


def _plain(value: float, digits: int) -> str:
    """Write digits without an exponent, as long as that is no longer than with one."""
    if 1e-3 <= abs(value) < 1e6:
        rounded = float(f"{value:.{digits}g}")
        return f"{rounded:.{max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)}f}"
    return f"{value:.{digits - 1}e}"


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


def is_outside(channel: ChannelStatus) -> bool:
    """Return whether a channel left its sensor's range within the last second."""
    if channel.range is None or channel.level is None:
        return False
    low, high = allowed(channel.range)
    return channel.level.low < low or channel.level.high > high


def span_of(level: Level, unit: str, *, whole: bool) -> str:
    """Write both ends of a span; with ``whole`` each has its unit."""
    (low, low_unit), (_, high_unit) = _scaled(level.low, unit), _scaled(level.high, unit)
    shared = not whole and low_unit == high_unit
    return f"{low if shared else engineering(level.low, unit)} .. {engineering(level.high, unit)}"


def age_of(source: SourceStatus) -> Text:
    """Write how old the last data of a source is."""
    if source.age_s is None:
        return line_of("never", "bold red")
    text = f"{source.age_s:.2f} s" if source.age_s < 60 else f"{source.age_s / 60:.0f} min"
    return line_of(text, "bold red" if is_old(source) else "")


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
    text = f"{state.disk_free_bytes / 1e9:.1f} GB"
    rate = state.journal_bytes / state.armed_s if state.armed_s > 5 else 0.0
    left_s = state.disk_free_bytes / rate if rate > 0 else math.inf
    if left_s < 86_400:
        text += f" ({left_s / 3600:.1f} h)" if left_s >= 3600 else f" ({left_s / 60:.0f} min)"
    return text, left_s < LITTLE_DISK_S or state.disk_free_bytes < LITTLE_DISK_BYTES


def shots_in_order(shots: Sequence[RangeShot]) -> list[RangeShot]:
    """Put the shots that are to be looked at last, where they are shown first: the settled ones, then those on the way.

    All that are on the way are there, of the settled ones the newest six.
    """
    settled = [shot for shot in shots if shot.settled]
    return [*settled[-SETTLED_SHOWN:], *(shot for shot in shots if not shot.settled)]


def more_shots(shots: Sequence[RangeShot]) -> Text:
    """Count the shots that have no line of their own, by what they are."""
    states = Counter(shot.state for shot in shots)
    counted = ", ".join(f"{count} {state}" for state, count in states.items())
    names = f"{shots[0].name} .. {shots[-1].name}" if len(shots) > 1 else shots[0].name
    return line_of(f"+{len(shots)} more shots ({names}): {counted}", "dim")


def shot_line(shot: RangeShot) -> Text:
    """Write how far a shot is, what it waits for, and what speaks against it."""
    text = line_of(f"shot {shot.name}  ").append(shot.state, SHOT_STYLES.get(shot.state, "cyan"))
    if shot.state is ShotState.WAITING and shot.missing:
        text.append(f" for files of {visible(', '.join(shot.missing))}")
    elif shot.state is ShotState.WAITING:
        text.append(" for its turn to be converted")
    if shot.verdict is not None:
        text.append(shot.verdict.counted)
    return text.append(f": {visible(' '.join(shot.why.split()))}") if shot.why else text
