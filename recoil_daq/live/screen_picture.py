"""The picture of the armed screen: a function of the range's state and of the terminal, and of nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from recoil_acquisition.capture.status import ChannelStatus
from recoil_acquisition.devices.device import Counters
from recoil_acquisition.errors import visible
from recoil_daq.live.mass_work import campaign_line
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.plain_log import UNSYNCED_S
from recoil_daq.live.range_state import FigureCode, RangeFigure, RangeShot, RangeSource, RangeState
from recoil_daq.live.screen_cells import (
    METER_CELLS,
    NOW,
    PEAK,
    SPAN,
    TRIGGER,
    age_of,
    age_text,
    clock_text,
    disk_left,
    engineering,
    folder_text,
    is_outside,
    losses_cell,
    meter,
    now_text,
    peak_text,
    rate_text,
    size_text,
    spelled,
)
from recoil_daq.live.screen_table import Column, line_of, table_lines, wrapped
from recoil_daq.live.shot import ShotState, losses_of, lost_anything
from recoil_rigs.specification import mass_decimals

if TYPE_CHECKING:
    from rich.text import Text

COLOURED_S = 180.0
"""Time after its verdict for which a shot's row is in colour, s."""
NARROW, LOW = 72, 20
"""Columns and rows of the terminal below which the sources share one line."""
NAME_WIDTH = 24
METER_NEEDS = 12
_VERDICT_WIDTH, _FIGURE_WIDTH = 25, 9
_NOTICES = 3
_CHANNEL_COLUMNS = (
    Column("channel", most=NAME_WIDTH), Column("now", right=True, least=11), Column("peak", right=True, least=11),
    Column("trigger", right=True, leaves=1, least=8),
)  # fmt: skip
_SOURCE_COLUMNS = (
    Column("source", most=NAME_WIDTH), Column("state", least=9), Column("rate", least=13),
    Column("last data", right=True, least=9),
)  # fmt: skip
_GIVING_WAY = (
    ("notices", 2), ("shots", 4), ("channels", 8), ("gaps", 0), ("shots", 2), ("channels", 7), ("campaign", 0),
    ("shots", 1), ("channels", 3), ("notices", 1), ("lost", 0), ("notices", 0), ("shots", 0), ("channels", 0),
)  # fmt: skip
"""Sections that lose rows where there are too few, in this order, and how many rows each keeps."""

_ASCII = str.maketrans({NOW: "#", SPAN: "=", TRIGGER: "|", PEAK: "^", "·": ".", "µ": "u"})
WARNING = "bold red on white not reverse"
CAUTION = "bold yellow"
STATE_STYLES = {
    "armed": "bold reverse green",
    "recording": "bold reverse red",
    "disarmed": "bold reverse yellow",
    "stopped": "bold reverse",
}
SHOT_STYLES = {
    ShotState.USABLE: "green",
    ShotState.RECORD_ONLY: "bold yellow",
    ShotState.NOT_USABLE: "bold red",
    ShotState.NOT_WHOLE: "bold red",
    ShotState.FAILED: "bold red",
    ShotState.INCOMPLETE: "yellow",
}


@dataclass(frozen=True)
class Look:
    """How the range is looked at.

    Attributes
    ----------
    width, height
        Size of the terminal, cells; the last row stays free for the cursor.
    has_keys
        Whether somebody can press keys.
    ascii_only
        Whether the terminal shows no other characters.
    words
        Whether the warnings of the shots are to be read in words, in place of the channels.
    printed
        Number of the newest notice that is printed above the picture, and is not in it again.
    """

    width: int
    height: int
    has_keys: bool = True
    ascii_only: bool = False
    words: bool = False
    printed: int = 0

    @property
    def narrow(self) -> bool:
        """Whether there is no room for the wide layout."""
        return self.width < NARROW or self.height < LOW


@dataclass(frozen=True)
class Picture:
    """A picture.

    Attributes
    ----------
    lines
        Lines, each as wide as the terminal at most.
    first_notice
        Number of the oldest notice that is in the picture; one more than the newest where none is.
    """

    lines: tuple[Text, ...]
    first_notice: int


def picture(state: RangeState, look: Look) -> Picture:
    """Draw a state: what nobody may overlook first, then as much of the rest as the terminal has room for."""
    top = [*_head(state, look), *_sources(state, look)]
    bottom = _bottom(state, look)
    room = max(look.height - 1 - len(top) - len(bottom), 0)
    newest = 1 + (state.notices[-1].number if state.notices else 0)
    if look.words:
        lines, first = _words(state, look, room), newest
    else:
        lines, first = _middle(state, look, room, newest)
    drawn = [*top, *lines, *bottom]
    if look.ascii_only:
        for line in drawn:
            line.plain = line.plain.translate(_ASCII)
    for line in drawn:
        line.truncate(look.width, overflow="ellipsis")
    return Picture(tuple(drawn), first)


def _middle(state: RangeState, look: Look, room: int, newest: int) -> tuple[list[Text], int]:
    """Return channels, shots, campaign and notices in so many rows, and the number of the first notice shown."""
    shots = _shots_in_order(state.shots)
    head = [] if look.narrow or not any(shot.figures for shot in shots) else [_shot_titles(shots)]
    rows = [_shot_line(shot, look, shots) for shot in shots]
    lost = _lost(state) if look.narrow else []
    together = "" if state.campaign is None else campaign_line(state.campaign, brief=True)
    campaign = wrapped(together, look.width, most=2) if together else []
    new = [notice for notice in state.notices if notice.number > look.printed]
    notices = [(notice, wrapped(notice.line, look.width, style="dim")) for notice in new[-_NOTICES:]]
    wanted = {
        "channels": 1 + len(state.channels), "shots": len(head) + len(rows), "campaign": len(campaign),
        "lost": len(lost), "notices": sum(len(lines) for _, lines in notices),
    }  # fmt: skip
    wanted["gaps"] = 0 if look.narrow else 1 + bool(rows or campaign) + bool(notices)
    given = _shared(room, wanted)
    shown, first = _newest(notices, given["notices"], newest)
    sections = [
        _channels(state, look, given["channels"]),
        [
            *_shots(shots, head, rows, given["shots"], look.width),
            *campaign[: given["campaign"]],
            *lost[: given["lost"]],
        ],
        shown,
    ]
    lines: list[Text] = []
    for section in sections:
        if section and given["gaps"] > 0:
            lines.append(line_of(""))
            given["gaps"] -= 1
        lines += section
    return lines, first


def _newest(notices: Sequence[tuple[Notice, list[Text]]], rows: int, newest: int) -> tuple[list[Text], int]:
    """Return the lines of the newest notices that have room, and the number of the first of them."""
    shown: list[Text] = []
    first = newest
    for notice, lines in reversed(notices):
        if len(shown) + len(lines) > rows:
            if not shown and rows:
                shown, first = lines[:rows], notice.number
                shown[-1].append(" …")
            break
        shown, first = [*lines, *shown], notice.number
    return shown, first


def _head(state: RangeState, look: Look) -> list[Text]:
    """Return the state and what concerns the whole session, on as many lines as that takes."""
    disk, is_little = disk_left(state)
    style = STATE_STYLES[state.state]
    short = look.narrow
    parts = [(f"{state.state.upper()} {clock_text(state.since_s)}", "")]
    if state.virtual:
        parts.append(("VIRTUAL", WARNING))
    parts.append((visible(state.rig), ""))
    if state.next_shot and state.state != "stopped":
        parts.append((f"{'next' if short else 'next shot'} {state.next_shot}", ""))
    if state.added_mass:
        parts.append((f"added {visible(state.added_mass)}", ""))
    parts.append((disk if short and is_little else disk.split(",")[0] if short else f"disk {disk}", ""))
    if is_little:
        parts[-1] = (f"disk {disk}", WARNING)
    if state.unsynced_s > UNSYNCED_S:
        parts.append((f"disk {state.unsynced_s:.1f} s behind", WARNING))
    if state.unseen_bytes:
        parts.append((f"trigger behind by {size_text(state.unseen_bytes)}", WARNING))
    gap = " " * (2 if short else 3)
    lines = [line_of(" ", style)]
    for text, own in parts:
        if lines[-1].cell_len + len(gap) + len(text) > look.width:
            lines.append(line_of(" ", style))
        lines[-1].append(gap if lines[-1].cell_len > 1 else "").append(text, own)
    for line in lines:
        line.align("left", look.width)
    if state.alert:
        lines += wrapped(f" {state.alert}", look.width, style="bold white on red", most=3, fill=True)
    if state.cautions:
        lines += wrapped("; ".join(state.cautions), look.width, style=CAUTION, most=2)
    return lines


def _bottom(state: RangeState, look: Look) -> list[Text]:
    """Return the question that is to be answered, or the keys."""
    if state.asked:
        return wrapped(f" {state.asked}", look.width, style="bold black on yellow", most=3, fill=True)
    if not look.has_keys:
        return [line_of(" no keys here: Ctrl-C quits ", "reverse")]
    mass = "m mass" if look.width < NARROW else "m added mass"
    words = "w back" if look.words else "w warnings"
    return [line_of(f" a arm  d disarm  t trigger  {mass}  {words}  q quit ", "reverse")]


def _sources(state: RangeState, look: Look) -> list[Text]:
    """Return a row for each source, or all in one line where there is little room."""
    if look.narrow:
        return _collapsed(state, look)
    rows, ends = [], []
    for source in state.sources:
        live = source.live
        if live is None:
            cells = [line_of(_waiting(source)), line_of("")]
            ends.append(partial(_first_that_fits, _awaited(state, source)))
        else:
            cells = [line_of(rate_text(live)), age_of(live)]
            end = losses_cell(replace(live, counters=_frames_lost(live.counters)))
            for text in _growing(source):
                end.append(f"; {text}", "not bold default")
            ends.append(partial(_in_lines, end))
        rows.append([line_of(source.name), _state_cell(state, source), *cells])
    return table_lines(_SOURCE_COLUMNS, rows, ("lost", ends), look.width)


def _frames_lost(counters: Counters) -> Counters:
    """Leave the bytes out that were skipped, where frames are lost too: they are of those, as a rule."""
    frames = replace(counters, skipped_bytes=0)
    return frames if lost_anything(frames) else counters


def _first_that_fits(texts: Sequence[str], room: int) -> list[Text]:
    """Return the first of some texts, each shorter than the one before, that fits into one line; else the last."""
    return wrapped(next((text for text in texts if len(text) <= room), texts[-1]), max(room, 1), most=3)


def _in_lines(text: Text, room: int) -> list[Text]:
    """Break a cell into three lines at most."""
    return wrapped(text, max(room, 1), most=3)


def _state_cell(state: RangeState, source: RangeSource) -> Text:
    if source.state == "live":
        recording = state.state == "recording"
        return line_of("recording" if recording else "live", "bold red" if recording else "green")
    if source.live is None:
        return line_of(source.state, "bold cyan" if source.awaited else "")
    return line_of(source.state.upper(), "bold red")


def _growing(source: RangeSource) -> list[str]:
    return [f"{visible(name)} grows, {size_text(size)}" for name, size in source.growing]


def _waiting(source: RangeSource) -> str:
    """Name the shot that has waited longest for a file of a source, and count the others."""
    if not source.awaited:
        return "none awaited"
    first, more = source.awaited[0], len(source.awaited) - 1
    return f"{first} +{more} wait" if more else f"{first} waits"


def _awaited(state: RangeState, source: RangeSource) -> list[str]:
    """Say where the files of a source are waited for, since when, how long yet, what has come; ever shorter texts."""
    if state.watched is None:
        return ["no folder is watched: --watch FOLDER", "no folder is watched"]
    where = f"in {visible(folder_text(state.watched, most=24))}{' (made)' if state.folder_made else ''}"
    if not source.awaited and not source.growing:
        return [f"{where}; last {visible(source.last_file)}", where] if source.last_file else [where]
    waited = "" if source.waited_s is None else f" for {source.waited_s:.0f} s"
    left = "" if source.left_s is None else f", {source.left_s:.0f} s left"
    long, short = (f"{where}{one}{left}" for one in (waited, ""))
    if not source.growing:
        return [long, short]
    size = size_text(sum(size for _, size in source.growing))
    return [
        "; ".join([long, *_growing(source)]),
        f"{long}; {size} so far",
        f"{short}; {size} so far",
        f"{short}; {size}",
    ]


def _collapsed(state: RangeState, look: Look) -> list[Text]:
    """Return all sources in as few lines as they need: those that are well together, each other one by itself."""
    well = [source.name for source in state.sources if source.state == "live"]
    parts: list[tuple[str, str]] = []
    if well:
        parts.append((f"{' '.join(map(visible, well))} {'recording' if state.state == 'recording' else 'live'}", ""))
    for source in state.sources:
        name = visible(source.name)
        if source.live is None and (source.awaited or source.growing):
            left = "" if source.left_s is None else f", {source.left_s:.0f} s left"
            text = f"{name}: {_waiting(source)}{left}"
            if source.growing:
                text += f", {size_text(sum(size for _, size in source.growing))}"
            parts.append((text, "cyan" if source.awaited else ""))
        elif source.live is not None and source.state != "live":
            parts.append((f"{name} {source.state.upper()} {age_text(source.live)}", "bold red"))
    files = [source for source in state.sources if source.live is None]
    idle = [visible(source.name) for source in files if not source.awaited and not source.growing]
    if idle:
        parts.append((f"{' '.join(idle)}: none awaited", ""))
    if files and state.watched is None:
        parts.append(("no folder is watched", CAUTION))
    elif files and state.folder_made:
        parts.append((f"{visible(folder_text(state.watched, most=20))} made", ""))  # type: ignore[arg-type]
    lines = [line_of(" ")]
    for text, style in parts:
        if lines[-1].cell_len > 1 and lines[-1].cell_len + 3 + len(text) > look.width:
            lines.append(line_of(" "))
        lines[-1].append("   " if lines[-1].cell_len > 1 else "").append(text, style)
    return lines[:3]


def _lost(state: RangeState) -> list[Text]:
    """Return in one line what the sources lost; none where nothing was."""
    lost = [
        f"{visible(source.name)} {losses_of(_frames_lost(source.counters))}"
        for source in state.live
        if lost_anything(source.counters)
    ]
    return [line_of(f"lost: {'; '.join(lost)}", CAUTION)] if lost else []


def _channels(state: RangeState, look: Look, most: int) -> list[Text]:
    """Return the table of channels in so many lines at most; those with a trigger level come first."""
    if most < 2:
        return []
    bad = {source.name: source.state for source in state.sources if source.state in ("silent", "lost", "stopped")}
    ordered = sorted(state.channels, key=lambda channel: channel.triggers_at is None)
    # where there is little room, the title counts those that have no row
    fit = most - 1 if look.narrow else max(most - 2, 0)
    shown = ordered if len(ordered) < most else ordered[:fit]
    hidden = ordered[len(shown) :]
    mute = sum(channel.level is None or channel.source in bad for channel in hidden)
    more = f"+{len(hidden)} more, " + (f"{mute} of them silent" if mute else "live")
    rows, bars = [], []
    for channel in shown:
        silent = channel.source in bad or channel.level is None
        now = line_of("silent", "bold red") if silent else line_of(now_text(channel))
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


def _shots_in_order(shots: Sequence[RangeShot]) -> list[RangeShot]:
    """Put the shots that are on the way first, then the others, the newest first."""
    return [*(s for s in reversed(shots) if not s.settled), *(s for s in reversed(shots) if s.settled)]


def _shots(
    shots: Sequence[RangeShot], head: Sequence[Text], lines: Sequence[Text], rows: int, width: int
) -> list[Text]:
    """Return the rows of shots in so many lines; where not all have room, the last counts those that have none."""
    if len(head) + len(lines) <= rows:
        return [*head, *lines]
    if rows < 2:
        more = line_of(f"  +{len(lines) - 1} more", "dim")
        return [line + more if line.cell_len + more.cell_len <= width else line for line in lines[:rows]]
    kept = rows - 1 - len(head)
    if kept < 1:
        head, kept = (), rows - 1
    return [*head, *lines[:kept], _more(shots[kept:])]


def _more(shots: Sequence[RangeShot]) -> Text:
    """Count the shots that have no line of their own, by what they are."""
    counted = ", ".join(f"{count} {state}" for state, count in Counter(shot.state for shot in shots).items())
    return line_of(f"+{len(shots)} more: {counted}", "dim")


def _codes(shots: Sequence[RangeShot]) -> tuple[FigureCode, ...]:
    """Return the figures that any of the shots has."""
    there = {figure.code for shot in shots for figure in shot.figures}
    return tuple(code for code in FigureCode if code in there)


def _shot_titles(shots: Sequence[RangeShot]) -> Text:
    cells = "".join(f"{code.value:>{_figure_width(code)}}" for code in _codes(shots))
    return line_of(f"{'shot':6}{'verdict':{_VERDICT_WIDTH - 6}}{cells}  mass, kg", "bold")


def _figure_width(code: FigureCode) -> int:
    """Return the width of a column of figures; one of a compound unit is longer."""
    return _FIGURE_WIDTH + (code is FigureCode.SPEED)


def _shot_line(shot: RangeShot, look: Look, shots: Sequence[RangeShot]) -> Text:
    """Write how far a shot is, what it waits for, or its verdict with its figures and its mass."""
    style = SHOT_STYLES.get(shot.state, "cyan")
    if shot.settled and shot.age_s is not None and shot.age_s > COLOURED_S:
        style = ""
    name = visible(shot.name)
    if shot.state is ShotState.USABLE:
        return _usable_line(shot, name, look, style, shots)
    text = line_of(f"{name}{' ' if look.narrow else '  '}").append(_state_words(shot), style)
    why = f": {visible(' '.join(shot.why.split()))}" if shot.why else ""
    return text.append(why)


def _state_words(shot: RangeShot) -> str:
    if shot.state is ShotState.WAITING and shot.missing:
        left = "" if shot.left_s is None else f", {shot.left_s:.0f} s left"
        return f"waiting for {visible(', '.join(shot.missing))}{left}"
    if shot.state is ShotState.WAITING:
        return "waiting for its turn"
    if shot.state in (ShotState.CUTTING, ShotState.CONVERTING):
        return "captured, being cut" if shot.state is ShotState.CUTTING else "being converted"
    return str(shot.state).upper()


def _usable_line(shot: RangeShot, name: str, look: Look, style: str, shots: Sequence[RangeShot]) -> Text:
    count = 0 if shot.verdict is None else len(shot.verdict.warned)
    plural = "" if count == 1 else "s"
    warnings = (f", {count} warn" if look.narrow else f", {count} warning{plural}") if count else ""
    of_figures = {figure.code: figure for figure in shot.figures}
    if look.narrow:
        text = line_of(f"{name} ").append("usable", style).append(warnings, "yellow" if count and style else "")
        figures = [_figure(one) for code, one in of_figures.items() if code is not FigureCode.SPEED]
        return text.append("".join(f"  {one}" for one in figures)).append_text(_mass(shot, "  ", " kg", short=True))
    text = line_of(f"{name:4}  ").append("usable", style).append(warnings, "yellow" if count and style else "")
    text.align("left", _VERDICT_WIDTH)
    for code in _codes(shots):
        text.append(f"{_figure(of_figures[code]) if code in of_figures else '-':>{_figure_width(code)}}")
    mass = _mass(shot, "  ", "", short=False)
    fits = text.cell_len + mass.cell_len <= look.width
    return text.append_text(mass if fits else _mass(shot, "  ", "", short=True))


def _figure(figure: RangeFigure) -> str:
    return engineering(figure.value, figure.unit)


def _mass(shot: RangeShot, before: str, unit: str, *, short: bool) -> Text:
    """Write a mass and half the width of its interval; what speaks against it in a word."""
    if shot.mass is None:
        return line_of(f"{before}mass to come" if shot.mass_to_come else "", "cyan")
    low, high = shot.mass["U95"]
    places = mass_decimals(shot.mass["u"], 1)
    text = line_of(f"{before}{shot.mass['value']:.{places}f} +- {(high - low) / 2:.{places}f}{unit}")
    if not shot.mass["valid"]:
        return text.append(" NOT VALID", "bold red")
    return text.append((" prov." if short else " provisional") if shot.provisional else "", "yellow")


def _words(state: RangeState, look: Look, room: int) -> list[Text]:
    """Return reasons and warnings of the shots in words, the newest first, then the newest notices."""
    lines: list[Text] = []
    for shot in reversed(state.shots):
        verdict = shot.verdict
        against = [] if shot.mass is None or shot.mass["valid"] else [f"mass NOT VALID: {shot.mass['reason']}"]
        texts = [*against, *(() if verdict is None else (*verdict.reasons, *verdict.warned))]
        if shot.problem and shot.problem not in texts:
            texts.insert(0, shot.problem)
        if texts:
            counted = "" if verdict is None else verdict.counted
            lines.append(line_of(f"shot {visible(shot.name)}: {shot.state}{counted}", "bold"))
            for text in texts:
                lines += wrapped(f"- {text}", look.width, indent=2)
    if not lines:
        lines.append(line_of("no shot has a warning", "bold"))
    if state.notices and len(lines) + 2 < room:
        lines.append(line_of("what happened, the newest first", "bold"))
        for notice in reversed(state.notices):
            lines += wrapped(notice.line, look.width, indent=2)
    if len(lines) > room > 0:
        file = f"{visible(folder_text(state.out, most=30))}ID.h5"
        lines[room - 1 :] = [line_of(f"+{len(lines) - room + 1} more lines: `recoil-daq show {file}`", "dim")]
    return lines[:room]


def _shared(room: int, wanted: Mapping[str, int]) -> dict[str, int]:
    """Share out rows to sections."""
    rows = dict(wanted)
    for section, least in _GIVING_WAY:
        excess = sum(rows.values()) - room
        if excess <= 0:
            break
        rows[section] = max(min(rows[section], least), rows[section] - excess)
    return rows
