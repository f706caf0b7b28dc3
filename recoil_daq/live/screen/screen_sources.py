"""Sources on the armed screen: a row for each, or all in one line; what they lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from recoil_acquisition.devices.device import Counters
from recoil_acquisition.errors import visible
from recoil_daq.live.range_state import RangeSource, RangeState
from recoil_daq.live.screen.screen_cells import (
    age_of,
    age_text,
    folder_text,
    losses_cell,
    rate_text,
    size_text,
)
from recoil_daq.live.screen.screen_look import CAUTION, Look
from recoil_daq.live.screen.screen_table import NAME_WIDTH, Column, line_of, table_lines, wrapped
from recoil_daq.live.shot import losses_of, lost_anything

if TYPE_CHECKING:
    from rich.text import Text

_SOURCE_COLUMNS = (
    Column("source", most=NAME_WIDTH), Column("state", least=9), Column("rate", least=13),
    Column("last data", right=True, least=9),
)  # fmt: skip

_SHORT: Mapping[str, str] = {"not understood": "NONE GOOD"}
"""States whose own words are wider than their column."""


def source_lines(state: RangeState, look: Look) -> list[Text]:
    """Return a row for each source, or all in one line where there is little room."""
    if look.narrow or look.brief:
        return _collapsed(state, look)
    rows, ends = [], []
    for source in state.sources:
        live = source.live
        if live is None:
            cells = [line_of(_waiting(source)), line_of("")]
            ends.append(partial(_first_that_fits, _awaited(state, source)))
        else:
            ended = state.state == "stopped" and not live.error
            cells = [line_of(""), line_of("")] if ended else [line_of(rate_text(live)), age_of(live)]
            end = losses_cell(replace(live, counters=_frames_lost(live.counters)))
            for text in _growing(source):
                end.append(f"; {text}", "not bold default")
            ends.append(partial(_in_lines, end))
        rows.append([line_of(source.name), _state_cell(state, source), *cells])
    return table_lines(_SOURCE_COLUMNS, rows, ("lost", ends), look.width)


def _collapsed(state: RangeState, look: Look) -> list[Text]:
    """Return all sources in as few lines as they need: those that are well together, each other one by itself."""
    ended = state.state == "stopped"
    well = [s.name for s in state.sources if s.live is not None and (s.state == "live" or (ended and not s.live.error))]
    parts: list[tuple[str, str]] = []
    if well:
        together = state.state if state.state in ("recording", "stopped") else "live"
        parts.append((f"{' '.join(map(visible, well))} {together}", ""))
    for source in state.sources:
        name = visible(source.name)
        if source.live is None and (source.awaited or source.growing):
            left = "" if source.left_s is None else f", {source.left_s:.0f} s left"
            text = f"{name}: {_waiting(source)}{left}"
            if source.growing:
                text += f", {size_text(sum(size for _, size in source.growing))}"
            parts.append((text, "cyan" if source.awaited else ""))
        elif source.live is not None and source.name not in well:
            parts.append((f"{name} {_bad(source)} {age_text(source.live)}", "bold red"))
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
    if state.state == "stopped" and not source.live.error:
        return line_of(source.state)
    return line_of(_bad(source), "bold red")


def _bad(source: RangeSource) -> str:
    """Return the word for a state that is not well."""
    return _SHORT.get(source.state, source.state.upper())


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


def lost_lines(state: RangeState) -> list[Text]:
    """Return in one line what the sources lost; none where nothing was."""
    lost = [
        f"{visible(source.name)} {losses_of(_frames_lost(source.counters))}"
        for source in state.live
        if lost_anything(source.counters)
    ]
    return [line_of(f"lost: {'; '.join(lost)}", CAUTION)] if lost else []
