"""The picture of the armed screen: a function of the range's state and of the terminal, and of nothing else."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from recoil_acquisition.errors import visible
from recoil_daq.live.next_step import next_step
from recoil_daq.live.notice_board import Notice
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.screen.plain_log import UNSYNCED_S
from recoil_daq.live.screen.screen_cells import (
    NOW,
    PEAK,
    SPAN,
    TRIGGER,
    clock_text,
    disk_left,
    size_text,
)
from recoil_daq.live.screen.screen_channels import channel_lines
from recoil_daq.live.screen.screen_look import CAUTION, NARROW, WARNING, Look
from recoil_daq.live.screen.screen_shots import (
    newest_verdict,
    shot_block,
    shot_lines,
    shot_titles,
    shots_in_order,
    verdict_lines,
    words_of,
)
from recoil_daq.live.screen.screen_sources import lost_lines, source_lines
from recoil_daq.live.screen.screen_table import line_of, wrapped
from recoil_daq.live.shot import ShotState
from recoil_daq.live.shots.mass_work import campaign_line

if TYPE_CHECKING:
    from rich.text import Text

_NOTICES = 3
_MOST_ALERT = 5
FRESH_S = 60.0
"""Age of the newest notice, s, up to which channels give way to it: its remedy stands at its end."""
_GIVING_WAY = (
    ("notices", 2), ("shots", 4), ("channels", 8), ("gaps", 0), ("shots", 2), ("channels", 7), ("campaign", 0),
    ("shots", 1), ("channels", 3), ("notices", 1), ("lost", 0), ("channels", 0), ("notices", 0), ("shots", 0),
)  # fmt: skip
"""Sections that lose rows where there are too few, in this order, and how many rows each keeps."""

_ASCII = str.maketrans({NOW: "#", SPAN: "=", TRIGGER: "|", PEAK: "^", "·": ".", "µ": "u"})
STATE_STYLES = {
    "armed": "bold reverse green",
    "recording": "bold reverse red",
    "disarmed": "bold reverse yellow",
    "stopped": "bold reverse",
}


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
    state = state.as_read()
    verdict = None if look.words else newest_verdict(state)
    seen_far = [] if verdict is None else verdict_lines(verdict, look)
    top = [*_head(state, look, brief=verdict is not None), *seen_far]
    top += source_lines(state, replace(look, brief=verdict is not None))
    bottom = _bottom(state, look)
    room = max(look.height - 1 - len(top) - len(bottom), 0)
    newest = 1 + (state.notices[-1].number if state.notices else 0)
    if look.words:
        lines, first = words_of(state, look, room), newest
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
    shots = shots_in_order(state.shots)
    head = [] if look.narrow or not any(shot.figures for shot in shots) else [shot_titles(shots)]
    rows = [shot_block(shot, look, shots) for shot in shots]
    lost = lost_lines(state) if look.narrow else []
    together = "" if state.campaign is None else campaign_line(state.campaign, brief=True)
    campaign = wrapped(together, look.width, most=2) if together else []
    new = [notice for notice in state.notices if notice.number > look.printed]
    notices = [(notice, wrapped(notice.line, look.width, style="dim")) for notice in new[-_NOTICES:]]
    wanted = {
        "channels": 1 + len(state.channels), "shots": len(head) + sum(map(len, rows)), "campaign": len(campaign),
        "lost": len(lost), "notices": sum(len(lines) for _, lines in notices),
    }  # fmt: skip
    wanted["gaps"] = 0 if look.narrow else 1 + bool(rows or campaign) + bool(notices)
    newest_rows = len(notices[-1][1]) if notices and _is_fresh(notices[-1][0], state.utc) else 0
    given = _shared(room, wanted, newest_rows)
    shown, first = _newest(notices, given["notices"], newest)
    sections = [
        channel_lines(state, look, given["channels"]),
        [
            *shot_lines(shots, head, rows, given["shots"], look.width),
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
            break  # half of one would lack its remedy: it is printed above the picture
        shown, first = [*lines, *shown], notice.number
    return shown, first


def _head(state: RangeState, look: Look, *, brief: bool) -> list[Text]:
    """Return the state and what concerns the whole session, on as many lines as that takes.

    Parameters
    ----------
    brief
        Whether what is to be done about the last shot stands elsewhere.
    """
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
        lines += wrapped(f" {state.alert}", look.width, style="bold white on red", most=_MOST_ALERT, fill=True)
    step = next_step(state)
    if not brief and any(shot.name == step.about and shot.settled for shot in state.shots):
        lines += wrapped(f" next: {step.text}", look.width, style="bold", most=_MOST_ALERT)
    if state.cautions:
        lines += wrapped("; ".join(state.cautions), look.width, style=CAUTION, most=2)
    return lines


def _bottom(state: RangeState, look: Look) -> list[Text]:
    """Return the question that is to be answered, or the keys."""
    if state.asked:
        return wrapped(f" {state.asked}", look.width, style="bold black on yellow", most=3, fill=True)
    if state.state == "stopped":
        gives_up = "q or Ctrl-C gives up what is not" if look.has_keys else "Ctrl-C again gives up what is not"
        return [line_of(f" completing the shots; {gives_up} ", "reverse")]
    if not look.has_keys:
        return [line_of(" no keys here: Ctrl-C quits ", "reverse")]
    words = "w back" if look.words else "w words"
    waits = any(shot.state is ShotState.WAITING and shot.missing for shot in state.shots)
    of_shot = "x exclude  l note  " if state.shots else ""
    if newest_verdict(state) is not None:
        keys = f"space seen  {of_shot}m mass"
    elif look.width < NARROW and waits:
        keys = "c goes on without it  a arm  d disarm"
    elif look.width < NARROW:
        keys = "a arm  d disarm  t trigger  m mass"
    else:
        keys = f"a arm  d disarm  t trigger  m added mass  {of_shot}".rstrip()
    return [line_of(f" {keys}  {words}  q quit ", "reverse")]


def _shared(room: int, wanted: Mapping[str, int], newest: int) -> dict[str, int]:
    """Share out rows to sections; the newest notice, of so many rows, is whole while anything else can give way."""
    rows = dict(wanted)
    for section, few in _GIVING_WAY:
        least = max(few, newest) if section == "notices" and few else few
        excess = sum(rows.values()) - room
        if excess <= 0:
            break
        rows[section] = max(min(rows[section], least), rows[section] - excess)
    return rows


def _is_fresh(notice: Notice, utc: str) -> bool:
    """Return whether a notice is so new that it is to be read."""
    now, given = (dt.datetime.fromisoformat(one) for one in (utc, notice.utc))
    return abs((now - given).total_seconds()) < FRESH_S
